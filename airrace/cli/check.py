"""The command `airrace check`: it validates the inputs, reviews the course and shows it."""

from pathlib import Path
from typing import Annotated

import typer

from airrace.cli.answer import answering, ensure_room
from airrace.cli.options import AircraftFile, AsJson, Force, Overrides, SettingsFile, TrackFile, Verbose
from airrace.standard_streams import STANDARD, stem_of


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
        from airrace.cli.clearance_tables import planned_table
        from airrace.cli.course_tables import course_tables, remarks_text
        from airrace.cli.plan_view import COLUMNS, plan_view
        from airrace.cli.tables import rendered, takes_unicode, terminal_columns
        from airrace.runs.courses import checked

        course = checked(track, aircraft=aircraft, settings=settings, overrides=overrides or ())
        answer.fields.update(valid=True, **course.as_object())
        if plot is not None:
            ensure_unread([plot], documents_of(course.inputs))
            course.draw(plot)
        if not as_json and plot != STANDARD:
            race, remarks = course.race, course.warnings
            columns, plain = terminal_columns() or COLUMNS, not takes_unicode()
            view = plan_view(course.map_model, race.air.wind, columns=columns, plain=plain)
            tables = course_tables(race)
            tables += [planned_table(course.planned, course.clearances)] if course.clearances else []
            answer.texts += [*(rendered(table) for table in tables), rendered(view)]
            answer.texts += [remarks_text(remarks)] if remarks else []
