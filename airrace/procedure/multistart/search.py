"""The search for the fastest route: several starts, then one segment after another on other routes.

The result is the best of what was tried, no more. Jobs are independent and ordered by course and starts, so it does
not depend on the number of solver processes.
"""

import dataclasses
import math
from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass

import numpy as np

from airrace.model.environment import g0
from airrace.model.track.course import Course
from airrace.optimal_control.solvers.service import SolverPool
from airrace.procedure.multistart.coarse_solution import CoarseSolution, InitialGuess, planned_guess, solve_coarse
from airrace.procedure.multistart.moves import MoveGenerator
from airrace.procedure.multistart.segments import Segment, differing, neighbours, same_route, segments_of
from airrace.procedure.multistart.window import EvaluatedMove, Move, apply_moves, evaluate
from airrace.procedure.planning.plan import Plan, decisions_from_solution, plan
from airrace.procedure.planning.planning_model import PlanningModel
from airrace.procedure.planning.route_decisions import RouteDecisions
from airrace.procedure.stage_problem import StageProblem
from airrace.procedure.warm_start import InitialBarrier

SAVED_MIN = 0.003
"""The time that a move has to save in its window to be solved jointly, s."""
RETRIED_GAIN = 1.0
"""The gain of a move's plan, s, above which it is solved jointly although its window has failed.

A window asks for the states of the flight around it, which a route that is seconds faster does not pass.
"""
RETRIED_MAX = 2
"""The largest number of moves, those of the best plans, that are solved jointly although their windows have failed."""
OTHER_TURN = math.radians(90.0)
"""The difference from which on two plans turn otherwise through a segment, rad. On 44 courses a smaller radius changed
turns by 80 degrees at most on 41, and on three, where pylons are passed at other headings, by 140 to 310."""


@dataclasses.dataclass(frozen=True)
class Radius:
    """A factor on the planned turning radius; reached by a higher load factor, or by flying slower."""

    factor: float
    slower: bool = False

    def scale(self, pace: PlanningModel) -> PlanningModel:
        """Return a pace with turns of this radius."""
        if self.slower:
            return dataclasses.replace(pace, V=pace.V * math.sqrt(self.factor))
        return dataclasses.replace(pace, n=math.hypot(1.0, pace.V**2 / (g0 * self.factor * pace.radius)))


@dataclasses.dataclass(frozen=True)
class SearchBudget:
    """The extent of a search.

    Attributes:
        radii: of the plans that are solved as a whole, besides the race's own plan.
        tightest_radius: of a further plan, which is solved only if it turns otherwise than all of these through one
            segment or more.
        planning_radius: at which moves are planned.
        plan_penalty_max: s, by which the plan of a move may take longer than that of the flight.
        iterations: how often the best flight is improved, at most.
        compared_max: how many flights are compared on the mesh on which the winner's mesh check begins.
        local: whether the flight is near an optimum. Then a place that several laps pass by the
            same route is tried in the first of them, windows that keep the route are not solved jointly, and other
            shapes are left out: on Rovinj and Chiba all windows with them led back to the same shape.
    """

    radii: tuple[Radius, ...]
    tightest_radius: Radius
    planning_radius: Radius
    plan_penalty_max: float
    iterations: int
    compared_max: int
    local: bool = False


QUICK = SearchBudget(
    radii=(Radius(0.7), Radius(0.6, slower=True), Radius(0.4)),
    tightest_radius=Radius(0.3),
    planning_radius=Radius(0.5),
    plan_penalty_max=2.0,
    iterations=3,
    compared_max=3,
)
LOCAL = dataclasses.replace(QUICK, plan_penalty_max=1.5, local=True)
"""The budget of a search around a flight. Moves that it leaves out were slower by 6 s and more after a change of a few
per cent; the fastest that it finds on Rovinj from a flight on another route takes 1.2 s longer as planned."""


def planned_starts(stage_problem: StageProblem, course: Course, budget: SearchBudget) -> list[InitialGuess]:
    """Return the plans of the budget, that of the tightest radius only where it takes another way."""
    cruise, segments = stage_problem.plan.cruise, segments_of(course)
    routes = [plan(course, radius.scale(cruise)) for radius in budget.radii]
    tightest = plan(course, budget.tightest_radius.scale(cruise))
    if any(_turns_otherwise(tightest, [stage_problem.plan, *routes], segment) for segment in segments):
        routes.append(tightest)
    return [planned_guess(stage_problem, route, InitialBarrier.COLD) for route in routes]


def _turns_otherwise(planned: Plan, others: Sequence[Plan], segment: Segment) -> bool:
    """Return whether a plan turns through a segment as none of the others does; legs without paths do not turn."""
    turns: list[float] = []
    for route in (planned, *others):
        paths = [leg.path for leg in route.legs[segment.first : segment.last]]
        turns.append(sum(path.turn for path in paths if path is not None))
    return all(abs(turns[0] - turn) > OTHER_TURN for turn in turns[1:])


@dataclass(frozen=True, eq=False)
class SearchResult:
    """All routes that were tried.

    Attributes:
        flights: solved jointly, by race time.
        moves: evaluated in a window of the best flight of their time, in the order in which they were tried; without
            those that were then solved jointly as well.
        failed: number of joint solves that did not converge.
    """

    flights: tuple[CoarseSolution, ...]
    moves: tuple[EvaluatedMove, ...]
    failed: int


class Search:
    """A search for the fastest route.

    Args:
        stage_problem: the point mass on the course.
        course: the course.
        budget: how much is tried.
        pool: what solves.
        report: takes what is being done, in words.

    Attributes:
        failed_starts: those that have led to no flight.
    """

    def __init__(
        self,
        stage_problem: StageProblem,
        course: Course,
        budget: SearchBudget,
        pool: SolverPool,
        report: Callable[[str], None],
    ) -> None:
        self._flight, self._course, self._pace = stage_problem, course, stage_problem.plan.cruise
        self._budget, self._pool, self._report = budget, pool, report
        self.failed_starts: list[InitialGuess] = []
        self._flights: list[CoarseSolution] = []
        self._starts: list[CoarseSolution] = []
        self._moves: list[EvaluatedMove] = []
        self._joint: list[EvaluatedMove] = []
        self._failing: set[tuple[int, str]] = set()
        self._failed = 0

    def run(
        self,
        starts: Sequence[InitialGuess],
        solved: Sequence[CoarseSolution] = (),
        failed: Sequence[InitialGuess] = (),
    ) -> SearchResult:
        """Try starts, then improve the best of the flights that they lead to.

        Args:
            starts: to be tried.
            solved, failed: flights that further starts have led to before, and further ones that have led to none.
        """
        self._report(f"{len(starts) + len(solved) + len(failed)} starts, solved coarsely")
        outcomes = self._pool.work(starts, solve_coarse)
        self._starts = [*(flight for flight in outcomes if flight is not None), *solved]
        self._flights = list(self._starts)
        self.failed_starts = [start for start, flight in zip(starts, outcomes, strict=True) if flight is None]
        self.failed_starts += failed
        self._failed = len(self.failed_starts)
        if self._flights:
            self.improve(min(self._flights, key=lambda flight: flight.race_time))
        return self.result()

    def improve(self, best: CoarseSolution) -> CoarseSolution:
        """Return the flight at the end of a sequence of moves, each of which saves time."""
        best = self._improve_routes(best, segments_of(self._course))
        better = self._retry_failing(best)
        if better is None:
            return best
        return self._improve_routes(better, differing(best, better, segments_of(self._course)))

    def improve_by(
        self,
        best: CoarseSolution,
        what: str,
        propose: Callable[[MoveGenerator, Set[int]], list[Move]],
    ) -> CoarseSolution:
        """Return the flight at the end of a sequence of proposed moves; where these gain time, with all others tried.

        Args:
            best: the flight to begin with.
            what: is changed, in words.
            propose: returns moves whose windows hold some of these phases.
        """
        segments = segments_of(self._course)
        different: Sequence[Segment] = segments
        for _ in range(self._budget.iterations):
            better = self._repeat(best, what, propose, different)
            if better is best:
                return best
            best = self._improve_routes(better, differing(best, better, segments))
            if best is better:
                return best
            different = differing(better, best, segments)
        return best

    def _improve_routes(self, best: CoarseSolution, different: Sequence[Segment]) -> CoarseSolution:
        return self._repeat(
            best, "routes", lambda generator, changed: self._other_routes(best, generator, changed), different
        )

    def _retry_failing(self, best: CoarseSolution) -> CoarseSolution | None:
        """Return the fastest flight of the first move that leads to a faster one when it is solved jointly.

        Only moves are tried whose window has failed and whose plan is much faster: the whole race is solved along it
        from plans of several radii.
        """
        if not self._failing:
            return None
        generator = self._generator(best)
        promising = (move for move in generator.moves(set(range(len(best.problem.phases)))) if self._is_promising(move))
        for move in sorted(promising, key=lambda move: move.plan_penalty)[:RETRIED_MAX]:
            self._failing.discard((move.segment.number, move.kind))
            self._report(f"another route as a whole: {best.race_time:.2f} s so far")
            starts = self._starts_along(best, move)
            flights = [flight for flight in self._pool.work(starts, solve_coarse) if flight is not None]
            self._failed += len(starts) - len(flights)
            self._flights += flights
            fastest = min(flights, key=lambda flight: flight.race_time, default=best)
            if fastest.race_time < best.race_time - SAVED_MIN:
                return fastest
        return None

    def _is_promising(self, move: Move) -> bool:
        """Return whether the window of a move has failed although its plan is much faster than that of the flight."""
        return (move.segment.number, move.kind) in self._failing and move.plan_penalty < -RETRIED_GAIN

    def _starts_along(self, base: CoarseSolution, move: Move) -> list[InitialGuess]:
        """Return plans of a flight in which a move is made, of the race's own radius and of those of the budget."""
        starts: list[InitialGuess] = []
        for radius in (Radius(1.0), *self._budget.radii):
            planned = plan(self._course, radius.scale(self._pace), self._decisions_with(base, [move]))
            start = planned_guess(self._flight, planned, InitialBarrier.COLD)
            if not any(np.array_equal(start.guess.state, previous.guess.state) for previous in starts):
                starts.append(start)
        return starts

    def _generator(self, base: CoarseSolution) -> MoveGenerator:
        return MoveGenerator(base, self._course, self._budget.planning_radius.scale(self._pace))

    def improve_rolls(self, flight: CoarseSolution, unlike: CoarseSolution | None = None) -> CoarseSolution:
        """Return the fastest flight after trying each roll to the other side.

        Args:
            flight: with the rolls.
            unlike: a flight whose rolls were tried already; its route is not tried again.
        """
        segments = segments_of(self._course)
        return self._repeat(
            flight,
            "rolls",
            lambda generator, changed: list(generator.rolls(changed)),
            segments if unlike is None else differing(flight, unlike, segments),
        )

    def result(self) -> SearchResult:
        """Return what was found so far."""
        flights = sorted(self._flights, key=lambda flight: flight.race_time)
        moves = tuple(move for move in self._moves if move not in self._joint)
        return SearchResult(tuple(flights), moves, self._failed)

    def _repeat(
        self,
        best: CoarseSolution,
        what: str,
        propose: Callable[[MoveGenerator, Set[int]], list[Move]],
        different: Sequence[Segment],
    ) -> CoarseSolution:
        """Make moves around the best flight until none gains time; return the flight.

        Args:
            best: the flight to begin with.
            what: is changed, in words.
            propose: returns moves whose windows hold some of these phases: their route differs from when moves were
                tried last, or one that saves time there was left out.
            different: the segments whose route is to be changed first.
        """
        left_out: list[EvaluatedMove] = []
        for number in range(self._budget.iterations):
            self._report(f"other {what}, {number + 1}: {best.race_time:.2f} s so far")
            generator = self._generator(best)
            changed = {phase for segment in different for phase in range(segment.first, segment.last)}
            changed |= {phase for move in left_out for phase in move.move.changed}
            better, left_out = self._improve(best, generator, propose(generator, changed))
            if better is None:
                break
            different, best = differing(best, better, generator.segments), better
        return best

    def _other_routes(self, first: CoarseSolution, generator: MoveGenerator, changed: Set[int]) -> list[Move]:
        """Return other routes through the segments of a flight, those of the other starts among them."""
        begins = generator.base is first
        distinct = generator.distinct_segments() if begins and self._budget.local else None
        around = generator.moves(changed, shapes=not self._budget.local, segments=distinct)
        moves = [move for move in around if move.plan_penalty <= self._budget.plan_penalty_max]
        return [*moves, *self._from_other_starts(generator, changed)]

    def _improve(
        self, base: CoarseSolution, generator: MoveGenerator, moves: Sequence[Move]
    ) -> tuple[CoarseSolution | None, list[EvaluatedMove]]:
        """Return a faster flight from some moves, and those that save time but are not in it; None if there is none."""
        improving = self._improving(moves)
        improving += self._improving(
            [replica for move in improving for replica in generator.replicate_in_other_laps(move, move.move.kind)]
        )
        if not improving:
            return None, []
        return self._combine(base, sorted(improving, key=lambda move: -move.saved))

    def _improving(self, moves: Sequence[Move]) -> list[EvaluatedMove]:
        """Evaluate all moves, and return those that save time."""
        outcomes = self._pool.work(moves, evaluate)
        for move, evaluated in zip(moves, outcomes, strict=True):
            if evaluated is None:
                self._failing.add((move.segment.number, move.kind))
        evaluated_moves = [move for move in outcomes if move is not None]
        self._moves += evaluated_moves
        return [
            move
            for move in evaluated_moves
            if move.saved > SAVED_MIN and not (self._budget.local and self._keeps_route(move))
        ]

    def _keeps_route(self, move: EvaluatedMove) -> bool:
        """Return whether a window leads along the route of the flight around it."""
        pairs = move.inside(segments_of(self._course))
        return all(same_route(move.as_solution, own, move.move.base, segment) for own, segment in pairs)

    def _from_other_starts(self, generator: MoveGenerator, changed: Set[int]) -> list[Move]:
        """Return the routes of the starts where they differ from the best flight, if that has changed there.

        Neighbouring segments are taken together, and each route once.
        """
        routes: list[tuple[CoarseSolution, list[Segment]]] = []
        for flight in self._starts:
            for group in neighbours(differing(generator.base, flight, generator.segments)):
                if changed.isdisjoint(range(group[0].first, group[-1].last)):
                    continue
                if not any(group == segments and not differing(flight, start, group) for start, segments in routes):
                    routes.append((flight, group))
        return [generator.from_flight(flight, group, "from another start") for flight, group in routes]

    def _combine(
        self, base: CoarseSolution, moves: Sequence[EvaluatedMove]
    ) -> tuple[CoarseSolution | None, list[EvaluatedMove]]:
        """Fly all moves that do not overlap jointly, and some alone; return the fastest flight and the moves left out.

        The best move is solved alone because moves may not go together.
        """
        together: list[EvaluatedMove] = []
        for move in moves:
            if all(set(move.move.changed).isdisjoint(earlier.move.changed) for earlier in together):
                together.append(move)
        groups = [together] if len(together) == 1 else [together, together[:1]]
        groups += [[move] for move in moves if move not in together][:1]
        jobs = [(self._with_moves(base, [move.move for move in group]), base, group) for group in groups]
        faster: list[tuple[CoarseSolution, Sequence[EvaluatedMove]]] = []
        joint = self._pool.work(jobs, lambda service, job: apply_moves(service, *job))
        for group, coarse in zip(groups, joint, strict=True):
            if coarse is None:
                self._failed += 1
                continue
            self._joint += group
            self._flights.append(coarse)
            if coarse.race_time < base.race_time - 0.0005:
                faster.append((coarse, group))
        if not faster:
            return None, []
        best, group = min(faster, key=lambda pair: pair[0].race_time)
        return best, [move for move in moves if move not in group]

    def _with_moves(self, base: CoarseSolution, moves: Sequence[Move]) -> StageProblem:
        """Return the model with the plan of a flight in which some moves are made."""
        decisions = self._decisions_with(base, moves)
        return dataclasses.replace(self._flight, plan=plan(self._course, self._pace, decisions))

    def _decisions_with(self, base: CoarseSolution, moves: Sequence[Move]) -> RouteDecisions:
        """Return the decisions of a flight in which some moves are made."""
        problem = base.problem
        decisions = decisions_from_solution(self._course, problem.system.states, base.iterate.state, problem.first_node)
        for move in moves:
            waypoints = move.stage_problem.plan.waypoints
            decisions = decisions.as_planned({index: waypoints[index] for index in range(move.first, move.last + 1)})
        return decisions
