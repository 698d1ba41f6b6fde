"""The moves around a flight: other routes through a segment of it, each with a guess through a window around it."""

import bisect
import dataclasses
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence, Set

import numpy as np

from airrace.model.frames import angle_between
from airrace.model.track.course import Course, Turning
from airrace.optimal_control.problem import Iterate
from airrace.optimal_control.replay import interval_durations
from airrace.procedure.guess import guess, leg_seconds, phase_piece
from airrace.procedure.multistart.coarse_solution import CoarseSolution, intervals
from airrace.procedure.multistart.rolls import rerolls, tilt_turn
from airrace.procedure.multistart.segments import Segment, SegmentShape, neighbours, same_route, segments_of, shape_of
from airrace.procedure.multistart.window import EvaluatedMove, Move
from airrace.procedure.planning.plan import Plan, decisions_from_solution, plan
from airrace.procedure.planning.planning_model import PlanningModel
from airrace.procedure.planning.route_decisions import RouteDecisions, Waypoint, candidates

MARGIN = 2
"""Number of segments before and after those that change in a window. On Rovinj a reversal that saves 0.40 s jointly was
evaluated at 0.28 s with one of them, at 0.38 s with two."""
FEWEST = 4
"""Number of intervals of a phase from which on they are left out of a window, and that stay in it at least: the end
fixes eleven states, which two intervals behind a gate cannot reach."""
TURN_MIN = math.radians(60.0)
"""The turn from which on the opposite turn is proposed, rad. Shorter ones that were forced to the other side, on
Rovinj, came back to where they were."""
LONG_TURN = math.radians(100.0)
"""The turn from which on a way over the top is proposed, rad."""
HIGH = 40.0
"""Rise above both ends from which on a turn is no longer flat, m."""
PLAN_PENALTY_MAX = 7.0
"""Largest extra time of a move's plan with which it is proposed, whatever the budget, s. On Rovinj and Air Race X moves
with 2 s and more were slower by 3.7 to 12 s in their windows."""
TILT = math.radians(85.0)
"""The tilt of a long turn, rad: almost upright. From 50 degrees, too, windows on 33 courses led to no other flight."""


class MoveGenerator:
    """The neighbourhood of a flight.

    Args:
        base: the flight.
        course: that it flies.
        pace: at which other routes are planned; a tight one leaves room for all of them.
        plan_penalty_max: the largest extra time of a move's plan with which it is proposed, s.
    """

    def __init__(
        self,
        base: CoarseSolution,
        course: Course,
        pace: PlanningModel,
        plan_penalty_max: float = PLAN_PENALTY_MAX,
    ) -> None:
        self.segments = segments_of(course)
        self.base, self._course, self._pace, self._plan_penalty_max = base, course, pace, plan_penalty_max
        self._decisions = self._decisions_of(base)
        self._plan = plan(course, pace, self._decisions)

    def moves(
        self, changed: Set[int], *, shapes: bool = True, segments: Sequence[Segment] | None = None
    ) -> Iterator[Move]:
        """Yield the moves whose window holds a phase that has changed, in the order of the course.

        Args:
            changed: numbers of the phases.
            shapes: whether other shapes of the same turn are proposed, too.
            segments: whose route changes; None for all.
        """
        for segment in self.segments if segments is None else segments:
            if changed.isdisjoint(range(*self._window(segment, segment))):
                continue
            shape = shape_of(self.base, segment)
            yield from self._opposite_turn(segment, shape)
            if segment.number == 0:
                yield from self._other_crossing(segment, segment.first)
            yield from self._other_crossing(segment, segment.last)
            yield from self._other_sides(segment)
            yield from self._other_course(segment)
            if shapes:
                yield from self._other_shapes(segment, shape)

    def rolls(self, changed: Set[int]) -> Iterator[Move]:
        """Yield each roll from side to side the other way, in windows that hold a phase that has changed."""
        base, nodes = self.base, self.base.problem.first_node
        flight = dataclasses.replace(base.stage_problem, plan=self._plan)
        steps = interval_durations(base.problem, base.iterate.durations)
        time: list[float] = [0.0, *np.cumsum(steps).tolist()]
        for reroll in rerolls(base.problem, base.iterate):
            inside = [
                segment
                for segment in self.segments
                if reroll.first < nodes[segment.last] and nodes[segment.first] < reroll.last
            ]
            own, segment = range(inside[0].first, inside[-1].last), inside[0]
            begin = bisect.bisect_left(time, time[reroll.first] - reroll.reach)
            end = min(bisect.bisect_left(time, time[reroll.last] + reroll.reach), len(time) - 1)
            first = min(own[0], bisect.bisect_right(nodes[1:-1], begin))
            last = max(own[-1], bisect.bisect_left(nodes[1:-1], end)) + 1
            if changed.isdisjoint(range(first, last)):
                continue
            pieces = [phase_piece(reroll.flight, base.problem, index) for index in range(first, last)]
            spare = (self._spare(first, begin - nodes[first]), self._spare(last - 1, nodes[last] - end))
            yield Move(base, first, last, flight, pieces, segment, reroll.kind, spare=spare, own=own)

    def _spare(self, phase: int, count: int) -> int:
        """Return how many of so many intervals at an end of a phase need not be in a window."""
        problem_phase = self.base.problem.phases[phase]
        spare = min(count, len(problem_phase.fractions) - FEWEST)
        return 0 if problem_phase.bounds or spare < FEWEST else spare

    def from_flight(self, other: CoarseSolution, group: Sequence[Segment], kind: str) -> Move:
        """Return the route of another flight through neighbouring segments."""
        first, last = group[0], group[-1]
        stops = {index for segment in group for index in (segment.first, segment.last)}
        mixed = self._decisions.with_those_of(self._decisions_of(other), stops)
        pieces = {index: phase_piece(other.iterate, other.problem, index) for index in range(first.first, last.last)}
        return self._move(first, last, plan(self._course, self._pace, mixed), pieces, kind)

    def replicate_in_other_laps(self, move: EvaluatedMove, kind: str) -> Iterator[Move]:
        """Yield a faster move for the other laps: wherever the same passages follow one another."""
        inside = {segment.number: own for own, segment in move.inside(self.segments)}

        def is_same_route(number: int, later: int = 0) -> bool:
            return same_route(move.as_solution, inside[number], self.base, self.segments[number + later])

        changed = {number for number in inside if not is_same_route(number)}
        for later in range(1 - len(self.segments), len(self.segments)):
            within = [self.segments[number] for number in inside if 0 <= number + later < len(self.segments)]
            same_places = [
                segment for segment in within if self._same_place(segment, self.segments[segment.number + later])
            ]
            for group in neighbours(same_places) if later else ():
                numbers = changed.intersection(segment.number for segment in group)
                places = range(min(numbers, default=0), max(numbers, default=-1) + 1)
                if not all(is_same_route(number, later) for number in places):
                    yield self._translate(move, places, later, f"{kind} in another lap")

    def distinct_segments(self) -> list[Segment]:
        """Return the segments; of those that are the same place in several laps by the same route, the first."""
        distinct: list[Segment] = []
        for segment in self.segments:
            earlier_laps = (earlier for earlier in distinct if self._same_place(earlier, segment))
            if not any(same_route(self.base, earlier, self.base, segment) for earlier in earlier_laps):
                distinct.append(segment)
        return distinct

    def _decisions_of(self, flight: CoarseSolution) -> RouteDecisions:
        problem = flight.problem
        return decisions_from_solution(self._course, problem.system.states, flight.iterate.state, problem.first_node)

    def _same_place(self, first: Segment, second: Segment) -> bool:
        """Return whether two segments lead past the same elements, in the same directions, with the same rolls."""
        a, b = (self._course.passages[segment.first : segment.last + 1] for segment in (first, second))
        if [(p.element, p.direction) for p in a] != [(p.element, p.direction) for p in b]:
            return False
        return [p.roll for p in a[1:]] == [p.roll for p in b[1:]]

    def _translate(self, move: EvaluatedMove, numbers: range, later: int, kind: str) -> Move:
        """Return a move in some segments for others past the same elements, so many segments later."""
        first, last = self.segments[numbers[0]], self.segments[numbers[-1]]
        places = self.segments[numbers[0] + later], self.segments[numbers[-1] + later]
        shift, waypoints = places[0].first - first.first, move.move.stage_problem.plan.waypoints
        planned = {
            index + shift: dataclasses.replace(waypoints[index], passage=self._course.passages[index + shift])
            for index in range(first.first, last.last + 1)
        }
        pieces = {
            index + shift: phase_piece(move.iterate, move.problem, index - move.move.first)
            for index in range(first.first, last.last)
        }
        return self._move(*places, plan(self._course, self._pace, self._decisions.as_planned(planned)), pieces, kind)

    def _opposite_turn(self, segment: Segment, shape: SegmentShape) -> Iterator[Move]:
        """Yield the turn to the other side; where its ends are free to be crossed otherwise, they are."""
        if abs(shape.turn) < TURN_MIN or not self._is_level(segment):
            return
        free = self._release(segment.first, segment.last)
        turns = {**free.turns, segment.last: -1 if shape.turn > 0.0 else 1}
        yield from self._planned_move(segment, dataclasses.replace(free, turns=turns), "other hand")

    def _other_crossing(self, segment: Segment, index: int) -> Iterator[Move]:
        """Yield the passage at an end of the segment crossed along another axis."""
        if not self._course.passages[index].element.stands:
            return
        (own,) = self._decisions.candidates[index]
        by_axis: list[list[Waypoint]] = []
        for candidate in candidates(self._course, index):
            group = next((g for g in by_axis if abs(angle_between(g[0].axis, candidate.axis)) < 1e-6), None)
            if group is None:
                by_axis.append([candidate])
            else:
                group.append(candidate)
        for along_axis in by_axis:
            if abs(angle_between(along_axis[0].axis, own.axis)) > 1e-6:
                free = self._release(index)
                chosen = dataclasses.replace(free, candidates={**free.candidates, index: tuple(along_axis)})
                yield from self._planned_move(segment, chosen, "other direction")

    def _other_sides(self, segment: Segment) -> Iterator[Move]:
        """Yield the roll on the way, or the knife edge at the end, to the other side."""
        passage, index, own = self._course.passages[segment.last], segment.last, self._decisions
        if passage.roll is not None and passage.roll.turning is Turning.EITHER:
            rolls = {**own.rolls, index: -own.rolls[index]}
            chosen = dataclasses.replace(own.without_candidates(index), rolls=rolls)
            yield from self._planned_move(segment, chosen, "other roll")
        if passage.element.two_edged:
            edges = {**own.edges, index: -own.edges[index]}
            yield from self._planned_move(segment, dataclasses.replace(own, edges=edges), "other edge")

    def _other_course(self, segment: Segment) -> Iterator[Move]:
        """Yield a manoeuvre whose course is free, entered the other way, with those beside it that are as free."""

        def is_free(index: int) -> bool:
            return self._course.passages[index].element.free_course

        if not is_free(segment.last):
            return
        (own,) = self._decisions.candidates[segment.last]
        entries = tuple(
            candidate
            for candidate in candidates(self._course, segment.last)
            if math.cos(candidate.heading - own.heading) < -0.1
        )
        if entries:
            ends = [segment.last for segment in self.segments]
            before = itertools.takewhile(is_free, reversed(ends[: segment.number]))
            behind = itertools.takewhile(is_free, ends[segment.number + 1 :])
            free = self._release(segment.last, *before, *behind)
            chosen = dataclasses.replace(free, candidates={**free.candidates, segment.last: entries})
            yield from self._planned_move(segment, chosen, "other course")

    def _other_shapes(self, segment: Segment, shape: SegmentShape) -> Iterator[Move]:
        """Yield a segment flat instead of high, and a long turn over the top instead of flat."""
        is_long, is_high = abs(shape.turn) >= LONG_TURN, shape.rise > HIGH
        if not (is_long or is_high) or not self._is_level(segment):
            return
        phases = range(segment.first, segment.last)
        pieces = self._guesses(self._plan, phases)
        if is_high:
            yield self._move(segment, segment, self._plan, pieces, "flat")
        if is_long:
            tilted = dict(zip(phases, tilt_turn([pieces[index] for index in phases], TILT), strict=True))
            yield self._move(segment, segment, self._plan, tilted, "over the top")

    def _is_level(self, segment: Segment) -> bool:
        """Return whether all of a segment is planned in a plane; in other legs a plan knows no side."""
        return all(self._plan.legs[index].path is not None for index in range(segment.first, segment.last))

    def _release(self, *indices: int) -> RouteDecisions:
        """Return the flight's decisions without those of some stops: their candidates, the turns to and from them."""
        turns = {segment.last for segment in self.segments if segment.first in indices or segment.last in indices}
        return dataclasses.replace(
            self._decisions.without_candidates(*indices),
            turns={index: side for index, side in self._decisions.turns.items() if index not in turns},
        )

    def _planned_move(self, segment: Segment, decisions: RouteDecisions, kind: str) -> Iterator[Move]:
        """Yield a move from a plan of a segment and those beside it, unless that is far too long."""
        planned = plan(self._course, self._pace, decisions)
        plan_penalty = planned.seconds - self._plan.seconds
        if not plan_penalty <= self._plan_penalty_max:
            return
        first = self.segments[max(0, segment.number - 1)]
        last = self.segments[min(len(self.segments) - 1, segment.number + 1)]
        pieces = self._guesses(planned, range(first.first, last.last))
        move = self._move(first, last, planned, pieces, kind)
        yield dataclasses.replace(move, segment=segment, plan_penalty=plan_penalty)

    def _guesses(self, planned: Plan, phases: range) -> dict[int, Iterate]:
        """Return pieces of a planned flight."""
        part, first = planned.part(phases)
        mesh = [(1.0 / count,) * count for count in map(intervals, leg_seconds(part))]
        flight = guess(part, mesh)
        nodes = list(itertools.accumulate(map(len, mesh), initial=0))
        return {
            index: Iterate(
                flight.durations[index - first : index - first + 1],
                flight.state[:, nodes[index - first] : nodes[index - first + 1] + 1],
                flight.control[:, nodes[index - first] : nodes[index - first + 1]],
            )
            for index in phases
        }

    def _move(self, first: Segment, last: Segment, planned: Plan, pieces: Mapping[int, Iterate], kind: str) -> Move:
        """Return a move in a window with room around what changes."""
        begin, end = self._window(first, last)
        base = self.base
        flight = dataclasses.replace(base.stage_problem, plan=planned)
        window = [
            pieces[index] if index in pieces else phase_piece(base.iterate, base.problem, index)
            for index in range(begin, end)
        ]
        return Move(base, begin, end, flight, window, first, kind)

    def _window(self, first: Segment, last: Segment) -> tuple[int, int]:
        """Return the first phase of a window around some segments, and the one behind its last."""
        begin = self.segments[max(0, first.number - MARGIN)].first
        end = self.segments[min(len(self.segments) - 1, last.number + MARGIN)].last
        return begin, end
