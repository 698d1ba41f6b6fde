"""The decision what `resume` does with each stage: keep it, or run it and why."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace

from airrace.checkpoint import inputs_hash, stale_stages
from airrace.errors import UsageError
from airrace.procedure import run as procedure
from airrace.procedure.fidelity_continuation import proves
from airrace.procedure.restart import SourceRun
from airrace.procedure.result import Outcome, Stage, StageResult, State
from airrace.procedure.settings import GuessKind
from airrace.runs.run import Run
from airrace.runs.task import Step, Task


def continuation(run: Run, *, until: Stage, from_stage: Stage | None = None) -> Task:
    """Decide for every stage up to `until`. A stage that follows one that runs, runs, too.

    A stage that was solved on one mesh is kept, and proved if it is the last one or if all are to be proved.

    Args:
        run: the stored run, its inputs understood anew.
        from_stage: computed again although it may still stand; None for none.

    Raises:
        UsageError: `from_stage` comes after `until`.
    """
    stale = dict(stale_stages(run.checkpoint, inputs_hash(run.checkpoint.inputs.resolved)))
    stages = tuple(procedure.STAGES)
    if from_stage is not None and stages.index(from_stage) > stages.index(until):
        raise UsageError(f"{from_stage.value} comes after {until.value}, the last stage: nothing would run")
    steps: list[Step] = []
    kept: list[StageResult] = []
    for stage in stages[: stages.index(until) + 1]:
        stored = run.checkpoint.stage(stage)
        if stage is from_stage:
            reason = "asked for"
        elif steps and steps[-1].reason:
            reason = f"{steps[-1].stage.value} runs before it"
        elif stored is not None:
            reason = stale.get(stage, "") or _unfit(stored.result)
        elif _went_without(run, stage, stages[stages.index(stage) + 1 :], from_stage, stale):
            continue
        else:
            reason = "not finished"
        steps.append(Step(stage, reason))
        if stored is not None and not reason:
            kept.append(stored.result)
            if stored.result.state is State.SOLVED and proves(run.inputs.settings, stage, until):
                steps[-1] = replace(steps[-1], unproved="it was solved on one mesh")
    return Task(run, until, tuple(kept), tuple(steps))


def starting_steps(start: SourceRun, until: Stage) -> tuple[Step, ...]:
    """Return the steps of a new run that is started from another one, if nothing stands in the way of that."""
    stages = tuple(procedure.STAGES)
    first = start.optima(stages[: stages.index(until) + 1])[0].stage
    climbed = itertools.pairwise(stages[stages.index(first) : stages.index(until) + 1])
    later = (Step(stage, f"{before.value} runs before it") for before, stage in climbed)
    return (Step(first, f"started from the one of {start.name}"), *later)


def _went_without(
    run: Run, stage: Stage, later: Sequence[Stage], from_stage: Stage | None, stale: Mapping[Stage, str]
) -> bool:
    """Return whether a stage that is not stored is not needed either.

    A run from a plan has no homotopy; one that was started from another run has no stages below its first, and needs
    them only where nothing of its own stands.
    """
    stored = [one for one in later if run.checkpoint.stage(one) is not None]
    if stage is Stage.HOMOTOPY and run.inputs.settings.guess is GuessKind.PLAN:
        return bool(stored)
    before = later if from_stage not in later else later[: later.index(from_stage)]
    standing = (run.checkpoint.stage(one) for one in before if one not in stale)
    return any(one is not None and not _unfit(one.result) for one in standing)


def _unfit(result: StageResult) -> str:
    """Return why nothing can be built on a stored stage; empty if something can."""
    if result.outcome is not Outcome.SOLVED:
        return f"it ended {result.outcome.value}"
    if result.certificate is not None and not result.holds:
        return "it is not certified"
    return ""
