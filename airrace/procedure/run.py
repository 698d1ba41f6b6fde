"""A run: the stages in order, each started from the one before.

The edges consume the results as they come.
"""

import logging
import math
import time
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial

from airrace.dynamics import handling
from airrace.native.library import MISSING, library_path
from airrace.optimal_control.solvers.service import SolverService
from airrace.planning.plan import plan_race
from airrace.procedure.fidelity import fidelity_of
from airrace.procedure.fidelity_continuation import FidelityContinuation, wanted_stages
from airrace.procedure.recomputation import recertify, recompute
from airrace.procedure.restart import SourceRun, start_from
from airrace.procedure.result import Note, NoteKind, Progress, StageResult, Status
from airrace.procedure.settings import Settings
from airrace.procedure.solver_session import Budget, SolverSession
from airrace.procedure.stage import STAGES, Stage
from airrace.race import Race

logger = logging.getLogger(__name__)

__all__ = ["STAGES", "optimize", "recertify", "recompute"]


def optimize(
    race: Race,
    settings: Settings,
    *,
    until: Stage,
    threads: int,
    finished: Sequence[StageResult] = (),
    start: Sequence[StageResult] = (),
    start_name: str = "another run",
    timeout: float | None = None,
    progress: Progress,
) -> Iterator[StageResult]:
    """Run the stages up to `until` that are not in `finished`; yield each result as it is finished.

    A stage that fails is yielded, too, and is the last. Finished stages that were solved on one mesh, and whose mesh is
    to be checked, are yielded first, each as soon as its check has succeeded or failed.

    Args:
        race: the course, the aircraft and the air.
        settings: how it is solved.
        until: the last stage.
        threads: threads that evaluate derivatives.
        finished: stages of this very race that need not be run again.
        start: stages of another run, of a race with the same passings. The highest of them that holds is the
            start; lower stages are left out. Where it leads to no certified optimum the next lower one is the start,
            and where none does, all stages are run; the first result then has a note that says so. Without effect
            where stages are finished.
        start_name: what users call that other run.
        timeout: the longest wall time of all stages together, s; None for none. No result depends on it: what is not
            finished by then is not there.
        progress: who watches.

    Raises:
        OutOfTime: the stage under way is not finished within `timeout`.
        InputError: aircraft and rules contradict each other.
        UsageError: `start` has no certified or solved stage up to `until`, or flies other passings.
        SolverCrash: the solver process died.
    """
    deadline = math.inf if timeout is None else time.monotonic() + timeout
    stages = STAGES[: STAGES.index(until) + 1]
    source = SourceRun(start_name, start)
    optima = source.optima(stages)
    first = optima[0].stage if optima else Stage.POINT_MASS
    continuation = FidelityContinuation(race, settings, finished, first, last=until)
    if any(fidelity_of(stage).inner_controller for stage in wanted_stages(settings, until)):
        for remark in handling.remarks(race.aircraft):
            logger.warning("%s: %s", race.aircraft.name, remark)
    # A run that was started from another one has no stages below its first: what is finished needs them no more.
    highest = max((STAGES.index(stage) for stage in continuation.done), default=-1)
    wanted = [stage for stage in wanted_stages(settings, until) if STAGES.index(stage) > highest]
    unchecked = [
        one.stage for one in finished if one.holds and not one.certified and continuation.checks_mesh(one.stage)
    ]
    if not (wanted or unchecked):
        return
    service = SolverService(
        threads=threads,
        stall_seconds=settings.solver.stall_seconds,
        deadline=deadline,
        on_notice=lambda text: progress.activity(text, 0, 0),
    )
    budget = Budget.from_plan(plan_race(race), settings.mesh)
    with service, closing(SolverSession(service, settings, progress, threads, deadline, budget)) as session:
        if library_path() is None:
            progress.activity(MISSING, 0, 0)
        for stage in unchecked:
            progress.stage_started(stage)
            yield continuation.check_mesh(stage, session)
        remark = ""
        if start and not finished:
            found, remark = start_from(source, stages, race.course, continuation, session)
            if found is not None:
                result, remark = _with_note(found, remark), ""
                continuation.done[result.stage] = result
                wanted = list(stages[stages.index(result.stage) + 1 :])
                yield result
        yield from _solve_stages(continuation, wanted, session, remark)


def _solve_stages(
    continuation: FidelityContinuation,
    wanted: list[Stage],
    session: SolverSession,
    remark: str,
) -> Iterator[StageResult]:
    """Solve the stages that are wanted, up to the last or to one that fails; yield each as it is finished."""
    for first in wanted[:1]:
        continuation.preload(first, session.service)
    while wanted:
        stage, *wanted = wanted
        session.progress.stage_started(stage)
        if not remark:
            session.reset_log()  # what led nowhere before stays on the record of the stage that was run instead
        for following in wanted[:1]:
            prepare = partial(continuation.prepare, following)
            if continuation.searches(stage):  # on every core: nothing would only wait meanwhile
                prepare()
            else:
                session.service.defer(prepare)
        result = continuation.solve_stage(stage, session)
        result, remark = _with_note(result, remark), ""
        if result.outcome is Status.SOLVED:
            for following in wanted[:1]:  # while the result is stored and flown along
                continuation.preload(following, session.service)
        yield result
        if result.outcome is not Status.SOLVED:
            return


def _with_note(result: StageResult, remark: str) -> StageResult:
    """Return a result with a note on its start; the result itself where there is none."""
    return replace(result, notes=(Note(NoteKind.START, remark), *result.notes)) if remark else result
