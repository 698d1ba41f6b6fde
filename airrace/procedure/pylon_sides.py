"""The other sides of pylons that a flight need not pass: on which side it comes by is chance, and may cost tenths of a
second."""

import functools
from collections.abc import Callable, Sequence

from airrace.procedure.choice import SAME_FLIGHT, fastest_of, mesh_resolution
from airrace.procedure.mesh_loop import Failure, solve_certified
from airrace.procedure.result import PylonCondition, PylonSide, StageResult
from airrace.procedure.single_mesh import solve_single_mesh
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_models import StageModels
from airrace.procedure.stage_problem import StageProblem, coarse_mesh
from airrace.procedure.warm_start import InitialBarrier, Start

ROUNDS_MAX = 3
"""How often the pylons beside the fastest flight are passed on their other sides, one at a time."""
ITERATIONS_MAX = 60
"""The largest number of iterations of the first solve on another side. Some that led to a flight took 9 to 19; two that
led to none took 900 together, three times as long as from scratch."""

Sides = frozenset[tuple[str, int, int, PylonSide]]
"""Element and number of each pylon, the leg, and where it stands as the pilot passes it there."""
Solve = Callable[[SolverSession], StageResult | Failure]


def with_other_sides(models: StageModels, results: Sequence[StageResult], session: SolverSession) -> list[StageResult]:
    """Return results of a stage, and faster ones that pass pylons on other sides than the fastest of them.

    What is tried takes nothing from the budget.
    """
    flights, tried, spent = list(results), set[Sides](), session.budget.spent
    for _ in range(ROUNDS_MAX):
        fastest = fastest_of(flights)
        tried.add(sides_of(fastest.pylon_conditions))
        solved = session.side_by_side(on_other_sides(models, fastest, tried, session))
        faster: list[StageResult] = []
        for result in solved:
            if isinstance(result, Failure) or result.trajectory.race_time >= fastest.trajectory.race_time - SAME_FLIGHT:
                continue
            if result.certified or (result.holds and not fastest.certified):
                faster.append(result)
        if not faster:
            break
        flights += faster
    session.budget.spent = spent
    return flights


def on_other_sides(models: StageModels, optimum: StageResult, tried: set[Sides], session: SolverSession) -> list[Solve]:
    """Return solves that start from an optimum and pass one pylon each on its other side, as was not tried yet.

    Args:
        models: of the race.
        optimum: passed by on its sides.
        tried: the sides of all flights; those of the solves are added.
        session: with the settings.
    """
    if not optimum.holds:
        return []
    stage_problem, (mesh, iterate) = models.problem_along(optimum.stage, optimum), coarse_mesh(optimum)
    if stage_problem.clearance is None:
        return []
    race_time = optimum.trajectory.race_time
    slowest = race_time + mesh_resolution(session.settings, race_time)
    solves: list[Solve] = []
    for conditions in stage_problem.clearance.on_other_sides(stage_problem.plan, stage_problem.problem(mesh), iterate):
        if (sides := sides_of(conditions)) in tried:
            continue
        tried.add(sides)
        other = stage_problem.with_conditions(conditions)
        solves.append(functools.partial(_solve, other, optimum, slowest))
    return solves


def sides_of(conditions: Sequence[PylonCondition]) -> Sides:
    """Return on which side every pylon is passed on every leg."""
    return frozenset((condition.element, condition.post, condition.leg, condition.side) for condition in conditions)


def _solve(
    stage_problem: StageProblem, optimum: StageResult, slowest: float, session: SolverSession
) -> StageResult | Failure:
    """Solve a race past a pylon on its other side from an optimum; nothing slower than `slowest` (s) is of use."""
    mesh, iterate = coarse_mesh(optimum)
    start = Start(
        stage_problem,
        stage_problem.problem(mesh),
        iterate,
        InitialBarrier.PIECES,
        optimum.provenance,
        iterations_max=ITERATIONS_MAX,
        race_time_max=slowest,
    )
    refine = solve_certified if optimum.certified else solve_single_mesh
    return refine(session, start, session.solvers[0])
