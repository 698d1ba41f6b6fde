"""A digest of all that a value says, independent of how it is stored."""

import dataclasses
import hashlib
import struct
from collections.abc import Iterator
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airrace.procedure.stage import Stage


def content_digest(value: object) -> str:
    """Return the sha256 (hex) of a frozen dataclass.

    Its fields may be arrays, strings, numbers, enums, tuples and further such dataclasses.

    Numbers count as what they are stored as, 64-bit floats and integers: 1 and 1.0 have the same digest, as they are
    the same after a round trip; 0.0 and -0.0 have not. A field whose metadata say `"counts": "where set"` is left out
    while it is empty, so that a record that was stored before the field existed keeps its digest.

    Raises:
        TypeError: for a value of another kind.
    """
    digest = hashlib.sha256()
    for piece in _pieces(value):
        # Each piece is preceded by its length, so that ("ab", "c") and ("a", "bc") are told apart.
        digest.update(struct.pack("<Q", len(piece)))
        digest.update(piece)
    return digest.hexdigest()


def _pieces(value: object) -> Iterator[bytes]:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        yield type(value).__name__.encode()
        for field in dataclasses.fields(value):
            entry = getattr(value, field.name)
            if field.metadata.get("counts") == "where set" and not entry:
                continue
            yield field.name.encode()
            yield from _pieces(entry)
    elif isinstance(value, tuple):
        members: tuple[object, ...] = value  # pyright: ignore[reportUnknownVariableType]  # narrowed from object
        yield struct.pack("<Q", len(members))
        for member in members:
            yield from _pieces(member)
    elif isinstance(value, np.ndarray):
        yield from _array_pieces(value)  # pyright: ignore[reportUnknownArgumentType]  # narrowed from object
    else:
        yield _scalar(value)


def _array_pieces(array: NDArray[Any]) -> Iterator[bytes]:  # Any: whatever the array's numbers are
    stored = "<f8" if array.dtype.kind == "f" else "<i8"
    yield f"{stored}{array.shape}".encode()
    yield array.astype(stored).tobytes()


def _scalar(value: object) -> bytes:
    match value:
        case None:
            return b"none"
        case Enum() | Stage():
            return f"enum {value.value}".encode()
        case bool() | np.bool_():
            return b"true" if value else b"false"
        case int() | float() | np.integer() | np.floating():
            return b"number" + struct.pack("<d", float(value))  # pyright: ignore[reportUnknownArgumentType]  # numpy's width
        case str():
            return b"text" + value.encode("utf-8", "surrogateescape")
        case _:
            raise TypeError(f"no digest is defined for {type(value).__name__}")
