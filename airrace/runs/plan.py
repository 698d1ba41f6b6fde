"""What is to be computed of a run that is new, resumed or changed; decided before anything is."""

import itertools
import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from enum import Enum
from pathlib import Path
from typing import Self

from airrace.checkpoint import Sign, inputs_hash, read_checkpoint, stale_stages
from airrace.errors import Finding, InputError, UsageError
from airrace.inputs import Document, inputs_from_documents, load_inputs
from airrace.inputs.document import AIRCRAFT, TRACKS, read_document
from airrace.inputs.inputs import read_named
from airrace.procedure import run as procedure
from airrace.procedure.fidelity_continuation import checks_mesh
from airrace.procedure.formulation import ensure_same_passings, passings_of
from airrace.procedure.restart import SourceRun
from airrace.procedure.result import Stage, StageResult, Status
from airrace.procedure.settings import GuessKind, MeshCheck
from airrace.records import record
from airrace.runs.output import documents_of, ensure_unread
from airrace.runs.run import Run, document_of, library_versions, new_run, resolved_text, run_of_checkpoint


@record
class PlannedStage:
    """A stage of a plan.

    Attributes:
        stage: which one.
        reason: why it runs, a clause for the user; empty where it is kept.
        unproved: why it is kept but checked on a second mesh first, a clause; empty where it is not.
    """

    stage: Stage
    reason: str
    unproved: str = ""

    @property
    def action(self) -> str:
        """The word for what is done with the stage: `run`, `prove` or `keep`."""
        return "run" if self.reason else "prove" if self.unproved else "keep"

    def as_object(self) -> dict[str, object]:
        return {"stage": self.stage.value, "action": self.action, "reason": self.reason or self.unproved}


@record
class ExecutionPlan:
    """A run and what is to be computed of it.

    Attributes:
        run: the run as it stands.
        until: the last stage.
        reused: results that need not be computed again, though some may still have to be proved.
        steps: every stage up to the last, with the reason why it runs; empty for a run of which nothing exists.
        start: another run to start from; None to start from the course alone.
    """

    run: Run
    until: Stage
    reused: tuple[StageResult, ...] = ()
    steps: tuple[PlannedStage, ...] = ()
    start: SourceRun | None = None

    def signed(self, sign: Sign | None) -> Self:
        """Return this plan with a way to sign the file of its run."""
        return replace(self, run=self.run.signing(sign))

    @property
    def stages(self) -> tuple[Stage, ...]:
        """The stages of the run up to the last, those that are kept as well."""
        if self.steps:
            return tuple(step.stage for step in self.steps)
        stages = tuple(procedure.STAGES)
        without_homotopy = self.run.inputs.settings.guess is GuessKind.PLAN
        return stages[1 if without_homotopy else 0 : stages.index(self.until) + 1]


def step_lines(steps: Sequence[PlannedStage]) -> Iterator[str]:
    """Yield one line per stage that says whether it is run or kept."""
    for step in steps:
        reason = step.reason or step.unproved
        yield f"{step.stage.value}: {step.action}{reason and f' ({reason})'}"


def stage_by_name(text: str | None) -> Stage:
    """Return the stage that a user names, by default the last available one.

    Raises:
        UsageError: no such stage, or not one that can be run.
    """
    stages = tuple(procedure.STAGES)
    if text is None:
        return stages[-1]
    for stage in stages:
        if stage.value == text:
            return stage
    available = ", ".join(stage.value for stage in stages)
    raise UsageError(f"there is no stage {text!r}; available: {available}")


logger = logging.getLogger(__name__)

MESH_CHECK = "settings.mesh_check="
"""The beginning of an override that says which stages are proved."""


@record
class Changes:
    """The differences of a run from the one it is started from; None and empty stand for what stays as it is."""

    track: str | Path | Document | None = None
    aircraft: str | Path | Document | None = None
    settings: str | Path | None = None
    overrides: Sequence[str] = ()

    def __bool__(self) -> bool:
        return any((self.track, self.aircraft, self.settings, self.overrides))

    def with_overrides(self, texts: Sequence[str]) -> Self:
        """Return these changes and further overrides, which are made last."""
        return replace(self, overrides=(*self.overrides, *texts))


def open_source_run(path: Path) -> Run:
    """Open the run to start from, with one warning if other versions have written it.

    Its flight is only a start, and what is found is certified anew, so other versions do no harm.

    Raises:
        CheckpointError: the file is damaged, or of another schema.
        InputError: this version of airrace does not accept its inputs.
    """
    checkpoint = read_checkpoint(path)
    others = [
        f"{name} {checkpoint.versions.get(name, 'unknown')}"
        for name, number in library_versions().items()
        if checkpoint.versions.get(name) != number
    ]
    if others:
        logger.warning(
            "%s was written with %s; its flight is only a start, and what is found is certified anew",
            path,
            ", ".join(others),
        )
    return run_of_checkpoint(checkpoint, path)


def with_changes(before: Run, changes: Changes, out: Path | None) -> Run:
    """Return a new run: the inputs of a stored one with changes.

    The files that are named replace the stored texts; stored overrides are made before the new ones.

    Raises:
        InputError: the inputs are not valid; it carries all findings.
    """
    findings: list[Finding] = []
    stored = before.checkpoint.inputs
    track, aircraft = document_of(stored.track), document_of(stored.aircraft)
    if changes.track is not None:
        track = read_named(TRACKS, changes.track, findings)
    if changes.aircraft is not None:
        aircraft = read_named(AIRCRAFT, changes.aircraft, findings)
    settings = None if stored.settings is None else document_of(stored.settings)
    if changes.settings is not None:
        settings = read_document(Path(changes.settings), findings)
    if findings or track is None or aircraft is None:
        raise InputError(findings)
    return new_run(inputs_from_documents(track, aircraft, settings, (*stored.overrides, *changes.overrides)), out)


def with_mesh_check(run: Run, mesh_check: MeshCheck | str) -> Run:
    """Return the same run, of which other stages are to be checked on a second mesh. Its stages stand as they did.

    Raises:
        InputError: `mesh_check` is not known.
    """
    stored = run.checkpoint.inputs
    asked = mesh_check.value if isinstance(mesh_check, MeshCheck) else mesh_check
    overrides = (*(text for text in stored.overrides if not text.startswith(MESH_CHECK)), f"{MESH_CHECK}{asked}")
    settings = None if stored.settings is None else document_of(stored.settings)
    inputs = inputs_from_documents(document_of(stored.track), document_of(stored.aircraft), settings, overrides)
    changed = replace(stored, overrides=overrides, resolved=resolved_text(inputs))
    return replace(run, inputs=inputs, checkpoint=replace(run.checkpoint, inputs=changed))


def source_run(before: Run, run: Run, until: Stage) -> SourceRun:
    """Return the run to start from, as the procedure takes it.

    Raises:
        UsageError: it has other passings, or no certified or solved stage up to `until`.
    """
    known = SourceRun(before.label, before.results)
    there, here = (passings_of(one.inputs.race.course) for one in (before, run))
    ensure_same_passings(here, there, known.name)
    stages = tuple(procedure.STAGES)
    known.usable_optima(stages[: stages.index(until) + 1])
    return known


def last_stage(run: Run) -> Stage:
    """Return the last stage that a run holds.

    Raises:
        UsageError: it holds none.
    """
    if not run.results:
        raise UsageError(f"{run.label} has no finished stage to start from")
    return run.results[-1].stage


def continuation(run: Run, *, until: Stage, from_stage: Stage | None = None) -> ExecutionPlan:
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
    steps: list[PlannedStage] = []
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
        steps.append(PlannedStage(stage, reason))
        if stored is not None and not reason:
            kept.append(stored.result)
            if stored.result.status is Status.SOLVED and checks_mesh(run.inputs.settings, stage, until):
                steps[-1] = replace(steps[-1], unproved="it was solved on one mesh")
    return ExecutionPlan(run, until, tuple(kept), tuple(steps))


def starting_steps(start: SourceRun, until: Stage) -> tuple[PlannedStage, ...]:
    """Return the steps of a new run that is started from another one, if nothing stands in the way of that."""
    stages = tuple(procedure.STAGES)
    first = start.optima(stages[: stages.index(until) + 1])[0].stage
    climbed = itertools.pairwise(stages[stages.index(first) : stages.index(until) + 1])
    later = (PlannedStage(stage, f"{before.value} runs before it") for before, stage in climbed)
    return (PlannedStage(first, f"started from the one of {start.name}"), *later)


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
    if result.outcome is not Status.SOLVED:
        return f"it ended {result.outcome.value}"
    if result.certificate is not None and not result.holds:
        return "it is not certified"
    return ""


def plan_new_run(
    track: str | Path | Document,
    *,
    aircraft: str | Path | Document | None = None,
    settings: str | Path | None = None,
    overrides: Sequence[str] = (),
    until: str | None = None,
    path: Path | None = None,
    start: Run | str | Path | None = None,
) -> ExecutionPlan:
    """Return the plan to fly all stages of a course up to the last.

    Args:
        track, aircraft, settings, overrides: see `load_inputs`.
        until: the name of the last stage; None for the last one there is.
        path: the checkpoint to be written; None for a run that is kept in memory alone.
        start: another run, or its file, whose highest stage that holds is started from.

    Raises:
        InputError: with all findings.
        UsageError: no such stage; the other run has other passings or no optimum, or the file to be written is
            read.
        CheckpointError: the other run cannot be read.
    """
    last = stage_by_name(until)
    run = new_run(load_inputs(track, aircraft=aircraft, settings=settings, overrides=overrides), path)
    before = start.path if isinstance(start, Run) else start
    ensure_unread([] if path is None else [path], [*documents_of(run.inputs), before])
    if start is None:
        return ExecutionPlan(run, last)
    if not isinstance(start, Run):
        start = open_source_run(Path(start))
    return ExecutionPlan(run, last, start=source_run(start, run, last))


def settings_texts(**chosen: Enum | str | int | None) -> list[str]:
    """Return settings that have options of their own as `key=value` texts; None leaves a setting alone."""
    plain = {name: value.value if isinstance(value, Enum) else value for name, value in chosen.items()}
    return [f"settings.{name}={value}" for name, value in plain.items() if value is not None]


def plan_resumed_run(
    run: Run, *, until: str | None = None, from_stage: str | None = None, mesh_check: MeshCheck | str | None = None
) -> ExecutionPlan:
    """Return what is left of a run: the stages after the last one that still stands, and proofs to be completed.

    Args:
        run: the stored run.
        until: the name of the last stage; None for the last one there is.
        from_stage: the name of a stage that is computed again although it may still stand; None for none.
        mesh_check: which stages are proved from now on; None for what the run's settings say.

    Raises:
        InputError: `mesh_check` is not known.
        UsageError: no such stage, or `from_stage` comes after `until`.
    """
    again = None if from_stage is None else stage_by_name(from_stage)
    run = run if mesh_check is None else with_mesh_check(run, mesh_check)
    return continuation(run, until=stage_by_name(until), from_stage=again)


def plan_changed_run(
    before: Run, changes: Changes, *, until: str | None = None, out: Path | None = None
) -> ExecutionPlan:
    """Return a new run with other inputs, started from the highest stage that holds of one that exists.

    Args:
        before: the run that exists.
        changes: what is otherwise.
        until: the name of the last stage; None for the last one that the other run holds.
        out: the checkpoint to be written; None for a run that is kept in memory alone.

    Raises:
        InputError: the changed inputs are not valid; it carries all findings.
        UsageError: there is nothing to start from, or the file to be written is one that is read.
    """
    last = last_stage(before) if until is None else stage_by_name(until)
    run = with_changes(before, changes, out)
    ensure_unread([] if out is None else [out], [*documents_of(run.inputs), before.path])
    start = source_run(before, run, last)
    return ExecutionPlan(run, last, steps=starting_steps(start, last), start=start)
