"""`airrace plot`: a flight as a drawing."""

from pathlib import Path
from typing import Annotated

import typer

from airrace.cli.answer import answer_written, answering, ensure_room
from airrace.cli.options import AsJson, Force, Quiet, StageOfFlights, Verbose, output_option


def plot(
    name: Annotated[str, typer.Argument(metavar="FLIGHT", help="RUN.h5 for its last stage, or RUN.h5:STAGE.")],
    output: Annotated[
        Path | None,
        output_option(
            "FILE.png", "The drawing; or .svg, .pdf; by default RUN.png, or RUN.kneeboard.png, beside the run."
        ),
    ] = None,
    kneeboard: Annotated[
        bool, typer.Option("--kneeboard", help="One page to hold in the hand: map and table of the gates.")
    ] = False,
    stage: StageOfFlights = None,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Draw a flight: plan and profile by load factor, and histories with their limits (needs matplotlib)."""
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.runs.flight_sources import opened_flight
        from airrace.runs.output import beside, ensure_free
        from airrace.views.drawing import ensure_drawable

        path = output or beside(name, "kneeboard.png" if kneeboard else "png")
        ensure_room(path, as_json=as_json)
        ensure_drawable(path)
        ensure_free(path, force=force, sources=[name])
        flight = opened_flight(name, stage=stage)
        if kneeboard:
            from airrace.views.kneeboard import draw_kneeboard

            draw_kneeboard(flight, path)
        else:
            from airrace.views.flight_figure import draw_flight

            draw_flight(flight, path)
        answer_written(answer, [path], quiet=quiet, format=path.suffix[1:].lower() or "png", flights=[name])
