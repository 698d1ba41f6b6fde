"""The constraint rows of a program besides the gaps, and the samples of observations that some of them limit.

A limit is stated once and holds at many nodes; a row is a limit at one of them.
"""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from airrace.optimal_control.problem import Boundary, Problem
from airrace.quantities import Interval, Quantity
from airrace.records import record
from airrace.system import Observation
from airrace.trajectory import Array

Indices = NDArray[np.int64]


class Limit(NamedTuple):
    """A quantity with its range (SI), and its place among those that are observed together."""

    component: int
    quantity: Quantity
    bounds: Interval


class Row(NamedTuple):
    """A constraint that is not a gap: its node, what it limits, its range and scale (SI).

    `source` is the path (-1) from the output sample with that number; `component` is the place within its quantities.
    """

    node: int
    source: int
    component: int
    quantity: Quantity
    bounds: Interval


class Block(NamedTuple):
    """Limits that hold at each of some nodes; `source` as of a row."""

    nodes: Indices
    source: int
    limits: Sequence[Limit]


@record
class Rows:
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
    limits: Sequence[Limit]

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

    def row(self, index: int) -> Row:
        """Return one row."""
        return Row(int(self.node[index]), int(self.source[index]), *self.limits[int(self.number[index])])

    def one_by_one(self) -> list[Row]:
        """Return all rows."""
        places = zip(self.node.tolist(), self.source.tolist(), self.number.tolist(), strict=True)
        return [Row(node, source, *self.limits[number]) for node, source, number in places]


def limits_on(quantities: Sequence[Quantity], ranges: Mapping[str, Interval]) -> list[Limit]:
    """Return the limits on those of the quantities that have a bounded range."""
    known = [Limit(component, one, ranges.get(one.name, Interval())) for component, one in enumerate(quantities)]
    return [one for one in known if one.bounds.bounded]


def rows_of(blocks: Sequence[Block]) -> Rows:
    """Return the rows of all blocks, node by node; those of one node in the order of the blocks."""
    stated: dict[int, int] = {}  # the first number of limits that blocks share
    limits: list[Limit] = []
    nodes: list[Indices] = []
    sources: list[Indices] = []
    numbers: list[Indices] = []
    for block in (one for one in blocks if one.limits):
        if id(block.limits) not in stated:
            stated[id(block.limits)] = len(limits)
            limits += block.limits
        first, count = stated[id(block.limits)], len(block.limits)
        nodes.append(np.repeat(block.nodes, count))
        sources.append(np.full(len(nodes[-1]), block.source))
        numbers.append(np.tile(np.arange(first, first + count), len(block.nodes)))
    if not nodes:
        nothing = np.zeros(0, dtype=np.int64)
        return Rows(nothing, nothing, nothing, ())
    node = np.concatenate(nodes)
    order = np.argsort(node, kind="stable")
    return Rows(node[order], np.concatenate(sources)[order], np.concatenate(numbers)[order], limits)


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


def boundaries_of(problem: Problem) -> list[tuple[int, Boundary]]:
    """Return (node, boundary) of the start and of every phase's end."""
    ends = [(node, phase.end) for node, phase in zip(problem.first_node[1:], problem.phases, strict=True)]
    return [(0, problem.start), *ends]


def output_samples_of(
    problem: Problem, jump_at: Mapping[int, int]
) -> tuple[list[OutputSample], list[tuple[float, ...]]]:
    """Return all output samples, and the parameters that they share: at the boundaries in order, then watch by watch.

    Args:
        problem: whose boundaries and watches observe.
        jump_at: number of the jump at each node that has one.
    """
    output_samples: list[OutputSample] = []
    values: list[tuple[float, ...]] = []
    offset = 0
    for node, boundary in boundaries_of(problem):
        if boundary.observation is not None:
            before = jump_at.get(node)
            output_samples.append(
                OutputSample(node, boundary.name, boundary.observation, boundary.bounds, offset, before)
            )
            values.append(boundary.values)
            offset += len(boundary.values)
    for index, phase in enumerate(problem.phases):
        start, end = problem.first_node[index], problem.first_node[index + 1]
        watched_before = problem.phases[index - 1].watches if index and start not in jump_at else ()
        for watch in phase.watches:
            # Where a watch goes on from the phase before, the node between the two has its rows already.
            begun = any(watch.same_conditions(other) for other in watched_before)
            name = f"{phase.name}, {watch.name}"
            for node in range(start + (1 if begun else 0), end + 1):
                before = jump_at.get(node) if node == end else None
                output_samples.append(OutputSample(node, name, watch.observation, watch.bounds, offset, before))
            values.append(watch.values)
            offset += len(watch.values)
    return output_samples, values
