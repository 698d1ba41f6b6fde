"""A codec of frozen dataclasses and HDF5 groups, driven by the types of the fields.

    type of a field                       member
    `str` or an `Enum` of texts           text
    array of one dimension, with units    series of 64-bit numbers; a number with units is one of length 1
    `tuple[str, ...]`                     table of one column, called like the field without its plural s
    `Mapping[str, str]`                   table of the columns `name` and the field without its s
    a record of texts and numbers         table of one row; of at most one where it may be None
    a tuple of such records               table
    any other record                      group
    a tuple of other records              group of groups 1, 2, ...
    further numbers                       table `summary` of one row

What types do not say, such as units and names that differ, a `Layout` says for the fields of a record.
"""

import functools
import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, is_dataclass
from enum import Enum
from typing import Any, Protocol, cast, get_args, get_origin, get_type_hints

import numpy as np

from airrace.checkpoint.hdf5 import Attribute, Reader, Writer, new_image
from airrace.errors import CheckpointError

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
    absent: bool = False  # there is no member while the value is None or an empty tuple
    inline: bool = False  # the members of this record stand beside those of the record that it is part of
    keys: Callable[[], Sequence[str]] | None = None  # names of the groups of a tuple in its order, all of them optional
    key: Callable[[Any], str] = str  # returns which of `keys` an entry has
    follows: Callable[[str], tuple[Any] | None] | None = None  # a value by the record's path; None where it is stored
    special: Special | None = None  # stores the member


@dataclass(frozen=True)
class Layout:
    """What the types of a record do not say."""

    hints: Mapping[str, Hint] = field(default_factory=dict[str, Hint])  # by field
    kind: type | None = None  # the record that is stored instead
    pack: Callable[[Any], Any] | None = None  # makes that record
    unpack: Callable[[Any, str], Any] | None = None  # takes what is stored at a path: restores or refuses it


@dataclass(frozen=True)
class Codec:
    """A codec of records, with the layouts of some of them."""

    layouts: Mapping[type, Layout]

    def image_of(self, value: object, attributes: Mapping[str, Attribute]) -> bytes:
        """Return an HDF5 file that holds a record and attributes at its root.

        Raises:
            CheckpointError: a text with a NUL character, or what a `Special` cannot store.
        """
        with new_image() as root:
            root.attributes(attributes)
            self._write_record(root, type(value), value)
            return root.image()

    def read(self, group: Reader, kind: type) -> Any:
        """Return the record that a group holds.

        Raises:
            CheckpointError: a member is missing, unknown or of the wrong kind, or what is stored contradicts itself.
        """
        required, optional = self._contents(kind, group.path)
        folders = {name.split("/")[0] for name in required if "/" in name}
        group.expect({name.split("/")[0] for name in required}, optional)
        for folder in folders:
            group.group(folder).expect({name.split("/")[1] for name in required if name.startswith(f"{folder}/")})
        return self._read_record(group, kind)

    def _parts(self, kind: type, path: str) -> tuple[list[tuple[str, Any, Hint]], dict[str, type]]:
        """Return the fields of a record at a path with their types and hints, and apart the further numbers."""
        layout = self.layouts.get(kind, Layout())
        parts: list[tuple[str, Any, Hint]] = []
        numbers: dict[str, type] = {}
        for name, hint in _types(layout.kind or kind).items():
            if name not in layout.hints and hint in (float, int, bool):
                numbers[name] = hint
            else:
                parts.append((name, hint, layout.hints.get(name, Hint())))
        return parts, numbers

    def _contents(self, kind: type, path: str) -> tuple[list[str], list[str]]:
        """Return the names of the members of a record that must exist, and of those that may."""
        parts, numbers = self._parts(kind, path)
        required, optional = [SUMMARY] if numbers else list[str](), list[str]()
        for name, hint, said in parts:
            if said.inline:
                for names, more in zip((required, optional), self._contents(_record(hint), path), strict=True):
                    names.extend(more)
            elif said.follows is None or said.follows(path) is None:
                (optional if said.absent else required).append(said.name or name)
        return required, optional

    def _write_record(self, group: Writer, kind: type, value: Any) -> None:
        layout = self.layouts.get(kind, Layout())
        record = layout.pack(value) if layout.pack else value
        parts, numbers = self._parts(kind, group.path)
        for name, hint, said in parts:
            if said.follows is None or said.follows(group.path) is None:
                self._write(group, said.name or name, hint, said, getattr(record, name))
        if numbers:
            group.dataset(SUMMARY, _stored(numbers), [[getattr(record, name) for name in numbers]])

    def _read_record(self, group: Reader, kind: type) -> Any:
        layout = self.layouts.get(kind, Layout())
        parts, numbers = self._parts(kind, group.path)
        values: dict[str, Any] = {}
        for name, hint, said in parts:
            following = None if said.follows is None else said.follows(group.path)
            values[name] = following[0] if following else self._read(group, said.name or name, hint, said)
        if numbers:
            path = f"{group.path}/{SUMMARY}"
            rows = _values(group.dataset(SUMMARY, _stored(numbers)), numbers, path)
            values |= dict(zip(numbers, _only(rows, path), strict=True))
        record = (layout.kind or kind)(**values)
        return layout.unpack(record, group.path) if layout.unpack else record

    def _write(self, group: Writer, name: str, hint: Any, said: Hint, value: Any) -> None:
        folder, _, name = name.rpartition("/")
        group = group.group(folder) if folder else group
        if said.absent and (value is None or value == ()):
            return
        if said.special:
            said.special.write(group, name, value)
        elif said.inline:
            self._write_record(group, hint, value)
        elif number := _number(hint):
            attributes = {"units": said.units, "long_name": said.long_name}
            group.dataset(name, _stored_as(number), np.atleast_1d(np.asarray(value)), attributes)
        elif _is_cell(hint):
            group.dataset(name, str, _cell(value))
        elif columns := _columns(name, hint):
            group.dataset(name, _stored(columns), _rows(hint, columns, value))
        elif get_origin(hint) is tuple:
            within = group.group(name)
            for number, entry in enumerate(value, start=1):
                key = said.key(entry) if said.keys else str(number)
                self._write_record(within.group(key), _record(hint), entry)
        else:
            self._write_record(group.group(name), _record(hint), value)

    def _read(self, group: Reader, name: str, hint: Any, said: Hint) -> Any:
        folder, _, name = name.rpartition("/")
        group = group.group(folder) if folder else group
        path = f"{group.path}/{name}"
        if said.absent and name not in group.names:
            return () if get_origin(hint) is tuple else None
        if said.special:
            return said.special.read(group, name)
        if said.inline:
            return self._read_record(group, hint)
        if number := _number(hint):
            return _array(group.dataset(name, _stored_as(number)), number, path)
        if _is_cell(hint):
            return _value(group.dataset(name, str), hint, name, path)
        if columns := _columns(name, hint):
            return _of_rows(hint, _values(group.dataset(name, _stored(columns)), columns, path), path)
        within = group.group(name)
        if get_origin(hint) is not tuple:
            return self.read(within, _record(hint))
        numbers = [str(number) for number in range(1, len(within.names) + 1)]
        within.expect(() if said.keys else numbers, said.keys() if said.keys else ())
        names = [key for key in (said.keys() if said.keys else numbers) if key in within.names]
        return tuple(self.read(within.group(key), _record(hint)) for key in names)


@functools.cache
def _types(record: type) -> dict[str, Any]:
    """Return the types of a record's fields."""
    return get_type_hints(record)


def _record(hint: Any) -> type:
    """Return the type itself, that of the entries of a tuple, or that of what may be None."""
    return get_args(hint)[0] if get_origin(hint) in (tuple, types.UnionType) else hint


def _number(hint: Any) -> Any:
    """Return the type of the numbers of an array, or `float` itself; None for any other type."""
    if get_origin(hint) is np.ndarray:
        return get_args(get_args(hint)[1])[0]
    return float if hint is float else None


def _is_cell(hint: Any) -> bool:
    return hint in (str, float, int, bool) or (isinstance(hint, type) and issubclass(hint, Enum))


def _columns(field: str, hint: Any) -> dict[str, type] | None:
    """Return the columns of a table with their types; None for a type that is stored otherwise."""
    singular, record = field.removesuffix("s"), _record(hint)
    if hint == tuple[str, ...]:
        return {singular: str}
    if hint == Mapping[str, str]:
        return {"name": str, singular: str}
    cells = _types(record) if is_dataclass(record) else {}
    with_numbers = get_origin(hint) is tuple or not {float, int, bool}.isdisjoint(cells.values())
    return cells if cells and with_numbers and all(map(_is_cell, cells.values())) else None


def _rows(hint: Any, columns: Mapping[str, type], value: Any) -> list[Sequence[Any]]:
    """Return the rows of a table."""
    if hint == Mapping[str, str]:
        return list(value.items())
    records = cast(Sequence[Any], value if get_origin(hint) is tuple else [] if value is None else [value])
    if hint == tuple[str, ...]:
        return [(text,) for text in records]
    return [[_cell(getattr(record, column)) for column in columns] for record in records]


def _of_rows(hint: Any, rows: list[tuple[Any, ...]], path: str) -> Any:
    """Return the value that the rows of a table stand for."""
    if hint == Mapping[str, str]:
        return dict(cast(list[tuple[str, str]], rows))
    if hint == tuple[str, ...]:
        return tuple(text for (text,) in rows)
    if get_origin(hint) is tuple:
        return tuple(_record(hint)(*row) for row in rows)
    if get_origin(hint) is types.UnionType and not rows:
        return None
    return _record(hint)(*_only(rows, path))


def _only(rows: Sequence[Any], path: str) -> Any:
    if len(rows) != 1:
        raise CheckpointError(f"{path}: {len(rows)} rows instead of one")
    return rows[0]


def _stored_as(kind: type) -> type:
    """Return the type as which a text or a number is stored: `str`, `float` or `int`."""
    return str if issubclass(kind, str | Enum) else float if issubclass(kind, float) else int


def _stored(columns: Mapping[str, type]) -> dict[str, type]:
    return {column: _stored_as(kind) for column, kind in columns.items()}


def _cell(value: Any) -> Any:
    return value.value if isinstance(value, Enum) else value


def _values(rows: Sequence[Sequence[Any]], columns: Mapping[str, type], path: str) -> list[tuple[Any, ...]]:
    """Return the values that the cells of a table stand for."""
    kinds = columns.items()
    return [
        tuple(_value(cell, kind, column, f"{path}.{column}") for cell, (column, kind) in zip(row, kinds, strict=True))
        for row in rows
    ]


def _value(cell: Any, kind: Any, name: str, path: str) -> Any:
    if issubclass(kind, Enum) and cell not in [entry.value for entry in kind]:
        raise CheckpointError(f"{path}: unknown {name} {cell[:40]!r}")
    if kind is bool and cell not in (0, 1):
        raise CheckpointError(f"{path}: a truth value is neither 0 nor 1")
    return kind(cell)


def _array(stored: Any, kind: Any, path: str) -> Any:
    if kind is float:
        return float(_only(stored, path))
    values = stored.astype(kind)
    if _stored_as(kind) is int and (values != stored).any():
        raise CheckpointError(f"{path}: holds numbers that are no {kind.__name__}")
    return values
