"""The rows of a program: its constraints besides the gaps, one by one for people and as arrays for the rest.

A limit is stated once and holds at many nodes; a row is a limit at one of them.
"""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from airrace.quantities import Interval, Quantity
from airrace.records import record
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
