"""Conditions of second order: is a point that satisfies the first-order ones a minimum, or only stationary?

At a minimum the Hessian H of the Lagrangian has no negative curvature along the directions d that keep all gaps,
equalities and strictly active limits [Nocedal & Wright 2006, theorems 12.5 and 12.6]. Solvers ask that of a matrix that
they have regularised, so they call a saddle optimal where they happen to end in one. Here nothing is added to H; what
the objective regularises is part of it.

Curvature is `d' H d / d' W d` in scaled unknowns, with the share of the whole duration that each stage stands for on
W's diagonal: what a change of one scale in the mean square costs, on every mesh alike. The least one exceeds a number s
if and only if `H - s W` is positive definite on these directions, which a Riccati recursion finds from the last stage
to the first. At stage k, with z = (x, u), gaps `x_next = F z` and rows `C z = 0` of limits, what follows costs
`x' P x` and exists where `A x = 0`:

    M = H - s W + F' P F,   D = (C; A F)

The singular values of D's part in u show which rows some u can keep. These are solved for u exactly, and what is left
of D binds x alone: it is handed on to the stage before [Vanroye et al. 2023]. The u that are still free are eliminated
by Cholesky's method, whose first pivot that is not positive gives a direction of that little curvature from that stage
on. There is no division by any other pivot, so errors are those of Cholesky's method. Costs are linear in the number of
stages.

Where controls move a limited quantity through several lags, to keep it node by node is unstable: what the last of them
can still do costs the more the longer it lasts. So directions of x that cost very much are handed on as rows, too.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from airrace.optimal_control.assembly import Assembly, StageMatrices
from airrace.optimal_control.certificate import SADDLE, Curvature, SecondOrder
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.kernels import build_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.optimality import MULTIPLIER_SCALE
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.trajectory import Array, Indices

# The tolerances of curvature, all for scaled unknowns.

ZERO_CURVATURE = 1e-4
"""The curvature that counts as zero, in the objective's unit for a change of one scale in the mean square.

It is relaxed with the size of the multipliers, as the KKT error is. A change that large then costs less than 5e-5 s, a
hundredth of the 5 ms to which race times are certified.
"""
GAIN_MIN = 1e-4
"""The least gain of a saddle by a change of one scale along its direction, in the objective's unit: a fiftieth of 5 ms.

On three generated courses directions of 1 to 16 stages, a tenth of a second at most, had a curvature of -0.010 to
-0.012 and gained 4e-7 to 3e-5 s; the solver returned from steps along them to where it had been.
"""
SPIKES_MAX = 20
"""The number of directions of less gain that are passed over in the search for a saddle's."""
SPIKE = 0.1
"""The part of a direction's largest change from which on a stage belongs to it (1)."""
RANK = 1e-6
"""The size of what is left of a row of length 1 below which it depends on others, or no u can keep it (1)."""
STIFF = 1e6
"""The cost of a change of the states by 1 from which on they are fixed, in the objective's unit.

Of costs from 1e9 on, rounding alone exceeds what a change at a single stage costs; and to fix what costs 1e6 changes
the curvature of nothing else by more than a millionth of the square of its slope.
"""
WEAKLY_ACTIVE_RATIO = 100.0
"""The ratio of multiplier and slack, or of slack and multiplier, below which a limit is weakly active (1)."""
RESOLUTION = 1e-8
"""The size of multipliers and slacks, scaled, to which solvers resolve them (1)."""

Number = TypeVar("Number", np.float64, np.bool_)


def second_order(problem: Problem, iterate: Iterate, constraint_multipliers: Array) -> tuple[SecondOrder, Array] | None:
    """Judge an optimum of a problem by its own functions; arguments besides as of `judge`.

    Args:
        problem: any.
        iterate: a point that satisfies the conditions of first order, SI.
        constraint_multipliers: of the scaled program, shape (n_g,).
    """
    layout = Layout(problem)
    functions = Evaluation(Assembly(layout, build_kernels(problem.system, problem.scheme)))
    return judge(functions, layout, layout.pack(iterate), layout.parameter_values(), constraint_multipliers)


def judge(functions: Evaluation, layout: Layout, w: Array, p: Array, lam_g: Array) -> tuple[SecondOrder, Array] | None:
    """Judge a point that satisfies the conditions of first order.

    A limit is an equality where its scaled multiplier exceeds its scaled slack. An interior point method leaves
    a product of both that is the same everywhere; where the exact multiplier is zero it leaves a multiplier above the
    slack only if the curvature across the limit exceeds 1, so that nothing negative is hidden by keeping it. Where it
    left one that is smaller than the slack, the exact one may be above zero none the less: negative curvature makes a
    saddle only where it is left with all weakly active limits as equalities.

    Args:
        functions: of the program, whose stage matrices are written anew.
        layout: with the bounds of the problem that was solved.
        w: scaled unknowns, shape (n_w,).
        p: the parameters.
        lam_g: multipliers of the constraints, shape (n_g,). Those of the simple bounds are what balances them.

    Returns:
        The verdict, and a direction of little curvature in scaled unknowns, the largest 1, zeros where there is none;
        shape (n_w,). None where the derivatives are not finite.

    Raises:
        SolverCrash: the program could not be evaluated.
    """
    functions.at(w, p)
    functions.lam_f, functions.lam_g[:] = 1.0, lam_g
    matrices = functions.stage_matrices
    if not matrices.write(functions.jacobian_sources(), functions.hessian_sources()):
        return None
    rows, lam_x = layout.row_index, -functions.gradient
    sides = zip(layout.constraint_bounds(), layout.unknown_bounds(), strict=True)
    lower, upper = (np.concatenate([of_rows[rows], of_unknowns]) for of_rows, of_unknowns in sides)
    values, pressure = np.concatenate([functions.g[rows], w]), np.concatenate([lam_g[rows], lam_x])
    slack = np.maximum(np.where(pressure > 0.0, upper - values, values - lower), 0.0)
    size, equal = np.abs(pressure), lower == upper
    active = ~equal & (size > slack)
    vague = size + RESOLUTION, slack + RESOLUTION
    weak = ~equal & (vague[0] < WEAKLY_ACTIVE_RATIO * vague[1]) & (vague[1] < WEAKLY_ACTIVE_RATIO * vague[0])
    form = StageQuadratic.of(matrices, equal | active, _shares(layout, w))
    largest = max(MULTIPLIER_SCALE, float(np.abs(lam_g).mean()), float(np.abs(lam_x).mean()))
    threshold = ZERO_CURVATURE * largest / MULTIPLIER_SCALE
    saddle = SADDLE * threshold
    direction, curvature, least = direction_below(form, threshold), Curvature.POSITIVE, np.nan
    if direction is not None:
        curvature = Curvature.SINGULAR
        least = min(form.curvature(direction), threshold)  # however the direction is rounded
        below = direction_below(form, -saddle)
        if below is not None:
            direction, least = below, min(form.curvature(below), -saddle)
            negative = descent_direction(replace(form, active=equal | active | weak), saddle)
            if negative is not None:
                curvature, direction, least = Curvature.INDEFINITE, negative, form.curvature(negative)
    phase, quantity = ("", "") if direction is None else _place(layout, direction)
    verdict = SecondOrder(
        curvature=curvature,
        threshold=threshold,
        least=least,
        phase=phase,
        quantity=quantity,
        active=int(active.sum()),
        weakly_active=int(weak.sum()),
    )
    if direction is None:
        return verdict, np.zeros(layout.unknowns)
    return verdict, direction / direction[np.abs(direction).argmax()]


def _shares(layout: Layout, w: Array) -> Array:
    """Return the share of the whole duration that each stage stands for, the last one as long as the one before it."""
    index = layout.duration_index[:-1]
    durations = np.maximum(w[index] * layout.scale[index] * layout.fractions, 0.0)
    total = float(durations.sum())
    shares = durations / total if total > 0.0 else np.full(len(durations), 1.0 / len(durations))
    return np.append(shares, shares[-1])


def _place(layout: Layout, direction: Array) -> tuple[str, str]:
    """Return the phase in which a direction begins, and what it changes most, for people."""
    system = layout.problem.system
    texts = [quantity.text or quantity.name for quantity in (*system.states, *system.controls)]
    names = [*texts[: len(system.states)], "duration", *texts[len(system.states) :], "next duration"]
    stage_of, most = layout.stage_of_unknown, int(np.abs(direction).argmax())
    begin = int(np.min(stage_of[direction != 0.0]))
    place = int(np.sum(stage_of[:most] == stage_of[most]))
    return layout.problem.phase_of(min(begin, layout.intervals - 1)).name, names[place]


@dataclass(frozen=True, eq=False)
class StageQuadratic:
    """A quadratic form on directions of a program of N intervals; z_k = (x_k, u_k) has n_k entries, x_k m of them.

    All but the weights lie as in `StageMatrices`.

    Attributes:
        states: m.
        sizes: n_k, shape (N + 1,).
        hessian: of each stage, (n_k, n_k).
        dynamics: `x_next = F z` of each interval, (m, n_k), column by column.
        row_counts: number of rows of each stage, shape (N + 1,).
        rows: of each stage, row by row.
        active: which (rows, unknowns) are zero, shape (n_r + n_w,).
        weights: of each stage in the norm of directions, shape (N + 1,).
    """

    states: int
    sizes: NDArray[np.int32]
    hessian: Array
    dynamics: Array
    row_counts: NDArray[np.int32]
    rows: Array
    active: NDArray[np.bool_]
    weights: Array

    @classmethod
    def of(cls, matrices: StageMatrices, active: NDArray[np.bool_], weights: Array) -> "StageQuadratic":
        """Return the form of a program's Lagrangian, which refers to the matrices."""
        gaps, rows = np.split(matrices.constraints.doubles, [matrices.gap_size])
        sizes, counts = matrices.sizes, matrices.row_counts
        return cls(matrices.states, sizes, matrices.hessian.doubles, gaps, counts, rows, active, weights)

    def curvature(self, direction: Array) -> float:
        """Return the curvature along a direction, shape (n_w,)."""
        return -2.0 * self.gain(direction) / float(np.repeat(self.weights, self.sizes) @ direction**2)

    def gain(self, direction: Array) -> float:
        """Return what a step gains, of shape (n_w,), in the objective's unit."""
        curvature = 0.0
        for z, H in zip(_blocks(direction, self.sizes), self.hessians, strict=True):
            if z.any():
                curvature += float(z @ H @ z)
        return -0.5 * curvature

    @property
    def hessians(self) -> list[Array]:
        """H of each stage."""
        sizes = self.sizes.astype(np.int64)
        return [block.reshape(n, n) for block, n in zip(_blocks(self.hessian, sizes**2), sizes, strict=True)]

    @property
    def steps(self) -> list[Array]:
        """F of each interval."""
        sizes, m = self.sizes[:-1].astype(np.int64), self.states
        return [block.reshape(n, m).T for block, n in zip(_blocks(self.dynamics, m * sizes), sizes, strict=True)]


def direction_below(form: StageQuadratic, shift: float) -> Array | None:
    """Return a direction of no more curvature than that, shape (n_w,); None where every one has more."""
    end = _recursion(form, shift)
    if end is None:
        return None
    stage, z, gains = end
    direction: list[Array] = [*(np.zeros(n) for n in form.sizes[:stage]), z]
    for F, gain in zip(form.steps[stage:], gains, strict=True):
        direction.append(gain @ (F @ direction[-1]))
    return np.concatenate(direction)


def descent_direction(form: StageQuadratic, saddle: float) -> Array | None:
    """Return a direction of less curvature than `-saddle` that gains enough for a saddle; None where none does.

    One that gains too little is made to count for more, so that the others are seen.
    """
    for _ in range(SPIKES_MAX):
        direction = direction_below(form, -saddle)
        if direction is None or not form.curvature(direction) < -saddle:  # a saddle only where it is measured
            return None
        direction = direction / np.abs(direction).max()
        if form.gain(direction) > GAIN_MIN:
            return direction
        inside = [bool((np.abs(z) > SPIKE).any()) for z in _blocks(direction, form.sizes)]
        form = replace(form, weights=np.where(inside, 4.0 * form.weights, form.weights))
    return None


class _StartOfDirection(NamedTuple):
    """Where a direction begins: the stage, its unknowns there, and the gains that lead from x to z behind it."""

    stage: int
    z: Array
    gains: list[Array]


def _first(costs: Array, bound: Array, gains: list[Array]) -> _StartOfDirection | None:
    """Return where a direction begins at the first stage, whose states cost that much; None where none does."""
    free = _null_space(bound)
    reduced = free.T @ costs @ free
    if len(reduced) == 0 or _cholesky(reduced) is not None:
        return None
    return _StartOfDirection(0, gains[0] @ (free @ _least_direction(reduced)), gains[1:])


def _recursion(form: StageQuadratic, shift: float) -> _StartOfDirection | None:
    """Go from the last stage to the first, with the curvature `shift` taken off everywhere.

    Returns:
        Where a direction of no more curvature than that begins; None where there is none.
    """
    m, sizes = form.states, form.sizes.astype(np.int64)
    counts = form.row_counts.astype(np.int64)
    of_rows, of_unknowns = np.split(form.active, [len(form.active) - int(sizes.sum())])
    hessians, steps = form.hessians, form.steps
    rows, active, fixed = _blocks(form.rows, counts * sizes), _blocks(of_rows, counts), _blocks(of_unknowns, sizes)
    costs: Array = np.zeros((m, m))
    ahead: Array = np.zeros((0, m))
    gains: list[Array] = []  # the last stage first
    for k in range(len(sizes) - 1, -1, -1):
        n = int(sizes[k])
        ends: Array = steps[k] if k < len(steps) else np.zeros((m, n))
        own = rows[k].reshape(-1, n)[active[k]]
        T, ahead = _eliminate(np.concatenate([own, ahead @ ends]), fixed[k], m)
        F: Array = ends @ T
        M: Array = T.T @ hessians[k] @ T - shift * form.weights[k] * (T.T @ T) + F.T @ costs @ F
        costs, free = M[:m, :m], M[m:, m:]
        if len(free) == 0:
            gains.append(T)
            costs, ahead = _hold_stiff(costs, ahead)
            continue
        root = _cholesky(free)
        if root is None:
            return _StartOfDirection(k, T[:, m:] @ _least_direction(free), gains[::-1])
        half = np.linalg.solve(root, M[m:, :m])
        costs = costs - half.T @ half
        costs = 0.5 * (costs + costs.T)  # rounding that is not symmetric would grow from stage to stage
        gains.append(T[:, :m] - T[:, m:] @ np.linalg.solve(root.T, half))
        costs, ahead = _hold_stiff(costs, ahead)
    return _first(costs, ahead, gains[::-1])


def _blocks(values: NDArray[Number], sizes: Indices | NDArray[np.int32]) -> list[NDArray[Number]]:
    """Return blocks of these sizes that lie one behind the other."""
    ends = np.cumsum(sizes).tolist()
    return [values[begin:end] for begin, end in zip([0, *ends[:-1]], ends, strict=True)]


def _eliminate(rows: Array, fixed: NDArray[np.bool_], m: int) -> tuple[Array, Array]:
    """Solve the rows of a stage for its controls.

    Args:
        rows: that are zero, shape (any number, n).
        held: unknowns that are zero, shape (n,).
        m: the number of states.

    Returns:
        T of `z = T (x, v)` with free v, and rows that bind x, which are handed on to the stage before.
    """
    free, n = m + np.flatnonzero(~fixed[m:]), len(fixed)
    states = np.eye(m)
    bound = states[fixed[:m]]
    T = np.zeros((n, m + len(free)))
    T[:m, :m] = np.diag(~fixed[:m])
    if len(rows) == 0:
        T[free, m + np.arange(len(free))] = 1.0
        return T, bound
    D = _row_space(np.concatenate([rows[:, :m] * ~fixed[:m], rows[:, free]], axis=1))
    U, S, Vt = np.linalg.svd(D[:, m:], full_matrices=True)
    rank = int((RANK < S).sum())
    on_states = U.T @ D[:, :m]  # its rows are orthogonal, so the solved ones leave what others bind alone
    T[free, :m] = -Vt[:rank].T @ (on_states[:rank] / S[:rank, None])
    T[free, m : m + len(free) - rank] = Vt[rank:].T
    return T[:, : m + len(free) - rank], np.concatenate([bound, on_states[rank:]])


def _hold_stiff(costs: Array, ahead: Array) -> tuple[Array, Array]:
    """Take the squares of changes of the states off the costs as long as one is stiff, and let these changes
    be zero, as rows that are handed on."""
    for _ in costs:
        most = int(costs.diagonal().argmax())
        if not costs[most, most] > STIFF:
            break
        change = costs[most] / np.sqrt(costs[most, most])
        costs = costs - np.outer(change, change)
        ahead = np.concatenate([ahead, change[None] / np.linalg.norm(change)])
    return costs, ahead


def _row_space(rows: Array) -> Array:
    """Return orthonormal rows that span the same; what is left of a row below `RANK` of it is left out."""
    lengths = np.sqrt((rows * rows).sum(axis=1))
    independent = lengths > RANK
    rows = rows[independent] / lengths[independent, None]
    if len(rows) < 2:
        return rows
    _, S, Vt = np.linalg.svd(rows, full_matrices=False)
    return Vt[: int((RANK < S).sum())]


def _null_space(rows: Array) -> Array:
    """Return an orthonormal basis of the null space of rows of length 1, as columns."""
    _, S, Vt = np.linalg.svd(rows, full_matrices=True)
    return Vt[int((RANK < S).sum()) :].T


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
