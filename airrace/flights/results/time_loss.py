"""Where the time went: what costs the slower of two flights its time, leg by leg and cause by cause, in words.

At the same share `s` of its way `L` through a leg a flight takes `1/V` per metre. What is lost by speed is, with
`K = (L + L') / (2 V V' (V + V'))`, exactly `int K (V^2 - V'^2) ds`, and the speed follows from the energy:

    V(s)^2 = V(0)^2 - 2 g0 (h(s) - h(0)) - 2 int D_L/m L ds + the rest

So the loss by speed is the sum of four: of the speed at the start, the height climbed, the drag of lift `D_L` by
the aircraft's polar, where the load factor is known better than from smoothed positions, and the rest of the energy:
power, other drag, wind. With the loss by the way they add up to the loss of the
leg, all legs to the difference of the race times, and every part changes its sign when the flights change places.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

import numpy as np

from airrace.flights.results.comparison import (
    SHARES,
    Comparison,
    Difference,
    LegComparison,
    LegMeasure,
    compare_flights,
    differences,
    is_vague,
)
from airrace.flights.results.flight import Flight, Leg, way
from airrace.model.environment import atmosphere_parameters, density, g0
from airrace.optimal_control.quantities import KNOT
from airrace.optimal_control.trajectory import Array

LEGS_MAX = 3
"""The number of legs that are reported."""
LOSS_MIN = 0.02
"""The smallest loss that is reported, s; passings of good logs are known to 5 to 10 ms."""
CAUSE_SHARE = 0.25
"""The share of the loss of a leg from which on a cause is reported, or what is won back by one."""
CAUSE_MIN = 0.015
"""The least such loss, s."""
CAUSES_MAX = 2
"""The greatest number of causes of a leg."""
DIFFERENCES_MAX = 3
"""The greatest number of differences that are reported of a cause."""
TURN_ENDS = math.radians(20.0)
"""The angle by which the path has turned where a turn begins, and is still to turn where it ends, rad; directions of
smoothed logs are known to one or two degrees."""


class Cause(Enum):
    """A cause of a loss on a leg."""

    WAY = "way"
    ENTRY = "entry_speed"
    HEIGHT = "height"
    LIFT = "drag_of_lift"
    ENERGY = "energy"


WORDS = {
    Cause.WAY: ("a longer way", "a shorter way"),
    Cause.ENTRY: ("a slower entry", "a faster entry"),
    Cause.HEIGHT: ("climbing", "descending"),
    Cause.LIFT: ("more drag of lift", "less drag of lift"),
    Cause.ENERGY: ("a greater loss of energy", "a smaller loss of energy"),
}
"""The words for each cause where it costs time, and where it gains some."""


@dataclass(frozen=True)
class Loss:
    """What the slower flight loses on a leg.

    Attributes:
        leg: in both flights; the other one is the slower.
        parts: what it loses by each cause, s; they add up to the loss.
        facts: what it flies otherwise that explains a cause.
        leaving: how much slower it leaves, if it does.
    """

    leg: LegComparison
    parts: Mapping[Cause, float]
    facts: Mapping[Cause, tuple[Difference, ...]]
    leaving: tuple[Difference, ...]

    @property
    def amount(self) -> float:
        """The time that is lost on the leg, s."""
        return self.leg.difference

    @property
    def causes(self) -> tuple[Cause, ...]:
        """The causes that are reported, the greatest first."""
        ranked = sorted(self.parts, key=lambda part: -self.parts[part])
        return tuple(cause for cause in ranked if self.parts[cause] >= self._least)[:CAUSES_MAX]

    @property
    def _least(self) -> float:
        return max(CAUSE_SHARE * self.amount, CAUSE_MIN)

    @property
    def text(self) -> str:
        """The loss in words."""
        clauses: list[str] = []
        for cause in self.causes:
            facts = ", ".join(fact.text for fact in self.facts[cause])
            clauses.append(f"{self.parts[cause]:.2f} s by {WORDS[cause][0]}{f' ({facts})' if facts else ''}")
        least = min(self.parts, key=lambda part: self.parts[part])
        if -self.parts[least] >= self._least:
            clauses.append(f"{-self.parts[least]:.2f} s won back by {WORDS[least][1]}")
        clauses += [fact.text for fact in self.leaving]
        text = f"{self.amount:.2f} s from {self.leg.reference.before.name} to {self.leg.name}"
        return f"{text}: {'; '.join(clauses)}" if clauses else text


@dataclass(frozen=True)
class TimeLoss:
    """Where the slower of two flights has lost its time.

    Attributes:
        comparison: the slower one compared with the faster.
        losses: of all legs that both completed, in race order; negative where the slower one wins.
    """

    comparison: Comparison
    losses: tuple[Loss, ...]

    @property
    def costliest(self) -> tuple[Loss, ...]:
        """The losses that are reported, the greatest first."""
        ranked = sorted(self.losses, key=lambda loss: -loss.amount)[:LEGS_MAX]
        return tuple(loss for loss in ranked if loss.amount >= LOSS_MIN)

    @property
    def title(self) -> str:
        """The heading of the losses."""
        count = len(self.costliest)
        number = {1: "one thing that costs", 2: "two things that cost", 3: "three things that cost"}.get(count, "")
        against = self.comparison.reference.label
        return f"{number} {self.comparison.flight.label} most against {against}" if count else ""


def time_loss(comparison: Comparison) -> TimeLoss:
    """Return where the slower one of two flights has lost its time; the other one, if neither is."""
    if comparison.difference < 0.0:
        comparison = compare_flights(comparison.flight, comparison.reference)
    reference, other = comparison.reference, comparison.flight
    losses: list[Loss] = []
    comparable = all(
        "chi" in flight for flight in (reference, other)
    )  # without its course over ground a flight has no causes
    for leg in comparison.legs:
        if comparable and leg.reference.is_complete and leg.flight.is_complete:
            pair = reference, leg.reference, other, leg.flight
            facts = {cause: differences(*pair, measures, DIFFERENCES_MAX) for cause, measures in FACTS.items()}
            losses.append(Loss(leg, loss_parts(comparison, leg), facts, differences(*pair, (_LEAVING,), 1)))
    return TimeLoss(comparison, tuple(losses))


def loss_along(comparison: Comparison) -> tuple[Array, Array]:
    """Return places of the other flight, north and east, m, shape (n, 2), and the local rate of loss, shape (n,).

    The rate is that of time by way of the reference, s/m; NaN on legs that one of them lacks.
    """
    places, rates = [np.zeros((0, 2))], [np.zeros(0)]
    lost = comparison.progress.difference
    for number, leg in enumerate(comparison.legs):
        if leg.reference.is_complete and leg.flight.is_complete:
            share = _shares(comparison.flight, leg.flight)
            places.append(np.stack([np.interp(SHARES, share, comparison.flight[x][leg.flight.rows]) for x in "xy"], 1))
            first, length = number * (len(SHARES) - 1), float(np.diff(comparison.progress.passings)[number])
            rates.append(np.gradient(lost[first : first + len(SHARES)], SHARES * length))
        places.append(np.full((1, 2), np.nan))
        rates.append(np.full(1, np.nan))
    return np.concatenate(places), np.concatenate(rates)


def _shares(flight: Flight, leg: Leg) -> Array:
    along = way(flight, leg)
    return along / along[-1]


def loss_parts(comparison: Comparison, leg: LegComparison) -> dict[Cause, float]:
    """Return what a complete leg costs by each cause, s; negative where the other flight wins by it."""
    (V, h, W, L), (V_other, h_other, W_other, L_other) = (
        _energies(flight, flight_leg)
        for flight, flight_leg in ((comparison.reference, leg.reference), (comparison.flight, leg.flight))
    )
    K = 0.5 * (L + L_other) / (V * V_other * (V + V_other))

    def lost(squares: Array | float) -> float:
        return float(np.trapezoid(K * squares, SHARES))

    entry = lost(V[0] ** 2 - V_other[0] ** 2)
    height = lost(2.0 * g0 * ((h_other - h_other[0]) - (h - h[0])))
    vague = any(is_vague(flight, "n_z") for flight in (comparison.reference, comparison.flight))
    lift = 0.0 if vague else lost(2.0 * (W_other - W))
    energy = leg.by_speed - entry - height - lift
    return dict(zip(Cause, (leg.by_way, entry, height, lift, energy), strict=True))


def _energies(flight: Flight, leg: Leg) -> tuple[Array, Array, Array, float]:
    """Return speed, height and the work of the drag of lift over the mass at `SHARES`, and the length of the leg."""
    along, rows = way(flight, leg), leg.rows
    V_A, n_z, height = (flight.values(name)[rows] for name in ("V_A", "n_z", "height"))
    rho = np.asarray(density(-height, atmosphere_parameters(flight.air)), np.float64).reshape(height.shape)
    body, drag = flight.aircraft.airframe, flight.aircraft.drag
    pressure = 0.5 * rho * V_A**2 * body.S
    C_L = n_z * body.m * g0 / pressure
    force = np.nan_to_num(drag.k * (C_L - drag.C_L_minD) ** 2 * pressure / body.m)
    work = np.concatenate([[0.0], np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(along))])
    share = along / along[-1]
    V, h, W = (np.interp(SHARES, share, history) for history in (flight["V_K"][rows], height, work))
    return V, h, W, float(along[-1])


def _turn(flight: Flight, leg: Leg) -> tuple[float, float]:
    """Return when the turn of a leg begins and ends, s on the flight's clock; NaN where the path hardly turns."""
    chi, gamma = flight["chi"][leg.rows], flight["gamma"][leg.rows]
    path = np.stack([np.cos(chi) * np.cos(gamma), np.sin(chi) * np.cos(gamma), np.sin(gamma)])
    begun, open_ = (np.flatnonzero(directions @ path < math.cos(TURN_ENDS)) for directions in (path[:, 0], path[:, -1]))
    if not len(begun) or not len(open_) or open_[-1] <= begun[0]:
        return math.nan, math.nan
    begin, end = flight.time[leg.rows][[begun[0], open_[-1]]].tolist()
    return begin, end


def _turn_begins(flight: Flight, leg: Leg) -> float:
    return _turn(flight, leg)[0] - leg.before.time


def _load_in_turn(half: int) -> LegMeasure:
    """Return the measure of the mean load factor in the first (0) or the second half of the turn."""

    def load(flight: Flight, leg: Leg) -> float:
        begin, end = _turn(flight, leg)
        early, late = begin + 0.5 * half * (end - begin), begin + 0.5 * (half + 1) * (end - begin)
        time = flight.time[leg.rows]
        inside = (time >= early) & (time <= late)
        return float(np.mean(flight.values("n_z")[leg.rows][inside])) if inside.any() else math.nan

    place = ("early", "late")[half]
    return LegMeasure(f"load_{place}", load, "g", 0.3, "", f"{{}} g less {place} in the turn", 1)


def _width(flight: Flight, leg: Leg) -> float:
    """Return how far a leg leads from the straight line between its passings, over ground, m; NaN without a turn."""
    if math.isnan(_turn_begins(flight, leg)):
        return math.nan
    places = np.stack([flight["x"][leg.rows], flight["y"][leg.rows]])
    chord = places[:, -1] - places[:, 0]
    offset = places - places[:, :1]
    share = np.clip(chord @ offset / max(float(chord @ chord), 1e-9), 0.0, 1.0)
    return float(np.hypot(*(offset - share * chord[:, None])).max())


def _mean(name: str, flight: Flight, leg: Leg) -> float:
    return float(np.trapezoid(flight.values(name)[leg.rows], flight.time[leg.rows]) / leg.time)


_LOAD = LegMeasure("load", lambda flight, leg: _mean("n_z", flight, leg), "g", 0.2, "{} g more on average", "", 1)
_LEAVING = LegMeasure(
    "speed_out", lambda _, leg: leg.after.value("V_K") / KNOT, "kt", 2.0, "", "leaves {} kt slower", 0
)
FACTS: Mapping[Cause, tuple[LegMeasure, ...]] = {
    Cause.WAY: (
        LegMeasure("width", _width, "m", 5.0, "the turn is {} m wider", "", 0),
        LegMeasure("turn_begins", _turn_begins, "s", 0.05, "turns in {} s later", "", 2, most=1.5),
        _load_in_turn(0),
        _load_in_turn(1),
        LegMeasure("way", lambda flight, leg: float(way(flight, leg)[-1]), "m", 3.0, "{} m more in all", "", 0),
    ),
    Cause.ENTRY: (
        LegMeasure("speed_in", lambda _, leg: leg.before.value("V_K") / KNOT, "kt", 1.0, "", "{} kt slower in", 0),
    ),
    Cause.HEIGHT: (
        LegMeasure("top", lambda flight, leg: float(flight["height"][leg.rows].max()), "m", 3.0, "{} m higher", "", 0),
    ),
    Cause.LIFT: (_LOAD,),
    Cause.ENERGY: (
        _LOAD,
        LegMeasure(
            "throttle", lambda flight, leg: 100.0 * _mean("delta_T", flight, leg), "%", 3.0, "", "{} % less throttle", 0
        ),
    ),
}
"""What explains each cause; only what costs time is reported."""
