"""The resolved inputs, as plain values: what a checkpoint stores beside the documents' texts."""

import dataclasses
import math
from enum import Enum
from functools import cache
from typing import cast

from airrace.inputs.nodes import JSON
from airrace.planning.race import Race
from airrace.procedure.settings import Settings


def resolved_inputs(race: Race, settings: Settings) -> dict[str, JSON]:
    """Return `course`, `aircraft`, `air` and `settings` with all defaults filled in; SI and radians.

    `settings.mesh_check` is left out: a stage stands whichever stages have a mesh check, and its certificate says what
    was measured of it.
    """
    return {
        "course": _plain(race.course),
        "aircraft": _plain(race.aircraft),
        "air": _plain(race.air),
        "settings": {name: _plain(getattr(settings, name)) for name in field_names(Settings) if name != "mesh_check"},
    }


def _plain(value: object) -> JSON:
    match value:
        case float():
            return value if math.isfinite(value) else None  # JSON knows no infinity; null stands for no limit
        case Enum():
            return _plain(value.value)
        case None | bool() | int() | str():
            return value
        case tuple():
            return [_plain(item) for item in cast(tuple[object, ...], value)]
        case _ if dataclasses.is_dataclass(type(value)):
            return {name: _plain(getattr(value, name)) for name in field_names(type(value))}
        case _:
            raise TypeError(f"{type(value).__name__} has no plain form")


@cache
def field_names(kind: type) -> tuple[str, ...]:
    """Return the fields of a dataclass; cached, since a long course asks for the same few thousands of times."""
    return tuple(field.name for field in dataclasses.fields(kind))
