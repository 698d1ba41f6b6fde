"""Violations of the rules in a recorded run, and the penalties for them.

A passing is measured by the conditions that its element sets to an optimum. A violation that is smaller than three
standard deviations of its measurement is uncertain.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from airrace.flights.results import Flight, TimedCrossing
from airrace.flights.results.clearances import at_row, distances
from airrace.flights.results.flight import legs_of
from airrace.model.dynamics.observations import crossing_values
from airrace.model.frames import QUATERNION, angle_between
from airrace.model.track.course import StartSpeed
from airrace.model.track.element import Element
from airrace.model.track.gates import ElementWithTolerances, Passing
from airrace.optimal_control.quantities import KNOT, Interval
from airrace.procedure.formulation import crossing_parameters
from airrace.race import Race

ENDS_RACE = math.inf
"""The penalty that ends the race."""
START_SPEEDS = {StartSpeed.GROUND: "V_K", StartSpeed.TRUE: "V_A", StartSpeed.INDICATED: "V_I"}
"""The history that the limit of the speed at the start is a limit of."""


@dataclass(frozen=True)
class Penalties:
    """Seconds that are added for what is broken; `ENDS_RACE` where the race is over, None where no rule states them.

    Attributes:
        pylon: a wing touches a pylon.
        missed: a gate or pylon is passed outside of its pylons or on the wrong side, or not at all.
        too_high, too_low: a gate is passed above or below its legal heights.
        bank: a gate is passed with another bank than prescribed.
        climb: a gate is passed climbing or descending too steeply.
        manoeuvre: a height or an attitude is not reached.
        manoeuvres: the same of single kinds of elements, by the names of the kinds.
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
    manoeuvres: Mapping[str, float | None] = field(default_factory=dict[str, float | None])
    start_speed: float | None = None
    start_speed_end: float | None = None
    load_factor: float | None = None
    load_factor_from: float | None = None
    load_factor_time: float = 0.0
    load_factor_end: float | None = None
    source: str = ""


NONE_KNOWN = Penalties()
"""The penalties of a course whose rules name none."""
CERTAIN_DEVIATIONS = 5.0
"""The number of standard deviations of a measurement beyond which a violation is taken for certain.

An optimum touches its limits in a hundred places. By chance one of them is off by five deviations in one of 35,000
logs, so that less than one log in 10,000 accuses falsely.
"""


MISSED_ROWS = 30
"""The approximate number of times at which the distance from a missed element is measured."""


@dataclass(frozen=True)
class Violation:
    """A rule that a flight would break.

    Attributes:
        passing: the name of the passage; empty for the flight as a whole.
        rule: `pylon`, `missed`, `too-high`, `too-low`, `bank`, `climb`, `course`, `manoeuvre`, `start-speed`,
            `load-factor`, `obstacle`, `crowd`, `safety-line`, `airspace`, `floor` or
            `ceiling`.
        time: when, s after the start; NaN where it did not happen at a time.
        value, limit: what was measured and what is allowed, in `unit`.
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
    def deviations(self) -> float:
        """By how many standard deviations it exceeds what is allowed; 0 where that is not known."""
        excess = abs(self.value - self.limit)
        if not math.isfinite(excess + self.deviation):
            return 0.0
        return excess / self.deviation if self.deviation > 0.0 else math.inf

    @property
    def certain(self) -> bool:
        """Whether the violation is larger than what the measurement may be wrong by."""
        return self.deviations >= CERTAIN_DEVIATIONS  # never where that is not known


@dataclass(frozen=True)
class StandardDeviations:
    """Standard deviations of what is known at a passing.

    Attributes:
        across: of the position over ground, m.
        tip: of a wing tip, m.
        up: of the height, m.
        bank, path: of the bank and of the direction of the path, rad.
        speed: m/s.
        load: of the load factor, g.
        time: of the passing itself, s.
    """

    across: float
    tip: float
    up: float
    bank: float
    path: float
    speed: float
    load: float
    time: float


NOT_KNOWN = StandardDeviations(*(math.nan,) * 8)
DeviationsAt = Callable[[float], StandardDeviations]
"""How well a flight is known at a time of its clock, s."""


def violations(
    flight: Flight, axes: Mapping[str, float], deviations: DeviationsAt, penalties: Penalties
) -> tuple[Violation, ...]:
    """Return all rules that a flight would break: certain ones first, each in the order of the course.

    Args:
        flight: through the course.
        axes: along which axis each element was passed, rad, by the names of the passages.
        deviations: how well the flight is known.
        penalties: of the season.
    """
    broken_rules: list[Violation] = []
    for crossing in flight.crossings:
        certainty = deviations(crossing.time) if crossing.found else NOT_KNOWN
        if not crossing.found and (missed := _missed(flight, crossing, deviations, penalties)):
            broken_rules.append(missed)
            continue
        broken = _passing_violations(flight.race, crossing, axes.get(crossing.name, 0.0), certainty, penalties)
        for rule, value, limit, deviation, unit, penalty in broken:
            price = math.nan if penalty is None else penalty
            broken_rules.append(Violation(crossing.name, rule, crossing.time, value, limit, deviation, unit, price))
    broken_rules += [*_load_factors(flight, penalties, deviations), *_distances(flight, deviations)]
    return tuple(sorted(broken_rules, key=lambda violation: not violation.certain))


def select_violations(violations: Sequence[Violation]) -> tuple[list[Violation], str]:
    """Return the violations to be reported, certain ones first, and a sentence on the near misses beside them.

    An optimum touches its limits everywhere, and so does every good flight within what its measurement may be wrong by:
    of ten near misses the one closest to certain is reported. What the log does not hold, such as gates behind
    its end, is no near miss.
    """
    certain = [violation for violation in violations if violation.certain]
    possible = [violation for violation in violations if not violation.certain and math.isfinite(violation.value)]
    near_misses = sorted(possible, key=lambda violation: -violation.deviations)
    listed, unlisted = near_misses[: math.ceil(len(near_misses) / 10)], near_misses[math.ceil(len(near_misses) / 10) :]
    rules = Counter(violation.rule for violation in unlisted).most_common()
    words = ", ".join(f"{count} {rule}" for rule, count in rules)
    misses = "near miss is" if len(unlisted) == 1 else "near misses are"
    sentence = f"{len(unlisted)} more {misses} within what the measurement may be wrong by: {words}" if unlisted else ""
    return [*certain, *listed], sentence


def as_judged(element: Element) -> Element:
    """Return an element as it is judged: one that is optimised to a point as a window."""
    if isinstance(element, ElementWithTolerances) and element.passing is Passing.POINT:
        kind: Any = element  # every kind of gate is a dataclass, but not all that is tolerant need be
        return replace(kind, passing=Passing.WINDOW)
    return element


def height_window(element: Element, axis: float) -> Interval:
    """Return the heights at which an element may be passed, m."""
    bounds = as_judged(element).conditions(axis)
    depth = bounds.get("z", Interval())
    return bounds.get("height", Interval(-depth.upper, -depth.lower))


def _passing_violations(
    race: Race, crossing: TimedCrossing, axis: float, standard_deviations: StandardDeviations, penalties: Penalties
) -> Iterator[tuple[str, float, float, float, str, float | None]]:
    """Yield rule, value, limit, deviation, unit and penalty of all that one passing breaks."""
    element: Element = crossing.passage.element
    manoeuvre = ("manoeuvre", penalties.manoeuvres.get(element.type_name, penalties.manoeuvre))
    if not crossing.found:
        rule, penalty = ("missed", penalties.missed) if element.stands else manoeuvre
        yield rule, math.nan, math.nan, math.nan, "", penalty
        return
    tolerances = element.tolerances if isinstance(element, ElementWithTolerances) else None
    element = as_judged(element)
    bounds, bank = element.conditions(axis), element.prescribed_bank or 0.0
    if element.two_edged and crossing.value("mu") * bank < 0.0:
        bank = -bank
    value = crossing.value
    measured = crossing_values(
        position=(value("x"), value("y"), value("z")),
        V_K=value("V_K"),
        q=[value(name) for name in QUATERNION],
        place=crossing_parameters(element.frame(axis=axis, bank=bank, span=race.aircraft.airframe.b)),
        beta_K=crossing.values.get("beta_K", 0.0),
    )
    values = {name: float(var) for name, var in vars(measured).items()}

    # beside: of the centre, else of the worse of the wing tips
    right, half = values["right"], 0.5 * getattr(element, "width", math.inf)
    tips = [name for name in ("right_wing", "left_wing", "beside_right", "beside_left") if name in bounds]
    if excess := beyond(right, bounds.get("right", Interval(-half, half))):
        yield "missed", right, right - excess, standard_deviations.across, "m", penalties.missed
    elif excess := max((abs(beyond(values[name], bounds[name])) for name in tips), default=0.0):
        clearance = 0.0 if tolerances is None else tolerances.clearance
        penalty = penalties.pylon if clearance - excess <= 0.0 else 0.0
        yield "pylon", clearance - excess, clearance, standard_deviations.tip, "m", penalty

    height = values["height"]
    if excess := beyond(height, height_window(element, axis)):
        too = ("too-high", penalties.too_high) if excess > 0.0 else ("too-low", penalties.too_low)
        rule, penalty = too if element.stands else manoeuvre
        yield rule, height, height - excess, standard_deviations.up, "m", penalty

    sine, path = values["climb_sine"], math.degrees(standard_deviations.path)
    if excess := beyond(sine, bounds.get("climb_sine", Interval())):
        climb, limit = (math.degrees(math.asin(max(-1.0, min(1.0, number)))) for number in (sine, sine - excess))
        yield "climb", climb, limit, path, "deg", penalties.climb
    allowed: list[tuple[str, float, float, float, float | None]] = []
    if tolerances is not None and element.prescribed_bank is not None:
        angle = angle_between(bank, crossing.value("mu"))
        allowed.append(("bank", angle, tolerances.bank, math.degrees(standard_deviations.bank), penalties.bank))
    if tolerances is not None and {"course_excess_right", "course_excess_left"} <= set(bounds):
        angle = math.atan2(values["course_sine"], values["course_cosine"])
        allowed.append(("course", angle, tolerances.crossing, path, None))
    for rule, angle, most, deviation, penalty in allowed:
        angle, most = math.degrees(angle), math.degrees(most)
        if abs(angle) > most:
            yield rule, angle, math.copysign(most, angle), deviation, "deg", penalty

    speed = crossing.value(START_SPEEDS[race.course.rules.start_speed])
    if excess := beyond(speed, crossing.passage.speed):
        ends = penalties.start_speed_end
        penalty = math.inf if ends is not None and speed > ends else penalties.start_speed
        yield "start-speed", speed / KNOT, (speed - excess) / KNOT, standard_deviations.speed / KNOT, "kt", penalty


def beyond(value: float, allowed: Interval) -> float:
    """Return by how much a value lies above (positive) or below (negative) what is allowed; 0 where it does not."""
    return max(value - allowed.upper, 0.0) + min(value - allowed.lower, 0.0)


def _missed(
    flight: Flight, crossing: TimedCrossing, deviations: DeviationsAt, penalties: Penalties
) -> Violation | None:
    """Return how far from an element the flight went by between the passings around it; None where it is not known.

    Of all times between them that one counts at which the aircraft may have been at the element soonest: in a gap of
    the log it may have been anywhere.
    """
    element: Element = crossing.passage.element
    index = flight.crossings.index(crossing)
    before = max((crossing.time for crossing in flight.crossings[:index] if crossing.found), default=math.nan)
    after = min((crossing.time for crossing in flight.crossings[index:] if crossing.found), default=math.nan)
    rows = np.flatnonzero((flight.time > before) & (flight.time < after))
    allowed = getattr(element, "reach", 0.5 * getattr(element, "width", math.inf))
    if not element.stands or element.place is None or not len(rows):
        return None
    distances = np.hypot(flight["x"][rows] - element.place[0], flight["y"][rows] - element.place[1])
    if distances.min() <= allowed:
        return None
    penalty = math.nan if penalties.missed is None else penalties.missed
    candidates = np.unique([*range(0, len(rows), max(1, len(rows) // MISSED_ROWS)), int(np.argmin(distances))]).tolist()
    misses: list[Violation] = []
    for row in candidates:
        when, distance = float(flight.time[rows[row]]), float(distances[row])
        misses.append(
            Violation(crossing.name, "missed", when, distance, allowed, deviations(when).across, "m", penalty)
        )
    return min(misses, key=lambda miss: miss.deviations)


def _load_factors(flight: Flight, penalties: Penalties, deviations: DeviationsAt) -> Iterator[Violation]:
    """Yield the load factor where it is too large for too long, and where it ends the race."""
    if "n_z" not in flight:
        return
    n_z, time = flight["n_z"], flight.time
    highest = np.flatnonzero(n_z == np.nanmax(n_z))
    row = int(highest[len(highest) // 2])
    most, when = float(n_z[row]), float(time[row])
    deviation = deviations(when).load
    if penalties.load_factor_end is not None and most > penalties.load_factor_end:
        yield Violation("", "load-factor", when, most, penalties.load_factor_end, deviation, "g", math.inf)
        return
    limit = penalties.load_factor_from or flight.course.rules.n_z.upper
    turns = np.flatnonzero(np.diff(np.concatenate(([False], n_z > limit, [False])).astype(int)))
    lasting = time[turns[1::2] - 1] - time[turns[::2]]
    if len(lasting) and lasting.max() >= penalties.load_factor_time:
        penalty = math.nan if penalties.load_factor is None else penalties.load_factor
        yield Violation("", "load-factor", when, most, limit, deviation, "g", penalty)


def _distances(flight: Flight, deviations: DeviationsAt) -> Iterator[Violation]:
    """Yield what the flight came too near to: obstacles, people, safety lines, borders, floor and ceiling."""
    legs = {leg.number: leg.rows for leg in legs_of(flight)}
    for distance in distances(flight):
        if distance.kind == "pylon":
            continue
        rows = np.arange(len(flight.time))
        if distance.legs is not None:
            rows = np.concatenate([legs[number] for number in sorted(distance.legs)])
        rows = rows[np.isfinite(distance.values[rows])]
        if len(rows):
            row = int(rows[int(np.argmin(distance.values[rows]))])
            nearest = at_row(flight, distance, row)
            if nearest.margin < 0.0:
                rule = distance.kind.replace(" ", "-")
                certainty = deviations(nearest.time)
                deviation = certainty.up if rule in ("floor", "ceiling") else certainty.across
                yield Violation("", rule, nearest.time, nearest.distance, distance.required, deviation, "m", math.nan)
