"""The command `airrace fairness`: what aircraft and air are worth on a course."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from airrace.cli.answer import answer_with_files, answering, ensure_room
from airrace.cli.options import (
    AsJson,
    Force,
    LastStage,
    Overrides,
    Quiet,
    SettingsFile,
    Threads,
    TrackFile,
    Verbose,
    complete_aircraft,
    file_option,
    output_option,
)


def fairness(
    track: TrackFile,
    aircraft: Annotated[
        list[Path] | None,
        file_option(
            "FILE", "An aircraft: a file or a name, e.g. pc9; as often as you like.", complete=complete_aircraft
        ),
    ] = None,
    winds: Annotated[
        str | None,
        typer.Option(metavar="ROSE", help="Winds, e.g. 0,5,10kt@8: from eight directions; by default the course's."),
    ] = None,
    sweep: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY=VALUES", help="Values of another key of the air; as often as you like."),
    ] = None,
    flights: Annotated[
        list[str] | None,
        typer.Option("--flight", metavar="FLIGHT", help="A run or a flight log to normalise; as often as you like."),
    ] = None,
    settings: SettingsFile = None,
    overrides: Overrides = None,
    until: LastStage = None,
    cold: Annotated[
        bool, typer.Option("--cold", help="Find every optimum from the course alone as well, and take the faster one.")
    ] = False,
    output: Annotated[
        Path | None, output_option("DIR", "Keep the runs here; a second call takes up what is there.")
    ] = None,
    csv_file: Annotated[Path | None, typer.Option("--csv", metavar="FILE", help="Write the optima as CSV.")] = None,
    force: Force = False,
    threads: Threads = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Tell what aircraft and air are worth on a course: handicaps, spreads, and times as of still standard air."""
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.inputs import load_inputs
        from airrace.runs.output import documents_of, ensure_free, ensure_unread, write_text

        ensure_room(csv_file, as_json=as_json)
        if csv_file is not None:
            ensure_free(csv_file, force=force, sources=[track, settings, *(aircraft or ()), *(flights or ())])
            ensure_unread([csv_file], documents_of(load_inputs(track, settings=settings, overrides=overrides or ())))
        from airrace.batch.fairness import fairness as find_fairness
        from airrace.batch.planning import parse_sweeps
        from airrace.cli.tables import render
        from airrace.runs.command_result import ExitCode

        found = find_fairness(
            track,
            aircraft=aircraft or (),
            winds=winds,
            sweep=parse_sweeps(sweep or ()),
            flights=flights or (),
            settings=settings,
            set=overrides or (),
            until=until,
            cold=cold,
            output=output,
            threads=threads,
            tell=lambda text: None if quiet else print(text, file=sys.stderr, flush=True),
        )
        answer.fields.update(found.as_object())
        if csv_file is not None:
            write_text(csv_file, found.air_table().csv(".10g"))
        if not quiet:
            answer.texts.extend(render(table) for table in found.tables())
        answer_with_files(answer, [] if csv_file is None else [csv_file], quiet=quiet)
        if found.messages:
            answer.fail(ExitCode.NOT_CERTIFIED, found.messages[0])
