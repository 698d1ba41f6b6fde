"""The command `airrace sweep`: one stage of a run under many values."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from airrace.cli.answer import answer_with_files, answering, ensure_room
from airrace.cli.options import AsJson, Force, Overrides, Quiet, RunFile, Threads, Verbose, output_option, stage_option

ROWS_SHOWN = 30
"""The largest number of combinations that a terminal shows."""


def sweep(
    run_file: RunFile,
    sweep: Annotated[
        list[str],
        typer.Option(
            metavar="KEY=VALUES",
            help="Values of a key as --set takes it: a list 0,5,10, a range first:last:step, or a list of both; "
            "several multiply.",
        ),
    ],
    stage: Annotated[str, stage_option("Which stage.")] = "point-mass",
    overrides: Overrides = None,
    output: Annotated[
        Path | None, output_option("FILE", "Write all combinations, .csv or .parquet (extra: parquet).")
    ] = None,
    force: Force = False,
    threads: Threads = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Solve one stage of a run under every combination of values, some a second.

    Each is solved from its neighbour and measured like a stage that is solved on one mesh. Routes stay those of the
    run; `airrace batch` flies every combination from scratch instead.
    """
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.batch.sweep import ensure_sweep_file
        from airrace.batch.sweep import sweep as solve_sweep
        from airrace.cli.tables import render
        from airrace.runs.command_result import ExitCode
        from airrace.runs.output import ensure_free
        from airrace.views.tables import Table

        if output is not None:
            ensure_room(output, as_json=as_json)
            ensure_sweep_file(output)
            ensure_free(output, force=force, sources=[run_file])
        shows = not quiet and sys.stderr.isatty()

        def tell(done: int, number: int) -> None:
            if shows:
                print(f"\r{done} of {number}", end="" if done < number else "\r\033[K", file=sys.stderr, flush=True)

        found = solve_sweep(
            run_file, sweep, stage=stage, set=overrides or (), threads=threads, output=output, tell=tell
        )
        answer.fields.update(found.as_object())
        table = found.table()
        if not quiet:
            left = len(table.rows) - ROWS_SHOWN
            more = (f"{left} more; --output writes all",) if left > 0 else ()
            answer.texts.append(render(Table(table.title, table.columns, table.rows[:ROWS_SHOWN], more)))
        answer_with_files(answer, [] if output is None else [output], quiet=quiet)
        if unsolved := len(found.points) - found.solved:
            answer.fail(ExitCode.NOT_CERTIFIED, f"{unsolved} of {len(found.points)} combinations have no optimum")
