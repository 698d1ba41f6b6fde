"""Courses and aircraft built in Python, as documents that a run stores and reads back exactly.

The document is JSON as pydantic writes it, in SI and radians; an element is tagged with the name of its class, as kinds
of elements differ in their fields. Only classes of which courses, air and aircraft consist are built from such a text.
"""

import json
from dataclasses import dataclass
from functools import cache
from types import GenericAlias
from typing import Any, TypeVar, cast

from pydantic import ConfigDict, TypeAdapter, ValidationError
from pydantic_core import PydanticSerializationError, to_json

from airrace.errors import Finding, InputError
from airrace.files.inputs.document import Document
from airrace.files.inputs.nodes import JSON
from airrace.model.aircraft import Aircraft
from airrace.model.environment import Air
from airrace.model.track.course import Course
from airrace.model.track.element import Element
from airrace.procedure.settings import SearchEffort, Settings
from airrace.race import Race

OBJECTS_SCHEMA = "airrace/objects/2"
BEGIN = json.dumps({"schema": OBJECTS_SCHEMA})[:-1]
"""The beginning of such a document."""

T = TypeVar("T")


@dataclass(frozen=True)
class CourseAndAir:
    """A course and the air of the day: the contents of a track file."""

    course: Course
    air: Air


def document_of_objects(objects: CourseAndAir | Aircraft, name: str) -> Document:
    """Return a document that holds these very objects.

    Args:
        objects: a course with its air, or an aircraft.
        name: of the document; runs are named after that of their course.

    Raises:
        InputError: they hold something that is no part of a course or an aircraft.
    """
    try:
        plain = json.loads(to_json(objects, inf_nan_mode="strings", fallback=float))  # float: numbers of numpy
    except PydanticSerializationError as error:
        message = f"a course or an aircraft cannot hold that: {error}"
        raise InputError([Finding(name, 0, 0, "", message)]) from error
    if isinstance(objects, CourseAndAir):
        for passage, written in zip(objects.course.passages, plain["course"]["passages"], strict=True):
            written["element"] = {type(passage.element).__name__: written["element"]}
    return Document(name, json.dumps({"schema": OBJECTS_SCHEMA, "objects": plain}))


def is_of_objects(document: Document) -> bool:
    """Return whether a document holds objects, not YAML."""
    return document.text.startswith(BEGIN)


def course_and_air_of(document: Document) -> CourseAndAir:
    """Return the course and the air of a document.

    Raises:
        InputError: they are not there, or the course cannot be raced.
    """
    course_and_air = _read(document, CourseAndAir)
    passages = course_and_air.course.passages
    names = [passage.name for passage in passages]
    duplicate = next((name for name in names if names.count(name) > 1), "")
    problem = ""
    if len(passages) < 2:
        problem = "a course needs at least two passages: the first is the start, the last the finish"
    elif duplicate:
        problem = f"two passages are called `{duplicate}`; their names must differ"
    elif passages[0].element.position is None:
        problem = f"a race must start somewhere: `{passages[0].element.name}` has no position"
    if problem:
        raise InputError([Finding(document.path, 0, 0, "", problem)])
    return course_and_air


def aircraft_of(document: Document) -> Aircraft:
    """Return the aircraft of a document.

    Raises:
        InputError: it is not there.
    """
    return _read(document, Aircraft)


def resolved_inputs(race: Race, settings: Settings) -> dict[str, JSON]:
    """Return `course`, `aircraft`, `air` and `settings` with all defaults filled in; SI and radians; no limit is null.

    `settings.mesh_check` is left out: a stage stands whichever stages have a mesh check, and its certificate says what
    was measured of it. So are tables where the aircraft has none, and the gap where no search seeks one: runs that were
    stored before there were any stand.
    """
    without_effect = {"mesh_check"} if settings.search is SearchEffort.THOROUGH else {"mesh_check", "gap"}
    excluded = {"settings": without_effect} | ({"aircraft": {"tables"}} if race.aircraft.tables is None else {})
    objects = {"course": race.course, "aircraft": race.aircraft, "air": race.air, "settings": settings}
    plain = json.loads(to_json(objects, exclude=excluded, inf_nan_mode="null"))
    return cast(dict[str, JSON], plain)


def _read(document: Document, kind: type[T]) -> T:
    try:
        plain = json.loads(document.text)["objects"]
        if kind is CourseAndAir:
            classes = _elements(Element)
            for passage in plain["course"]["passages"]:
                ((name, fields),) = passage["element"].items()
                passage["element"] = _build(classes[name], fields)
        return _build(kind, plain)
    except (AttributeError, KeyError, TypeError, ValueError, RecursionError) as error:
        reason = error.errors()[0]["msg"] if isinstance(error, ValidationError) else error
        message = f"does not hold a {kind.__name__} as this version of airrace knows it ({reason})"
        raise InputError([Finding(document.path, 0, 0, "", message)]) from error


def _build(kind: type[T], plain: object) -> T:
    return _reader(kind).validate_python([plain])[0]


@cache
def _reader(kind: Any) -> TypeAdapter[list[Any]]:  # Any: a class, and its instances
    """Return the reader of a list of objects: a list, since pydantic configures no dataclass by itself."""
    hint: Any = GenericAlias(list, (kind,))
    return TypeAdapter(hint, config=ConfigDict(arbitrary_types_allowed=True, extra="forbid"))


def _elements(kind: type[Element]) -> dict[str, type[Element]]:
    """Return the classes of elements that have fields, by name."""
    classes = {kind.__name__: kind} if hasattr(kind, "__dataclass_fields__") else {}
    for subclass in kind.__subclasses__():
        classes |= _elements(subclass)
    return classes
