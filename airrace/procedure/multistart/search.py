"""The search for the fastest route: several starts, then one stretch after another taken otherwise.

What is claimed of the result is only that it is the best of what was tried. The order of everything is that of the
course and of the starts, and all jobs are independent of one another, so the result does not depend on the number of
solver processes.
"""

import dataclasses
from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass

import numpy as np

from airrace.planning.decisions_from_solution import choices_as_flown
from airrace.planning.plan import plan
from airrace.planning.planning_model import PlanningModel
from airrace.planning.route_decisions import ANY, TWIN
from airrace.procedure.multistart.budget import SearchBudget, scaled
from airrace.procedure.multistart.coarse_solution import CoarseSolution, InitialGuess, planned_guess, solve_coarse
from airrace.procedure.multistart.moves import Move, MoveGenerator
from airrace.procedure.multistart.segments import Segment, differing, neighbours, stretches
from airrace.procedure.multistart.solver_pool import SolverPool
from airrace.procedure.multistart.window import EvaluatedMove, apply_moves, priced
from airrace.procedure.stage_problem import Flight
from airrace.procedure.start import InitialBarrier
from airrace.track.course import Course

WORTH = 0.003
"""The time that a window has to save to be flown jointly, s."""
TABU_LOSS = 2.0
"""The loss in its window beyond which a way is not tried again around a better flight, s.

The same holds for a way that led nowhere. On Air Race X, where flights around it became a second faster, ways changed
their price by up to 0.7 s.
"""
GAINED = 0.0005
"""The time that a joint flight has to gain to be the better one, s."""


@dataclass(frozen=True, eq=False)
class Tried:
    """A route that was solved jointly: its origin, and the flight."""

    origin: str
    coarse: CoarseSolution


@dataclass(frozen=True, eq=False)
class EvaluatedWindow:
    """A way through a stretch that was solved in its window: the thought, and the solution with what it saves."""

    move: Move
    found: EvaluatedMove


@dataclass(frozen=True, eq=False)
class Found:
    """All routes that were tried, the best first.

    Attributes:
        flights: solved jointly, by race time.
        windows: priced in a window of the best flight of their time, in the order in which they were tried; without
            those that were then flown jointly as well.
        lost: how many flights that were to be solved jointly led nowhere.
    """

    flights: tuple[Tried, ...]
    windows: tuple[EvaluatedWindow, ...]
    lost: int


class Search:
    """A search for the fastest route.

    Args:
        flight: the point mass on the course.
        course: the course.
        pace: at which the race is planned.
        effort: how much is tried.
        pool: what solves.
        watch: told what is being done.
    """

    def __init__(
        self,
        flight: Flight,
        course: Course,
        pace: PlanningModel,
        effort: SearchBudget,
        pool: SolverPool,
        watch: Callable[[str], None],
    ) -> None:
        self._flight, self._course, self._pace = flight, course, pace
        self._effort, self._crew, self._watch = effort, pool, watch
        self._flights: list[Tried] = []
        self._windows: list[EvaluatedWindow] = []
        self._joined: list[EvaluatedWindow] = []
        self._tabu: set[tuple[int, str]] = set()
        self._lost = 0

    def run(self, starts: Sequence[tuple[str, InitialGuess]]) -> Found:
        """Try the starts given and those of the effort, then improve the best of them."""
        self._fly_all([*starts, *self._planned_starts()])
        if self._flights:
            best, changed = self._best, set(range(len(self._course.passages) - 1))
            for number in range(self._effort.rounds):
                self._watch(f"other routes, {number + 1}: {best.race_time:.2f} s so far")
                better = self._improved(best, changed, first=number == 0)
                if better is None:
                    break
                changed = {
                    phase
                    for stretch in differing(best, better, stretches(self._course))
                    for phase in range(stretch.first, stretch.last)
                }
                best = better
        flights = sorted(self._flights, key=lambda one: one.coarse.race_time)
        windows = tuple(one for one in self._windows if not any(one is joined for joined in self._joined))
        return Found(tuple(flights), windows, self._lost)

    @property
    def _best(self) -> CoarseSolution:
        return min((one.coarse for one in self._flights), key=lambda one: one.race_time)

    def _planned_starts(self) -> list[tuple[str, InitialGuess]]:
        """Return plans of different radius, and twins of some of them."""
        found: list[tuple[str, InitialGuess]] = []
        for number, radius in enumerate(self._effort.radii):
            pace = scaled(self._pace, radius)
            text = f"plan with turns of {pace.radius:.0f} m"
            own, twin = (
                planned_guess(self._flight, plan(self._course, pace, ties), InitialBarrier.COLD) for ties in (ANY, TWIN)
            )
            found.append((text, own))
            if number < self._effort.twins and not np.array_equal(own.guess.state, twin.guess.state):
                found.append((f"{text}, its twin", twin))
        return found

    def _fly_all(self, starts: Sequence[tuple[str, InitialGuess]]) -> None:
        self._watch(f"{len(starts)} starts, solved coarsely")
        coarse_solutions = self._crew.work([initial_guess for _, initial_guess in starts], solve_coarse)
        for (origin, _), coarse in zip(starts, coarse_solutions, strict=True):
            if coarse is None:
                self._lost += 1
            else:
                self._flights.append(Tried(origin, coarse))

    def _improved(self, base: CoarseSolution, changed: Set[int], *, first: bool) -> CoarseSolution | None:
        """Return a faster flight, from other ways through the stretches of a flight; None if none was found.

        Args:
            base: the flight.
            changed: phases that are flown otherwise than when other ways were tried last; the others need no new trial.
            first: whether the ways of the other starts are to be tried as well.
        """
        move_generator = MoveGenerator(base, self._course, scaled(self._pace, self._effort.thinking))
        moves = [one for one in move_generator.moves(changed) if self._is_worth_while(one)]
        if first:
            moves += self._from_other_starts(base, move_generator)
        wins = self._won(moves)
        wins += self._won(
            [again for win in wins for again in move_generator.replicate_in_other_laps(win.found, win.move.kind)]
        )
        return self._combined(base, sorted(wins, key=lambda one: -one.found.saved)) if wins else None

    def _won(self, moves: Sequence[Move]) -> list[EvaluatedWindow]:
        """Solve all windows, and return those that save time."""
        found = self._crew.work([one.window for one in moves], priced)
        self._tabu |= {
            (one.stretch.number, one.kind)
            for one, win in zip(moves, found, strict=True)
            if win is None or win.saved < -TABU_LOSS
        }
        tried = [EvaluatedWindow(one, win) for one, win in zip(moves, found, strict=True) if win is not None]
        self._windows += tried
        return [one for one in tried if one.found.saved > WORTH]

    def _is_worth_while(self, move: Move) -> bool:
        """Return whether a way is neither far too long in its plan nor was far too slow when tried before."""
        return move.plan_penalty <= self._effort.max_plan_penalty and (move.stretch.number, move.kind) not in self._tabu

    def _from_other_starts(self, base: CoarseSolution, move_generator: MoveGenerator) -> list[Move]:
        """Return the ways of other flights where they differ from the best.

        Neighbouring stretches are taken together, and each way once.
        """
        known: list[tuple[CoarseSolution, list[Segment]]] = []
        for tried in self._flights:
            for group in neighbours(differing(base, tried.coarse, move_generator.stretches)):
                again = any(
                    group == other_group and not differing(tried.coarse, other, group) for other, other_group in known
                )
                if not again:
                    known.append((tried.coarse, group))
        return [move_generator.from_flight(coarse, group) for coarse, group in known]

    def _combined(self, base: CoarseSolution, wins: Sequence[EvaluatedWindow]) -> CoarseSolution | None:
        """Fly all wins that do not overlap jointly, and some alone, and return the fastest flight that gains time.

        The greatest win is flown alone because wins may not go together.
        """
        together: list[EvaluatedWindow] = []
        for win in wins:
            taken = {index for one in together for index in one.found.window.phases}
            if taken.isdisjoint(win.found.window.phases):
                together.append(win)
        groups = [together] if len(together) == 1 else [together, together[:1]]
        groups += [[win] for win in wins if win not in together][: self._effort.alternatives]
        jobs = [self._splice(base, group) for group in groups]
        flown = self._crew.work(jobs, lambda service, job: apply_moves(service, *job))
        found: list[CoarseSolution] = []
        for group, coarse in zip(groups, flown, strict=True):
            if coarse is None:
                self._lost += 1
                continue
            self._joined += group
            self._flights.append(Tried(", ".join(one.move.kind for one in group), coarse))
            if coarse.race_time < base.race_time - GAINED:
                found.append(coarse)
        return min(found, key=lambda one: one.race_time) if found else None

    def _splice(
        self, base: CoarseSolution, group: Sequence[EvaluatedWindow]
    ) -> tuple[Flight, CoarseSolution, list[EvaluatedMove]]:
        """Return the arguments of `apply_moves` for a flight some of whose windows are flown otherwise."""
        problem = base.problem
        names = problem.system.states
        choices = choices_as_flown(self._course, names, base.iterate.state, problem.first_node)
        for one in group:
            window = one.found.window
            waypoints = window.flight.plan.waypoints
            choices = choices.as_planned({index: waypoints[index] for index in (*window.phases, window.last)})
        planned = plan(self._course, self._pace, choices)
        return dataclasses.replace(self._flight, plan=planned), base, [one.found for one in group]
