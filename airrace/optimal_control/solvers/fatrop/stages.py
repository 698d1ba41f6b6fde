"""The mapping of the nonlinear program to fatrop's stages.

fatrop orders the unknowns of a stage `u, x` (the program: `x, u`) and knows three kinds of constraints: equalities and
inequalities of one stage, and the dynamics `F(x, u) - x_next = 0` (the program's gaps with the other sign). Simple
bounds are constraints like others. Its vectors of constraints and multipliers hold all equalities, then the dynamics,
then all inequalities.

Entries of matrices are counted column by column, stage by stage. Those that a pattern leaves out are zero for good:

    BAbt = [B A b]^T, Ggt = [G g]^T of equalities and of inequalities: nonzeros of the Jacobian, residuals, ones
    RSQrqt = [R S^T; S Q; r^T q^T]: nonzeros of the Hessian, the gradient
"""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from airrace.optimal_control.assembly import Assembly
from airrace.optimal_control.solvers.fatrop.blasfeo import MatrixFamily
from airrace.optimal_control.solvers.interface import Bounds
from airrace.optimal_control.sparse_assembly import Entries, Factors, SparseAssembly, StageAssembly, unique_rows
from airrace.records import record
from airrace.trajectory import Array, Indices

LEAST_FACTOR = 1e-2
"""The smallest factor of a side (1).

The solver's tolerance holds for a side times its factor. With 1e-3 the limits of Rovinj in 5 kt of wind were satisfied
within 1e-5 and the solve took 17 iterations, with 1e-2 within 5e-7 in as many, and with 0.1 it took 21; 25 without
factors.
"""
RELAXATION = 1e-8
"""The part of a bound, of 1 at least, by which fatrop relaxes it: its `bound_relax_factor`."""
WIDE = 1e6
"""The bound, in scaled units, that is given to one unknown of a problem without any inequality.

fatrop 1.1.8 never brings the multipliers of such a problem to convergence. With one bound of 1e3 to 1e9 it solves a
linear-quadratic problem in 7 to 10 iterations, to the same digits; with 1e15 the bound has no effect any more.
"""
INEQUALITIES = 2
"""The number of the matrices of inequalities among those of constraints: BAbt, Ggt of equalities, Ggt of these."""


@record
class InitialPoint:
    """The point that a solve begins with, scaled.

    Attributes:
        values: of (g, w), shape (n_g + n_w,).
        multipliers: of them, positive where an upper bound is pressed on; shape (n_g + n_w,).
        barrier: the first value of the barrier parameter.
    """

    values: Array
    multipliers: Array
    barrier: float


@record
class ScaledInequalities:
    """Inequalities `lower <= factors * v[items] + shifts <= upper`, in the order of their rows.

    Attributes:
        items: places in v, shape (n,); one that is there twice has its lower side first.
        copies: how many of them each row became, shape (rows,).
        factors, shifts, lower, upper: shape (n,).
    """

    items: Indices
    copies: Indices
    factors: Array
    shifts: Array
    lower: Array
    upper: Array


def scale_by_multipliers(rows: Indices, lower: Array, upper: Array, start: InitialPoint) -> ScaledInequalities:
    """Scale inequalities so that their known multipliers become 1.

    fatrop begins with multipliers of 1 for all bounds, whatever it is given, and finds those of the dynamics from them
    by least squares. Where a multiplier z is known, the side `z (v - lower) >= 0` has 1. With the slack of that side
    pushed off its limit by the barrier parameter mu, slack times multiplier is mu from the first iteration on, as on
    the way to the optimum. A row that presses on one of its limits becomes two rows, for the far side has another
    factor.
    """
    v, lam = start.values[rows], start.multipliers[rows]
    equal = float(np.sqrt(start.barrier))  # the multiplier of a limit whose slack is as large

    def multiplier(slack: Array, known: Array) -> Array:
        """The larger one of slack and multiplier is trusted, and is at least as large as where both are equal."""
        return np.where(known >= slack, np.maximum(known, equal), start.barrier / np.maximum(slack, equal))

    below, above = multiplier(v - lower, np.maximum(-lam, 0.0)), multiplier(upper - v, np.maximum(lam, 0.0))
    apart = np.isfinite(lower) & np.isfinite(upper) & (np.maximum(below, above) >= equal)
    copies = 1 + apart.astype(np.int64)
    first = (np.cumsum(copies) - copies)[apart]
    low, high, factors = (np.repeat(one, copies) for one in (lower, upper, np.maximum(below, above)))
    high[first], factors[first] = np.inf, below[apart]
    low[first + 1], factors[first + 1] = -np.inf, above[apart]
    factors = np.maximum(factors, LEAST_FACTOR)
    shifts = -factors * np.where(np.isfinite(low), low, high)
    items = np.repeat(rows, copies)
    return ScaledInequalities(items, copies, factors, shifts, factors * low + shifts, factors * high + shifts)


def undo_relaxation(lower: Array, upper: Array) -> tuple[Array, Array]:
    """Return the bounds of inequalities that become these once fatrop has relaxed them, which no option forbids.

    A bound that is missed by 1e-8 is a complementarity error of 1e-6 where its multiplier is 100, however small
    fatrop's own errors are. Bounds that are closer to each other than that are brought together by a quarter each.
    """
    room = 0.25 * (upper - lower)
    margins = [
        np.where(np.isfinite(bound), np.minimum(RELAXATION * np.maximum(1.0, np.abs(bound)), room), 0.0)
        for bound in (lower, upper)
    ]
    return lower + margins[0], upper - margins[1]


class Stages:
    """The mapping as far as it depends on the structure of a program alone (K stages)."""

    def __init__(self, assembly: Assembly) -> None:
        layout = assembly.layout
        self.assembly = assembly
        self.n_x, self.n_u = layout.stage_states, layout.stage_controls
        self.sizes: Indices = self.n_x + self.n_u
        self.unknowns, self.constraints = layout.unknowns, layout.constraints
        self.count = len(self.sizes)
        self.first: Indices = np.cumsum(self.sizes) - self.sizes
        self.stage_of_unknown = layout.stage_of_unknown
        within = np.arange(self.unknowns) - self.first[self.stage_of_unknown]
        states, controls = self.n_x[self.stage_of_unknown], self.n_u[self.stage_of_unknown]
        self.place_in_stage: Indices = np.where(within < states, within + controls, within - states)
        self.place: Indices = self.first[self.stage_of_unknown] + self.place_in_stage
        self.gaps: Indices = layout.gap_index.ravel()
        next_states: Indices = self.first[1:, None] + np.arange(int(layout.gap_index.shape[1]))
        self.next_states = next_states.ravel()
        self.rows = layout.row_index
        self.stage_of_row = np.repeat(np.arange(self.count), layout.stage_rows)
        self.dynamics = MatrixFamily(self.sizes[:-1] + 1, self.n_x[1:])
        self.matrices = MatrixFamily(self.sizes + 1, self.sizes)

    @cached_property
    def _hessian(self) -> tuple[StageAssembly, NDArray[np.bool_]]:
        kind, first = unique_rows(self.assembly.structure_keys(rows=False))
        sums = self.assembly.hessian_of(first)
        stage = self.stage_of_unknown[sums.rows]
        if (stage != self.stage_of_unknown[sums.columns]).any():
            raise ValueError("a second derivative reaches into another stage")
        row, column = self.place_in_stage[sums.rows], self.place_in_stage[sums.columns]
        entries = Entries(stage, self.matrices.offsets(stage, row, column))
        return StageAssembly(sums, entries, kind), row == column

    @property
    def hessian(self) -> StageAssembly:
        """The nonzeros that are written to the matrices RSQrqt.

        Raises:
            ValueError: a second derivative reaches from one stage into another.
        """
        return self._hessian[0]

    @property
    def on_diagonal(self) -> NDArray[np.bool_]:
        """A mask of the nonzeros that stand for all: those on the diagonal."""
        return self._hessian[1]

    @cached_property
    def gradient_offsets(self) -> Indices:
        """The places that the gradient goes to within the matrices of the unknowns' stages."""
        stage = self.stage_of_unknown
        return self.matrices.offsets(stage, self.sizes[stage], self.place_in_stage)


@record
class Columns:
    """Columns of the matrices BAbt (family 0) and both Ggt (1 and 2), one per constraint of fatrop's.

    Attributes:
        stages, families, numbers: the matrix, and the column within it; each of shape (n,).
    """

    stages: Indices
    families: Indices
    numbers: Indices


class Rows:
    """The mapping as far as it depends on the kinds of bounds: which constraints are equalities, which inequalities.

    Values v are those of the constraints, then those of the unknowns, (g, w); so are multipliers.

    Attributes:
        items: the places in v of fatrop's constraints, in its order; those of both sides of a row are neighbours.
        factors: fatrop's constraints are `factors * v[items] + shifts`.
        equalities: number of equalities per stage, shape (K,).
        inequalities: number of inequalities per stage, shape (K,).
        lower, upper: bounds of the inequalities.
        weights: the factors of the inequalities, by which their nonzeros are multiplied.
    """

    def __init__(
        self, stages: Stages, bounds: Bounds, start: InitialPoint | None = None, *, exact: bool = False
    ) -> None:
        self.stages = stages
        lower = np.concatenate([bounds.g_lower, bounds.lower])
        upper = np.concatenate([bounds.g_upper, bounds.upper])
        # Within a stage the constraints come before the simple bounds.
        candidates = np.concatenate([stages.rows, stages.constraints + np.arange(stages.unknowns)])
        stage = np.concatenate([stages.stage_of_row, stages.stage_of_unknown])
        order = np.argsort(stage, kind="stable")
        candidates, stage = candidates[order], stage[order]
        equal = lower[candidates] == upper[candidates]
        between = ~equal & (np.isfinite(lower[candidates]) | np.isfinite(upper[candidates]))
        if not between.any():
            free = np.flatnonzero(~equal & (candidates >= stages.constraints))[:1]
            lower[candidates[free]], upper[candidates[free]] = -WIDE, WIDE
            between[free] = True
        self.equalities: Indices = np.bincount(stage[equal], minlength=stages.count)
        fixed, ranged = candidates[equal], candidates[between]
        low, high, count = lower[ranged], upper[ranged], len(ranged)
        if start is None:
            once = np.ones(count, dtype=np.int64)
            sides = ScaledInequalities(ranged, once, np.ones(count), np.zeros(count), low, high)
        else:
            sides = scale_by_multipliers(ranged, low, high, start)
        self.inequalities: Indices = np.bincount(np.repeat(stage[between], sides.copies), minlength=stages.count)
        self.items: Indices = np.concatenate([fixed, stages.gaps, sides.items])
        self.factors = np.concatenate([np.ones(len(fixed)), -np.ones(len(stages.gaps)), sides.factors])
        self.shifts = np.concatenate([-lower[fixed], lower[stages.gaps], sides.shifts])
        self.lower, self.upper = undo_relaxation(sides.lower, sides.upper) if exact else (sides.lower, sides.upper)
        self.first_inequality = np.cumsum(self.inequalities) - self.inequalities
        self.weights = Factors(sides.factors, self.first_inequality)
        self.families = (
            stages.dynamics,
            MatrixFamily(stages.sizes + 1, self.equalities),
            MatrixFamily(stages.sizes + 1, self.inequalities),
        )
        copies = equal.astype(np.int64)
        copies[between] = 2 * sides.copies
        self._copies, self._stage = copies, stage

    @cached_property
    def columns(self) -> Columns:
        """The columns of all items."""
        counts = self.equalities, self.stages.n_x[1:], self.inequalities
        stage = [np.repeat(np.arange(len(count)), count) for count in counts]
        number = [np.arange(len(at)) - (np.cumsum(count) - count)[at] for at, count in zip(stage, counts, strict=True)]
        family = np.repeat((1, 0, 2), [len(at) for at in stage])
        return Columns(np.concatenate(stage), family, np.concatenate(number))

    def _structure_keys(self) -> Indices:
        """Return what tells stages apart that have other constraints, shape (K, n)."""
        counts = np.bincount(self._stage, minlength=self.stages.count)
        places = np.arange(len(self._stage)) - np.repeat(np.cumsum(counts) - counts, counts)
        copies = np.full((self.stages.count, int(counts.max())), -1)
        copies[self._stage, places] = self._copies
        return np.hstack([self.stages.assembly.structure_keys(rows=True), copies])

    @cached_property
    def jacobian(self) -> StageAssembly:
        """The nonzeros that are written to BAbt and both Ggt.

        The others of the program's Jacobian belong to the next states, whose matrix fatrop knows, and to rows without
        bounds.

        Raises:
            ValueError: a constraint reaches into another stage, other than a gap to the next states.
        """
        kind, first = unique_rows(self._structure_keys())
        sums = self.stages.assembly.jacobian_of(first)
        numbers, items = self.locate(sums)
        family = self.columns.families[items]
        stage, column = self.columns.stages[items], self.columns.numbers[items]
        inequality = family == INEQUALITIES
        signs = np.where(inequality, 1.0, self.factors[items])
        row = self.stages.place_in_stage[sums.columns[numbers]]
        entries = Entries(stage, self.offsets(items, row), family, np.where(inequality, column, -1))
        return StageAssembly(sums.choose(numbers, signs), entries, kind)

    def locate(self, sums: SparseAssembly) -> tuple[Indices, Indices]:
        """Return which nonzeros are written, and to which items' columns."""
        stages = self.stages
        rows, columns = sums.rows, sums.columns
        stage_of_row = np.empty(stages.constraints, dtype=np.int64)
        stage_of_row[stages.rows] = stages.stage_of_row
        stage_of_row[stages.gaps] = np.repeat(np.arange(stages.count - 1), stages.n_x[1:])
        ahead = stages.stage_of_unknown[columns] == stage_of_row[rows] + 1
        next_state = np.full(stages.constraints, -1)
        next_state[stages.gaps] = stages.next_states
        if (
            not np.array_equal(next_state[rows[ahead]], columns[ahead])
            or (stages.stage_of_unknown[columns[~ahead]] != stage_of_row[rows[~ahead]]).any()
        ):
            raise ValueError("a constraint reaches into another stage")
        second = np.concatenate([[False], self.items[1:] == self.items[:-1]])
        numbers: list[Indices] = []
        items: list[Indices] = []
        for some in (~second, second):
            item_of = np.full(stages.constraints + stages.unknowns, -1)
            item_of[self.items[some]] = np.flatnonzero(some)
            numbers.append(np.flatnonzero(~ahead & (item_of[rows] >= 0)))
            items.append(item_of[rows[numbers[-1]]])
        return np.concatenate(numbers), np.concatenate(items)

    @cached_property
    def residual_offsets(self) -> Indices:
        """The places that the residuals go to within the matrices of the items' columns."""
        return self.offsets(np.arange(len(self.items)), self.stages.sizes[self.columns.stages])

    @cached_property
    def constants(self) -> tuple[Indices, Indices]:
        """The items that are simple bounds, and where their derivatives, the factors, go within their matrices."""
        bounded = np.flatnonzero(self.items >= self.stages.constraints)
        unknowns = self.items[bounded] - self.stages.constraints
        return bounded, self.offsets(bounded, self.stages.place_in_stage[unknowns])

    def offsets(self, items: Indices, rows: Indices) -> Indices:
        """Return where entries in the columns of items lie within their matrices."""
        columns = self.columns
        result = np.empty(len(items), dtype=np.int64)
        for number, family in enumerate(self.families):
            here = np.flatnonzero(columns.families[items] == number)
            own = items[here]
            result[here] = family.offsets(columns.stages[own], rows[here], columns.numbers[own])
        return result
