"""`airrace resume`: go on where a run ended."""

from typing import Annotated

import typer

from airrace.cli.answer import answering, unflown
from airrace.cli.options import AsJson, LastStage, Quiet, RunFile, Threads


def resume(
    run_file: RunFile,
    until: LastStage = None,
    from_stage: Annotated[
        str | None, typer.Option("--from", metavar="STAGE", help="Compute this stage and all after it again.")
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only say what would run, and why.")] = False,
    threads: Threads = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
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
        fly(answer, run, finished=plan.kept, until=plan.until, threads=threads, quiet=quiet)
