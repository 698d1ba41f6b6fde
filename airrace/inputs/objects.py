"""Courses and aircraft built in Python, as documents: what a run stores of them, and reads back exactly.

The document is JSON. Every object is a mapping from the name of its class to its fields, as they are: SI and radians.
Only classes that courses, air and aircraft consist of are ever built from such a text.
"""

import dataclasses
import json
import math
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
class CourseAndAir:
    """A course and the air of the day: what a track file says of a race."""

    course: Course
    air: Air


def document_of_objects(objects: CourseAndAir | Aircraft, name: str) -> Document:
    """Return a document that holds these very objects.

    Args:
        objects: a course with its air, or an aircraft.
        name: what the document is called; runs are named after that of their course.
    """
    return Document(name, json.dumps({"schema": OBJECTS_SCHEMA, "objects": _plain(objects, typed=True)}))


def is_of_objects(document: Document) -> bool:
    """Return whether a document holds objects, and no text that a person wrote."""
    return document.text.startswith(BEGIN)


def course_and_air_of(document: Document) -> CourseAndAir:
    """Return the course and the air of a document.

    Raises:
        InputError: they are not there, or the course is none that can be flown.
    """
    found = _read(document, CourseAndAir)
    passages = found.course.passages
    names = [passage.name for passage in passages]
    twice = next((name for name in names if names.count(name) > 1), "")
    problem = ""
    if len(passages) < 2:
        problem = "a course needs at least two passages: the first is the start, the last the finish"
    elif twice:
        problem = f"two passages are called `{twice}`; their names must differ"
    elif passages[0].element.position is None:
        problem = f"a race must start somewhere: `{passages[0].element.name}` has no position"
    if problem:
        raise InputError([Finding(document.path, 0, 0, "", problem)])
    return found


def aircraft_of(document: Document) -> Aircraft:
    """Return the aircraft of a document.

    Raises:
        InputError: it is not there.
    """
    return _read(document, Aircraft)


def resolved_inputs(race: Race, settings: Settings) -> dict[str, JSON]:
    """Return `course`, `aircraft`, `air` and `settings` with all defaults filled in; SI and radians.

    `settings.mesh_check` is left out: a stage stands whichever stages have a mesh check, and its certificate says what
    was measured of it.
    """
    plain = {name: _plain(getattr(settings, name), typed=False) for name in field_names(Settings)}
    del plain["mesh_check"]
    return {
        "course": _plain(race.course, typed=False),
        "aircraft": _plain(race.aircraft, typed=False),
        "air": _plain(race.air, typed=False),
        "settings": plain,
    }


def _plain(value: object, *, typed: bool) -> JSON:
    """Return a value as JSON holds it.

    To be read back (`typed`), objects carry their class and infinities are the texts `inf` and `-inf`; for reading
    alone they are null, which stands for no limit.
    """
    match value:
        case Enum():
            return _plain(value.value, typed=typed)
        case None | bool() | int() | str():
            return value
        case float():
            return value if math.isfinite(value) else str(value) if typed else None
        case tuple():
            return [_plain(item, typed=typed) for item in cast(tuple[object, ...], value)]
        case _ if dataclasses.is_dataclass(type(value)):
            fields = {name: _plain(getattr(value, name), typed=typed) for name in field_names(type(value))}
            return {type(value).__name__: fields} if typed else fields
        case _ if hasattr(value, "__index__"):  # numbers of other libraries, such as numpy's
            return int(cast(int, value))
        case _ if hasattr(value, "__float__"):
            return _plain(float(cast(float, value)), typed=typed)
        case _:
            message = f"a course or an aircraft cannot hold a {type(value).__name__}"
            raise InputError([Finding(PATH, 0, 0, "", message)])


def _read(document: Document, kind: type[T]) -> T:
    try:
        return cast(T, _build(kind, json.loads(document.text)["objects"]))
    except (AttributeError, KeyError, TypeError, ValueError, RecursionError) as error:
        message = f"does not hold a {kind.__name__} as this version of airrace knows it ({error})"
        raise InputError([Finding(document.path, 0, 0, "", message)]) from error


# Any: a type hint, and JSON that `_plain` wrote; what does not fit raises.
def _build(hint: Any, plain: Any) -> object:
    """Return the value of a type hint that a piece of JSON stands for."""
    if get_origin(hint) in (Union, UnionType):
        if plain is None:
            return None
        others = [one for one in get_args(hint) if one is not NoneType]
        kinds = (one for one in others if len(others) == 1 or set(plain) <= set(_classes(one)))
        return _build(next(kinds, NoneType), plain)
    if get_origin(hint) is tuple:
        return tuple(_build(get_args(hint)[0], item) for item in plain)
    if hint is float:
        return float(plain)
    if issubclass(hint, Enum):
        return hint(plain)
    if hint in (bool, int, str):
        if type(plain) is not hint:
            raise TypeError(f"{plain!r} is no {hint.__name__}")
        return plain
    (name,) = plain
    kind = _classes(hint)[name]
    hints = _hints(kind)
    return kind(**{field: _build(hints[field], value) for field, value in plain[name].items()})


def _classes(kind: type) -> dict[str, type]:
    """Return a class and those that inherit from it, as far as they are dataclasses, by name."""
    classes = {kind.__name__: kind} if hasattr(kind, "__dataclass_fields__") else {}
    for heir in kind.__subclasses__():
        classes = _classes(heir) | classes
    return classes


@cache
def _hints(kind: type) -> dict[str, Any]:
    return get_type_hints(kind)


@cache
def field_names(kind: type) -> tuple[str, ...]:
    """Return the fields of a dataclass; cached, since a long course asks for the same few thousands of times."""
    return tuple(field.name for field in dataclasses.fields(kind))
