"""What is solved before the point mass: the homotopy, and the plans of the search beside it."""

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from airrace.optimal_control.problem import Iterate, Problem
from airrace.procedure.homotopy import HomotopyOutcome, solve_homotopy
from airrace.procedure.infeasibility.conflicts import RelaxedRace, conflict_location
from airrace.procedure.infeasibility.local_infeasibility import LocalInfeasibility, find_local_infeasibility
from airrace.procedure.multistart.coarse_solution import CoarseSolution, InitialGuess, solve_coarse
from airrace.procedure.multistart.plans import plans_to_search
from airrace.procedure.multistart.search import QUICK
from airrace.procedure.settings import SearchEffort
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage import Stage
from airrace.procedure.stage_models import StageModels


@dataclass(frozen=True)
class FirstSolutions:
    """The outcome of the homotopy, and of what was solved beside it.

    Attributes:
        homotopy: the flight from piece to piece.
        relaxed: the race with its limits relaxed, as far as that was asked for.
        flights: what plans of the search have led to; None where none were solved.
        failed_plans: those that have led to no flight.
    """

    homotopy: HomotopyOutcome
    relaxed: RelaxedRace
    flights: Sequence[CoarseSolution] | None = None
    failed_plans: Sequence[InitialGuess] = ()


def solve_homotopy_and_plans(models: StageModels, session: SolverSession, *, searches: bool) -> FirstSolutions:
    """Return the pieces of the homotopy, and solve the plans of the search meanwhile: they do not depend on it.

    With `searches` the point mass follows, which searches for routes.
    """
    relaxed = relaxed_race(models, session)
    if session.settings.search is SearchEffort.OFF or not searches:
        return FirstSolutions(solve_homotopy_pieces(models, relaxed, session), relaxed)
    jobs: list[Callable[[SolverSession], HomotopyOutcome | CoarseSolution | None]] = []
    jobs.append(functools.partial(solve_homotopy_pieces, models, relaxed))
    plans = plans_to_search(models.problem(Stage.POINT_MASS), session.settings.mesh, QUICK)
    jobs += [functools.partial(_solve_plan, plan) for plan in plans]
    homotopy, *outcomes = session.side_by_side(jobs)
    assert isinstance(homotopy, HomotopyOutcome)
    flights = [flight for flight in outcomes if isinstance(flight, CoarseSolution)]
    failed_plans = [plan for plan, flight in zip(plans, outcomes, strict=True) if flight is None]
    return FirstSolutions(homotopy, relaxed, flights, failed_plans)


def solve_homotopy_pieces(models: StageModels, relaxed: RelaxedRace, session: SolverSession) -> HomotopyOutcome:
    """Solve phase by phase; given up where legs around a phase that fails are found to be infeasible."""

    def race_is_in_conflict() -> bool:
        return bool(conflict_location(relaxed.solve(session)))

    def infeasibility_around(problem: Problem, phase: int, guesses: Sequence[Iterate]) -> LocalInfeasibility | None:
        return find_local_infeasibility(session, problem, phase, guesses, race_is_in_conflict)

    return solve_homotopy(models.problem(Stage.HOMOTOPY), session, infeasibility_around)


def relaxed_race(models: StageModels, session: SolverSession) -> RelaxedRace:
    """Return the race with its limits relaxed, solved once it is asked for."""
    return RelaxedRace(models.race, models.problem(Stage.POINT_MASS), session.settings.mesh)


def _solve_plan(planned: InitialGuess, session: SolverSession) -> CoarseSolution | None:
    return solve_coarse(session.service, planned)
