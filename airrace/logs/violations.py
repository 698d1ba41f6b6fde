"""Violations of the rules in a flown run, and the penalties for them.

A passing is measured by the conditions that its element sets to an optimum. A violation that is smaller than three
standard deviations of its measurement is told as uncertain.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from airrace.dynamics.crossing import crossing_values
from airrace.frames import angle_between
from airrace.planning.race import Race
from airrace.procedure.formulation import crossing_parameters
from airrace.quantities import KNOT, Interval
from airrace.records import record
from airrace.results import Crossing, Flight
from airrace.results.clearances import at_row, surroundings
from airrace.results.flight import PATH_ATTITUDE
from airrace.results.legs import legs_of
from airrace.track.element import Element
from airrace.track.gates import Passing, Tolerant

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
"""The number of standard deviations of a measurement beyond which a violation is taken for certain.

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
        """Whether the violation is larger than what the measurement may be wrong by."""
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


def violations(
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
        found += _PassingRules(flight.race, crossing, axes.get(crossing.name, 0.0), known, penalties).violations()
    worst = max(deviations.values(), key=lambda one: one.up, default=NOT_KNOWN)
    return (*found, *_load_factors(flight, penalties, worst.load), *_distances(flight, worst))


class _PassingRules:
    """The rules of one passing, at which a gate that is optimised to a point is a window."""

    def __init__(
        self, race: Race, crossing: Crossing, axis: float, known: StandardDeviations, penalties: Penalties
    ) -> None:
        element = crossing.passage.element
        self._tolerances = element.tolerances if isinstance(element, Tolerant) else None
        if isinstance(element, Tolerant) and element.passing is Passing.POINT:
            kind: Any = element  # every kind of gate is a dataclass, but not all that is tolerant need be
            element = replace(kind, passing=Passing.WINDOW)
        self._element: Element = element
        self._crossing, self._known, self._penalties = crossing, known, penalties
        self._span, self._axis = race.aircraft.airframe.b, axis

    def violations(self) -> Iterator[Violation]:
        """Yield what is broken."""
        if not self._crossing.found:
            rule, penalty = ("missed", self._penalties.missed) if self._element.stands else self._manoeuvre
            yield self._violation(rule, math.nan, math.nan, "", penalty)
            return
        bounds, values = self._element.conditions(self._axis), self._values()
        yield from self._beside(bounds, values)
        yield from self._heights(bounds, values)
        yield from self._angles(bounds, values)
        yield from self._speed()

    @property
    def _manoeuvre(self) -> tuple[str, float | None]:
        return "manoeuvre", self._penalties.manoeuvre

    def _values(self) -> Mapping[str, float]:
        """Return what conditions are of, by name, and the bank that is asked for."""
        value = self._crossing.value
        bank = self._element.prescribed_bank or 0.0
        if self._element.two_edged and value("mu") * bank < 0.0:
            bank = -bank
        frame = self._element.frame(axis=self._axis, bank=bank, span=self._span)
        place = (value("x"), value("y"), value("z"))
        q = [value(name) for name in PATH_ATTITUDE]
        values = crossing_values(position=place, V_K=value("V_K"), q=q, place=crossing_parameters(frame))
        named = {name: float(one) for name, one in vars(values).items()}
        return named | {"x": place[0], "y": place[1], "z": place[2], "bank": bank}

    def _beside(self, bounds: Mapping[str, Interval], values: Mapping[str, float]) -> Iterator[Violation]:
        """Yield a pylon that is touched, or a passing outside: of the centre, else of the worse of the wing tips."""
        half = 0.5 * getattr(self._element, "width", math.inf)
        if excess := _excess(values["right"], bounds.get("right", Interval(-half, half))):
            limit = values["right"] - excess
            yield self._violation("missed", values["right"], limit, "m", self._penalties.missed, self._known.across)
            return
        tips = (name for name in ("right_wing", "left_wing", "beside_right", "beside_left") if name in bounds)
        excess = max((abs(_excess(values[name], bounds[name])) for name in tips), default=0.0)
        if excess:
            clearance = 0.0 if self._tolerances is None else self._tolerances.clearance
            penalty = self._penalties.pylon if clearance - excess <= 0.0 else 0.0
            yield self._violation("pylon", clearance - excess, clearance, "m", penalty, self._known.tip)

    def _heights(self, bounds: Mapping[str, Interval], values: Mapping[str, float]) -> Iterator[Violation]:
        depth = bounds.get("z", Interval())
        excess = _excess(values["height"], bounds.get("height", Interval(-depth.upper, -depth.lower)))
        if excess:
            too_high, too_low = ("too-high", self._penalties.too_high), ("too-low", self._penalties.too_low)
            rule, penalty = (too_high if excess > 0.0 else too_low) if self._element.stands else self._manoeuvre
            yield self._violation(rule, values["height"], values["height"] - excess, "m", penalty, self._known.up)

    def _angles(self, bounds: Mapping[str, Interval], values: Mapping[str, float]) -> Iterator[Violation]:
        path, bank = math.degrees(self._known.path), math.degrees(self._known.bank)
        sine = values["climb_sine"]
        if excess := _excess(sine, bounds.get("climb_sine", Interval())):
            climb, limit = (math.degrees(math.asin(max(-1.0, min(1.0, one)))) for one in (sine, sine - excess))
            yield self._violation("climb", climb, limit, "deg", self._penalties.climb, path)
        if self._tolerances is None:
            return
        allowed: list[tuple[str, float, float, float | None, float]] = []
        if self._element.prescribed_bank is not None:
            off = angle_between(values["bank"], self._crossing.value("mu"))
            allowed.append(("bank", off, self._tolerances.bank, self._penalties.bank, bank))
        if {"course_excess_right", "course_excess_left"} <= set(bounds):
            off = math.atan2(values["course_sine"], values["course_cosine"])
            allowed.append(("course", off, self._tolerances.crossing, None, path))
        for rule, off, most, penalty, known in allowed:
            off, most = math.degrees(off), math.degrees(most)
            if abs(off) > most:
                yield self._violation(rule, off, math.copysign(most, off), "deg", penalty, known)

    def _speed(self) -> Iterator[Violation]:
        speed = self._crossing.value("V_K")
        if excess := _excess(speed, self._crossing.passage.speed):
            ends = self._penalties.start_speed_end
            penalty = math.inf if ends is not None and speed > ends else self._penalties.start_speed
            speeds = speed / KNOT, (speed - excess) / KNOT
            yield self._violation("start-speed", *speeds, "kt", penalty, self._known.speed / KNOT)

    def _violation(
        self, rule: str, value: float, limit: float, unit: str, penalty: float | None, deviation: float = math.nan
    ) -> Violation:
        known = math.nan if penalty is None else penalty
        return Violation(self._crossing.name, rule, self._crossing.time, value, limit, deviation, unit, known)


def _excess(value: float, allowed: Interval) -> float:
    """Return by how much a value lies above (positive) or below (negative) what is allowed; 0 where it does not."""
    return max(value - allowed.upper, 0.0) + min(value - allowed.lower, 0.0)


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
    turns = np.flatnonzero(np.diff(np.concatenate(([False], n_z > limit, [False])).astype(int)))
    lasting = time[turns[1::2] - 1] - time[turns[::2]]
    if len(lasting) and lasting.max() >= penalties.load_factor_time:
        known = math.nan if penalties.load_factor is None else penalties.load_factor
        yield Violation("", "load-factor", when, most, limit, deviation, "g", known)


def _distances(flight: Flight, known: StandardDeviations) -> Iterator[Violation]:
    """Yield what the flight came too near to: people, safety lines, borders, floor and ceiling."""
    legs = {leg.number: leg.rows for leg in legs_of(flight)}
    for one in surroundings(flight) if flight.has("x", "y", "height") else ():
        rows = np.arange(len(flight.time))
        if one.legs is not None:
            rows = np.concatenate([legs[number] for number in sorted(one.legs)])
        if len(rows):
            row = int(rows[int(np.argmin(one.values[rows]))])
            nearest = at_row(flight, one, row)
            if nearest.margin < 0.0:
                rule = one.kind.replace(" ", "-")
                off = known.up if rule in ("floor", "ceiling") else known.across
                yield Violation("", rule, nearest.time, nearest.distance, one.required, off, "m", math.nan)
