"""The forms in which Python may give a run its inputs: names, paths or objects."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from airrace.aircraft.aircraft import Aircraft
from airrace.environment.air import Air
from airrace.inputs import Document
from airrace.inputs.batch import set_texts
from airrace.inputs.objects import Scene, document_of_objects
from airrace.planning.race import Race
from airrace.procedure.result import Stage
from airrace.track.course import Course

TrackGiven = str | Path | Course | Race
"""A course by name, its file, or an object: a course in calm standard air, or a race with aircraft and air."""
AircraftGiven = str | Path | Aircraft
"""An aircraft by name, its file, or an object."""
SettingsGiven = str | Path
"""A settings file, by its path."""
Values = Mapping[str, str | int | float | bool] | Sequence[str]
"""Single values by their keys, or texts `key=value`."""


def document_or_path(given: TrackGiven | AircraftGiven | None) -> str | Path | Document | None:
    """Return a name or a path as it is, and an object as the document that holds it."""
    match given:
        case Race(course, _, air):
            return document_of_objects(Scene(course, air), _file_name(course.name))
        case Course():
            return document_of_objects(Scene(given, Air(elevation=given.origin.elevation)), _file_name(given.name))
        case Aircraft():
            return document_of_objects(given, _file_name(given.name))
        case _:
            return given


def aircraft_of(track: TrackGiven | None, aircraft: AircraftGiven | None) -> AircraftGiven | None:
    """Return the aircraft that is asked for: the one that is named, else that of a race."""
    return track.aircraft if aircraft is None and isinstance(track, Race) else aircraft


def value_texts(values: Values) -> list[str]:
    """Return values as `key=value` texts, as `--set` takes them."""
    return set_texts(values) if isinstance(values, Mapping) else [values] if isinstance(values, str) else list(values)


def stage_name(stage: str | Stage | None) -> str | None:
    """Return the name of a stage."""
    return stage.value if isinstance(stage, Stage) else stage


def _file_name(name: str) -> str:
    """Return a name as a file could bear it: runs are called after it."""
    return "_".join("".join(letter if letter.isalnum() else " " for letter in name).lower().split()) or "course"
