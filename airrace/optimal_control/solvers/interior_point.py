"""A primal-dual interior point method on a program of stages.

The step is Mehrotra's predictor and corrector [Mehrotra 1992] with Gondzio's corrections [Gondzio 1996], on a nonlinear
program whose derivatives are taken anew at every iterate; the native library computes it with a Riccati recursion,
whose pivots give the inertia. Damping, a number on the diagonal [Levenberg 1944, Marquardt 1963], makes it that of a
minimum and keeps steps as short as the program is trusted.

The method has two modes [Nocedal, Waechter & Waltz 2009]. In free mode, as long as the conditions of optimality come
closer over some iterates, the step chooses its barrier parameter by itself and is taken as it is. Where they do not,
either the slacks have become too small for the infeasibility that is left, and the point is centred again; or a line
search with a filter [Waechter & Biegler 2006] takes steps to the minimum of the barrier function, the barrier parameter
held until its problem is solved, until the conditions are closer. Where no step passes the filter, slacks and
multipliers are reset for a large barrier parameter, twice at most.

So the barrier parameter is lowered in two places: in free mode by the predictor, in `interior_point.c` of the native
library, and in a search by `FilterSearch`.
"""

import sys
from collections import deque
from dataclasses import replace

import numpy as np

from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.solvers.bounded_program import BoundedProgram, Measures
from airrace.optimal_control.solvers.filter_search import FilterSearch
from airrace.optimal_control.solvers.interface import Bounds, Ending, Multipliers, Solver, SolverOptions, SolverResult
from airrace.optimal_control.trajectory import Array

FIRST_BARRIER_MIN = 1e-5
"""The least first value of the barrier parameter: with less, slacks are so small that more steps are cut short."""
BARRIER_PER_TOLERANCE = 0.1
"""The last value of the barrier parameter, as a part of the tolerance."""
STEP_MAX = 1.5
"""The largest change of a scaled unknown in free mode; in flat valleys 0.8 and 3 take up to half as many iterations
more."""
DAMPING_MIN = 1e-6
"""The least damping: some controls matter so little, such as the throttle just before the end, that they would move by
their whole range from step to step, in up to 25 iterations of a solve. With 1e-5 all take a third more."""
DAMPING_MAX = 10.0
"""The largest damping in free mode."""
DAMPING_FACTOR = 4.0
"""By which damping grows until a step descends and is short enough, and falls after a short step."""
SADDLE_DAMPING, SADDLES_MAX = 1e-2, 3
"""The damping with which the step from a minimum must have the right inertia; the number of points that may fail it."""
REVERSAL_COSINE, REVERSAL_RATIO = -0.9, 0.9
"""The cosine of the angle between two steps, and the ratio of their lengths, from which on the second reverses the
first and damping grows: a commanded roll rate went to and fro by 0.08 in 60 of 80 steps."""
MEMORY, PROGRESS = 5, 0.999
"""There is progress where the largest violation is less than this part of the largest at so many points before."""
PRODUCT_RATIO, CENTRING, DESCENT = 0.03, 0.1, 1e-6
"""Where the mean product of slack and multiplier is less than the first part of the infeasibility, the point is centred
for a barrier parameter of the second part of it; and again, if the objective has fallen by the third part since. On
seven courses 554 solves took 4 % fewer iterations for it, the slowest of them up to 60 % fewer."""
REDUCTION = 0.1
"""An iteration that reduces the sum of all violations by less than this part counts as stagnation (1)."""
COLD_BARRIER, COLD_PROGRESS = 0.1, 0.9
"""Without multipliers and with a first barrier parameter of at least the former, the guess may be far off: the method
begins with a search until violations are this part of the guess's. Whole steps led to other valleys, up to 1 s slower
in 30 s. Where the search fails, whole steps are tried."""
SEARCH_BARRIER_SHARE, SEARCH_BARRIER_MAX = 0.8, 1.0
"""The barrier parameter of a search, as a part of the mean product of slack and multiplier, and its largest value."""
RESTARTS_MAX, RESTART_FACTOR, RESTART_BARRIER_MIN = 2, 10.0, 0.1
"""How often slacks and multipliers are reset, for a barrier parameter of so many times that of the search, at least
the last number."""


class InteriorPoint(Solver):
    """The method for one program with changing bounds, parameters and guesses."""

    begins_with_multipliers = True

    def __init__(self, functions: Evaluation, options: SolverOptions) -> None:
        self._functions, self._options = functions, options

    def solve(self, guess: Array, bounds: Bounds, p: Array, multipliers: Multipliers | None) -> SolverResult:
        self._functions.p[:] = p
        self._functions.forget()
        program = BoundedProgram(self._functions, bounds)
        is_cold = multipliers is None and self._options.barrier >= COLD_BARRIER
        result = _Solve(program, self._options).solve(guess, multipliers, begins_in_search=is_cold)
        left = self._options.iterations_max - result.iterations
        if result.ending not in (Ending.NO_STEP, Ending.NOT_FINITE) or not is_cold or left <= 0:
            return result
        again = _Solve(program, replace(self._options, iterations_max=left)).solve(guess, multipliers)
        return replace(again, iterations=result.iterations + again.iterations)


class _Solve:
    def __init__(self, program: BoundedProgram, options: SolverOptions) -> None:
        self._program, self._options = program, options
        self._barrier_min = min(BARRIER_PER_TOLERANCE * options.tolerance, options.barrier)
        self._point, self._previous_point, self._step, self._residuals = (program.vector() for _ in range(4))
        self._damping = self._damping_min = DAMPING_MIN
        self._last_change = np.zeros(len(self._point.w))
        self._recent = deque[float](maxlen=MEMORY)
        self._restarts = self._stagnation = self._saddles = 0
        self._infeasibility_min = self._primal_min = np.inf
        self._is_free = False  # whether the last step was one of free mode
        self._recentring_objective = np.inf  # below which the point is centred again
        self._search: FilterSearch | None = None

    def solve(self, guess: Array, multipliers: Multipliers | None, *, begins_in_search: bool = False) -> SolverResult:
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
                if self._program.factorise(self._point, SADDLE_DAMPING):
                    ending = Ending.OPTIMAL
                    break
                self._saddles += 1  # from near one the next steps lead on, from it there is none
                if self._saddles > SADDLES_MAX:
                    ending = Ending.SADDLE
                    break
            self._damping_min = min(DAMPING_MIN, measures.violation)
            if self._stagnates(measures):
                ending = Ending.INFEASIBLE
                break
            if iteration == options.iterations_max:
                ending = Ending.ITERATION_LIMIT
                break
            if iteration == 0 and begins_in_search:
                violation_max = COLD_PROGRESS * measures.violation
                self._search = FilterSearch(
                    self._program, self._options.barrier, self._barrier_min, measures, violation_max
                )
            if not self._advance(measures):
                break
        return self._result(ending, iteration)

    def _stagnates(self, measures: Measures) -> bool:
        """Count iterations that hardly reduce the violations; return whether there are too many."""
        if measures.infeasibility < (1.0 - REDUCTION) * self._infeasibility_min:
            self._infeasibility_min, self._stagnation = measures.infeasibility, 0
        elif min(measures.primal, self._primal_min) > self._options.nearly_feasible:
            self._stagnation += 1
        self._primal_min = min(self._primal_min, measures.primal)
        return self._stagnation > self._options.stagnation_max

    def _linearise(self) -> Measures | None:
        """Linearise at the point; where a step of free mode led too far for that, at the one before it."""
        measures = self._program.linearise(self._point, self._residuals)
        if measures is None and self._is_free:
            self._point, self._previous_point = self._previous_point, self._point
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
            point.z[:] = np.maximum(-program.sign * bounded[program.inequality], 0.0)
        point.s[:] = 1.0  # which have no weight yet
        self._estimate_multipliers()
        self._centre(program.slacks(guess), max(self._options.barrier, FIRST_BARRIER_MIN))

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
        self._point.s[:], self._point.z[:] = centre(slacks, self._point.z, barrier)

    def _advance(self, measures: Measures | None) -> bool:
        """Go on from a point with these measures to the next one; return False where there is none."""
        assert measures is not None
        stalls = len(self._recent) == MEMORY and measures.violation > PROGRESS * max(self._recent)
        if self._search is not None and measures.violation <= self._search.violation_max:
            self._search, self._recentring_objective = None, np.inf
            self._recent.clear()
        elif self._search is None and stalls:
            is_off_centre = 0.0 < measures.mean_product < PRODUCT_RATIO * measures.primal
            is_lower = self._program.functions.f < self._recentring_objective
            measures = self._recentre(measures) if is_off_centre and is_lower else self._begin_search()
        if measures is None:
            return False
        if self._search is None:
            self._recent.append(measures.violation)
            self._is_free = self._take_free_step()
            if self._is_free:
                return True
            measures = self._begin_search()
        return measures is not None and (self._take_search_step(measures) or self._restart())

    def _recentre(self, measures: Measures) -> Measures | None:
        """Centre the point, whose slacks have become too small; return its measures then."""
        objective, self._is_free = self._program.functions.f, False
        self._recentring_objective = objective - DESCENT * abs(objective)
        self._recent.clear()
        self._centre(self._point.s + self._residuals.s, CENTRING * measures.primal)
        return self._program.linearise(self._point, self._residuals)

    def _take_free_step(self) -> bool:
        """Take a step that chooses its barrier parameter, damped until it can be trusted; return whether it exists."""
        program, point, step = self._program, self._point, self._step
        while self._damping <= DAMPING_MAX:
            if program.factorise(point, self._damping):
                primal, dual = program.predict_and_correct(point, self._residuals, self._barrier_min, step)
                change = primal * step.w
                largest = float(np.abs(change).max())
                if largest <= STEP_MAX:
                    if _reverses(change, self._last_change):
                        self._damping *= DAMPING_FACTOR
                    elif largest < STEP_MAX / 3.0:
                        self._damping = max(self._damping / DAMPING_FACTOR, self._damping_min)
                    self._last_change = change
                    next_point = self._previous_point  # whose memory is free now
                    next_point.become(point, step, primal, dual)
                    self._point, self._previous_point = next_point, point
                    return True
            self._damping *= DAMPING_FACTOR
        return False

    def _begin_search(self) -> Measures | None:
        """Begin a search, with multipliers of gaps and equalities estimated anew; return the measures."""
        self._estimate_multipliers()
        measures = self._program.linearise(self._point, self._residuals)
        if measures is not None:
            barrier = max(min(SEARCH_BARRIER_SHARE * measures.mean_product, SEARCH_BARRIER_MAX), self._barrier_min)
            violation_max = PROGRESS * max(self._recent, default=np.inf)
            self._search = FilterSearch(self._program, barrier, self._barrier_min, measures, violation_max)
            self._damping, self._is_free = self._damping_min, False
        return measures

    def _take_search_step(self, measures: Measures) -> bool:
        assert self._search is not None
        damping = self._search.advance(self._point, self._residuals, measures, self._damping)
        if damping is None:
            return False
        self._damping = max(damping / DAMPING_FACTOR, self._damping_min)
        return True

    def _restart(self) -> bool:
        """Reset slacks and multipliers; return whether that is still allowed."""
        if self._restarts == RESTARTS_MAX:
            return False
        assert self._search is not None
        self._restarts += 1
        barrier = max(RESTART_FACTOR * self._search.barrier, RESTART_BARRIER_MIN)
        self._point.z[:] = 0.0
        self._centre(self._point.s + self._residuals.s, barrier)
        self._estimate_multipliers()
        self._search, self._damping = None, self._damping_min
        self._recentring_objective, self._stagnation = np.inf, 0
        self._recent.clear()
        return True


def centre(slacks: Array, multipliers: Array, barrier: float) -> tuple[Array, Array]:
    """Return slacks and multipliers with at least the products of a barrier parameter; the larger of both is kept."""
    middle = np.sqrt(barrier)  # where both are equal
    multipliers = np.where(multipliers >= slacks, np.maximum(multipliers, middle), barrier / np.maximum(slacks, middle))
    return np.maximum(slacks, barrier / multipliers), multipliers


def _reverses(change: Array, last_change: Array) -> bool:
    """Return whether a step takes back the one before it."""
    length, last_length = float(np.linalg.norm(change)), float(np.linalg.norm(last_change))
    is_as_long = length > REVERSAL_RATIO * last_length
    return is_as_long and float(change @ last_change) < REVERSAL_COSINE * length * last_length
