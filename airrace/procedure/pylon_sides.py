"""Other sides of pylons: on which side a flight passes one that it need not pass, or whether its wing passes one of a
gate beside or above it, is chance, and may cost tenths of a second."""

import functools
import math
from collections.abc import Callable, Sequence, Set

from airrace.optimal_control.certificate import RACE_TIME_CHANGE
from airrace.procedure.choice import SAME_FLIGHT, fastest_of, mesh_resolution
from airrace.procedure.mesh_loop import Failure, solve_certified
from airrace.procedure.result import PylonCondition, PylonSide, StageResult
from airrace.procedure.settings import Settings
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

GAIN_MIN = 1e-3
"""The time that another side must save beside a certified optimum, on its coarser mesh, to be refined there, s.

Of 20 flights past pylons near whose tops they came by six saved 1 to 71 ms in the end, and 6 to 71 ms on that mesh.
"""

Side = tuple[str, int, int, PylonSide]
"""Element and number of a pylon, the leg, and where it stands as the pilot passes it there."""
Solve = Callable[[SolverSession], StageResult | Failure]


def with_other_sides(models: StageModels, results: Sequence[StageResult], session: SolverSession) -> list[StageResult]:
    """Return results of a stage, and faster ones that pass pylons on other sides than the fastest of them.

    What is tried takes nothing from the budget.
    """
    flights, useless, spent = list(results), set[Side](), session.budget.spent
    for _ in range(ROUNDS_MAX):
        fastest = fastest_of(flights)
        others = on_other_sides(models, fastest, useless, session)
        solved = session.side_by_side([solve for _, solve in others])
        faster: list[StageResult] = []
        for (changed, _), result in zip(others, solved, strict=True):
            if not isinstance(result, Failure) and _is_faster(result, fastest):
                faster.append(result)
            else:
                useless |= changed
        if not faster:
            break
        useless |= sides_of(fastest.pylon_conditions) - sides_of(fastest_of(faster).pylon_conditions)  # not back again
        flights += faster
    session.budget.spent = spent
    return flights


def _is_faster(result: StageResult, fastest: StageResult) -> bool:
    """Return whether a result is a faster flight than the fastest, and checked as well."""
    checked = result.certified or (result.holds and not fastest.certified)
    return checked and result.trajectory.race_time < fastest.trajectory.race_time - SAME_FLIGHT


def on_other_sides(
    models: StageModels, optimum: StageResult, useless: Set[Side], session: SolverSession
) -> list[tuple[frozenset[Side], Solve]]:
    """Return solves that start from an optimum and pass one pylon each on its other side, with its new sides.

    Args:
        models: of the race.
        optimum: passed by on its sides.
        useless: new sides that are not tried: those that have saved no time before, and those that were left.
        session: with the settings.
    """
    if not optimum.holds:
        return []
    stage_problem, (mesh, iterate) = models.problem_along(optimum.stage, optimum), coarse_mesh(optimum)
    if stage_problem.clearance is None:
        return []
    slowest = longest_race_time(optimum, session.settings)
    own_sides, solves = sides_of(optimum.pylon_conditions), list[tuple[frozenset[Side], Solve]]()
    for conditions in stage_problem.clearance.on_other_sides(stage_problem.plan, stage_problem.problem(mesh), iterate):
        changed = sides_of(conditions) - own_sides
        if not changed or not changed <= useless:  # both sides are taken already where it is passed twice
            other = stage_problem.with_conditions(conditions)
            solves.append((changed, functools.partial(_solve, other, optimum, slowest)))
    return solves


def sides_of(conditions: Sequence[PylonCondition]) -> frozenset[Side]:
    """Return on which side every pylon is passed on every leg."""
    return frozenset((condition.element, condition.post, condition.leg, condition.side) for condition in conditions)


def longest_race_time(optimum: StageResult, settings: Settings) -> float:
    """Return the race time above which a flight on the coarser mesh of an optimum is not worth refining, s.

    Of a certified optimum the race time on that mesh is known, and the flight has to be faster; else it may be slower
    by what meshes differ.
    """
    race_time = optimum.trajectory.race_time
    for item in optimum.certificate.items if optimum.certificate else ():
        if item.name == RACE_TIME_CHANGE and math.isfinite(item.value):
            return race_time + item.value - GAIN_MIN  # the item is a magnitude; a coarser mesh takes longer
    return race_time + mesh_resolution(settings, race_time)


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
