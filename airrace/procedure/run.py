"""A run: the stages in order, each started from the one before. The edges consume the results as they come."""

import logging
from collections.abc import Iterator, Sequence

from airrace.dynamics import handling
from airrace.optimal_control.integration import load_in_background
from airrace.optimal_control.service import SolverService
from airrace.procedure.derived import derived_quantities
from airrace.procedure.ladder import STAGES, Ladder, wanted_stages
from airrace.procedure.progress import Progress
from airrace.procedure.race import Race
from airrace.procedure.result import Outcome, Stage, StageResult
from airrace.procedure.settings import Settings
from airrace.procedure.solving import Workbench
from airrace.procedure.stored import recertified, recertify, sampler

logger = logging.getLogger(__name__)

__all__ = ["STAGES", "derived_quantities", "optimise", "recertified", "recertify", "sampler"]


def optimise(
    race: Race,
    settings: Settings,
    *,
    until: Stage,
    threads: int,
    finished: Sequence[StageResult] = (),
    progress: Progress,
) -> Iterator[StageResult]:
    """Run the stages up to `until` that are not in `finished`; yield each result as it is finished.

    A stage that fails is yielded, too, and is the last.

    Raises:
        InputError: aircraft and rules contradict each other.
        SolverCrash: the solver process died.
    """
    ladder = Ladder(race, settings, finished)
    if STAGES.index(until) > STAGES.index(Stage.POINT_MASS):
        for remark in handling.remarks(race.aircraft):
            logger.warning("%s: %s", race.aircraft.name, remark)
    wanted = [stage for stage in wanted_stages(settings, until) if stage not in ladder.done]
    if not wanted:
        return
    solver = settings.solver
    with SolverService(
        threads=threads,
        compiled=solver.compile_kernels,
        stall_seconds=solver.stall_seconds,
        on_notice=lambda text: progress.activity(text, 0, 0),
    ) as service:
        load_in_background()
        bench = Workbench(service, settings, progress, threads)
        for stage, *later in (wanted[number:] for number in range(len(wanted))):
            progress.stage_started(stage)
            bench.begin()
            for following in later[:1]:
                service.prepare(ladder.flight(following).model.system)
            result = ladder.climb(stage, bench)
            progress.stage_finished(result)
            yield result
            if result.outcome is not Outcome.SOLVED:
                return
