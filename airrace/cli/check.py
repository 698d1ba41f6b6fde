"""`airrace check`: validate the inputs, review the course and show it."""

from pathlib import Path
from typing import Annotated

import typer

from airrace.cli.answer import answering
from airrace.cli.options import AircraftFile, AsJson, Overrides, SettingsFile, TrackFile


def check(
    track: TrackFile,
    aircraft: AircraftFile = None,
    settings: SettingsFile = None,
    overrides: Overrides = None,
    plot: Annotated[
        Path | None,
        typer.Option(metavar="FILE.png", help="Draw the course into this file (needs matplotlib); also .svg or .pdf."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing drawing.")] = False,
    as_json: AsJson = False,
) -> None:
    """Validate inputs, review and show the course."""
    with answering({"track": track.stem, "valid": False}, as_json=as_json) as answer:
        if plot is not None:
            from airrace.cli.course_figure import ensure_drawable

            ensure_drawable(plot, force=force)
        from airrace.cli.course import course_object
        from airrace.cli.course_tables import course_tables, remarks_text
        from airrace.cli.plan_view import COLUMNS, plan_view
        from airrace.cli.scenery import scenery
        from airrace.cli.tables import rendered, takes_unicode, terminal_columns
        from airrace.documents import load_inputs
        from airrace.planning.review import review

        inputs = load_inputs(track, aircraft=aircraft, settings=settings, overrides=overrides or ())
        race, remarks = inputs.race, review(inputs.race)
        answer.fields.update(valid=True, **course_object(race, remarks))
        if plot is not None:
            from airrace.cli.course_figure import draw_course

            draw_course(race, scenery(race), plot)
        if not as_json:
            columns, plain = terminal_columns() or COLUMNS, not takes_unicode()
            view = plan_view(scenery(race), race.air.wind, columns=columns, plain=plain)
            answer.texts += [*(rendered(table) for table in course_tables(race)), rendered(view)]
            answer.texts += [remarks_text(remarks)] if remarks else []
