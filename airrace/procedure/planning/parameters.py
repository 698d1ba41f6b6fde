"""The limits of a race as parameters: rules, gates, surroundings, then the aircraft's own.

A director may relax them, and a flight may keep a margin from those of the course.
"""

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from airrace.model.parameters import Parameter, attribute_parameter, lift
from airrace.model.track.element import Element
from airrace.model.track.gates import HIGHEST
from airrace.optimal_control.quantities import KNOT, Interval
from airrace.race import Race

ALPHA_MAX, START_SPEED_MAX = 45.0, 500.0
"""The values up to which the angle of attack (deg) and the start speed (kt) are relaxed."""
N_Z_MAX, ROLL_RATE_MAX, SPEED_MAX, SPEED_MIN = 25.0, 1000.0, 300.0, 5.0
"""The values up to which an aircraft's limits are relaxed: g, deg/s, m/s."""
ONSET_MAX, TURN_TOLERANCE_MAX, SIDESLIP_MAX = 1000.0, 10.0, 45.0
"""The values up to which a pilot's onset (g/s), deviation from a steady turn (g) and sideslip (deg) are relaxed."""


def relaxable_parameters(race: Race) -> list[Parameter[Race]]:
    """Return all parameters of a race that may be relaxed, in the order in which they are stated.

    Limits that are not set, and those that something stricter covers, are left out.
    """
    return [one for one in (*course_limits(race), *_aircraft(race)) if one.can_relax]


def course_limits(race: Race) -> list[Parameter[Race]]:
    """Return the limits of rules, gates and surroundings, also those that cannot be relaxed."""
    return [*_rules(race), *_gates(race), *_surroundings(race)]


def with_margins(race: Race, margins: Mapping[str, float]) -> Race:
    """Return a race whose course is tightened by margins; `Race.rules_course` is the course as it was.

    Args:
        race: on a course without margins.
        margins: by how much limits are tighter, each in the unit of its key, by the keys of `course_limits`.
    """
    if not margins:
        return race
    tightened = race
    for course_limit in course_limits(race):
        if course_limit.key in margins:
            tightened = course_limit.set(
                tightened, course_limit.value - math.copysign(margins[course_limit.key], course_limit.relaxing_step)
            )
    return dataclasses.replace(tightened, rules_course=race.course)


def _rules(race: Race) -> Iterator[Parameter[Race]]:
    envelope, own = race.aircraft.envelope, race.aircraft.point_mass

    def rule(key: str, path: str, label: str, step: float, limit: float, digit: float = 0.0) -> Parameter[Race]:
        return attribute_parameter(
            race, f"rules.{key}", f"course.{path}", label=label, relaxing_step=step, limit=limit, digit=digit
        )

    yield rule("n_z_max", "rules.n_z.upper", "n_z", 0.5, envelope.n_z.upper)
    yield rule("n_z_min", "rules.n_z.lower", "n_z", -0.5, envelope.n_z.lower)
    yield rule("ceiling_m", "rules.height.upper", "the ceiling", 10.0, HIGHEST)
    yield rule("floor_m", "rules.height.lower", "the floor", -5.0, min(race.course.rules.height.lower, 0.0))
    if race.course.rules.p < own.p:
        yield rule("roll_rate_max_deg_s", "rules.p", "roll rate", 20.0, math.degrees(own.p))
    C_L = rule("C_L_max", "rules.C_L.upper", "C_L", 0.1, race.aircraft.lift.C_L_max, 0.01)
    yield dataclasses.replace(C_L, value=min(C_L.value, race.aircraft.lift.C_L_max))
    yield rule("alpha_max_deg", "rules.alpha_A.upper", "angle of attack", 1.0, ALPHA_MAX, 0.1)
    fastest = min(START_SPEED_MAX, math.floor(envelope.V.upper / KNOT))
    yield rule("start_speed_max_kt", "passages.0.speed.upper", "start speed", 10.0, fastest)
    pilot = race.course.rules.pilot
    yield rule("pilot.n_z_min", "rules.pilot.n_z_min", "the load factor", -0.5, envelope.n_z.lower)
    yield rule("pilot.n_z_min_low", "rules.pilot.n_z_low", "the load factor near the ground", -0.5, envelope.n_z.lower)
    yield rule(
        "pilot.n_z_min_ends", "rules.pilot.n_z_ends", "the load factor over start and finish", -0.5, envelope.n_z.lower
    )
    yield rule("pilot.gate_onset_max_g_s", "rules.pilot.onset", "the onset at gates", 5.0, ONSET_MAX)
    rolls = math.degrees(own.p)
    yield rule("pilot.gate_roll_rate_max_deg_s", "rules.pilot.roll_rate", "the roll rate at gates", 20.0, rolls)
    sideslip = "the sideslip at gates"
    yield rule("pilot.gate_sideslip_max_deg", "rules.pilot.sideslip", sideslip, 2.0, SIDESLIP_MAX)
    yield rule("pilot.gate_n_y_max", "rules.pilot.n_y", "the lateral load factor at gates", 0.1, own.n_y, 0.01)
    if pilot.steady_start or pilot.steady_finish:
        path, label = "rules.pilot.turn_tolerance", "the tolerance of the steady turn"
        yield rule("pilot.turn_tolerance_g", path, label, 0.5, TURN_TOLERANCE_MAX)


def _gates(race: Race) -> Iterator[Parameter[Race]]:
    """Yield what the elements declare, for each entry of `gates` once: both passings of a quad are one entry."""
    seen: dict[str, Element] = {}
    for passage in race.course.passages:
        seen.setdefault(passage.element.base_name, passage.element)
    for name, element in seen.items():
        change = _change_elements(name, type(element))
        for parameter in element.parameters():
            yield lift(parameter, f"gates.{name}.", change, at=name)


def _change_elements(name: str, kind: type[Element]) -> Callable[[Race, Callable[[Any], Any]], Race]:
    """Return what changes all elements of one entry of `gates` that are of one kind."""

    def change(race: Race, make: Callable[[Any], Any]) -> Race:
        passages = tuple(
            dataclasses.replace(passage, element=make(passage.element))
            if passage.element.base_name == name and isinstance(passage.element, kind)
            else passage
            for passage in race.course.passages
        )
        return dataclasses.replace(race, course=dataclasses.replace(race.course, passages=passages))

    return change


def _surroundings(race: Race) -> Iterator[Parameter[Race]]:
    for line in race.course.safety_lines:
        yield Parameter(
            f"safety_lines.{line.name}.margin_m",
            line.margin,
            _change_margin(line.name),
            label=f"the margin of safety line {line.name}",
            relaxing_step=-10.0,
            limit=-1000.0,
            bounds=Interval(lower=0.0),
        )
    for index, crowd in enumerate(race.course.crowd):
        key, path = f"crowd.{crowd.name}.distance_m", f"course.crowd.{index}.distance"
        label = f"the distance of crowd {crowd.name}"
        yield attribute_parameter(race, key, path, label=label, relaxing_step=-10.0, limit=1.0)
    for index, obstacle in enumerate(race.course.obstacles):
        key, path = f"obstacles.{obstacle.name}.clearance_m", f"course.obstacles.{index}.clearance"
        label = f"the clearance of obstacle {obstacle.name}"
        yield attribute_parameter(race, key, path, label=label, relaxing_step=-2.0, limit=0.5)


def _change_margin(name: str) -> Callable[[Race, float], Race]:
    """Return what changes a safety line, which several passages hold."""

    def change(race: Race, margin: float) -> Race:
        passages = [
            dataclasses.replace(
                passage,
                safety_lines=tuple(
                    dataclasses.replace(line, margin=margin) if line.name == name else line
                    for line in passage.safety_lines
                ),
            )
            for passage in race.course.passages
        ]
        return dataclasses.replace(race, course=dataclasses.replace(race.course, passages=tuple(passages)))

    return change


def _aircraft(race: Race) -> Iterator[Parameter[Race]]:
    aircraft, rules = race.aircraft, race.course.rules
    C_L_max, m, kilowatts = aircraft.lift.C_L_max, aircraft.airframe.m, aircraft.propulsion.P_max / 1000.0

    def own(key: str, path: str, label: str, step: float, limit: float, digit: float = 0.0) -> Parameter[Race]:
        return attribute_parameter(
            race, f"aircraft.{key}", f"aircraft.{path}", label=label, relaxing_step=step, limit=limit, digit=digit
        )

    if aircraft.envelope.n_z.upper <= rules.n_z.upper:
        yield own("envelope.n_z_max", "envelope.n_z.upper", "the aircraft's n_z", 0.5, N_Z_MAX)
    yield own("envelope.speed_max_m_s", "envelope.V.upper", "the aircraft's top speed", 5.0, SPEED_MAX)
    yield own("envelope.speed_min_m_s", "envelope.V.lower", "the aircraft's least speed", -2.0, SPEED_MIN)
    if aircraft.point_mass.p <= rules.p:
        yield own("point_mass.roll_rate_max_deg_s", "point_mass.p", "the aircraft's roll rate", 20.0, ROLL_RATE_MAX)
    yield own("lift.C_L_max", "lift.C_L_max", "the aircraft's C_L", 0.1, max(2.0, 1.5 * C_L_max), 0.01)
    yield own("airframe.mass_kg", "airframe.m", "the mass", -0.1 * m, 0.4 * m)
    yield own("propulsion.power_max_kW", "propulsion.P_max", "the power", 0.1 * kilowatts, 10.0 * kilowatts, 1.0)
