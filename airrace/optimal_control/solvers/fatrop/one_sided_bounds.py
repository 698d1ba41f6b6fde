"""The sides of inequalities as fatrop gets them, weighed where their multipliers are known.

fatrop begins with multipliers of 1 for all bounds, whatever it is told, and finds those of the dynamics from them by
least squares. But an inequality may be multiplied by any factor, and its multiplier is divided by it: where a
multiplier z is known, the side `z (v - lower) >= 0` has 1. With the slack of that side pushed off its limit by the
barrier parameter mu, slack times multiplier is mu from the first iteration on, as on the way to the optimum.

A row that presses on one of its limits becomes two rows then, one for each side, for the far side has another factor.
"""

import numpy as np

from airrace.optimal_control.layout import Indices
from airrace.records import record
from airrace.trajectory import Array

LEAST_FACTOR = 1e-2
"""The smallest factor of a side (1).

The solver's tolerance holds for a side times its factor. With 1e-3 the limits of Rovinj in 5 kt of wind were kept
within 1e-5 and the solve took 17 iterations, with 1e-2 within 5e-7 in as many, and with 0.1 it took 21; 25 without
factors.
"""


RELAXED = 1e-8
"""The part of a bound, of 1 at least, by which fatrop relaxes it: its `bound_relax_factor`."""


@record
class PrimalDualPoint:
    """The point that a solve begins with, scaled.

    Attributes:
        values: of (g, w), shape (n_g + n_w,).
        multipliers: of them, positive where an upper bound is pressed on; shape (n_g + n_w,).
        barrier: the first value of the barrier parameter.
    """

    values: Array
    multipliers: Array
    barrier: float


@record
class Sides:
    """Inequalities `lower <= factors * v[items] + shifts <= upper`, in the order of their rows.

    Attributes:
        items: places in v, shape (n,); one that is there twice has its lower side first.
        copies: how many of them each row became, shape (rows,).
        factors, shifts, lower, upper: shape (n,).
    """

    items: Indices
    copies: Indices
    factors: Array
    shifts: Array
    lower: Array
    upper: Array


def plain(rows: Indices, lower: Array, upper: Array) -> Sides:
    """Return the rows as they are, nothing known: places in v and their bounds, each of shape (rows,)."""
    return Sides(rows, np.ones_like(rows), np.ones(len(rows)), np.zeros(len(rows)), lower, upper)


def weighed(rows: Indices, lower: Array, upper: Array, known: PrimalDualPoint) -> Sides:
    """Return the rows with factors by which their known multipliers become 1."""
    v, lam = known.values[rows], known.multipliers[rows]
    below = _multiplier(v - lower, np.maximum(-lam, 0.0), known.barrier)
    above = _multiplier(upper - v, np.maximum(lam, 0.0), known.barrier)
    pressing = np.maximum(below, above) >= _strongest_at_rest(known.barrier)
    apart = np.isfinite(lower) & np.isfinite(upper) & pressing
    copies = 1 + apart.astype(np.int64)
    first = np.cumsum(copies) - copies
    low, high, factors = (np.repeat(one, copies) for one in (lower, upper, np.maximum(below, above)))
    high[first[apart]], factors[first[apart]] = np.inf, below[apart]
    low[first[apart] + 1], factors[first[apart] + 1] = -np.inf, above[apart]
    factors = np.maximum(factors, LEAST_FACTOR)
    shifts = -factors * np.where(np.isfinite(low), low, high)
    return Sides(np.repeat(rows, copies), copies, factors, shifts, factors * low + shifts, factors * high + shifts)


def _multiplier(slack: Array, multiplier: Array, barrier: float) -> Array:
    """Return the multipliers with which a barrier begins: known ones, else the barrier over the slack.

    The larger one of a pair of slack and multiplier is trusted, and is at least as large as where both are equal.
    """
    equal = _strongest_at_rest(barrier)
    return np.where(multiplier >= slack, np.maximum(multiplier, equal), barrier / np.maximum(slack, equal))


def _strongest_at_rest(barrier: float) -> float:
    """Return the multiplier of a limit whose slack is as large: slack times multiplier is the barrier parameter."""
    return float(np.sqrt(barrier))


def unrelaxed(lower: Array, upper: Array) -> tuple[Array, Array]:
    """Return the bounds of inequalities that become these once fatrop has relaxed them, which no option forbids.

    A bound that is missed by 1e-8 is a complementarity error of 1e-6 where its multiplier is 100, however small
    fatrop's own errors are. Bounds that are closer to each other than that are brought together by a quarter each.
    """
    room = 0.25 * (upper - lower)

    def kept(bound: Array) -> Array:
        margin = np.minimum(RELAXED * np.maximum(1.0, np.abs(bound)), room)
        return np.where(np.isfinite(bound), margin, 0.0)

    return lower + kept(lower), upper - kept(upper)
