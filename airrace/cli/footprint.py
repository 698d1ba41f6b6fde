"""The command `airrace footprint`: what falls where."""

import textwrap
from collections.abc import Iterator
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
        from airrace.runs.flight_sources import open_flight
        from airrace.runs.footprints import ensure_footprint_file, flight_footprint
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
    from airrace.quantities import KNOT
    from airrace.runs.footprints import leg_at, wind_text
    from airrace.safety.footprint import NOT_AN_AUTHORITYS
    from airrace.views.tables import Column, Table

    falls: list[tuple[str | float, ...]] = []
    names = {"vacuum": "in vacuum", "drag": "with drag", "level": "V sqrt(2h/g)"}
    for key, way in found.lengths.items():
        row = int(way.argmax())
        state = (float(found.states.speed[row]) / KNOT, float(found.states.place[row, 2]))
        falls.append((names[key], float(way[row]), float(found.time[row]), *state, leg_at(flight, found.time[row])))
    columns = (
        *(Column("free fall"), Column("way", "m", ".0f"), Column("from", "s", ".2f"), Column("speed", "kt", ".0f")),
        *(Column("height", "m", ".0f"), Column("leg", wraps=True)),
    )
    yield render(Table(f"{flight.label}: the longest ways over ground", columns, falls), columns=PAGE)
    if found.crowds:
        people = [
            (
                *(one.crowd.name, one.crowd.distance, one.distance, one.time, leg_at(flight, one.time)),
                *(one.seconds, one.overlap, one.straight_seconds, one.turned_seconds),
            )
            for one in found.crowds
        ]
        columns = (
            *(Column("people", wraps=True), Column("rule", "m", ".0f"), Column("least", "m", ".0f")),
            *(Column("from", "s", ".2f"), Column("leg", wraps=True), Column("hit", "s", ".2f")),
            *(Column("area", "m2", ".0f"), Column("glide", "s", ".1f"), Column("turn", "s", ".1f")),
        )
        yield render(Table("impacts and people", columns, people), columns=PAGE)
        sentence = (
            "least: distance of the nearest impact, half the span taken off. hit: for how long a fall that begins "
            "meanwhile hits people; area: of theirs under the footprint. glide: for how long a glide straight on leads "
            "over them; turn: for how long they lie within reach of a glide behind a turn."
        )
        yield textwrap.fill(sentence, PAGE)
    else:
        yield "the course names no people (key `crowd`): no distance from them was measured"
    shortest, longest = found.reach.distance.min(), found.reach.distance.max()
    glide = f"without power: {found.glide.ratio:.1f} to 1 at {found.glide.speed / KNOT:.0f} kt ({found.glide_source})"
    facts = [
        f"{glide}, {shortest:.0f} to {longest:.0f} m straight on",
        f"drag area: {found.drag_area:.3g} m2 ({found.drag_source})",
        "ground: flat, at the height of the course's origin; " + wind_text(flight.air.wind),
        NOT_AN_AUTHORITYS,
    ]
    yield "\n".join(textwrap.fill(fact, PAGE, subsequent_indent="  ") for fact in facts)
