"""The mapping of the nonlinear program to fatrop's stages.

fatrop orders the unknowns of a stage `u, x` (the program: `x, u`) and knows three kinds of constraints: equalities and
inequalities of one stage, and the dynamics `F(x, u) - x_next = 0` (the program's gaps with the other sign). Simple
bounds are constraints like others. Its vectors of constraints and multipliers hold all equalities, then the dynamics,
then all inequalities.

Entries of matrices are counted column by column, stage by stage. Those that a pattern leaves out are zero for good:

    BAbt = [B A b]^T, Ggt = [G g]^T of equalities and of inequalities: nonzeros of the Jacobian, residuals, ones
    RSQrqt = [R S^T; S Q; r^T q^T]: nonzeros of the Hessian, the gradient
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from airrace.optimal_control.fatrop.matrices import MatrixFamily
from airrace.optimal_control.fatrop.sides import Known, plain, weighed
from airrace.optimal_control.layout import Indices, Layout
from airrace.optimal_control.sums import Sums
from airrace.trajectory import Array

WIDE = 1e6
"""The bound, in scaled units, that is given to one unknown of a problem without any inequality.

fatrop 1.1.8 never brings the multipliers of such a problem to convergence. With one bound of 1e3 to 1e9 it solves a
linear-quadratic problem in 7 to 10 iterations, to the same digits; with 1e15 the bound has no effect any more.
"""


@dataclass(frozen=True)
class Bounds:
    """The bounds of the scaled unknowns, each of shape (n_w,), and of the scaled constraints, each of shape (n_g,)."""

    lower: Array
    upper: Array
    g_lower: Array
    g_upper: Array


class Stages:
    """The mapping as far as it depends on the structure of a program alone (K stages)."""

    def __init__(self, layout: Layout, jacobian: Sums, hessian: Sums) -> None:
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
        self.jacobian = jacobian
        self._hessian_nonzeros = hessian.rows, hessian.columns
        self.dynamics = MatrixFamily(self.sizes[:-1] + 1, self.n_x[1:])
        self.hessian = MatrixFamily(self.sizes + 1, self.sizes)

    @cached_property
    def hessian_places(self) -> Indices:
        """The places of the nonzeros among the entries of the matrices RSQrqt.

        Raises:
            ValueError: a second derivative reaches from one stage into another.
        """
        rows, columns = self._hessian_nonzeros
        stage = self.stage_of_unknown
        if (stage[rows] != stage[columns]).any():
            raise ValueError("a second derivative reaches into another stage")
        return self._hessian_columns[columns] + self.place_in_stage[rows]

    @cached_property
    def gradient_places(self) -> Indices:
        """The places of the gradient among these entries."""
        return self._hessian_columns + self.sizes[self.stage_of_unknown]

    @cached_property
    def _hessian_columns(self) -> Indices:
        """The place at which the column of each unknown begins among these entries."""
        stage = self.stage_of_unknown
        return self.hessian.starts[:-1][stage] + self.place_in_stage * (self.sizes[stage] + 1)

    @cached_property
    def hessian_diagonal(self) -> Indices:
        """The places of the diagonal among the entries of the matrices RSQrqt."""
        stage = self.stage_of_unknown
        return self.hessian.starts[:-1][stage] + self.place_in_stage * (self.sizes[stage] + 2)


class Rows:
    """The mapping as far as it depends on the kinds of bounds: which constraints are equalities, which inequalities.

    Values v are those of the constraints, then those of the unknowns, (g, w); so are multipliers.

    Attributes:
        items: the places in v of fatrop's constraints, in its order; those of both sides of a row are neighbours.
        factors: fatrop's constraints are `factors * v[items] + shifts`.
        equalities: number of equalities per stage, shape (K,).
        inequalities: number of inequalities per stage, shape (K,).
        lower, upper: bounds of the inequalities.
    """

    def __init__(self, stages: Stages, bounds: Bounds, known: Known | None = None) -> None:
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
        ends = lower[ranged], upper[ranged]
        sides = plain(ranged, *ends) if known is None else weighed(ranged, *ends, known)
        self.inequalities: Indices = np.bincount(np.repeat(stage[between], sides.copies), minlength=stages.count)
        self.items: Indices = np.concatenate([fixed, stages.gaps, sides.items])
        self.factors = np.concatenate([np.ones(len(fixed)), -np.ones(len(stages.gaps)), sides.factors])
        self.shifts = np.concatenate([-lower[fixed], lower[stages.gaps], sides.shifts])
        self.lower, self.upper = sides.lower, sides.upper
        self.first_inequality = np.cumsum(self.inequalities) - self.inequalities
        self.families = (
            stages.dynamics,
            MatrixFamily(stages.sizes + 1, self.equalities),
            MatrixFamily(stages.sizes + 1, self.inequalities),
        )

    @cached_property
    def _entries(self) -> tuple[Indices, Indices]:
        """The nonzeros of the program's Jacobian that are written to BAbt and both Ggt, and the item of each.

        The others belong to the next states, whose matrix fatrop knows, and to rows without bounds.

        Raises:
            ValueError: a constraint reaches into another stage, other than a gap to the next states.
        """
        stages = self.stages
        rows, columns = stages.jacobian.rows, stages.jacobian.columns
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
        again = np.concatenate([[False], self.items[1:] == self.items[:-1]])
        numbers: list[Indices] = []
        items: list[Indices] = []
        for chosen in (~again, again):
            item_of = np.full(stages.constraints + stages.unknowns, -1)
            item_of[self.items[chosen]] = np.flatnonzero(chosen)
            numbers.append(np.flatnonzero(~ahead & (item_of[rows] >= 0)))
            items.append(item_of[rows[numbers[-1]]])
        return np.concatenate(numbers), np.concatenate(items)

    @cached_property
    def jacobian(self) -> Sums:
        """The nonzeros that are written to BAbt and both Ggt."""
        numbers, items = self._entries
        return self.stages.jacobian.chosen(numbers, self.factors[items])

    @cached_property
    def nonzero_places(self) -> Indices:
        """The places of these nonzeros among the entries of BAbt and both Ggt."""
        return self._column_start[self._entries[1]] + self.stages.place_in_stage[self.jacobian.columns]

    @cached_property
    def residual_places(self) -> Indices:
        """The places of the residuals among these entries."""
        return self._column_start + self.stages.sizes[self._stage_of_item()]

    @cached_property
    def constants(self) -> tuple[Indices, Array]:
        """The places of the derivatives of simple bounds among these entries, and the derivatives."""
        bounded = np.flatnonzero(self.items >= self.stages.constraints)
        unknowns = self.items[bounded] - self.stages.constraints
        return self._column_start[bounded] + self.stages.place_in_stage[unknowns], self.factors[bounded]

    def _stage_of_item(self) -> Indices:
        of_gap = np.repeat(np.arange(self.stages.count - 1), self.stages.n_x[1:])
        kinds = [np.repeat(np.arange(self.stages.count), count) for count in (self.equalities, self.inequalities)]
        return np.concatenate([kinds[0], of_gap, kinds[1]])

    @cached_property
    def _column_start(self) -> Indices:
        """The place at which the column of each item begins among the entries of BAbt and both Ggt."""
        dynamics, equal, between = self.families
        height = self.stages.sizes + 1
        starts = [
            equal.starts[:-1] + dynamics.entries,
            dynamics.starts[:-1],
            between.starts[:-1] + dynamics.entries + equal.entries,
        ]
        counts = [self.equalities, self.stages.n_x[1:], self.inequalities]
        begin: list[Indices] = []
        for start, count in zip(starts, counts, strict=True):
            stage = np.repeat(np.arange(len(count)), count)
            within = np.arange(len(stage)) - (np.cumsum(count) - count)[stage]
            begin.append(start[stage] + within * height[stage])
        return np.concatenate(begin)
