"""`airrace export`: a flight for other programs. One subcommand per format."""

from pathlib import Path
from typing import Annotated

import typer

from airrace.cli.answer import answering
from airrace.cli.options import RunFile

export = typer.Typer(name="export", help="Write a flight for other programs.", no_args_is_help=True)


@export.callback()
def formats() -> None:
    """Write a flight for other programs."""


@export.command("csv")
def csv_table(
    run_file: RunFile,
    stage: Annotated[str | None, typer.Option(metavar="STAGE", help="Which stage; by default the last one.")] = None,
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
    """Comma-separated values: the flight as one table, the gate splits as another; headers name the units."""
    with answering(as_json=False) as answer:
        from airrace.checkpoint import read_checkpoint
        from airrace.errors import UsageError
        from airrace.runs.csv_texts import flight_text, splits_text
        from airrace.runs.output import ensure_free, write_text
        from airrace.runs.run import stored_run
        from airrace.runs.stage_names import stored_result

        if splits and rate is not None:
            raise UsageError("gate splits have no rate; leave out --splits or --rate")
        beside = [] if splits or output is None else [output.with_suffix(f".splits{output.suffix}")]
        for path in [*([] if output is None else [output]), *beside]:
            ensure_free(path, force=force)
        run = stored_run(read_checkpoint(run_file), run_file)
        result = stored_result(run.checkpoint, stage)
        text = splits_text(result) if splits else flight_text(run, result, rate)
        if output is None:
            answer.texts.append(text)
        else:
            write_text(output, text)
        for path in beside:
            write_text(path, splits_text(result))
