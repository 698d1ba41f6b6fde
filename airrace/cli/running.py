"""Flying a run at the terminal: watched on stderr, told in tables. What `optimize` and `resume` share."""

from collections.abc import Sequence

from airrace.cli.comparison import comparison_table
from airrace.cli.tables import rendered, result_tables, stages_table
from airrace.cli.ways_table import ways_table
from airrace.procedure.restart import Another
from airrace.procedure.result import Stage, StageResult
from airrace.runs.answer import Answer
from airrace.runs.exit_codes import ExitCode
from airrace.runs.flying import available_cores, fly_stages
from airrace.runs.run import Run
from airrace.views.live import watching


def fly(
    answer: Answer,
    run: Run,
    *,
    finished: Sequence[StageResult],
    until: Stage,
    threads: int | None,
    quiet: bool,
    start: Another | None = None,
) -> None:
    """Run the stages that are not finished, watched on stderr, and fill in the answer with its tables.

    Args:
        answer: what the command has to say.
        run: as it stands.
        finished: the stages that are kept.
        until: the last stage.
        threads: threads; None for all cores.
        quiet: whether neither progress nor tables are shown.
        start: another run to start from; None to start from the course alone.
    """
    with watching(run.inputs.race.course.name, quiet=quiet) as progress:
        results = fly_stages(
            answer,
            run,
            finished=finished,
            until=until,
            threads=threads or available_cores(),
            progress=progress,
            start=start,
        )
    if results and answer.code is not ExitCode.INTERRUPTED and not quiet:
        climbed = [stages_table(results)] if any(result.certified for result in results) else []
        answer.texts.extend(f"{one.stage.value}: {one.message}" for one in results if one.certified and one.message)
        ways = [ways_table(one.explored) for one in results[:-1] if one.explored.ways]
        answer.texts.extend(rendered(table) for table in (*climbed, *ways, *result_tables(results[-1])))
        difference = None if start is None else comparison_table(start, results)
        answer.texts.extend(() if difference is None else [rendered(difference)])
