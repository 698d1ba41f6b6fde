"""The sketches, flights optimised roughly, well enough to be compared.

What a coarse mesh gains by its own errors of integration is told in seconds by the costates, and taken off again; where
it is much, or where a leg takes far longer than planned, the mesh is made finer there first.
"""

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from airrace.errors import SolverCrash
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.optimality import costates, errors_in_objective
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.refinement import resample
from airrace.optimal_control.replay import estimate_defect
from airrace.optimal_control.solvers.interface import SolverOptions
from airrace.optimal_control.solvers.process.service import SolverEnded, SolverService, SolverTimeout
from airrace.optimal_control.solvers.solver import Solution
from airrace.planning.plan import Plan
from airrace.procedure.guess import guess, leg_seconds
from airrace.procedure.stage_problem import Flight
from airrace.procedure.start import InitialBarrier
from airrace.trajectory import Array

logger = logging.getLogger(__name__)

INTERVAL = 0.22
"""The approximate length of an interval, s: half again as long as those of a first mesh."""
FEWEST, MOST = 8, 120
"""The smallest and the largest number of intervals in a phase."""
STEP = 4
"""The step in which numbers of intervals rise.

Phases of like length share their number, and so a solver made ready for it.
"""
TOLERANCE = 1e-5
"""The tolerance of the solver (1)."""
STALL_SECONDS = 20.0
"""The longest time for an iteration, s; it takes a thousandth of that."""
ITERATIONS = 120
"""The largest number of iterations.

Solves that converge take 30 to 60; one that is lost is not worth more.
"""
OWN_ITERATIONS = 400
"""The largest number of iterations of the start without exploring, which must not be lost by exploring.

All solves of a point mass without exploring, the proof among them, took 69 to 203 iterations on most of 14 generated
courses, 367 on one and 638 and 939 on two.
"""
TOO_FEW = 0.7
"""The part of the intervals that a phase should have (1), below which it gets a finer mesh."""
ERROR_TOLERANCE = 0.01
"""The time by which a phase may be too fast because of its mesh alone, s."""
COARSE_SOLVES_MAX = 3
"""The largest number of meshes."""


@dataclass(frozen=True, eq=False)
class InitialGuess:
    """A flight to be sketched.

    Attributes:
        flight: as it is planned.
        mesh: that the guess is on.
        guess: where the solver begins.
        barrier: the first value of the barrier parameter.
        is_own: whether the race would be started like this without exploring: then it is worth more iterations, and as
            its mesh is a finer one, it is sketched from the optimum on that.
    """

    flight: Flight
    mesh: Sequence[tuple[float, ...]]
    guess: Iterate
    barrier: float
    is_baseline: bool = False


@dataclass(frozen=True, eq=False)
class CoarseSolution:
    """A rough optimum.

    Attributes:
        flight: with the plan that it was flown from.
        problem: on its mesh.
        iterate: the flight.
        multipliers: of the constraints, shape (n_g,).
        errors: what each phase is too fast for its mesh alone, s; shape (n,).
    """

    flight: Flight
    problem: Problem
    iterate: Iterate
    multipliers: Array
    errors: Array

    @property
    def race_time(self) -> float:
        """The race time with what its errors of integration are worth, s.

        Large errors count against it, whatever their sign.
        """
        return float(self.iterate.durations.sum() + self.error_penalty.sum())

    @property
    def error_penalty(self) -> Array:
        """The time that is added to the duration of each phase, s; shape (n,)."""
        return np.where(np.abs(self.errors) > ERROR_TOLERANCE, np.abs(self.errors), self.errors)

    @cached_property
    def costates(self) -> Array:
        """The costates at the ends of the intervals, s per unit of each state; shape (n_x, N)."""
        return costates(Layout(self.problem), self.multipliers)


def planned_guess(flight: Flight, plan: Plan, barrier: float) -> InitialGuess:
    """Return a flight straight from a plan; one that is planned to be slow has no more intervals for that."""
    share = plan.cruise.V / flight.plan.cruise.V
    mesh = [(1.0 / count,) * count for count in (intervals(share * s) for s in leg_seconds(plan))]
    return InitialGuess(replace(flight, plan=plan), mesh, guess(plan, mesh), barrier)


def intervals(seconds: float) -> int:
    """Return the number of intervals of a phase of that duration (s)."""
    return min(STEP * math.ceil(max(FEWEST, seconds / INTERVAL) / STEP), MOST)


def solve_coarse(service: SolverService, initial_guess: InitialGuess) -> CoarseSolution | None:
    """Return the rough optimum; None if there is none within the budget."""
    found = _coarse_solution(service, initial_guess)
    if found is None or not initial_guess.is_baseline:
        return found
    counts = [intervals(seconds) for seconds in found.iterate.durations.tolist()]
    mesh, iterate = resample(found.problem.mesh, found.iterate, counts)
    return _coarse_solution(service, InitialGuess(found.flight, mesh, iterate, InitialBarrier.COARSE)) or found


def _coarse_solution(service: SolverService, initial_guess: InitialGuess) -> CoarseSolution | None:
    mesh, iterate, barrier = list(initial_guess.mesh), initial_guess.guess, initial_guess.barrier
    found: CoarseSolution | None = None
    for _ in range(COARSE_SOLVES_MAX):
        problem = initial_guess.flight.problem(mesh)
        iterations = OWN_ITERATIONS if initial_guess.is_baseline else ITERATIONS
        solution = try_solve(service, problem, iterate, barrier, iterations)
        if solution is None or not solution.success:
            return found
        multipliers = solution.multipliers.constraints
        found = CoarseSolution(
            initial_guess.flight, problem, solution.iterate, multipliers, objective_error(problem, solution)
        )
        counts = _counts(found)
        if counts == [len(phase) for phase in mesh]:
            return found
        mesh, iterate = resample(mesh, found.iterate, counts)
        barrier = InitialBarrier.COARSE
    return found


def try_solve(
    service: SolverService, problem: Problem, iterate: Iterate, barrier: float, iterations: int = ITERATIONS
) -> Solution | None:
    """Solve once within a budget of iterations; return None if the solver did not come back.

    Whatever a guess does to the solver, the other solves are not affected.

    Raises:
        SolverEnded: nobody waits for the result any more.
    """
    try:
        options = SolverOptions(TOLERANCE, iterations, barrier)
        return service.solve(problem, iterate, solver="fatrop", options=options, threads=1, stall_seconds=STALL_SECONDS)
    except SolverTimeout:
        return None
    except SolverEnded:
        raise
    except SolverCrash as error:
        logger.warning("a route that was tried is left out: %s", str(error).splitlines()[-1])
        return None


def objective_error(problem: Problem, solution: Solution) -> Array:
    """Return the time by which each phase of an optimum is too fast because of its mesh alone, s; shape (n,).

    It is infinite where it cannot be told.
    """
    defect = estimate_defect(problem, solution.iterate)
    errors = errors_in_objective(problem, defect, solution.multipliers.constraints)
    by_phase: Array = np.add.reduceat(np.where(np.isfinite(errors), errors, math.inf), problem.first_node[:-1])
    return by_phase


def _counts(coarse: CoarseSolution) -> list[int]:
    """Return the number of intervals that each phase should have."""
    counts: list[int] = []
    for phase, seconds, error in zip(coarse.problem.phases, coarse.iterate.durations, coarse.errors, strict=True):
        count, wanted = len(phase.fractions), intervals(float(seconds))
        if not abs(error) <= ERROR_TOLERANCE:
            count = min(2 * count, MOST)
        counts.append(wanted if count < TOO_FEW * wanted else count)
    return counts
