"""A codec of frozen dataclasses and HDF5 groups, driven by the types of the fields.

    type of a field                    member
    `str`, an `Enum` of texts          text
    array of one dimension             series of numbers; a number with units is one of length 1
    `tuple[str, ...]`                  table of one column, called like the field without its plural s
    `Mapping[str, str]`                table of the columns `name` and the field without its s
    record of texts and numbers        table of one row; of at most one where it may be None
    tuple of such records              table
    any other record                   group, absent where it may be None and is
    tuple of other records             group of groups 1, 2, ...
    further numbers                    table `summary` of one row

What types do not state, such as units and names that differ, a `RecordLayout` states for the fields of a record.
"""

import functools
import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, is_dataclass
from enum import Enum
from typing import Any, Protocol, get_args, get_origin, get_type_hints

import numpy as np

from airrace.errors import CheckpointError
from airrace.files.checkpoint.hdf5 import Attribute, Reader, Writer, new_image

# Any: types of fields and their values, which are known when the program runs.
SUMMARY = "summary"


class Special(Protocol):
    """A member of a kind of its own."""

    def write(self, group: Writer, name: str, value: Any) -> None: ...

    def read(self, group: Reader, name: str) -> Any: ...


@dataclass(frozen=True)
class Hint:
    """What the type of a field does not say of its member."""

    name: str = ""  # of the member, where it is not the field's; `a/b` is a member of the group a
    units: str = ""  # attribute of a series
    long_name: str = ""  # attribute of a series
    absent: bool = False  # there is no member while a tuple is empty
    inline: bool = False  # the members of this record stand beside those of the record that it is part of
    outermost: bool = False  # a record within such a tuple has no member, and an empty tuple
    value_at: Callable[[str], Any] | None = None  # there is no member: this function of the record's path is the value
    entries: Callable[[], Sequence[str]] | None = None  # names of a tuple's groups, in this order, instead of 1, 2, ...
    entry: Callable[[Any], str] = str  # returns the name of a group, one of `entries`
    special: Special | None = None  # stores the member

    def is_stored(self, field: str, path: str) -> bool:
        """Return whether a record at this path has the member."""
        return self.value_at is None and not (self.outermost and f"/{field}/" in path)


@dataclass(frozen=True)
class RecordLayout:
    """What the types of a record do not say."""

    hints: Mapping[str, Hint] = field(default_factory=dict[str, Hint])  # by field
    kind: type | None = None  # the record that is stored instead
    pack: Callable[[Any], Any] | None = None  # makes that record
    unpack: Callable[[Any, str], Any] | None = None  # takes what is stored at a path: validates it, makes the value


@dataclass(frozen=True)
class Codec:
    """A codec of records, with the layouts of some of them."""

    layouts: Mapping[type, RecordLayout]

    def image_of(self, value: Any, attributes: Mapping[str, Attribute]) -> bytes:
        """Return an HDF5 file that holds a record and attributes at its root.

        Raises:
            CheckpointError: a text with a NUL character, or what a `Special` cannot store.
        """
        with new_image() as root:
            root.attributes(attributes)
            self._write_record(root, type(value), value)
            return root.image()

    def read(self, group: Reader, kind: Any) -> Any:
        """Return the record that a group holds.

        Raises:
            CheckpointError: a member is missing, unknown or of the wrong kind, or what is stored contradicts itself.
        """
        required, optional = self._members(kind, group.path)
        group.expect({name.split("/")[0] for name in required}, optional)
        for folder in {name.split("/")[0] for name in required if "/" in name}:
            group.group(folder).expect([name.split("/")[1] for name in required if name.startswith(f"{folder}/")])
        return self._read_record(group, kind)

    def _fields(self, kind: Any) -> tuple[list[tuple[str, Any, Hint]], dict[str, type]]:
        """Return the fields of a record with their types and hints, and apart its numbers without a member."""
        layout = self.layouts.get(kind, RecordLayout())
        types_of = _types(layout.kind or kind)
        numbers = {name: of for name, of in types_of.items() if of in (float, int, bool) and name not in layout.hints}
        special = [(name, of, layout.hints.get(name, Hint())) for name, of in types_of.items() if name not in numbers]
        return special, numbers

    def _members(self, kind: Any, path: str) -> tuple[list[str], list[str]]:
        """Return the names of the members of a record that must exist, and of those that may."""
        fields, numbers = self._fields(kind)
        required, optional = [SUMMARY] if numbers else list[str](), list[str]()
        for name, of, hint in fields:
            if hint.inline:
                inner = self._members(of, path)
                required += inner[0]
                optional += inner[1]
            elif hint.is_stored(name, path):
                (optional if _may_be_absent(name, of, hint) else required).append(hint.name or name)
        return required, optional

    def _write_record(self, group: Writer, kind: Any, value: Any) -> None:
        layout, (fields, numbers) = self.layouts.get(kind, RecordLayout()), self._fields(kind)
        record = layout.pack(value) if layout.pack else value
        for name, of, hint in fields:
            if hint.is_stored(name, group.path):
                self._write(group, hint.name or name, of, hint, getattr(record, name))
        if numbers:
            _write_table(group, SUMMARY, numbers, [[getattr(record, name) for name in numbers]])

    def _read_record(self, group: Reader, kind: Any) -> Any:
        layout, (fields, numbers) = self.layouts.get(kind, RecordLayout()), self._fields(kind)
        values: dict[str, Any] = {}
        for name, of, hint in fields:
            if hint.is_stored(name, group.path):
                values[name] = self._read(group, hint.name or name, of, hint)
            else:
                values[name] = hint.value_at(group.path) if hint.value_at else ()
        if numbers:
            row = _only(_read_table(group, SUMMARY, numbers), f"{group.path}/{SUMMARY}")
            values |= dict(zip(numbers, row, strict=True))
        record = (layout.kind or kind)(**values)
        return layout.unpack(record, group.path) if layout.unpack else record

    def _write(self, group: Writer, name: str, kind: Any, hint: Hint, value: Any) -> None:
        folder, _, name = name.rpartition("/")
        group = group.group(folder) if folder else group
        if _may_be_absent(name, kind, hint) and value in (None, ()):
            return
        if hint.special:
            hint.special.write(group, name, value)
        elif hint.inline:
            self._write_record(group, kind, value)
        elif kind is float or get_origin(kind) is np.ndarray:
            attributes = {"units": hint.units, "long_name": hint.long_name}
            group.dataset(name, _stored_as(_number(kind)), np.atleast_1d(np.asarray(value)), attributes)
        elif _is_cell(kind):
            group.dataset(name, str, _cell(value))
        elif columns := _columns(name, kind):
            _write_table(group, name, columns, _rows(kind, columns, value))
        elif get_origin(kind) is tuple:
            within = group.group(name)
            for number, entry in enumerate(value, start=1):
                self._write_record(
                    within.group(hint.entry(entry) if hint.entries else str(number)), _record(kind), entry
                )
        else:
            self._write_record(group.group(name), _record(kind), value)

    def _read(self, group: Reader, name: str, kind: Any, hint: Hint) -> Any:
        folder, _, name = name.rpartition("/")
        group = group.group(folder) if folder else group
        path = f"{group.path}/{name}"
        if name not in group.names and not hint.inline:
            return () if get_origin(kind) is tuple else None
        if hint.special:
            return hint.special.read(group, name)
        if hint.inline:
            return self._read_record(group, kind)
        if kind is float or get_origin(kind) is np.ndarray:
            return _numbers(group.dataset(name, _stored_as(_number(kind))), kind, path)
        if _is_cell(kind):
            return _value(group.dataset(name, str), kind, name, path)
        if columns := _columns(name, kind):
            return _of_rows(kind, _read_table(group, name, columns), path)
        within = group.group(name)
        if get_origin(kind) is not tuple:
            return self.read(within, _record(kind))
        names = [str(number) for number in range(1, len(within.names) + 1)]
        if hint.entries:
            within.expect((), hint.entries())
            names = [name for name in hint.entries() if name in within.names]
        within.expect(names)
        return tuple(self.read(within.group(entry), _record(kind)) for entry in names)


@functools.cache
def _types(record: type) -> dict[str, Any]:
    """Return the types of a record's fields."""
    return get_type_hints(record)


def _record(kind: Any) -> Any:
    """Return the type itself, that of the entries of a tuple, or that of what may be None."""
    return get_args(kind)[0] if get_origin(kind) in (tuple, types.UnionType) else kind


def _number(kind: Any) -> Any:
    """Return the type of the numbers of an array, or of a number."""
    return kind if kind is float else get_args(get_args(kind)[1])[0]


def _is_cell(kind: Any) -> bool:
    return kind in (str, float, int, bool) or (isinstance(kind, type) and issubclass(kind, Enum))


def _may_be_absent(name: str, kind: Any, hint: Hint) -> bool:
    return hint.absent or (get_origin(kind) is types.UnionType and not _columns(name, kind))


def _columns(name: str, kind: Any) -> dict[str, type]:
    """Return the columns of a table with their types; none for what is stored otherwise."""
    singular, record = name.removesuffix("s"), _record(kind)
    if kind == tuple[str, ...]:
        return {singular: str}
    if kind == Mapping[str, str]:
        return {"name": str, singular: str}
    cells = _types(record) if is_dataclass(record) else {}
    is_table = get_origin(kind) is tuple or not {float, int, bool}.isdisjoint(cells.values())
    return cells if is_table and all(map(_is_cell, cells.values())) else {}


def _rows(kind: Any, columns: Mapping[str, type], value: Any) -> list[Sequence[Any]]:
    """Return the rows of a table."""
    if kind == Mapping[str, str]:
        return list(value.items())
    if kind == tuple[str, ...]:
        return [[text] for text in value]
    if get_origin(kind) is not tuple:
        value = [] if value is None else [value]
    return [[_cell(getattr(record, column)) for column in columns] for record in value]


def _of_rows(kind: Any, rows: list[Any], path: str) -> Any:
    """Return the value that the rows of a table stand for."""
    if kind == Mapping[str, str]:
        return dict(rows)
    if kind == tuple[str, ...]:
        return tuple(text for (text,) in rows)
    if get_origin(kind) is tuple:
        return tuple(_record(kind)(*row) for row in rows)
    if get_origin(kind) is types.UnionType and not rows:
        return None
    return _record(kind)(*_only(rows, path))


def _only(rows: Sequence[Any], path: str) -> Any:
    if len(rows) != 1:
        raise CheckpointError(f"{path}: {len(rows)} rows instead of one")
    return rows[0]


def _stored_as(kind: Any) -> type:
    """Return the type as which a text or a number is stored: `str`, `float` or `int`."""
    return str if issubclass(kind, str | Enum) else float if issubclass(kind, float) else int


def _write_table(group: Writer, name: str, columns: Mapping[str, type], rows: Sequence[Sequence[Any]]) -> None:
    group.dataset(name, {column: _stored_as(kind) for column, kind in columns.items()}, rows)


def _read_table(group: Reader, name: str, columns: Mapping[str, type]) -> list[Sequence[Any]]:
    table: list[Sequence[Any]] = []
    for row in group.dataset(name, {column: _stored_as(kind) for column, kind in columns.items()}):
        cells = zip(row, columns.items(), strict=True)
        table.append([_value(cell, kind, column, f"{group.path}/{name}.{column}") for cell, (column, kind) in cells])
    return table


def _cell(value: Any) -> Any:
    return value.value if isinstance(value, Enum) else value


def _value(cell: Any, kind: Any, name: str, path: str) -> Any:
    """Return the value that a cell or a text stands for."""
    if issubclass(kind, Enum) and cell not in [entry.value for entry in kind]:
        raise CheckpointError(f"{path}: unknown {name} {cell[:40]!r}")
    if kind is bool and cell not in (0, 1):
        raise CheckpointError(f"{path}: a truth value is neither 0 nor 1")
    return kind(cell)


def _numbers(stored: Any, kind: Any, path: str) -> Any:
    """Return the array, or the number, that a series stands for."""
    if kind is float:
        return float(_only(stored, path))
    values = stored.astype(_number(kind))
    if _stored_as(_number(kind)) is int and (values != stored).any():
        raise CheckpointError(f"{path}: holds numbers that are no {_number(kind).__name__}")
    return values
