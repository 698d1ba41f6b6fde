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
        return importlib.import_module(f"{_package()}.rk").DOP853
    except (ImportError, AttributeError):
        return importlib.import_module("scipy.integrate").DOP853


def _package() -> str:
    """Return the name of a package whose modules are scipy's files of integrators."""
    scipy = find_spec("scipy")
    if scipy is None or scipy.submodule_search_locations is None:
        raise ImportError("scipy is no package")
    package = ModuleType(ALIAS)
    package.__path__ = [str(Path(folder, FOLDER)) for folder in scipy.submodule_search_locations]
    sys.modules.setdefault(ALIAS, package)
    return ALIAS


EVALUATIONS = 12
"""The rates are evaluated so many times in a step, three more times where states within it are asked for."""


class _TooManyStepsError(Exception):
    """More steps would be needed than were allowed."""


@cache
def load_in_background() -> None:
    """Begin to load the integrator, once, while a solver process works."""
    threading.Thread(target=dop853, daemon=True).start()


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
    if not np.isfinite(start).all():
        return np.full((len(start), len(times)), np.nan)
    bounded = _bounded(rates, most_steps * EVALUATIONS)
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # rates that are no numbers shorten the step, until it fails
            solver = dop853()(bounded, times[0], start, times[-1], rtol=relative, atol=absolute, first_step=first_step)
            return _flown(solver, start, times)
    except _TooManyStepsError:
        return np.full((len(start), len(times)), np.nan)


def _flown(solver: Any, start: Array, times: Array) -> Array:  # Any: untyped in scipy
    """Let an integrator take its steps; return the states at the times, NaN at those that it does not reach."""
    states, reached = np.full((len(start), len(times)), np.nan), 1
    states[:, 0] = start
    while True:
        solver.step()
        status: str = solver.status
        if status == "failed":
            return states
        passed = int(np.searchsorted(times, float(solver.t), side="right"))
        if len(times) > 2 and passed > reached:
            states[:, reached:passed] = solver.dense_output()(times[reached:passed])
            reached = passed
        if status == "finished":
            if len(times) == 2:  # both ends are there without interpolation
                states[:, -1] = solver.y
            return states


def _bounded(rates: Callable[[float, Array], Array], most: int) -> Callable[[float, Array], Array]:
    """Return the same rates, which raise an error when they are evaluated once more than so many times."""
    count = 0

    def counted(time: float, state: Array) -> Array:
        nonlocal count
        count += 1
        if count > most:
            raise _TooManyStepsError
        return rates(time, state)

    return counted
