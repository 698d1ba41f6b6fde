"""The race as an optimal control problem: a phase per leg, a boundary per passage."""

import dataclasses
import math
from collections.abc import Mapping, Sequence

from airrace.aircraft.aircraft import Aircraft
from airrace.dynamics.crossing import CrossingParameters
from airrace.dynamics.flight_model import FlightModel
from airrace.dynamics.roll_counter import COUNTING, FROM_ZERO
from airrace.optimal_control.problem import Boundary, Objective, Phase, Problem, Watch
from airrace.procedure.ends import Ends
from airrace.procedure.guess import leg_seconds
from airrace.procedure.plan import Plan
from airrace.procedure.waypoints import Waypoint
from airrace.quantities import Interval
from airrace.system import Observation
from airrace.track.gates import Gate, Manoeuvre, Passing, Pylon, Tolerances
from airrace.track.limits import Roll

SHORTEST = 0.1  # s, of a phase
DETOUR, DETOUR_SECONDS = 3.0, 10.0  # longest duration of a phase: factor on the plan and s on top
TIME_SCALE = 3.0  # s
PIECE_ANGLE = math.radians(10.0)  # how far a piece of the homotopy may leave the planned course and climb
WIDE = math.radians(89.9)  # beyond this the tangent of a tolerance is too large to compute with
VERTICAL = 1e-6  # a climb angle this close to +-pi/2 is vertical
POSITIVE = Interval(lower=0.0)
NOT_POSITIVE = Interval(upper=0.0)
ZERO = Interval.exactly(0.0)


def race_problem(
    plan: Plan,
    mesh: Sequence[tuple[float, ...]],
    *,
    watches: Sequence[tuple[Watch, ...]],
    model: FlightModel,
    observation: Observation,
    ends: Ends,
    aircraft: Aircraft,
    regularised: Mapping[str, float],
) -> Problem:
    """The joint problem over all phases.

    Args:
        plan: waypoints in flown order.
        mesh: fractions of each phase's intervals.
        watches: what holds along each phase.
        model: the aircraft's equations.
        observation: the crossing, seen from the model's states.
        ends: what is asked of the first and the last passage besides.
        aircraft: for its wing span.
        regularised: weights of the squared, scaled controls by name.
    """
    first, *between, last = _boundaries(plan, observation, aircraft.airframe.b)
    start = ends.start(first)
    phases = [
        Phase(
            name=f"{a.passage.name} -> {b.passage.name}",
            fractions=fractions,
            duration=Interval(SHORTEST, DETOUR * seconds + DETOUR_SECONDS),
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
        time_scale=TIME_SCALE,
    )


def _boundaries(plan: Plan, observation: Observation, span: float) -> list[Boundary]:
    """The conditions of all passages; counting begins anew where a roll does."""
    boundaries = [boundary(waypoint, observation, span) for waypoint in plan.waypoints]
    for index, following in enumerate(plan.waypoints[1:]):
        if following.passage.roll is not None:
            before = boundaries[index]
            boundaries[index] = dataclasses.replace(before, bounds={**before.bounds, **FROM_ZERO})
    return boundaries


def boundary(waypoint: Waypoint, observation: Observation, span: float) -> Boundary:
    """The conditions of one passage, in its own frame."""
    element, passage = waypoint.passage.element, waypoint.passage
    if isinstance(element, Gate):
        bounds = _gate(element, element.tolerances)
    elif isinstance(element, Pylon):
        bounds = _pylon(element, waypoint)
    else:
        bounds = _manoeuvre(element)
    if passage.speed.bounded:
        bounds["V_K"] = passage.speed
    if passage.roll is not None:
        bounds |= _rolled(passage.roll, waypoint.rolled)
    place = _place(waypoint, span)
    return Boundary(passage.name, bounds, observation, tuple(place.join()))


def piece_boundary(waypoint: Waypoint, observation: Observation) -> Boundary:
    """A passage as one piece of the homotopy meets it: exactly as planned, so that the next piece can begin there.

    Position and prescribed bank are exact; course and climb keep within `PIECE_ANGLE` of the plan.
    """
    steep = abs(waypoint.climb) > math.radians(80.0)
    bounds: dict[str, Interval] = {}
    if steep:
        bounds = {"climb_sine": Interval(lower=0.9) if waypoint.climb > 0.0 else Interval(upper=-0.9)}
        bounds |= {"course_sine": Interval(-0.1, 0.1), "course_cosine": Interval(-0.1, 0.1)}
    else:
        near = Interval(waypoint.climb - PIECE_ANGLE, waypoint.climb + PIECE_ANGLE)
        bounds = {"course_excess_right": NOT_POSITIVE, "course_excess_left": NOT_POSITIVE, **_climb(near)}
    if waypoint.position is not None:
        north, east, height = waypoint.position
        bounds |= {"x": Interval.exactly(north), "y": Interval.exactly(east), "z": Interval.exactly(-height)}
    if waypoint.bank is not None and not steep:
        bounds |= {"bank_sine": ZERO, "bank_cosine": POSITIVE}
    if waypoint.passage.speed.bounded:
        bounds["V_K"] = waypoint.passage.speed
    bank = waypoint.bank or 0.0
    place = CrossingParameters(
        centre_north=0.0,
        centre_east=0.0,
        axis_north=math.cos(waypoint.heading),
        axis_east=math.sin(waypoint.heading),
        bank_cos=math.cos(bank),
        bank_sin=math.sin(bank),
        bank_tan=0.0,
        crossing_tan=math.tan(PIECE_ANGLE),
        half_span=0.0,
    )
    return Boundary(waypoint.passage.name, bounds, observation, tuple(place.join()))


def _gate(gate: Gate, allowed: Tolerances) -> dict[str, Interval]:
    bounds = {"along": ZERO, "course_excess_right": NOT_POSITIVE, "course_excess_left": NOT_POSITIVE}
    if gate.passing is Passing.POINT:
        exact = {"right": ZERO, "height": Interval.exactly(gate.height)}
        return bounds | exact | {"bank_sine": ZERO, "bank_cosine": POSITIVE} | _climb(allowed.climb)
    reach = gate.width / 2 - allowed.clearance
    between = Interval(-reach, reach)
    bounds |= {"right_wing": between, "left_wing": between, "height": allowed.height}
    if allowed.bank > WIDE:
        bounds["bank_cosine"] = POSITIVE
    else:
        bounds |= {"bank_excess_right": NOT_POSITIVE, "bank_excess_left": NOT_POSITIVE}
    return bounds | _climb(allowed.climb)


def _pylon(pylon: Pylon, waypoint: Waypoint) -> dict[str, Interval]:
    """Passed on its side, both wing tips clear of it, measured across the track."""
    allowed = pylon.tolerances
    to_right = math.sin(pylon.side - waypoint.axis) > 0.0
    clear = Interval(lower=allowed.clearance) if to_right else Interval(upper=-allowed.clearance)
    bounds = {
        "along": ZERO,
        "right": Interval(0.0, pylon.reach) if to_right else Interval(-pylon.reach, 0.0),
        "beside_right": clear,
        "beside_left": clear,
        "course_excess_right": NOT_POSITIVE,
        "course_excess_left": NOT_POSITIVE,
    }
    if pylon.passing is Passing.POINT:
        return bounds | {"height": Interval.exactly(pylon.height)} | _climb(allowed.climb)
    return bounds | {"height": allowed.height} | _climb(allowed.climb)


def _climb(allowed: Interval) -> dict[str, Interval]:
    """A range of climb angles; none where it allows everything."""
    lower = math.sin(allowed.lower) if allowed.lower > -math.pi / 2 else -math.inf
    upper = math.sin(allowed.upper) if allowed.upper < math.pi / 2 else math.inf
    return {"climb_sine": Interval(lower, upper)}


def _manoeuvre(element: Manoeuvre) -> dict[str, Interval]:
    """A prescribed attitude. The vertical is two conditions: the sine of the climb angle is flat there."""
    bounds = {"x": element.north, "y": element.east, "z": Interval(-element.height.upper, -element.height.lower)}
    if element.climb is not None and element.climb_tolerance > 0.0:
        reach = Interval(element.climb - element.climb_tolerance, element.climb + element.climb_tolerance)
        bounds |= _climb(reach)
    elif element.climb is not None and abs(abs(element.climb) - math.pi / 2) < VERTICAL:
        up = POSITIVE if element.climb > 0.0 else NOT_POSITIVE
        return bounds | {"course_sine": ZERO, "course_cosine": ZERO, "climb_sine": up}
    elif element.climb is not None:
        bounds["climb_sine"] = Interval.exactly(math.sin(element.climb))
    if element.heading is not None:
        bounds |= {"course_sine": ZERO, "course_cosine": POSITIVE}
    if element.bank is not None:
        bounds |= {"bank_sine": ZERO, "bank_cosine": POSITIVE}
    return bounds


def _rolled(roll: Roll, planned: float) -> dict[str, Interval]:
    """Far enough, to the side to which the plan rolls."""
    angle = Interval(lower=roll.angle) if planned > 0.0 else Interval(upper=-roll.angle)
    return {"Phi": angle, "gain": Interval(lower=roll.gain)}


def _place(waypoint: Waypoint, span: float) -> CrossingParameters[float]:
    """The frame of a passage. That of a manoeuvre is its own, whatever was planned: where its course is free any frame
    would do, and one flight must not be told in several."""
    element = waypoint.passage.element
    if isinstance(element, Manoeuvre):
        return _frame(0.0, 0.0, axis=element.heading or 0.0, bank=element.bank or 0.0)
    tolerances = element.tolerances
    return dataclasses.replace(
        _frame(element.north, element.east, axis=waypoint.axis, bank=waypoint.bank or 0.0),
        bank_tan=math.tan(tolerances.bank) if tolerances.bank <= WIDE else 0.0,
        crossing_tan=math.tan(tolerances.crossing),
        half_span=0.0 if element.passing is Passing.POINT else span / 2,
    )


def _frame(north: float, east: float, *, axis: float, bank: float) -> CrossingParameters[float]:
    return CrossingParameters(
        centre_north=north,
        centre_east=east,
        axis_north=math.cos(axis),
        axis_east=math.sin(axis),
        bank_cos=math.cos(bank),
        bank_sin=math.sin(bank),
        bank_tan=0.0,
        crossing_tan=0.0,
        half_span=0.0,
    )
