"""The numbers of a race that a director may relax, each by the key that `--set` takes, with its usual step.

A lever knows its value in its user's unit, to which side it is relaxed, how far that makes sense, and how to make the
race with another value. Limits that nobody has set have none.
"""

import dataclasses
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from airrace.aircraft.aircraft import Aircraft
from airrace.planning.race import Race
from airrace.quantities import KNOT, Interval
from airrace.track.course import Course, Passage
from airrace.track.element import Element
from airrace.track.gate import LEVEL, Gate
from airrace.track.manoeuvre import Manoeuvre
from airrace.track.passing import Passing, Tolerances
from airrace.track.pylon import Pylon

DEGREE = math.pi / 180.0
STEEPEST, MOST_CROSSING, MOST_BANK = 85.0, 85.0, 89.0
"""The largest angles to which a climb, a crossing and a tolerance of bank are relaxed, deg."""
HIGHEST = 5000.0
"""The largest ceiling that the track language knows, m."""


@dataclass(frozen=True)
class Lever:
    """A number that may be relaxed.

    Attributes:
        key: that `--set` takes.
        text: what it is, for people.
        at: the gate that it belongs to, by its key; empty where it holds all along.
        unit: of its value; empty for a number.
        value: as it is.
        step: a usual change to the milder side, with its sign.
        digit: the unit of the last digit that is told of it.
        furthest: the last value that makes sense.
        changed: makes the race with another value.
        curve: what of the value enters the equations in proportion.
        inverse: the value from that.
        settable_from: the least value that the inputs allow.
    """

    key: str
    text: str
    at: str
    unit: str
    value: float
    step: float
    digit: float
    furthest: float
    changed: Callable[[Race, float], Race]
    curve: Callable[[float], float] = float
    inverse: Callable[[float], float] = float
    settable_from: float = -math.inf

    @property
    def told(self) -> str:
        """What it is, and at which gate, for people."""
        return f"{self.text} at {self.at}" if self.at else self.text

    @property
    def of_aircraft(self) -> bool:
        """Whether it is the aircraft's number, which no race director can change."""
        return self.key.startswith("aircraft.")

    @property
    def milder(self) -> float:
        """The value after a usual step, or half of what is left where that is less."""
        room = self.furthest - self.value
        return self.value + (self.step if abs(room) > abs(self.step) else 0.5 * room)

    @property
    def steps_max(self) -> float:
        """The number of steps, in proportion, to the last value that makes sense."""
        return self._steps(self.furthest)

    def at_steps(self, steps: float) -> float:
        """Return the value after so many steps, taken in proportion to what enters the equations."""
        now, milder = self.curve(self.value), self.curve(self.milder)
        return self.inverse(now + steps * (milder - now))

    def _steps(self, value: float) -> float:
        now, milder = self.curve(self.value), self.curve(self.milder)
        return (self.curve(value) - now) / (milder - now)

    def usual_steps(self, value: float) -> float:
        """Return how many usual steps a value is away."""
        return (value - self.value) / self.step

    def settable(self, value: float) -> bool:
        """Return whether the inputs allow a value."""
        return value >= self.settable_from

    def rounded(self, value: float) -> float:
        """Return a value rounded to the milder side in the last digit that is told, within what makes sense."""
        whole = math.ceil if self.step > 0.0 else math.floor
        digits = max(0, -math.floor(math.log10(self.digit)))
        told = round(whole(round(value / self.digit, 6)) * self.digit, digits)
        return min(told, self.furthest) if self.step > 0.0 else max(told, self.furthest)


def levers(race: Race) -> list[Lever]:
    """Return all levers of a race: rules, gates, surroundings, the aircraft."""
    found = [*_rules(race), *_gates(race.course), *_surroundings(race.course), *_aircraft(race)]
    return [one for one in found if (one.furthest - one.value) * one.step > 0.0]


# Rules.


def _rules(race: Race) -> Iterator[Lever]:
    rules, envelope, own = race.course.rules, race.aircraft.envelope, race.aircraft.point_mass

    def changing(key: str, text: str, unit: str, value: float, step: float, digit: float, furthest: float) -> Lever:
        name, end, factor = _RULES[key]

        def changed(race: Race, value: float) -> Race:
            rules = race.course.rules
            at = getattr(rules, name)
            now = value * factor if end == "" else dataclasses.replace(at, **{end: value * factor})
            return _with_course(race, rules=dataclasses.replace(rules, **{name: now}))

        return Lever(f"rules.{key}", text, "", unit, value, step, digit, furthest, changed)

    if rules.n_z.upper < envelope.n_z.upper:
        yield changing("n_z_max", "n_z", "g", rules.n_z.upper, 0.5, 0.1, envelope.n_z.upper)
    if rules.n_z.lower > envelope.n_z.lower:
        yield changing("n_z_min", "n_z", "g", rules.n_z.lower, -0.5, 0.1, envelope.n_z.lower)
    if math.isfinite(rules.height.upper):
        yield changing("ceiling_m", "the ceiling", "m", rules.height.upper, 10.0, 1.0, HIGHEST)
    if math.isfinite(rules.height.lower):
        yield changing("floor_m", "the floor", "m", rules.height.lower, -5.0, 1.0, min(rules.height.lower, 0.0))
    if rules.p < own.p:
        rate = round(math.degrees(rules.p), 9)
        yield changing("roll_rate_max_deg_s", "roll rate", "deg/s", rate, 20.0, 1.0, math.degrees(own.p))
    if math.isfinite(rules.C_L.upper) and rules.C_L.upper < race.aircraft.lift.C_L_max:
        yield changing("C_L_max", "C_L", "", rules.C_L.upper, 0.1, 0.01, race.aircraft.lift.C_L_max)
    if math.isfinite(rules.alpha_A.upper):
        alpha = round(math.degrees(rules.alpha_A.upper), 9)
        yield changing("alpha_max_deg", "angle of attack", "deg", alpha, 1.0, 0.1, 45.0)
    start = race.course.passages[0].speed.upper
    if math.isfinite(start):
        knots = round(start / KNOT, 9)
        furthest = min(500.0, math.floor(envelope.V.upper / KNOT))
        yield Lever(
            "rules.start_speed_max_kt", "start speed", "", "kt", knots, 10.0, 1.0, furthest, _start_speed
        )


_RULES = {
    "n_z_max": ("n_z", "upper", 1.0),
    "n_z_min": ("n_z", "lower", 1.0),
    "ceiling_m": ("height", "upper", 1.0),
    "floor_m": ("height", "lower", 1.0),
    "roll_rate_max_deg_s": ("p", "", DEGREE),
    "C_L_max": ("C_L", "upper", 1.0),
    "alpha_max_deg": ("alpha_A", "upper", DEGREE),
}
"""The attribute of the rules that a key sets, which end of it, and the factor to SI."""


def _start_speed(race: Race, value: float) -> Race:
    first, *others = race.course.passages
    faster = dataclasses.replace(first, speed=dataclasses.replace(first.speed, upper=value * KNOT))
    return _with_course(race, passages=(faster, *others))


def _with_course(race: Race, **changes: object) -> Race:
    return dataclasses.replace(race, course=dataclasses.replace(race.course, **changes))


# Gates.


def base_name(element: Element) -> str:
    """Return the key of the entry of `gates` that an element belongs to: `q` of `q/1`."""
    return element.name.partition("/")[0]


def _gates(course: Course) -> Iterator[Lever]:
    seen = {base_name(passage.element): passage.element for passage in reversed(course.passages)}
    for name, element in reversed(seen.items()):
        match element:
            case Gate() | Pylon():
                yield from _tolerances(name, element)
            case Manoeuvre():
                yield from _manoeuvre(name, element)
            case _:
                continue


def _tolerances(name: str, element: Gate | Pylon) -> Iterator[Lever]:
    allowed, window = element.tolerances, element.passing is Passing.WINDOW

    def lever(
        key: str, text: str, unit: str, numbers: tuple[float, float, float, float], set_to: "_Set", **curve: "_Curve"
    ) -> Lever:
        value, step, digit, furthest = numbers

        def changed(race: Race, value: float) -> Race:
            return _with_elements(race, name, lambda one: _tolerating(one, set_to(one.tolerances, value)))

        return Lever(f"gates.{name}.{key}", text, name, unit, value, step, digit, furthest, changed, **curve)

    def angle(
        key: str, text: str, at: float, numbers: tuple[float, float], set_to: "_Set", of: "_Curve", inverse: "_Curve"
    ) -> Lever:
        step, furthest = numbers
        return lever(
            key,
            text,
            "deg",
            (round(math.degrees(at), 9), step, 1.0, furthest),
            set_to,
            curve=lambda value: of(math.radians(value)),
            inverse=lambda value: math.degrees(inverse(value)),
        )

    def crossing(was: Tolerances, value: float) -> Tolerances:
        return dataclasses.replace(was, crossing=math.radians(value))

    def climb(end: str) -> "_Set":
        return lambda was, value: dataclasses.replace(
            was, climb=dataclasses.replace(was.climb, **{end: math.radians(value)})
        )

    def height(end: str) -> "_Set":
        return lambda was, value: dataclasses.replace(was, height=dataclasses.replace(was.height, **{end: value}))

    def clearance(was: Tolerances, value: float) -> Tolerances:
        return dataclasses.replace(was, clearance=value)

    def bank(was: Tolerances, value: float) -> Tolerances:
        return dataclasses.replace(was, bank=math.radians(value))

    yield angle("crossing_max_deg", "crossing angle", allowed.crossing, (10.0, MOST_CROSSING), crossing, math.tan, math.atan)
    yield angle("climb_max_deg", "climb angle", allowed.climb.upper, (10.0, STEEPEST), climb("upper"), math.sin, _asin)
    yield angle("climb_min_deg", "climb angle", allowed.climb.lower, (-10.0, -STEEPEST), climb("lower"), math.sin, _asin)
    if not window:
        return
    yield lever("height_max_m", "height", "m", (allowed.height.upper, 5.0, 1.0, HIGHEST), height("upper"))
    yield lever("height_min_m", "height", "m", (allowed.height.lower, -5.0, 1.0, min(allowed.height.lower, 0.0)), height("lower"))
    yield lever("clearance_m", "clearance", "m", (allowed.clearance, -0.5, 0.1, 0.0), clearance)
    if isinstance(element, Gate):
        yield angle("bank_tolerance_deg", "bank tolerance", allowed.bank, (5.0, MOST_BANK), bank, math.tan, math.atan)
        yield Lever(
            f"gates.{name}.width_m", "width", name, "m", element.width, 1.0, 0.1, 100.0, _width(name)
        )
    else:
        yield Lever(f"gates.{name}.reach_m", "reach", name, "m", element.reach, 10.0, 1.0, 1000.0, _reach(name))


_Set = Callable[[Tolerances, float], Tolerances]
_Curve = Callable[[float], float]


def _asin(sine: float) -> float:
    return math.asin(max(-1.0, min(1.0, sine)))


def _tolerating(element: Gate | Pylon, tolerances: Tolerances) -> Gate | Pylon:
    return dataclasses.replace(element, tolerances=tolerances)


def _width(name: str) -> Callable[[Race, float], Race]:
    return lambda race, value: _with_elements(race, name, lambda one: dataclasses.replace(one, width=value))


def _reach(name: str) -> Callable[[Race, float], Race]:
    return lambda race, value: _with_elements(race, name, lambda one: dataclasses.replace(one, reach=value))


def _manoeuvre(name: str, element: Manoeuvre) -> Iterator[Lever]:
    def changing(end: str) -> Callable[[Race, float], Race]:
        def changed(race: Race, value: float) -> Race:
            def at(one: Manoeuvre) -> Manoeuvre:
                if one.height.bounded:
                    return dataclasses.replace(one, height=dataclasses.replace(one.height, **{end: value}))
                return one

            return _with_elements(race, name, at)

        return changed

    height = element.height
    if height.lower == height.upper:
        return
    if math.isfinite(height.lower):
        yield Lever(
            f"gates.{name}.height_min_m", "height", name, "m", height.lower, -10.0, 1.0, min(height.lower, 0.0), changing("lower")
        )
    if math.isfinite(height.upper):
        yield Lever(
            f"gates.{name}.height_max_m", "height", name, "m", height.upper, 10.0, 1.0, HIGHEST, changing("upper")
        )


def _with_elements(race: Race, name: str, change: Callable[..., Element]) -> Race:
    """Return the race with all elements changed that belong to one entry of `gates`."""

    def changed(passage: Passage) -> Passage:
        if base_name(passage.element) != name:
            return passage
        return dataclasses.replace(passage, element=change(passage.element))

    return _with_course(race, passages=tuple(changed(one) for one in race.course.passages))


# Surroundings.


def _surroundings(course: Course) -> Iterator[Lever]:
    lines = {line.name: line for passage in course.passages for line in passage.safety_lines}
    for line in lines.values():
        yield Lever(
            f"safety_lines.{line.name}.margin_m",
            f"the margin of safety line {line.name}",
            "",
            "m",
            line.margin,
            -10.0,
            1.0,
            -1000.0,
            _margin(line.name),
            settable_from=0.0,
        )
    for crowd in course.crowd:
        yield Lever(
            f"crowd.{crowd.name}.distance_m",
            f"the distance of crowd {crowd.name}",
            "",
            "m",
            crowd.distance,
            -10.0,
            1.0,
            1.0,
            _distance(crowd.name),
        )


def _margin(name: str) -> Callable[[Race, float], Race]:
    def changed(race: Race, value: float) -> Race:
        passages = tuple(
            dataclasses.replace(
                passage,
                safety_lines=tuple(
                    dataclasses.replace(line, margin=value) if line.name == name else line
                    for line in passage.safety_lines
                ),
            )
            for passage in race.course.passages
        )
        return _with_course(race, passages=passages)

    return changed


def _distance(name: str) -> Callable[[Race, float], Race]:
    def changed(race: Race, value: float) -> Race:
        crowd = tuple(
            dataclasses.replace(one, distance=value) if one.name == name else one for one in race.course.crowd
        )
        return _with_course(race, crowd=crowd)

    return changed


# The aircraft.


def _aircraft(race: Race) -> Iterator[Lever]:
    aircraft, rules = race.aircraft, race.course.rules
    envelope, own, lift = aircraft.envelope, aircraft.point_mass, aircraft.lift

    def lever(key: str, text: str, unit: str, value: float, step: float, digit: float, furthest: float) -> Lever:
        part, name, end, factor = _AIRCRAFT[key]

        def changed(race: Race, value: float) -> Race:
            was = getattr(race.aircraft, part)
            now = value * factor
            if end:
                now = dataclasses.replace(getattr(was, name), **{end: now})
            flown: Aircraft = dataclasses.replace(race.aircraft, **{part: dataclasses.replace(was, **{name: now})})
            return dataclasses.replace(race, aircraft=flown)

        return Lever(f"aircraft.{key}", text, "", unit, value, step, digit, furthest, changed)

    if envelope.n_z.upper <= rules.n_z.upper:
        yield lever("envelope.n_z_max", "the aircraft's n_z", "g", envelope.n_z.upper, 0.5, 0.1, 25.0)
    yield lever("envelope.speed_max_m_s", "the aircraft's top speed", "m/s", envelope.V.upper, 5.0, 1.0, 300.0)
    yield lever("envelope.speed_min_m_s", "the aircraft's least speed", "m/s", envelope.V.lower, -2.0, 1.0, 5.0)
    if own.p <= rules.p:
        rate = round(math.degrees(own.p), 9)
        yield lever("point_mass.roll_rate_max_deg_s", "the aircraft's roll rate", "deg/s", rate, 20.0, 1.0, 1000.0)
    yield lever("lift.C_L_max", "the aircraft's C_L", "", lift.C_L_max, 0.1, 0.01, max(2.0, 1.5 * lift.C_L_max))
    mass, power = aircraft.airframe.m, aircraft.propulsion.P_max / 1000.0
    yield lever("airframe.mass_kg", "the mass", "kg", mass, -0.1 * mass, 1.0, 0.1 * mass)
    yield lever("propulsion.power_max_kW", "the power", "kW", power, 0.1 * power, 1.0, 10.0 * power)


_AIRCRAFT = {
    "envelope.n_z_max": ("envelope", "n_z", "upper", 1.0),
    "envelope.speed_max_m_s": ("envelope", "V", "upper", 1.0),
    "envelope.speed_min_m_s": ("envelope", "V", "lower", 1.0),
    "point_mass.roll_rate_max_deg_s": ("point_mass", "p", "", DEGREE),
    "lift.C_L_max": ("lift", "C_L_max", "", 1.0),
    "airframe.mass_kg": ("airframe", "m", "", 1.0),
    "propulsion.power_max_kW": ("propulsion", "P_max", "", 1000.0),
}
"""The part of an aircraft that a key sets, the attribute of that part, which end of it, and the factor to SI."""
