"""Violations of the rules in a recorded run, and the penalties for them.

A passing is measured by the conditions that its element sets to an optimum. Places and heights are judged by what all
passings tell of the errors that they share (`errors`), all else by its own standard deviation. Where a measure has
several limits, more of it is never judged more mildly: a harsher rule replaces a milder one only where it is certain.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from airrace.flights.logs.errors import CommonErrors, Window
from airrace.flights.results import Flight, TimedCrossing
from airrace.flights.results.clearances import at_row, distances
from airrace.flights.results.flight import Basis, legs_of
from airrace.flights.results.penalties import ENDS_RACE, Penalties
from airrace.model.dynamics.limits import flight_limits
from airrace.model.dynamics.observations import crossing_values
from airrace.model.frames import QUATERNION, angle_between
from airrace.model.track.course import StartSpeed
from airrace.model.track.element import Element
from airrace.model.track.gates import ElementWithTolerances, Passing
from airrace.optimal_control.quantities import KNOT, Interval
from airrace.procedure.formulation import crossing_parameters

START_SPEEDS = {StartSpeed.GROUND: "V_K", StartSpeed.TRUE: "V_A", StartSpeed.INDICATED: "V_I"}
"""The history that the limit of the speed at the start is a limit of."""


CERTAIN_DEVIATIONS = 4.0
"""The number of standard deviations of a measurement beyond which a violation is taken for certain.

An optimum touches its limits in some thirty places, and errors of passings have 0.5 to 1.0 of the deviations that are
told. Of breaches beyond five deviations a threshold of five misses one in fourteen, for these are measured as less, and
four one in forty. How often it accuses falsely is measured in `docs/evidence/studies.md`.
"""
FAR_OFF = 5.0
"""The number of deviations from which on a passing is no legal one whichever of its measures tells."""
COSINE_MIN = 0.1
"""The least cosine between path and axis that is counted."""
STEEP = math.radians(80.0)
"""The steepest climb that is counted, rad."""
LOAD_SAMPLING = 0.02
"""The time between load factors that are looked at for what lasts, s."""
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


@dataclass(frozen=True, eq=False)
class FlightErrors:
    """How well a flight is known.

    Attributes:
        own: at a time, beside the errors that samples share.
        at: at a time, in all.
        common: the errors that samples share.
        offset: of the flight's clock on that of the recording, s.
    """

    own: DeviationsAt
    at: DeviationsAt
    common: CommonErrors
    offset: float = 0.0


def violations(
    flight: Flight, axes: Mapping[str, float], errors: FlightErrors, penalties: Penalties
) -> tuple[Violation, ...]:
    """Return all rules that a flight would break: certain ones first, each in the order of the course.

    Args:
        flight: through the course.
        axes: along which axis each element was passed, rad, by the names of the passages.
        errors: how well the flight is known.
        penalties: of the season.
    """
    broken_rules: list[Violation] = []
    for crossing in flight.crossings:
        if crossing.found:
            passing = _Passing(flight, crossing, axes.get(crossing.name, 0.0), errors, penalties)
            broken_rules += passing.violations()
        elif missed := _missed(flight, crossing, errors.at, penalties):
            broken_rules.append(missed)
        else:
            element: Element = crossing.passage.element
            rule, penalty = ("missed", penalties.missed) if element.stands else _manoeuvre(element, penalties)
            price = math.nan if penalty is None else penalty
            broken_rules.append(Violation(crossing.name, rule, math.nan, math.nan, math.nan, math.nan, "", price))
    broken_rules += [*_load_factors(flight, penalties, errors), *_distances(flight, errors)]
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


def is_measured(flight: Flight, name: str) -> bool:
    """Return whether a history was recorded."""
    return name in flight and flight.basis(name) is Basis.MEASURED


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


def passing_windows(flight: Flight, axes: Mapping[str, float], own: DeviationsAt, offset: float) -> list[Window]:
    """Return what the passings of a flight measure of the errors that its samples share.

    Args:
        flight: through the course.
        axes: along which axis each element was passed, rad, by the names of the passages.
        own: how well it is known beside these errors.
        offset: of the flight's clock on that of the recording, s.
    """
    windows: list[Window] = []
    for crossing in flight.crossings:
        if crossing.found and crossing.passage.element.stands:
            measured = _MeasuredPassing(flight, crossing, axes.get(crossing.name, 0.0))
            deviations = own(crossing.time)
            windows.append(measured.height_window(offset, deviations.up))
            beside = [measured.window(measured.centre, offset, deviations.across)]
            if measured.tips:
                beside.insert(0, measured.window(measured.tips, offset, deviations.tip))
            # A bank of the path is known badly, and so the tips; else they tell more, and of what is far off most.
            windows.append(max(beside, key=lambda window: min(window.excess, FAR_OFF)))
    return windows


class _MeasuredPassing:
    """The measures of a passing, and what its element allows.

    Attributes:
        element: as it is judged.
        bounds: its conditions, by name.
        values: what they are conditions of.
        bank: that it prescribes, rad.
        centre: of the aircraft to the right of the axis, and what is allowed of it, m; empty where nothing is.
        tips: likewise of the wing tips.
        clearance: of these from a pylon, m.
    """

    def __init__(self, flight: Flight, crossing: TimedCrossing, axis: float) -> None:
        race, value = flight.race, crossing.value
        self.crossing = crossing
        self.element: Element = as_judged(crossing.passage.element)
        self.bounds, self.bank = self.element.conditions(axis), self.element.prescribed_bank or 0.0
        if self.element.two_edged and value("mu") * self.bank < 0.0:
            self.bank = -self.bank
        # The race's own element, whose wing has no span where it is passed at a point.
        frame = crossing.passage.element.frame(axis=axis, bank=self.bank, span=race.aircraft.airframe.b)
        measured = crossing_values(
            position=(value("x"), value("y"), value("z")),
            V_K=value("V_K"),
            q=[value(name) for name in QUATERNION],
            place=crossing_parameters(frame),
            beta_K=crossing.values.get("beta_K", 0.0),
        )
        self.values = {name: float(var) for name, var in vars(measured).items()}
        self.heights = height_window(self.element, axis)
        half = 0.5 * getattr(self.element, "width", math.inf)
        self.centre = [(self.values["right"], self.bounds.get("right", Interval(-half, half)))]
        tips = [name for name in ("right_wing", "left_wing", "beside_right", "beside_left") if name in self.bounds]
        self.tips = [(self.values[name], self.bounds[name]) for name in tips]
        self.clearance = self.element.tolerances.clearance if isinstance(self.element, ElementWithTolerances) else 0.0
        chi, gamma = value("chi"), value("gamma")
        forward = math.copysign(max(abs(math.cos(chi - axis)), COSINE_MIN), math.cos(chi - axis))
        slant, climb = math.sin(chi - axis) / forward, math.tan(max(-STEEP, min(STEEP, gamma))) / forward
        along = math.cos(axis), math.sin(axis)
        self._up = -climb * along[0], -climb * along[1], 1.0
        self._right = -math.sin(axis) - slant * along[0], math.cos(axis) - slant * along[1], 0.0
        self._beside = (-math.sin(chi), math.cos(chi), 0.0) if "beside_right" in self.bounds else self._right

    def height_window(self, offset: float, deviation: float) -> Window:
        """Return the errors of the height with which it is legal."""
        height = self.values["height"]
        return self._window(self._up, height - self.heights.upper, height - self.heights.lower, offset, deviation)

    def window(self, allowed: Sequence[tuple[float, Interval]], offset: float, deviation: float) -> Window:
        """Return the errors across the axis with which some of its measures are within their limits."""
        lower = max(value - limits.upper for value, limits in allowed)
        upper = min(value - limits.lower for value, limits in allowed)
        if lower > upper:  # the wing is wider than the gate; a bank of the path is known badly
            lower = upper = 0.5 * (lower + upper)
        direction = self._right if allowed is self.centre else self._beside
        return self._window(direction, lower, upper, offset, deviation)

    def _window(
        self, direction: tuple[float, float, float], lower: float, upper: float, offset: float, deviation: float
    ) -> Window:
        crossing = self.crossing
        gate = crossing.passage.element.name
        return Window(crossing.name, gate, offset + crossing.time, direction, lower, upper, deviation)


class _Passing:
    """A passing before the rules."""

    def __init__(
        self, flight: Flight, crossing: TimedCrossing, axis: float, errors: FlightErrors, penalties: Penalties
    ) -> None:
        self._measured = _MeasuredPassing(flight, crossing, axis)
        self._race, self._crossing, self._errors, self._penalties = flight.race, crossing, errors, penalties
        self._own, self._in_all = errors.own(crossing.time), errors.at(crossing.time)
        push = -flight_limits(flight.aircraft, flight.course.rules).n_z.lower
        pulled = crossing.value("n_z") - CERTAIN_DEVIATIONS * self._in_all.load > push  # not where a load is not known
        self._may_be_pushed = not is_measured(flight, "phi") and not pulled

    def violations(self) -> list[Violation]:
        """Return all that it breaks."""
        broken = [*self._beside(), *self._height(), *self._angles()]
        return broken + self._start_speed()

    def _violation(
        self, rule: str, value: float, limit: float, deviation: float, unit: str, penalty: float | None
    ) -> Violation:
        price = math.nan if penalty is None else penalty
        return Violation(self._crossing.name, rule, self._crossing.time, value, limit, deviation, unit, price)

    def _beside(self) -> list[Violation]:
        """Return what the aircraft passes too far aside: with its wing within the clearance, on a pylon, outside."""
        measured, penalties, levels = self._measured, self._penalties, list[Violation]()
        clearance = measured.clearance
        touching = [
            (value, Interval(limits.lower - clearance, limits.upper + clearance)) for value, limits in measured.tips
        ]
        for rule, allowed, deviation, gap, penalty in (
            ("pylon", measured.tips, self._own.tip, clearance, 0.0),
            ("pylon", touching, self._own.tip, 0.0, penalties.pylon),
            ("missed", measured.centre, self._own.across, math.nan, penalties.missed),
        ):
            if not allowed:
                continue
            judged = self._errors.common.judge(measured.window(allowed, self._errors.offset, deviation))
            excess = max((beyond(value - judged.shift, limits) for value, limits in allowed), key=abs)
            if excess == 0.0:
                continue
            known = abs(excess) / judged.deviations if judged.deviations > 0.0 else math.nan
            value = measured.centre[0][0] - judged.shift if rule == "missed" else gap - abs(excess)
            limit = value - excess if rule == "missed" else gap
            levels.append(self._violation(rule, value, limit, known, "m", penalty))
        return severest(levels)

    def _height(self) -> list[Violation]:
        measured, penalties = self._measured, self._penalties
        judged = self._errors.common.judge(measured.height_window(self._errors.offset, self._own.up))
        height = measured.values["height"] - judged.shift
        excess = beyond(height, measured.heights)
        if excess == 0.0:
            return []
        known = abs(excess) / judged.deviations if judged.deviations > 0.0 else math.nan
        too = ("too-high", penalties.too_high) if excess > 0.0 else ("too-low", penalties.too_low)
        rule, penalty = too if measured.element.stands else _manoeuvre(measured.element, penalties)
        return [self._violation(rule, height, height - excess, known, "m", penalty)]

    def _angles(self) -> Iterator[Violation]:
        measured, penalties, element = self._measured, self._penalties, self._measured.element
        values, bounds, path = measured.values, measured.bounds, math.degrees(self._in_all.path)
        sine = values["climb_sine"]
        if excess := beyond(sine, bounds.get("climb_sine", Interval())):
            climb, limit = (math.degrees(math.asin(max(-1.0, min(1.0, number)))) for number in (sine, sine - excess))
            yield self._violation("climb", climb, limit, path, "deg", penalties.climb)
        if not isinstance(element, ElementWithTolerances):
            return
        allowed: list[tuple[str, float, float, float, float | None]] = []
        if element.prescribed_bank is not None:
            angle, bank = angle_between(measured.bank, self._crossing.value("mu")), math.degrees(self._in_all.bank)
            if self._may_be_pushed:  # which looks like a pull on the back
                angle = min(angle, math.remainder(angle - math.pi, math.tau), key=abs)
            allowed.append(("bank", angle, element.tolerances.bank, bank, penalties.bank))
        if {"course_excess_right", "course_excess_left"} <= set(bounds):
            angle = math.atan2(values["course_sine"], values["course_cosine"])
            allowed.append(("course", angle, element.tolerances.crossing, path, None))
        for rule, angle, most, deviation, penalty in allowed:
            angle, most = math.degrees(angle), math.degrees(most)
            if abs(angle) > most:
                yield self._violation(rule, angle, math.copysign(most, angle), deviation, "deg", penalty)

    def _start_speed(self) -> list[Violation]:
        penalties, deviation = self._penalties, self._in_all.speed / KNOT
        speed = self._crossing.value(START_SPEEDS[self._race.course.rules.start_speed])
        allowed, levels = self._crossing.passage.speed, list[Violation]()
        if excess := beyond(speed, allowed):
            limit = (speed - excess) / KNOT
            levels.append(self._violation("start-speed", speed / KNOT, limit, deviation, "kt", penalties.start_speed))
        ends = penalties.start_speed_end
        if excess and ends is not None and speed > ends:
            levels.append(self._violation("start-speed", speed / KNOT, ends / KNOT, deviation, "kt", ENDS_RACE))
        return severest(levels)


def severest(levels: Sequence[Violation]) -> list[Violation]:
    """Return which of the limits that one measure exceeds count: the harshest certain one, and harsher ones.

    Args:
        levels: from the mildest to the harshest.
    """
    certain = [number for number, violation in enumerate(levels) if violation.certain]
    return list(levels[certain[-1] if certain else -1 :])


def _manoeuvre(element: Element, penalties: Penalties) -> tuple[str, float | None]:
    return "manoeuvre", penalties.manoeuvres.get(element.type_name, penalties.manoeuvre)


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


def _load_factors(flight: Flight, penalties: Penalties, errors: FlightErrors) -> list[Violation]:
    """Return the load factor where it is too large for too long, and where it ends the race.

    What lasts is the highest load factor that is exceeded all along the time that the rules name.
    """
    if "n_z" not in flight or not np.isfinite(flight["n_z"]).any():
        return []
    finite = np.isfinite(flight["n_z"])
    time = np.arange(flight.time[0], flight.time[-1], LOAD_SAMPLING)
    n_z = np.interp(time, flight.time[finite], flight["n_z"][finite])
    levels: list[Violation] = []
    limit = penalties.load_factor_from or flight.course.rules.n_z.upper
    for lasting, most, penalty in (
        (penalties.load_factor_time, limit, penalties.load_factor),
        (0.0, penalties.load_factor_end, ENDS_RACE),
    ):
        count = round(lasting / LOAD_SAMPLING) + 1
        if most is None or count > len(n_z):
            continue
        exceeded = np.lib.stride_tricks.sliding_window_view(n_z, count).min(axis=1)
        highest = np.flatnonzero(exceeded == exceeded.max())
        row = int(highest[len(highest) // 2]) + count // 2
        value, when = float(exceeded.max()), float(time[row])
        if value > most:
            price = math.nan if penalty is None else penalty
            levels.append(Violation("", "load-factor", when, value, most, errors.at(when).load, "g", price))
    return severest(levels)


def _distances(flight: Flight, errors: FlightErrors) -> Iterator[Violation]:
    """Yield what the flight came too near to: obstacles, people, safety lines, borders, floor and ceiling."""
    legs = {leg.number: leg.rows for leg in legs_of(flight)}
    for distance in distances(flight):
        if distance.kind == "pylon":
            continue
        rows = np.arange(len(flight.time))
        if distance.legs is not None:
            rows = np.concatenate([legs[number] for number in sorted(distance.legs)])
        rows = rows[np.isfinite(distance.values[rows])]
        if not len(rows):
            continue
        row = int(rows[int(np.argmin(distance.values[rows]))])
        nearest = at_row(flight, distance, row)
        if nearest.margin >= 0.0:
            continue
        rule, own = distance.kind.replace(" ", "-"), errors.own(nearest.time)
        north, east = -math.sin(float(flight["chi"][row])), math.cos(float(flight["chi"][row]))
        directions, deviation = [(north, east, 0.0), (-north, -east, 0.0)], own.across  # the nearest is beside the path
        if rule in ("floor", "ceiling"):
            directions, deviation = [(0.0, 0.0, 1.0 if rule == "floor" else -1.0)], own.up
        when = errors.offset + nearest.time
        windows = [Window("", "", when, direction, -math.inf, nearest.margin, deviation) for direction in directions]
        judgements = [errors.common.judge(window) for window in windows]
        judged = min(judgements, key=lambda judgement: judgement.deviations)
        excess = judged.shift - nearest.margin
        if excess > 0.0:
            value = nearest.distance - judged.shift
            known = excess / judged.deviations if judged.deviations > 0.0 else math.nan
            yield Violation("", rule, nearest.time, value, distance.required, known, "m", math.nan)
