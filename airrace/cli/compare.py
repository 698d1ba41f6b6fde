"""`airrace compare`: flights of the same passings on one clock."""

from pathlib import Path
from typing import Annotated

import typer

from airrace.cli.answer import answering, ensure_room
from airrace.cli.options import AsJson, FlightNames, Force, StageOfFlights, Verbose
from airrace.standard_streams import STANDARD


def compare(
    names: FlightNames,
    stage: StageOfFlights = None,
    plot: Annotated[
        Path | None,
        typer.Option(metavar="FILE.png", help="Draw the comparison into this file (needs matplotlib); or .svg, .pdf."),
    ] = None,
    every: Annotated[bool, typer.Option("--all", help="List the legs that are ties as well.")] = False,
    force: Force = False,
    as_json: AsJson = False,
    verbose: Verbose = False,
) -> None:
    """Hold flights against the first one: where time is lost, leg by leg, and what is flown otherwise there."""
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.errors import UsageError
        from airrace.runs.output import ensure_free
        from airrace.views.drawing import ensure_drawable

        if len(names) < 2:
            raise UsageError("a comparison takes two flights or more, e.g. RUN.h5:point-mass RUN.h5:six-dof")
        if plot is not None:
            ensure_room(plot, as_json=as_json)
            ensure_drawable(plot)
            ensure_free(plot, force=force, sources=names)
        from airrace.cli.compare_tables import comparison_texts
        from airrace.results.comparison import compare_flights
        from airrace.runs.flight_sources import opened_flights
        from airrace.runs.json_objects import compared_object

        reference, *others = opened_flights(names, stage=stage)
        comparisons = [compare_flights(reference, other) for other in others]
        answer.fields.update(compared_object(reference, comparisons))
        if plot is not None:
            from airrace.views.comparison_figure import draw_comparison

            draw_comparison(comparisons, plot)
        if not as_json and plot != STANDARD:
            answer.texts += [text for one in comparisons for text in comparison_texts(one, every=every)]
