"""The kernels of a system at once: evaluated by the machine, whether the system has been compiled or not."""

import logging
from collections.abc import Sequence

import casadi as ca
import numpy as np

from airrace.errors import KernelError, SolverCrash
from airrace.optimal_control.bytecode import NOTHING, bytecode
from airrace.optimal_control.kernels import Kernels, path_functions
from airrace.optimal_control.machine import Entry, Machine, function_tables, machine
from airrace.optimal_control.machine_tables import Tables
from airrace.optimal_control.mapping import Bound, Part, spread
from airrace.optimal_control.runge_kutta import RungeKutta
from airrace.optimal_control.step_tables import scheme_numbers, step_parts, step_tables
from airrace.records import record
from airrace.system import System
from airrace.trajectory import Array

logger = logging.getLogger(__name__)

FUNCTIONS = 5  # of a model: f, and Jacobian and Hessian of f and of the projection


@record
class MachineKernel:
    """A kernel that the machine evaluates, see `mapping.Callee`.

    Attributes:
        name: for messages.
        lanes: number of intervals in a call.
        sizes: of one interval's y, own, shared and lam.
        jacobian_pattern, hessian_pattern: of the derivatives.
        entries: what evaluates values, Jacobian and Hessian.
    """

    name: str
    lanes: int
    sizes: tuple[int, int, int, int]
    jacobian_pattern: ca.Sparsity
    hessian_pattern: ca.Sparsity
    entries: Sequence[Entry]

    @property
    def values(self) -> int:
        """The number of values."""
        return self.jacobian_pattern.size1()

    def mapped(self, part: Part, calls: int, threads: int) -> ca.Function:
        """Refuse what the machine does not have: functions of casadi.

        Raises:
            KernelError: always.
        """
        raise KernelError(f"{self.name} is evaluated without functions of casadi")

    def bound(self, part: Part, calls: int, threads: int, given: Sequence[Array]) -> Bound:
        """Return all calls of a function at once.

        Raises:
            SolverCrash: an argument has another size.
        """
        entry, intervals = self.entries[part], calls * self.lanes
        for place, (array, size) in enumerate(zip(given, self.sizes, strict=False)):
            if array.size != size * (calls if place == 2 else intervals):
                raise SolverCrash(f"{self.name}: argument {place} has another size")
        results = [np.zeros(intervals * size) for size in self._results(part)]
        return entry.bound(given, results, spread(calls, self.lanes, threads), calls), results

    def _results(self, part: Part) -> list[int]:
        n_y = self.sizes[0]
        if part is Part.VALUES:
            return [self.values]
        return (
            [self.values, self.jacobian_pattern.nnz()] if part is Part.JACOBIAN else [n_y, self.hessian_pattern.nnz()]
        )


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


def step_kernel(machine: Machine, system: System, scheme: RungeKutta) -> MachineKernel:
    """Return the kernel of a step.

    Raises:
        KernelError: the system has an operation that the machine does not know.
    """
    parts = step_parts(system, scheme)
    functions = [bytecode(function) for function in (parts.alone, *parts.generated)]
    functions += [NOTHING] * (FUNCTIONS - len(functions))
    tables = Tables.of(step_tables(parts), scheme_numbers(scheme), functions)
    n_x, n_p = len(system.states), len(system.parameters)
    sizes = (n_x + len(system.controls) + 1, 1, n_p, n_x)
    entries = [machine.step(tables, part) for part in Part]
    return MachineKernel("step", machine.lanes, sizes, parts.jacobian, parts.hessian, entries)


def function_kernel(machine: Machine, functions: Sequence[ca.Function]) -> MachineKernel:
    """Return the kernel of a function, of its Jacobian and its Hessian.

    Raises:
        KernelError: they have an operation that the machine does not know.
    """
    value, jacobian, hessian = functions
    y, own, shared, lam = (hessian.nnz_in(place) for place in range(4))
    entries = [machine.function(function_tables(function)) for function in functions]
    patterns = jacobian.sparsity_out(1), hessian.sparsity_out(1)
    return MachineKernel(value.name(), machine.lanes, (y, own, shared, lam), *patterns, entries)
