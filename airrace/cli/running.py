"""Runs flown at the terminal, watched on stderr and shown in tables: what `optimize` and `resume` share."""

from collections.abc import Sequence

from airrace.procedure.result import StageResult
from airrace.runs.command_result import Answer, ExitCode
from airrace.runs.execute import fly_stages
from airrace.runs.plan import Step, Task, described
from airrace.views.progress_view import watching


def fly(answer: Answer, task: Task, *, threads: int, timeout: float | None, quiet: bool) -> None:
    """Run the stages that are not kept, watched on stderr, and fill in the answer with its tables.

    Args:
        answer: what the command has to say.
        task: what is to be flown.
        threads: threads.
        timeout: the longest wall time, s; None for none.
        quiet: whether neither progress nor tables are shown.
    """
    with watching(task.run.race.course.name, task.stages, quiet=quiet) as progress:
        results = fly_stages(answer, task, threads=threads, timeout=timeout, progress=progress)
    if results and answer.code is not ExitCode.INTERRUPTED and not quiet:
        _tell(answer, task, results)


def describe_task(answer: Answer, task: Task, *, quiet: bool) -> None:
    """Fill in the answer with what would run."""
    steps = task.steps or [Step(stage, "it is not finished") for stage in task.stages]
    answer.fields = {"track": task.run.name, "steps": [step.as_object() for step in steps]}
    answer.texts.extend(() if quiet else ["\n".join(described(steps))])


def _tell(answer: Answer, task: Task, results: Sequence[StageResult]) -> None:
    """Fill in an answer with the tables of what was flown."""
    # Imported here: what draws tables is not needed before there is something to show.
    from airrace.cli.clearance_tables import near_misses_text
    from airrace.cli.split_comparison import comparison_table
    from airrace.cli.tables import PAGE, rendered, result_tables, stages_table
    from airrace.cli.ways_table import ways_table
    from airrace.runs.stage_view import StageView

    climbed = [stages_table(results)] if any(result.holds for result in results) else []
    answer.texts.extend(f"{one.stage.value}: {one.remarks}" for one in results if one.holds and one.remarks)
    ways = [ways_table(one.search) for one in results[:-1] if one.search.ways]
    tables = (*climbed, *ways, *result_tables(results[-1]))
    answer.texts.extend(rendered(table, columns=PAGE) for table in tables)
    last = StageView(task.run.inputs, results[-1], {})
    misses = near_misses_text(last.flight()) if results[-1].is_flight else ""
    answer.texts.extend([misses] if misses else [])
    difference = None if task.start is None else comparison_table(task.start, results)
    answer.texts.extend(() if difference is None else [rendered(difference, columns=PAGE)])
