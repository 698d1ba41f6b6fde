"""Predictor-corrector steps of an interior point method, for a guess whose multipliers may be known.

Mehrotra's method [Mehrotra 1992] with Gondzio's corrections [Gondzio 1996] on the nonlinear program, its derivatives
taken anew at every iterate. That takes about half of fatrop's iterations, whose steps are cut short by slacks that
vanish. There is no line search: a number on the diagonal [Levenberg 1944, Marquardt 1963] keeps steps as short as the
program is trusted, which leads along valleys that are curved and nearly flat, such as the choice of a bank where there
is no lift. Where steps lead nowhere it gives up, and another solver has to be asked.

The Newton step is the native Riccati recursion, `riccati.c`. For it the matrices of all stages are dense and lie one
behind the other. Constraints besides the gaps (rows) and simple bounds enter with weights, which an interior point
method has for inequalities and a penalty for equalities.
"""

import ctypes
import sys
from collections import deque

import numpy as np
from numpy.typing import NDArray

from airrace.native.library import library
from airrace.optimal_control.assembly import MOST_UNKNOWNS, Assembly, StageMatrices
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.optimality import MULTIPLIER_SCALE
from airrace.optimal_control.solvers.interface import Bounds, Ending, SolverOptions, SolverResult
from airrace.records import record
from airrace.trajectory import Array


def available(assembly: Assembly) -> bool:
    """Return whether the steps of a program can be solved here."""
    layout = assembly.layout
    return library() is not None and int((layout.stage_states + layout.stage_controls).max()) <= MOST_UNKNOWNS


class StageSystem(StageMatrices):
    """The linear system of a program's Newton steps (n_w unknowns, n_r rows, n_y gaps), written anew for every step."""

    def __init__(self, assembly: Assembly) -> None:
        super().__init__(assembly)
        native = library()
        assert native is not None  # see `available`
        self._native = native.evaluator
        self._factors = np.zeros_like(self.hessian.doubles)
        self._first = np.zeros(self.states**2)
        self._room = np.zeros(self.unknowns), np.zeros(self.states * len(self.sizes))

    def factorise(self, weights: Array) -> bool:
        """Factorise, with the weights of rows and simple bounds, shape (n_r + n_w,).

        Returns:
            Whether the step leads to a minimum: the matrix has the inertia that it has at one.
        """
        of_rows, of_bounds = np.split(np.ascontiguousarray(weights), [self.rows])
        constraints = self.constraints.doubles
        arrays = (self.sizes, self.hessian.doubles, constraints, self.row_counts, constraints[self.gap_size :])
        arrays = (*arrays, of_rows, of_bounds, self._factors, self._first)
        wrong: int = self._native.riccati_factorise(len(self.sizes), self.states, *map(_address, arrays))
        return wrong == 0

    def solve(self, stationarity: Array, gaps: Array) -> tuple[Array, Array]:
        """Return the unknowns (n_w,) and the multipliers of the gaps (n_y,) for right-hand sides of the same shapes."""
        step, multipliers = np.empty(self.unknowns), np.empty(self.gaps)
        arrays = (self.sizes, self.constraints.doubles, self._factors, self._first)
        arrays = (*arrays, np.ascontiguousarray(stationarity), np.ascontiguousarray(gaps), *self._room)
        self._native.riccati_solve(len(self.sizes), self.states, *map(_address, (*arrays, step, multipliers)))
        return step, multipliers

    def values(self, step: Array) -> Array:
        """Return the changes of rows and unknowns with a step, shape (n_r + n_w,)."""
        result = np.concatenate([np.empty(self.rows), step])
        arrays = (self.sizes, self.row_counts, self.constraints.doubles[self.gap_size :], result[self.rows :], result)
        self._native.riccati_rows(len(self.sizes), *map(_address, arrays))
        return result

    def transpose_multiply(self, values: Array) -> Array:
        """Return the transpose of `values` times multipliers of rows and unknowns, shape (n_w,)."""
        result, multipliers = values[self.rows :].copy(), np.ascontiguousarray(values)
        arrays = (self.sizes, self.row_counts, self.constraints.doubles[self.gap_size :], multipliers, result)
        self._native.riccati_rows_transposed(len(self.sizes), *map(_address, arrays))
        return result


def _address(array: Array | NDArray[np.int32]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


@record
class Parameters:
    """The constants of the method.

    Attributes:
        iterations_max: after which steps are given up. Of 61 solves on refined meshes of the shipped courses 60 led to
            an optimum, after 8 at most; fatrop took 8 to 23.
        downhill: so many iterations lead on if the objective falls over them at nearly feasible points;
            `iterations_max` does not end them then, only that of the options. A roll that moves along its leg took 107
            to 157, and fatrop 200 to 600.
        nearly_feasible: the largest infeasibility of such points, scaled (1).
        nearly_optimal: the error from which on steps go on as long as each lessens it, likewise.
        largest_step: the largest change of a scaled unknown in a step; in those valleys 0.8 and 3 take up to half as
            many iterations more.
        first_barrier: least first value of the barrier parameter: with less, slacks are so small that more steps are
            cut short.
        last_barrier: last value of the barrier parameter, as a part of the tolerance.
        least_damping: the least number on the diagonal: some controls matter so little, such as the throttle just
            before the end, that they would move by their whole range from step to step, in up to 25 iterations of a
            solve. With 1e-5 all take a third more.
        minimum_damping: the largest one with which an optimum is taken for a minimum.
        most_damping: the largest one; where it leads to no step either, there is none.
        damping_factor: by which it grows until a step leads to a minimum and is short enough, and falls after a step
            of less than a third of the largest.
        takes_back, as_long: the cosine of the angle between two steps, and the ratio of their lengths, from which on
            the second takes the first back and damping grows: two points may lead to each other for ever, as where a
            commanded roll rate went to and fro by 0.08 in 60 of 80 steps.
        equality_weight: of the penalty on equalities; what is left of them the next step sees to.
        corrections_max, step_gain, least_gain, long_enough: of Gondzio's corrections: how many, by how much one tries
            to lengthen the step, the least that it has to win, and the step from which on there is none.
        recentred_every, recentred_barrier: where multipliers were known, every so many iterations raise the barrier
            parameter to this value, except at a nearly optimal point: with less, what is on its bounds changes by an
            interval per step. 13 solves that begin with another stage's took 42 to 76 iterations, with it 31 to 51.
        spread: products of slack and multiplier stay within this factor of the barrier parameter.
        boundary_fraction: part of the way to where the first slack vanishes.
    """

    iterations_max: int = 120
    downhill: int = 20
    nearly_feasible: float = 0.1
    nearly_optimal: float = 1e-5
    largest_step: float = 1.5
    first_barrier: float = 1e-5
    last_barrier: float = 0.1
    least_damping: float = 1e-6
    minimum_damping: float = 1e-2
    most_damping: float = 10.0
    damping_factor: float = 4.0
    takes_back: float = -0.9
    as_long: float = 0.9
    equality_weight: float = 1e6
    corrections_max: int = 3
    step_gain: float = 0.3
    least_gain: float = 0.02
    long_enough: float = 0.95
    recentred_every: int = 20
    recentred_barrier: float = 1e-4
    spread: float = 10.0
    boundary_fraction: float = 0.99


PARAMETERS = Parameters()


class _OneSidedBounds:
    """The finite sides of inequalities of (rows, unknowns): places, bounds and signs, 1 for lower sides."""

    def __init__(self, lower: Array, upper: Array) -> None:
        below = np.flatnonzero((lower != upper) & np.isfinite(lower))
        above = np.flatnonzero((lower != upper) & np.isfinite(upper))
        self.places = np.concatenate([below, above])
        self.bounds = np.concatenate([lower[below], upper[above]])
        self.signs = np.concatenate([np.ones(len(below)), -np.ones(len(above))])
        self.size = len(lower)

    def changes(self, values: Array) -> Array:
        """Return what changes of (rows, unknowns) are for the slacks."""
        return self.signs * values[self.places]

    def sum(self, sides: Array) -> Array:
        """Return the sums over both sides of every row and unknown."""
        return np.bincount(self.places, sides, self.size).astype(np.float64, copy=False)


@record
class _PrimalDualPoint:
    """The unknowns w (n_w,), multipliers y of the gaps (n_y,) and e of equalities, slacks s of the sides and their
    multipliers z; or the changes of all these in a step."""

    w: Array
    y: Array
    e: Array
    s: Array
    z: Array

    def advance(self, step: "_PrimalDualPoint", primal: float, dual: float) -> "_PrimalDualPoint":
        """Return the point after parts of a step."""
        return _PrimalDualPoint(
            self.w + primal * step.w,
            self.y + primal * step.y,
            self.e + primal * step.e,
            self.s + primal * step.s,
            self.z + dual * step.z,
        )

    @property
    def products(self) -> Array:
        return self.s * self.z


@record
class _Residuals:
    """The violations of the conditions of optimality: stationarity, gaps, equalities, slacks."""

    stationarity: Array
    gaps: Array
    equalities: Array
    slacks: Array


class PredictorCorrector:
    """The method for one program with changing bounds, parameters and guesses."""

    def __init__(self, functions: Evaluation) -> None:
        self._functions = functions
        self._system = StageSystem(functions.assembly)

    def solve(
        self, guess: Array, bounds: Bounds, p: Array, multipliers: Array | None, options: SolverOptions
    ) -> SolverResult:
        """Solve from a guess.

        Args:
            guess: of the unknowns, shape (n_w,).
            bounds: of unknowns and constraints.
            p: the parameters.
            multipliers: of (g, w), shape (n_g + n_w,); those of equalities are not asked for. None if nothing is known.
            options: tolerance, first value of the barrier parameter, number of iterations.

        Raises:
            SolverCrash: the program could not be evaluated.
        """
        self._functions.p[:] = p
        self._functions.forget()
        return _Solve(self._functions, self._system, bounds, options).solve(guess, multipliers)


class _Solve:
    def __init__(self, functions: Evaluation, system: StageSystem, bounds: Bounds, options: SolverOptions) -> None:
        layout = functions.assembly.layout
        self._functions, self._system, self._options = functions, system, options
        self._gaps, self._rows = layout.gap_index.ravel(), layout.row_index
        lower = np.concatenate([bounds.g_lower[self._rows], bounds.lower])
        upper = np.concatenate([bounds.g_upper[self._rows], bounds.upper])
        self._sides = _OneSidedBounds(lower, upper)
        self._equal = np.flatnonzero(lower == upper)
        self._targets, self._jumps = lower[self._equal], bounds.g_lower[self._gaps]
        self._barrier = max(options.barrier, PARAMETERS.first_barrier)
        self._least = min(PARAMETERS.last_barrier * options.tolerance, options.barrier)
        self._damping = PARAMETERS.least_damping
        self._moved = np.zeros(layout.unknowns)

    def solve(self, guess: Array, multipliers: Array | None) -> SolverResult:
        if len(self._sides.places) == 0:  # there is no barrier
            return self._result(guess, np.zeros(len(self._functions.g)), Ending.NO_STEP, 0)
        usual = min(self._options.iterations_max, PARAMETERS.iterations_max)
        point, iteration, ending, before = self._first(guess, multipliers), 0, Ending.NO_STEP, np.inf
        objectives = deque[float](maxlen=PARAMETERS.downhill)
        for iteration in range(self._options.iterations_max + 1):
            residuals = self._residuals(point)
            if residuals is None:
                ending = Ending.NOT_FINITE
                break
            error, infeasibility = self._errors(point, residuals)
            sys.stdout.write(f"{iteration:4d} {self._functions.f:.8e} {infeasibility:.2e} predictor-corrector\n")
            if error <= self._options.tolerance:
                if self._damping > PARAMETERS.minimum_damping:
                    break
                w = self._restore_fixed(point.w)
                return self._result(w, self._multipliers(point), Ending.OPTIMAL, iteration)
            objectives.append(self._functions.f)
            downhill = len(objectives) == PARAMETERS.downhill and self._functions.f < objectives[0]
            downhill = downhill and infeasibility < PARAMETERS.nearly_feasible
            leads_on = downhill or error < min(before, PARAMETERS.nearly_optimal)
            if iteration == self._options.iterations_max or (iteration >= usual and not leads_on):
                ending = Ending.ITERATION_LIMIT
                break
            before = error
            recentred = iteration > 0 and iteration % PARAMETERS.recentred_every == 0
            if recentred and multipliers is not None and error > PARAMETERS.nearly_optimal:
                point = self._recentre(point, residuals)
                residuals = self._residuals(point)
                if residuals is None:
                    ending = Ending.NOT_FINITE
                    break
            following = self._next(point, residuals)
            if following is None:
                break
            point = following
        return self._result(point.w, self._multipliers(point), ending, iteration)

    def _result(self, w: Array, lam_g: Array, ending: Ending, iterations: int) -> SolverResult:
        steps = "predictor-corrector steps"
        return SolverResult(
            w=w,
            lam_g=lam_g,
            objective=self._functions.f,
            ending=ending,
            status=f"solved by {steps}" if ending is Ending.OPTIMAL else f"{steps}: {ending.value}",
            success=ending is Ending.OPTIMAL,
            iterations=iterations,
            derivative_seconds=self._functions.seconds,
        )

    def _first(self, guess: Array, multipliers: Array | None) -> _PrimalDualPoint:
        """Return the first point, with slacks and multipliers of the first barrier parameter.

        The multipliers of equalities are those that balance the others best (least squares).
        """
        functions, sides = self._functions, self._sides
        functions.w[:] = guess
        functions.values()
        slacks = sides.signs * (self._values(guess)[sides.places] - sides.bounds)
        if multipliers is None:
            multipliers = np.zeros(len(functions.g) + len(guess))
        known = np.concatenate([multipliers[self._rows], multipliers[len(functions.g) :]])
        z = np.maximum(-sides.changes(known), 0.0)
        point = _PrimalDualPoint(guess, np.zeros(len(self._gaps)), np.zeros(len(self._equal)), slacks, z)
        functions.lam_f = 1.0
        functions.lam_g[:] = self._multipliers(point)
        functions.slope()
        stationarity = functions.gradient + self._of_values(point)[len(self._rows) :]
        self._system.write_identity(functions.jacobian_sources())
        self._system.factorise(self._weights(np.zeros_like(z)))
        _, y, e, _ = self._solve_system(-stationarity, np.zeros_like(point.y), np.zeros_like(point.e))
        self._system.clear()
        return _PrimalDualPoint(guess, y, e, *_central(slacks, z, self._barrier))

    def _recentre(self, point: _PrimalDualPoint, residuals: _Residuals) -> _PrimalDualPoint:
        """Return the point with slacks and multipliers of the barrier parameter that is raised again."""
        slacks, z = _central(point.s + residuals.slacks, point.z, PARAMETERS.recentred_barrier)
        return _PrimalDualPoint(point.w, point.y, point.e, slacks, z)

    def _residuals(self, point: _PrimalDualPoint) -> _Residuals | None:
        """Evaluate the program at a point; None where its numbers are none."""
        functions, sides = self._functions, self._sides
        functions.w[:] = point.w
        functions.lam_g[:] = self._multipliers(point)
        functions.values()
        finite = self._system.write(functions.jacobian_sources(), functions.hessian_sources())
        values = self._values(point.w)
        found = _Residuals(
            functions.gradient + self._of_values(point)[len(self._rows) :],
            functions.g[self._gaps] - self._jumps,
            values[self._equal] - self._targets,
            sides.signs * (values[sides.places] - sides.bounds) - point.s,
        )
        return found if finite and np.isfinite(functions.f) and np.isfinite(found.stationarity).all() else None

    def _errors(self, point: _PrimalDualPoint, residuals: _Residuals) -> tuple[float, float]:
        """Return the largest KKT error, as `kkt_error` measures it, and the primal one."""
        size = max(MULTIPLIER_SCALE, *(float(np.abs(one).mean()) for one in (point.y, point.z) if len(one)))
        primal = max(_largest(residuals.gaps), _largest(residuals.equalities), _largest(residuals.slacks))
        products = _largest((point.s + residuals.slacks) * point.z)
        dual = max(_largest(residuals.stationarity), products) * MULTIPLIER_SCALE / size
        return max(primal, dual, _largest(point.products) * MULTIPLIER_SCALE / size), primal

    def _next(self, point: _PrimalDualPoint, residuals: _Residuals) -> _PrimalDualPoint | None:
        """Return the next point, after a step that is damped until it can be trusted; None where there is none."""
        weights, unknowns = self._weights(point.z / point.s), slice(len(self._rows), None)
        while self._damping <= PARAMETERS.most_damping:
            damped = weights.copy()
            damped[unknowns] += self._damping
            if self._system.factorise(damped):
                found = self._after_step(point, residuals)
                moved = found.w - point.w
                largest = _largest(moved)
                if largest <= PARAMETERS.largest_step:
                    before, self._moved = self._moved, moved
                    if _takes_back(moved, before):
                        self._damping *= PARAMETERS.damping_factor
                    elif largest < PARAMETERS.largest_step / 3.0:
                        self._damping = max(self._damping / PARAMETERS.damping_factor, PARAMETERS.least_damping)
                    return found
            self._damping *= PARAMETERS.damping_factor
        return None

    def _after_step(self, point: _PrimalDualPoint, residuals: _Residuals) -> _PrimalDualPoint:
        """Return the point after a step with the matrix that was factorised."""
        average = float(point.products.mean())
        predicted = self._step(point, residuals, -point.products)
        primal, dual = _step_lengths(point, predicted, 1.0)
        ahead = float(point.advance(predicted, primal, dual).products.mean())
        barrier = max(min(1.0, (ahead / average) ** 3) * average, self._least)
        most = PARAMETERS.spread**2 * max(average, barrier)
        least = -np.maximum(0.5 * point.products, barrier)  # less would keep a product that is too large where it is
        second_order = np.clip(predicted.products, least, most)
        step = self._step(point, residuals, barrier - point.products - second_order)
        return point.advance(*self._correct(point, step, barrier))

    def _correct(
        self, point: _PrimalDualPoint, step: _PrimalDualPoint, barrier: float
    ) -> tuple[_PrimalDualPoint, float, float]:
        """Return the step with Gondzio's corrections, which lengthen it, and its lengths."""
        gain, spread = PARAMETERS.step_gain, PARAMETERS.spread
        reach = max(PARAMETERS.boundary_fraction, 1.0 - barrier)
        primal, dual = _step_lengths(point, step, reach)
        for _ in range(PARAMETERS.corrections_max):
            if min(primal, dual) > PARAMETERS.long_enough:
                break
            products = point.advance(step, min(1.0, primal + gain), min(1.0, dual + gain)).products
            wanted = np.clip(products, barrier / spread, spread * barrier) - products
            nothing = _Residuals(*(np.zeros_like(one) for one in (point.w, point.y, point.e, point.s)))
            correction = self._step(point, nothing, np.maximum(wanted, -spread * barrier))
            candidate = step.advance(correction, 1.0, 1.0)
            longer = _step_lengths(point, candidate, reach)
            if sum(longer) < primal + dual + PARAMETERS.least_gain:
                break
            step, (primal, dual) = candidate, longer
        return step, primal, dual

    def _step(self, point: _PrimalDualPoint, residuals: _Residuals, products: Array) -> _PrimalDualPoint:
        """Return the step after which the linear conditions hold, and slack times multiplier changes so."""
        sides = self._sides
        z = (products - point.z * residuals.slacks) / point.s
        pull = self._system.transpose_multiply(sides.sum(sides.signs * z))
        w, y, e, changes = self._solve_system(pull - residuals.stationarity, -residuals.gaps, -residuals.equalities)
        moved = sides.changes(changes)
        return _PrimalDualPoint(w, y, e, moved + residuals.slacks, z - point.z / point.s * moved)

    def _solve_system(self, stationarity: Array, gaps: Array, equalities: Array) -> tuple[Array, Array, Array, Array]:
        """Return the changes of unknowns, of the multipliers of gaps and of equalities, and of (rows, unknowns)."""
        penalty = 1.0 / PARAMETERS.equality_weight
        pull = np.zeros(self._sides.size)
        pull[self._equal] = equalities / penalty
        w, y = self._system.solve(stationarity + self._system.transpose_multiply(pull), gaps)
        changes = self._system.values(w)
        return w, y, (changes[self._equal] - equalities) / penalty, changes

    def _restore_fixed(self, w: Array) -> Array:
        """Return the unknowns with those that are given as they are given, of which a penalty leaves 1e-11."""
        values = np.concatenate([np.zeros(len(self._rows)), w])
        values[self._equal] = self._targets
        return values[len(self._rows) :]

    def _weights(self, of_sides: Array) -> Array:
        weights = self._sides.sum(of_sides)
        weights[self._equal] = PARAMETERS.equality_weight
        return weights

    def _values(self, w: Array) -> Array:
        return np.concatenate([self._functions.g[self._rows], w])

    def _of_values(self, point: _PrimalDualPoint) -> Array:
        """Return the multipliers of (rows, unknowns), positive where an upper bound is pressed on."""
        multipliers = -self._sides.sum(self._sides.signs * point.z)
        multipliers[self._equal] += point.e
        return multipliers

    def _multipliers(self, point: _PrimalDualPoint) -> Array:
        """Return the multipliers of the constraints."""
        multipliers = np.zeros(len(self._functions.g))
        multipliers[self._gaps] = point.y
        multipliers[self._rows] = self._of_values(point)[: len(self._rows)]
        return multipliers


def _central(slacks: Array, z: Array, barrier: float) -> tuple[Array, Array]:
    """Return slacks and multipliers whose products are the barrier parameter; the larger of both is trusted."""
    at_rest = np.sqrt(barrier)
    z = np.where(z >= slacks, np.maximum(z, at_rest), barrier / np.maximum(slacks, at_rest))
    return np.maximum(slacks, barrier / z), z


def _step_lengths(point: _PrimalDualPoint, step: _PrimalDualPoint, reach: float) -> tuple[float, float]:
    """Return how far slacks and multipliers can go, at most the whole step and a part of the way to zero."""
    ratios = (float((change / value).min(initial=0.0)) for value, change in ((point.s, step.s), (point.z, step.z)))
    primal, dual = (1.0 if ratio >= -reach else -reach / ratio for ratio in ratios)
    return primal, dual


def _takes_back(moved: Array, before: Array) -> bool:
    """Tell whether a step takes back the one before it."""
    now, last = float(np.linalg.norm(moved)), float(np.linalg.norm(before))
    return now > PARAMETERS.as_long * last and float(moved @ before) < PARAMETERS.takes_back * now * last


def _largest(values: Array) -> float:
    return float(np.abs(values).max(initial=0.0))
