"""A checkpoint as a tree of groups, texts, series and tables: what HDF5 stores, without HDF5."""

from collections.abc import Mapping, Sequence
from dataclasses import field, fields
from typing import Any, ClassVar, Protocol, TypeVar, get_type_hints

import numpy as np
from numpy.typing import NDArray

from airrace.errors import CheckpointError
from airrace.records import record

Attribute = str | float | int
Numbers = NDArray[np.float64 | np.int64]
Column = tuple[str, ...] | Numbers


@record
class Series:
    """A row of numbers, shape (n,), with attributes.

    `axis` is the path of the series that gives the places of these numbers (HDF5: its dimension scale), if any.
    """

    values: Numbers
    attributes: Mapping[str, Attribute] = field(default_factory=dict[str, Attribute])
    axis: str = ""


@record
class Table:
    """A table: columns of equal length, by name."""

    columns: Mapping[str, Column]


@record
class Group:
    """A group of named members, with attributes."""

    members: Mapping[str, "Node"]
    attributes: Mapping[str, Attribute] = field(default_factory=dict[str, Attribute])


Node = Group | Series | Table | str


class Record(Protocol):
    """A dataclass whose fields are all `str`, `float`, `int` or `bool`."""

    # Any: the protocol by which the standard library itself recognises a dataclass.
    __dataclass_fields__: ClassVar[dict[str, Any]]


R = TypeVar("R", bound=Record)


def column_kinds(record: type[Record]) -> dict[str, type]:
    """Return the columns of a table of such records: the fields and their types."""
    hints = get_type_hints(record)
    return {one.name: hints[one.name] for one in fields(record)}


def table_of(record: type[R], rows: Sequence[R]) -> Table:
    """Return a table with one row per record; truth values are stored as 0 and 1."""
    columns: dict[str, Column] = {}
    for name, kind in column_kinds(record).items():
        entries = [getattr(row, name) for row in rows]
        columns[name] = tuple(entries) if kind is str else np.array(entries, np.float64 if kind is float else np.int64)
    return Table(columns)


def rows_of(record: type[R], table: Table, path: str) -> tuple[R, ...]:
    """Return the records of a table.

    Raises:
        CheckpointError: its columns are not exactly the fields, or a truth value is neither 0 nor 1.
    """
    kinds = column_kinds(record)
    if list(table.columns) != list(kinds):
        raise CheckpointError(f"{path}: the columns are {', '.join(table.columns)}, not {', '.join(kinds)}")
    columns = [_entries(table.columns[name], kind, f"{path}.{name}") for name, kind in kinds.items()]
    return tuple(record(*row) for row in zip(*columns, strict=True))


def _entries(column: Column, kind: type, path: str) -> Sequence[str | float | int | bool]:
    stored = str if isinstance(column, tuple) else float if column.dtype.kind == "f" else int
    if stored is not (int if kind is bool else kind):
        raise CheckpointError(f"{path}: holds {stored.__name__}, not {kind.__name__}")
    entries: Sequence[Any] = column if isinstance(column, tuple) else column.tolist()  # Any: numpy's tolist is untyped
    if kind is not bool:
        return entries
    if any(entry not in (0, 1) for entry in entries):
        raise CheckpointError(f"{path}: a truth value is neither 0 nor 1")
    return [bool(entry) for entry in entries]
