"""The assembly of a nonlinear program from the kernels of its intervals, and of the dense matrices of its stages.

It states on which unknowns each kernel is called, and of which of the results every constraint and every nonzero of the
derivatives is a weighted sum; the weights carry the scaling. These are index arrays, which depend on the structure of a
problem alone and are made in time linear in its length. `evaluation.py` evaluates them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from airrace.optimal_control.kernels import Callee, Kernel, Kernels, casadi_observation
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.sparse_assembly import (
    COOBuilder,
    Entries,
    Memory,
    SparseAssembly,
    StageAssembly,
    unique_rows,
)
from airrace.optimal_control.system import Observation
from airrace.optimal_control.trajectory import Array, Indices


@dataclass(frozen=True, eq=False)
class Calls:
    """All calls of one kernel. Parameters are named by their places in (p, 0), p and a zero behind it.

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
    def of_lane(self) -> Indices:
        """The call that each lane of all batches takes; lanes that are left over repeat the last one."""
        return np.minimum(np.arange(self.batches * self.kernel.lanes), len(self.inputs) - 1)

    def first_of_stage(self, stages: int) -> Indices:
        """Return the first call at each of so many stages, 0 where there is none."""
        first = np.zeros(stages, dtype=np.int64)
        first[self.stages[::-1]] = np.arange(len(self.stages))[::-1]
        return first


@dataclass(frozen=True, eq=False)
class EndCost:
    """The cost `sum_i weights_i c_i(y)` of the state y at one end (a Mayer term), as an observation sees it.

    Attributes:
        stage: the first or the last.
        kernel: what is observed, c.
        weights: of its values, in the objective's unit per unit of the quantity; shape (n_c,).
        inputs: places of y among the unknowns, shape (n_x,).
        own: places of the observation's parameters in p, shape (n_b,).
    """

    stage: int
    kernel: Kernel
    weights: Array
    inputs: Indices
    own: Indices


@dataclass(frozen=True, eq=False)
class Penalty:
    """The regularisation `sum_k T_k fraction_k sum_j weights_j w_kj^2` in scaled states and controls.

    Attributes:
        weights: of the n states and controls that have one, shape (n,).
        places: of these among the unknowns, the states where the intervals begin; shape (N, n).
        durations: places of the durations, shape (N,).
        fractions: places of the fractions in p, shape (N,).
    """

    weights: Array
    places: Indices
    durations: Indices
    fractions: Indices


class Assembly:
    """The index arrays of one problem's program.

    Attributes:
        layout: of the problem.
        calls: of all kernels.
        linear: the linear part of the objective in the scaled unknowns, shape (n_w,).
        end_costs: what observations see in the states at the ends.
        penalty: None without a regularisation.
    """

    def __init__(self, layout: Layout, kernels: Kernels) -> None:
        self.layout = layout
        problem, objective = layout.problem, layout.problem.objective
        self._stages = layout.intervals + 1
        self._system_parameters = np.arange(len(problem.parameters))
        self._fractions = len(problem.parameters) + np.arange(layout.intervals)
        self.calls = [self._steps(kernels.step)]
        if kernels.path is not None:
            self.calls.append(self._path(kernels.path))
        samples_of: dict[int, list[int]] = {}
        for number, sample in enumerate(layout.output_samples):
            samples_of.setdefault(id(sample.observation), []).append(number)
        self.calls += [self._observations(kernels, numbers) for numbers in samples_of.values()]
        self.linear = np.zeros(layout.unknowns)
        self.linear[layout.duration_index[layout.first_node[:-1]]] = objective.time
        terminal = [objective.terminal.get(quantity.name, 0.0) for quantity in problem.system.states]
        self.linear[layout.state_index[-1]] += terminal
        self.linear *= layout.scale
        self.end_costs: list[EndCost] = []
        begin = len(layout.parameter_values()) - len(objective.all_values)
        own = begin + np.arange(len(objective.all_values))
        if objective.observation is not None:
            self._observe_end(layout.intervals, objective.observation, objective.terminal, own[: len(objective.values)])
        if (start := objective.start) is not None:
            self._observe_end(0, start.observation, start.weights, own[len(objective.values) :])
        regularised = (*problem.system.states, *problem.system.controls)
        weights = np.array([objective.regularisation.get(quantity.name, 0.0) for quantity in regularised])
        regularised_rows = np.flatnonzero(weights)
        places = np.hstack([layout.state_index[:-1], layout.control_index])[:, regularised_rows]
        penalty = Penalty(weights[regularised_rows], places, layout.duration_index[:-1], self._fractions)
        self.penalty = penalty if regularised_rows.size else None
        # the linear part of the gaps, in scaled units: rows, unknowns, signs and stages
        states, durations, intervals = layout.gap_index[:, :-1], layout.gap_index[:, -1], np.arange(layout.intervals)
        self._gap_rows = np.concatenate([states.ravel(), durations, durations])
        self._gap_unknowns = np.concatenate(
            [layout.state_index[1:].ravel(), layout.duration_index[1:], layout.duration_source]
        )
        self._gap_signs = np.repeat([1.0, 1.0, -1.0], [states.size, layout.intervals, layout.intervals])
        self._gap_stages = np.concatenate([np.repeat(intervals, layout.n_x), intervals, intervals])

    def _observe_end(self, stage: int, observation: Observation, weights: Mapping[str, float], own: Indices) -> None:
        values = np.array([weights.get(quantity.name, 0.0) for quantity in observation.quantities])
        kernel, inputs = casadi_observation(observation.values), self.layout.state_index[stage]
        self.end_costs.append(EndCost(stage, kernel, values, inputs, own))

    # the kernel calls

    def _steps(self, kernel: Callee) -> Calls:
        layout = self.layout
        rows = layout.gap_index[:, :-1]
        scale = np.array([quantity.scale for quantity in layout.problem.system.states])
        return Calls(
            kernel=kernel,
            inputs=layout.interval_index,
            own=self._fractions[:, None],
            shared=self._system_parameters,
            rows=rows,
            weights=np.broadcast_to(-1.0 / scale, rows.shape),
            stages=np.arange(layout.intervals),
        )

    def _path(self, kernel: Callee) -> Calls:
        layout, nodes = self.layout, np.arange(self._stages)
        # The last node has no control of its own; no row there depends on it.
        inputs = np.hstack([layout.state_index, np.vstack([layout.control_index, layout.control_index[-1:]])])
        rows, weights = self._rows(kernel, len(nodes), np.where(layout.rows.source < 0, layout.rows.node, -1))
        own = np.zeros((len(nodes), 0), dtype=np.int64)
        return Calls(kernel, inputs, own, self._system_parameters, rows, weights, nodes)

    def _observations(self, kernels: Kernels, numbers: list[int]) -> Calls:
        """Return the calls of one observation, for the output samples of these numbers."""
        layout = self.layout
        samples = [layout.output_samples[number] for number in numbers]
        observation = samples[0].observation
        call_of = np.full(len(layout.output_samples) + 1, -1)  # the last one stands for the path
        call_of[numbers] = np.arange(len(numbers))
        kernel = kernels.observations.kernel(observation.values)
        nodes = np.array([sample.node for sample in samples])
        rows, weights = self._rows(kernel, len(numbers), call_of[layout.rows.source])
        offsets = len(layout.problem.parameters) + layout.intervals + np.array([sample.offset for sample in samples])
        jumps = None
        if any(sample.jump is not None for sample in samples):
            without_jump = np.full(layout.n_x, len(layout.parameter_values()))  # the place of the zero behind p
            at = layout.jump_offset + np.arange(layout.n_x)
            jumps = np.stack(
                [without_jump if sample.jump is None else at + sample.jump * layout.n_x for sample in samples]
            )
        return Calls(
            kernel=kernel,
            inputs=layout.state_index[nodes],
            own=offsets[:, None] + np.arange(len(observation.parameters)),
            shared=np.zeros(0, dtype=np.int64),
            rows=rows,
            weights=weights,
            stages=nodes,
            jumps=jumps,
        )

    def _rows(self, kernel: Callee, calls: int, call: Indices) -> tuple[Indices, Array]:
        """Return the places and weights of the outputs that are constrained; `call` is that of each row, or -1."""
        rows = np.full((calls, kernel.values), self.layout.constraints)
        weights = np.zeros(rows.shape)
        own, limits = call >= 0, self.layout.rows
        rows[call[own], limits.component[own]] = self.layout.row_index[own]
        weights[call[own], limits.component[own]] = 1.0 / limits.scale[own]
        return rows, weights

    # the sums

    @cached_property
    def constraints(self) -> SparseAssembly:
        """The constraints g, a column: gaps `x_next - F(x, u, T)` and `T_next - T`, rows of path and boundaries.

        The gap at the end of a phase is bounded to that phase's jump, all others to zero. Its sources are the values of
        all kernels, and w.
        """
        g = COOBuilder(self.layout.constraints, 1)
        for calls in self.calls:
            rows = calls.rows.ravel()
            used = np.flatnonzero(rows < self.layout.constraints)
            g.add_block(calls.rows.shape[1] * len(calls.of_lane))
            g.add(rows[used], np.zeros_like(used), calls.weights.ravel()[used], used)
        g.add_block(self.layout.unknowns)
        g.add(self._gap_rows, np.zeros_like(self._gap_rows), self._gap_signs, self._gap_unknowns)
        return g.build()

    @cached_property
    def jacobian(self) -> SparseAssembly:
        """The Jacobian of g; its sources are the nonzeros of all kernels' Jacobians, and a one."""
        return self.jacobian_of(np.arange(self._stages))

    def jacobian_of(self, stages: Indices) -> SparseAssembly:
        """Return the rows of the Jacobian that belong to some stages; the others are left out."""
        layout = self.layout
        within = np.isin(np.arange(self._stages), stages)
        matrix = COOBuilder(layout.constraints, layout.unknowns)
        for calls in self.calls:
            component, of = _nonzeros(calls.kernel.jacobian_pattern)
            numbers = np.flatnonzero(within[calls.stages])
            rows = calls.rows[numbers[:, None], component].ravel()
            columns = calls.inputs[numbers[:, None], of].ravel()
            weights = calls.weights[numbers[:, None], component].ravel() * layout.scale[columns]
            used = np.flatnonzero(rows < layout.constraints)
            count = len(component)
            matrix.add_block(count * len(calls.of_lane), count * calls.first_of_stage(self._stages))
            matrix.add(rows[used], columns[used], weights[used], _results(numbers, count)[used])
        matrix.add_block(1, np.zeros(self._stages, dtype=np.int64))
        gaps = np.flatnonzero(within[self._gap_stages])
        matrix.add(self._gap_rows[gaps], self._gap_unknowns[gaps], self._gap_signs[gaps], np.zeros_like(gaps))
        return matrix.build()

    @cached_property
    def adjoint(self) -> SparseAssembly:
        """The Jacobian of g transposed times lam_g, a column; its sources are all kernels' gradients, and lam_g."""
        layout = self.layout
        adjoint = COOBuilder(layout.unknowns, 1)
        for calls in self.calls:
            places = calls.inputs.ravel()
            adjoint.add_block(calls.inputs.shape[1] * len(calls.of_lane))
            adjoint.add(places, np.zeros_like(places), layout.scale[places], np.arange(len(places)))
        adjoint.add_block(layout.constraints)
        adjoint.add(self._gap_unknowns, np.zeros_like(self._gap_rows), self._gap_signs, self._gap_rows)
        return adjoint.build()

    @cached_property
    def hessian(self) -> SparseAssembly:
        """The Hessian of the Lagrangian, both triangles.

        Its sources are the nonzeros of all kernels' Hessians, those of the costs' at the ends, and the penalty's two
        blocks, in w w and in w T, each of shape (N, n).
        """
        return self.hessian_of(np.arange(self._stages))

    def hessian_of(self, stages: Indices) -> SparseAssembly:
        """Return what some stages contribute to the Hessian; the others are left out."""
        layout, scale = self.layout, self.layout.scale
        within = np.isin(np.arange(self._stages), stages)
        matrix = COOBuilder(layout.unknowns, layout.unknowns, symmetric=True)
        for calls in self.calls:
            row, column = _nonzeros(calls.kernel.hessian_pattern)
            numbers = np.flatnonzero(within[calls.stages])
            rows, columns = calls.inputs[numbers[:, None], row].ravel(), calls.inputs[numbers[:, None], column].ravel()
            # what the last node's path would say of the control before it is zero: no row there depends on that
            stage = np.repeat(calls.stages[numbers], len(row))
            used = (layout.stage_of_unknown[rows] == stage) & (layout.stage_of_unknown[columns] == stage)
            used = np.flatnonzero(used)
            rows, columns, count = rows[used], columns[used], len(row)
            matrix.add_block(count * len(calls.of_lane), count * calls.first_of_stage(self._stages))
            matrix.add(rows, columns, scale[rows] * scale[columns], _results(numbers, count)[used])
        for cost in self.end_costs:
            row, column = _nonzeros(cost.kernel.hessian_pattern)
            rows, columns = cost.inputs[row], cost.inputs[column]
            matrix.add_block(len(rows), np.zeros(self._stages, dtype=np.int64))
            if within[cost.stage]:
                matrix.add(rows, columns, scale[rows] * scale[columns], np.arange(len(rows)))
        if (penalty := self.penalty) is not None:  # T fraction weight w^2
            intervals, count = np.flatnonzero(within[:-1]), len(penalty.weights)
            places = penalty.places[intervals].ravel()
            factor = 2.0 * np.tile(penalty.weights, len(intervals))
            durations = np.repeat(penalty.durations[intervals], count)
            for columns, weights in ((places, factor), (durations, factor * scale[durations])):
                matrix.add_block(penalty.places.size, count * np.arange(self._stages))
                matrix.add(places, columns, weights, _results(intervals, count))
        return matrix.build()

    def structure_keys(self, *, rows: bool) -> Indices:
        """Return keys that distinguish stages whose derivatives have other patterns, shape (N + 1, n).

        Stages are alike where all is equal. None is like a stage at which a kernel is called twice.

        Args:
            rows: whether it counts which constraints there are, as it does for the Jacobian.
        """
        layout = self.layout
        ends = [np.arange(self._stages) == layout.intervals]
        ends += [np.arange(self._stages) == cost.stage for cost in self.end_costs]
        keys: list[Indices] = [layout.stage_states, layout.stage_controls, *ends]
        begins = np.append(layout.gap_index[:, 0], 0)
        for calls in self.calls:
            key = np.zeros(self._stages, dtype=np.int64)
            descriptions = np.ones((len(calls.stages), 1), dtype=np.int64)
            if rows:
                at = np.where(calls.rows < layout.constraints, calls.rows - begins[calls.stages, None], -1)
                descriptions = np.hstack([at, np.ascontiguousarray(calls.weights).view(np.int64)])
            key[calls.stages] = 1 + unique_rows(descriptions)[0]
            often = np.bincount(calls.stages, minlength=self._stages) > 1
            key[often] = -1 - np.flatnonzero(often)
            keys.append(key)
        return np.stack(keys, axis=1)


def _results(calls: Indices, count: int) -> Indices:
    """Return the numbers of all results of some calls, each of which has so many; shape (calls * count,)."""
    return (calls[:, None] * count + np.arange(count)).ravel()


def _nonzeros(sparsity: ca.Sparsity) -> tuple[Indices, Indices]:
    """Return the rows and columns of the nonzeros in casadi's order."""
    rows, columns = sparsity.get_triplet()
    return np.array(rows, dtype=np.int64), np.array(columns, dtype=np.int64)


MOST_UNKNOWNS = 64
"""The largest number of unknowns of a stage for which the native library has room, `riccati.c`."""


class StageMatrices:
    """The matrices of a program (n_w unknowns, n_r rows, n_y gaps), which lie one behind the other.

    Attributes:
        states: number of states of every stage, the duration among them, m.
        sizes: number of unknowns n_k of every stage; shape (N + 1,).
        row_counts: number of rows of every stage; shape (N + 1,).
        unknowns, gaps, rows: n_w, n_y, n_r.
        hessian: of each stage, (n_k, n_k).
        constraints: of each interval the derivatives of its end, (m, n_k), column by column; behind them those of each
            stage's rows, row by row.
        gap_size: number of all entries of the former.
    """

    def __init__(self, assembly: Assembly) -> None:
        layout = assembly.layout
        sizes = layout.stage_states + layout.stage_controls
        self.states = int(layout.stage_states[0])
        self.sizes, self.row_counts = sizes.astype(np.int32), layout.stage_rows.astype(np.int32)
        self.unknowns, self.gaps, self.rows = layout.unknowns, layout.gap_index.size, len(layout.row_index)
        dynamics, rows = self.states * sizes[:-1], layout.stage_rows * sizes
        self.hessian = Memory(np.zeros(int((sizes**2).sum())), begins_of(sizes**2)[:, None])
        self.gap_size = int(dynamics.sum())
        begins = np.stack([np.append(begins_of(dynamics), 0), self.gap_size + begins_of(rows)], axis=1)
        self.constraints = Memory(np.zeros(self.gap_size + int(rows.sum())), begins)
        place = np.arange(self.unknowns) - begins_of(sizes)[layout.stage_of_unknown]
        begins, size = self.hessian.begins[layout.stage_of_unknown, 0], sizes[layout.stage_of_unknown]
        self._diagonal = begins + place * (size + 1)
        self._hessian = self._hessian_assembly(assembly, sizes, place)
        self._jacobian = self._jacobian_assembly(assembly, sizes, place)

    def _hessian_assembly(self, assembly: Assembly, sizes: Indices, place: Indices) -> StageAssembly:
        kind, first = unique_rows(assembly.structure_keys(rows=False))
        sums = assembly.hessian_of(first)
        stage = assembly.layout.stage_of_unknown[sums.rows]
        return StageAssembly(sums, Entries(stage, place[sums.columns] * sizes[stage] + place[sums.rows]), kind)

    def _jacobian_assembly(self, assembly: Assembly, sizes: Indices, place: Indices) -> StageAssembly:
        """The Jacobian: of the gaps with the other sign and without the next states, of the rows as it is."""
        layout = assembly.layout
        kind, first = unique_rows(assembly.structure_keys(rows=True))
        sums = assembly.jacobian_of(first)
        number, stage_of, is_row = (np.zeros(layout.constraints, dtype=np.int64) for _ in range(3))
        number[layout.gap_index] = np.arange(self.states)
        number[layout.row_index] = np.arange(self.rows) - begins_of(layout.stage_rows)[layout.rows.node]
        stage_of[layout.gap_index] = np.arange(layout.intervals)[:, None]
        stage_of[layout.row_index] = layout.rows.node
        is_row[layout.row_index] = 1
        own = np.flatnonzero(layout.stage_of_unknown[sums.columns] == stage_of[sums.rows])
        constraint, column = sums.rows[own], place[sums.columns[own]]
        stage, family = stage_of[constraint], is_row[constraint]
        as_row = number[constraint] * sizes[stage] + column
        as_gap = column * self.states + number[constraint]
        entries = Entries(stage, np.where(family == 1, as_row, as_gap), family)
        return StageAssembly(sums.choose(own, np.where(family == 1, 1.0, -1.0)), entries, kind)

    def write(self, linear: Array, curved: Array) -> bool:
        """Take the derivatives at a point, as `Evaluation` returns them; return whether all are finite."""
        finite = self._jacobian.write(linear, self.constraints)
        return self._hessian.write(curved, self.hessian) and finite

    def write_identity(self, linear: Array) -> bool:
        """Take the Jacobian alone, with ones in the place of the Hessian; return whether all are finite."""
        self.clear()
        self.hessian.doubles[self._diagonal] = 1.0
        return self._jacobian.write(linear, self.constraints)

    def clear(self) -> None:
        """Write zeros to the matrices of second derivatives, which keep what no second derivative is written to."""
        self.hessian.doubles[:] = 0.0


def begins_of(sizes: Indices) -> Indices:
    """Return where blocks of these sizes begin that lie one behind the other."""
    return np.cumsum(sizes) - sizes
