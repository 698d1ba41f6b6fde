"""The moves of other ways to take a stretch of a flight, each with a guess through a window around it."""

import dataclasses
import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass

from airrace.frames import angle_between
from airrace.optimal_control.problem import Iterate
from airrace.planning.decisions_from_solution import choices_as_flown
from airrace.planning.plan import Plan, plan
from airrace.planning.planning_model import PlanningModel
from airrace.planning.route_decisions import RouteDecisions
from airrace.planning.waypoints import Waypoint, candidates
from airrace.procedure.guess import guess, leg_seconds
from airrace.procedure.multistart.coarse_solution import CoarseSolution, intervals
from airrace.procedure.multistart.segments import Segment, Shape, neighbours, same_way, shape, stretches
from airrace.procedure.multistart.tilted_turns import tilt_turn
from airrace.procedure.multistart.window import EvaluatedMove, Window
from airrace.procedure.phase_segments import phase_piece
from airrace.procedure.stage_problem import Flight
from airrace.track.course import Course, Turning

MARGIN = 2
"""The number of stretches before and after those that change in a window.

On Rovinj a reversal that saves 0.40 s jointly was priced at 0.28 s with one of them, at 0.38 s with two.
"""

TURN = math.radians(60.0)
"""The turn from which on the other side is proposed, rad.

Shorter ones that were forced there, on Rovinj, came back to where they were.
"""

LONG_TURN = math.radians(100.0)
"""The turn from which on a way over the top is proposed, rad."""

HIGH = 40.0
"""The rise above both ends from which on a turn is no longer flat, m."""

MAX_PLAN_PENALTY = 7.0
"""The largest extra time of a way's plan with which it is proposed, whatever the effort, s.

On Rovinj and Air Race X ways that were dearer by 2 s and more in the plan were slower by 3.7 to 12 s in their windows.
"""

TILT_ANGLES = (math.radians(50.0), math.radians(85.0))
"""The angles by which a long turn is tilted, rad: slanted, and almost upright."""


@dataclass(frozen=True, eq=False)
class Move:
    """Another way to take a stretch.

    Attributes:
        stretch: which one.
        window: around it, with a guess.
        dearer: by how much its plan takes longer than the flight's own, s.
        kind: what is different, for the record.
    """

    stretch: Segment
    window: Window
    plan_penalty: float
    kind: str


class MoveGenerator:
    """A move generator of other ways around one flight.

    Args:
        base: the flight.
        course: that it flies.
        pace: at which other ways are planned; a tight one leaves room for all of them.
        dearest: the largest extra time of a way's plan with which it is proposed, s.
    """

    def __init__(
        self, base: CoarseSolution, course: Course, pace: PlanningModel, max_plan_penalty: float = MAX_PLAN_PENALTY
    ) -> None:
        problem = base.problem
        self.base, self.course, self.pace, self.max_plan_penalty = base, course, pace, max_plan_penalty
        self.stretches = stretches(course)
        self.choices = choices_as_flown(course, problem.system.states, base.iterate.state, problem.first_node)
        self.own = plan(course, pace, self.choices)

    def moves(
        self, changed: Set[int], *, shapes: bool = True, places: Sequence[Segment] | None = None
    ) -> Iterator[Move]:
        """Yield the moves whose window holds a phase that has changed, in the order of the course.

        Args:
            changed: numbers of the phases.
            shapes: whether other shapes of the same turn are proposed, too.
            places: stretches of which is thought; None for all.
        """
        for stretch in self.stretches if places is None else places:
            if changed.isdisjoint(range(*self._window(stretch, stretch))):
                continue
            flown = shape(self.base, stretch)
            yield from self._opposite_turn(stretch, flown)
            if stretch.number == 0:
                yield from self._other_crossing(stretch, stretch.first)
            yield from self._other_crossing(stretch, stretch.last)
            yield from self._other_sides(stretch)
            yield from self._other_course(stretch)
            if shapes:
                yield from self._other_shapes(stretch, flown)

    def from_flight(self, other: CoarseSolution, group: Sequence[Segment]) -> Move:
        """Return the way of another flight through neighbouring stretches."""
        first, last = group[0], group[-1]
        phases = range(first.first, last.last)
        problem = other.problem
        theirs = choices_as_flown(self.course, problem.system.states, other.iterate.state, problem.first_node)
        stops = {index for stretch in group for index in (stretch.first, stretch.last)}
        mixed = plan(self.course, self.pace, _mixed(self.choices, theirs, stops))
        pieces = {index: phase_piece(other.iterate, problem, index) for index in phases}
        return self._move(first, last, mixed, pieces, 0.0, "from another start")

    def replicate_in_other_laps(self, won: EvaluatedMove, kind: str) -> Iterator[Move]:
        """Yield what has won in a window for the other laps: wherever the same passages follow one another."""
        own = {place.number: one for one, place in won.inside(self.stretches)}
        changed = {number for number, one in own.items() if not self._flies(won, one, self.stretches[number])}
        for later in range(1 - len(self.stretches), len(self.stretches)):
            inside = [self.stretches[number] for number in own if 0 <= number + later < len(self.stretches)]
            alike = [one for one in inside if self._same_place(one, self.stretches[one.number + later])]
            for group in neighbours(alike) if later else ():
                numbers = changed.intersection(one.number for one in group)
                places = range(min(numbers, default=0), max(numbers, default=-1) + 1)
                if not all(self._flies(won, own[number], self.stretches[number + later]) for number in places):
                    yield self._again(won, places, later, f"{kind} in another lap")

    def places(self) -> list[Segment]:
        """Return the stretches; of those that are the same place in several laps, flown alike, the first."""
        found: list[Segment] = []
        for stretch in self.stretches:
            again = (one for one in found if self._same_place(one, stretch))
            if not any(same_way(self.base, one, self.base, stretch) for one in again):
                found.append(stretch)
        return found

    def _flies(self, won: EvaluatedMove, one: Segment, place: Segment) -> bool:
        """Return whether the flight itself takes a stretch as a window takes one of its own."""
        return same_way(won.shown, one, self.base, place)

    def _same_place(self, one: Segment, other: Segment) -> bool:
        """Return whether two stretches lead past the same elements, in the same directions, with the same rolls."""
        here, there = (self.course.passages[place.first : place.last + 1] for place in (one, other))
        same = len(here) == len(there) and all(
            (a.element, a.direction) == (b.element, b.direction) for a, b in zip(here, there, strict=True)
        )
        return same and [one.roll for one in here[1:]] == [one.roll for one in there[1:]]

    def _again(self, won: EvaluatedMove, numbers: range, later: int, kind: str) -> Move:
        """Return what has won on some stretches for others past the same elements, so many stretches later."""
        first, last = self.stretches[numbers[0]], self.stretches[numbers[-1]]
        places = self.stretches[numbers[0] + later], self.stretches[numbers[-1] + later]
        shift, waypoints = places[0].first - first.first, won.window.flight.plan.waypoints
        moved = {
            index + shift: dataclasses.replace(waypoints[index], passage=self.course.passages[index + shift])
            for index in range(first.first, last.last + 1)
        }
        pieces = {
            index + shift: phase_piece(won.iterate, won.problem, index - won.window.first)
            for index in range(first.first, last.last)
        }
        return self._move(*places, plan(self.course, self.pace, self.choices.as_planned(moved)), pieces, 0.0, kind)

    def _opposite_turn(self, stretch: Segment, flown: Shape) -> Iterator[Move]:
        """Yield the turn to the other side; where its ends are free to be crossed otherwise, they are."""
        if abs(flown.turn) < TURN or not self._level(stretch):
            return
        side = -1 if flown.turn > 0.0 else 1
        freed = self._freed(stretch.first, stretch.last)
        chosen = dataclasses.replace(freed, turns={**freed.turns, stretch.last: side})
        yield from self._planned(stretch, chosen, "other hand")

    def _other_crossing(self, stretch: Segment, index: int) -> Iterator[Move]:
        """Yield the passage at an end of the stretch crossed along another axis."""
        if not self.course.passages[index].element.stands:
            return
        (own,) = self.choices.ways[index]
        for axis, ways in _by_axis(candidates(self.course, index)):
            if abs(angle_between(axis, own.axis)) > 1e-6:
                freed = self._freed(index)
                chosen = dataclasses.replace(freed, ways={**freed.ways, index: tuple(ways)})
                yield from self._planned(stretch, chosen, "other direction")

    def _other_sides(self, stretch: Segment) -> Iterator[Move]:
        """Yield the roll on the way, or the knife edge at the end, to the other side."""
        passage, index = self.course.passages[stretch.last], stretch.last
        if passage.roll is not None and passage.roll.turning is Turning.EITHER:
            rolls = {**self.choices.rolls, index: -self.choices.rolls[index]}
            chosen = dataclasses.replace(self.choices.without_ways(index), rolls=rolls)
            yield from self._planned(stretch, chosen, "other roll")
        if passage.element.two_edged:
            edges = {**self.choices.edges, index: -self.choices.edges[index]}
            yield from self._planned(stretch, dataclasses.replace(self.choices, edges=edges), "other edge")

    def _other_course(self, stretch: Segment) -> Iterator[Move]:
        """Yield a manoeuvre whose course is free, entered the other way."""
        passage = self.course.passages[stretch.last]
        if not passage.element.free_course:
            return
        (own,) = self.choices.ways[stretch.last]
        ways = tuple(one for one in candidates(self.course, stretch.last) if math.cos(one.heading - own.heading) < -0.1)
        if ways:
            freed = self._freed(*self._chain(stretch))
            chosen = dataclasses.replace(freed, ways={**freed.ways, stretch.last: ways})
            yield from self._planned(stretch, chosen, "other course")

    def _other_shapes(self, stretch: Segment, flown: Shape) -> Iterator[Move]:
        """Yield a stretch flat instead of high, and a long turn slanted or over the top instead of flat."""
        long = abs(flown.turn) >= LONG_TURN
        if not (long or flown.rise > HIGH) or not self._level(stretch):
            return
        pieces = self._guesses(self.own, range(stretch.first, stretch.last))
        # The plan stays, and so nothing is dearer.
        if flown.rise > HIGH:
            yield self._move(stretch, stretch, self.own, pieces, 0.0, "flat")
        for slant in TILT_ANGLES if long else ():
            raised = tilt_turn([pieces[index] for index in sorted(pieces)], slant)
            by_phase = dict(zip(sorted(pieces), raised, strict=True))
            yield self._move(stretch, stretch, self.own, by_phase, 0.0, f"slanted {math.degrees(slant):.0f}")

    def _chain(self, stretch: Segment) -> list[int]:
        """Return the manoeuvre at the end of a stretch, and those beside it whose courses are as free.

        They change together.
        """

        def free(index: int) -> bool:
            return self.course.passages[index].element.free_course

        ends = [one.last for one in self.stretches]
        before = itertools.takewhile(free, reversed(ends[: stretch.number]))
        behind = itertools.takewhile(free, ends[stretch.number + 1 :])
        return [stretch.last, *before, *behind]

    def _level(self, stretch: Segment) -> bool:
        """Return whether all of a stretch is planned in a plane; in other legs a plan knows no side."""
        return all(self.own.legs[index].path is not None for index in range(stretch.first, stretch.last))

    def _freed(self, *indices: int) -> RouteDecisions:
        """Return the flight's choices without those of some stops: their candidates, and the turns to and from them."""
        numbers = [one.number for one in self.stretches if one.first in indices or one.last in indices]
        turns = {self.stretches[number].last for number in numbers}
        return dataclasses.replace(
            self.choices.without_ways(*indices),
            turns={index: side for index, side in self.choices.turns.items() if index not in turns},
        )

    def _planned(self, stretch: Segment, chosen: RouteDecisions, kind: str) -> Iterator[Move]:
        """Yield a thought from a plan of a stretch and those beside it, unless that is far too long."""
        planned = plan(self.course, self.pace, chosen)
        plan_penalty = planned.seconds - self.own.seconds
        if not plan_penalty <= self.max_plan_penalty:
            return
        first = self.stretches[max(0, stretch.number - 1)]
        last = self.stretches[min(len(self.stretches) - 1, stretch.number + 1)]
        pieces = self._guesses(planned, range(first.first, last.last))
        yield self._move(first, last, planned, pieces, plan_penalty, kind, about=stretch)

    def _guesses(self, planned: Plan, phases: Iterable[int]) -> dict[int, Iterate]:
        """Return pieces of a planned flight."""
        seconds = leg_seconds(planned)
        mesh = [(1.0 / count,) * count for count in map(intervals, seconds)]
        whole = guess(planned, mesh)
        nodes = [0]
        for phase in mesh:
            nodes.append(nodes[-1] + len(phase))
        return {
            index: Iterate(
                whole.durations[index : index + 1],
                whole.state[:, nodes[index] : nodes[index + 1] + 1],
                whole.control[:, nodes[index] : nodes[index + 1]],
            )
            for index in phases
        }

    def _move(
        self,
        first: Segment,
        last: Segment,
        planned: Plan,
        pieces: Mapping[int, Iterate],
        plan_penalty: float,
        kind: str,
        about: Segment | None = None,
    ) -> Move:
        """Return a thought in a window with room around what changes."""
        begin, end = self._window(first, last)
        own = self.base.iterate, self.base.problem
        flight: Flight = dataclasses.replace(self.base.flight, plan=planned)
        guessed = [pieces[index] if index in pieces else phase_piece(*own, index) for index in range(begin, end)]
        return Move(about or first, Window(self.base, begin, end, flight, guessed), plan_penalty, kind)

    def _window(self, first: Segment, last: Segment) -> tuple[int, int]:
        """Return the first phase of a window around some stretches, and the one behind its last."""
        begin = self.stretches[max(0, first.number - MARGIN)].first
        end = self.stretches[min(len(self.stretches) - 1, last.number + MARGIN)].last
        return begin, end


def _by_axis(ways: Sequence[Waypoint]) -> list[tuple[float, list[Waypoint]]]:
    """Return candidates grouped by the axis along which they cross."""
    groups: list[tuple[float, list[Waypoint]]] = []
    for way in ways:
        for axis, members in groups:
            if abs(angle_between(axis, way.axis)) < 1e-6:
                members.append(way)
                break
        else:
            groups.append((way.axis, [way]))
    return groups


def _mixed(own: RouteDecisions, theirs: RouteDecisions, stops: set[int]) -> RouteDecisions:
    """Return one's own choices, but another flight's at some stops, and the turns with which it gets there."""
    return RouteDecisions(
        ways={index: (theirs if index in stops else own).ways[index] for index in own.ways},
        turns={
            **{index: side for index, side in own.turns.items() if index not in stops},
            **{index: side for index, side in theirs.turns.items() if index in stops},
        },
        rolls={index: (theirs if index in stops else own).rolls[index] for index in own.rolls},
        edges={index: (theirs if index in stops else own).edges[index] for index in own.edges},
    )
