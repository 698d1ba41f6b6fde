"""The command `airrace export`: a flight for other programs. There is one subcommand per format."""

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TextIO, cast

import typer
from typer.core import TyperGroup

from airrace.cli.answer import answer_written, answering, ensure_room
from airrace.cli.command import Command
from airrace.cli.options import AsJson, FlightNames, Force, Quiet, StageOfFlights, Verbose, output_option
from airrace.standard_streams import STANDARD, abandon_stdout

if TYPE_CHECKING:
    from airrace.export.formats import Format


class _Formats(TyperGroup):
    """The subcommands: `csv`, and one for every registered format, made when the first of them is looked up."""

    # Any: contexts and commands belong to click, whose place depends on typer's version.
    def list_commands(self, ctx: Any) -> list[str]:
        return [*super().list_commands(ctx), *(name for name in _registered() if name not in self.commands)]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        known = super().get_command(ctx, cmd_name)
        form = None if known else _registered().get(cmd_name)
        return known if form is None else _subcommand(form)


export = typer.Typer(name="export", help="Write a flight for other programs.", no_args_is_help=True, cls=_Formats)


@export.callback()
def common() -> None:
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
        from airrace.runs.output import Named, ensure_free
        from airrace.runs.stage_view import Splits
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


def _registered() -> Mapping[str, "Format"]:
    from airrace.errors import UsageError
    from airrace.export.formats import formats

    try:
        return formats()
    except UsageError as error:
        raise typer.BadParameter(str(error)) from error


def _subcommand(form: "Format") -> Any:  # Any: as above
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
            from airrace.runs.flight_sources import output_of, write_flights

            path = output or output_of(form.name, names)
            ensure_room(path, as_json=as_json)
            write_flights(form.name, names, path, stage=stage, rate=rate, origin=origin, start=start, force=force)
            answer_written(answer, [path], quiet=quiet, format=form.name, flights=names)

    alone = typer.Typer(add_completion=False, rich_markup_mode=None)
    alone.command(form.name, help=form.help, cls=Command)(write)
    return typer.main.get_command(alone)
