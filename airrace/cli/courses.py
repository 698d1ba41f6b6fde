"""Commands around a course: `check`, `design`, `init`, `tracks` and `schema`; and `doctor`, around the installation."""

import json
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from airrace import options
from airrace.api import courses
from airrace.cli.command import command
from airrace.cli.printed_result import PrintedResult, paragraph, takes_unicode, terminal_columns
from airrace.options import Option
from airrace.pages.views.plain_text import one_line
from airrace.runtime.standard_streams import stem_of

if TYPE_CHECKING:
    from airrace.cli.installation import Component
    from airrace.design.designer import Unsaved
    from airrace.runs.courses import Catalogue, CourseCheck, CourseFile


@command(courses.check)
def check(command_result: PrintedResult, function: "partial[CourseCheck]") -> None:
    command_result.fields = {"track": stem_of(function.keywords["track"]), "valid": False}
    course = function()
    command_result.fields.update(valid=True, **course.as_object())
    if command_result.shows:
        from airrace.cli.course_tables import course_tables, planned_table, remarks_text
        from airrace.cli.plan_view import COLUMNS, plan_view

        command_result.add(*course_tables(course.race))
        if course.clearances:
            command_result.add(planned_table(course.planned, course.clearances))
        columns, plain = terminal_columns() or COLUMNS, not takes_unicode()
        command_result.add(plan_view(course.map_model, columns=columns, plain=plain))
        if course.warnings:
            command_result.add(remarks_text(course.warnings))


@command(courses.begin_course)
def init(command_result: PrintedResult, function: "partial[CourseFile]") -> None:
    course = function()
    path, sketched = course.path, function.keywords["from_"] is not None
    remark = f"; fly it with `airrace optimize {path} --until point-mass`"
    if sketched:
        remark = f"; look at it with `airrace check {path}`, for placemarks say little"
    if course.faults:
        remark = f"; put right what is listed, until then `airrace check {path}` refuses it"
    command_result.add_files(path, remark=remark, **(course.as_object() if sketched else {}))
    if remarks := [*(remark.text for remark in course.remarks), *course.tasks]:
        command_result.add("\n".join(map(one_line, remarks)))


def _catalogue() -> "Catalogue":
    """List the shipped courses, aircraft and rule books.

    Their names stand for files in every command, and in track files.
    """
    from airrace.runs.courses import catalogue

    return catalogue()


@command(_catalogue)
def tracks(command_result: PrintedResult, function: "partial[Catalogue]") -> None:
    from airrace.pages.views.tables import Column, Table

    catalogue = function()
    command_result.fields.update(catalogue.as_object())
    heads = (*map(Column, ("name", "course", "aircraft")), Column("laps", form="d"), Column("passings", form="d"))
    rows = [(track.name, track.title, track.aircraft, track.laps, track.passages) for track in catalogue.tracks]
    aircraft = [(aircraft.name, aircraft.title) for aircraft in catalogue.aircraft]
    command_result.add(
        Table("courses", heads, rows),
        Table("aircraft", (Column("name"), Column("aircraft")), aircraft),
        paragraph(f"rule books (rules: NAME): {', '.join(catalogue.rules)}"),
    )


@command(courses.schema, without=["as_json", "quiet"])
def schema(command_result: PrintedResult, function: "partial[dict[str, object]]") -> None:
    command_result.add(json.dumps(function(), indent=2))


def _components() -> "tuple[Component, ...]":
    """Examine this installation.

    It tells the versions, what is missing for which command, and whether a problem with a known answer is solved.
    """
    from airrace.cli.installation import examine

    return examine()


@command(_components)
def doctor(command_result: PrintedResult, function: "partial[tuple[Component, ...]]") -> None:
    from airrace.runs.command_result import ExitCode

    command_result.fields = {"healthy": False, "components": []}
    components = function()
    width = max(len(component.name) for component in components)
    lines: list[str] = []
    for component in components:
        state = component.fault or component.found or f"missing, needed for {component.needed_for}"
        lines.append(f"{component.name:<{width}}  {state}")
    command_result.add("\n".join(lines))
    faulty = [component.name for component in components if component.fault]
    command_result.fields.update(healthy=not faulty, components=[asdict(component) for component in components])
    if faulty:
        command_result.fail(ExitCode.BUG, f"this installation does not work: {', '.join(faulty)}")


def _design(
    track: Annotated[Path, Option("The track file to be edited.", "TRACK.yaml")],
    *,
    aircraft: options.Aircraft = None,
    port: Annotated[int, Option("Port; by default a free one.", "N", min=0, max=65535)] = 0,
    browser: Annotated[bool, Option("Only print the address.")] = True,
) -> "Unsaved | None":
    """Lay out a course in the browser: drag gates and see the race time change (extra: design).

    The page is served to this machine alone, under an address with a token, until Ctrl-C. Saving edits the file in
    place; what is not saved lies beside it after every change, as NAME.unsaved.yaml, and is offered at the next start.
    """
    from airrace.design.designer import Designer
    from airrace.errors import UsageError
    from airrace.runtime import interrupts

    try:
        from airrace.design.server import DesignServer
    except ModuleNotFoundError as error:
        raise UsageError(f"the designer needs {error.name}: pip install 'airrace[design]'") from error
    designer = Designer(track, None if aircraft is None else str(aircraft))
    try:
        server = DesignServer(designer, port)
        print(f"{server.address}\nCtrl-C ends it.", flush=True)
        server.run(browser=browser)
    except KeyboardInterrupt:
        interrupts.acknowledge()  # the way in which it ends
    finally:
        unsaved = designer.close()
    return unsaved


@command(_design, without=["as_json", "quiet"])
def design(command_result: PrintedResult, function: "partial[Unsaved | None]") -> None:
    unsaved = function()
    if unsaved is None:
        return
    if unsaved.path is not None:
        command_result.add(f"what was not saved lies in {unsaved.path}")
    else:
        command_result.add(f"what was not saved could be written nowhere; this is it:\n\n{unsaved.text}")
