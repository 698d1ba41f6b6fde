"""The independent integrator: scipy's DOP853, which shares no code with the shooting schemes."""

from collections.abc import Callable
from typing import Any

import numpy as np

from airrace.trajectory import Array


def integrate(
    rates: Callable[[float, Array], Array], start: Array, times: Array, *, relative: float, absolute: float
) -> Array:
    """States at increasing `times` (n,) from `start` (m,) at the first of them; shape (m, n)."""
    # Imported here: scipy takes longer to load than many races take to solve. It ships no types.
    from scipy.integrate import solve_ivp as untyped  # pyright: ignore[reportUnknownVariableType]

    solve_ivp: Any = untyped  # pyright: ignore[reportUnknownVariableType]
    span = (float(times[0]), float(times[-1]))
    flown = solve_ivp(rates, span, start, "DOP853", times, rtol=relative, atol=absolute)
    return np.asarray(flown.y, dtype=np.float64)
