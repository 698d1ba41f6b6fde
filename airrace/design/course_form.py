"""What a track file says of the race as a whole, as a form: laps, limits, the pilot, and the order of passings."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, get_args

from airrace.design.edits import Edit, Insert, Put, Remove
from airrace.design.pieces import EditableCourse, Plain
from airrace.errors import UsageError
from airrace.files.inputs.course_order import DirectionName
from airrace.files.inputs.nodes import KeyPath, dotted
from airrace.files.inputs.rules import PILOT_PRESETS, LimitsEntry

DIRECTIONS: tuple[str, ...] = get_args(DirectionName)
NUMBERS = ("n_z_max", "n_z_min", "floor_m", "ceiling_m", "start_speed_max_kt", "crowd_distance_m")
"""The rules that are numbers of the form; the file may hold others."""


@dataclass(frozen=True)
class Field:
    """An entry of the form; `value` is None where the file does not have it, `choices` are empty for a number."""

    path: KeyPath
    text: str
    value: Any  # JSON
    choices: tuple[str, ...] = ()


@dataclass(frozen=True)
class PassingItem:
    """A passing in the order of the file; `path` is that of its item, `direction` empty where it says none."""

    path: KeyPath
    gate: str
    direction: str


def fields_of(plain: Plain) -> list[Field]:
    """Return the entries of the form of a track without fault."""
    course: Plain = plain["course"]
    rules: Plain = plain.get("rules") or {}
    fields = [Field(("course", "laps"), "number of laps", course.get("laps"))] if "lap" in course else []
    pilot = rules.get("pilot")
    path: KeyPath = ("rules", "pilot", "preset") if isinstance(pilot, dict) else ("rules", "pilot")
    preset: Any = value_at(plain, path)
    fields.append(Field(path, "the pilot's limits", preset, tuple(PILOT_PRESETS)))
    for key in NUMBERS:
        fields.append(Field(("rules", key), LimitsEntry.model_fields[key].description or key, rules.get(key)))
    return fields


def set_field(plain: Plain, path: KeyPath, value: object) -> list[Edit]:
    """Return the edits that give an entry of the form a value, or with None take it out of the file.

    Raises:
        UsageError: the form has no such entry.
    """
    if path not in {field.path for field in fields_of(plain)}:
        raise UsageError(f"the page does not change {dotted(path)}")
    if value is not None:
        return [Put(path, value)]
    return [] if value_at(plain, path) is None else [Remove(path)]


def passing_items(layout: EditableCourse) -> Iterator[PassingItem]:
    """Yield the passings in the order of the file, that of a repeated lap once."""
    for reference in layout.references:
        yield PassingItem(reference.path, reference.gate or "", reference.direction or "")


def move_passing(layout: EditableCourse, path: KeyPath, later: bool) -> list[Edit]:
    """Return the edits that exchange a passing with the one behind or before it in its lap.

    Raises:
        UsageError: there is no such passing, or none beside it.
    """
    index = path[-1] if path else None
    neighbour = (*path[:-1], index + (1 if later else -1)) if isinstance(index, int) else ()
    if not {path, neighbour} <= {reference.path for reference in layout.references}:
        raise UsageError("this passing has no neighbour in its lap on that side")
    return [Remove(path), Insert(neighbour, value_at(layout.plain, path))]


def direct_passing(layout: EditableCourse, path: KeyPath, direction: str) -> list[Edit]:
    """Return the edits that give a passing a direction; empty for none, so that the file's default holds.

    Raises:
        UsageError: there is no such passing or direction.
    """
    reference = next((reference for reference in layout.references if reference.path == path), None)
    if reference is None or direction not in ("", *DIRECTIONS):
        raise UsageError("there is no such passing or direction")
    if not direction:
        return [] if reference.direction is None else [Remove(reference.direction_path)]
    item = value_at(layout.plain, path)
    if reference.lap and isinstance(item, str):
        return [Put(path, {"gate": item, "direction": direction})]
    return [Put(reference.direction_path, direction)]


def value_at(plain: Plain, path: KeyPath) -> Any:
    """Return what a track holds at a path; None where it holds nothing."""
    value: Any = plain
    for part in path:
        try:
            value = value[part]
        except (KeyError, IndexError, TypeError):
            return None
    return value
