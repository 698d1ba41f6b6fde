"""Violations of the rules in a flown run, and the penalties for them.

A passing is measured by the conditions that its element sets to an optimum. A breach that is smaller than three
standard deviations of its measurement is told as uncertain.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airrace.dynamics.crossing import crossing_values
from airrace.frames import angle_between
from airrace.planning.race import Race
from airrace.procedure.formulation import crossing_parameters
from airrace.quantities import KNOT, Interval
from airrace.records import record
from airrace.results import Crossing, Flight
from airrace.results.clearances import distances
from airrace.results.flight import PATH_ATTITUDE
from airrace.track.course import Passage
from airrace.track.element import Element
from airrace.track.passing import Passing, Tolerant

ENDS_RACE = math.inf
"""The penalty that ends the race."""


@record
class Penalties:
    """Seconds that are added for what is broken; `ENDS_RACE` where the race is over, None where no rule says.

    Attributes:
        pylon: a wing touches a pylon.
        missed: a gate or pylon is passed outside of its pylons or on the wrong side, or not at all.
        too_high, too_low: a gate is passed above or below its legal heights.
        bank: a gate is passed with another bank than prescribed.
        climb: a gate is passed climbing or descending too steeply.
        manoeuvre: a height or an attitude is not reached.
        start_speed: the start is passed too fast.
        start_speed_end: m/s, from which on that ends the race.
        load_factor: the load factor exceeds the limit of the rules.
        load_factor_from: g, from which it counts; None for the limit that the course has.
        load_factor_time: s, for which it has to last before it counts.
        load_factor_end: g, above which the race is over at once.
        source: where the numbers come from.
    """

    pylon: float | None = None
    missed: float | None = None
    too_high: float | None = None
    too_low: float | None = None
    bank: float | None = None
    climb: float | None = None
    manoeuvre: float | None = None
    start_speed: float | None = None
    start_speed_end: float | None = None
    load_factor: float | None = None
    load_factor_from: float | None = None
    load_factor_time: float = 0.0
    load_factor_end: float | None = None
    source: str = ""


NONE_KNOWN = Penalties()
"""The penalties of a course whose rules name none."""


SURE = 3.0
"""The number of standard deviations of a measurement beyond which a breach is taken for certain.

An optimum touches its limits at many gates, and of two standard deviations every fortieth such passing exceeds them.
"""


@record
class Violation:
    """A rule that a flight would break.

    Attributes:
        passing: the name of the passage; empty for the flight as a whole.
        rule: `pylon`, `missed`, `too-high`, `too-low`, `bank`, `climb`, `course`, `manoeuvre`, `start-speed`,
            `load-factor`, `crowd`, `safety-line`, `airspace`, `floor` or `ceiling`.
        time: when, s after the start; NaN where it did not happen at a time.
        value, limit: what was flown and what is allowed, in `unit`.
        deviation: standard deviation of the value; NaN where it is not known.
        unit: `m`, `deg`, `kt`, `g` or empty.
        penalty: s; infinity where the race is over, NaN where the rules name none.
    """

    passing: str
    rule: str
    time: float
    value: float
    limit: float
    deviation: float
    unit: str
    penalty: float

    @property
    def certain(self) -> bool:
        """Whether the breach is larger than what the measurement may be wrong by."""
        return not abs(self.value - self.limit) < SURE * self.deviation  # certain where that is not known


@record
class StandardDeviations:
    """Standard deviations of what is known at a passing.

    Attributes:
        across: of the position over ground, m.
        tip: of a wing tip, m.
        up: of the height, m.
        bank, path: of the bank and of the direction of the path, rad.
        speed: m/s.
        load: of the load factor, g.
    """

    across: float
    tip: float
    up: float
    bank: float
    path: float
    speed: float
    load: float


NOT_KNOWN = StandardDeviations(*(math.nan,) * 7)


def breaches(
    flight: Flight, axes: Mapping[str, float], deviations: Mapping[str, StandardDeviations], penalties: Penalties
) -> tuple[Violation, ...]:
    """Return all rules that a flight would break, in the order of the course, then those of the flight as a whole.

    Args:
        flight: through the course.
        axes: along which axis each element was passed, rad, by the names of the passages.
        deviations: how well every passing is known, likewise.
        penalties: of the season.
    """
    found: list[Violation] = []
    for crossing in flight.crossings:
        known = deviations.get(crossing.name, NOT_KNOWN)
        found += _Judge(flight.race, crossing, axes.get(crossing.name, 0.0), known, penalties).breaches()
    worst = max(deviations.values(), key=lambda one: one.up, default=NOT_KNOWN)
    return (*found, *_load_factors(flight, penalties, worst.load), *_distances(flight, worst))


class _Judge:
    """The judge of one passing."""

    def __init__(
        self, race: Race, crossing: Crossing, axis: float, known: StandardDeviations, penalties: Penalties
    ) -> None:
        self._crossing, self._known, self._penalties = crossing, known, penalties
        self._element = by_the_rules(crossing.passage.element)
        self._span, self._axis = race.aircraft.airframe.b, axis

    def breaches(self) -> Iterator[Violation]:
        """Yield what is broken."""
        passage = self._crossing.passage
        if not self._crossing.found:
            penalty = self._penalties.missed if self._element.stands else self._penalties.manoeuvre
            yield self._breach("missed" if self._element.stands else "manoeuvre", math.nan, math.nan, "", penalty)
            return
        bounds = self._element.conditions(self._axis)
        values = self._values()
        yield from self._beside(bounds, values)
        yield from self._heights(bounds, values)
        yield from self._angles(bounds, values)
        yield from self._speed(passage)

    def _values(self) -> Mapping[str, float]:
        bank = self._element.prescribed_bank or 0.0
        if self._element.two_edged and self._crossing.value("mu") * bank < 0.0:
            bank = -bank
        frame = self._element.frame(axis=self._axis, bank=bank, span=self._span)
        q = [self._crossing.value(name) for name in PATH_ATTITUDE]
        place = (self._crossing.value("x"), self._crossing.value("y"), self._crossing.value("z"))
        seen = crossing_values(position=place, V_K=self._crossing.value("V_K"), q=q, place=crossing_parameters(frame))
        named = {name: float(value) for name, value in vars(seen).items()}
        return named | {"x": place[0], "y": place[1], "z": place[2], "bank": bank}

    def _beside(self, bounds: Mapping[str, Interval], values: Mapping[str, float]) -> Iterator[Violation]:
        """Yield a pylon that is touched, or a passing outside: of the centre, else of the worse of the wing tips."""
        outside = bounds.get("right", _between_pylons(self._element))
        if excess := _excess(values["right"], outside):
            limit = values["right"] - excess
            yield self._breach("missed", values["right"], limit, "m", self._penalties.missed, self._known.across)
            return
        tips = ("right_wing", "left_wing", "beside_right", "beside_left")
        worst = max(
            (name for name in tips if name in bounds),
            key=lambda name: abs(_excess(values[name], bounds[name])),
            default="",
        )
        if worst and (excess := _excess(values[worst], bounds[worst])):
            clearance = self._element.tolerances.clearance if isinstance(self._element, Tolerant) else 0.0
            left = clearance - abs(excess)
            penalty = self._penalties.pylon if left <= 0.0 else 0.0
            yield self._breach("pylon", left, clearance, "m", penalty, self._known.tip)

    def _heights(self, bounds: Mapping[str, Interval], values: Mapping[str, float]) -> Iterator[Violation]:
        if "height" in bounds:
            allowed = bounds["height"]
        else:
            depth = bounds.get("z", Interval())
            allowed = Interval(-depth.upper, -depth.lower)
        excess = _excess(values["height"], allowed)
        if excess:
            rule, penalty = (
                ("too-high", self._penalties.too_high) if excess > 0.0 else ("too-low", self._penalties.too_low)
            )
            if not self._element.stands:
                rule, penalty = "manoeuvre", self._penalties.manoeuvre
            yield self._breach(rule, values["height"], values["height"] - excess, "m", penalty, self._known.up)

    def _angles(self, bounds: Mapping[str, Interval], values: Mapping[str, float]) -> Iterator[Violation]:
        climb = math.degrees(math.asin(max(-1.0, min(1.0, values["climb_sine"]))))
        if excess := _excess(values["climb_sine"], bounds.get("climb_sine", Interval())):
            limit = math.degrees(math.asin(max(-1.0, min(1.0, values["climb_sine"] - excess))))
            yield self._breach("climb", climb, limit, "deg", self._penalties.climb, math.degrees(self._known.path))
        tolerance = _tolerance_of_bank(self._element)
        if tolerance is not None:
            off = math.degrees(angle_between(values["bank"], self._crossing.value("mu")))
            if abs(off) > tolerance:
                limit, known = math.copysign(tolerance, off), math.degrees(self._known.bank)
                yield self._breach("bank", off, limit, "deg", self._penalties.bank, known)
        if {"course_excess_right", "course_excess_left"} <= set(bounds) and isinstance(self._element, Tolerant):
            off = math.degrees(math.atan2(values["course_sine"], values["course_cosine"]))
            most = math.degrees(self._element.tolerances.crossing)
            if abs(off) > most:
                yield self._breach("course", off, math.copysign(most, off), "deg", None, math.degrees(self._known.path))

    def _speed(self, passage: Passage) -> Iterator[Violation]:
        speed = self._crossing.value("V_K")
        if excess := _excess(speed, passage.speed):
            limit, ends = speed - excess, self._penalties.start_speed_end
            over = ends is not None and speed > ends
            penalty = math.inf if over else self._penalties.start_speed
            known = self._known.speed / KNOT
            yield self._breach("start-speed", speed / KNOT, limit / KNOT, "kt", penalty, known)

    def _breach(
        self, rule: str, value: float, limit: float, unit: str, penalty: float | None, deviation: float = math.nan
    ) -> Violation:
        known = math.nan if penalty is None else penalty
        return Violation(self._crossing.name, rule, self._crossing.time, value, limit, deviation, unit, known)


def by_the_rules(element: Element) -> Element:
    """Return an element as the rules judge it: a passing that is optimised to a point is flown through a window."""
    if isinstance(element, Tolerant) and element.passing is Passing.POINT:
        kind: Any = element  # every kind of gate is a dataclass, but not all that is tolerant need be
        return replace(kind, passing=Passing.WINDOW)
    return element


def _excess(value: float, allowed: Interval) -> float:
    """Return by how much a value lies above (positive) or below (negative) what is allowed; 0 where it does not."""
    return max(value - allowed.upper, 0.0) + min(value - allowed.lower, 0.0)


def _between_pylons(element: Element) -> Interval:
    width = getattr(element, "width", math.inf)
    return Interval(-0.5 * width, 0.5 * width)


def _tolerance_of_bank(element: Element) -> float | None:
    """Return the tolerance of the bank, deg; None where the element leaves the bank free."""
    if element.prescribed_bank is None or not isinstance(element, Tolerant):
        return None
    return math.degrees(element.tolerances.bank)


def _load_factors(flight: Flight, penalties: Penalties, deviation: float) -> Iterator[Violation]:
    """Yield the load factor where it is too large for too long, and where it ends the race."""
    if "n_z" not in flight:
        return
    n_z, time = flight["n_z"], flight.time
    row = int(np.nanargmax(n_z))
    most, when = float(n_z[row]), float(time[row])
    if penalties.load_factor_end is not None and most > penalties.load_factor_end:
        yield Violation("", "load-factor", when, most, penalties.load_factor_end, deviation, "g", math.inf)
        return
    limit = penalties.load_factor_from or flight.course.rules.n_z.upper
    above = np.concatenate(([False], n_z > limit, [False]))
    begins, ends = np.flatnonzero(np.diff(above.astype(int)) == 1), np.flatnonzero(np.diff(above.astype(int)) == -1)
    lasting = time[ends - 1] - time[begins] if len(begins) else np.zeros(0)
    if len(lasting) and lasting.max() >= penalties.load_factor_time:
        known = math.nan if penalties.load_factor is None else penalties.load_factor
        yield Violation("", "load-factor", when, most, limit, deviation, "g", known)


def _distances(flight: Flight, known: StandardDeviations) -> Iterator[Violation]:
    """Yield what the flight came too near to: people, safety lines, borders, floor and ceiling."""
    for one in distances(flight):
        if one.kind == "pylon":
            continue
        rows = np.concatenate([_rows(flight, leg) for leg in sorted(one.legs)]) if one.legs is not None else None
        values = one.values if rows is None else one.values[rows]
        if not len(values):
            continue
        least = int(np.argmin(values))
        if values[least] < one.required:
            row = least if rows is None else int(rows[least])
            rule, when, nearest = one.kind.replace(" ", "-"), float(flight.time[row]), float(values[least])
            off = known.up if rule in ("floor", "ceiling") else known.across
            yield Violation("", rule, when, nearest, one.required, off, "m", math.nan)


def _rows(flight: Flight, leg: int) -> NDArray[np.int64]:
    before, after = flight.crossings[leg - 1], flight.crossings[leg]
    if leg == 0 or not (before.found and after.found):
        return np.zeros(0, np.int64)
    return np.flatnonzero((flight.time >= before.time) & (flight.time <= after.time))
