"""`airrace resume`: go on where a run ended."""

from pathlib import Path
from typing import Annotated

import typer

from airrace.cli.answer import answering, unflown
from airrace.cli.exit_codes import ExitCode


def resume(
    run_file: Annotated[Path, typer.Argument(metavar="RUN.h5", readable=False, help="The checkpoint to go on with.")],
    until: Annotated[
        str | None, typer.Option(metavar="STAGE", help="Last stage to run; by default the last available one.")
    ] = None,
    from_stage: Annotated[
        str | None, typer.Option("--from", metavar="STAGE", help="Compute this stage and all after it again.")
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only say what would run, and why.")] = False,
    threads: Annotated[int | None, typer.Option(min=1, metavar="N", help="Threads; by default all cores.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress and no tables.")] = False,
) -> None:
    """Continue a run.

    It goes on after the last stage that still stands, in the same file.
    """
    with answering(unflown(None), as_json=as_json) as answer:
        from airrace.optimal_control.spawn import start_early

        if not dry_run:
            start_early()
        from airrace.checkpoint import read_checkpoint
        from airrace.cli.continuation import continuation, describe
        from airrace.cli.running import fly, stage_named, stored_run
        from airrace.cli.tables import rendered, result_tables

        run = stored_run(read_checkpoint(run_file), run_file)
        plan = continuation(
            run,
            until=stage_named(until),
            from_stage=None if from_stage is None else stage_named(from_stage),
        )
        if dry_run:
            answer.fields = {"track": run.name, "steps": [step.as_object() for step in plan.steps]}
            answer.texts.extend(() if quiet else ["\n".join(describe(plan))])
            return
        results = fly(answer, run, finished=plan.kept, until=plan.until, threads=threads, quiet=quiet)
        if results and answer.code is not ExitCode.INTERRUPTED and not quiet:
            answer.texts.extend(rendered(table) for table in result_tables(results[-1]))
