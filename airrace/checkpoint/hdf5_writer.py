"""The writer of a tree as an HDF5 image in memory.

Only the plainest HDF5 is written, so that only that has to be read: groups; datasets of at most one dimension, stored
contiguously, of 64-bit numbers, of fixed-length UTF-8 strings, or of rows of both; scalar attributes of the same types.
"""

# h5py ships no types: what comes from it is unknown to the checker, and becomes known in the functions below.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false

from collections.abc import Iterator, Mapping, Sequence
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
        _attach_axes(list(_Writer().written(h5py.h5g.open(file.id, b"/"), root, "")))
        file.flush()
        return bytes(file.id.get_file_image())


class _Writer:
    """A writer by HDF5's own calls, which take half of the time that h5py's objects take.

    A type is made once, however often it occurs: all strings here are UTF-8, so numpy's type tells HDF5's.
    """

    def __init__(self) -> None:
        self._kinds: dict[np.dtype[Any], Handle] = {}  # Any: numbers, strings or rows
        self._scalar = h5py.h5s.create_simple(())
        self._of_groups = h5py.h5p.create(h5py.h5p.GROUP_CREATE)
        self._of_datasets = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        for properties in (self._of_groups, self._of_datasets):
            properties.set_obj_track_times(False)  # the same contents are the same bytes, whenever they are written

    def written(self, place: Handle, group: Group, path: str) -> Iterator[tuple[str, str, Handle]]:
        """Write what a group holds; yield the path, the path of the axis and the dataset of every series."""
        self._write_attributes(place, group.attributes)
        for name, node in group.members.items():
            match node:
                case Group():
                    below = h5py.h5g.create(place, name.encode("ascii"), gcpl=self._of_groups)
                    yield from self.written(below, node, f"{path}/{name}")
                case str():
                    self._dataset(place, name, _text(node))
                case Series():
                    dataset = self._dataset(place, name, node.values)
                    self._write_attributes(dataset, node.attributes)
                    yield f"{path}/{name}", node.axis, dataset
                case Table():
                    self._dataset(place, name, _rows(node))

    def _dataset(self, place: Handle, name: str, values: NDArray[Any]) -> Handle:  # Any: numbers, strings or rows
        kind = self._kind(values.dtype)
        space = h5py.h5s.create_simple(values.shape) if values.ndim else self._scalar
        dataset = h5py.h5d.create(place, name.encode("ascii"), kind, space, dcpl=self._of_datasets)
        dataset.write(h5py.h5s.ALL, h5py.h5s.ALL, np.ascontiguousarray(values), kind)
        return dataset

    def _write_attributes(self, place: Handle, attributes: Mapping[str, Attribute]) -> None:
        for name, value in attributes.items():
            match value:
                case str():
                    one = _text(value)
                case int():
                    one = np.array(value, np.int64)
                case float():
                    one = np.array(value, np.float64)
            kind = self._kind(one.dtype)
            h5py.h5a.create(place, name.encode("ascii"), kind, self._scalar).write(one, kind)

    def _kind(self, dtype: np.dtype[Any]) -> Handle:  # Any: as above
        if dtype not in self._kinds:
            self._kinds[dtype] = h5py.h5t.py_create(dtype, logical=True)
        return self._kinds[dtype]


def _attach_axes(series: Sequence[tuple[str, str, Handle]]) -> None:
    """Declare the dimension scales, once all datasets exist."""
    datasets = {path: dataset for path, _, dataset in series}
    for _, axis, dataset in series:
        if axis:
            if not h5py.h5ds.is_scale(datasets[axis]):
                h5py.h5ds.set_scale(datasets[axis], axis.rsplit("/", 1)[-1].encode("ascii"))
            h5py.h5ds.attach_scale(dataset, datasets[axis], 0)


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
