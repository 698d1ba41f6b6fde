"""Reading of a tree that nobody vouches for: members by name and kind, and numbers that a flight can have."""

from collections.abc import Mapping
from typing import Never

import numpy as np
from numpy.typing import NDArray

from airrace.checkpoint.hdf5 import Column, Group, Node, Numbers, R, Series, StoredTable, rows_of
from airrace.errors import CheckpointError
from airrace.procedure.result import StageResult
from airrace.records import record
from airrace.trajectory import Array


@record
class GroupReader:
    """A group of a tree and its path, which every message names."""

    path: str
    node: Group

    def expecting(self, *names: str, optional: tuple[str, ...] = ()) -> "GroupReader":
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

    def group(self, name: str) -> "GroupReader":
        node = self.node.members[name]
        return GroupReader(f"{self.path}/{name}", node) if isinstance(node, Group) else self._wrong(name, "a group")

    def text(self, name: str) -> str:
        node = self.node.members[name]
        return node if isinstance(node, str) else self._wrong(name, "a text")

    def table(self, name: str) -> StoredTable:
        node = self.node.members[name]
        return node if isinstance(node, StoredTable) else self._wrong(name, "a table")

    def rows(self, name: str, record: type[R]) -> tuple[R, ...]:
        """Return the records of a table.

        Raises:
            CheckpointError: the member is no table, or its columns are not the fields of such records.
        """
        return rows_of(record, self.table(name), f"{self.path}/{name}")

    def row(self, name: str, record: type[R]) -> R:
        """Return the record of a table of one row; errors as of `rows`, and if there are more."""
        rows = self.rows(name, record)
        if len(rows) != 1:
            raise CheckpointError(f"{self.path}/{name}: {len(rows)} rows instead of one")
        return rows[0]

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


ROUNDED = 1e-9
"""The largest difference between the durations of the phases and the times of their nodes, as a fraction of the race
time: both are sums of the same numbers in another order."""

LARGEST = 1e30
"""The largest magnitude of a number of a flight, in SI units.

No quantity of a flight comes near it, and products of a few such numbers still are finite.
"""
QUATERNION = ("q0", "q1", "q2", "q3")
LENGTH_ERROR = 0.1
"""The largest distance of the length of an attitude's quaternion from 1; a flight keeps it at 1 but for rounding."""


def ensure_possible(result: StageResult, path: str) -> None:
    """Refuse a stage whose flight no aircraft can fly.

    Where no flight was found the numbers are those at which the solver gave up, and anything goes.

    Raises:
        CheckpointError: histories, times, multipliers or splits are not finite or larger than `LARGEST`; time runs
            backwards, does not begin at 0, or does not pass as the durations of the phases have it; a quaternion is
            no attitude.
    """
    if not result.is_flight:
        return
    trajectory = result.trajectory
    for name, values in (
        ("durations", trajectory.durations),
        ("time", trajectory.time),
        ("states", trajectory.state),
        ("controls", trajectory.control),
        ("constraint_multipliers", result.constraint_multipliers),
        ("bound_multipliers", result.bound_multipliers),
    ):
        ensure_sizes(values, f"{path}/{name}")
    numbers = [[value for value in vars(split).values() if isinstance(value, float)] for split in result.splits]
    ensure_sizes(np.array(numbers), f"{path}/splits")
    if not (trajectory.durations > 0.0).all():
        raise CheckpointError(f"{path}/durations: a phase takes no time")
    if trajectory.time[0] != 0.0 or not (np.diff(trajectory.time) > 0.0).all():
        raise CheckpointError(f"{path}/time: does not run forwards from 0")
    passed: Array = np.diff(trajectory.time[trajectory.first_node])
    if not (np.abs(passed - trajectory.durations) <= ROUNDED * trajectory.race_time).all():
        raise CheckpointError(f"{path}/time: does not pass as the durations of the phases have it")
    rows = {one.name: values for one, values in zip(trajectory.states, trajectory.state, strict=True)}
    ensure_attitudes(rows, f"{path}/states")


def ensure_sizes(values: Array, path: str) -> None:
    """Refuse numbers that nothing can be calculated with.

    Raises:
        CheckpointError: one of them is not finite, or larger than `LARGEST`.
    """
    if not np.isfinite(values).all():
        raise CheckpointError(f"{path}: holds numbers that are not finite")
    if (np.abs(values) > LARGEST).any():
        raise CheckpointError(f"{path}: holds numbers larger than {LARGEST:g}")


def ensure_attitudes(histories: Mapping[str, Array], path: str) -> None:
    """Refuse quaternions that are no attitudes; nothing is asked where there are none.

    Raises:
        CheckpointError: the length of a quaternion is not within `LENGTH_ERROR` of 1.
    """
    if not all(name in histories for name in QUATERNION):
        return
    length: Array = np.sqrt(sum(histories[name] ** 2 for name in QUATERNION))
    if not (np.abs(length - 1.0) <= LENGTH_ERROR).all():
        raise CheckpointError(f"{path}: the quaternion {', '.join(QUATERNION)} is not of length 1")
