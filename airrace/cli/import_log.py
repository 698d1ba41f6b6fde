"""The command `airrace import`: a log of a flight becomes a flight like any other."""

from pathlib import Path
from typing import Annotated

import typer

from airrace.cli import completion
from airrace.cli.answer import answer_written, answering, ensure_room
from airrace.cli.options import AircraftFile, AsJson, Force, Overrides, Quiet, Verbose, output_option
from airrace.standard_streams import STANDARD, name_of


def import_log(
    log: Annotated[Path, typer.Argument(metavar="LOG", readable=False, help="The log: CSV, GPX, IGC or ACMI.")],
    course: Annotated[
        Path,
        typer.Option(
            metavar="TRACK",
            readable=False,
            autocompletion=completion.tracks,
            help="The course that was flown: a file, or a name that `airrace tracks` lists.",
        ),
    ],
    output: Annotated[
        Path | None, output_option("FILE.h5", "The flight; by default beside the log, as LOG.h5.")
    ] = None,
    mapping: Annotated[
        Path | None, typer.Option(metavar="FILE.yaml", readable=False, help="What the columns of a CSV file mean.")
    ] = None,
    column: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=HEADER", help="One column, e.g. 'altitude=GPS alt [ft]'; as often as you like."),
    ] = None,
    time_zone: Annotated[
        str | None, typer.Option(metavar="ZONE", help="Of times that name none: +02:00 or Europe/Zagreb; else UTC.")
    ] = None,
    noise: Annotated[
        float | None, typer.Option(metavar="M", help="Standard deviation of the positions; estimated by default.")
    ] = None,
    run: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Which run through the course, where there are several.")
    ] = None,
    name: Annotated[str | None, typer.Option(metavar="NAME", help="Which aircraft of an ACMI recording.")] = None,
    aircraft: AircraftFile = None,
    overrides: Overrides = None,
    force: Force = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
    verbose: Verbose = False,
) -> None:
    """Import a flown log: find its run through a course, smooth it, and tell which rules it would break.

    show, report, compare, plot and export take the file that is written.
    """
    with answering({"flown": True, "log": name_of(log)}, as_json=as_json, verbose=verbose) as answer:
        from airrace.runs.output import beside, documents_of, ensure_free, ensure_unread

        path = output or beside(log, "h5")
        ensure_room(path, as_json=as_json)
        ensure_free(path, force=force, sources=[log, course, aircraft, mapping])
        from airrace.api import import_log as imported
        from airrace.cli.flown_tables import flown_texts
        from airrace.runs.json_objects import flown_object

        flown = imported(
            log,
            course,
            aircraft=aircraft,
            set=overrides or (),
            mapping=mapping,
            columns=column or (),
            time_zone=time_zone,
            noise=noise,
            run=run,
            name=name,
        )
        ensure_unread([path], documents_of(flown.inputs))
        flown.save(path)
        answer.fields.update(flown_object(flown))
        if not quiet and path != STANDARD:
            answer.texts.extend(flown_texts(flown))
        answer_written(answer, [path], quiet=quiet)
