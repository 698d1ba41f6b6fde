"""The independent integrator: scipy's DOP853, which shares no code with the shooting schemes."""

import importlib
import sys
import threading
from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from airrace.trajectory import Array

ALIAS = "airrace_scipy_integrators"
"""The name under which the folder of integrators is loaded."""
FOLDER = Path("integrate", "_ivp")
"""The folder of the integrators in scipy, since its version 1.0."""


@cache
def dop853() -> Any:  # Any: untyped in scipy
    """Return scipy's class `DOP853`: from its own file, or from `scipy.integrate` where that file is elsewhere."""
    try:
        scipy = find_spec("scipy")
        if scipy is None or scipy.submodule_search_locations is None:
            raise ImportError("scipy is no package")
        package = ModuleType(ALIAS)
        package.__path__ = [str(Path(folder, FOLDER)) for folder in scipy.submodule_search_locations]
        sys.modules.setdefault(ALIAS, package)
        return importlib.import_module(f"{ALIAS}.rk").DOP853
    except (ImportError, AttributeError):
        return importlib.import_module("scipy.integrate").DOP853


@cache
def load_in_background() -> None:
    """Begin to load the integrator, once, while a solver process works."""
    threading.Thread(target=dop853, daemon=True).start()


class _TooManyStepsError(Exception):
    """More steps would be needed than were allowed."""


def integrate(
    rates: Callable[[float, Array], Array],
    start: Array,
    times: Array,
    *,
    relative: float,
    absolute: float,
    first_step: float | None = None,
    most_steps: int = 100_000,
) -> Array:
    """Integrate differential equations by the Runge-Kutta scheme DOP853 of orders 8, 5 and 3 [Hairer 1993, II.5].

    Args:
        rates: from the time and the state (m,) to the state's rates (m,).
        start: state at the first of the times, shape (m,).
        times: increasing, s; shape (n,).
        relative, absolute: tolerances of the error of a step, as a fraction of the state and in its units.
        first_step: length that is tried first, s; by default the integrator looks for one.
        most_steps: about how many steps are taken or tried at most.

    Returns:
        The states at these times, shape (m, n); NaN from where the integrator found no step that is small enough, and
        all of them where the start is not finite or more steps would be needed.
    """
    states, reached, evaluations = np.full((len(start), len(times)), np.nan), 1, 0
    if not np.isfinite(start).all():
        return states

    def counted(time: float, state: Array) -> Array:
        nonlocal evaluations
        evaluations += 1
        if evaluations > most_steps * 12:  # evaluations of the rates in a step
            raise _TooManyStepsError
        return rates(time, state)

    try:
        with np.errstate(over="ignore", invalid="ignore"):  # rates that are no numbers shorten the step, until it fails
            solver = dop853()(counted, times[0], start, times[-1], rtol=relative, atol=absolute, first_step=first_step)
            states[:, 0], status = start, "running"
            while status == "running":
                solver.step()
                status = str(solver.status)
                passed = int(np.searchsorted(times, float(solver.t), side="right"))
                if len(times) > 2 and passed > reached and status != "failed":
                    states[:, reached:passed] = solver.dense_output()(times[reached:passed])
                    reached = passed
            if len(times) == 2 and status == "finished":  # both ends are there without interpolation
                states[:, -1] = solver.y
    except _TooManyStepsError:
        states[:] = np.nan
    return states
