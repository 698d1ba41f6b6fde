"""A tree of groups, texts, series and tables, written as an HDF5 image and read back with distrust.

Only the plainest HDF5 is written, so that only that has to be read: groups; datasets of at most one dimension, stored
contiguously, of 64-bit numbers, of fixed-length UTF-8 strings, or of rows of both; scalar attributes of the same types.
"""

import math
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, Never, Protocol, TypeVar, get_type_hints

import h5py
import h5py.h5l
import h5py.h5o
import numpy as np
from numpy.typing import NDArray

from airrace.errors import CheckpointError
from airrace.trajectory import Array

# h5py ships no types: what comes from it is unknown to the checker, and becomes known in the functions below.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false


Attribute = str | float | int
Numbers = NDArray[np.float64 | np.int64]
Column = tuple[str, ...] | Numbers


@dataclass(frozen=True, eq=False)
class Series:
    """A row of numbers, shape (n,), with attributes.

    `axis` is the path of the series that gives the places of these numbers (HDF5: its dimension scale), if any.
    """

    values: Numbers
    attributes: Mapping[str, Attribute] = field(default_factory=dict[str, Attribute])
    axis: str = ""


@dataclass(frozen=True)
class StoredTable:
    """A table: columns of equal length, by name."""

    columns: Mapping[str, Column]


@dataclass(frozen=True)
class Group:
    """A group of named members, with attributes."""

    members: Mapping[str, "Node"]
    attributes: Mapping[str, Attribute] = field(default_factory=dict[str, Attribute])


Node = Group | Series | StoredTable | str


class Record(Protocol):
    """A dataclass whose fields are all `str`, `float`, `int` or `bool`."""

    # Any: the protocol by which the standard library itself recognises a dataclass.
    __dataclass_fields__: ClassVar[dict[str, Any]]


R = TypeVar("R", bound=Record)


def _column_kinds(record: type[Record]) -> dict[str, type]:
    """Return the columns of a table of such records: the fields and their types."""
    hints = get_type_hints(record)
    return {one.name: hints[one.name] for one in fields(record)}


def table_of(record: type[R], rows: Sequence[R]) -> StoredTable:
    """Return a table with one row per record; truth values are stored as 0 and 1."""
    columns: dict[str, Column] = {}
    for name, kind in _column_kinds(record).items():
        entries = [getattr(row, name) for row in rows]
        columns[name] = tuple(entries) if kind is str else np.array(entries, np.float64 if kind is float else np.int64)
    return StoredTable(columns)


def rows_of(record: type[R], table: StoredTable, path: str) -> tuple[R, ...]:
    """Return the records of a table.

    Raises:
        CheckpointError: its columns are not exactly the fields, or a truth value is neither 0 nor 1.
    """
    kinds = _column_kinds(record)
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


# Any: h5py's objects and identifiers, which have no types.
Handle = Any


def image_of(root: Group) -> bytes:
    """Return the tree as an HDF5 file, in memory.

    Raises:
        CheckpointError: a text contains a NUL character.
    """
    with h5py.File("checkpoint", "w", driver="core", backing_store=False) as file:
        series = list(_Writer().write(h5py.h5g.open(file.id, b"/"), root, ""))
        datasets = {path: dataset for path, _, dataset in series}
        for _, axis, dataset in series:  # the dimension scales, once all datasets exist
            if axis:
                if not h5py.h5ds.is_scale(datasets[axis]):
                    h5py.h5ds.set_scale(datasets[axis], axis.rsplit("/", 1)[-1].encode("ascii"))
                h5py.h5ds.attach_scale(dataset, datasets[axis], 0)
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

    def write(self, place: Handle, group: Group, path: str) -> Iterator[tuple[str, str, Handle]]:
        """Write what a group holds; yield the path, the path of the axis and the dataset of every series."""
        self._write_attributes(place, group.attributes)
        for name, node in group.members.items():
            match node:
                case Group():
                    below = h5py.h5g.create(place, name.encode("ascii"), gcpl=self._of_groups)
                    yield from self.write(below, node, f"{path}/{name}")
                case str():
                    self._dataset(place, name, _text(node))
                case Series():
                    dataset = self._dataset(place, name, node.values)
                    self._write_attributes(dataset, node.attributes)
                    yield f"{path}/{name}", node.axis, dataset
                case StoredTable():
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


def _text(text: str) -> NDArray[np.bytes_]:
    """Return a scalar string of just the length it needs (HDF5 has no strings of length 0: one NUL stands for that)."""
    encoded = _encode_text(text)
    return np.array(encoded, h5py.string_dtype("utf-8", max(1, len(encoded))))


def _rows(table: StoredTable) -> NDArray[np.void]:
    columns: dict[str, NDArray[Any]] = {name: _column_array(column) for name, column in table.columns.items()}
    rows = np.zeros(len(next(iter(columns.values()))), np.dtype([(name, one.dtype) for name, one in columns.items()]))
    for name, column in columns.items():
        rows[name] = column
    return rows


def _column_array(column: Column) -> NDArray[Any]:  # Any: numbers or strings, as the column has them
    if not isinstance(column, tuple):
        return column
    encoded = [_encode_text(entry) for entry in column]
    width = max((len(entry) for entry in encoded), default=0)
    return np.array(encoded, h5py.string_dtype("utf-8", max(1, width)))


def _encode_text(text: str) -> bytes:
    if "\0" in text:
        raise CheckpointError(f"a text with a NUL character cannot be stored: {text[:40]!r}")
    # Paths that are not UTF-8 reach Python as lone surrogates.
    return text.encode("utf-8", "surrogateescape")


@dataclass(frozen=True)
class ReadLimits:
    """The most that is read of an image.

    Attributes:
        objects: groups and datasets.
        depth: of groups within one another.
        attributes: of a group or a dataset.
        attribute_bytes: of one attribute; HDF5's own limit is 64 KiB.
    """

    objects: int = 20_000
    depth: int = 8
    attributes: int = 16
    attribute_bytes: int = 64_000


LIMITS = ReadLimits()
# Attributes of HDF5's dimension scales. They are never read; two of them hold references.
SCALE_ATTRIBUTES = frozenset({b"CLASS", b"NAME", b"DIMENSION_LIST", b"REFERENCE_LIST"})
NAMES_OF_FILES = re.compile(r"/.*/path|/versions\.name")
"""The texts that may be no UTF-8, as names of files on Linux."""
NUMBERS = (np.dtype("<f8"), np.dtype("<i8"))


def tree_of(image: bytes, without: Collection[str] = ()) -> Group:
    """Return the tree that an HDF5 image holds.

    Args:
        image: of the whole file.
        without: paths of members that are not read, such as `/stages/six-dof`.

    Raises:
        CheckpointError: no HDF5 image, or one with anything but the plain kinds described above.
    """
    try:
        file = h5py.h5f.open_file_image(image)
        try:
            return _ImageReader(len(image), without).group(h5py.h5g.open(file, b"/"), "", 0)
        finally:
            file.close()
    except CheckpointError:
        raise
    except Exception as error:  # h5py's errors have no common root: OSError, KeyError, TypeError, ValueError, ...
        raise CheckpointError(f"the checkpoint's HDF5 content cannot be read: {error}") from error


@dataclass
class _ImageReader:
    """A reader of one image, by HDF5's own calls; it looks at a type once, however often it occurs.

    It counts what may still be read: all datasets together cannot hold more bytes than the image does.
    """

    bytes_left: int
    without: Collection[str] = ()
    objects_left: int = LIMITS.objects
    _dtypes: dict[bytes, np.dtype[Any]] = field(default_factory=dict[bytes, np.dtype[Any]])

    def _take(self, path: str, *, objects: int = 0, size: int = 0) -> None:
        """Account for objects or bytes before they are read."""
        self.objects_left -= objects
        self.bytes_left -= size
        if self.objects_left < 0 or self.bytes_left < 0:
            raise CheckpointError(f"{path or '/'}: claims to hold more than a checkpoint can")

    def group(self, group: Handle, path: str, depth: int) -> Group:
        if depth > LIMITS.depth:  # hard links can make a group its own member
            raise CheckpointError(f"{path}: groups are nested more than {LIMITS.depth} deep")
        self._take(path, objects=group.get_num_objs())
        members: dict[str, Node] = {}
        for name in list(group):
            text = name.decode("utf-8", "replace")
            if f"{path}/{text}" not in self.without:
                members[text] = self._member(group, name, f"{path}/{text}", depth)
        return Group(members, self._attributes(group, path))

    def _member(self, group: Handle, name: bytes, path: str, depth: int) -> Node:
        if group.links.get_info(name).type != h5py.h5l.TYPE_HARD:
            raise CheckpointError(f"{path}: is a soft or external link; a checkpoint has none")
        member = h5py.h5o.open(group, name)
        if isinstance(member, h5py.h5g.GroupID):
            return self.group(member, path, depth + 1)
        if isinstance(member, h5py.h5d.DatasetID):
            return self._dataset(member, path)
        raise CheckpointError(f"{path}: is neither a group nor a dataset")

    def _dataset(self, dataset: Handle, path: str) -> Series | StoredTable | str:
        dtype, kind = self._dtype(dataset)
        shape: tuple[int, ...] | None = dataset.shape
        known = _is_text(dtype) if shape == () else _is_row(dtype)
        if shape is None or len(shape) > 1 or not known:
            raise CheckpointError(f"{path}: is neither a text, nor a series of 64-bit numbers, nor a table of both")
        size = math.prod(shape) * dtype.itemsize
        self._take(path, size=size)
        # Only what is stored in one piece, without filters and in this file, has an offset.
        if size and dataset.get_offset() is None:
            raise CheckpointError(f"{path}: is not stored plainly in the file itself")
        if dataset.get_storage_size() != size:
            raise CheckpointError(f"{path}: {size} bytes are declared, {dataset.get_storage_size()} are stored")
        values: NDArray[Any] = np.zeros(shape, dtype)  # Any: one of the types just checked
        dataset.read(h5py.h5s.ALL, h5py.h5s.ALL, values, kind)
        if shape == ():
            return _decode_text(values.item(), path)
        if dtype.names is None:
            return Series(values, self._attributes(dataset, path))
        return StoredTable({name: _column(values[name], f"{path}.{name}") for name in dtype.names})

    def _attributes(self, place: Handle, path: str) -> dict[str, Attribute]:
        """Return the scalar attributes of a group or dataset, without those of HDF5's dimension scales."""
        count: int = h5py.h5a.get_num_attrs(place)
        if count > LIMITS.attributes:
            raise CheckpointError(f"{path or '/'}: has {count} attributes")
        attributes: dict[str, Attribute] = {}
        for index in range(count):
            attribute = h5py.h5a.open(place, index=index)
            name: bytes = attribute.name
            if name not in SCALE_ATTRIBUTES:
                text = name.decode("utf-8", "replace")
                attributes[text] = self._attribute(attribute, f"{path or '/'}@{text}")
        return attributes

    def _attribute(self, attribute: Handle, path: str) -> Attribute:
        dtype, kind = self._dtype(attribute)
        known = dtype in NUMBERS or _is_text(dtype)
        if attribute.shape != () or not known or dtype.itemsize > LIMITS.attribute_bytes:
            raise CheckpointError(f"{path}: is neither a 64-bit number nor a short text")
        stored = np.zeros((), dtype)
        attribute.read(stored, kind)
        value: Any = stored.item()  # Any: untyped, but of the dtype just checked
        return _decode_text(value, path) if isinstance(value, bytes) else value

    def _dtype(self, stored: Handle) -> tuple[np.dtype[Any], Handle]:  # Any: this is what is being found out
        """Return the type of a dataset or an attribute, as numpy and as HDF5 have it."""
        kind = stored.get_type()
        key: bytes = kind.encode()
        if key not in self._dtypes:
            self._dtypes[key] = stored.dtype
        return self._dtypes[key], kind


def _is_text(dtype: np.dtype[Any]) -> bool:
    description = h5py.check_string_dtype(dtype)
    return description is not None and description.length is not None and description.encoding == "utf-8"


def _is_row(dtype: np.dtype[Any]) -> bool:
    if dtype.names is None:
        return dtype in NUMBERS
    return all(dtype[name] in NUMBERS or _is_text(dtype[name]) for name in dtype.names)


def _column(values: NDArray[Any], path: str) -> Column:
    if values.dtype.kind != "S":
        return np.ascontiguousarray(values)
    return tuple(_decode_text(entry, path) for entry in values.tolist())


def _decode_text(text: bytes, path: str) -> str:
    try:
        decoded = text.decode("utf-8", "surrogateescape" if NAMES_OF_FILES.fullmatch(path) else "strict")
    except UnicodeDecodeError:
        raise CheckpointError(f"{path}: a text is not UTF-8") from None
    if "\0" in decoded:
        raise CheckpointError(f"{path}: a text contains a NUL character")
    return decoded


@dataclass(frozen=True)
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
