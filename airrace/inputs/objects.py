"""Courses and aircraft built in Python, as documents: what a run stores of them, and reads back exactly.

The document is JSON. Every object is a mapping from the name of its class to its fields, as they are: SI and radians.
Only classes that courses, air and aircraft consist of are ever built from such a text.
"""

import dataclasses
import json
import math
from collections.abc import Mapping
from enum import Enum
from functools import cache
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, cast, get_args, get_origin, get_type_hints

from airrace.aircraft.aircraft import Aircraft
from airrace.environment.air import Air
from airrace.errors import Finding, InputError
from airrace.inputs.document import Document
from airrace.inputs.nodes import JSON
from airrace.planning.race import Race
from airrace.procedure.settings import Settings
from airrace.records import record
from airrace.track.course import Course

OBJECTS_SCHEMA = "airrace/objects/1"
PATH = "<Python>"
BEGIN = json.dumps({"schema": OBJECTS_SCHEMA})[:-1]
"""The text with which such a document begins."""

T = TypeVar("T")


@record
class Scene:
    """A course and the air of the day: what a track file says of a race."""

    course: Course
    air: Air


def document_of_objects(objects: Scene | Aircraft, name: str) -> Document:
    """Return a document that holds these very objects.

    Args:
        objects: a course with its air, or an aircraft.
        name: what the document is called; runs are named after that of their course.
    """
    return Document(name, json.dumps({"schema": OBJECTS_SCHEMA, "objects": _plain(objects)}))


def is_of_objects(document: Document) -> bool:
    """Return whether a document holds objects, and no text that a person wrote."""
    return document.text.startswith(BEGIN)


def scene_of(document: Document) -> Scene:
    """Return the course and the air of a document.

    Raises:
        InputError: they are not there, or the course is none that can be flown.
    """
    scene = _read(document, Scene)
    if problem := _problem(scene.course):
        raise InputError([Finding(document.path, 0, 0, "", problem)])
    return scene


def aircraft_of(document: Document) -> Aircraft:
    """Return the aircraft of a document.

    Raises:
        InputError: it is not there.
    """
    return _read(document, Aircraft)


def _problem(course: Course) -> str:
    """Return why a course cannot be flown, as far as that is seen before anything is planned; empty if it can."""
    if len(course.passages) < 2:
        return "a course needs at least two passages: the first is the start, the last the finish"
    names = [passage.name for passage in course.passages]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        return f"two passages are called `{twice}`; their names must differ"
    start = course.passages[0].element
    if start.position is None:
        return f"a race must start somewhere: `{start.name}` has no position"
    return ""


def _plain(value: object) -> JSON:
    """Return a value as JSON holds it; infinities are the texts `inf` and `-inf`."""
    match value:
        case Enum():
            return _plain(value.value)
        case None | bool() | int() | str():
            return value
        case float():
            return value if math.isfinite(value) else str(value)
        case tuple():
            return [_plain(item) for item in cast(tuple[object, ...], value)]
        case _ if dataclasses.is_dataclass(type(value)):
            fields = {name: _plain(getattr(value, name)) for name in field_names(type(value))}
            return {type(value).__name__: fields}
        case _:
            return _plain_number(value)


def _plain_number(value: object) -> JSON:
    """Return a number of another library, such as numpy's, as one of Python's."""
    if hasattr(value, "__index__"):
        return int(cast(int, value))
    if hasattr(value, "__float__"):
        return _plain(float(cast(float, value)))
    raise InputError([Finding(PATH, 0, 0, "", f"a course or an aircraft cannot hold a {type(value).__name__}")])


def _read(document: Document, kind: type[T]) -> T:
    try:
        found = _built(kind, json.loads(document.text)["objects"])
    except (AttributeError, KeyError, TypeError, ValueError, RecursionError) as error:
        message = f"does not hold a {kind.__name__} as this version of airrace knows it ({error})"
        raise InputError([Finding(document.path, 0, 0, "", message)]) from error
    return cast(T, found)


# Any: a type hint, and JSON that `_plain` wrote; what does not fit raises.
def _built(hint: Any, plain: Any) -> object:
    """Return the value of a type hint that a piece of JSON stands for."""
    if get_origin(hint) in (Union, UnionType):
        return _built(_chosen(get_args(hint), plain), plain)
    if get_origin(hint) is tuple:
        return tuple(_built(get_args(hint)[0], item) for item in plain)
    if hint is NoneType:
        return None
    if hint is float:
        return float(plain)
    return _built_class(hint, plain)


def _built_class(hint: Any, plain: Any) -> object:
    """Return a choice, a plain value or an object, as the class says."""
    if issubclass(hint, Enum):
        return hint(plain)
    if hint in (bool, int, str):
        if type(plain) is not hint:
            raise TypeError(f"{plain!r} is no {hint.__name__}")
        return plain
    name = _name_of(plain)
    fields: Mapping[str, Any] = plain[name]
    kind = _named(hint, name)
    hints = _hints(kind)
    return kind(**{field: _built(hints[field], value) for field, value in fields.items()})


def _name_of(plain: Any) -> str:
    (name,) = plain
    return name


def _chosen(hints: tuple[Any, ...], plain: Any) -> Any:
    """Return the member of a union that a value is of."""
    if plain is None:
        return NoneType
    others = [hint for hint in hints if hint is not NoneType]
    if not isinstance(plain, dict):
        return others[0]
    name = _name_of(plain)
    for hint in others:
        if name in (kind.__name__ for kind in (hint, *_heirs(hint))):
            return hint
    raise TypeError(f"{name} is not known here")


def _named(hint: Any, name: str) -> type:
    """Return the class of this name: the hinted one, or one that inherits from it."""
    kinds: list[type] = [hint, *_heirs(hint)]
    for kind in kinds:
        if kind.__name__ == name and hasattr(kind, "__dataclass_fields__"):
            return kind
    raise TypeError(f"{name} is no {hint.__name__}")


def _heirs(kind: type) -> list[type]:
    return [heir for child in kind.__subclasses__() for heir in (child, *_heirs(child))]


@cache
def _hints(kind: type) -> dict[str, Any]:
    return get_type_hints(kind)


def resolved_inputs(race: Race, settings: Settings) -> dict[str, JSON]:
    """Return `course`, `aircraft`, `air` and `settings` with all defaults filled in; SI and radians.

    `settings.mesh_check` is left out: a stage stands whichever stages have a mesh check, and its certificate says what
    was measured of it.
    """
    return {
        "course": _resolved(race.course),
        "aircraft": _resolved(race.aircraft),
        "air": _resolved(race.air),
        "settings": {
            name: _resolved(getattr(settings, name)) for name in field_names(Settings) if name != "mesh_check"
        },
    }


def _resolved(value: object) -> JSON:
    """Return a value for reading alone: unlike in `_plain`, objects go without their class."""
    match value:
        case float():
            return value if math.isfinite(value) else None  # JSON knows no infinity; null stands for no limit
        case Enum():
            return _resolved(value.value)
        case None | bool() | int() | str():
            return value
        case tuple():
            return [_resolved(item) for item in cast(tuple[object, ...], value)]
        case _ if dataclasses.is_dataclass(type(value)):
            return {name: _resolved(getattr(value, name)) for name in field_names(type(value))}
        case _:
            raise TypeError(f"{type(value).__name__} has no plain form")


@cache
def field_names(kind: type) -> tuple[str, ...]:
    """Return the fields of a dataclass; cached, since a long course asks for the same few thousands of times."""
    return tuple(field.name for field in dataclasses.fields(kind))
