"""The parts of a race as an optimal control problem: the conditions at its passages, at its ends and along its legs.

Among them are the limits of a pilot: at gates, at start and finish, and near the ground.
"""

import dataclasses
import itertools
import math
from collections.abc import Sequence
from typing import Self

from airrace.errors import UsageError
from airrace.model.dynamics.flight_model import FROM_ZERO, FlightModel
from airrace.model.dynamics.limits import symmetric
from airrace.model.dynamics.observations import (
    AIRSPEED,
    SIDE_ACCELERATION,
    CrossingParameters,
    CrowdKind,
    airspeed_observation,
    airspeed_values,
    climb_observation,
    crowd_observation,
    crowd_values,
    line_observation,
    line_values,
    settled_observation,
    with_output,
)
from airrace.model.dynamics.pilot_observation import (
    LATERAL_LOAD_FACTOR,
    LOAD_FACTOR,
    LOW_LOAD_FACTOR,
    ONSET,
    ROLL_RATE,
    SIDESLIP,
    TURN_EXCESS,
    TURN_LACK,
    crossing_observation_of_pilot,
    low_flight_observation,
)
from airrace.model.environment import Air, WindField
from airrace.model.track.course import Course, PilotLimits, Rules, StartSpeed
from airrace.model.track.element import Frame, climb_condition
from airrace.model.track.gates import NOT_POSITIVE, POSITIVE, ZERO
from airrace.model.track.polygons import area, edges
from airrace.optimal_control.problem import Boundary, PathConstraint
from airrace.optimal_control.quantities import Interval, Quantity
from airrace.optimal_control.system import Observation, side_by_side
from airrace.procedure.planning.plan import Plan
from airrace.procedure.planning.route_decisions import Waypoint

LEAST_COSINE = 0.1
"""The least cosine of a prescribed bank at which a steady turn is asked for (1): it takes 10 g there, none beyond."""
PILOT_NAMES = frozenset(
    quantity.name for quantity in (LOAD_FACTOR, ONSET, ROLL_RATE, TURN_EXCESS, TURN_LACK, LATERAL_LOAD_FACTOR, SIDESLIP)
)
"""The quantities by which a pilot's limits hold at passages."""
NEAR_GROUND = "load factor near the ground"


@dataclasses.dataclass(frozen=True)
class PilotConditions:
    """The limits of a pilot as a model observes them, see `airrace.model.dynamics.pilot_observation`.

    Attributes:
        limits: the limits.
        crossing: the observation at passages.
        low: the constraint along every leg; None without a least load factor near the ground.
        values: the numbers of aircraft and air.
    """

    limits: PilotLimits
    crossing: Observation
    low: PathConstraint | None
    values: tuple[float, ...]

    @classmethod
    def of(cls, model: FlightModel, rules: Rules) -> Self | None:
        """Return the conditions of a model under rules; None if the rules set no limits of the pilot."""
        limits = rules.pilot
        if limits == PilotLimits():
            return None
        values = tuple(float(value) for value in model.parameter_values)
        low = None
        if math.isfinite(limits.n_z_low):
            smooth, exact = (low_flight_observation(model, exact=is_exact) for is_exact in (False, True))
            low = _near_ground(limits, smooth, exact, values)
        return cls(limits, crossing_observation_of_pilot(model), low, values)

    def of_other_numbers(self, model: FlightModel, rules: Rules) -> Self:
        """Return the conditions of a model and rules that differ in numbers alone."""
        values, low = tuple(float(value) for value in model.parameter_values), self.low
        if (values, rules.pilot) == (self.values, self.limits):
            return self
        if low is not None:
            low = _near_ground(rules.pilot, low.observation, low.exact, values)
        return dataclasses.replace(self, limits=rules.pilot, low=low, values=values)

    @property
    def along(self) -> tuple[PathConstraint, ...]:
        """The constraints along every leg."""
        return () if self.low is None else (self.low,)

    def at(self, boundary: Boundary, waypoint: Waypoint, *, start: bool = False, finish: bool = False) -> Boundary:
        """Return the boundary of a passage with the pilot's limits there."""
        limits, element = self.limits, waypoint.passage.element
        bounds: dict[str, Interval] = {}
        if element.stands or start or finish:
            magnitudes = {
                ROLL_RATE.name: limits.roll_rate,
                ONSET.name: limits.onset,
                SIDESLIP.name: limits.sideslip,
                LATERAL_LOAD_FACTOR.name: limits.n_y,
            }
            observed = {quantity.name for quantity in self.crossing.quantities}  # a point mass has no onset
            for name, magnitude in magnitudes.items():
                if name in observed and math.isfinite(magnitude):
                    bounds[name] = symmetric(magnitude)
        if (start or finish) and math.isfinite(limits.n_z_ends):
            bounds[LOAD_FACTOR.name] = Interval(lower=limits.n_z_ends)
        if (start and limits.steady_start) or (finish and limits.steady_finish):
            bounds[ROLL_RATE.name] = ZERO
            if math.cos(element.prescribed_bank or 0.0) > LEAST_COSINE:
                bounds |= {TURN_EXCESS.name: NOT_POSITIVE, TURN_LACK.name: NOT_POSITIVE}
        observation = boundary.observation
        if not bounds or observation is None:
            return boundary
        return dataclasses.replace(
            boundary,
            bounds={**boundary.bounds, **bounds},
            observation=side_by_side(observation, self.crossing),
            values=(*boundary.values, limits.turn_tolerance, *self.values),
        )


def without_pilot(boundary: Boundary) -> Boundary:
    """Return the boundary of a passage without the limits of `PilotConditions`."""
    return dataclasses.replace(
        boundary, bounds={name: at for name, at in boundary.bounds.items() if name not in PILOT_NAMES}
    )


def _near_ground(
    limits: PilotLimits, smooth: Observation, exact: Observation | None, values: tuple[float, ...]
) -> PathConstraint:
    bounds = {LOW_LOAD_FACTOR.name: Interval(lower=limits.n_z_low)}
    return PathConstraint(NEAR_GROUND, bounds, smooth, (limits.low_height, *values), exact)


@dataclasses.dataclass(frozen=True)
class StartAirspeed:
    """The airspeed at the boundary of a start, which replaces its speed over ground.

    Attributes:
        airspeed: see `airrace.model.dynamics.observations`.
        values: the numbers of the air.
    """

    airspeed: Observation
    values: tuple[float, ...]

    @classmethod
    def of(cls, model: FlightModel, rules: Rules, air: Air) -> Self | None:
        """Return it for a model under rules in the air of the day; None where the limit is of the speed over ground."""
        if rules.start_speed is StartSpeed.GROUND:
            return None
        indicated = rules.start_speed is StartSpeed.INDICATED
        observed = airspeed_observation(model.system.states, WindField.from_air(air), indicated=indicated)
        return cls(observed, airspeed_values(air))

    def of_other_numbers(self, air: Air) -> Self:
        """Return it for an air that differs in numbers alone."""
        return dataclasses.replace(self, values=airspeed_values(air))

    def at(self, boundary: Boundary, speed: Interval) -> Boundary:
        """Return the boundary of a start that is passed at a speed within a range (m/s)."""
        observation = boundary.observation
        if not speed.constrained or observation is None:
            return boundary
        bounds = {name: at for name, at in boundary.bounds.items() if name != "V_K"}
        return dataclasses.replace(
            boundary,
            bounds={**bounds, AIRSPEED.name: speed},
            observation=side_by_side(observation, self.airspeed),
            values=(*boundary.values, *self.values),
        )


PIECE_ANGLE = math.radians(10.0)
"""The largest angle by which a piece of the homotopy may leave the planned course and climb, rad."""

NamedPassing = tuple[str, str]
"""The name of a passing and, where it is known, its kind."""


@dataclasses.dataclass(frozen=True)
class Trim:
    """The condition that the inner loop is settled at an end of the race, see `airrace.model.dynamics.observations`.

    Attributes:
        crossing: the observation at the boundaries of passages.
        settled: the observation whose quantities are zero in trimmed flight.
        values: its parameters, the numbers of aircraft and air.
    """

    crossing: Observation
    settled: Observation
    values: tuple[float, ...]

    @classmethod
    def of(cls, model: FlightModel, crossing: Observation) -> Self:
        """Return the condition for a model that sees the course's passages as `crossing`."""
        settled = settled_observation(model)
        values = tuple(float(value) for value in model.parameter_values)
        return cls(crossing, settled, values)

    def of_other_numbers(self, model: FlightModel) -> Self:
        """Return the condition for a model that differs in numbers alone."""
        return dataclasses.replace(self, values=tuple(float(value) for value in model.parameter_values))

    def at(self, boundary: Boundary) -> Boundary:
        """Return the boundary of a passage that is to be met in settled flight."""
        observation = boundary.observation
        assert observation is not None  # it is the boundary of a passage
        return dataclasses.replace(
            boundary,
            bounds={**boundary.bounds, **{quantity.name: ZERO for quantity in self.settled.quantities}},
            observation=side_by_side(observation, self.settled),
            values=(*boundary.values, *self.values),
        )


def without_trim(boundary: Boundary) -> Boundary:
    """Return the boundary of a passage without the conditions of `Trim`."""
    quantities = () if boundary.observation is None else boundary.observation.quantities
    added = {quantity.name for quantity in quantities if quantity.rate_of or quantity == SIDE_ACCELERATION}
    return dataclasses.replace(boundary, bounds={name: at for name, at in boundary.bounds.items() if name not in added})


def boundaries(
    plan: Plan,
    course: Course,
    observation: Observation,
    trim: Trim | None,
    span: float,
    pilot: PilotConditions | None = None,
    start_airspeed: StartAirspeed | None = None,
) -> list[Boundary]:
    """Return the conditions of all passages, in which counting begins anew where a roll does."""
    conditions = [boundary(waypoint, observation, span) for waypoint in plan.waypoints]
    if start_airspeed is not None:
        conditions[0] = start_airspeed.at(conditions[0], plan.waypoints[0].passage.speed)
    if pilot is not None:
        last = len(conditions) - 1
        conditions = [
            pilot.at(passage, waypoint, start=index == 0, finish=index == last)
            for index, (passage, waypoint) in enumerate(zip(conditions, plan.waypoints, strict=True))
        ]
    for index, following in enumerate(plan.waypoints[1:]):
        if following.passage.roll is not None:
            conditions[index] = dataclasses.replace(conditions[index], bounds={**conditions[index].bounds, **FROM_ZERO})
    for index, settled in zip((0, -1), course.settled_ends, strict=True):
        if trim is not None and settled:
            conditions[index] = trim.at(conditions[index])
    return conditions


def boundary(waypoint: Waypoint, observation: Observation, span: float) -> Boundary:
    """Return the conditions of one passage, in its own frame; (13) and (14) of the paper."""
    element, passage = waypoint.passage.element, waypoint.passage
    bounds = element.conditions(waypoint.axis)
    if passage.speed.constrained:
        bounds["V_K"] = passage.speed
    if passage.roll is not None:
        angle = passage.roll.angle  # to the side to which the plan rolls
        bounds["Phi"] = Interval(lower=angle) if waypoint.rolled > 0.0 else Interval(upper=-angle)
        bounds["gain"] = Interval(lower=passage.roll.gain)
    frame = element.frame(axis=waypoint.axis, bank=waypoint.bank or 0.0, span=span)
    values = (*crossing_parameters(frame).join(), *element.output_values)
    return Boundary(passage.name, bounds, with_output(observation, element.output), values)


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
    if waypoint.passage.speed.constrained:
        bounds["V_K"] = waypoint.passage.speed
    frame = Frame(axis=waypoint.heading, bank=waypoint.bank or 0.0, crossing_tan=math.tan(PIECE_ANGLE))
    return Boundary(waypoint.passage.name, bounds, observation, tuple(crossing_parameters(frame).join()))


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


def path_constraints(course: Course, states: Sequence[Quantity]) -> tuple[tuple[PathConstraint, ...], ...]:
    """Return the constraints along each leg besides the aircraft's limits: lines, crowd, the climb angle of a roll.

    There is one leg less than there are passages. All legs share one observation of each kind.
    """
    line = line_observation(states)
    climb, exact_climb = climb_observation(states, exact=False), climb_observation(states, exact=True)
    crowds: dict[CrowdKind, tuple[Observation, Observation]] = {}

    def beside(name: str, values: tuple[float, ...], margin: float) -> PathConstraint:
        return PathConstraint(name, {"beside": Interval(lower=margin)}, line, values)

    everywhere: list[PathConstraint] = []
    if course.airspace:
        right = area(course.airspace) > 0.0
        for number, (a, b) in enumerate(edges(course.airspace, closed=True), start=1):
            everywhere.append(beside(f"airspace, side {number}", line_values(a, b, right=right), 0.0))
    for crowd in course.crowd:
        kind = CrowdKind.from_crowd(crowd)
        if kind not in crowds:
            crowds[kind] = crowd_observation(states, kind, exact=False), crowd_observation(states, kind, exact=True)
        smooth, exact = crowds[kind]
        distance = {"distance": Interval(lower=crowd.distance)}
        everywhere.append(PathConstraint(f"crowd {crowd.name}", distance, smooth, crowd_values(crowd), exact))
    legs: list[tuple[PathConstraint, ...]] = []
    for passage in course.passages[1:]:
        lines = [
            beside(
                f"safety line {safety_line.name}",
                line_values(safety_line.start, safety_line.end, right=safety_line.keep_right),
                safety_line.margin,
            )
            for safety_line in passage.safety_lines
        ]
        if passage.roll is not None:
            lines.append(PathConstraint("roll", {"climb": passage.roll.climb}, climb, (), exact_climb))
        legs.append((*everywhere, *lines))
    return tuple(legs)


def passings_of(course: Course) -> list[NamedPassing]:
    """Return the names and kinds of the elements that a course passes, in order."""
    return [(passage.name, type(passage.element).__name__.lower()) for passage in course.passages]


def ensure_same_passings(own: Sequence[NamedPassing], source: Sequence[NamedPassing], name: str) -> None:
    """Refuse a run whose passings differ: its flight leads through another course.

    Args:
        own: the passings of this race.
        source: those of the run to start from; unknown kinds are empty.
        name: label of that run.

    Raises:
        UsageError: naming the first passing that differs.
    """
    for number, (passing, source_passing) in enumerate(itertools.zip_longest(own, source), start=1):
        if passing is None or source_passing is None:
            longer, extra = ("this course", passing) if source_passing is None else (name, source_passing)
            assert extra is not None  # only one of the two sequences has ended
            raise UsageError(f"{name} flies other passings: only {longer} has a passing number {number}, {extra[0]}")
        same_kind = passing[1] == source_passing[1] or not (passing[1] and source_passing[1])
        if passing[0] != source_passing[0] or not same_kind:
            texts: list[str] = []
            for passing_name, kind in (source_passing, passing):
                texts.append(f"{passing_name} ({kind})" if kind and not same_kind else passing_name)
            raise UsageError(
                f"{name} flies other passings: number {number} is {texts[0]} there and {texts[1]} here; "
                "start without it, or keep the names and the order of the passings"
            )
