"""The kernels of a system at once: evaluated by the machine, whether the system has been compiled or not."""

import logging

from airrace.errors import KernelError
from airrace.optimal_control.kernels import Kernels, path_functions
from airrace.optimal_control.machine import function_kernel, machine, step_kernel
from airrace.optimal_control.runge_kutta import RungeKutta
from airrace.system import System

logger = logging.getLogger(__name__)


def machine_kernels(system: System, scheme: RungeKutta) -> Kernels | None:
    """Return the kernels of a system that the machine evaluates; None where there is no machine for it."""
    found = machine()
    if found is None:
        return None
    try:
        step, path = step_kernel(found, system, scheme), path_functions(system)
        return Kernels(step, function_kernel(found, list(path.values())) if path else None, compiled=False)
    except KernelError as error:
        logger.info("%s waits for its compiled kernels: %s", system.name, error)
        return None
