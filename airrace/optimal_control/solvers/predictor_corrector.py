"""Predictor-corrector steps of an interior point method, from a point near the optimum with known multipliers.

Mehrotra's method [Mehrotra 1992] with Gondzio's corrections [Gondzio 1996] on the nonlinear program, its derivatives
taken anew at every iterate: each factorisation serves a step towards the optimum, which tells how far the barrier can
fall, and the corrections that keep products of slacks and multipliers equal. Near an optimum that takes less than half
of fatrop's iterations, whose steps are cut short by slacks that vanish. There is no line search: where steps lead
nowhere, or not to a minimum, it gives up after a few, and another solver has to be asked.
"""

import sys

import numpy as np

from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.layout import Indices
from airrace.optimal_control.optimality import MULTIPLIER_SCALE
from airrace.optimal_control.solvers.fatrop.stages import Bounds
from airrace.optimal_control.solvers.riccati import StageSystem
from airrace.records import record
from airrace.trajectory import Array

ITERATIONS_MAX = 15
"""The number of iterations after which steps are given up.

Of 61 solves on refined meshes of the shipped courses 60 led to an optimum, after 8 at most; fatrop took 8 to 23.
"""
LARGEST_STEP = 1e3
"""The largest change of a scaled unknown that is believed."""
FIRST_BARRIER = 1e-5
"""The least first value of the barrier parameter: with less, slacks are so small that more steps are cut short."""
LAST_BARRIER = 0.1
"""The last value of the barrier parameter, as a part of the tolerance."""
ADDED = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
"""The numbers that are added to the diagonal in turn, until a step leads to a minimum.

The first is always added: some controls matter so little, such as the throttle just before the end, that they would
move by their whole range from step to step, in up to 25 iterations of a solve. With 1e-5 all take a third more.
"""
_PENALTY = 1e-6  # the inverse of the weight of equalities; what is left of them the next step sees to
_CORRECTIONS_MAX = 3
_LONGER = 0.3  # by so much a correction tries to lengthen the step [Gondzio 1996]
_WORTHWHILE = 0.02  # the least that it has to win
_LONG_ENOUGH = 0.95  # the step from which on there is none
_SPREAD = 10.0  # products of slack and multiplier are kept within this factor of the barrier parameter
_MOST_OF_THE_WAY = 0.99  # to where the first slack vanishes


@record
class Found:
    """The answer: unknowns w (n_w,), multipliers of the constraints (n_g,), and whether it is an optimum."""

    w: Array
    lam_g: Array
    optimal: bool
    iterations: int


@record
class _Sides:
    """The finite sides of inequalities of (rows, unknowns): places, bounds and signs, 1 for lower sides."""

    places: Indices
    bounds: Array
    signs: Array
    size: int

    @classmethod
    def of(cls, lower: Array, upper: Array) -> "_Sides":
        below = np.flatnonzero((lower != upper) & np.isfinite(lower))
        above = np.flatnonzero((lower != upper) & np.isfinite(upper))
        signs = np.concatenate([np.ones(len(below)), -np.ones(len(above))])
        bounds = np.concatenate([lower[below], upper[above]])
        return cls(np.concatenate([below, above]), bounds, signs, len(lower))

    def slacks(self, values: Array) -> Array:
        """Return how far values of (rows, unknowns) are from the bounds."""
        return self.signs * (values[self.places] - self.bounds)

    def changes(self, values: Array) -> Array:
        """Return what changes of (rows, unknowns) are for the slacks."""
        return self.signs * values[self.places]

    def summed(self, sides: Array) -> Array:
        """Return the sums over both sides of every row and unknown."""
        return np.bincount(self.places, sides, self.size).astype(np.float64, copy=False)

    def transposed(self, sides: Array) -> Array:
        """Return the transpose of `changes` times multipliers of the sides."""
        return self.summed(self.signs * sides)


@record
class _Point:
    """The unknowns, or their changes in a step.

    Attributes:
        w: unknowns (n_w,).
        y: multipliers of the gaps (n_y,).
        e: multipliers of equalities.
        s, z: slacks of the sides and their multipliers.
    """

    w: Array
    y: Array
    e: Array
    s: Array
    z: Array

    def moved(self, step: "_Point", primal: float, dual: float) -> "_Point":
        """Return the point after parts of a step."""
        return _Point(
            self.w + primal * step.w,
            self.y + primal * step.y,
            self.e + primal * step.e,
            self.s + primal * step.s,
            self.z + dual * step.z,
        )

    @property
    def products(self) -> Array:
        """The products of slacks and multipliers."""
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
        self,
        guess: Array,
        bounds: Bounds,
        p: Array,
        multipliers: Array,
        *,
        tolerance: float,
        barrier: float,
        iterations_max: int,
    ) -> Found:
        """Solve from a guess.

        Args:
            guess: of the unknowns, shape (n_w,).
            bounds: of unknowns and constraints.
            p: the parameters.
            multipliers: of (g, w), shape (n_g + n_w,); those of equalities are not asked for.
            tolerance: on the scaled conditions of optimality.
            barrier: first value of the barrier parameter.
            iterations_max: number of iterations after which it gives up, if not sooner.

        Raises:
            SolverCrash: the program could not be evaluated.
        """
        self._functions.p[:] = p
        self._functions.forget()
        run = _Run(self._functions, self._system, bounds, tolerance, barrier)
        return run.found(guess, multipliers, min(iterations_max, ITERATIONS_MAX))


class _Run:
    def __init__(
        self, functions: Evaluation, system: StageSystem, bounds: Bounds, tolerance: float, barrier: float
    ) -> None:
        layout = functions.assembly.layout
        self._functions, self._system = functions, system
        self._gaps, self._rows = layout.gap_index.ravel(), layout.row_index
        lower = np.concatenate([bounds.g_lower[self._rows], bounds.lower])
        upper = np.concatenate([bounds.g_upper[self._rows], bounds.upper])
        self._sides = _Sides.of(lower, upper)
        self._equal = np.flatnonzero(lower == upper)
        self._targets, self._jumps = lower[self._equal], bounds.g_lower[self._gaps]
        self._tolerance = tolerance
        self._barrier = max(barrier, FIRST_BARRIER)
        self._least = min(LAST_BARRIER * tolerance, barrier)

    def found(self, guess: Array, multipliers: Array, iterations_max: int) -> Found:
        if len(self._sides.places) == 0:  # there is no barrier
            return Found(guess, np.zeros(len(self._functions.g)), False, 0)
        point, iteration = self._first(guess, multipliers), 0
        for iteration in range(iterations_max + 1):
            residuals = self._residuals(point)
            if residuals is None:
                break
            error, infeasibility = self._errors(point, residuals)
            sys.stdout.write(f"{iteration:4d} {self._functions.f:.8e} {infeasibility:.2e} predictor-corrector\n")
            if error <= self._tolerance:
                return Found(self._kept(point.w), self._all_multipliers(point), True, iteration)
            if iteration == iterations_max or not self._factorised(point):
                break
            following = self._next(point, residuals)
            if following is None:
                break
            point = following
        return Found(point.w, self._all_multipliers(point), False, iteration)

    def _factorised(self, point: _Point) -> bool:
        """Factorise, with as much added to the diagonal as makes the step lead to a minimum."""
        weights = self._weights(point.z / point.s)
        for added in ADDED:
            weights[len(self._rows) :] += added
            if self._system.factorise(weights):
                return True
        return False

    def _first(self, guess: Array, multipliers: Array) -> _Point:
        """Return the first point: slack times multiplier is the barrier parameter, the larger of both is trusted.

        The multipliers of equalities are those that balance the others best (least squares).
        """
        functions, sides = self._functions, self._sides
        functions.w[:] = guess
        functions.values()
        slacks = sides.slacks(self._values(guess))
        known = np.concatenate([multipliers[self._rows], multipliers[len(functions.g) :]])
        z = np.maximum(-sides.changes(known), 0.0)
        point = _Point(guess, np.zeros(len(self._gaps)), np.zeros(len(self._equal)), slacks, z)
        functions.lam_f = 1.0
        functions.lam_g[:] = self._all_multipliers(point)
        functions.slope()
        stationarity = functions.gradient + self._of_values(point)[len(self._rows) :]
        self._system.write_identity(functions.linear())
        self._system.factorise(self._weights(np.zeros_like(z)))
        _, y, e, _ = self._solved(-stationarity, np.zeros_like(point.y), np.zeros_like(point.e))
        self._system.clear()
        at_rest = np.sqrt(self._barrier)
        z = np.where(z >= slacks, np.maximum(z, at_rest), self._barrier / np.maximum(slacks, at_rest))
        return _Point(guess, y, e, np.maximum(slacks, self._barrier / z), z)

    def _residuals(self, point: _Point) -> _Residuals | None:
        """Evaluate the program at a point; None where its numbers are none."""
        functions = self._functions
        functions.w[:] = point.w
        functions.lam_g[:] = self._all_multipliers(point)
        functions.values()
        finite = self._system.write(functions.linear(), functions.curved())
        values = self._values(point.w)
        found = _Residuals(
            functions.gradient + self._of_values(point)[len(self._rows) :],
            functions.g[self._gaps] - self._jumps,
            values[self._equal] - self._targets,
            self._sides.slacks(values) - point.s,
        )
        return found if finite and np.isfinite(functions.f) and np.isfinite(found.stationarity).all() else None

    def _errors(self, point: _Point, residuals: _Residuals) -> tuple[float, float]:
        """Return the largest KKT error, as `kkt_error` measures it, and the primal one."""
        size = max(MULTIPLIER_SCALE, *(float(np.abs(one).mean()) for one in (point.y, point.z) if len(one)))
        primal = max(_largest(residuals.gaps), _largest(residuals.equalities), _largest(residuals.slacks))
        products = _largest((point.s + residuals.slacks) * point.z)
        dual = max(_largest(residuals.stationarity), products) * MULTIPLIER_SCALE / size
        return max(primal, dual, _largest(point.products) * MULTIPLIER_SCALE / size), primal

    def _next(self, point: _Point, residuals: _Residuals) -> _Point | None:
        """Return the next point; None where the step is not to be believed."""
        average = float(point.products.mean())
        predicted = self._step(point, residuals, -point.products)
        primal, dual = _longest(point, predicted, 1.0)
        ahead = float(point.moved(predicted, primal, dual).products.mean())
        barrier = max(min(1.0, (ahead / average) ** 3) * average, self._least)
        most = _SPREAD**2 * max(average, barrier)
        second_order = np.clip(predicted.products, -most, most)
        step = self._step(point, residuals, barrier - point.products - second_order)
        step, primal, dual = self._centred(point, step, barrier)
        if not (np.isfinite(step.w).all() and _largest(step.w) < LARGEST_STEP):
            return None
        return point.moved(step, primal, dual)

    def _centred(self, point: _Point, step: _Point, barrier: float) -> tuple[_Point, float, float]:
        """Return the step with corrections that lengthen it, and its lengths."""
        reach = max(_MOST_OF_THE_WAY, 1.0 - barrier)
        primal, dual = _longest(point, step, reach)
        for _ in range(_CORRECTIONS_MAX):
            if min(primal, dual) > _LONG_ENOUGH:
                break
            products = point.moved(step, min(1.0, primal + _LONGER), min(1.0, dual + _LONGER)).products
            wanted = np.clip(products, barrier / _SPREAD, _SPREAD * barrier) - products
            nothing = _Residuals(*(np.zeros_like(one) for one in (point.w, point.y, point.e, point.s)))
            correction = self._step(point, nothing, np.maximum(wanted, -_SPREAD * barrier))
            corrected = step.moved(correction, 1.0, 1.0)
            longer = _longest(point, corrected, reach)
            if sum(longer) < primal + dual + _WORTHWHILE:
                break
            step, (primal, dual) = corrected, longer
        return step, primal, dual

    def _step(self, point: _Point, residuals: _Residuals, products: Array) -> _Point:
        """Return the step after which the linear conditions hold, and slack times multiplier changes so."""
        z = (products - point.z * residuals.slacks) / point.s
        pull = self._system.transposed(self._sides.transposed(z))
        w, y, e, changes = self._solved(pull - residuals.stationarity, -residuals.gaps, -residuals.equalities)
        moved = self._sides.changes(changes)
        return _Point(w, y, e, moved + residuals.slacks, z - point.z / point.s * moved)

    def _solved(self, stationarity: Array, gaps: Array, equalities: Array) -> tuple[Array, Array, Array, Array]:
        """Solve the factorised system.

        Returns:
            The changes of unknowns, of the multipliers of gaps and of equalities, and of (rows, unknowns).
        """
        pull = np.zeros(self._sides.size)
        pull[self._equal] = equalities / _PENALTY
        w, y = self._system.solve(stationarity + self._system.transposed(pull), gaps)
        changes = self._system.values(w)
        e = (changes[self._equal] - equalities) / _PENALTY
        return w, y, e, changes

    def _kept(self, w: Array) -> Array:
        """Return the unknowns with those that are given as they are given, of which a penalty leaves 1e-11."""
        values = np.concatenate([np.zeros(len(self._rows)), w])
        values[self._equal] = self._targets
        return values[len(self._rows) :]

    def _weights(self, of_sides: Array) -> Array:
        weights = self._sides.summed(of_sides)
        weights[self._equal] = 1.0 / _PENALTY
        return weights

    def _values(self, w: Array) -> Array:
        return np.concatenate([self._functions.g[self._rows], w])

    def _of_values(self, point: _Point) -> Array:
        """Return the multipliers of (rows, unknowns), positive where an upper bound is pressed on."""
        multipliers = -self._sides.transposed(point.z)
        multipliers[self._equal] += point.e
        return multipliers

    def _all_multipliers(self, point: _Point) -> Array:
        """Return the multipliers of the constraints."""
        multipliers = np.zeros(len(self._functions.g))
        multipliers[self._gaps] = point.y
        multipliers[self._rows] = self._of_values(point)[: len(self._rows)]
        return multipliers


def _longest(point: _Point, step: _Point, reach: float) -> tuple[float, float]:
    """Return how far slacks and multipliers can go, at most the whole step and a part of the way to zero."""
    ratios = (float((change / value).min(initial=0.0)) for value, change in ((point.s, step.s), (point.z, step.z)))
    primal, dual = (1.0 if ratio >= -reach else -reach / ratio for ratio in ratios)
    return primal, dual


def _largest(values: Array) -> float:
    return float(np.abs(values).max(initial=0.0))
