"""Commands that make pictures for others to watch: `film` and `card`."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from airrace.cli.answer import answer_with_files, answering, ensure_room
from airrace.cli.options import AsJson, FlightNames, Force, NoVerify, Quiet, StageOfFlights, Verbose, output_option
from airrace.report.film import FilmView


def film(
    names: FlightNames,
    output: Annotated[
        Path | None, output_option("FILE.mp4", "The film; or .gif; by default beside the first run, as RUN.mp4.")
    ] = None,
    view: Annotated[
        FilmView, typer.Option(help="Cameras at the gates and in the air, or one view of the report throughout.")
    ] = FilmView.TV,
    form: Annotated[
        str,
        typer.Option("--format", metavar="16:9|9:16|1:1", help="1280x720, 720x1280, 960x960; of a GIF the half."),
    ] = "16:9",
    size: Annotated[
        str | None, typer.Option(metavar="WIDTHxHEIGHT", help="Pixels, instead of a format; e.g. 1920x1080.")
    ] = None,
    fps: Annotated[
        float | None, typer.Option(metavar="N", help="Pictures per second; by default 30, of a GIF 15.")
    ] = None,
    begin: Annotated[
        float | None, typer.Option("--from", metavar="S", help="Where the film begins, on the clock of the race.")
    ] = None,
    end: Annotated[float | None, typer.Option("--to", metavar="S", help="Where it ends; else at the finish.")] = None,
    seconds: Annotated[float | None, typer.Option(metavar="S", help="How long it is, instead of its end.")] = None,
    stage: StageOfFlights = None,
    no_verify: NoVerify = False,
    force: Force = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
    verbose: Verbose = False,
) -> None:
    """Film a flight, with others beside it: the scene of the report as television shows it (needs Chromium, ffmpeg)."""
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.checkpoint.atomic import replace_file
        from airrace.report.film import film_of, film_settings
        from airrace.runs.flight_sources import report_of_flights
        from airrace.runs.output import default_output_path, ensure_free

        path = output or default_output_path(names[0], "mp4")
        settings = film_settings(path, view=view, format=form, size=size, fps=fps, from_=begin, to=end, seconds=seconds)
        ensure_room(path, as_json=as_json)
        ensure_free(path, force=force, sources=names)
        page, opened = report_of_flights(names, stage=stage, verify=not no_verify)
        answer.fail_if_refuted({one.label: one.source.confirmation for one in opened})
        watched = not quiet and sys.stderr.isatty()

        def watch(share: float) -> None:
            print(f"\rfilming: {share:4.0%}", end="\n" if share == 1.0 else "", file=sys.stderr, flush=True)

        replace_file(path, film_of(page, settings, path.suffix, *[watch] * watched))
        answer_with_files(answer, [path], quiet=quiet, format=path.suffix[1:].lower(), flights=names)


def card(
    name: Annotated[
        str, typer.Argument(metavar="FLIGHT", help="RUN.h5 for its last stage, or RUN.h5:STAGE, or a flight log.")
    ],
    output: Annotated[
        Path | None, output_option("FILE.png", "The card; by default beside the run, as RUN.card.png.")
    ] = None,
    stage: StageOfFlights = None,
    no_verify: NoVerify = False,
    force: Force = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
    verbose: Verbose = False,
) -> None:
    """Draw a card of a flight for a message or an article: line, name, aircraft, time, wind (needs Chromium).

    It is 1200 pixels wide and 630 high.
    """
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.checkpoint.atomic import replace_file
        from airrace.report.film import card_of, ensure_card
        from airrace.runs.flight_sources import report_of_flights
        from airrace.runs.output import default_output_path, ensure_free

        path = output or default_output_path(name, "card.png")
        ensure_card(path)
        ensure_room(path, as_json=as_json)
        ensure_free(path, force=force, sources=[name])
        page, opened = report_of_flights([name], stage=stage, verify=not no_verify)
        answer.fail_if_refuted({one.label: one.source.confirmation for one in opened})
        replace_file(path, card_of(page))
        answer_with_files(answer, [path], quiet=quiet, format="png", flights=[name])
