"""The layout of the nonlinear program: where every unknown and every constraint of a problem sits in it.

The order keeps the stage structure that a Riccati-based solver needs: unknowns `x_0 u_0 x_1 u_1 ... x_N`, constraints
per stage first the gap to the next, then the stage's own. The stage's x are the states and the phase's duration T (a
state with zero rate); the last interval of a phase has one more u, the duration of the next phase. A limit is stated
once and holds at many nodes; a row is a limit at one of them, of the path or of a sample of an observation.

Unknowns and constraints are scaled here, once, by their quantities' scales; everything above and below is in SI.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from airrace.optimal_control.problem import Iterate, Problem, require_valid
from airrace.optimal_control.quantities import Interval, Quantity
from airrace.optimal_control.system import Observation
from airrace.optimal_control.trajectory import Array, Indices


class LimitedQuantity(NamedTuple):
    """A quantity with its range (SI), and its place among those that are observed together."""

    component: int
    quantity: Quantity
    bounds: Interval


class ConstraintRow(NamedTuple):
    """A constraint that is not a gap: its node, what it limits, its range and scale (SI).

    `source` is the path (-1) or the number of an output sample; `component` is the place within its quantities.
    """

    node: int
    source: int
    component: int
    quantity: Quantity
    bounds: Interval


class RowBlock(NamedTuple):
    """Limits that hold at each of some nodes; `sources` as of a row, one for each node."""

    nodes: Indices
    sources: Indices
    limits: Sequence[LimitedQuantity]


@dataclass(frozen=True, eq=False)
class ConstraintRows:
    """All n rows of a program, node by node.

    Attributes:
        node: at which node, shape (n,).
        source: where they come from, as of a row; shape (n,).
        number: of their limits among all limits, shape (n,).
        limits: each of them once.
    """

    node: Indices
    source: Indices
    number: Indices
    limits: Sequence[LimitedQuantity]

    @cached_property
    def component(self) -> Indices:
        """The place of what is limited within the quantities of its source, shape (n,)."""
        return np.array([limit.component for limit in self.limits], dtype=np.int64)[self.number]

    @cached_property
    def scale(self) -> Array:
        """The scale of what is limited (SI), shape (n,)."""
        return np.array([limit.quantity.scale for limit in self.limits])[self.number]

    @property
    def bounds(self) -> tuple[Array, Array]:
        """The lower and upper bounds (SI), each of shape (n,)."""
        ends = np.array([(limit.bounds.lower, limit.bounds.upper) for limit in self.limits]).reshape(-1, 2)[self.number]
        return ends[:, 0], ends[:, 1]

    @property
    def structure(self) -> bytes:
        """All that derivatives depend on: where the rows are and what they limit, but not to what range."""
        return np.concatenate([self.node, self.source, self.component]).tobytes()

    def row(self, index: int) -> ConstraintRow:
        """Return one row."""
        return ConstraintRow(int(self.node[index]), int(self.source[index]), *self.limits[int(self.number[index])])


def limits_on(quantities: Sequence[Quantity], ranges: Mapping[str, Interval]) -> list[LimitedQuantity]:
    """Return the limits on those of the quantities that have a bounded range."""
    limits = [
        LimitedQuantity(place, quantity, ranges.get(quantity.name, Interval()))
        for place, quantity in enumerate(quantities)
    ]
    return [limit for limit in limits if limit.bounds.constrained]


def rows_of(blocks: Sequence[RowBlock]) -> ConstraintRows:
    """Return the rows of all blocks, node by node; those of one node in the order of the blocks."""
    limits: list[LimitedQuantity] = []
    rows = [np.zeros((3, 0), dtype=np.int64)]
    for block in (block for block in blocks if block.limits):
        count = len(block.limits)
        numbers = np.tile(len(limits) + np.arange(count), len(block.nodes))
        rows.append(np.stack([np.repeat(block.nodes, count), np.repeat(block.sources, count), numbers]))
        limits += block.limits
    table = np.concatenate(rows, axis=1)
    node, source, number = np.ascontiguousarray(table[:, np.argsort(table[0], kind="stable")])
    return ConstraintRows(node, source, number, limits)


@dataclass(frozen=True)
class OutputSample:
    """A look at an observation at one node.

    Attributes:
        node: where.
        name: of the boundary, or of phase and path constraint, for messages.
        bounds: ranges by name of the observation's quantities.
        offset: place of the observation's parameters among those of all output samples; a path constraint shares them.
        jump: number, among the jumps of the problem, of that which follows at this node and is not seen yet; None
            where there is none, and where the phase after it is looked at.
    """

    node: int
    name: str
    observation: Observation
    bounds: Mapping[str, Interval]
    offset: int
    jump: int | None = None


def output_samples_of(
    problem: Problem, jump_at: Mapping[int, int]
) -> tuple[list[OutputSample], list[tuple[float, ...]]]:
    """Return all output samples, boundaries before path constraints, and the parameters that they share.

    Args:
        problem: whose boundaries and path constraints observe.
        jump_at: number of the jump at each node that has one.
    """
    samples: list[OutputSample] = []
    values: list[tuple[float, ...]] = []
    offset = 0
    for node, boundary in zip(problem.first_node, problem.boundaries, strict=True):
        if (observation := boundary.observation) is not None:
            samples.append(OutputSample(node, boundary.name, observation, boundary.bounds, offset, jump_at.get(node)))
            values.append(boundary.values)
            offset += len(boundary.values)
    for index, phase in enumerate(problem.phases):
        start, end = problem.first_node[index], problem.first_node[index + 1]
        before = problem.phases[index - 1].path_constraints if index and start not in jump_at else ()
        for constraint in phase.path_constraints:
            # Where a path constraint goes on from the phase before, the node between the two has its rows already.
            continues = any(constraint.same_conditions(previous) for previous in before)
            name = f"{phase.name}, {constraint.name}"
            nodes = range(start + continues, end + 1)
            if constraint.at is not None:
                nodes = (start + phase.nearest_node(constraint.at),)
            for node in nodes:
                jump = jump_at.get(node) if node == end else None
                samples.append(OutputSample(node, name, constraint.observation, constraint.bounds, offset, jump))
            values.append(constraint.values)
            offset += len(constraint.values)
    return samples, values


class Layout:
    """The index arrays of one problem (N intervals, n_x states, n_u controls, n phases, n_w unknowns, n_g constraints).

    Attributes:
        problem: whose layout this is.
        n_x, n_u, intervals: the numbers of states, controls and intervals.
        first_node: the node at which each phase begins and, last, the final node; shape (n + 1,).
        phase_of_interval: the phase of each interval, shape (N,).
        fractions: the share of its phase's duration that each interval takes, shape (N,).
        stage_states, stage_controls: the numbers of stage states and controls per stage, shape (N + 1,).
        stage_of_unknown: the stage of each unknown, shape (n_w,).
        unknowns: the number of unknowns n_w.
        state_index: the places of the states, shape (N + 1, n_x).
        control_index: the places of the controls, shape (N, n_u).
        duration_index: the place of the phase's duration at each node, shape (N + 1,).
        duration_source: the place of what each interval hands on as duration to the next node, shape (N,).
        phase_durations: the place at which each phase's duration is chosen, shape (n,).
        interval_index: the places of (x, u, T) of each interval, shape (N, n_x + n_u + 1).
        scale: the scale of every unknown, shape (n_w,).
        jump_at: the number of the jump at each node that has one.
        output_samples: the observations: at the boundaries in order, then by path constraint and node.

    Raises:
        ValueError: the problem does not say what it seems to say, see `require_valid`.
    """

    def __init__(self, problem: Problem) -> None:
        require_valid(problem)
        states, controls = problem.system.states, problem.system.controls
        self.problem = problem
        self.n_x, self.n_u, self.intervals = len(states), len(controls), problem.intervals
        self.first_node: Indices = np.array(problem.first_node, dtype=np.int64)
        self.phase_of_interval: Indices = np.repeat(np.arange(len(problem.phases)), np.diff(self.first_node))
        self.fractions: Array = np.concatenate([np.asarray(phase.fractions) for phase in problem.phases])
        last = self.first_node[1:-1] - 1  # the last interval of every phase but the last
        self.stage_states: Indices = np.full(self.intervals + 1, self.n_x + 1)
        self.stage_controls: Indices = np.full(self.intervals + 1, self.n_u)
        self.stage_controls[last] += 1
        self.stage_controls[-1] = 0
        sizes = self.stage_states + self.stage_controls
        begins = np.cumsum(sizes) - sizes
        self.stage_of_unknown: Indices = np.repeat(np.arange(self.intervals + 1), sizes)
        self.unknowns = len(self.stage_of_unknown)
        self.state_index: Indices = begins[:, None] + np.arange(self.n_x)
        self.control_index: Indices = begins[:-1, None] + self.n_x + 1 + np.arange(self.n_u)
        self.duration_index: Indices = begins + self.n_x
        self.duration_source: Indices = self.duration_index[:-1].copy()
        self.duration_source[last] += self.n_u + 1
        self.phase_durations: Indices = np.append(self.duration_index[:1], self.duration_source[last])
        self.interval_index: Indices = np.hstack(
            [self.state_index[:-1], self.control_index, self.duration_index[:-1, None]]
        )
        self.scale = np.full(self.unknowns, problem.time_scale)
        self.scale[self.state_index] = [quantity.scale for quantity in states]
        self.scale[self.control_index] = [quantity.scale for quantity in controls]
        jumps = [node for node, phase in zip(problem.first_node[1:], problem.phases, strict=True) if phase.jump]
        self.jump_at = {node: number for number, node in enumerate(jumps)}
        self.output_samples, self._sample_values = output_samples_of(problem, self.jump_at)

    # constraints

    @cached_property
    def rows(self) -> ConstraintRows:
        """The constraints besides the gaps: at every node those of the path, then those of what is observed there."""
        blocks = self._path_blocks()
        # A path constraint has the same limits at all its nodes, whose samples follow one another.
        first = 0
        for _, group in itertools.groupby(
            self.output_samples, lambda sample: (id(sample.observation), id(sample.bounds))
        ):
            samples = list(group)
            nodes, numbers = np.array([sample.node for sample in samples]), first + np.arange(len(samples))
            limits = limits_on(samples[0].observation.quantities, samples[0].bounds)
            blocks.append(RowBlock(nodes, numbers, limits))
            first += len(samples)
        return rows_of(blocks)

    def _path_blocks(self) -> list[RowBlock]:
        """Return the limits on path quantities, and the nodes at which they hold.

        Those that depend on u have none at the last node. Where phases meet, those of both hold; after a jump, those of
        the phase that begins.
        """
        path, values = self.problem.system.path, self.problem.system.path_values
        ranges: list[dict[str, Interval]] = []
        for phase in self.problem.phases:
            ranges.append({quantity.name: narrow_range(quantity, phase.bounds) for quantity in path})
        blocks: list[RowBlock] = []
        for phase, (begin, end) in enumerate(itertools.pairwise(self.first_node.tolist())):
            meeting = phase > 0 and begin not in self.jump_at
            if meeting:
                common = {name: bounds.intersect(ranges[phase][name]) for name, bounds in ranges[phase - 1].items()}
                blocks.append(RowBlock(np.array([begin]), np.array([-1]), limits_on(path, common)))
            nodes = np.array(range(begin + meeting, end), dtype=np.int64)
            blocks.append(RowBlock(nodes, np.full(len(nodes), -1), limits_on(path, ranges[phase])))
        with_control = () if values is None else values.jac_sparsity(0, 1).get_triplet()[0]
        last = [limit for limit in limits_on(path, ranges[-1]) if limit.component not in with_control]
        return [*blocks, RowBlock(self.first_node[-1:], np.array([-1]), last)]

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
    def flat_rows(self) -> list[ConstraintRow]:
        """The rows one by one."""
        return [self.rows.row(index) for index in range(len(self.rows.node))]

    # values

    def pack(self, iterate: Iterate) -> Array:
        """Put the values of an iterate into the scaled unknowns, shape (n_w,).

        Raises:
            ValueError: the iterate belongs to another problem or another mesh, to judge by its shapes.
        """
        expected = {
            "durations": (len(self.problem.phases),),
            "state": (self.n_x, self.intervals + 1),
            "control": (self.n_u, self.intervals),
        }
        for name, shape in expected.items():  # numpy would silently repeat other arrays to these shapes
            actual = getattr(iterate, name).shape
            if actual != shape:
                raise ValueError(f"the iterate's {name} has the shape {actual}, the problem's {shape}")
        w = np.zeros(self.unknowns)
        w[self.state_index] = iterate.state.T
        w[self.control_index] = iterate.control.T
        w[self.duration_index] = iterate.durations[np.append(self.phase_of_interval, len(iterate.durations) - 1)]
        w[self.phase_durations] = iterate.durations
        return w / self.scale

    def unpack(self, w: Array) -> Iterate:
        """Return the iterate of scaled unknowns."""
        values = w * self.scale
        durations = values[self.duration_index[self.first_node[:-1]]]
        return Iterate(durations, values[self.state_index].T.copy(), values[self.control_index].T.copy())

    def unknown_bounds(self) -> tuple[Array, Array]:
        """Return the scaled lower and upper bounds of the unknowns, each (n_w,)."""
        lower = np.full(self.unknowns, -np.inf)
        upper = np.full(self.unknowns, np.inf)

        def narrow(places: Indices | int, bounds: Interval, change: float = 0.0) -> None:
            """Bound `x + change` where `bounds` is the range of x."""
            lower[places] = np.maximum(lower[places], bounds.lower + change)
            upper[places] = np.minimum(upper[places], bounds.upper + change)

        system, jumps = self.problem.system, self.problem.jumps
        for index, phase in enumerate(self.problem.phases):
            first, last = self.first_node[index], self.first_node[index + 1]
            for component, quantity in enumerate(system.states):
                bounds = narrow_range(quantity, phase.bounds)
                narrow(self.state_index[first:last, component], bounds)
                narrow(int(self.state_index[last, component]), bounds, float(jumps[component, index]))
            for component, quantity in enumerate(system.controls):
                narrow(self.control_index[first:last, component], narrow_range(quantity, phase.bounds))
            narrow(int(self.phase_durations[index]), phase.duration)
        number = {quantity.name: component for component, quantity in enumerate(system.states)}
        for index, (node, boundary) in enumerate(zip(self.first_node, self.problem.boundaries, strict=True)):
            for name, bounds in boundary.bounds.items():
                if name in number:
                    change = float(jumps[number[name], index - 1]) if index else 0.0
                    narrow(int(self.state_index[node, number[name]]), bounds, change)
        return lower / self.scale, upper / self.scale

    def constraint_bounds(self) -> tuple[Array, Array]:
        """Return the scaled lower and upper bounds of the constraints, each (n_g,).

        Gaps are zero, or the jump between phases.
        """
        lower, upper = np.zeros(self.constraints), np.zeros(self.constraints)
        ends, states = self.gap_index[self.first_node[1:] - 1, :-1], self.problem.system.states
        lower[ends] = upper[ends] = (self.problem.jumps / np.array([[quantity.scale] for quantity in states])).T
        rows_lower, rows_upper = self.rows.bounds
        lower[self.row_index], upper[self.row_index] = rows_lower / self.rows.scale, rows_upper / self.rows.scale
        return lower, upper

    def parameter_values(self) -> Array:
        """Return the parameters of the nonlinear program.

        They are the system's, the fractions, those of all samples, the jumps, those of the objective's observations.
        """
        jumps = [jump for jump, phase in zip(self.problem.jumps.T, self.problem.phases, strict=True) if phase.jump]
        objective = self.problem.objective.all_values
        return np.concatenate([self.problem.parameters, self.fractions, *self._sample_values, *jumps, objective])

    @property
    def jump_offset(self) -> int:
        """The place of the first jump among the parameters of the nonlinear program."""
        jumps = self.n_x * len(self.jump_at)
        return len(self.parameter_values()) - len(self.problem.objective.all_values) - jumps

    def describe(self, constraint: int) -> str:
        """Return a description of a constraint, for people."""
        stage = int(np.searchsorted(self._constraint_offset, constraint, side="right")) - 1
        phase = self.problem.phases[int(self.phase_of_interval[min(stage, self.intervals - 1)])]
        within = constraint - int(self._constraint_offset[stage])
        gaps = self.n_x + 1 if stage < self.intervals else 0
        if within < gaps:
            return f"{phase.name}: continuity"
        row = self.rows.row(int(np.searchsorted(self.rows.node, stage)) + within - gaps)
        place = phase.name if row.source < 0 else self.output_samples[row.source].name
        return f"{place}: {row.quantity.text or row.quantity.name}"


def narrow_range(quantity: Quantity, bounds: Mapping[str, Interval]) -> Interval:
    """Return a quantity's own range, narrowed by the entry of that name, if there is one."""
    return Interval(quantity.lower, quantity.upper).intersect(bounds.get(quantity.name, Interval()))
