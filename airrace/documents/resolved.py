"""Everything as understood, as plain values: what a checkpoint stores beside the documents' texts."""

import dataclasses
import math
from enum import Enum
from typing import cast

from airrace.documents.nodes import JSON
from airrace.procedure.race import Race
from airrace.procedure.settings import Settings


def resolved_inputs(race: Race, settings: Settings) -> dict[str, JSON]:
    """`course`, `aircraft`, `air` and `settings` with all defaults filled in; SI and radians."""
    return {
        "course": _plain(race.course),
        "aircraft": _plain(race.aircraft),
        "air": _plain(race.air),
        "settings": _plain(settings),
    }


def _plain(value: object) -> JSON:
    match value:
        case Enum():
            return _plain(value.value)
        case float() if not math.isfinite(value):
            return None  # JSON knows no infinity: no limit
        case None | bool() | int() | float() | str():
            return value
        case tuple():
            return [_plain(item) for item in cast(tuple[object, ...], value)]
        case _ if dataclasses.is_dataclass(value):
            return {field.name: _plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
        case _:
            raise TypeError(f"{type(value).__name__} has no plain form")
