"""The base of all schemas, and what their fields declare."""

import math
from collections.abc import Iterator
from types import NoneType, UnionType
from typing import Annotated, Any, ClassVar, Literal, Union, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic.fields import FieldInfo

from airrace.quantities import KNOT

# Any: annotations of arbitrary type, inspected at run time.
Annotation = Any

DEGREE = math.radians(1.0)
SI = {"_deg": DEGREE, "_deg_s": DEGREE, "_kt": KNOT, "_kW": 1000.0, "_hPa": 100.0}
"""The SI value of units, by the ending of the key; all other units are SI."""


class Schema(BaseModel):
    """A mapping of a document: unknown keys are errors, nothing is converted, numbers are finite.

    A field is named as in the object that is built of it; its alias, if it has one, is its key in the document.
    `what` names the element in messages ("a level gate"), `form` says how it is written. Where a bare text may stand
    for the mapping, `shorthand` is the key whose value it is.
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)
    what: ClassVar[str] = "this element"
    form: ClassVar[str] = "a mapping (`key: value` lines)"
    shorthand: ClassVar[str | None] = None

    def arguments(self) -> dict[str, Any]:  # Any: values of any type, checked already
        """Return the values that are given, by field: numbers in SI."""
        arguments: dict[str, Any] = {}
        for name, info in type(self).model_fields.items():
            value, key = getattr(self, name), info.alias or name
            if isinstance(value, float):
                value *= next((factor for ending, factor in SI.items() if key.endswith(ending)), 1.0)
            if value is not None:
                arguments[name] = value
        return arguments


class ShorthandSchema(Schema):
    """A mapping for which a bare text may stand."""

    @model_validator(mode="before")
    @classmethod
    def _write_out(cls, value: object) -> object:
        return {cls.shorthand: value} if isinstance(value, str) else value


def optional(description: str, alias: str | None = None) -> Any:  # Any: the declaration of a field of any type
    """Return the declaration of a key that may be left out, with None in its place."""
    return Field(default=None, alias=alias, description=description)


def schema_of(annotation: Annotation) -> type[Schema] | None:
    """Return the schema that is expected here, if it is one and the same for all; else None."""
    plain = bare(annotation)
    return plain if isinstance(plain, type) and issubclass(plain, Schema) else None


def field_of(owner: type[Schema] | None, name: str) -> FieldInfo | None:
    """Return what a schema declares of one of its keys; None if it has no such key."""
    fields = owner.model_fields.items() if owner else ()
    return next((info for key, info in fields if name == (info.alias or key)), None)


def keys_of(owner: type[Schema]) -> list[str]:
    """Return the keys as documents write them."""
    return [info.alias or key for key, info in owner.model_fields.items()]


def constraints_of(found: FieldInfo | None) -> Iterator[object]:
    """Yield the limits that a field declares, of itself or of the type it optionally has."""
    if found is None:
        return
    yield from found.metadata
    for member in members(found.annotation):
        if get_origin(member) is Annotated:
            yield from get_args(member)[1:]


def inner(annotation: Annotation, part: str | int) -> Annotation:
    """Return what is expected one step further down: of a key, of an entry, of an item; None where nothing is."""
    plain = bare(annotation)
    schema = schema_of(plain)
    if schema is not None:
        found = field_of(schema, str(part))
        return found.annotation if found else None
    if get_origin(plain) is dict:
        return get_args(plain)[1]
    return get_args(plain)[0] if get_origin(plain) is list else None


def bare(annotation: Annotation) -> Annotation:
    """Return an annotation without `Annotated[...]` and `| None`."""
    while not isinstance(annotation, type):
        if get_origin(annotation) is Annotated:
            annotation = get_args(annotation)[0]
            continue
        found = members(annotation)
        if len(found) != 1:
            return annotation
        annotation = found[0]
    return annotation


def members(annotation: Annotation) -> list[Annotation]:
    """Return the alternatives of a union, without None."""
    if isinstance(annotation, type) or get_origin(annotation) not in (Union, UnionType):
        return []
    return [member for member in get_args(annotation) if member is not NoneType]


def tags_of(annotation: Annotation) -> dict[str, Annotation]:
    """Return the members of a tagged union by their tags."""
    tags: dict[str, Annotation] = {}
    for member in members(bare(annotation)):
        found = field_of(schema_of(member), "type")
        if found and get_origin(found.annotation) is Literal:
            tags |= dict.fromkeys(get_args(found.annotation), member)
    return tags
