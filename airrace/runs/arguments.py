"""The arguments of the public functions that say what is solved: names, files and objects, understood as inputs."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from airrace.aircraft.aircraft import Aircraft
from airrace.environment.atmosphere import Air
from airrace.errors import UsageError
from airrace.inputs import Document, Inputs, load_inputs
from airrace.inputs.objects import CourseAndAir, document_of_objects
from airrace.inputs.overrides import value_text
from airrace.planning.plan import Race
from airrace.procedure.settings import GuessKind, MeshCheck, SearchEffort
from airrace.runs.plan import settings_texts
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
            return document_of_objects(CourseAndAir(course, air), _file_name(course.name))
        case Course():
            still = Air(elevation=given.origin.elevation)
            return document_of_objects(CourseAndAir(given, still), _file_name(given.name))
        case Aircraft():
            return document_of_objects(given, _file_name(given.name))
        case _:
            return given


def aircraft_of(track: TrackGiven | None, aircraft: AircraftGiven | None) -> AircraftGiven | None:
    """Return the aircraft that is asked for: the one that is named, else that of a race."""
    return track.aircraft if aircraft is None and isinstance(track, Race) else aircraft


def value_texts(values: Values) -> list[str]:
    """Return values as `key=value` texts, as `--set` takes them."""
    if isinstance(values, Mapping):
        return [f"{key}={value_text(value)}" for key, value in values.items()]
    return [values] if isinstance(values, str) else list(values)


def read_inputs(
    track: TrackGiven,
    aircraft: AircraftGiven | None = None,
    settings: SettingsGiven | None = None,
    set: Values = (),
    **chosen: str | GuessKind | SearchEffort | MeshCheck | int | None,
) -> Inputs:
    """Return what is given for a race, as objects.

    Args:
        track, aircraft, settings, set: see `optimize`.
        chosen: settings that have arguments of their own; None for what the settings say.

    Raises:
        InputError: they are not valid; it carries all findings.
        UsageError: no course is given.
    """
    named = document_or_path(track)
    if named is None:
        raise UsageError("a course is needed: a name, a file or an object")
    return load_inputs(
        named,
        aircraft=document_or_path(aircraft_of(track, aircraft)),
        settings=settings,
        overrides=[*value_texts(set), *settings_texts(**chosen)],
    )


def _file_name(name: str) -> str:
    """Return a name as a file could bear it: runs are called after it."""
    return "_".join("".join(letter if letter.isalnum() else " " for letter in name).lower().split()) or "course"
