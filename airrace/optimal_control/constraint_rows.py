"""The constraint rows of a program besides the gaps, and the samples of observations that some of them limit.

A limit is stated once and holds at many nodes; a row is a limit at one of them.
"""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from airrace.optimal_control.problem import Problem
from airrace.quantities import Interval, Quantity
from airrace.records import record
from airrace.system import Observation
from airrace.trajectory import Array, Indices


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
    """Limits that hold at each of some nodes; `source` as of a row."""

    nodes: Indices
    source: int
    limits: Sequence[LimitedQuantity]


@record
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
        return np.array([one.component for one in self.limits], dtype=np.int64)[self.number]

    @cached_property
    def scale(self) -> Array:
        """The scale of what is limited (SI), shape (n,)."""
        return np.array([one.quantity.scale for one in self.limits])[self.number]

    @property
    def bounds(self) -> tuple[Array, Array]:
        """The lower and upper bounds (SI), each of shape (n,)."""
        ends = np.array([(one.bounds.lower, one.bounds.upper) for one in self.limits]).reshape(-1, 2)[self.number]
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
    known = [LimitedQuantity(place, one, ranges.get(one.name, Interval())) for place, one in enumerate(quantities)]
    return [one for one in known if one.bounds.bounded]


def rows_of(blocks: Sequence[RowBlock]) -> ConstraintRows:
    """Return the rows of all blocks, node by node; those of one node in the order of the blocks."""
    first_of: dict[int, int] = {}  # the first number of limits that blocks share
    limits: list[LimitedQuantity] = []
    rows = [np.zeros((3, 0), dtype=np.int64)]
    for block in (one for one in blocks if one.limits):
        if id(block.limits) not in first_of:
            first_of[id(block.limits)] = len(limits)
            limits += block.limits
        count, nodes = len(block.limits), len(block.nodes)
        numbers = np.tile(first_of[id(block.limits)] + np.arange(count), nodes)
        rows.append(np.stack([np.repeat(block.nodes, count), np.full(count * nodes, block.source), numbers]))
    whole = np.concatenate(rows, axis=1)
    node, source, number = np.ascontiguousarray(whole[:, np.argsort(whole[0], kind="stable")])
    return ConstraintRows(node, source, number, limits)


@record
class OutputSample:
    """A look at an observation at one node.

    Attributes:
        node: where.
        name: of the boundary, or of phase and watch, for people.
        bounds: ranges by name of the observation's quantities.
        offset: place of the observation's parameters among those of all output samples; a watch shares them.
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
    """Return all output samples, and the parameters that they share: at the boundaries in order, then watch by watch.

    Args:
        problem: whose boundaries and watches observe.
        jump_at: number of the jump at each node that has one.
    """
    samples: list[OutputSample] = []
    values: list[tuple[float, ...]] = []
    offset = 0
    for node, boundary in zip(problem.first_node, problem.boundaries, strict=True):
        if (seen := boundary.observation) is not None:
            samples.append(OutputSample(node, boundary.name, seen, boundary.bounds, offset, jump_at.get(node)))
            values.append(boundary.values)
            offset += len(boundary.values)
    for index, phase in enumerate(problem.phases):
        start, end = problem.first_node[index], problem.first_node[index + 1]
        before = problem.phases[index - 1].watches if index and start not in jump_at else ()
        for watch in phase.watches:
            # Where a watch goes on from the phase before, the node between the two has its rows already.
            goes_on = any(watch.same_conditions(other) for other in before)
            name = f"{phase.name}, {watch.name}"
            nodes = range(start + goes_on, end + 1)
            if watch.at is not None:
                nodes = (start + phase.nearest_node(watch.at),)
            for node in nodes:
                jump = jump_at.get(node) if node == end else None
                samples.append(OutputSample(node, name, watch.observation, watch.bounds, offset, jump))
            values.append(watch.values)
            offset += len(watch.values)
    return samples, values
