"""Conditions of second order: is a point that satisfies the first-order ones a minimum, or only stationary?

At a minimum the Hessian H of the Lagrangian has no negative curvature along the directions d that keep all gaps,
equalities and strictly active limits [Nocedal & Wright 2006, theorems 12.5 and 12.6]. Solvers ask that of a matrix that
they have regularised, so they call a saddle optimal where they happen to end in one. Here nothing is added to H; what
the objective regularises is part of it.

Curvature is `d' H d / d' W d` in scaled unknowns, with the share of the whole duration that each stage stands for on
W's diagonal: what a change of one scale in the mean square costs, on every mesh alike. The least one exceeds a number s
if and only if `H - s W` is positive definite on these directions, which a Riccati recursion tells, from the last stage
to the first. At stage k, with z = (x, u), gaps `x_next = F z` and rows `C z = 0` that are kept, what follows costs
`x' P x` and exists where `A x = 0`:

    M = H - s W + F' P F,   D = (C; A F)

The singular values of D's part in u tell which rows some u can keep. These are solved for u exactly, and what is left
of D binds x alone: it is handed on to the stage before [Vanroye et al. 2023]. The u that are still free are eliminated
by Cholesky's method, whose first pivot that is not positive gives a direction of that little curvature from that stage
on. There is no division by any other pivot, so errors are those of Cholesky's method. Costs are linear in the number of
stages.
"""

from enum import Enum
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from airrace.optimal_control.assembly import Assembly
from airrace.optimal_control.constraint_rows import Indices
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.kernels import build_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.optimality import MULTIPLIER_SCALE
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.stage_matrices import StageMatrices
from airrace.records import record
from airrace.trajectory import Array

THRESHOLD = 1e-4
"""The curvature that counts as zero, in the objective's unit for a change of one scale in the mean square.

It is relaxed with the size of the multipliers, as the KKT error is. A change that large then costs or gains less than
5e-5 s, a hundredth of the 5 ms to which race times are certified; the Hessian itself is known about as closely, for
solvers leave errors of 1e-8 in the multipliers, and a stage may stand for no more than 1e-4 of a race.
"""
Number = TypeVar("Number", np.float64, np.bool_)

RANK = 1e-6
"""The size of what is left of a row of length 1 below which it depends on others, or no u can keep it (1)."""
LIKELY = 100.0
"""The ratio of multiplier and slack, or of slack and multiplier, below which a limit is weakly active (1)."""
RESOLUTION = 1e-8
"""The size of multipliers and slacks, scaled, below which nothing is known of them: as solvers leave them (1)."""


class Curvature(Enum):
    """The kind of a stationary point, by the least curvature along directions that keep the limits.

    `SINGULAR` is within the threshold of zero, or hangs on limits that are weakly active: as far as can be told, there
    are directions that cost nothing.
    """

    POSITIVE = "positive"
    SINGULAR = "singular"
    INDEFINITE = "indefinite"


@record
class SecondOrder:
    """The verdict of the conditions of second order.

    Attributes:
        curvature: the kind of point.
        threshold: the curvature that counts as zero, in the objective's unit.
        least: the curvature along `direction`, which need not be the very least; NaN where all is above the threshold.
        direction: of that little curvature, in scaled unknowns, the largest 1; zeros where there is none; shape (n_w,).
        where: the phase in which the direction begins, and the quantity that changes most; empty where there is none.
        active: number of limits that are kept as equalities, for their multipliers exceed their slacks.
        weakly_active: number of limits of which multiplier and slack are within a factor of 100, kept or not.
    """

    curvature: Curvature
    threshold: float
    least: float
    direction: Array
    where: str
    active: int
    weakly_active: int

    def __str__(self) -> str:
        """Return the verdict in a clause."""
        weak = f"; {self.weakly_active} limits weakly active" if self.weakly_active else ""
        if self.curvature is Curvature.POSITIVE:
            return f"positive, above {self.threshold:.1e}{weak}"
        return f"{self.curvature.value}, {self.least:.1e} in {self.where}{weak}"


def second_order(problem: Problem, iterate: Iterate, constraint_multipliers: Array) -> SecondOrder:
    """Judge an optimum of a problem by its own functions, as `judge` does.

    Args:
        problem: any.
        iterate: a point that satisfies the conditions of first order, SI.
        constraint_multipliers: of the scaled program, shape (n_g,).

    Raises:
        SolverCrash: the program could not be evaluated.
    """
    layout = Layout(problem)
    functions = Evaluation(Assembly(layout, build_kernels(problem.system, problem.scheme)))
    return judge(functions, layout.pack(iterate), layout.parameter_values(), constraint_multipliers)


def judge(functions: Evaluation, w: Array, p: Array, lam_g: Array) -> SecondOrder:
    """Judge a point that satisfies the conditions of first order.

    A limit is kept as an equality where its scaled multiplier exceeds its scaled slack. An interior point method leaves
    a product of both that is the same everywhere; where the exact multiplier is zero it leaves a multiplier above the
    slack only if the curvature across the limit exceeds 1, so that nothing negative is hidden by keeping it. Where it
    left one that is smaller than the slack, the exact one may be above zero none the less: negative curvature tells a
    saddle only where it is left with all weakly active limits kept.

    Args:
        functions: of the program.
        w: scaled unknowns, shape (n_w,).
        p: the parameters.
        lam_g: multipliers of the constraints, shape (n_g,). Those of the simple bounds are what balances them.

    Raises:
        SolverCrash: the program could not be evaluated.
    """
    layout = functions.assembly.layout
    functions.at(w, p)
    functions.lam_f, functions.lam_g[:] = 1.0, lam_g
    matrices = StageMatrices(functions.assembly)
    matrices.write(functions.jacobian_sources(), functions.hessian_sources())
    rows, lam_x = layout.row_index, -functions.gradient
    sides = zip(layout.constraint_bounds(), layout.unknown_bounds(), strict=True)
    lower, upper = (np.concatenate([of_rows[rows], of_unknowns]) for of_rows, of_unknowns in sides)
    values, pressure = np.concatenate([functions.g[rows], w]), np.concatenate([lam_g[rows], lam_x])
    slack = np.maximum(np.where(pressure > 0.0, upper - values, values - lower), 0.0)
    size, equal = np.abs(pressure), lower == upper
    active = ~equal & (size > slack)
    vague = size + RESOLUTION, slack + RESOLUTION
    weak = ~equal & (vague[0] < LIKELY * vague[1]) & (vague[1] < LIKELY * vague[0])
    form = stage_quadratic(matrices, equal | active, _shares(layout, w))
    largest = max(MULTIPLIER_SCALE, float(np.abs(lam_g).mean()), float(np.abs(lam_x).mean()))
    threshold = THRESHOLD * largest / MULTIPLIER_SCALE
    reduced = ReducedQuadratic(form)
    found, curvature = reduced.direction_below(threshold), Curvature.POSITIVE
    if found is not None:
        curvature = Curvature.SINGULAR
        if reduced.direction_below(-threshold) is not None:
            certain = stage_quadratic(matrices, equal | active | weak, form.weights)
            negative = ReducedQuadratic(certain).direction_below(-threshold)
            if negative is not None and form.curvature(negative) < 0.0:  # measured, whatever was rounded on the way
                curvature, found = Curvature.INDEFINITE, negative
    return SecondOrder(
        curvature=curvature,
        threshold=threshold,
        least=np.nan if found is None else form.curvature(found),
        direction=np.zeros(layout.unknowns) if found is None else _unit_maximum(found),
        where="" if found is None else _place(layout, found),
        active=int(active.sum()),
        weakly_active=int(weak.sum()),
    )


def _shares(layout: Layout, w: Array) -> Array:
    """Return the share of the whole duration that each stage stands for, the last one as long as the one before it."""
    index = layout.duration_index[:-1]
    durations = np.maximum(w[index] * layout.scale[index] * layout.fractions, 0.0)
    whole = float(durations.sum())
    shares = durations / whole if whole > 0.0 else np.full(len(durations), 1.0 / len(durations))
    return np.append(shares, shares[-1])


def _unit_maximum(direction: list[Array]) -> Array:
    whole = np.concatenate(direction)
    return whole / whole[np.abs(whole).argmax()]


def _place(layout: Layout, direction: list[Array]) -> str:
    """Return the phase in which a direction begins, and the quantity that it changes most, for people."""
    system = layout.problem.system
    names = [*(one.name for one in system.states), "duration", *(one.name for one in system.controls), "next duration"]
    begin = next(stage for stage, z in enumerate(direction) if z.any())
    most = max(direction, key=lambda z: float(np.abs(z).max(initial=0.0)))
    phase = layout.problem.phase_of(min(begin, layout.intervals - 1))
    return f"{phase.name}, {names[int(np.abs(most).argmax())]}"


@record
class StageQuadratic:
    """A quadratic form on directions of a program of N intervals; z_k = (x_k, u_k) has n_k entries, x_k m of them.

    Attributes:
        hessian: of each stage, N + 1 of shape (n_k, n_k).
        dynamics: `x_next = F z` of each interval, N of shape (m, n_k).
        rows: that are zero at each stage, N + 1 of shape (any number, n_k).
        held: unknowns that are zero at each stage, N + 1 of shape (n_k,).
        weights: of each stage in the norm of directions, shape (N + 1,).
    """

    hessian: list[Array]
    dynamics: list[Array]
    rows: list[Array]
    held: list[NDArray[np.bool_]]
    weights: Array

    def curvature(self, direction: list[Array]) -> float:
        """Return the curvature along a direction, given by stage."""
        cost = sum(float(z @ H @ z) for z, H in zip(direction, self.hessian, strict=True))
        return cost / sum(float(weight * (z @ z)) for z, weight in zip(direction, self.weights, strict=True))


def stage_quadratic(matrices: StageMatrices, kept: NDArray[np.bool_], weights: Array) -> StageQuadratic:
    """Return the quadratic form of a program's Lagrangian.

    Args:
        matrices: of the stages.
        kept: which (rows, unknowns) are zero, shape (n_r + n_w,).
        weights: of each stage in the norm of directions, shape (N + 1,).
    """
    sizes, m = matrices.sizes.astype(np.int64), matrices.states
    hessian = [block.reshape(n, n) for block, n in zip(_blocks(matrices.hessian.doubles, sizes**2), sizes, strict=True)]
    gaps, rows = np.split(matrices.constraints.doubles, [matrices.gap_size])
    dynamics = [block.reshape(n, m).T for block, n in zip(_blocks(gaps, m * sizes[:-1]), sizes[:-1], strict=True)]
    of_rows, held = np.split(kept, [matrices.rows])
    counts = matrices.row_counts.astype(np.int64)
    chosen = [
        block.reshape(-1, n)[keep]
        for block, n, keep in zip(_blocks(rows, counts * sizes), sizes, _blocks(of_rows, counts), strict=True)
    ]
    return StageQuadratic(hessian, dynamics, chosen, _blocks(held, sizes), weights)


def _blocks(values: NDArray[Number], sizes: Indices) -> list[NDArray[Number]]:
    """Return blocks of these sizes that lie one behind the other."""
    return np.split(values, np.cumsum(sizes)[:-1])


class _ReducedStage(NamedTuple):
    """A stage without the controls that rows determine: `z = T (x, v)`, v free; H, W and F in terms of (x, v)."""

    T: Array
    H: Array
    W: Array
    F: Array


class ReducedQuadratic:
    """A quadratic form on the directions that keep all gaps and rows."""

    def __init__(self, form: StageQuadratic) -> None:
        self._form = form
        self._states = m = len(form.dynamics[0])
        ahead = np.zeros((0, m))
        self._stages: list[_ReducedStage] = []  # the last one first
        for k in range(len(form.hessian) - 1, -1, -1):
            H, held, rows = form.hessian[k], form.held[k], form.rows[k]
            F = form.dynamics[k] if k < len(form.dynamics) else np.zeros((m, len(H)))
            if len(ahead):
                rows = np.concatenate([rows, ahead @ F])
            T, ahead = _eliminate(rows, held, m)
            self._stages.append(_ReducedStage(T, T.T @ H @ T, form.weights[k] * (T.T @ T), F @ T))
        self._first = _null_space(ahead)

    def direction_below(self, shift: float) -> list[Array] | None:
        """Return a direction of no more curvature than that, by stage; None where every one has more."""
        m, gains = self._states, list[Array]()  # gains lead from x to z, the last stage first
        costs = np.zeros((m, m))  # P of what follows
        for T, H, W, F in self._stages:
            M = H - shift * W + F.T @ costs @ F
            costs, free = M[:m, :m], M[m:, m:]
            if len(free) == 0:
                gains.append(T)
                continue
            root = _cholesky(free)
            if root is None:
                return self._roll_out(T[:, m:] @ _least_direction(free), gains)
            half = np.linalg.solve(root, M[m:, :m])
            costs = costs - half.T @ half
            costs = 0.5 * (costs + costs.T)  # rounding that is not symmetric would grow from stage to stage
            gains.append(T[:, :m] - T[:, m:] @ np.linalg.solve(root.T, half))
        first = self._first.T @ costs @ self._first
        if len(first) == 0 or _cholesky(first) is not None:
            return None
        return self._roll_out(gains.pop() @ self._first @ _least_direction(first), gains)

    def _roll_out(self, z: Array, gains: list[Array]) -> list[Array]:
        """Return the direction that begins with z before the stages of the gains, and goes on at least cost."""
        form = self._form
        begin = len(form.hessian) - 1 - len(gains)
        direction = [np.zeros(len(one)) for one in form.hessian[:begin]] + [z]
        for F, gain in zip(form.dynamics[begin:], reversed(gains), strict=True):
            direction.append(gain @ (F @ direction[-1]))
        return direction


def _eliminate(rows: Array, held: NDArray[np.bool_], m: int) -> tuple[Array, Array]:
    """Solve the rows of a stage for its controls.

    Args:
        rows: that are zero, shape (any number, n).
        held: unknowns that are zero, shape (n,).
        m: the number of states.

    Returns:
        T of `z = T (x, v)` with free v, and orthonormal rows that bind x, which are handed on to the stage before.
    """
    free, n = m + np.flatnonzero(~held[m:]), len(held)
    states = np.eye(m)
    bound = states[held[:m]]
    T = np.zeros((n, m + len(free)))
    T[:m, :m] = np.diag(~held[:m])
    if len(rows) == 0:
        T[free, m + np.arange(len(free))] = 1.0
        return T, bound
    D = _row_space(np.concatenate([rows[:, :m] * ~held[:m], rows[:, free]], axis=1))
    U, S, Vt = np.linalg.svd(D[:, m:], full_matrices=True)
    rank = int((S > RANK).sum())
    on_states = U.T @ D[:, :m]  # its rows are orthogonal, so the solved ones leave what others bind alone
    T[free, :m] = -Vt[:rank].T @ (on_states[:rank] / S[:rank, None])
    T[free, m : m + len(free) - rank] = Vt[rank:].T
    return T[:, : m + len(free) - rank], np.concatenate([bound, on_states[rank:]])


def _row_space(rows: Array) -> Array:
    """Return orthonormal rows that span the same; what is left of a row below `RANK` of it is left out."""
    lengths = np.sqrt((rows * rows).sum(axis=1))
    kept = lengths > RANK
    rows = rows[kept] / lengths[kept, None]
    if len(rows) < 2:
        return rows
    _, S, Vt = np.linalg.svd(rows, full_matrices=False)
    return Vt[: int((S > RANK).sum())]


def _null_space(rows: Array) -> Array:
    """Return an orthonormal basis of the null space of orthonormal rows, as columns."""
    return np.linalg.svd(rows, full_matrices=True)[2][len(rows) :].T


def _cholesky(matrix: Array) -> Array | None:
    """Return the lower factor; None where the matrix is not positive definite, or no number."""
    try:
        root = np.asarray(np.linalg.cholesky(matrix), dtype=np.float64)
    except np.linalg.LinAlgError:
        return None
    return root if np.isfinite(root).all() else None


def _least_direction(matrix: Array) -> Array:
    """Return the eigenvector of the least eigenvalue."""
    return np.linalg.eigh(matrix)[1][:, 0]
