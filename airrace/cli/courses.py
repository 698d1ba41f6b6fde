"""Commands around a course: `check`, `design`, `init`, `tracks` and `schema`; and `doctor`, around the installation."""

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from airrace.cli.answer import (
    answer_with_files,
    answering,
    ensure_room,
    paragraph,
    render,
    takes_unicode,
    terminal_columns,
)
from airrace.cli.options import (
    AircraftFile,
    AsJson,
    Force,
    Overrides,
    Quiet,
    SettingsFile,
    TrackFile,
    Verbose,
    file_option,
    track_option,
)
from airrace.standard_streams import STANDARD, stem_of
from airrace.views.plain_text import one_line


def check(
    track: TrackFile,
    aircraft: AircraftFile = None,
    settings: SettingsFile = None,
    overrides: Overrides = None,
    plot: Annotated[
        Path | None,
        typer.Option(metavar="FILE.png", help="Draw the course into this file (needs matplotlib); also .svg or .pdf."),
    ] = None,
    force: Force = False,
    as_json: AsJson = False,
    verbose: Verbose = False,
) -> None:
    """Validate inputs, review and show the course."""
    with answering({"track": stem_of(track), "valid": False}, as_json=as_json, verbose=verbose) as answer:
        from airrace.runs.output import documents_of, ensure_free, ensure_unread

        if plot is not None:
            from airrace.views.drawing import ensure_drawable

            ensure_room(plot, as_json=as_json)
            ensure_drawable(plot)
            ensure_free(plot, force=force, sources=[track, aircraft, settings])
        from airrace.cli.course_tables import course_tables, planned_table, remarks_text
        from airrace.cli.plan_view import COLUMNS, plan_view
        from airrace.inputs import load_inputs
        from airrace.runs.courses import check_course

        course = check_course(load_inputs(track, aircraft=aircraft, settings=settings, overrides=overrides or ()))
        answer.fields.update(valid=True, **course.as_object())
        if plot is not None:
            ensure_unread([plot], documents_of(course.inputs))
            course.draw(plot)
        if not as_json and plot != STANDARD:
            columns, plain = terminal_columns() or COLUMNS, not takes_unicode()
            tables = course_tables(course.race)
            tables += [planned_table(course.planned, course.clearances)] if course.clearances else []
            view = plan_view(course.map_model, columns=columns, plain=plain)
            answer.texts += [*map(render, tables), render(view)]
            answer.texts += [remarks_text(course.warnings)] if course.warnings else []


def init(
    name: Annotated[Path, typer.Argument(metavar="NAME", readable=False, help="Name of the new course.")],
    like: Annotated[Path | None, track_option("Copy this course, a file or a name that comes along.")] = None,
    from_: Annotated[
        Path | None,
        file_option("FILE", "Sketch the course from placemarks: KML, KMZ, GPX or GeoJSON, in race order.", "--from"),
    ] = None,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Write a course to begin with.

    NAME.yaml flies as it stands, and its comments say what every part of it is. track.schema.json, which is written
    beside it, lets editors complete its keys and mark mistakes. - is stdout. What is guessed of placemarks, those that
    are not taken over, and what is to be put right first are listed, and stand at the end of the file.
    """
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.runs.courses import begin_course

        ensure_room(name, as_json=as_json)
        course = begin_course(name, like=like, from_=from_, force=force)
        path, fields = course.path, {} if from_ is None else course.as_object()
        remark = f"; fly it with `airrace optimize {path} --until point-mass`"
        if from_ is not None:
            remark = f"; look at it with `airrace check {path}`, for placemarks say little"
        if course.faults:
            remark = f"; put right what is listed, until then `airrace check {path}` refuses it"
        answer_with_files(answer, [path], quiet=quiet, remark=remark, **fields)
        told = [*(one.text for one in course.remarks), *course.tasks]
        if told and path != STANDARD and not quiet:
            answer.texts.append("\n".join(one_line(text) for text in told))


def tracks(as_json: AsJson = False, verbose: Verbose = False) -> None:
    """List the courses, aircraft and rule books that come along.

    Their names stand for files in every command, and in track files.
    """
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.runs.courses import catalogue
        from airrace.views.tables import Column, Table

        listed = catalogue()
        answer.fields.update(listed.as_object())
        courses = [(one.name, one.title, one.aircraft, one.laps, one.passages) for one in listed.tracks]
        heads = (*map(Column, ("name", "course", "aircraft")), Column("laps", form="d"), Column("passings", form="d"))
        aircraft = [(one.name, one.title) for one in listed.aircraft]
        answer.texts += [
            render(Table("courses", heads, courses)),
            render(Table("aircraft", (Column("name"), Column("aircraft")), aircraft)),
            paragraph(f"rule books (rules: NAME): {', '.join(listed.rules)}"),
        ]


class Language(Enum):
    """A language of input files."""

    TRACK = "track"
    AIRCRAFT = "aircraft"
    SETTINGS = "settings"
    BATCH = "batch"
    LOG = "log"


def schema(
    language: Annotated[
        Language, typer.Argument(metavar="LANGUAGE", help="One of: track, aircraft, settings, batch, log.")
    ],
    verbose: Verbose = False,
) -> None:
    """Print the JSON Schema of an input file.

    It is draft-07, for editors that complete keys and mark mistakes while you type.
    """
    with answering(as_json=False, verbose=verbose) as answer:
        from airrace.inputs.json_schema import schema_text

        answer.texts.append(schema_text(language.value))


def doctor(as_json: AsJson = False, verbose: Verbose = False) -> None:
    """Examine this installation.

    It tells the versions, what is missing for which command, and whether a problem with a known answer is solved.
    """
    with answering({"healthy": False, "components": []}, as_json=as_json, verbose=verbose) as answer:
        from dataclasses import asdict

        from airrace.cli.installation import examine
        from airrace.runs.command_result import ExitCode

        components = examine()
        width = max(len(one.name) for one in components)
        lines = [
            f"{one.name:<{width}}  {one.fault or one.found or f'missing, needed for {one.needed_for}'}"
            for one in components
        ]
        answer.texts.append("\n".join(lines))
        faulty = [one.name for one in components if one.fault]
        answer.fields.update(healthy=not faulty, components=[asdict(one) for one in components])
        if faulty:
            answer.fail(ExitCode.BUG, f"this installation does not work: {', '.join(faulty)}")


def design(
    track: Annotated[Path, typer.Argument(metavar="TRACK.yaml", readable=False, help="The track file to be edited.")],
    aircraft: AircraftFile = None,
    port: Annotated[int, typer.Option(min=0, max=65535, metavar="N", help="Port; by default a free one.")] = 0,
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Only print the address.")] = False,
    verbose: Verbose = False,
) -> None:
    """Lay out a course in the browser: drag gates and see the race time change (extra: design).

    The page is served to this machine alone, under an address with a token, until Ctrl-C. Saving edits the file in
    place; what is not saved by then lies beside it.
    """
    with answering(as_json=False, verbose=verbose) as answer:
        from airrace.design.designer import Designer

        try:
            from airrace.design.server import DesignServer
        except ModuleNotFoundError as error:
            from airrace.errors import UsageError

            raise UsageError(f"the designer needs {error.name}: pip install 'airrace[design]'") from error
        from airrace import interrupts

        designer = Designer(track, None if aircraft is None else str(aircraft))
        try:
            server = DesignServer(designer, port)
            print(f"{server.address}\nCtrl-C ends it.", flush=True)
            server.run(browser=not no_browser)
        except KeyboardInterrupt:
            interrupts.hear()  # the way in which it ends
        finally:
            unsaved = designer.close()
        if unsaved is not None:
            answer.texts.append(f"what was not saved lies in {unsaved}")
