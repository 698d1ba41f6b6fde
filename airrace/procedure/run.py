"""A run: the stages in order, each started from the one before.

The edges consume the results as they come.
"""

import logging
import math
import time
from collections.abc import Iterator, Sequence
from functools import partial

from airrace.dynamics import handling
from airrace.native.library import MISSING, is_missing
from airrace.optimal_control.runge_kutta import RungeKutta
from airrace.optimal_control.solvers.process.service import SolverService
from airrace.planning.race import Race
from airrace.procedure.fidelity import fidelity_of
from airrace.procedure.fidelity_continuation import FidelityContinuation, wanted_stages
from airrace.procedure.progress import Progress
from airrace.procedure.recomputation import recertify, remeasured
from airrace.procedure.restart import (
    SourceRun,
    is_better,
    starting_points,
    superseded,
    warm_start_from,
    with_remark,
)
from airrace.procedure.result import Stage, StageResult, Status
from airrace.procedure.settings import Settings
from airrace.procedure.solver_session import Budget, SolverSession
from airrace.procedure.stage import STAGES
from airrace.records import record
from airrace.system import System

logger = logging.getLogger(__name__)

__all__ = ["STAGES", "optimize", "recertify", "remeasured"]


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

    A stage that fails is yielded, too, and is the last. Finished stages that were solved on one mesh, and are to be
    proved, are yielded first, each as soon as its proof is completed or has failed.

    Args:
        race: what is flown.
        settings: how it is solved.
        until: the last stage.
        threads: threads that evaluate derivatives.
        finished: stages of this very race that need not be run again.
        start: stages of another run, of a race with the same passings. The highest of them that holds is the
            start; lower stages are left out. Where it leads to no certified optimum the next lower one is the start,
            and where none does, all stages are run; the first result then says so in its message. Without any say
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
    another = SourceRun(start_name, start)
    optima = another.optima(STAGES[: STAGES.index(until) + 1])
    ladder = FidelityContinuation(race, settings, finished, optima[0].stage if optima else Stage.POINT_MASS, last=until)
    if any(fidelity_of(stage).inner_controller for stage in wanted_stages(settings, until)):
        for remark in handling.remarks(race.aircraft):
            logger.warning("%s: %s", race.aircraft.name, remark)
    # A run that was started from another one has no stages below its first: what is finished needs them no more.
    highest = max((STAGES.index(stage) for stage in ladder.done), default=-1)
    wanted = [stage for stage in wanted_stages(settings, until) if STAGES.index(stage) > highest]
    unproved = [one.stage for one in finished if one.holds and not one.certified and ladder.proves(one.stage)]
    if not (wanted or unproved):
        return
    solver = settings.solver
    with SolverService(
        threads=threads,
        stall_seconds=solver.stall_seconds,
        deadline=deadline,
        on_notice=lambda text: progress.activity(text, 0, 0),
    ) as service:
        if is_missing():
            progress.activity(MISSING, 0, 0)
        session = SolverSession(service, settings, progress, threads, deadline, Budget.of(race.plan, settings.mesh))
        for stage in unproved:
            progress.stage_started(stage)
            completed = ladder.complete(stage, session)
            yield completed
        found = _Found()
        if start and not finished:
            found = _from_another(another, STAGES[: STAGES.index(until) + 1], race, ladder, session)
        if found.result is not None:
            ladder.done[found.result.stage] = found.result
            wanted = _above(found.result.stage, until)
            yield found.result
        yield from _climbed(ladder, wanted, until, found, session)


@record
class _Found:
    """The outcome of a start from another run; without one, nothing.

    Attributes:
        result: the stage that it led to.
        spare: the stage that it led to where another route has become the faster one; it counts if nothing faster
            is found.
        remark: what is said of it with the next result.
    """

    result: StageResult | None = None
    spare: StageResult | None = None
    remark: str = ""


def _from_another(
    another: SourceRun, stages: Sequence[Stage], race: Race, ladder: FidelityContinuation, session: SolverSession
) -> _Found:
    """Start from another run, and look for a faster route beside it."""
    highest, *_ = starting_points(another, stages, race.course)
    session.service.preload(*_flown(ladder, highest.stage))
    with session.search_in_background(ladder.find_faster_route(highest)) as search:
        result, remark = warm_start_from(another, stages, race.course, ladder, session)
        faster = "" if result is None else search.result()
    if result is None:
        return _Found(remark=remark)
    if faster:
        return _Found(spare=result, remark=superseded(another, result, faster))
    return _Found(with_remark(result, remark))


def _climbed(
    ladder: FidelityContinuation, wanted: Sequence[Stage], until: Stage, found: _Found, session: SolverSession
) -> Iterator[StageResult]:
    """Climb the stages that are wanted, up to the last or to one that fails; yield each as it is finished."""
    remark, spare = found.remark, found.spare
    for first in wanted[:1]:
        session.service.preload(*_flown(ladder, first))
    while wanted:
        stage, *wanted = wanted
        session.progress.stage_started(stage)
        if not remark:
            session.reset_log()  # what led nowhere before stays on the record of the stage that was run instead
        for following in wanted[:1]:
            prepare = partial(_prepare, ladder, following, session.service)
            if ladder.explores(stage):  # on every core: nothing would only wait meanwhile
                prepare()
            else:
                session.service.defer(prepare)
        result = ladder.climb(stage, session)
        if spare is not None and is_better(spare, result):
            result, remark, spare = spare, f"{found.remark}, which led to nothing faster", None
            ladder.done[result.stage], wanted = result, _above(result.stage, until)
        result, remark = with_remark(result, remark), ""
        yield result
        if result.outcome is not Status.SOLVED:
            return


def _prepare(ladder: FidelityContinuation, stage: Stage, service: SolverService) -> None:
    """Get a stage ready that is flown next."""
    service.preload(*_flown(ladder, stage))
    ladder.make_ready(stage)


def _flown(ladder: FidelityContinuation, stage: Stage) -> tuple[System, RungeKutta]:
    """Return what a stage flies, and the scheme that integrates it."""
    return ladder.flight(stage).model.system, fidelity_of(stage).scheme


def _above(stage: Stage, until: Stage) -> list[Stage]:
    """Return the stages above one, up to the last."""
    return list(STAGES[STAGES.index(stage) + 1 : STAGES.index(until) + 1])
