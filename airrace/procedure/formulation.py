"""The statement of the race as an optimal control problem: a phase per leg, a boundary per passage."""

import dataclasses
import math
from collections.abc import Mapping, Sequence

from airrace.aircraft.aircraft import Aircraft
from airrace.dynamics.crossing import CrossingParameters, with_sight
from airrace.dynamics.flight_model import COUNTING, FROM_ZERO, FlightModel
from airrace.optimal_control.problem import Boundary, Objective, PathConstraint, Phase, Problem
from airrace.optimal_control.runge_kutta import RungeKutta
from airrace.planning.plan import Plan
from airrace.planning.waypoints import Waypoint
from airrace.procedure.boundary_conditions import Ends
from airrace.procedure.guess import leg_seconds
from airrace.quantities import Interval
from airrace.system import Observation
from airrace.track.course import Roll
from airrace.track.element import Frame, climb_condition
from airrace.track.gates import NOT_POSITIVE, POSITIVE, ZERO

DETOUR, DETOUR_SECONDS = 3.0, 10.0
"""The longest duration of a phase: a factor on the plan (1), and a time on top (s)."""
SHORTEST_SHARE, SHORTEST_SECONDS = 1.0 / 3.0, 0.1
"""The shortest duration of a phase: a share of the plan (1), and a time (s) of which no more is asked."""
TIME_SCALE = 3.0
"""The scale of the phases' durations, s."""
PIECE_ANGLE = math.radians(10.0)
"""The largest angle by which a piece of the homotopy may leave the planned course and climb, rad."""


def race_problem(
    plan: Plan,
    mesh: Sequence[tuple[float, ...]],
    *,
    watches: Sequence[tuple[PathConstraint, ...]],
    model: FlightModel,
    observation: Observation,
    ends: Ends,
    aircraft: Aircraft,
    regularised: Mapping[str, float],
    scheme: RungeKutta,
) -> Problem:
    """Return the joint problem over all phases.

    Args:
        plan: waypoints in flown order.
        mesh: fractions of each phase's intervals.
        watches: what holds along each phase.
        model: the aircraft's equations.
        observation: the crossing, seen from the model's states.
        ends: what is asked of the first and the last passage besides.
        aircraft: for its wing span.
        regularised: weights of the squared, scaled controls by name.
        scheme: integrates an interval.
    """
    first, *between, last = _boundaries(plan, observation, aircraft.airframe.b)
    start = ends.start(first)
    phases = [
        Phase(
            name=f"{a.passage.name} -> {b.passage.name}",
            fractions=fractions,
            duration=Interval(min(SHORTEST_SHARE * seconds, SHORTEST_SECONDS), DETOUR * seconds + DETOUR_SECONDS),
            end=end,
            bounds=COUNTING if b.passage.roll is not None else {},
            watches=watched,
        )
        for a, b, fractions, end, watched, seconds in zip(
            plan.waypoints,
            plan.waypoints[1:],
            mesh,
            [*between, ends.finish(last)],
            watches,
            leg_seconds(plan),
            strict=False,
        )
    ]
    return Problem(
        system=model.system,
        parameters=tuple(float(value) for value in model.parameter_values),
        # Every interval ends with a unit quaternion; the first one must begin with one, or its length is arbitrary.
        start=dataclasses.replace(start, bounds={**start.bounds, "attitude_norm": Interval.exactly(1.0)}),
        phases=tuple(phases),
        objective=Objective(time=1.0, regularisation=regularised),
        scheme=scheme,
        time_scale=TIME_SCALE,
    )


def _boundaries(plan: Plan, observation: Observation, span: float) -> list[Boundary]:
    """Return the conditions of all passages, in which counting begins anew where a roll does."""
    boundaries = [boundary(waypoint, observation, span) for waypoint in plan.waypoints]
    for index, following in enumerate(plan.waypoints[1:]):
        if following.passage.roll is not None:
            before = boundaries[index]
            boundaries[index] = dataclasses.replace(before, bounds={**before.bounds, **FROM_ZERO})
    return boundaries


def boundary(waypoint: Waypoint, observation: Observation, span: float) -> Boundary:
    """Return the conditions of one passage, in its own frame; (13) and (14) of the paper."""
    element, passage = waypoint.passage.element, waypoint.passage
    bounds = element.conditions(waypoint.axis)
    if passage.speed.bounded:
        bounds["V_K"] = passage.speed
    if passage.roll is not None:
        bounds |= _rolled(passage.roll, waypoint.rolled)
    frame = element.frame(axis=waypoint.axis, bank=waypoint.bank or 0.0, span=span)
    values = (*crossing_parameters(frame).join(), *element.sight_values)
    return Boundary(passage.name, bounds, with_sight(observation, element.sight), values)


def piece_boundary(waypoint: Waypoint, observation: Observation) -> Boundary:
    """Return the conditions of a passage as a piece of the homotopy meets it: as planned, so the next can begin there.

    Position and prescribed bank are exact; course and climb keep within `PIECE_ANGLE` of the plan.
    """
    steep = abs(waypoint.climb) > math.radians(80.0)
    bounds: dict[str, Interval] = {}
    if steep:
        bounds = {"climb_sine": Interval(lower=0.9) if waypoint.climb > 0.0 else Interval(upper=-0.9)}
        bounds |= {"course_sine": Interval(-0.1, 0.1), "course_cosine": Interval(-0.1, 0.1)}
    else:
        near = Interval(waypoint.climb - PIECE_ANGLE, waypoint.climb + PIECE_ANGLE)
        bounds = {"course_excess_right": NOT_POSITIVE, "course_excess_left": NOT_POSITIVE, **climb_condition(near)}
    if waypoint.position is not None:
        north, east, height = waypoint.position
        bounds |= {"x": Interval.exactly(north), "y": Interval.exactly(east), "z": Interval.exactly(-height)}
    if waypoint.bank is not None and not steep:
        bounds |= {"bank_sine": ZERO, "bank_cosine": POSITIVE}
    if waypoint.passage.speed.bounded:
        bounds["V_K"] = waypoint.passage.speed
    frame = Frame(axis=waypoint.heading, bank=waypoint.bank or 0.0, crossing_tan=math.tan(PIECE_ANGLE))
    return Boundary(waypoint.passage.name, bounds, observation, tuple(crossing_parameters(frame).join()))


def _rolled(roll: Roll, planned: float) -> dict[str, Interval]:
    """Return the conditions of a roll that goes far enough, to the side to which the plan rolls."""
    angle = Interval(lower=roll.angle) if planned > 0.0 else Interval(upper=-roll.angle)
    return {"Phi": angle, "gain": Interval(lower=roll.gain)}


def crossing_parameters(frame: Frame) -> CrossingParameters[float]:
    """Return the frame of a passage as the parameters by which a crossing is observed."""
    return CrossingParameters(
        centre_north=frame.north,
        centre_east=frame.east,
        axis_north=math.cos(frame.axis),
        axis_east=math.sin(frame.axis),
        bank_cos=math.cos(frame.bank),
        bank_sin=math.sin(frame.bank),
        bank_tan=frame.bank_tan,
        crossing_tan=frame.crossing_tan,
        half_span=frame.half_span,
    )
