"""The assembly of a nonlinear program from the kernels of its intervals.

It tells on which unknowns each kernel is called, and of which of the results every constraint and every nonzero of the
derivatives is a weighted sum; the weights carry the scaling. These are index arrays, which depend on the structure of a
problem alone and are made in time linear in its length. `evaluation.py` evaluates them.
"""

from collections.abc import Sequence
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from airrace.optimal_control.kernels import Callee, Kernel, Kernels, observation_kernel
from airrace.optimal_control.layout import Indices, Layout, OutputSample
from airrace.optimal_control.sparse_assembly import COOBuilder, SparseAssembly, unique_rows
from airrace.records import record
from airrace.trajectory import Array


@record
class Calls:
    """All calls of one kernel. Parameters are told by their places in (p, 0), p and a zero behind it.

    Attributes:
        kernel: what is called.
        inputs: places of y among the unknowns, shape (calls, n_y).
        own: places of `own`, shape (calls, n_own).
        shared: places of `shared`, shape (n_shared,).
        rows: places of c among the constraints, the number of constraints where not constrained; shape (calls, n_c).
        weights: factors from c to the scaled constraints; shape (calls, n_c).
        stages: to which the calls belong, shape (calls,).
        jumps: places of what is taken off the unknowns before they become y, shape (calls, n_y); None for nothing.
    """

    kernel: Callee
    inputs: Indices
    own: Indices
    shared: Indices
    rows: Indices
    weights: Array
    stages: Indices
    jumps: Indices | None = None

    @property
    def batches(self) -> int:
        """The number of calls of a kernel that takes several intervals at once."""
        return -(-len(self.inputs) // self.kernel.lanes)

    @cached_property
    def filled(self) -> Indices:
        """The call that each lane of all batches takes.

        Lanes that are left over repeat the last call, so that they hold nothing that could not be evaluated.
        """
        return np.minimum(np.arange(self.batches * self.kernel.lanes), len(self.inputs) - 1)


@record
class FinalCost:
    """The cost `sum_i weights_i c_i(y)` of the final state y (a Mayer term), as an observation sees it.

    Attributes:
        kernel: what is observed, c.
        weights: of its values, in the objective's unit per unit of the quantity; shape (n_c,).
        inputs: places of y among the unknowns, shape (n_x,).
        own: places of the observation's parameters in p, shape (n_b,).
    """

    kernel: Kernel
    weights: Array
    inputs: Indices
    own: Indices


@record
class Penalty:
    """The regularisation `sum_k T_k fraction_k sum_j weights_j w_kj^2` in scaled controls.

    Attributes:
        weights: per control, shape (n_u,).
        controls: places of the controls among the unknowns, shape (N, n_u).
        durations: places of the durations, shape (N,).
        fractions: places of the fractions in p, shape (N,).
    """

    weights: Array
    controls: Indices
    durations: Indices
    fractions: Indices


class Assembly:
    """The index arrays of one problem's program.

    Attributes:
        layout: of the problem.
        calls: of all kernels.
        linear: the linear part of the objective in the scaled unknowns, shape (n_w,).
        final: the cost that an observation sees in the final state; None without one.
        penalty: None without a regularisation.
    """

    def __init__(self, layout: Layout, kernels: Kernels) -> None:
        self.layout = layout
        self._system_parameters = np.arange(len(layout.problem.parameters))
        self._fractions = len(layout.problem.parameters) + np.arange(layout.intervals)
        self.calls = [self._steps(kernels.step), *self._path(kernels.path), *self._output_samples()]
        self.linear = self._linear()
        self.final = self._final()
        self.penalty = self._penalty()

    # the kernel calls

    def _steps(self, kernel: Callee) -> Calls:
        layout = self.layout
        rows = layout.gap_index[:, :-1]
        scale = np.array([quantity.scale for quantity in layout.problem.system.states])
        weights = np.broadcast_to(-1.0 / scale, rows.shape)
        return Calls(
            kernel,
            layout.interval_index,
            self._fractions[:, None],
            self._system_parameters,
            rows,
            weights,
            np.arange(layout.intervals),
        )

    def _path(self, kernel: Callee | None) -> list[Calls]:
        layout = self.layout
        if kernel is None:
            return []
        # The last node has no control of its own; no row there depends on it.
        controls = np.vstack([layout.control_index, layout.control_index[-1:]])
        inputs = np.hstack([layout.state_index, controls])
        given = self.layout.rows
        rows, weights = self._rows(kernel, len(inputs), np.where(given.source < 0, given.node, -1))
        own = np.zeros((len(inputs), 0), dtype=np.int64)
        return [Calls(kernel, inputs, own, self._system_parameters, rows, weights, np.arange(len(inputs)))]

    def _output_samples(self) -> list[Calls]:
        """Return the calls of the observations, those of one kind together."""
        groups: dict[int, list[int]] = {}
        for number, output_sample in enumerate(self.layout.output_samples):
            groups.setdefault(id(output_sample.observation), []).append(number)
        return [self._observations(members) for members in groups.values()]

    def _observations(self, members: list[int]) -> Calls:
        layout = self.layout
        output_samples = [layout.output_samples[number] for number in members]
        observation = output_samples[0].observation
        call_of = np.full(len(layout.output_samples) + 1, -1)  # the last one stands for the path
        call_of[members] = np.arange(len(members))
        kernel = observation_kernel(observation, layout.n_x)
        nodes = np.array([output_sample.node for output_sample in output_samples])
        inputs = layout.state_index[nodes]
        rows, weights = self._rows(kernel, len(members), call_of[layout.rows.source])
        first = len(layout.problem.parameters) + layout.intervals
        offsets = np.array([first + output_sample.offset for output_sample in output_samples])
        own = offsets[:, None] + np.arange(len(observation.parameters))
        shared = np.zeros(0, dtype=np.int64)
        return Calls(kernel, inputs, own, shared, rows, weights, nodes, self._unseen_jumps(output_samples))

    def _unseen_jumps(self, output_samples: Sequence[OutputSample]) -> Indices | None:
        """Return the places of the changes to be subtracted from the states at these nodes, shape (samples, n_x).

        It is None if none of the nodes has a jump.
        """
        layout = self.layout
        if all(output_sample.jump is None for output_sample in output_samples):
            return None
        places = np.full((len(output_samples), layout.n_x), len(layout.parameter_values()))
        for row, output_sample in enumerate(output_samples):
            if output_sample.jump is not None:
                places[row] = layout.jump_offset + output_sample.jump * layout.n_x + np.arange(layout.n_x)
        return places

    def _rows(self, kernel: Callee, calls: int, call: Indices) -> tuple[Indices, Array]:
        """Return the places and weights of the outputs that are constrained; `call` is that of each row, or -1."""
        rows = np.full((calls, kernel.values), self.layout.constraints)
        weights = np.zeros(rows.shape)
        own, given = call >= 0, self.layout.rows
        rows[call[own], given.component[own]] = self.layout.row_index[own]
        weights[call[own], given.component[own]] = 1.0 / given.scale[own]
        return rows, weights

    # the objective

    def _linear(self) -> Array:
        layout, objective = self.layout, self.layout.problem.objective
        linear = np.zeros(layout.unknowns)
        linear[layout.duration_index[layout.first_node[:-1]]] = objective.time
        for component, quantity in enumerate(layout.problem.system.states):
            linear[layout.state_index[-1, component]] += objective.terminal.get(quantity.name, 0.0)
        return linear * layout.scale

    def _final(self) -> FinalCost | None:
        layout, objective = self.layout, self.layout.problem.objective
        observation = objective.observation
        if observation is None:
            return None
        weights = np.array([objective.terminal.get(one.name, 0.0) for one in observation.quantities])
        end = len(layout.parameter_values())
        own = np.arange(end - len(objective.values), end)
        return FinalCost(observation_kernel(observation, layout.n_x), weights, layout.state_index[-1], own)

    def _penalty(self) -> Penalty | None:
        layout, objective = self.layout, self.layout.problem.objective
        weights = np.array([objective.regularisation.get(one.name, 0.0) for one in layout.problem.system.controls])
        if not weights.any():
            return None
        return Penalty(weights, layout.control_index, layout.duration_index[:-1], self._fractions)

    # the sums

    @cached_property
    def constraints(self) -> SparseAssembly:
        """The constraints g, a column: gaps `x_next - F(x, u, T)` and `T_next - T`, rows of path and boundaries.

        The gap at the end of a phase is bounded to that phase's jump, all others to zero. Drawn from the values of all
        kernels and from w.
        """
        g = COOBuilder(self.layout.constraints, 1)
        for calls in self.calls:
            rows, weights = calls.rows.ravel(), calls.weights.ravel()
            used = np.flatnonzero(rows < self.layout.constraints)
            g.draw_from(calls.rows.shape[1] * len(calls.filled))
            g.add(rows[used], np.zeros_like(used), weights[used], used)
        g.draw_from(self.layout.unknowns)
        for gap, unknown, sign in self._linear_gaps():
            g.add(gap, np.zeros_like(gap), np.full(len(gap), sign), unknown)
        return g.sums()

    def _linear_gaps(self) -> list[tuple[Indices, Indices, float]]:
        """Return the linear part of the gaps: (rows, unknowns, sign), all in scaled units."""
        layout = self.layout
        duration_gap = layout.gap_index[:, -1]
        return [
            (layout.gap_index[:, :-1].ravel(), layout.state_index[1:].ravel(), 1.0),
            (duration_gap, layout.duration_index[1:], 1.0),
            (duration_gap, layout.duration_source, -1.0),
        ]

    @cached_property
    def jacobian(self) -> SparseAssembly:
        """The Jacobian of g, drawn from the nonzeros of all kernels' Jacobians and from a one."""
        return self.jacobian_of(self._everywhere)

    def jacobian_of(self, stages: NDArray[np.bool_]) -> SparseAssembly:
        """Return the rows of the Jacobian that belong to some stages; the others are left out, shape (N + 1,)."""
        layout = self.layout
        matrix = COOBuilder(layout.constraints, layout.unknowns)
        for calls in self.calls:
            component, of = pattern(calls.kernel.jacobian_pattern)
            chosen = np.flatnonzero(stages[calls.stages])
            rows = calls.rows[chosen[:, None], component].ravel()
            columns = calls.inputs[chosen[:, None], of].ravel()
            weights = calls.weights[chosen[:, None], component].ravel() * layout.scale[columns]
            used = np.flatnonzero(rows < layout.constraints)
            matrix.draw_from(len(component) * len(calls.filled), len(component) * self._first_call(calls))
            matrix.add(rows[used], columns[used], weights[used], _numbered(chosen, len(component))[used])
        matrix.draw_from(1, np.zeros(len(stages), dtype=np.int64))
        intervals = np.flatnonzero(stages[:-1])
        for gap, unknown, sign in self._linear_gaps():
            gap, unknown = (one.reshape(layout.intervals, -1)[intervals].ravel() for one in (gap, unknown))
            matrix.add(gap, unknown, np.full(len(gap), sign), np.zeros_like(gap))
        return matrix.sums()

    @cached_property
    def adjoint(self) -> SparseAssembly:
        """The Jacobian of g transposed times lam_g, a column, drawn from all kernels' gradients and from lam_g."""
        layout = self.layout
        adjoint = COOBuilder(layout.unknowns, 1)
        for calls in self.calls:
            places = calls.inputs.ravel()
            adjoint.draw_from(calls.inputs.shape[1] * len(calls.filled))
            adjoint.add(places, np.zeros_like(places), layout.scale[places], np.arange(len(places)))
        adjoint.draw_from(layout.constraints)
        for gap, unknown, sign in self._linear_gaps():
            adjoint.add(unknown, np.zeros_like(unknown), np.full(len(gap), sign), gap)
        return adjoint.sums()

    @cached_property
    def hessian(self) -> SparseAssembly:
        """The Hessian of the Lagrangian, both triangles.

        Drawn from the nonzeros of all kernels' Hessians, from those of the final cost's and from the penalty's two
        blocks, in w w and in w T, each of shape (N, n_u).
        """
        return self.hessian_of(self._everywhere)

    def hessian_of(self, stages: NDArray[np.bool_]) -> SparseAssembly:
        """Return what some stages contribute to the Hessian; the others are left out, shape (N + 1,)."""
        layout = self.layout
        matrix = COOBuilder(layout.unknowns, layout.unknowns, symmetric=True)
        for calls in self.calls:
            row, column = pattern(calls.kernel.hessian_pattern)
            chosen = np.flatnonzero(stages[calls.stages])
            rows, columns = calls.inputs[chosen[:, None], row].ravel(), calls.inputs[chosen[:, None], column].ravel()
            # what the last node's path would say of the control before it is zero: no row there depends on that
            stage = np.repeat(calls.stages[chosen], len(row))
            within = (layout.stage_of_unknown[rows] == stage) & (layout.stage_of_unknown[columns] == stage)
            within = np.flatnonzero(within)
            rows, columns = rows[within], columns[within]
            matrix.draw_from(len(row) * len(calls.filled), len(row) * self._first_call(calls))
            matrix.add(rows, columns, layout.scale[rows] * layout.scale[columns], _numbered(chosen, len(row))[within])
        if self.final is not None:
            row, column = pattern(self.final.kernel.hessian_pattern)
            rows, columns = self.final.inputs[row], self.final.inputs[column]
            matrix.draw_from(len(rows), np.zeros(len(stages), dtype=np.int64))
            if stages[-1]:
                matrix.add(rows, columns, layout.scale[rows] * layout.scale[columns], np.arange(len(rows)))
        if self.penalty is not None:
            self._add_penalty(matrix, self.penalty, stages)
        return matrix.sums()

    def _add_penalty(self, matrix: COOBuilder, penalty: Penalty, stages: NDArray[np.bool_]) -> None:
        """Add the second derivatives of `T fraction weight w^2`: in w w and in w T."""
        layout = self.layout
        intervals, at = np.flatnonzero(stages[:-1]), layout.n_u * np.arange(len(stages))
        places = penalty.controls[intervals].ravel()
        factor = 2.0 * np.tile(penalty.weights, len(intervals))
        durations = np.repeat(penalty.durations[intervals], layout.n_u)
        sources = _numbered(intervals, layout.n_u)
        matrix.draw_from(penalty.controls.size, at)
        matrix.add(places, places, factor, sources)
        matrix.draw_from(penalty.controls.size, at)
        matrix.add(places, durations, factor * layout.scale[durations], sources)

    @property
    def _everywhere(self) -> NDArray[np.bool_]:
        return np.ones(self.layout.intervals + 1, dtype=np.bool_)

    def _first_call(self, calls: Calls) -> Indices:
        """Return the first call at each stage, 0 where there is none; shape (N + 1,)."""
        first = np.zeros(self.layout.intervals + 1, dtype=np.int64)
        first[calls.stages[::-1]] = np.arange(len(calls.stages))[::-1]
        return first

    # stages that are alike

    def alike(self, *, rows: bool) -> Indices:
        """Return what tells stages apart whose derivatives have other patterns, shape (N + 1, n).

        Stages are alike where all is equal. None is like a stage at which a kernel is called twice.

        Args:
            rows: whether it counts which constraints there are, as it does for the Jacobian.
        """
        layout = self.layout
        stages = layout.intervals + 1
        told: list[Indices] = [layout.stage_states, layout.stage_controls, np.arange(stages) == layout.intervals]
        begins = np.append(layout.gap_index[:, 0], 0)
        for calls in self.calls:
            code = np.zeros(stages, dtype=np.int64)
            here = np.ones((len(calls.stages), 1), dtype=np.int64)
            if rows:
                constrained = calls.rows < layout.constraints
                at = np.where(constrained, calls.rows - begins[calls.stages, None], -1)
                here = np.hstack([at, np.ascontiguousarray(calls.weights).view(np.int64)])
            code[calls.stages] = 1 + unique_rows(here)[0]
            often = np.bincount(calls.stages, minlength=stages) > 1
            code[often] = -1 - np.flatnonzero(often)
            told.append(code)
        return np.stack(told, axis=1)


def _numbered(calls: Indices, count: int) -> Indices:
    """Return the numbers of all results of some calls, each of which has so many; shape (calls * count,)."""
    return (calls[:, None] * count + np.arange(count)).ravel()


def pattern(sparsity: ca.Sparsity) -> tuple[Indices, Indices]:
    """Return the rows and columns of the nonzeros in casadi's order."""
    rows, columns = sparsity.get_triplet()
    return np.array(rows, dtype=np.int64), np.array(columns, dtype=np.int64)
