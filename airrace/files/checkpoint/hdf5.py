"""The plainest HDF5, written to and read from memory; the reader refuses everything else.

Plain are groups; datasets of at most one dimension, stored contiguously, of 64-bit numbers, of fixed-length UTF-8
strings, or of rows of both; scalar attributes of the same types. Both sides use HDF5's own calls, which take half of
the time that h5py's objects take.
"""

import contextlib
import functools
import math
import re
from collections.abc import Collection, Generator, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import h5py
import h5py.h5i
import h5py.h5l
import h5py.h5o
import numpy as np
from numpy.typing import NDArray

from airrace.errors import CheckpointError

# h5py ships no types: what comes from it is unknown to the checker, and becomes known in the functions below.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false

Attribute = str | float | int
Kind = type | Mapping[str, type]
"""What a dataset holds: `str` a text, `float` or `int` a series; the types of named columns make a table."""
Values = NDArray[Any]  # Any: numbers, strings or rows, as a `Kind` says
Handle = Any  # h5py's objects and identifiers, which have no types

NUMBERS = {float: np.dtype("<f8"), int: np.dtype("<i8")}
KINDS = {str: "a text", float: "a series of floats", int: "a series of integers"}
OBJECTS_MAX = 20_000
"""The most groups and datasets that are read of a file."""
ATTRIBUTE_BYTES_MAX = 64_000
"""The size of the largest attribute that is read, bytes; HDF5's own limit is 64 KiB."""
FILE_NAMES = re.compile(r"/.*/path|/versions\.name")
"""The texts that may be no UTF-8, as names of files on Linux."""
SCALAR = h5py.h5s.create_simple(())
OF_GROUPS, OF_DATASETS = h5py.h5p.create(h5py.h5p.GROUP_CREATE), h5py.h5p.create(h5py.h5p.DATASET_CREATE)
for properties in (OF_GROUPS, OF_DATASETS):  # the same contents are the same bytes, whenever they are written
    properties.set_obj_track_times(False)


@contextlib.contextmanager
def new_image() -> Generator["Writer"]:
    """Give the root of a new HDF5 file in memory."""
    with h5py.File("checkpoint", "w", driver="core", backing_store=False) as file:
        yield Writer(h5py.h5g.open(file.id, b"/"), "")


@dataclass(frozen=True)
class Writer:
    """A group that is being written, and its path."""

    handle: Handle
    path: str

    def group(self, name: str) -> "Writer":
        """Return a group, which is created unless it exists."""
        if name.encode("ascii") in self.handle:
            return Writer(h5py.h5g.open(self.handle, name.encode("ascii")), f"{self.path}/{name}")
        return Writer(h5py.h5g.create(self.handle, name.encode("ascii"), gcpl=OF_GROUPS), f"{self.path}/{name}")

    def dataset(
        self,
        name: str,
        kind: Kind,
        value: Any,  # Any: a text, numbers, or rows of both
        attributes: Mapping[str, Attribute] | None = None,
        axis: str = "",
    ) -> None:
        """Write a text, a series or a table, with attributes.

        `axis` names the series beside this group that gives the places of the numbers (HDF5: its dimension scale).
        """
        values = _array(kind, value)
        stored = _stored_type(values.dtype)
        space = h5py.h5s.create_simple(values.shape) if values.ndim else SCALAR
        dataset = h5py.h5d.create(self.handle, name.encode("ascii"), stored, space, dcpl=OF_DATASETS)
        dataset.write(h5py.h5s.ALL, h5py.h5s.ALL, values, stored)
        Writer(dataset, f"{self.path}/{name}").attributes(attributes or {})
        if axis:
            place = f"{self.path.rpartition('/')[0]}/{axis}".encode("ascii")
            scale = h5py.h5d.open(h5py.h5i.get_file_id(self.handle), place)
            if not h5py.h5ds.is_scale(scale):
                h5py.h5ds.set_scale(scale, axis.encode("ascii"))
            h5py.h5ds.attach_scale(dataset, scale, 0)

    def attributes(self, attributes: Mapping[str, Attribute]) -> None:
        """Write attributes of what the handle is of."""
        for name, value in attributes.items():
            values = _array(type(value), value)
            stored = _stored_type(values.dtype)
            h5py.h5a.create(self.handle, name.encode("ascii"), stored, SCALAR).write(values, stored)

    def image(self) -> bytes:
        """Return the whole file that the group is part of, as it is now."""
        file = h5py.h5i.get_file_id(self.handle)
        h5py.h5f.flush(file)
        return bytes(file.get_file_image())


@functools.cache
def _stored_type(dtype: np.dtype[Any]) -> Handle:  # Any: numbers, strings or rows
    """Return HDF5's type for numpy's, made once: making it takes as long as writing a short series."""
    return h5py.h5t.py_create(dtype, logical=True)


def _array(kind: Kind, value: Any) -> Values:  # Any: as above
    """Return what is stored; truth values are stored as 0 and 1."""
    if kind is str:
        return _encode([value]).reshape(())
    if not isinstance(kind, Mapping):
        return np.asarray(value, NUMBERS[kind], order="C")
    columns: dict[str, Values] = {}
    for index, (name, cell) in enumerate(kind.items()):
        cells = [row[index] for row in value]
        columns[name] = _encode(cells) if cell is str else np.array(cells, NUMBERS[cell])
    table = np.zeros(len(value), np.dtype([(name, cells.dtype) for name, cells in columns.items()]))
    for name, cells in columns.items():
        table[name] = cells
    return table


def _encode(texts: Sequence[str]) -> Values:
    """Return texts as strings of the length that the longest needs, at least 1: an empty text is one NUL in HDF5."""
    for text in texts:
        if "\0" in text:
            raise CheckpointError(f"a text with a NUL character cannot be stored: {text[:40]!r}")
    # Paths that are not UTF-8 reach Python as lone surrogates.
    encoded = [text.encode("utf-8", "surrogateescape") for text in texts]
    return np.array(encoded, h5py.string_dtype("utf-8", max([1, *map(len, encoded)])))


@contextlib.contextmanager
def open_image(image: bytes) -> Generator["Reader"]:
    """Give the root of an HDF5 file.

    Raises:
        CheckpointError: no HDF5 file, or one that HDF5 cannot read.
    """
    try:
        file = h5py.h5f.open_file_image(image)
        try:
            yield Reader(h5py.h5g.open(file, b"/"), "", Allowance(len(image)))
        finally:
            file.close()
    except CheckpointError:
        raise
    except Exception as error:  # h5py's errors have no common root: OSError, KeyError, TypeError, ValueError, ...
        raise CheckpointError(f"the checkpoint's HDF5 content cannot be read: {error}") from error


@dataclass
class Allowance:
    """What may still be read: all datasets together cannot hold more bytes than the file does."""

    size: int
    objects: int = OBJECTS_MAX

    def take(self, path: str, objects: int, size: int) -> None:
        """Account for objects and bytes before they are read."""
        self.objects -= objects
        self.size -= size
        if self.objects < 0 or self.size < 0:
            raise CheckpointError(f"{path}: claims to hold more than a checkpoint can")


class Reader:
    """A group that is read, and its path, which every message names.

    Its methods raise a `CheckpointError` unless a member is of the requested kind: no link, of no other
    type, not filtered and not stored elsewhere.
    """

    def __init__(self, handle: Handle, path: str, allowance: Allowance) -> None:
        self.handle, self.path, self.allowance = handle, path, allowance
        self.names = [name.decode("utf-8", "replace") for name in list(handle)]

    def expect(self, names: Iterable[str], optional: Collection[str] = ()) -> None:
        """Refuse the group unless its members are exactly `names`, with or without the optional ones."""
        missing = [name for name in names if name not in self.names]
        unknown = [name for name in self.names if name not in names and name not in optional]
        if missing or unknown:
            problem = f"{missing[0]!r} is missing" if missing else f"{unknown[0]!r} is unknown"
            raise CheckpointError(f"{self.path or '/'}: {problem}")

    def group(self, name: str) -> "Reader":
        """Return a group."""
        return Reader(self._open(name, h5py.h5g.GroupID, "a group"), f"{self.path}/{name}", self.allowance)

    def dataset(self, name: str, kind: Kind) -> Any:  # Any: as the kind says
        """Return a text, an array of numbers, shape (n,), or the rows of a table with exactly these columns."""
        path, words = (
            f"{self.path}/{name}",
            f"a table of {', '.join(kind)}" if isinstance(kind, Mapping) else KINDS[kind],
        )
        dataset = self._open(name, h5py.h5d.DatasetID, words)
        dtype, shape = dataset.dtype, dataset.shape
        if shape is None or len(shape) != (0 if kind is str else 1) or not _fits(dtype, kind):
            raise CheckpointError(f"{path} is not {words}, as airrace writes it")
        size = math.prod(shape) * dtype.itemsize
        self.allowance.take(path, 0, size)
        # Only what is stored in one piece, without filters and in this file, has an offset.
        if size and (dataset.get_offset() is None or dataset.get_storage_size() != size):
            raise CheckpointError(f"{path}: is not stored plainly in the file itself")
        values: Values = np.zeros(shape, dtype)
        dataset.read(h5py.h5s.ALL, h5py.h5s.ALL, values, dataset.get_type())
        if kind is str:
            return _decode(values.item(), path)
        if not isinstance(kind, Mapping):
            return values
        columns: list[list[Any]] = []  # Any: texts or numbers
        for column, cell in kind.items():
            cells = values[column].tolist()
            columns.append([_decode(text, f"{path}.{column}") for text in cells] if cell is str else cells)
        return list(zip(*columns, strict=True))

    def attributes(self, kinds: Mapping[str, type], name: str = "") -> dict[str, Attribute]:
        """Return those of these attributes that a dataset has, or without a name the group itself."""
        place = self._open(name, h5py.h5d.DatasetID, "a dataset") if name else self.handle
        attributes: dict[str, Attribute] = {}
        for attribute, kind in kinds.items():
            if not h5py.h5a.exists(place, attribute.encode("ascii")):
                continue
            path = f"{self.path}/{name}@{attribute}"
            stored = h5py.h5a.open(place, attribute.encode("ascii"))
            dtype = stored.dtype
            if stored.shape != () or not _fits(dtype, kind) or dtype.itemsize > ATTRIBUTE_BYTES_MAX:
                raise CheckpointError(f"{path} is not {'a short text' if kind is str else f'one {kind.__name__}'}")
            value: Values = np.zeros((), dtype)
            stored.read(value, stored.get_type())
            attributes[attribute] = _decode(value.item(), path) if kind is str else value.item()
        return attributes

    def _open(self, name: str, kind: type, words: str) -> Handle:
        path = f"{self.path}/{name}"
        self.allowance.take(path, 1, 0)
        if self.handle.links.get_info(name.encode()).type != h5py.h5l.TYPE_HARD:
            raise CheckpointError(f"{path}: is a soft or external link; a checkpoint has none")
        member = h5py.h5o.open(self.handle, name.encode())
        if not isinstance(member, kind):
            raise CheckpointError(f"{path} is not {words}")
        return member


def _fits(dtype: np.dtype[Any], kind: Kind) -> bool:  # Any: this is what is being found out
    if isinstance(kind, Mapping):
        return dtype.names == tuple(kind) and all(_fits(dtype[name], kind[name]) for name in kind)
    if kind is not str:
        return dtype == NUMBERS[kind]
    text = h5py.check_string_dtype(dtype)
    return text is not None and text.length is not None and text.encoding == "utf-8"


def _decode(text: bytes, path: str) -> str:
    try:
        decoded = text.decode("utf-8", "surrogateescape" if FILE_NAMES.fullmatch(path) else "strict")
    except UnicodeDecodeError:
        raise CheckpointError(f"{path}: a text is not UTF-8") from None
    if "\0" in decoded:
        raise CheckpointError(f"{path}: a text contains a NUL character")
    return decoded
