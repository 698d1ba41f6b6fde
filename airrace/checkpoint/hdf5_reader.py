"""The reader of HDF5 images that nobody vouches for; it returns a tree.

Only what `hdf5_writer.py` writes is accepted: groups; datasets of at most one dimension, stored contiguously in the
image itself, of 64-bit numbers, of fixed-length UTF-8 strings, or of rows of both; scalar attributes of the same types.
So no filter runs, no heap is followed, no link or object reference is resolved, and no size is believed that the bytes
of the image do not bear out.
"""

# h5py ships no types: what comes from it is unknown to the checker, and becomes known in the functions below.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false

import math
import re
from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Any

import h5py
import h5py.h5l
import h5py.h5o
import numpy as np
from numpy.typing import NDArray

from airrace.checkpoint.tree import Attribute, Column, Group, Node, Series, Table
from airrace.errors import CheckpointError

OBJECTS_MAX = 20_000
"""The largest number of groups and datasets that are read."""
DEPTH_MAX = 8
"""The deepest nesting of groups that is read."""
ATTRIBUTES_MAX = 16
"""The largest number of attributes of a group or a dataset."""
ATTRIBUTE_BYTES_MAX = 64_000
"""The size of the largest attribute that is read, bytes; HDF5's own limit is 64 KiB."""
# Attributes of HDF5's dimension scales. They are never read; two of them hold references.
SCALE_ATTRIBUTES = frozenset({b"CLASS", b"NAME", b"DIMENSION_LIST", b"REFERENCE_LIST"})
NAMES_OF_FILES = re.compile(r"/.*/path|/versions\.name")
"""The texts that may be no UTF-8, as names of files on Linux."""
NUMBERS = (np.dtype("<f8"), np.dtype("<i8"))

# Any: h5py's identifiers, which have no types.
Handle = Any


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
            return _Reader(Budget(len(image)), without).group(h5py.h5g.open(file, b"/"), "", 0)
        finally:
            file.close()
    except CheckpointError:
        raise
    except Exception as error:  # h5py's errors have no common root: OSError, KeyError, TypeError, ValueError, ...
        raise CheckpointError(f"the checkpoint's HDF5 content cannot be read: {error}") from error


@dataclass
class Budget:
    """A count of what may still be read: all datasets together cannot hold more bytes than the image does."""

    bytes_left: int
    objects_left: int = OBJECTS_MAX

    def take(self, path: str, *, objects: int = 0, size: int = 0) -> None:
        """Account for objects or bytes before they are read.

        Raises:
            CheckpointError: more is claimed than the image can hold.
        """
        self.objects_left -= objects
        self.bytes_left -= size
        if self.objects_left < 0 or self.bytes_left < 0:
            raise CheckpointError(f"{path or '/'}: claims to hold more than a checkpoint can")


@dataclass
class _Reader:
    """A reader of one image, by HDF5's own calls; it looks at a type once, however often it occurs."""

    budget: Budget
    without: Collection[str] = ()
    _dtypes: dict[bytes, np.dtype[Any]] = field(default_factory=dict[bytes, np.dtype[Any]])

    def group(self, group: Handle, path: str, depth: int) -> Group:
        if depth > DEPTH_MAX:  # hard links can make a group its own member
            raise CheckpointError(f"{path}: groups are nested more than {DEPTH_MAX} deep")
        self.budget.take(path, objects=group.get_num_objs())
        members: dict[str, Node] = {}
        for name in list(group):
            told = name.decode("utf-8", "replace")
            if f"{path}/{told}" not in self.without:
                members[told] = self._member(group, name, f"{path}/{told}", depth)
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

    def _dataset(self, dataset: Handle, path: str) -> Series | Table | str:
        dtype, kind = self._dtype(dataset)
        shape: tuple[int, ...] | None = dataset.shape
        known = _is_text(dtype) if shape == () else _is_row(dtype)
        if shape is None or len(shape) > 1 or not known:
            raise CheckpointError(f"{path}: is neither a text, nor a series of 64-bit numbers, nor a table of both")
        size = math.prod(shape) * dtype.itemsize
        self.budget.take(path, size=size)
        # Only what is stored in one piece, without filters and in this file, has an offset.
        if size and dataset.get_offset() is None:
            raise CheckpointError(f"{path}: is not stored plainly in the file itself")
        if dataset.get_storage_size() != size:
            raise CheckpointError(f"{path}: {size} bytes are declared, {dataset.get_storage_size()} are stored")
        values: NDArray[Any] = np.zeros(shape, dtype)  # Any: one of the types just checked
        dataset.read(h5py.h5s.ALL, h5py.h5s.ALL, values, kind)
        if shape == ():
            return _decoded(values.item(), path)
        if dtype.names is None:
            return Series(values, self._attributes(dataset, path))
        return Table({name: _column(values[name], f"{path}.{name}") for name in dtype.names})

    def _attributes(self, place: Handle, path: str) -> dict[str, Attribute]:
        """Return the scalar attributes of a group or dataset, without those of HDF5's dimension scales."""
        count: int = h5py.h5a.get_num_attrs(place)
        if count > ATTRIBUTES_MAX:
            raise CheckpointError(f"{path or '/'}: has {count} attributes")
        attributes: dict[str, Attribute] = {}
        for index in range(count):
            attribute = h5py.h5a.open(place, index=index)
            name: bytes = attribute.name
            if name not in SCALE_ATTRIBUTES:
                told = name.decode("utf-8", "replace")
                attributes[told] = self._attribute(attribute, f"{path or '/'}@{told}")
        return attributes

    def _attribute(self, attribute: Handle, path: str) -> Attribute:
        dtype, kind = self._dtype(attribute)
        known = dtype in NUMBERS or _is_text(dtype)
        if attribute.shape != () or not known or dtype.itemsize > ATTRIBUTE_BYTES_MAX:
            raise CheckpointError(f"{path}: is neither a 64-bit number nor a short text")
        stored = np.zeros((), dtype)
        attribute.read(stored, kind)
        value: Any = stored.item()  # Any: untyped, but of the dtype just checked
        return _decoded(value, path) if isinstance(value, bytes) else value

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
    return tuple(_decoded(entry, path) for entry in values.tolist())


def _decoded(text: bytes, path: str) -> str:
    try:
        decoded = text.decode("utf-8", "surrogateescape" if NAMES_OF_FILES.fullmatch(path) else "strict")
    except UnicodeDecodeError:
        raise CheckpointError(f"{path}: a text is not UTF-8") from None
    if "\0" in decoded:
        raise CheckpointError(f"{path}: a text contains a NUL character")
    return decoded
