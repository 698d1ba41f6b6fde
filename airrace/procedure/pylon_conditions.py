"""The conditions that the wing keeps clear of pylons when it is abeam of them, and their measurement on a flight.

A condition holds at one node, from which the clearance from the pylon is predicted (`PylonRoom`).
Where there is no flight yet, there is one for every pylon of a passing, at the node of the passing. On a flight the
distance of the wing is measured in continuous time; then a node is moved to the moment abeam, and the error of
the prediction is added to the required clearance. Pylons of other elements get a condition where a flight comes too
near to them: to the side, or above, wherever least is missing.

The node has to be near that moment: changes of the controls until then are not predicted, so that the condition, and
the Hamiltonian with it, would drift along the flight.
"""

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from operator import attrgetter
from typing import Self

import numpy as np

from airrace.model.dynamics.flight_model import FlightModel
from airrace.model.dynamics.observations import PylonRoom, pylon_room_observation
from airrace.model.track.course import Course
from airrace.model.track.polygons import Point
from airrace.optimal_control.mesh_refinement import Fractions, Marks, Mesh, move_nodes
from airrace.optimal_control.problem import Iterate, PathConstraint, Problem
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.replay import Replay
from airrace.optimal_control.system import SYMBOLS, Observation, System
from airrace.optimal_control.trajectory import Array
from airrace.procedure.planning.clearance import ClosestApproach, PylonPost, cleared_pylons, place_of
from airrace.procedure.planning.plan import Plan
from airrace.procedure.planning.route_decisions import Waypoint
from airrace.procedure.result import PylonCondition, PylonSide

CLEARANCE_ROUNDS_MAX = 6
"""Largest number of solves on a mesh that was good already, for wings that were measured to be too near to pylons."""
CLEARANCE_SAFETY = 0.3
"""Share of the certificate's limit by which a clearance may be missed on a mesh whose intervals are halved next."""
FAR_VIOLATION = 1.0
"""Length by which a clearance is missed beyond which multipliers of the flight that misses it mislead, m."""
EXCESS_LEFT_MAX = 0.9
"""Share to which a solve has to bring what wings keep needlessly away from pylons for another one to follow."""
PASSING_SECONDS = 0.5
"""Time within which a pylon is passed but once, s."""
ABEAM_SECONDS = 0.03
"""Time within which cylinders of one obstacle are abeam at once, s: three metres of way."""
TOUCHING_DISTANCE = 0.05
"""Distance below which a pylon counts as hit, m; the depth of the hit is unknown."""
ERROR_MAX = 1.0
"""Largest credible error of a prediction, m."""
EXCESS_MAX = 0.05
"""Length by which a condition may keep the wing farther away than its clearance, m."""
HOLDING_CLEARANCE = 0.01
"""Margin up to which a condition is active, m."""
BINDING_CLEARANCE = 1.0
"""Margin up to which it may be active on the next mesh, m."""
TIP_DEPTH_MAX = 0.25
"""Depth of the lower tip below the top of a pylon up to which passing above is tried instead of beside, m.

On seven courses 13 flights above pylons beside which it was deeper were 6 ms to 1.2 s slower, and one was 6 ms faster.
"""
OFFSET_MAX = 2e-3
"""Time beside the moment abeam from which on a condition may make the Hamiltonian drift, s. A judgement: nodes that
were moved lie within half a millisecond; at 18 ms it drifted by four times its limit."""
ROLL_SECONDS = 5e-3
"""Time before and after a moment abeam over which the roll accelerates, s; the tips are abeam within it."""

OBSERVED_CLEARANCE = {
    PylonSide.RIGHT: (("left_tip", 1.0), ("right_tip", 1.0)),
    PylonSide.LEFT: (("left_tip", -1.0), ("right_tip", -1.0)),
    PylonSide.BELOW: (("above_left", 1.0), ("above_right", 1.0)),
}
"""The observed quantities of which the least is the clearance from a pylon, with their signs."""


@dataclasses.dataclass(frozen=True, eq=False)
class ReplayedFlight:
    """A replayed flight.

    Attributes:
        problem: of the flight.
        durations: of its legs, s; shape (n,).
        replay: of its controls.
    """

    problem: Problem
    durations: Array
    replay: Replay

    def state(self, leg: int, share: float) -> Array:
        """Return the state at a share of a leg's duration, shape (n_x,)."""
        places = np.concatenate([[0.0], np.cumsum(self.problem.phases[leg].fractions)])
        within = int(np.clip(np.searchsorted(places, share, side="right") - 1, 0, len(places) - 2))
        samples: Array = self.replay.state[:, self.problem.first_node[leg] + within]
        part = (share - places[within]) / (places[within + 1] - places[within]) * (samples.shape[1] - 1)
        before = min(int(part), samples.shape[1] - 2)
        return samples[:, before] + (part - before) * (samples[:, before + 1] - samples[:, before])

    def time(self, condition: PylonCondition) -> float:
        """Return the time of a condition, s."""
        return float(self.durations[: condition.leg].sum() + condition.share * self.durations[condition.leg])

    def same(self, condition: PylonCondition, approach: ClosestApproach) -> bool:
        """Return whether an approach is to a condition's pylon at the same passing."""
        if (condition.element, condition.post) != (approach.pylon.name, approach.pylon.post):
            return False
        return abs(approach.time - self.time(condition)) <= PASSING_SECONDS

    def at(self, condition: PylonCondition, approach: ClosestApproach) -> PylonCondition:
        """Return a condition at the moment abeam of an approach."""
        ends = np.cumsum(self.durations)
        leg = min(int(np.searchsorted(ends, approach.abeam)), len(ends) - 1)
        share = 1.0 - (float(ends[leg]) - approach.abeam) / float(self.durations[leg])
        return dataclasses.replace(condition, leg=leg, share=min(max(share, 0.0), 1.0))


@dataclasses.dataclass(frozen=True)
class MeasuredConditions:
    """The conditions as a flight measures them.

    Attributes:
        conditions: at the moments abeam, as far as the flight comes near.
        distances: of the wing from their pylons, m; NaN where it does not come near.
        binding: whether the clearance hardly exceeds the required one, or is too small.
        violation: the largest length by which a clearance is violated, m.
        excess: the largest length beyond its clearance at which a condition keeps the wing away, m.
        offset: the longest time from a condition that keeps the wing away to its moment abeam, s.
    """

    conditions: tuple[PylonCondition, ...]
    distances: tuple[float, ...]
    binding: tuple[bool, ...]
    violation: float
    excess: float
    offset: float

    @property
    def is_excessive(self) -> bool:
        """Whether a condition keeps the wing farther away than another solve would."""
        return self.excess > EXCESS_MAX

    @property
    def is_beside(self) -> bool:
        """Whether a condition stands so far beside its moment abeam that the Hamiltonian may drift there."""
        return self.offset > OFFSET_MAX


@dataclasses.dataclass(frozen=True)
class ClearanceConstraints:
    """The constraints that keep the wing clear of the pylons of a course, as a model sees them.

    Attributes:
        system: the model.
        pylons: by the names of their elements and their numbers among the pylons of these.
        semispan: from the aircraft's centre to a wing tip, m.
        values: the numbers of aircraft and air.
        conditions: the conditions; None for the pylons of every passing, as planned.
    """

    system: System
    pylons: Mapping[tuple[str, int], PylonPost]
    semispan: float
    values: tuple[float, ...]
    conditions: tuple[PylonCondition, ...] | None = None

    @classmethod
    def of(cls, model: FlightModel, course: Course, span: float) -> Self:
        """Return the constraints for a model on a course."""
        values = tuple(float(value) for value in model.parameter_values)
        pylons = {(pylon.name, pylon.post): pylon for pylon in cleared_pylons(course)}
        return cls(model.system, pylons, 0.5 * span, values)

    @cached_property
    def observation(self) -> Observation:
        """The observation; many flights come near no pylon, and need none."""
        with SYMBOLS:
            return pylon_room_observation(self.system)

    def of_other_numbers(self, model: FlightModel, course: Course, span: float, plan: Plan) -> Self:
        """Return the constraints for a race that differs in numbers or obstacles, under the same conditions."""
        constraints = dataclasses.replace(self.of(model, course, span), system=self.system)
        return constraints.with_conditions(self.conditions_on(plan))

    def with_conditions(self, conditions: Sequence[PylonCondition]) -> Self:
        """Return the constraints under other conditions, of which those of unknown pylons are left out.

        Without any, those of the passings hold.
        """
        usable = tuple(condition for condition in conditions if (condition.element, condition.post) in self.pylons)
        return dataclasses.replace(self, conditions=usable or None)

    def conditions_on(self, plan: Plan) -> tuple[PylonCondition, ...]:
        """Return the conditions along a plan."""
        return self._at_passings(plan) if self.conditions is None else self.conditions

    def _at_passings(self, plan: Plan) -> tuple[PylonCondition, ...]:
        """Return a condition for every pylon of every passing, on the side on which the plan passes it.

        A wing whose tips are above the pylon at the least height of the passing and its prescribed bank passes above.
        """
        conditions: list[PylonCondition] = []
        standing = {place_of(pylon): pylon for pylon in self.pylons.values() if not pylon.is_obstacle}
        for number, waypoint in enumerate(plan.waypoints):
            element = waypoint.passage.element
            posts = element.drawing().posts if element.place is not None else ()
            for place in posts:
                pylon = standing.get(place_of(place))
                if pylon is None:
                    continue
                above = element.heights.lower - pylon.height - pylon.required
                if above >= self.semispan:
                    continue
                is_above = waypoint.bank is not None and above >= self.semispan * abs(math.sin(waypoint.bank))
                side = PylonSide.BELOW if is_above else _side_beside(waypoint, place)
                leg, share = max(number - 1, 0), float(number > 0)
                conditions.append(PylonCondition(pylon.name, pylon.post, leg, share, side, 0.0))
        return tuple(conditions)

    def on_other_sides(self, plan: Plan, problem: Problem, iterate: Iterate) -> Iterator[tuple[PylonCondition, ...]]:
        """Yield the conditions with one pylon at a time on another side of a flight.

        The pylons are those with active conditions. One of a passing at either end of the leg is to be passed beside
        instead of above, or above instead of beside where both tips are near its top; all others left instead of right,
        or the other way round, with all cylinders of an obstacle on one side.
        """
        conditions, obstacles = self.conditions_on(plan), set[tuple[str, int]]()
        for condition in conditions:
            pylon = self.pylons[condition.element, condition.post]
            if pylon.is_obstacle and (pylon.name, condition.leg) in obstacles:
                continue
            places = np.cumsum([0.0, *problem.phases[condition.leg].fractions])
            node = problem.first_node[condition.leg] + int(np.abs(places - condition.share).argmin())
            outputs = self._observe(condition, iterate.state[:, node])
            if self._clearance(condition, outputs) - self._required_clearance(condition) >= HOLDING_CLEARANCE:
                continue
            near_top = min(outputs["above_left"], outputs["above_right"]) > -TIP_DEPTH_MAX
            side = self._other_side(condition, plan, float(iterate.durations[condition.leg]), near_top=near_top)
            if side is None:
                continue
            if pylon.is_obstacle:
                obstacles.add((pylon.name, condition.leg))
            changed: list[PylonCondition] = []
            for current in conditions:
                if current is condition or (pylon.is_obstacle and _same_obstacle(current, condition)):
                    current = dataclasses.replace(current, side=side, error=0.0)
                changed.append(current)
            yield tuple(changed)

    def _other_side(self, condition: PylonCondition, plan: Plan, seconds: float, *, near_top: bool) -> PylonSide | None:
        """Return the side on which a pylon may be passed as well; None if there is none.

        Args:
            condition: on its side of now.
            plan: of the flight.
            seconds: duration of the leg, s.
            near_top: whether both tips come by near the top of the pylon, or above it.
        """
        pylon = self.pylons[condition.element, condition.post]
        ends = [(condition.leg, condition.share), (condition.leg + 1, 1.0 - condition.share)]
        for end, share in sorted(ends, key=lambda pair: pair[1]):
            waypoint = plan.waypoints[end]
            element = waypoint.passage.element
            for post in element.drawing().posts if element.place and not pylon.is_obstacle else ():
                if place_of(post) != place_of(pylon):
                    continue
                if share * seconds > PASSING_SECONDS:
                    return None  # the gate is flown past once more on this leg
                if condition.side is PylonSide.BELOW:
                    return _side_beside(waypoint, post)
                return PylonSide.BELOW if near_top else None
        if condition.side is PylonSide.BELOW:
            return None
        return PylonSide.LEFT if condition.side is PylonSide.RIGHT else PylonSide.RIGHT

    def path_constraints(self, plan: Plan) -> list[tuple[PathConstraint, ...]]:
        """Return the conditions along a plan as constraints on every leg."""
        legs: list[list[PathConstraint]] = [[] for _ in plan.waypoints[1:]]
        for condition in self.conditions_on(plan):
            pylon, required = self.pylons[condition.element, condition.post], self._required_clearance(condition)
            bounds = {
                name: Interval(lower=required) if sign > 0.0 else Interval(upper=-required)
                for name, sign in OBSERVED_CLEARANCE[condition.side]
            }
            name = pylon.text if pylon.is_obstacle else f"pylon {condition.post + 1} of {condition.element}"
            values = self._arguments(condition)
            legs[condition.leg].append(PathConstraint(name, bounds, self.observation, values, at=condition.share))
        return [tuple(leg) for leg in legs]

    def measure(
        self, plan: Plan, replayed: ReplayedFlight, approaches: Sequence[ClosestApproach]
    ) -> MeasuredConditions:
        """Return the conditions as a flight measures them.

        Args:
            plan: that the problem was stated along.
            replayed: the flight.
            approaches: of its wing to all pylons.
        """
        conditions, violation, excess, offset = list(self.conditions_on(plan)), 0.0, 0.0, 0.0
        distances, binding = [math.nan] * len(conditions), [False] * len(conditions)
        end = float(replayed.durations.sum())
        for number, before in enumerate(conditions):
            same_passing = [approach for approach in approaches if replayed.same(before, approach)]
            if not same_passing:
                continue
            approach = min(same_passing, key=attrgetter("distance"))
            violation = max(violation, approach.shortfall)
            if approach.shortfall <= 0.0 and not 0.0 <= approach.abeam <= end:
                continue  # the distance at the start or finish is not yet, or no more, that of the moment abeam
            clearance = self._clearance(before, self._observe(before, replayed.state(before.leg, before.share)))
            margin = clearance - self._required_clearance(before)
            conditions[number] = after = replayed.at(before, approach)
            fixed = approach.pylon.is_obstacle and before.side is not PylonSide.BELOW  # the side of all its cylinders
            if approach.shortfall > 0.0 and clearance <= 0.0 and not fixed:  # the wing does not pass on that side
                side = PylonSide.BELOW if approach.pylon.is_obstacle else self._side(after, approach.pylon, replayed)
                conditions[number] = dataclasses.replace(after, side=side, error=0.0)
            elif margin < HOLDING_CLEARANCE:
                excess = max(excess, -approach.shortfall)
                offset = max(offset, abs(approach.abeam - replayed.time(before)))
                side = self._side(after, approach.pylon, replayed)
                other_side = side is not before.side and (side is PylonSide.BELOW or not approach.pylon.is_obstacle)
                if -approach.shortfall > EXCESS_MAX and other_side:  # as above its top
                    conditions[number] = dataclasses.replace(after, side=side, error=0.0)
            distances[number], binding[number] = approach.distance, margin < BINDING_CLEARANCE
        new: list[tuple[float, PylonCondition, ClosestApproach]] = []
        for approach in sorted(approaches, key=attrgetter("distance")):
            pylon = approach.pylon
            if (pylon.name, pylon.post) not in self.pylons or not approach.shortfall > 0.0:
                continue
            if any(replayed.same(condition, approach) for condition in conditions):
                continue
            condition = PylonCondition(pylon.name, pylon.post, approach.leg, 0.0, PylonSide.RIGHT, 0.0)
            condition = replayed.at(condition, approach)
            side = self._side(condition, pylon, replayed)
            for existing in conditions if pylon.is_obstacle else ():
                if _same_obstacle(existing, condition):
                    side = existing.side
                    break
            condition = dataclasses.replace(condition, side=side)
            violation = max(violation, approach.shortfall)
            outputs = self._observe(condition, replayed.state(condition.leg, condition.share))
            new.append((self._clearance(condition, outputs) if pylon.is_obstacle else 0.0, condition, approach))
        abeam: list[ClosestApproach] = []  # of cylinders that are abeam at once the outermost counts
        for _, condition, approach in sorted(new, key=lambda item: item[0]):
            if not any(_abeam_together(approach, accepted) for accepted in abeam):
                abeam.append(approach)
                conditions.append(condition)
                distances.append(approach.distance)
                binding.append(True)
        return MeasuredConditions(tuple(conditions), tuple(distances), tuple(binding), violation, excess, offset)

    def _side(self, condition: PylonCondition, pylon: PylonPost, replayed: ReplayedFlight) -> PylonSide:
        """Return the side with the most clearance; of an obstacle all cylinders are passed on the same one."""
        state = replayed.state(condition.leg, condition.share)
        posts = [post for post in self.pylons.values() if post.name == pylon.name] if pylon.is_obstacle else [pylon]
        outputs = [self._observe(dataclasses.replace(condition, post=post.post), state) for post in posts]
        sides = [dataclasses.replace(condition, side=side) for side in PylonSide]
        return max(sides, key=lambda candidate: min(self._clearance(candidate, output) for output in outputs)).side

    def place_on_mesh(
        self,
        measured: MeasuredConditions,
        replayed: ReplayedFlight,
        mesh: Sequence[Fractions],
        guess: Iterate,
        nodes: Marks,
        *,
        beside_passings: bool,
    ) -> tuple[Mesh, Iterate, tuple[PylonCondition, ...]]:
        """Return another mesh with nodes moved to the moments abeam, the guess on it, and the conditions at its nodes.

        Args:
            measured: the conditions as a flight measures them.
            replayed: the flight.
            mesh: fractions of every leg.
            guess: on that mesh.
            nodes: those at which a condition may hold, shape (N + 1,); the ends of legs are among them.
            beside_passings: whether a moment abeam shortly before or after a passing takes a node of its own.
        """
        shares: list[list[float]] = [[] for _ in mesh]
        for condition, binding in zip(measured.conditions, measured.binding, strict=True):
            if binding:
                shares[condition.leg].append(condition.share)
        mesh, guess = move_nodes(mesh, guess, nodes, shares, beside_ends=beside_passings)
        first_node = np.cumsum([0, *(len(leg) for leg in mesh)])
        conditions: list[PylonCondition] = []
        for condition, distance in zip(measured.conditions, measured.distances, strict=True):
            places = np.concatenate([[0.0], np.cumsum(mesh[condition.leg])])
            places = places[nodes[first_node[condition.leg] : first_node[condition.leg + 1] + 1]]
            share = min(float(places[int(np.abs(places - condition.share).argmin())]), 1.0)
            conditions.append(self._with_error(dataclasses.replace(condition, share=share), replayed, distance))
        return mesh, guess, tuple(conditions)

    def _with_error(self, condition: PylonCondition, replayed: ReplayedFlight, distance: float) -> PylonCondition:
        """Return a condition with the error of its prediction; unchanged where that is unknown.

        Where the wing is farther away than predicted by more than an error may be, and than what is required, its
        distance is that to another side, as above the top. Above it the lower tip counts, whichever point of the wing
        is nearest, so there an error may be half a span. Where the wing touches the pylon, it is the whole clearance.
        """
        pylon = self.pylons[condition.element, condition.post]
        condition = self._with_roll_acceleration(condition, replayed)
        clearance = self._clearance(condition, self._observe(condition, replayed.state(condition.leg, condition.share)))
        most, error = ERROR_MAX, clearance - distance
        if distance < TOUCHING_DISTANCE:
            return dataclasses.replace(condition, error=max(condition.error, min(clearance, most), 0.0))
        if not clearance > 0.0 or math.isnan(distance):
            return condition
        aslant = max(most, pylon.required, self.semispan if condition.side is PylonSide.BELOW else 0.0)
        return dataclasses.replace(condition, error=min(error, most) if error > -aslant else 0.0)

    def _with_roll_acceleration(self, condition: PylonCondition, replayed: ReplayedFlight) -> PylonCondition:
        seconds = float(replayed.durations[condition.leg])
        ends = [min(max(condition.share + sign * ROLL_SECONDS / seconds, 0.0), 1.0) for sign in (-1.0, 1.0)]
        before, after = (self._observe(condition, replayed.state(condition.leg, end))["roll_rate"] for end in ends)
        rolling = (after - before) / ((ends[1] - ends[0]) * seconds)
        return dataclasses.replace(condition, roll_acceleration=rolling)

    def _required_clearance(self, condition: PylonCondition) -> float:
        """Return the clearance required by a condition, m."""
        return self.pylons[condition.element, condition.post].required + condition.error

    def _arguments(self, condition: PylonCondition) -> tuple[float, ...]:
        pylon = self.pylons[condition.element, condition.post]
        return (pylon.north, pylon.east, pylon.height, self.semispan, condition.roll_acceleration, *self.values)

    def _observe(self, condition: PylonCondition, state: Array) -> dict[str, float]:
        """Return the outputs for the pylon of a condition in a state (n_x,)."""
        values = self.observation.values(state, np.array(self._arguments(condition)))
        return dict(zip(PylonRoom.names(), np.asarray(values).ravel().tolist(), strict=True))

    def _clearance(self, condition: PylonCondition, output: Mapping[str, float]) -> float:
        return min(sign * output[name] for name, sign in OBSERVED_CLEARANCE[condition.side])


def _side_beside(waypoint: Waypoint, post: Point) -> PylonSide:
    """Return where a post of the element that is passed stands as the pilot sees it."""
    element, right = waypoint.passage.element, waypoint.axis + math.pi / 2
    assert element.place is not None  # it has a post
    north, east = post.north - element.place[0], post.east - element.place[1]
    offset = math.cos(right) * north + math.sin(right) * east
    if len(element.drawing().posts) == 1 and element.passing_side is not None:
        offset = -math.cos(element.passing_side - right)
    return PylonSide.RIGHT if offset > 0.0 else PylonSide.LEFT


def _same_obstacle(first: PylonCondition, second: PylonCondition) -> bool:
    """Return whether two conditions are to the side of the same element on the same leg."""
    return (first.element, first.leg) == (second.element, second.leg) and first.side is not PylonSide.BELOW


def _abeam_together(first: ClosestApproach, second: ClosestApproach) -> bool:
    """Return whether two cylinders of one obstacle are abeam at the same time, within the resolution of nodes."""
    same_obstacle = first.pylon.is_obstacle and first.pylon.name == second.pylon.name
    return same_obstacle and abs(first.abeam - second.abeam) < ABEAM_SECONDS
