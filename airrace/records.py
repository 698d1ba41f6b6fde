"""Records: dataclasses whose instances stay as they were made, and whose classes are made quickly.

`dataclass(frozen=True)` writes six methods for a class and has each of them compiled, some 0.4 ms. Of a record only
`__init__` is written; its other methods are the same functions for all records. For more than three hundred classes
that gains 0.13 s of the 1.3 s of processor time of `airrace check`, and 0.26 s of 1.6 s to import what flies. In
everything else it is a dataclass: `dataclasses.fields`, `replace` and `asdict` take it.
"""

import dataclasses
import functools
import operator
from collections.abc import Callable
from typing import Any, TypeVar, dataclass_transform, overload

Class = TypeVar("Class", bound=type)


@overload
def record(cls: Class) -> Class: ...
@overload
def record(*, kw_only: bool) -> Callable[[Class], Class]: ...
@dataclass_transform(frozen_default=True, field_specifiers=(dataclasses.field,))
def record(cls: Class | None = None, *, kw_only: bool = False) -> Class | Callable[[Class], Class]:
    """Make a class a dataclass whose instances never change, are equal where their fields are, and can be hashed.

    Of these methods those stay that the class defines itself.

    Args:
        cls: the class.
        kw_only: whether all fields are given by their names.
    """
    return _make(cls) if cls is not None else functools.partial(_make, kw_only=kw_only)


def _make(cls: Class, *, kw_only: bool = False) -> Class:
    own = {name for name, value in vars(cls).items() if value is not None}  # not the `__hash__` left out for `__eq__`
    dataclasses.dataclass(repr=False, eq=False, kw_only=kw_only)(cls)
    for name, method in _SHARED.items():
        if name not in own:
            setattr(cls, name, method)
    return cls


@functools.cache
def _reader(cls: type[Any], *, hashed: bool) -> Callable[[Any], tuple[Any, ...]]:
    """Return what reads the fields that are compared, or hashed."""
    fields = dataclasses.fields(cls)
    names = [one.name for one in fields if (one.hash if hashed and one.hash is not None else one.compare)]
    return operator.attrgetter(*names) if len(names) > 1 else lambda one: tuple(getattr(one, name) for name in names)


def _repr(self: Any) -> str:
    values = (f"{field.name}={getattr(self, field.name)!r}" for field in dataclasses.fields(self) if field.repr)
    return f"{type(self).__qualname__}({', '.join(values)})"


def _eq(self: Any, other: object) -> bool:
    if other.__class__ is not self.__class__:
        return NotImplemented
    values = _reader(self.__class__, hashed=False)
    return values(self) == values(other)


def _hash(self: Any) -> int:
    return hash(_reader(self.__class__, hashed=True)(self))


def _set_once(self: Any, name: str, value: object) -> None:
    """Set a field, which `__init__` does, but none that is set already."""
    if name in self.__dict__ or name not in self.__dataclass_fields__:
        raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
    self.__dict__[name] = value


def _delete(self: Any, name: str) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")


_SHARED = {"__repr__": _repr, "__eq__": _eq, "__hash__": _hash, "__setattr__": _set_once, "__delattr__": _delete}
