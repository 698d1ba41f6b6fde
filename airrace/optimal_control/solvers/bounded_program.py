"""A program with its bounds, in the arrays on which the native library computes steps of an interior point method.

Constraints besides the gaps (rows) and simple bounds are inequalities or equalities of (rows, unknowns), numbered one
behind the other. The matrices of all stages are dense, one behind the other.
"""

import ctypes
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airrace.optimal_control.assembly import MOST_UNKNOWNS, Assembly
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.native.library import library
from airrace.optimal_control.optimality import MULTIPLIER_SCALE
from airrace.optimal_control.solvers.interface import Bounds
from airrace.optimal_control.trajectory import Array, Indices


def available(assembly: Assembly) -> bool:
    """Return whether the steps of a program can be computed here."""
    layout = assembly.layout
    return library() is not None and int((layout.stage_states + layout.stage_controls).max()) <= MOST_UNKNOWNS


PRODUCT_SPREAD = 10.0
"""Products of slack and multiplier stay within this factor of the barrier parameter."""
BOUNDARY_FRACTION = 0.99
"""The part of the way to where the first slack vanishes."""
CORRECTIONS_MAX, STEP_GAIN, STEP_GAIN_MIN, STEP_LENGTH_ENOUGH = 3, 0.3, 0.02, 0.95
"""Gondzio's corrections: how many, by how much each tries to lengthen the step, the least that it has to gain, and the
length from which on there is none."""
EQUALITY_WEIGHT = 1e6
"""The weight of the penalty on equalities; the next step sees to what is left of them."""


class _ProgramArrays(ctypes.Structure):
    """`struct interior_program` of `interior_point.h`."""

    _fields_ = [
        *((name, ctypes.c_int) for name in ("stages", "states", "unknowns", "gaps", "rows")),
        *((name, ctypes.c_int) for name in ("equalities", "inequalities", "constraints")),
        *((name, ctypes.c_void_p) for name in ("sizes", "row_counts", "hessian", "dynamics", "gradients")),
        *((name, ctypes.c_void_p) for name in ("gap_index", "row_index", "equality", "jump", "target")),
        *((name, ctypes.c_void_p) for name in ("inequality", "sign", "bound")),
        ("equality_weight", ctypes.c_double),
        *((name, ctypes.c_void_p) for name in ("factors", "first", "feedforward", "cost_gradients")),
        *((name, ctypes.c_void_p) for name in ("values", "multipliers", "changes", "weights")),
        *((name, ctypes.c_void_p) for name in ("right_hand", "predicted", "correction", "candidate")),
    ]


class _Corrections(ctypes.Structure):
    """`struct interior_corrections` of `interior_point.h`."""

    _fields_ = [
        ("count", ctypes.c_int),
        *((name, ctypes.c_double) for name in ("gain", "gain_min", "length_enough", "spread", "boundary_fraction")),
    ]


_CORRECTIONS = _Corrections(
    CORRECTIONS_MAX, STEP_GAIN, STEP_GAIN_MIN, STEP_LENGTH_ENOUGH, PRODUCT_SPREAD, BOUNDARY_FRACTION
)


class ProgramVector:
    """A point (w, y, e, s, z), a step or residuals: one array `whole`, and its parts.

    Attributes:
        w: the unknowns, shape (n_w,).
        y, e: the multipliers of the gaps (n_y,) and of the equalities (n_e,).
        s, z: the slacks of the one-sided bounds and their multipliers, shape (n_s,) both.
        primal: all but z.
    """

    def __init__(self, sizes: tuple[int, int, int, int]) -> None:
        n_w, n_y, n_e, n_s = sizes
        self.whole = np.zeros(n_w + n_y + n_e + 2 * n_s)
        ends = np.cumsum([n_w, n_y, n_e, n_s])
        self.w, self.y, self.e, self.s, self.z = np.split(self.whole, ends)
        self.primal = self.whole[: ends[-1]]
        self.address = self.whole.ctypes.data

    def become(self, point: "ProgramVector", step: "ProgramVector", primal: float, dual: float) -> None:
        """Become a point after parts of a step."""
        np.multiply(step.primal, primal, out=self.primal)
        np.multiply(step.z, dual, out=self.z)
        self.whole += point.whole


@dataclass(frozen=True)
class Measures:
    """What the native library measures of a point, `interior_point.h`."""

    primal: float
    stationarity: float
    complementarity: float
    largest_product: float
    least_product: float
    mean_product: float
    constraint_multiplier: float
    bound_multiplier: float
    infeasibility: float

    @property
    def dual_scale(self) -> float:
        """The factor by which dual errors are reduced because multipliers are large."""
        return MULTIPLIER_SCALE / max(MULTIPLIER_SCALE, self.constraint_multiplier, self.bound_multiplier)

    @property
    def error(self) -> float:
        """The largest error of the conditions of optimality, as `kkt_error` measures it."""
        return max(self.primal, self.dual_scale * max(self.stationarity, self.complementarity, self.largest_product))

    @property
    def violation(self) -> float:
        """The same, independent of the size of the multipliers: what has to fall from iterate to iterate."""
        return max(self.primal, self.stationarity, self.largest_product)


class BoundedProgram:
    """A program with its bounds, in the arrays on which the native library works.

    Args:
        functions: of the program.
        bounds: of unknowns and constraints.
    """

    def __init__(self, functions: Evaluation, bounds: Bounds) -> None:
        native = library()
        assert native is not None  # see `available`
        layout, matrices = functions.assembly.layout, functions.stage_matrices
        self.functions, self.matrices, self._native = functions, matrices, native.evaluator
        gaps, rows = layout.gap_index.ravel(), layout.row_index
        lower = np.concatenate([bounds.g_lower[rows], bounds.lower])
        upper = np.concatenate([bounds.g_upper[rows], bounds.upper])
        self.equality = np.flatnonzero(lower == upper)
        below = np.flatnonzero((lower != upper) & np.isfinite(lower))
        above = np.flatnonzero((lower != upper) & np.isfinite(upper))
        self.inequality: Indices = np.concatenate([below, above])
        self.sign = np.concatenate([np.ones(len(below)), -np.ones(len(above))])
        self.bound = np.concatenate([lower[below], upper[above]])
        self.rows = rows
        self.sizes = layout.unknowns, len(gaps), len(self.equality), len(self.inequality)
        self.targets = lower[self.equality]
        fixed = self.equality >= len(rows)
        self._fixed, self._fixed_to = self.equality[fixed] - len(rows), self.targets[fixed]
        size, constraints = len(lower), matrices.constraints.doubles
        work = [np.zeros_like(matrices.hessian.doubles), np.zeros(matrices.states**2)]
        work += [np.zeros(layout.unknowns), np.zeros(matrices.states * len(matrices.sizes))]
        work += [*np.zeros((4, size)), np.zeros(layout.unknowns), *(ProgramVector(self.sizes).whole for _ in range(3))]
        arrays: list[Array | Indices | NDArray[np.int32]] = [
            *(matrices.sizes, matrices.row_counts, matrices.hessian.doubles),
            *(constraints, constraints[matrices.gap_size :]),
            *(gaps, rows, self.equality, bounds.g_lower[gaps], self.targets),
            *(self.inequality, self.sign, self.bound),
        ]
        self._arrays = *arrays, *work  # which the library knows by their addresses alone
        counts = len(matrices.sizes), matrices.states, *self.sizes[:2], len(rows), *self.sizes[2:], layout.constraints
        addresses, room = ([array.ctypes.data for array in part] for part in (arrays, work))
        self._program = ctypes.byref(_ProgramArrays(*counts, *addresses, EQUALITY_WEIGHT, *room))
        self._measures, self._lengths = np.zeros(9), np.zeros(2)

    def vector(self) -> ProgramVector:
        """Return a new point of zeros."""
        return ProgramVector(self.sizes)

    def slacks(self, w: Array) -> Array:
        """Return the room to the one-sided bounds at unknowns where the constraints are evaluated, shape (n_s,)."""
        return self.sign * (np.concatenate([self.functions.g[self.rows], w])[self.inequality] - self.bound)

    def multipliers(self, point: ProgramVector, constraint_multipliers: Array) -> None:
        """Write the multipliers of the constraints."""
        self._native.interior_multipliers(self._program, point.address, constraint_multipliers.ctypes.data)

    def go_to(self, point: ProgramVector) -> None:
        """Set the program to a point."""
        functions = self.functions
        point.w[self._fixed] = self._fixed_to  # of which a penalty leaves a little
        functions.w[:] = point.w
        functions.lam_f = 1.0
        self.multipliers(point, functions.lam_g)

    def residuals(self, point: ProgramVector, residuals: ProgramVector) -> Measures:
        """Write the residuals at a point where everything is evaluated, and return the measures of it."""
        functions = self.functions
        arrays = functions.gradient, functions.g, residuals.whole, self._measures
        self._native.interior_residuals(self._program, point.address, *(array.ctypes.data for array in arrays))
        return Measures(*self._measures.tolist())

    def linearise(self, point: ProgramVector, residuals: ProgramVector) -> Measures | None:
        """Evaluate the program and its derivatives at a point, write its residuals; None where one is not finite."""
        functions = self.functions
        self.go_to(point)
        hessian = functions.hessian_sources()  # first: values and Jacobian of steps are by-products
        functions.values()
        finite = self.matrices.write(functions.jacobian_sources(), hessian)
        measures = self.residuals(point, residuals)
        numbers = functions.f, measures.stationarity, measures.infeasibility
        return measures if finite and np.isfinite(numbers).all() else None

    def factorise(self, point: ProgramVector | None, damping: float) -> bool:
        """Factorise the matrix of a step; return whether its inertia is that of a step to a minimum."""
        address = None if point is None else point.address
        return not self._native.interior_factorise(self._program, address, damping)

    def solve(self, point: ProgramVector, residuals: ProgramVector, products: Array, step: ProgramVector) -> None:
        """Write the step after which the linear conditions hold, products of slack and multiplier changing so."""
        step.z[:] = products
        self._native.interior_solve(self._program, point.address, residuals.address, step.address)

    def predict_and_correct(
        self, point: ProgramVector, residuals: ProgramVector, barrier_min: float, step: ProgramVector
    ) -> tuple[float, float]:
        """Write Mehrotra's step with Gondzio's corrections, and return its primal and dual length."""
        addresses = ctypes.byref(_CORRECTIONS), point.address, residuals.address
        lengths = self._lengths.ctypes.data
        self._native.interior_predictor_corrector(self._program, *addresses, barrier_min, step.address, lengths)
        primal, dual = self._lengths.tolist()
        return primal, dual
