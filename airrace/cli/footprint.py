"""The command `airrace footprint`: what falls where."""

import textwrap
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from airrace.cli.answer import answer_with_files, answering, ensure_room
from airrace.cli.options import AsJson, Force, Quiet, StageOfFlights, Verbose, output_option

if TYPE_CHECKING:
    from airrace.results import Flight
    from airrace.safety.footprint import Footprint


def footprint(
    name: Annotated[
        str, typer.Argument(metavar="FLIGHT", help="RUN.h5 for its last stage, or RUN.h5:STAGE, or a flight log.")
    ],
    stage: StageOfFlights = None,
    drag_area: Annotated[
        float | None,
        typer.Option(metavar="M2", help="C_D A of the falling aircraft; by default C_D0 times its wing area."),
    ] = None,
    glide_ratio: Annotated[
        float | None, typer.Option(metavar="E", help="Way over height without power; by default that of its polar.")
    ] = None,
    output: Annotated[
        Path | None, output_option("FILE", "Write it: .geojson, .kml, .csv, .png, .svg or .pdf (needs matplotlib).")
    ] = None,
    origin: Annotated[
        str | None, typer.Option(metavar="LAT,LON,ELEV", help="Where the course lies: degrees, metres above the sea.")
    ] = None,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Tell what falls where: free fall and lost power from every instant of a flight, and who stands there.

    This is mechanics, not the scatter formula of an authority, and no prediction.
    """
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.runs.flight_sources import ensure_footprint_file, flight_footprint, open_flight
        from airrace.runs.output import ensure_free

        if output is not None:
            ensure_room(output, as_json=as_json)
            ensure_footprint_file(output)
            ensure_free(output, force=force, sources=[name])
        flight = open_flight(name, stage=stage)
        found = flight_footprint(flight, drag_area, glide_ratio, output, origin)
        answer.fields.update(found.as_object())
        if not as_json and not quiet:
            answer.texts.extend(_texts(found, flight))
        answer_with_files(answer, [] if output is None else [output], quiet=quiet)


def _texts(found: "Footprint", flight: "Flight") -> Iterator[str]:
    """Yield tables of falls, glides and people, and what they are not; at most 80 columns wide."""
    from airrace.cli.tables import PAGE, render
    from airrace.views.footprint_tables import facts, falls_table, people_table

    yield render(falls_table(found, flight), columns=PAGE)
    people = people_table(found, flight)
    if people.rows:
        yield render(replace(people, notes=()), columns=PAGE)
    yield from (textwrap.fill(note, PAGE) for note in people.notes)
    yield "\n".join(textwrap.fill(fact, PAGE, subsequent_indent="  ") for fact in facts(found, flight))
