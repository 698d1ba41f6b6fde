"""The independent integrator: scipy's DOP853, which shares no code with the shooting schemes."""

from collections.abc import Callable
from typing import Any

import numpy as np

from airrace.trajectory import Array


def integrate(
    rates: Callable[[float, Array], Array], start: Array, times: Array, *, relative: float, absolute: float
) -> Array:
    """States at increasing `times` (n,) from `start` (m,) at the first of them; shape (m, n)."""
    import scipy.integrate  # here: it takes longer to load than many races take to solve

    solve_ivp: Any = scipy.integrate.solve_ivp  # pyright: ignore[reportUnknownMemberType] - scipy ships no types
    span = (float(times[0]), float(times[-1]))
    flown = solve_ivp(rates, span, start, "DOP853", times, rtol=relative, atol=absolute)
    return np.asarray(flown.y, dtype=np.float64)
