"""Where the time went: what costs the slower of two flights its time, and by what.

At the same share `s` of its way `L` through a leg a flight takes `1/V` per metre. What is lost by speed is, with
`K = (L + L') / (2 V V' (V + V'))`, exactly `int K (V^2 - V'^2) ds`, and the speed follows from the energy:

    V(s)^2 = V(0)^2 - 2 g0 (h(s) - h(0)) + 2 int (T - D_0 - D_L)/m L ds + the rest

So the loss by speed is the sum of parts: of the speed at the start, of the height climbed, of the drag of lift `D_L` by
the aircraft's polar, where the load factor is known better than from smoothed positions, and, where the aircraft
differ, of drag and power for their mass, both flights flown by either aircraft. What is left is the rest of the energy:
throttle, sideslip, wind, and the drag at another speed. With the loss by the way they add up to the loss of the
leg, all legs to the difference of the race times, and every part changes its sign when the flights change places.

A leg that is lost to win the next is no mistake, and one that is slow because the one before it was left slowly is no
second mistake. So a leg of which most of the loss was brought along through its first passing is one item with the leg
before it, as are two of which one is longer because the other is shorter. The speed at the start of later legs of an
item is a part of its own.
"""

import math
from collections.abc import Mapping, Sequence
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
from airrace.model.aircraft import Aircraft, aircraft_parameters
from airrace.model.dynamics.aerodynamics import thrust
from airrace.model.environment import atmosphere_parameters, density, g0
from airrace.optimal_control.quantities import KNOT
from airrace.optimal_control.trajectory import Array

ITEMS_MAX = 3
"""The number of items that are reported."""
LOSS_MIN = 0.02
"""The smallest loss that is reported, s; passings of good logs are known to 5 to 10 ms."""
PART_SHARE = 0.06
"""The share of all parts of an item, without their signs, from which on a part is reported."""
PART_MIN = 0.015
"""The least such part, and the least time that one leg passes on to the next, s."""
COMMON_LEGS_MIN = 3
"""The least number of legs of which a cause on every leg is told as one."""
DIFFERENCES_MAX = 3
"""The greatest number of differences that are reported of a cause."""
TURN_ENDS = math.radians(20.0)
"""The angle by which the path has turned where a turn begins, and is still to turn where it ends, rad; directions of
smoothed logs are known to one or two degrees."""
JOINT_ANGLE, JOINT_PLACE = math.radians(3.0), 3.0
"""The direction (rad) or place (m) by which two flights differ at a passing where one prepares what follows."""


class Cause(Enum):
    """A cause of a loss: what the pilot flies, then what the aircraft is, then the rest."""

    WAY = "way"
    ENTRY = "entry_speed"
    HEIGHT = "height"
    LIFT = "drag_of_lift"
    CARRIED = "speed_carried"
    DRAG = "aircraft_drag"
    POWER = "aircraft_power"
    ENERGY = "energy"

    @property
    def by(self) -> str:
        """Who can do something about it, one of `BY`."""
        if self is Cause.ENERGY:
            return "rest"
        return "builder" if self in (Cause.DRAG, Cause.POWER) else "pilot"


WORDS: Mapping[Cause | None, tuple[str, str]] = {
    Cause.WAY: ("a longer way", "a shorter way"),
    Cause.ENTRY: ("a slower entry", "a faster entry"),
    Cause.HEIGHT: ("climbing", "descending"),
    Cause.LIFT: ("more drag of lift", "less drag of lift"),
    Cause.CARRIED: ("less speed on the legs after it", "more speed on the legs after it"),
    Cause.DRAG: ("an aircraft with more drag for its mass", "an aircraft with less drag for its mass"),
    Cause.POWER: ("an aircraft with less power for its mass", "an aircraft with more power for its mass"),
    Cause.ENERGY: ("a greater loss of energy", "a smaller loss of energy"),
    None: ("all else", "all else"),
}
"""The words for each cause where it costs time, and where it gains some; None for those too small to be named."""

BY = ("pilot", "builder", "rest")
"""Who can do something about a cause, in the order in which causes are reported."""


@dataclass(frozen=True)
class Part:
    """A part of a loss that is reported.

    Attributes:
        cause: None for all causes that are too small to be reported.
        amount: s; negative where it wins.
        hundredths: as shown, 1/100 s; those of all parts add up to those of the loss.
        facts: what the slower flight flies otherwise that explains it.
    """

    cause: Cause | None
    amount: float
    hundredths: int
    facts: tuple[Difference, ...]


@dataclass(frozen=True)
class Loss:
    """What the slower flight loses on a leg, or on several that belong together.

    Attributes:
        legs: in both flights, in race order; the other one is the slower.
        causes: what it loses by each cause, s; they add up to the loss.
        facts: what it flies otherwise on the first leg, or where most way is lost, that explains a cause.
        leaving: how much slower it leaves a single leg, if it does.
    """

    legs: tuple[LegComparison, ...]
    causes: Mapping[Cause, float]
    facts: Mapping[Cause, tuple[Difference, ...]]
    leaving: tuple[Difference, ...]

    @property
    def amount(self) -> float:
        """The time that is lost, s."""
        return sum(leg.difference for leg in self.legs)

    @property
    def hundredths(self) -> int:
        """The time that is lost, as shown, 1/100 s."""
        return round(100.0 * self.amount)

    @property
    def begin(self) -> str:
        """The name of the passing that the first leg begins with."""
        return self.legs[0].reference.before.name

    @property
    def end(self) -> str:
        """The name of the passing that the last leg ends with."""
        return self.legs[-1].name

    @property
    def turning_point(self) -> int:
        """The number of legs after which the loss changes its sign the most: what is lost before is won back behind.

        0 where all legs lose, or all win.
        """
        so_far = np.cumsum([leg.difference for leg in self.legs])
        peak = int(np.argmax(np.abs(so_far)))
        trades = abs(float(so_far[peak])) - abs(float(so_far[-1])) >= PART_MIN
        return peak + 1 if trades else 0

    @property
    def parts(self) -> tuple[Part, ...]:
        """The parts that are reported: of pilot, builder and rest, the greatest first; at last all small ones."""
        least = max(PART_SHARE * sum(abs(amount) for amount in self.causes.values()), PART_MIN)
        ranked = sorted(self.causes, key=lambda cause: (BY.index(cause.by), -abs(self.causes[cause])))
        parts: list[Part] = []
        for cause in ranked:
            amount = self.causes[cause]
            if abs(amount) >= least:
                facts = self.facts.get(cause, ()) if amount > 0.0 else ()
                parts.append(Part(cause, amount, round(100.0 * amount), facts))
        rest = self.hundredths - sum(part.hundredths for part in parts)
        return (*parts, Part(None, self.amount - sum(part.amount for part in parts), rest, ()))


@dataclass(frozen=True)
class TimeLoss:
    """Where the slower of two flights has lost its time.

    Attributes:
        comparison: the slower one compared with the faster.
        losses: of all legs that both completed, those that belong together as one, in race order; negative where the
            slower one wins.
    """

    comparison: Comparison
    losses: tuple[Loss, ...]

    @property
    def costliest(self) -> tuple[Loss, ...]:
        """The losses that are reported, the greatest first: those with a cause that can be named."""
        ranked = sorted(self.losses, key=lambda loss: -loss.amount)
        return tuple(loss for loss in ranked if loss.amount >= LOSS_MIN and len(loss.parts) > 1)[:ITEMS_MAX]

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
    # Without its course over ground a flight has no causes.
    if not all("chi" in flight for flight in (comparison.reference, comparison.flight)):
        return TimeLoss(comparison, ())
    groups: list[list[LegComparison]] = []
    before: LegComparison | None = None
    for leg in comparison.legs:
        if not (leg.reference.is_complete and leg.flight.is_complete):
            before = None
            continue
        if before is not None and _belong_together(comparison, before, leg):
            groups[-1].append(leg)
        else:
            groups.append([leg])
        before = leg
    return TimeLoss(comparison, tuple(_loss(comparison, legs) for legs in groups))


def leg_losses(comparison: Comparison) -> tuple[Loss, ...]:
    """Return what the slower flight loses on every leg by itself, in race order; none of legs that one of them lacks.

    On each leg that is whichever of the two takes longer.
    """
    if not all("chi" in flight for flight in (comparison.reference, comparison.flight)):
        return ()
    reverse = compare_flights(comparison.flight, comparison.reference)
    losses: list[Loss] = []
    for leg, reversed_leg in zip(comparison.legs, reverse.legs, strict=True):
        if leg.reference.is_complete and leg.flight.is_complete:
            slower = (comparison, leg) if leg.difference >= 0.0 else (reverse, reversed_leg)
            losses.append(_loss(slower[0], [slower[1]]))
    return tuple(losses)


def common_causes(comparison: Comparison, other_wind: bool) -> tuple[list[Cause], list[Cause]]:
    """Return by which causes the reference loses time on every leg that both completed, and by which the other flight.

    They are those that are not of a leg: the aircraft, and the wind where it is `other_wind`. On average they cost what
    is reported of a leg. None are of fewer than three legs.
    """
    lasting = [cause for cause in Cause if cause.by == "builder" or (cause is Cause.ENERGY and other_wind)]
    known = all("chi" in flight for flight in (comparison.reference, comparison.flight))
    complete = [leg for leg in comparison.legs if leg.reference.is_complete and leg.flight.is_complete]
    if not known or len(complete) < COMMON_LEGS_MIN:
        return [], []
    parts = [loss_parts(comparison, leg) for leg in complete]

    def costs(cause: Cause, sign: int) -> bool:
        lost = [sign * causes[cause] for causes in parts]
        return min(lost) > 0.0 and sum(lost) >= PART_MIN * len(lost)

    reference, other = ([cause for cause in lasting if costs(cause, sign)] for sign in (-1, 1))
    return reference, other


def _loss(comparison: Comparison, legs: Sequence[LegComparison]) -> Loss:
    causes = loss_parts(comparison, legs[0])
    for leg in legs[1:]:
        for cause, amount in loss_parts(comparison, leg).items():
            causes[Cause.CARRIED if cause is Cause.ENTRY else cause] += amount
    longest = max(legs, key=lambda leg: leg.by_way)
    facts: dict[Cause, tuple[Difference, ...]] = {}
    for cause, measures in FACTS.items():
        leg = longest if cause is Cause.WAY else legs[0]
        facts[cause] = differences(
            comparison.reference, leg.reference, comparison.flight, leg.flight, measures, DIFFERENCES_MAX
        )
    leaving: tuple[Difference, ...] = ()
    if len(legs) == 1:
        leaving = differences(
            comparison.reference, legs[0].reference, comparison.flight, legs[0].flight, (_LEAVING,), 1
        )
    return Loss(tuple(legs), causes, facts, leaving)


def _belong_together(comparison: Comparison, before: LegComparison, leg: LegComparison) -> bool:
    """Return whether the loss on a leg follows from the leg before it."""
    brought = _brought(comparison, leg)
    if abs(brought) > max(abs(leg.difference - brought), PART_MIN):
        return True
    ways = before.by_way, leg.by_way
    trades = ways[0] * ways[1] < 0.0 and min(abs(way_lost) for way_lost in ways) >= PART_MIN
    return trades and _apart(leg)


def _brought(comparison: Comparison, leg: LegComparison) -> float:
    """Return what is lost on a leg by less energy, of speed and height, at its first passing, s."""
    path, other_path = (
        _path(flight, flight_leg)
        for flight, flight_leg in ((comparison.reference, leg.reference), (comparison.flight, leg.flight))
    )
    energy, other_energy = (0.5 * one.V[0] ** 2 + g0 * one.h[0] for one in (path, other_path))
    return float(np.trapezoid(2.0 * _weight(path, other_path) * (energy - other_energy), SHARES))


def _apart(leg: LegComparison) -> bool:
    """Return whether two flights make the first passing of a leg in other directions or at other places."""
    crossing, other_crossing = leg.reference.before, leg.flight.before
    turned = other_crossing.value("chi") - crossing.value("chi")
    angle = abs(math.remainder(turned, 2.0 * math.pi))
    place = math.dist(*((one.value("x"), one.value("y"), one.value("height")) for one in (crossing, other_crossing)))
    return angle > JOINT_ANGLE or place > JOINT_PLACE


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


@dataclass(frozen=True, eq=False)
class _Path:
    """A flight on a leg, at `SHARES` of its way: speed, height, and the length of the leg."""

    V: Array
    h: Array
    length: float


def _path(flight: Flight, leg: Leg) -> _Path:
    along = way(flight, leg)
    V, h = (np.interp(SHARES, along / along[-1], flight[name][leg.rows]) for name in ("V_K", "height"))
    return _Path(V, h, float(along[-1]))


def _weight(path: _Path, other: _Path) -> Array:
    """Return the time that is lost per share of the leg and difference of the squares of the speeds, s3/m2."""
    return 0.5 * (path.length + other.length) / (path.V * other.V * (path.V + other.V))


def loss_parts(comparison: Comparison, leg: LegComparison) -> dict[Cause, float]:
    """Return what a complete leg costs by each cause, s; negative where the other flight wins by it."""
    reference, other = comparison.reference, comparison.flight
    path, other_path = _path(reference, leg.reference), _path(other, leg.flight)
    K = _weight(path, other_path)

    def lost(squares: Array | float) -> float:
        return float(np.trapezoid(K * squares, SHARES))

    parts = dict.fromkeys(Cause, 0.0)
    parts[Cause.WAY] = leg.by_way
    parts[Cause.ENTRY] = lost(path.V[0] ** 2 - other_path.V[0] ** 2)
    parts[Cause.HEIGHT] = lost(2.0 * g0 * ((other_path.h - other_path.h[0]) - (path.h - path.h[0])))
    # Both flights, each flown by either aircraft: rows are flights, columns aircraft.
    pairs = (reference, leg.reference), (other, leg.flight)
    works = [[_works(*pair, aircraft) for aircraft in (reference.aircraft, other.aircraft)] for pair in pairs]
    (same, swapped), (other_swapped, other_same) = works
    if not any(is_vague(flight, "n_z") for flight in (reference, other)):
        parts[Cause.LIFT] = lost((other_same.lift + other_swapped.lift) - (same.lift + swapped.lift))
        parts[Cause.DRAG] = lost((other_same.lift - other_swapped.lift) + (swapped.lift - same.lift))
    parts[Cause.DRAG] += lost((other_same.drag - other_swapped.drag) + (swapped.drag - same.drag))
    parts[Cause.POWER] = lost((other_swapped.thrust - other_same.thrust) + (same.thrust - swapped.thrust))
    parts[Cause.ENERGY] = leg.difference - sum(parts.values())
    return parts


@dataclass(frozen=True, eq=False)
class _Works:
    """The work over the mass since a leg began, m2/s2: of the drag of lift, of drag without lift, of full throttle."""

    lift: Array
    drag: Array
    thrust: Array


def _works(flight: Flight, leg: Leg, aircraft: Aircraft) -> _Works:
    """Return the works along a leg at `SHARES`, as of an aircraft that flies it."""
    along, numbers = way(flight, leg), aircraft_parameters(aircraft)
    V_A, n_z, height = (flight.values(name)[leg.rows] for name in ("V_A", "n_z", "height"))
    rho = np.asarray(density(-height, atmosphere_parameters(flight.air)), np.float64).reshape(height.shape)
    pressure = 0.5 * rho * V_A**2 * numbers.S
    C_L = n_z * numbers.m * g0 / pressure
    forces = (
        numbers.k * (C_L - numbers.C_L_minD) ** 2 * pressure,
        numbers.C_D0 * pressure,
        np.asarray(thrust(1.0, V_A, rho, numbers), np.float64).reshape(height.shape),
    )
    works: list[Array] = []
    for force in forces:
        per_mass = np.nan_to_num(force / numbers.m)
        work = np.concatenate([[0.0], np.cumsum(0.5 * (per_mass[1:] + per_mass[:-1]) * np.diff(along))])
        works.append(np.interp(SHARES, along / along[-1], work))
    return _Works(*works)


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
    return LegMeasure(f"load_{place}", load, "g", 0.3, "", f"{{}} less {place} in the turn", 1)


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


_LOAD = LegMeasure("load", lambda flight, leg: _mean("n_z", flight, leg), "g", 0.2, "{} more on average", "", 1)
_LEAVING = LegMeasure("speed_out", lambda _, leg: leg.after.value("V_K") / KNOT, "kt", 2.0, "", "leaves {} slower", 0)
FACTS: Mapping[Cause, tuple[LegMeasure, ...]] = {
    Cause.WAY: (
        LegMeasure("width", _width, "m", 5.0, "the turn is {} wider", "", 0),
        LegMeasure("turn_begins", _turn_begins, "s", 0.05, "turns in {} later", "", 2, most=1.5),
        _load_in_turn(0),
        _load_in_turn(1),
        LegMeasure("way", lambda flight, leg: float(way(flight, leg)[-1]), "m", 3.0, "{} more in all", "", 0),
    ),
    Cause.ENTRY: (
        LegMeasure("speed_in", lambda _, leg: leg.before.value("V_K") / KNOT, "kt", 1.0, "", "{} slower in", 0),
    ),
    Cause.HEIGHT: (
        LegMeasure("top", lambda flight, leg: float(flight["height"][leg.rows].max()), "m", 3.0, "{} higher", "", 0),
    ),
    Cause.LIFT: (_LOAD,),
    Cause.ENERGY: (
        _LOAD,
        LegMeasure(
            "throttle", lambda flight, leg: 100.0 * _mean("delta_T", flight, leg), "%", 3.0, "", "{} less throttle", 0
        ),
    ),
}
"""What explains each cause; only what costs time is reported."""
