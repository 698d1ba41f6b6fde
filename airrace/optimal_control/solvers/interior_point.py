"""A primal-dual interior point method on a program of stages.

The step is Mehrotra's predictor and corrector [Mehrotra 1992] with Gondzio's corrections [Gondzio 1996], on a nonlinear
program whose derivatives are taken anew at every iterate; the native library computes it with a Riccati recursion,
which tells whether the step leads to a minimum. A number on the diagonal [Levenberg 1944, Marquardt 1963] makes it so,
and keeps steps as short as the program is trusted.

The method has two modes [Nocedal, Waechter & Waltz 2009]. As long as the conditions of optimality come closer over some
iterates, the step chooses its barrier parameter by itself and is taken as it is. Where they do not, either the slacks
have become too small for the infeasibility that is left, and the point is centred again; or the barrier parameter stays
as it is, and a line search with a filter [Waechter & Biegler 2006] takes steps towards the minimum of the barrier
function, with a second-order correction, until the conditions are closer. Where no step passes the filter, slacks and
multipliers are made anew for a large barrier parameter, twice at most.
"""

import sys
from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.solvers.bounded_program import BoundedProgram, Measures
from airrace.optimal_control.solvers.filter_search import FilterSearch
from airrace.optimal_control.solvers.interface import Bounds, Ending, Multipliers, Solver, SolverOptions, SolverResult
from airrace.trajectory import Array


@dataclass(frozen=True)
class Parameters:
    """The constants of the method.

    Attributes:
        first_barrier: least first value of the barrier parameter: with less, slacks are so small that more steps are
            cut short.
        barrier_per_tolerance: last value of the barrier parameter, as a part of the tolerance.
        largest_step: the largest change of a scaled unknown in a step without a line search; in flat valleys 0.8 and 3
            take up to half as many iterations more.
        least_damping: the least number on the diagonal: some controls matter so little, such as the throttle just
            before the end, that they would move by their whole range from step to step, in up to 25 iterations of a
            solve. With 1e-5 all take a third more.
        saddle_test_damping, saddles_max: the one with which the step from a minimum has to lead to one, and how many
            points may fail that.
        most_damping: the largest one without a line search.
        damping_factor: by which it grows until a step leads to a minimum and is short enough, and falls after a step
            of less than a third of the largest.
        takes_back, as_long: the cosine of the angle between two steps, and the ratio of their lengths, from which on
            the second takes the first back and damping grows: two points may lead to each other for ever, as where a
            commanded roll rate went to and fro by 0.08 in 60 of 80 steps.
        memory, progress: the conditions come closer as long as their largest violation is less than this part of the
            largest at so many points before.
        least_ratio, centred, descent: where the mean product of slack and multiplier is less than the first part of
            the infeasibility, the point is centred for a barrier parameter of the second part; and again, if the
            objective has fallen by the last part since. On seven courses 554 solves took 4 % fewer iterations for it,
            the slowest of them up to 60 % fewer.
        stagnation_max, lessening, nearly_feasible: where so many iterations lessen the sum of all violations by less
            than this part, and the largest is above the last number, scaled (1), the program is locally infeasible. Of
            731 solves on nine courses that led to an optimum three had 32 or more such iterations, one 46.
        cold_barrier, first_progress: with a first barrier parameter of at least the former, without multipliers, the
            guess may be far off, and the method begins with a search until violations are this part of the guess's:
            whole steps led to other valleys, up to 1 s slower in 30 s. Where it fails, whole steps are tried.
        searched_share: the barrier parameter with which a search begins, as a part of the mean product of slack and
            multiplier; at most 1.
        restarts_max, restart_factor, restart_barrier: how often slacks and multipliers are made anew, for a barrier
            parameter of so many times that of the search, and its least value.
    """

    first_barrier: float = 1e-5
    barrier_per_tolerance: float = 0.1
    largest_step: float = 1.5
    least_damping: float = 1e-6
    saddle_test_damping: float = 1e-2
    saddles_max: int = 3
    most_damping: float = 10.0
    damping_factor: float = 4.0
    takes_back: float = -0.9
    as_long: float = 0.9
    memory: int = 5
    progress: float = 0.999
    least_ratio: float = 0.03
    centred: float = 0.1
    descent: float = 1e-6
    stagnation_max: int = 60
    lessening: float = 0.1
    nearly_feasible: float = 1e-3
    restarts_max: int = 2
    cold_barrier: float = 0.1
    first_progress: float = 0.9
    searched_share: float = 0.8
    restart_factor: float = 10.0
    restart_barrier: float = 0.1


PARAMETERS = Parameters()


class InteriorPoint(Solver):
    """The method for one program with changing bounds, parameters and guesses."""

    begins_with_multipliers = True

    def __init__(self, functions: Evaluation, options: SolverOptions) -> None:
        self._functions, self._options = functions, options

    def solve(self, guess: Array, bounds: Bounds, p: Array, multipliers: Multipliers | None) -> SolverResult:
        self._functions.p[:] = p
        self._functions.forget()
        program = BoundedProgram(self._functions, bounds)
        is_cold = multipliers is None and self._options.barrier >= PARAMETERS.cold_barrier
        result = _Solve(program, self._options).solve(guess, multipliers, begins_with_search=is_cold)
        left = self._options.iterations_max - result.iterations
        if result.ending not in (Ending.NO_STEP, Ending.NOT_FINITE) or not is_cold or left <= 0:
            return result
        again = _Solve(program, replace(self._options, iterations_max=left)).solve(guess, multipliers)
        return replace(again, iterations=result.iterations + again.iterations)


class _Solve:
    def __init__(self, program: BoundedProgram, options: SolverOptions) -> None:
        self._program, self._options = program, options
        self._least_barrier = min(PARAMETERS.barrier_per_tolerance * options.tolerance, options.barrier)
        self._point, self._other, self._step, self._residuals = (program.vector() for _ in range(4))
        self._damping = self._least_damping = PARAMETERS.least_damping
        self._moved = np.zeros(len(self._point.w))
        self._recent = deque[float](maxlen=PARAMETERS.memory)
        self._restarts = self._stagnation = self._saddles = 0
        self._least_infeasibility = self._least_primal = np.inf
        self._moves_freely = False  # whether the last step was one without a search
        self._highest_objective = np.inf  # with which the point is centred again
        self._search: FilterSearch | None = None

    def solve(self, guess: Array, multipliers: Multipliers | None, *, begins_with_search: bool = False) -> SolverResult:
        self._begin(guess, multipliers)
        functions, options = self._program.functions, self._options
        ending, iteration = Ending.NO_STEP, 0
        for iteration in range(options.iterations_max + 1):
            measures = self._linearise()
            if measures is None:
                ending = Ending.NOT_FINITE
                break
            sys.stdout.write(f"{iteration:4d} {functions.f:.8e} {measures.primal:.2e} interior point\n")
            if measures.error <= options.tolerance:
                if self._program.factorise(self._point, PARAMETERS.saddle_test_damping):
                    ending = Ending.OPTIMAL
                    break
                self._saddles += 1  # from near one the next steps lead on, from it there is none
                if self._saddles > PARAMETERS.saddles_max:
                    ending = Ending.SADDLE
                    break
            self._least_damping = min(PARAMETERS.least_damping, measures.violation)
            if self._stagnates(measures):
                ending = Ending.INFEASIBLE
                break
            if iteration == options.iterations_max:
                ending = Ending.ITERATION_LIMIT
                break
            if iteration == 0 and begins_with_search:
                leave_below = PARAMETERS.first_progress * measures.violation
                self._search = FilterSearch(
                    self._program, self._options.barrier, self._least_barrier, measures, leave_below
                )
            if not self._advance(measures):
                break
        return self._result(ending, iteration)

    def _stagnates(self, measures: Measures) -> bool:
        """Count iterations that hardly lessen the violations; tell whether there are too many."""
        if measures.infeasibility < (1.0 - PARAMETERS.lessening) * self._least_infeasibility:
            self._least_infeasibility, self._stagnation = measures.infeasibility, 0
        elif min(measures.primal, self._least_primal) > PARAMETERS.nearly_feasible:
            self._stagnation += 1
        self._least_primal = min(self._least_primal, measures.primal)
        return self._stagnation > PARAMETERS.stagnation_max

    def _linearise(self) -> Measures | None:
        """Linearise at the point; where a step without a search led too far for that, at the one before it."""
        measures = self._program.linearise(self._point, self._residuals)
        if measures is None and self._moves_freely:
            self._point, self._other = self._other, self._point
            measures = self._begin_search()
        return measures

    def _result(self, ending: Ending, iterations: int) -> SolverResult:
        functions = self._program.functions
        self._program.go_to(self._point)
        functions.values()  # which may be those of a step that was rejected
        return SolverResult(
            w=self._point.w.copy(),
            lam_g=functions.lam_g.copy(),
            objective=functions.f,
            ending=ending,
            status=ending.value,
            success=ending is Ending.OPTIMAL,
            iterations=iterations,
            derivative_seconds=functions.seconds,
        )

    def _begin(self, guess: Array, multipliers: Multipliers | None) -> None:
        """Begin at a guess, with slacks and multipliers of the first barrier parameter."""
        program, point = self._program, self._point
        point.w[:] = guess
        if multipliers is not None:
            bounded = np.concatenate([multipliers.constraints[program.rows], multipliers.bounds])
            point.z[:] = np.maximum(-program.sign * bounded[program.side], 0.0)
        point.s[:] = 1.0  # which have no weight yet
        self._estimate_multipliers()
        self._centre(program.slacks(guess), max(self._options.barrier, PARAMETERS.first_barrier))

    def _estimate_multipliers(self) -> None:
        """Give gaps and equalities the multipliers that balance those of bounds best (least squares)."""
        program, point, residuals = self._program, self._point, self._residuals
        point.y[:], point.e[:] = 0.0, 0.0
        program.go_to(point)
        program.functions.slope()
        program.functions.values()
        program.residuals(point, residuals)
        residuals.primal[len(point.w) :] = 0.0
        program.matrices.write_identity(program.functions.jacobian_sources())
        program.factorise(None, 0.0)
        program.solve(point, residuals, np.zeros(len(point.s)), self._step)
        program.matrices.clear()
        point.y[:], point.e[:] = self._step.y, self._step.e

    def _centre(self, slacks: Array, barrier: float) -> None:
        """Give slacks and multipliers at least the products of a barrier parameter; the larger of both is kept."""
        point, at_rest = self._point, np.sqrt(barrier)
        trusted = np.maximum(point.z, at_rest)
        point.z[:] = np.where(point.z >= slacks, trusted, barrier / np.maximum(slacks, at_rest))
        point.s[:] = np.maximum(slacks, barrier / point.z)

    def _advance(self, at: Measures) -> bool:
        """Go on from a point with these measures to the next one; return False where there is none."""
        measures: Measures | None = at
        stalls = len(self._recent) == PARAMETERS.memory and measures.violation > PARAMETERS.progress * max(self._recent)
        if self._search is not None and measures.violation <= self._search.leave_below:
            self._search, self._highest_objective = None, np.inf
            self._recent.clear()
        elif self._search is None and stalls:
            is_small = 0.0 < measures.mean_product < PARAMETERS.least_ratio * measures.primal
            is_lower = self._program.functions.f < self._highest_objective
            measures = self._centre_again(measures) if is_small and is_lower else self._begin_search()
        if measures is None:
            return False
        if self._search is None:
            self._recent.append(measures.violation)
            self._moves_freely = self._step_freely()
            if self._moves_freely:
                return True
            measures = self._begin_search()
        return measures is not None and (self._step_with_search(measures) or self._restart())

    def _centre_again(self, measures: Measures) -> Measures | None:
        """Centre the point, whose slacks have become too small; return its measures then."""
        objective, self._moves_freely = self._program.functions.f, False
        self._highest_objective = objective - PARAMETERS.descent * abs(objective)
        self._recent.clear()
        self._centre(self._point.s + self._residuals.s, PARAMETERS.centred * measures.primal)
        return self._program.linearise(self._point, self._residuals)

    def _step_freely(self) -> bool:
        """Take a step that chooses its barrier parameter, damped until it can be trusted; return whether it exists."""
        program, point, step = self._program, self._point, self._step
        while self._damping <= PARAMETERS.most_damping:
            if program.factorise(point, self._damping):
                primal, dual = program.predict_and_correct(point, self._residuals, self._least_barrier, step)
                moved = primal * step.w
                largest = float(np.abs(moved).max())
                if largest <= PARAMETERS.largest_step:
                    if _takes_back(moved, self._moved):
                        self._damping *= PARAMETERS.damping_factor
                    elif largest < PARAMETERS.largest_step / 3.0:
                        self._damping = max(self._damping / PARAMETERS.damping_factor, self._least_damping)
                    self._moved = moved
                    self._other.become(point, step, primal, dual)
                    self._point, self._other = self._other, point
                    return True
            self._damping *= PARAMETERS.damping_factor
        return False

    def _begin_search(self) -> Measures | None:
        """Begin a search, with multipliers of gaps and equalities that no step led astray; return the measures."""
        self._estimate_multipliers()
        measures = self._program.linearise(self._point, self._residuals)
        if measures is not None:
            barrier = max(min(PARAMETERS.searched_share * measures.mean_product, 1.0), self._least_barrier)
            leave_below = PARAMETERS.progress * max(self._recent, default=np.inf)
            self._search = FilterSearch(self._program, barrier, self._least_barrier, measures, leave_below)
            self._damping, self._moves_freely = self._least_damping, False
        return measures

    def _step_with_search(self, measures: Measures) -> bool:
        assert self._search is not None
        damping = self._search.advance(self._point, self._residuals, measures, self._damping)
        if damping is None:
            return False
        self._damping = max(damping / PARAMETERS.damping_factor, self._least_damping)
        return True

    def _restart(self) -> bool:
        """Make slacks and multipliers anew; return whether that is still allowed."""
        if self._restarts == PARAMETERS.restarts_max:
            return False
        assert self._search is not None
        self._restarts += 1
        barrier = max(PARAMETERS.restart_factor * self._search.barrier, PARAMETERS.restart_barrier)
        self._point.z[:] = 0.0
        self._centre(self._point.s + self._residuals.s, barrier)
        self._estimate_multipliers()
        self._search, self._damping = None, self._least_damping
        self._highest_objective, self._stagnation = np.inf, 0
        self._recent.clear()
        return True


def _takes_back(moved: Array, before: Array) -> bool:
    """Tell whether a step takes back the one before it."""
    now, last = float(np.linalg.norm(moved)), float(np.linalg.norm(before))
    return now > PARAMETERS.as_long * last and float(moved @ before) < PARAMETERS.takes_back * now * last
