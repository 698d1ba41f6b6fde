"""`airrace check`: validate the inputs and print the course."""

from pathlib import Path
from typing import Annotated

import typer

from airrace.cli.answer import answering


def check(
    track: Annotated[Path, typer.Argument(metavar="TRACK.yaml", readable=False, help="The course to check.")],
    aircraft: Annotated[
        Path | None,
        typer.Option(metavar="FILE", readable=False, help="Use this aircraft instead of the one the track names."),
    ] = None,
    settings: Annotated[
        Path | None, typer.Option(metavar="FILE", readable=False, help="Settings other than the defaults.")
    ] = None,
    overrides: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change one value, as for optimize.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Validate inputs and print the course."""
    with answering({"track": track.stem, "valid": False}, as_json=as_json) as answer:
        from airrace.cli.course import course_object, course_tables
        from airrace.cli.tables import rendered
        from airrace.documents import load_inputs

        inputs = load_inputs(track, aircraft=aircraft, settings=settings, overrides=overrides or ())
        answer.fields.update(valid=True, **course_object(inputs.race))
        answer.texts.extend(rendered(table) for table in course_tables(inputs.race))
