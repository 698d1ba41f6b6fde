"""The command `airrace export`: a flight for other programs. There is one subcommand per format."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, TextIO, cast

import typer

from airrace.cli.answer import answer_written, answering, ensure_room
from airrace.cli.command import Command
from airrace.cli.options import AsJson, FlightNames, Force, Quiet, StageOfFlights, Verbose, output_option
from airrace.standard_streams import STANDARD, abandon_stdout

export = typer.Typer(name="export", help="Write a flight for other programs.", no_args_is_help=True)


FORMATS = {
    "kml": "KML for Google Earth and map viewers: gates, people, lines, the line flown, and the flight in time.",
    "kmz": "KML, zipped.",
    "acmi": "Tacview 2.2: several aircraft with attitude, airspeeds and load factors; passings are events.",
    "fdr": "X-Plane's flight data recorder, version 4, with a mark at every passing; one flight.",
    "czml": "CZML for Cesium: the course, and the flights in time with their attitude.",
    "gpx": "GPX 1.1: gates and pylons as waypoints, a track for every flight.",
    "geojson": "GeoJSON: the course, the lines flown and their passings.",
    "parquet": "Parquet: all histories of all flights in one table (needs pyarrow).",
    "netcdf": "netCDF after the CF conventions: all histories with units; every flight is a trajectory.",
    "mat": "MATLAB: a structure for every flight.",
}
"""The formats that take several flights, and what their subcommands say of themselves."""


@export.callback()
def formats() -> None:
    """Write a flight for other programs."""


@export.command("csv", cls=Command)
def csv_table(
    name: Annotated[
        str, typer.Argument(metavar="FLIGHT", help="RUN.h5 for its last stage, or RUN.h5:STAGE, or a flown log.")
    ],
    stage: StageOfFlights = None,
    rate: Annotated[
        float | None, typer.Option(metavar="HZ", help="Rows per second; by default one row per node of the mesh.")
    ] = None,
    output: Annotated[
        Path, output_option("FILE", "Write here instead of to stdout, and the gate splits beside it.")
    ] = STANDARD,
    splits: Annotated[bool, typer.Option("--splits", help="Write the gate splits instead of the flight.")] = False,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Write comma-separated values: the flight as one table, the gate splits as another.

    Headers name the units. To stdout goes one table alone: the flight, or the gate splits with --splits.
    """
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.errors import UsageError
        from airrace.runs.flight_sources import opened_file, source_of
        from airrace.runs.log_view import LogView
        from airrace.runs.output import ensure_free
        from airrace.runs.sources import Named
        from airrace.runs.splits import Splits
        from airrace.views.streams import PlainStream

        if splits and rate is not None:
            raise UsageError("gate splits have no rate; leave out --splits or --rate")
        ensure_room(output, as_json=as_json)
        beside = [] if splits or output == STANDARD else [output.with_suffix(f".splits{output.suffix}")]
        for path in (output, *beside):
            ensure_free(path, force=force, sources=[name])
        named = Named.of(name)
        flown = source_of(opened_file(named.path), named.stage or stage)
        passings = flown.splits if isinstance(flown, LogView) else Splits(flown.result.splits)
        if output != STANDARD:
            _ = passings.to_csv(output) if splits else flown.to_csv(output, rate)
        elif splits:
            answer.texts.append(passings.to_csv())
        else:
            try:
                flown.write_csv(cast(TextIO, PlainStream(sys.stdout)), rate)
            except BrokenPipeError:  # the reader has seen enough
                abandon_stdout()
        for path in beside:
            passings.to_csv(path)
        answer_written(answer, [output, *beside], quiet=quiet, format="csv", flights=[name])


def _subcommand(name: str) -> Callable[..., None]:
    """Return the subcommand of a format."""

    def write(
        names: FlightNames,
        output: Annotated[
            Path | None, output_option("FILE", "The file; by default beside the first run, as RUN.FORMAT.")
        ] = None,
        stage: StageOfFlights = None,
        rate: Annotated[
            float | None, typer.Option(metavar="HZ", help="Samples per second; by default what suits the format.")
        ] = None,
        origin: Annotated[
            str | None,
            typer.Option(metavar="LAT,LON,ELEV", help="Where the course lies: degrees, and metres above the sea."),
        ] = None,
        start: Annotated[
            str | None,
            typer.Option(metavar="TIME", help="When the clock starts, e.g. 2014-04-13T12:00:00Z; by default in 2000."),
        ] = None,
        force: Force = False,
        as_json: AsJson = False,
        quiet: Quiet = False,
        verbose: Verbose = False,
    ) -> None:
        with answering(as_json=as_json, verbose=verbose) as answer:
            from airrace.runs.exports import output_of, write_flights

            path = output or output_of(name, names)
            ensure_room(path, as_json=as_json)
            write_flights(name, names, path, stage=stage, rate=rate, origin=origin, start=start, force=force)
            answer_written(answer, [path], quiet=quiet, format=name, flights=names)

    return write


for _name, _help in FORMATS.items():
    export.command(_name, help=_help, cls=Command)(_subcommand(_name))
