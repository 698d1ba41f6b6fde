"""Coarse solutions: flights that are optimised roughly, well enough to be compared.

The costates tell in seconds what a coarse mesh gains by its own errors of integration, and the race time is corrected
by that. Where it is much, or where a leg takes far longer than planned, the mesh is made finer there first.
"""

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from airrace.errors import SolverCrash
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.mesh_refinement import resample, transfer_multipliers
from airrace.optimal_control.optimality import costates, errors_in_objective
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.replay import estimate_defect
from airrace.optimal_control.solvers import INTERIOR_POINT
from airrace.optimal_control.solvers.interface import Multipliers, SolverOptions
from airrace.optimal_control.solvers.service import SolverEnded, SolverService, SolverTimeout
from airrace.optimal_control.solvers.solver import ProgramSolution
from airrace.optimal_control.trajectory import Array
from airrace.procedure.guess import counts_of, guess, leg_seconds
from airrace.procedure.planning.plan import Plan
from airrace.procedure.settings import MeshSettings
from airrace.procedure.stage_problem import StageProblem
from airrace.procedure.warm_start import InitialBarrier

logger = logging.getLogger(__name__)


INTERVAL_SECONDS = 0.22
"""Approximate length of an interval, s: half again as long as those of a first mesh."""
COMPARED_SECONDS = 0.15
"""Approximate length of an interval of the mesh on which flights are compared, s. On one of 0.22 s rolls are misjudged
by 20 ms, on one of 0.15 s by 2 ms."""
INTERVALS_MIN, INTERVALS_MAX = 8, 120
"""The numbers of intervals of a phase."""
INTERVAL_QUANTUM = 4
"""The number in multiples of which intervals are counted, so that phases of like length share a solver."""
TOLERANCE = 1e-5
"""The tolerance of the solver (1)."""
STALL_SECONDS = 20.0
"""Longest time for an iteration, s; it takes a thousandth of that."""
ITERATIONS_MAX = 120
"""The iterations of a solve. Of 71 from plans and the homotopy that predictor-corrector steps solved, nine in ten took
53 at most."""
STAGNATION_MAX, NEARLY_FEASIBLE = 15, 0.05
"""A solve from a plan, or in a window, whose ends may forbid a route, is given up after so many iterations that hardly
reduce the violations, while the largest is above the second number (1). On 42 courses those that failed took 23 % of
the iterations of the search: 207 of 292 end so. Of 1,723 that led to an optimum six would not have."""
KNOWN_ITERATIONS_MAX = 40
"""The iterations of a solve from an optimum on another mesh with its multipliers, before one without them."""
BASELINE_ITERATIONS_MAX = 400
"""The iterations of the start without a search, which must not be lost by it. All solves of a point mass without a
search, the mesh check among them, took 69 to 203 iterations on most of 14 generated courses, 367 on one and 638 and 939
on two."""
SHARE_MIN = 0.7
"""Part of the intervals that a phase should have (1), below which it gets a finer mesh."""
ERROR_MAX = 0.01
"""Time by which a phase may be too fast because of its mesh alone, s."""
MESHES_MAX = 3
"""Number of meshes that are solved on."""


@dataclass(frozen=True, eq=False)
class InitialGuess:
    """A flight that a coarse solution starts from.

    Attributes:
        stage_problem: as it is planned.
        mesh: that the guess is on.
        guess: where the solver begins.
        barrier: the first value of the barrier parameter.
        is_baseline: whether the race would be started like this without a search. It is solved by the same algorithm
            with a larger iteration budget and, as its mesh is a finer one, again from the optimum on that.
        before: the optimum on another mesh from which it comes, with its multipliers; None without one.
    """

    stage_problem: StageProblem
    mesh: Sequence[tuple[float, ...]]
    guess: Iterate
    barrier: InitialBarrier
    is_baseline: bool = False
    before: "CoarseSolution | None" = None


@dataclass(frozen=True, eq=False)
class CoarseSolution:
    """A rough optimum.

    Attributes:
        stage_problem: with the plan that it started from.
        problem: on its mesh.
        iterate: the flight.
        multipliers: of all limits.
        errors: what each phase is too fast for its mesh alone, s; shape (n,).
    """

    stage_problem: StageProblem
    problem: Problem
    iterate: Iterate
    multipliers: Multipliers
    errors: Array

    @property
    def race_time(self) -> float:
        """The race time corrected by its errors of integration, s; large ones count against it, whatever their sign."""
        return float(self.iterate.durations.sum() + self.error_penalty.sum())

    @property
    def error_penalty(self) -> Array:
        """The time that is added to the duration of each phase, s; shape (n,)."""
        return np.where(np.abs(self.errors) > ERROR_MAX, np.abs(self.errors), self.errors)

    @cached_property
    def costates(self) -> Array:
        """The costates at the ends of the intervals, s per unit of each state; shape (n_x, N)."""
        return costates(Layout(self.problem), self.multipliers.constraints)


def planned_guess(stage_problem: StageProblem, plan: Plan, barrier: InitialBarrier) -> InitialGuess:
    """Return a flight straight from a plan; one that is planned to be slow has no more intervals for that."""
    share = plan.cruise.V / stage_problem.plan.cruise.V
    mesh = [(1.0 / count,) * count for count in (intervals(share * s) for s in leg_seconds(plan))]
    return InitialGuess(replace(stage_problem, plan=plan), mesh, guess(plan, mesh), barrier)


def intervals(seconds: float) -> int:
    """Return the number of intervals of a phase of that duration (s)."""
    count = max(INTERVALS_MIN, seconds / INTERVAL_SECONDS)
    return min(INTERVAL_QUANTUM * math.ceil(count / INTERVAL_QUANTUM), INTERVALS_MAX)


def solve_coarse(service: SolverService, start: InitialGuess) -> CoarseSolution | None:
    """Return the rough optimum; None if there is none within the budget."""
    coarse = _solve_with_refinement(service, start)
    if coarse is None or not start.is_baseline:
        return coarse
    counts = [intervals(seconds) for seconds in coarse.iterate.durations.tolist()]
    return _solve_with_refinement(service, on_other_mesh(coarse, counts)) or coarse


def on_other_mesh(coarse: CoarseSolution, counts: Sequence[int]) -> InitialGuess:
    """Return a rough optimum on another mesh, with so many intervals per phase, to be solved again."""
    mesh, iterate = resample(coarse.problem.mesh, coarse.iterate, counts)
    return InitialGuess(coarse.stage_problem, mesh, iterate, InitialBarrier.COARSE, before=coarse)


def solve_finer(service: SolverService, coarse: CoarseSolution, mesh: MeshSettings) -> CoarseSolution:
    """Return a flight on the mesh on which flights are compared; the flight itself where it leads to none there."""
    return solve_coarse(service, finer_guess(coarse, mesh)) or coarse


def finer_guess(
    flight: CoarseSolution | InitialGuess, mesh: MeshSettings, counts_min: Sequence[int] = ()
) -> InitialGuess:
    """Return a flight, or a plan, on the mesh on which flights are compared, to be solved from there.

    Args:
        flight: the flight.
        mesh: the settings of meshes.
        counts_min: least numbers of intervals of its phases; a plan may expect too little time. Empty for none.
    """
    solved = isinstance(flight, CoarseSolution)
    iterate, fractions = (flight.iterate, flight.problem.mesh) if solved else (flight.guess, flight.mesh)
    fine = replace(mesh, interval=min(mesh.interval, COMPARED_SECONDS))
    own_counts = [len(phase) for phase in fractions]
    fine_counts = counts_of(iterate.durations.tolist(), fine)
    counts = np.max([own_counts, fine_counts, counts_min or own_counts], axis=0).tolist()
    if solved:
        return on_other_mesh(flight, counts)
    fractions, iterate = resample(fractions, iterate, counts)
    return replace(flight, mesh=fractions, guess=iterate)


def _solve_with_refinement(service: SolverService, start: InitialGuess) -> CoarseSolution | None:
    mesh, iterate, barrier = list(start.mesh), start.guess, start.barrier
    iterations = BASELINE_ITERATIONS_MAX if start.is_baseline else ITERATIONS_MAX
    coarse, before = None, start.before
    for _ in range(MESHES_MAX):
        problem = start.stage_problem.problem(mesh)
        solution: ProgramSolution | None = None
        if before is not None:
            multipliers = transfer_multipliers(before.multipliers, Layout(before.problem), Layout(problem))
            options = coarse_options(barrier, KNOWN_ITERATIONS_MAX)
            solution = try_solve(service, problem, iterate, options, multipliers)
        if solution is None or not solution.success:
            gives_up_early = barrier is InitialBarrier.COLD and not start.is_baseline
            options = coarse_options(barrier, iterations, gives_up_early=gives_up_early)
            solution = try_solve(service, problem, iterate, options)
        if solution is None or not solution.success:
            return coarse
        errors = objective_error(problem, solution)
        coarse = before = CoarseSolution(start.stage_problem, problem, solution.iterate, solution.multipliers, errors)
        counts: list[int] = []
        for phase, seconds, error in zip(mesh, coarse.iterate.durations.tolist(), errors.tolist(), strict=True):
            regular = intervals(seconds)
            count = len(phase) if abs(error) <= ERROR_MAX else min(2 * len(phase), INTERVALS_MAX)
            counts.append(regular if count < SHARE_MIN * regular else count)
        if counts == [len(phase) for phase in mesh]:
            return coarse
        mesh, iterate = resample(mesh, coarse.iterate, counts)
        barrier = InitialBarrier.COARSE
    return coarse


def coarse_options(
    barrier: InitialBarrier, iterations_max: int = ITERATIONS_MAX, *, gives_up_early: bool = False
) -> SolverOptions:
    """Return the options of a rough solve, which may give up where it hardly comes closer."""
    options = SolverOptions(TOLERANCE, iterations_max, barrier.value, curvature=False)
    if not gives_up_early:
        return options
    return replace(options, stagnation_max=STAGNATION_MAX, nearly_feasible=NEARLY_FEASIBLE)


def try_solve(
    service: SolverService,
    problem: Problem,
    iterate: Iterate,
    options: SolverOptions,
    multipliers: Multipliers | None = None,
) -> ProgramSolution | None:
    """Solve once; return None if the solver crashed or hung.

    Raises:
        SolverEnded: the pool was closed.
    """
    stall = STALL_SECONDS
    try:
        return service.solve(
            problem,
            iterate,
            solver=INTERIOR_POINT,
            options=options,
            multipliers=multipliers,
            threads=1,
            stall_seconds=stall,
        )
    except SolverTimeout:
        return None
    except SolverEnded:
        raise
    except SolverCrash as error:
        logger.warning("a route that was tried is left out: %s", str(error).splitlines()[-1])
        return None


def objective_error(problem: Problem, solution: ProgramSolution) -> Array:
    """Return the time by which each phase of an optimum is too fast because of its mesh alone, s; shape (n,).

    It is infinite where it cannot be estimated.
    """
    defect = estimate_defect(problem, solution.iterate)
    errors = errors_in_objective(problem, defect, solution.multipliers.constraints)
    by_phase: Array = np.add.reduceat(np.where(np.isfinite(errors), errors, math.inf), problem.first_node[:-1])
    return by_phase
