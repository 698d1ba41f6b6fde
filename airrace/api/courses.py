"""Courses before the race: checked, begun, and the shipped ones; the languages of input files."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from airrace import options
from airrace.options import Option

if TYPE_CHECKING:
    from airrace.runs.courses import CourseCheck, CourseFile, ShippedTrack

LANGUAGES = ("track", "aircraft", "settings", "batch", "log")
"""The languages of input files."""


def check(
    track: options.Track,
    *,
    aircraft: options.Aircraft = None,
    settings: options.Settings = None,
    set: options.Set = (),
    plot: Annotated[
        str | Path | None,
        Option("Draw the course into this file (needs matplotlib); also .svg or .pdf.", "FILE.png", written=True),
    ] = None,
    force: options.Force = False,
) -> "CourseCheck":
    """Validate inputs, review and show the course.

    Examples:
        >>> airrace.check("rovinj_2014")
        <CourseCheck Rovinj 2014: 17 passages, 0 warnings>

    Returns:
        Course, aircraft and air, with the warnings of the review as a race director would give them; nothing is solved.
        A notebook shows the course from above.

    Raises:
        InputError: the inputs are not valid; it carries all findings.
        UsageError: no course is given, or the file exists.
        StorageError: the system refused to write the file.
    """
    from airrace.runs.output import documents_of, ensure_free

    path = None if plot is None else Path(plot)
    if path is not None:
        from airrace.pages.views.drawing import ensure_drawable

        ensure_drawable(path)
        ensure_free(path, force=force, sources=[track, aircraft, settings])
    from airrace.runs.courses import check_course
    from airrace.runs.execution_plan import read_inputs

    course = check_course(read_inputs(track, aircraft, settings, set))
    if path is not None:
        ensure_free(path, force=True, sources=documents_of(course.inputs))
        course.draw(path)
    return course


def begin_course(
    name: Annotated[str | Path, Option("Name of the new course.", "NAME", written=True)],
    *,
    like: Annotated[
        str | Path | None,
        Option("Copy this course, a file or the name of a shipped one.", "TRACK", completion="tracks"),
    ] = None,
    from_: Annotated[
        str | Path | None,
        Option("Sketch the course from placemarks: KML, KMZ, GPX, GeoJSON, OpenAir or SeeYou CUP.", "FILE"),
    ] = None,
    yes: Annotated[
        bool, Option("Leave out placemarks that are, or may be, people or safety lines; else they are refused.")
    ] = False,
    force: options.Force = False,
) -> "CourseFile":
    """Write a course to begin with.

    NAME.yaml flies as it stands, and its comments say what every part of it is. track.schema.json, which is written
    beside it, lets editors complete its keys and mark mistakes. - is stdout. What is guessed of placemarks, those that
    are not taken over, and what is to be put right first are listed, and stand at the end of the file.
    """
    from airrace.runs import courses

    return courses.begin_course(name, like=like, from_=from_, yes=yes, force=force)


def tracks() -> "tuple[ShippedTrack, ...]":
    """Return the shipped courses; their names stand for files everywhere.

    Examples:
        >>> [track.name for track in airrace.tracks()][:3]
        ['abu_dhabi_2016', 'air_race_x_2024', 'chiba_2015']
    """
    from airrace.runs.courses import catalogue

    return catalogue().tracks


def schema(
    language: Annotated[str, Option(f"One of: {', '.join(LANGUAGES)}.", "LANGUAGE", choices=LANGUAGES)],
) -> dict[str, object]:
    """Print the JSON Schema of an input file.

    It is draft-07, for editors that complete keys and mark mistakes while you type.

    Raises:
        UsageError: there is no such language.
    """
    from airrace.errors import UsageError
    from airrace.files.inputs.json_schema import json_schema

    if language not in LANGUAGES:
        raise UsageError(f"there is no language {language!r}; known are {', '.join(LANGUAGES)}")
    return json_schema(language)
