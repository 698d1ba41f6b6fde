"""The layout of the nonlinear program: where every unknown and every constraint of a problem sits in it.

The order keeps the stage structure that a Riccati-based solver needs: unknowns `x_0 u_0 x_1 u_1 ... x_N`, constraints
per stage first the gap to the next, then the stage's own. The stage's x are the states and the phase's duration T (a
state with zero rate); the last interval of a phase has one more u, the duration of the next phase.

Unknowns and constraints are scaled here, once, by their quantities' scales; everything above and below is in SI.
"""

import itertools
from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np

from airrace.optimal_control.constraint_rows import (
    Block,
    Indices,
    Limit,
    OutputSample,
    Row,
    Rows,
    boundaries_of,
    limits_on,
    output_samples_of,
    rows_of,
)
from airrace.optimal_control.problem import Iterate, Problem, require_valid
from airrace.quantities import Interval, Quantity
from airrace.records import record
from airrace.trajectory import Array


@record
class Layout:
    """The index arrays of one problem (N intervals, n_x states, n_u controls, n phases)."""

    problem: Problem

    def __post_init__(self) -> None:
        """Refuse a problem that does not say what it seems to say.

        Raises:
            ValueError: see `require_valid`.
        """
        require_valid(self.problem)

    @cached_property
    def n_x(self) -> int:
        """The number of states."""
        return len(self.problem.system.states)

    @cached_property
    def n_u(self) -> int:
        """The number of controls."""
        return len(self.problem.system.controls)

    @cached_property
    def first_node(self) -> Indices:
        """The node at which each phase begins and, last, the final node; shape (n + 1,)."""
        return np.array(self.problem.first_node, dtype=np.int64)

    @cached_property
    def intervals(self) -> int:
        """The number of intervals N."""
        return self.problem.intervals

    @cached_property
    def phase_of_interval(self) -> Indices:
        """The phase of each interval, shape (N,)."""
        return np.repeat(np.arange(len(self.problem.phases)), np.diff(self.first_node))

    @cached_property
    def fractions(self) -> Array:
        """The share of its phase's duration that each interval takes, shape (N,)."""
        return np.concatenate([np.asarray(phase.fractions) for phase in self.problem.phases])

    # unknowns

    @cached_property
    def stage_states(self) -> Indices:
        """The number of stage states per stage, shape (N + 1,)."""
        return np.full(self.intervals + 1, self.n_x + 1)

    @cached_property
    def stage_controls(self) -> Indices:
        """The number of stage controls per stage, shape (N + 1,)."""
        count = np.full(self.intervals + 1, self.n_u)
        count[self.first_node[1:-1] - 1] += 1
        count[-1] = 0
        return count

    @cached_property
    def _stage_offset(self) -> Indices:
        return np.concatenate([[0], np.cumsum(self.stage_states + self.stage_controls)])

    @cached_property
    def stage_of_unknown(self) -> Indices:
        """The stage of each unknown, shape (n_w,)."""
        sizes = np.diff(self._stage_offset)
        return np.repeat(np.arange(len(sizes)), sizes)

    @property
    def unknowns(self) -> int:
        """The number of unknowns n_w."""
        return int(self._stage_offset[-1])

    @cached_property
    def state_index(self) -> Indices:
        """The places of the states, shape (N + 1, n_x)."""
        return self._stage_offset[:-1, None] + np.arange(self.n_x)

    @cached_property
    def duration_index(self) -> Indices:
        """The place of the phase's duration at each node, shape (N + 1,)."""
        return self._stage_offset[:-1] + self.n_x

    @cached_property
    def control_index(self) -> Indices:
        """The places of the controls, shape (N, n_u)."""
        return self._stage_offset[:-2, None] + self.n_x + 1 + np.arange(self.n_u)

    @cached_property
    def duration_source(self) -> Indices:
        """The place of the value that each interval hands on as duration to the next node, shape (N,)."""
        source = self.duration_index[:-1].copy()
        last = self.first_node[1:-1] - 1
        source[last] = self.control_index[last, -1] + 1 if self.n_u else self.duration_index[last] + 1
        return source

    @cached_property
    def interval_index(self) -> Indices:
        """The places of (x, u, T) of each interval, shape (N, n_x + n_u + 1)."""
        return np.hstack([self.state_index[:-1], self.control_index, self.duration_index[:-1, None]])

    @cached_property
    def scale(self) -> Array:
        """The scale of every unknown, shape (n_w,)."""
        system = self.problem.system
        scale = np.full(self.unknowns, self.problem.time_scale)
        scale[self.state_index] = [quantity.scale for quantity in system.states]
        scale[self.control_index] = [quantity.scale for quantity in system.controls]
        return scale

    # constraints

    @cached_property
    def jump_at(self) -> dict[int, int]:
        """The number of the jump at each node that has one."""
        nodes = [int(node) for node, phase in zip(self.first_node[1:], self.problem.phases, strict=True) if phase.jump]
        return {node: number for number, node in enumerate(nodes)}

    @cached_property
    def _output_samples(self) -> tuple[list[OutputSample], list[tuple[float, ...]]]:
        return output_samples_of(self.problem, self.jump_at)

    @property
    def output_samples(self) -> list[OutputSample]:
        """The observations: at the boundaries in order, then along the phases, watch by watch and node by node."""
        return self._output_samples[0]

    @cached_property
    def rows(self) -> Rows:
        """The constraints besides the gaps: at every node those of the path, then those of what is observed there."""
        known: dict[tuple[int, int], Sequence[Limit]] = {}  # what limits a watch is the same at all of its nodes
        blocks = self._path_blocks()
        for number, output_sample in enumerate(self.output_samples):
            shared = id(output_sample.observation), id(output_sample.bounds)
            if shared not in known:
                known[shared] = limits_on(output_sample.observation.quantities, output_sample.bounds)
            blocks.append(Block(np.array([output_sample.node]), number, known[shared]))
        return rows_of(blocks)

    def _path_blocks(self) -> list[Block]:
        """Return the limits on path quantities, and the nodes at which they hold.

        Those that depend on u have none at the last node. Where phases meet, those of both hold; after a jump, those of
        the phase that begins.
        """
        path = self.problem.system.path
        ranges = [{one.name: narrow_range(one, phase.bounds) for one in path} for phase in self.problem.phases]
        blocks: list[Block] = []
        for phase, (begin, end) in enumerate(itertools.pairwise(self.first_node.tolist())):
            meeting = phase > 0 and begin not in self.jump_at
            if meeting:
                both = {name: one.intersect(ranges[phase][name]) for name, one in ranges[phase - 1].items()}
                blocks.append(Block(np.array([begin]), -1, limits_on(path, both)))
            blocks.append(Block(np.arange(begin + meeting, end), -1, limits_on(path, ranges[phase])))
        with_control = self._components_with_control()
        last = [one for one in limits_on(path, ranges[-1]) if one.component not in with_control]
        return [*blocks, Block(self.first_node[-1:], -1, last)]

    def _components_with_control(self) -> list[int]:
        values = self.problem.system.path_values
        if values is None:
            return []
        rows = values.jac_sparsity(0, 1).get_triplet()[0]
        return sorted(set(rows))

    @cached_property
    def stage_rows(self) -> Indices:
        """The number of constraints besides the gap per stage, shape (N + 1,)."""
        return np.bincount(self.rows.node, minlength=self.intervals + 1)

    @cached_property
    def _constraint_offset(self) -> Indices:
        gaps = np.full(self.intervals + 1, self.n_x + 1)
        gaps[-1] = 0
        return np.concatenate([[0], np.cumsum(gaps + self.stage_rows)])

    @property
    def constraints(self) -> int:
        """The number of constraints n_g."""
        return int(self._constraint_offset[-1])

    @cached_property
    def gap_index(self) -> Indices:
        """The places of the gaps of (x, T), shape (N, n_x + 1)."""
        return self._constraint_offset[:-2, None] + np.arange(self.n_x + 1)

    @cached_property
    def row_index(self) -> Indices:
        """The places of the rows among the constraints, in their order."""
        before = np.cumsum(self.stage_rows)
        return np.arange(len(self.rows.node)) + (self._constraint_offset[1:] - before)[self.rows.node]

    @cached_property
    def flat_rows(self) -> list[Row]:
        """The rows one by one."""
        return self.rows.one_by_one()

    # values

    def pack(self, iterate: Iterate) -> Array:
        """Put the values of an iterate into the scaled unknowns, shape (n_w,).

        Raises:
            ValueError: the iterate belongs to another problem or another mesh, to judge by its shapes.
        """
        self._require_shapes(iterate)
        w = np.zeros(self.unknowns)
        w[self.state_index] = iterate.state.T
        w[self.control_index] = iterate.control.T
        phase = np.append(self.phase_of_interval, len(self.problem.phases) - 1)
        w[self.duration_index] = iterate.durations[phase]
        w[self.duration_source[self.first_node[1:-1] - 1]] = iterate.durations[1:]
        return w / self.scale

    def _require_shapes(self, iterate: Iterate) -> None:
        """Refuse arrays that numpy would silently repeat to the shape that is needed."""
        expected = {
            "durations": (len(self.problem.phases),),
            "state": (self.n_x, self.intervals + 1),
            "control": (self.n_u, self.intervals),
        }
        for name, shape in expected.items():
            found = getattr(iterate, name).shape
            if found != shape:
                raise ValueError(f"the iterate's {name} has the shape {found}, the problem's {shape}")

    def unpack(self, w: Array) -> Iterate:
        """Return the iterate of scaled unknowns."""
        values = w * self.scale
        durations = values[self.duration_index[self.first_node[:-1]]]
        return Iterate(durations, values[self.state_index].T.copy(), values[self.control_index].T.copy())

    def unknown_bounds(self) -> tuple[Array, Array]:
        """Return the scaled lower and upper bounds of the unknowns, each (n_w,)."""
        lower = np.full(self.unknowns, -np.inf)
        upper = np.full(self.unknowns, np.inf)

        def narrow(places: Indices | int, bounds: Interval) -> None:
            lower[places] = np.maximum(lower[places], bounds.lower)
            upper[places] = np.minimum(upper[places], bounds.upper)

        system, jumps = self.problem.system, self.problem.jumps
        for index, phase in enumerate(self.problem.phases):
            first, last = self.first_node[index], self.first_node[index + 1]
            for component, quantity in enumerate(system.states):
                bounds = narrow_range(quantity, phase.bounds)
                narrow(self.state_index[first : last if phase.jump else last + 1, component], bounds)
                if phase.jump:
                    narrow(int(self.state_index[last, component]), shift_range(bounds, float(jumps[component, index])))
            for component, quantity in enumerate(system.controls):
                narrow(self.control_index[first:last, component], narrow_range(quantity, phase.bounds))
            place = self.duration_index[0] if index == 0 else self.duration_source[first - 1]
            narrow(int(place), phase.duration)
        names = [quantity.name for quantity in system.states]
        for node, boundary in boundaries_of(self.problem):
            for name, bounds in boundary.bounds.items():
                if name in names:
                    component = names.index(name)
                    change = float(jumps[component, self._phase_before(node)]) if node else 0.0
                    narrow(int(self.state_index[node, component]), shift_range(bounds, change))
        return lower / self.scale, upper / self.scale

    def constraint_bounds(self) -> tuple[Array, Array]:
        """Return the scaled lower and upper bounds of the constraints, each (n_g,).

        Gaps are zero, or the jump between phases.
        """
        lower, upper = np.zeros(self.constraints), np.zeros(self.constraints)
        ends, states = self.gap_index[self.first_node[1:] - 1, :-1], self.problem.system.states
        lower[ends] = upper[ends] = (self.problem.jumps / np.array([[one.scale] for one in states])).T
        rows_lower, rows_upper = self.rows.bounds
        lower[self.row_index], upper[self.row_index] = rows_lower / self.rows.scale, rows_upper / self.rows.scale
        return lower, upper

    def parameter_values(self) -> Array:
        """Return the parameters of the nonlinear program.

        They are the system's, the fractions, those of all samples, the jumps, those of the objective's observation.
        """
        jumps = [self.problem.jumps[:, self._phase_before(node)] for node in self.jump_at]
        parts = [
            self.problem.parameters,
            self.fractions,
            *self._output_samples[1],
            *jumps,
            self.problem.objective.values,
        ]
        return np.concatenate(parts)

    @property
    def jump_offset(self) -> int:
        """The place of the first jump among the parameters of the nonlinear program."""
        jumps = self.n_x * len(self.jump_at)
        return len(self.parameter_values()) - len(self.problem.objective.values) - jumps

    def _phase_before(self, node: int) -> int:
        """Return the phase that ends at a node or continues through it; not for the first node."""
        return int(self.phase_of_interval[node - 1])

    def describe(self, constraint: int) -> str:
        """Return a description of a constraint, for people."""
        stage = int(np.searchsorted(self._constraint_offset, constraint, side="right")) - 1
        phase = self.problem.phases[int(self.phase_of_interval[min(stage, self.intervals - 1)])]
        within = constraint - int(self._constraint_offset[stage])
        gaps = self.n_x + 1 if stage < self.intervals else 0
        if within < gaps:
            return f"{phase.name}: continuity of the flight"
        row = self.rows.row(int(np.searchsorted(self.rows.node, stage)) + within - gaps)
        place = phase.name if row.source < 0 else self.output_samples[row.source].name
        return f"{place}: {row.quantity.text or row.quantity.name}"


def shift_range(bounds: Interval, change: float) -> Interval:
    """Return the range of `x + change` where `bounds` is that of x."""
    return Interval(bounds.lower + change, bounds.upper + change) if change else bounds


def narrow_range(quantity: Quantity, bounds: Mapping[str, Interval]) -> Interval:
    """Return a quantity's own range, narrowed by the entry of that name, if there is one."""
    return Interval(quantity.lower, quantity.upper).intersect(bounds.get(quantity.name, Interval()))
