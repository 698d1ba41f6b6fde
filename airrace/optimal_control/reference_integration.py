"""The independent integrator: scipy's DOP853, which shares no code with the shooting schemes."""

import importlib
import threading
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from airrace.trajectory import Array

EVALUATIONS = 12
"""The rates are evaluated so many times in a step, three more times where states within it are asked for."""


class _TooManyStepsError(Exception):
    """More steps would be needed than were allowed."""


@cache
def load_in_background() -> None:
    """Begin to load scipy, once, while a solver process works; it takes longer than many races take to solve."""
    threading.Thread(target=importlib.import_module, args=("scipy.integrate",), daemon=True).start()


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
    # Imported here, see `load_in_background`; scipy ships no types.
    from scipy.integrate import solve_ivp as untyped  # pyright: ignore[reportUnknownVariableType]

    solve_ivp: Any = untyped  # pyright: ignore[reportUnknownVariableType]
    span = (float(times[0]), float(times[-1]))
    asked = times if len(times) > 2 else None  # both ends are there without interpolation
    bounded = _bounded(rates, most_steps * EVALUATIONS)
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # rates that are no numbers shorten the step, until it fails
            flown = solve_ivp(
                bounded, span, start, "DOP853", asked, rtol=relative, atol=absolute, first_step=first_step
            )
    except _TooManyStepsError:
        return np.full((len(start), len(times)), np.nan)
    states = np.asarray(flown.y, dtype=np.float64)
    if flown.success:
        return states if asked is not None else states[:, [0, -1]]
    reached = states.shape[1] if asked is not None else 1
    result = np.full((len(start), len(times)), np.nan)
    result[:, :reached] = states[:, :reached]
    return result


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
