"""What closed-loop flights tell: counts with confidence intervals, and the scatter at every gate and on every leg."""

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv

from airrace.records import record
from airrace.safety.closed_loop import Scatter
from airrace.safety.evaluation import FlightMeasurements
from airrace.safety.pilot import PilotModel
from airrace.trajectory import Array

CONFIDENCE = 0.95
"""The confidence of intervals of counts."""
SHARES = (0.95, 0.997)
"""The shares of flights whose deviations are reported."""


def fewest(share: float) -> int:
    """Return the smallest number of flights of which one is expected beyond a quantile: of fewer it is not known."""
    return math.ceil(1.0 / min(share, 1.0 - share) - 1e-6)


QUANTITIES = ("lateral", "height", "bank", "load_factor")
"""The deviations that are reported; m, m, rad, g."""
CONTACT = ("pylon", "ground", "missed", "lost")
"""The kinds of breaches after which a race is over, and somebody may be hurt."""
LOAD = "load factor"
"""The kind of breach that is counted apart."""


@record
class Count:
    """How many flights of all did something, and between which shares their probability lies.

    Attributes:
        flights, of: the flights that did, and all.
        lower, upper: the interval of Clopper & Pearson (1934) with a confidence of 95 %.
    """

    flights: int
    of: int
    lower: float
    upper: float

    @classmethod
    def among(cls, flights: int, of: int) -> "Count":
        """Return a count with its interval."""
        tail = 0.5 * (1.0 - CONFIDENCE)
        lower = float(betaincinv(flights, of - flights + 1, tail)) if flights else 0.0
        upper = float(betaincinv(flights + 1, of - flights, 1.0 - tail)) if flights < of else 1.0
        return cls(flights, of, lower, upper)

    @property
    def share(self) -> float:
        """The share of the flights."""
        return self.flights / self.of


@record
class Deviation:
    """How far one quantity deviates from the optimum.

    Attributes:
        mean: of all flights.
        quantiles: of the absolute deviation, for `SHARES`; NaN of too few flights, see `fewest`.
        linear: standard deviation by the linear covariance; NaN where it is not known.
    """

    mean: float
    quantiles: tuple[float, ...]
    linear: float = np.nan


@record
class Stretch:
    """A gate, or a leg.

    Attributes:
        name: of the passage, or of that in which the leg ends.
        deviations: by the names in `QUANTITIES`, and `time` (s) at gates; the largest of a leg.
        breaches: counts by kind, at gates; only kinds that occur.
    """

    name: str
    deviations: Mapping[str, Deviation]
    breaches: Mapping[str, Count]


@record
class SafetyResult:
    """Closed-loop flights along one optimum.

    Attributes:
        scatter, pilot, seed, flights: what was simulated, and how often.
        race_time: of the optimum, s.
        counts: by kind: `pylon` (the wing touches one), `ground` (a wing tip does), `missed`, `clearance`, `height`,
            `bank`, `course`, `climb`, `speed`, `tolerance` at gates; `flight clearance` (of the wing at any time),
            `floor`, `ceiling`, `crowd`, `safety line`, `airspace`; `lost`; `load factor`.
        contact: flights that touch a pylon or the ground, miss a gate or are lost.
        outside: flights that break anything but the load factor.
        gates, legs: the scatter.
        pylons: flights that touch each pylon, and the least distance of any, m, by its name.
        clock, envelope: the grid of the clock, s, shape (m,), and on it the quantiles 0.0015, 0.025, 0.5, 0.975 and
            0.9985 of lateral (m), height (m), bank (rad) and load factor (g), shape (5, 4, m); NaN of too few flights.
    """

    scatter: Scatter
    pilot: PilotModel
    seed: int
    flights: int
    race_time: float
    counts: Mapping[str, Count]
    contact: Count
    outside: Count
    gates: tuple[Stretch, ...]
    legs: tuple[Stretch, ...]
    pylons: Mapping[str, tuple[Count, float]]
    clock: Array
    envelope: Array

    @property
    def note(self) -> str:
        """A sentence where the pilot cannot hold the optimum; else empty."""
        lost = self.counts["lost"]
        if lost.share <= 0.5:
            return ""
        return (
            f"a pilot with a delay of {self.pilot.delay:g} s cannot hold this optimum: {lost.flights} of {lost.of} "
            "flights lose the line; a shorter delay, milder gusts or a line with more reserve would help"
        )


ENVELOPE = (0.0015, 0.025, 0.5, 0.975, 0.9985)


def breaches_by_flight(measured: FlightMeasurements) -> dict[str, NDArray[np.bool_]]:
    """Return which flights broke what, by kind; each of shape (n,)."""
    return {
        "pylon": np.asarray(measured.touched.any(axis=0)),
        **{kind: np.asarray(one.any(axis=0)) for kind, one in measured.breaches.items()},
        **measured.along,
        "lost": measured.lost,
    }


def gate_stretches(names: Sequence[str], measured: FlightMeasurements, linear: Array) -> Iterator[Stretch]:
    """Yield the scatter at every passage.

    Args:
        names: of the passages.
        measured: of all flights.
        linear: standard deviations by the linear covariance, shape (passages, 5).
    """
    count = len(measured.lost)
    for number, name in enumerate(names):
        rows = dict(zip((*QUANTITIES, "time"), zip(measured.crossed[number], linear[number], strict=True), strict=True))
        broken = {kind: int(one[number].sum()) for kind, one in measured.breaches.items()}
        yield Stretch(
            name,
            {key: _deviation(values, float(sigma)) for key, (values, sigma) in rows.items()},
            {kind: Count.among(many, count) for kind, many in broken.items() if many},
        )


def leg_stretches(
    names: Sequence[str], passings: Array, clock: Array, measured: FlightMeasurements
) -> Iterator[Stretch]:
    """Yield the largest scatter on every leg: of each quantity that at the worst place of the grid."""
    for number, name in enumerate(names[1:]):
        inside = (clock >= passings[number]) & (clock <= passings[number + 1])
        rows = measured.deviations[:, inside]
        yield Stretch(name, {key: _worst(values) for key, values in zip(QUANTITIES, rows, strict=True)}, {})


def envelope_of(measured: FlightMeasurements) -> Array:
    """Return the quantiles of `SafetyResult.envelope`."""
    with np.errstate(all="ignore"):
        return np.stack([_quantile(measured.deviations, share) for share in ENVELOPE])


def _deviation(values: Array, linear: float) -> Deviation:
    known = values[np.isfinite(values)]
    if not len(known):
        return Deviation(np.nan, (np.nan,) * len(SHARES), linear)
    return Deviation(float(known.mean()), tuple(float(_quantile(np.abs(known), one)) for one in SHARES), linear)


def _worst(values: Array) -> Deviation:
    """Return the deviation at the place where most flights are farthest off; values of shape (m, n)."""
    widest = [_quantile(np.abs(values), share) for share in SHARES]
    if not np.isfinite(widest[0]).any():
        return Deviation(np.nan, (np.nan,) * len(SHARES))
    row = int(np.nanargmax(widest[0]))
    known = values[row][np.isfinite(values[row])]
    return Deviation(float(known.mean()), tuple(_largest(one) for one in widest))


def _largest(values: Array) -> float:
    return float(np.max(values, initial=-np.inf, where=np.isfinite(values))) if np.isfinite(values).any() else np.nan


def _quantile(values: Array, share: float) -> Array:
    """Return a quantile over the flights, the last axis; those that are lost do not count, and too few are NaN."""
    count = np.isfinite(values).sum(axis=-1)
    ordered = np.sort(values, axis=-1)  # NaN last
    place = share * np.maximum(count - 1, 0)
    low = np.floor(place).astype(np.int64)
    high = np.minimum(low + 1, np.maximum(count - 1, 0))
    first, last = (np.take_along_axis(ordered, one[..., None], axis=-1)[..., 0] for one in (low, high))
    return np.where(count < fewest(share), np.nan, first + (place - low) * (last - first))
