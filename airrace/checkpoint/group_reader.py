"""A group of a tree that nobody vouches for, asked for its members by name and kind."""

from collections.abc import Mapping
from typing import Never

import numpy as np
from numpy.typing import NDArray

from airrace.checkpoint.tree import Column, Group, Node, Numbers, Series, Table
from airrace.errors import CheckpointError
from airrace.records import record
from airrace.trajectory import Array


@record
class Place:
    """A group of a tree and its path, which every message names."""

    path: str
    node: Group

    def expecting(self, *names: str, optional: tuple[str, ...] = ()) -> "Place":
        """Return this place if its members are exactly `names`, with or without the optional ones.

        Raises:
            CheckpointError: a member is missing or unknown.
        """
        missing = [name for name in names if name not in self.node.members]
        unknown = [name for name in self.node.members if name not in (*names, *optional)]
        if missing or unknown:
            problem = f"{missing[0]!r} is missing" if missing else f"{unknown[0]!r} is unknown"
            raise CheckpointError(f"{self.path or '/'}: {problem}")
        return self

    def group(self, name: str) -> "Place":
        node = self.node.members[name]
        return Place(f"{self.path}/{name}", node) if isinstance(node, Group) else self._wrong(name, "a group")

    def text(self, name: str) -> str:
        node = self.node.members[name]
        return node if isinstance(node, str) else self._wrong(name, "a text")

    def table(self, name: str) -> Table:
        node = self.node.members[name]
        return node if isinstance(node, Table) else self._wrong(name, "a table")

    def texts(self, name: str, column: str) -> tuple[str, ...]:
        """Return the entries of a table that has one column of texts.

        Raises:
            CheckpointError: the member is not such a table.
        """
        columns: Mapping[str, Column] = self.table(name).columns
        entries = columns.get(column)
        return entries if isinstance(entries, tuple) and len(columns) == 1 else self._wrong(name, f"a list: {column}")

    def series(self, name: str) -> Series:
        node: Node = self.node.members[name]
        return node if isinstance(node, Series) else self._wrong(name, "a series of numbers")

    def floats(self, name: str) -> Array:
        values: Numbers = self.series(name).values
        return values.astype(np.float64) if values.dtype == np.float64 else self._wrong(name, "a series of floats")

    def integers(self, name: str) -> NDArray[np.int64]:
        values: Numbers = self.series(name).values
        return values.astype(np.int64) if values.dtype == np.int64 else self._wrong(name, "a series of integers")

    def _wrong(self, name: str, kind: str) -> Never:
        raise CheckpointError(f"{self.path}/{name} is not {kind}")
