"""The writer of a tree as an HDF5 image in memory.

Only the plainest HDF5 is written, so that only that has to be read: groups; datasets of at most one dimension, stored
contiguously, of 64-bit numbers, of fixed-length UTF-8 strings, or of rows of both; scalar attributes of the same types.
"""

# h5py ships no types: what comes from it is unknown to the checker, and becomes known in the functions below.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false

from collections.abc import Mapping
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from airrace.checkpoint.tree import Attribute, Column, Group, Series, Table
from airrace.errors import CheckpointError

# Any: h5py's objects and identifiers, which have no types.
Handle = Any


def image_of(root: Group) -> bytes:
    """Return the tree as an HDF5 file, in memory.

    Raises:
        CheckpointError: a text contains a NUL character.
    """
    with h5py.File("checkpoint", "w", driver="core", backing_store=False) as file:
        _write_group(file, root)
        _attach_axes(file, root, "")
        file.flush()
        return bytes(file.id.get_file_image())


def _write_group(place: Handle, group: Group) -> None:
    _write_attributes(place, group.attributes)
    for name, node in group.members.items():
        match node:
            case Group():
                _write_group(place.create_group(name), node)
            case str():
                place.create_dataset(name, data=_text(node))
            case Series():
                _write_attributes(place.create_dataset(name, data=node.values), node.attributes)
            case Table():
                place.create_dataset(name, data=_rows(node))


def _write_attributes(place: Handle, attributes: Mapping[str, Attribute]) -> None:
    for name, value in attributes.items():
        match value:
            case str():
                place.attrs.create(name, _text(value))
            case int():
                place.attrs.create(name, np.int64(value))
            case float():
                place.attrs.create(name, np.float64(value))


def _attach_axes(file: Handle, group: Group, path: str) -> None:
    """Declare the dimension scales once all datasets exist."""
    for name, node in group.members.items():
        match node:
            case Group():
                _attach_axes(file, node, f"{path}/{name}")
            case Series(axis=axis) if axis:
                if not file[axis].is_scale:
                    file[axis].make_scale(axis.rsplit("/", 1)[-1])
                file[f"{path}/{name}"].dims[0].attach_scale(file[axis])
            case _:
                pass


def _text(text: str) -> NDArray[np.bytes_]:
    """Return a scalar string of just the length it needs (HDF5 has no strings of length 0: one NUL stands for that)."""
    encoded = _encoded(text)
    return np.array(encoded, h5py.string_dtype("utf-8", max(1, len(encoded))))


def _rows(table: Table) -> NDArray[np.void]:
    columns: dict[str, NDArray[Any]] = {name: _column(column) for name, column in table.columns.items()}
    rows = np.zeros(len(next(iter(columns.values()))), np.dtype([(name, one.dtype) for name, one in columns.items()]))
    for name, column in columns.items():
        rows[name] = column
    return rows


def _column(column: Column) -> NDArray[Any]:  # Any: numbers or strings, as the column has them
    if not isinstance(column, tuple):
        return column
    encoded = [_encoded(entry) for entry in column]
    width = max((len(entry) for entry in encoded), default=0)
    return np.array(encoded, h5py.string_dtype("utf-8", max(1, width)))


def _encoded(text: str) -> bytes:
    if "\0" in text:
        raise CheckpointError(f"a text with a NUL character cannot be stored: {text[:40]!r}")
    # Paths that are not UTF-8 reach Python as lone surrogates.
    return text.encode("utf-8", "surrogateescape")
