"""The numbers of a race that a director may relax, each by the key that `--set` takes, with its usual step.

A parameter knows its value in its user's unit, to which side it is relaxed, how far at most, and how to make the
race with another value. Limits that nobody has set have none.
"""

import dataclasses
import math
from collections.abc import Callable, Iterator
from typing import Any

from airrace.aircraft.aircraft import Aircraft
from airrace.planning.race import Race
from airrace.procedure.infeasibility.gate_parameters import HIGHEST, gate_parameters
from airrace.procedure.infeasibility.relaxable import RelaxableParameter
from airrace.quantities import KNOT
from airrace.track.course import Course

DEGREE = math.pi / 180.0


def relaxables(race: Race) -> list[RelaxableParameter]:
    """Return all relaxable parameters of a race: rules, gates, surroundings, the aircraft."""
    found = [*_rules(race), *gate_parameters(race.course), *_surroundings(race.course), *_aircraft(race)]
    return [one for one in found if (one.furthest - one.value) * one.step > 0.0]


# Rules.


def _rules(race: Race) -> Iterator[RelaxableParameter]:
    rules, envelope, own = race.course.rules, race.aircraft.envelope, race.aircraft.point_mass

    def changing(
        key: str, text: str, unit: str, value: float, step: float, digit: float, furthest: float
    ) -> RelaxableParameter:
        name, end, factor = _RULES[key]

        def changed(race: Race, value: float) -> Race:
            rules = race.course.rules
            at = getattr(rules, name)
            now = value * factor if end == "" else dataclasses.replace(at, **{end: value * factor})
            return _with_course(race, rules=dataclasses.replace(rules, **{name: now}))

        return RelaxableParameter(f"rules.{key}", text, "", unit, value, step, digit, furthest, changed)

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
        yield RelaxableParameter(
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


def _with_course(race: Race, **changes: Any) -> Race:  # Any: attributes of a course
    return dataclasses.replace(race, course=dataclasses.replace(race.course, **changes))


# Surroundings.


def _surroundings(course: Course) -> Iterator[RelaxableParameter]:
    for line in course.safety_lines:
        yield RelaxableParameter(
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
        yield RelaxableParameter(
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


def _aircraft(race: Race) -> Iterator[RelaxableParameter]:
    aircraft, rules = race.aircraft, race.course.rules
    envelope, own, lift = aircraft.envelope, aircraft.point_mass, aircraft.lift

    def relaxable(
        key: str, text: str, unit: str, value: float, step: float, digit: float, furthest: float
    ) -> RelaxableParameter:
        part, name, end, factor = _AIRCRAFT[key]

        def changed(race: Race, value: float) -> Race:
            was = getattr(race.aircraft, part)
            now = value * factor
            if end:
                now = dataclasses.replace(getattr(was, name), **{end: now})
            flown: Aircraft = dataclasses.replace(race.aircraft, **{part: dataclasses.replace(was, **{name: now})})
            return dataclasses.replace(race, aircraft=flown)

        return RelaxableParameter(f"aircraft.{key}", text, "", unit, value, step, digit, furthest, changed)

    if envelope.n_z.upper <= rules.n_z.upper:
        yield relaxable("envelope.n_z_max", "the aircraft's n_z", "g", envelope.n_z.upper, 0.5, 0.1, 25.0)
    yield relaxable("envelope.speed_max_m_s", "the aircraft's top speed", "m/s", envelope.V.upper, 5.0, 1.0, 300.0)
    yield relaxable("envelope.speed_min_m_s", "the aircraft's least speed", "m/s", envelope.V.lower, -2.0, 1.0, 5.0)
    if own.p <= rules.p:
        rate = round(math.degrees(own.p), 9)
        yield relaxable("point_mass.roll_rate_max_deg_s", "the aircraft's roll rate", "deg/s", rate, 20.0, 1.0, 1000.0)
    yield relaxable("lift.C_L_max", "the aircraft's C_L", "", lift.C_L_max, 0.1, 0.01, max(2.0, 1.5 * lift.C_L_max))
    mass, power = aircraft.airframe.m, aircraft.propulsion.P_max / 1000.0
    yield relaxable("airframe.mass_kg", "the mass", "kg", mass, -0.1 * mass, 1.0, 0.4 * mass)
    yield relaxable("propulsion.power_max_kW", "the power", "kW", power, 0.1 * power, 1.0, 10.0 * power)


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
