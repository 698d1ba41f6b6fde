"""The command `airrace export`: a flight for other programs. There is one subcommand per format."""

from pathlib import Path
from typing import Annotated

import typer

from airrace.cli import completion
from airrace.cli.answer import answering
from airrace.cli.options import RunFile

export = typer.Typer(name="export", help="Write a flight for other programs.", no_args_is_help=True)


@export.callback()
def formats() -> None:
    """Write a flight for other programs."""


@export.command("csv")
def csv_table(
    run_file: RunFile,
    stage: Annotated[
        str | None,
        typer.Option(metavar="STAGE", autocompletion=completion.stages, help="Which stage; by default the last one."),
    ] = None,
    rate: Annotated[
        float | None, typer.Option(metavar="HZ", help="Rows per second; by default one row per node of the mesh.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write here instead of to stdout, and the gate splits beside it."),
    ] = None,
    splits: Annotated[bool, typer.Option("--splits", help="Write the gate splits instead of the flight.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Overwrite existing files.")] = False,
) -> None:
    """Write comma-separated values: the flight as one table, the gate splits as another.

    Headers name the units.
    """
    with answering(as_json=False) as answer:
        from airrace.errors import UsageError
        from airrace.runs.output import ensure_free
        from airrace.runs.splits import Splits
        from airrace.runs.stored import opened_run

        if splits and rate is not None:
            raise UsageError("gate splits have no rate; leave out --splits or --rate")
        beside = [] if splits or output is None else [output.with_suffix(f".splits{output.suffix}")]
        for path in [*([] if output is None else [output]), *beside]:
            ensure_free(path, force=force)
        flown = opened_run(run_file).stage(stage)
        passings = Splits(flown.result.splits)
        text = passings.to_csv(output) if splits else flown.to_csv(output, rate)
        answer.texts.extend([text] if output is None else [])
        for path in beside:
            passings.to_csv(path)
