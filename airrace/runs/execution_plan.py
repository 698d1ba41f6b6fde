"""The plan of a run: what is asked for, and which stages are computed, reused or checked on a second mesh."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Self

from airrace.errors import Finding, InputError, UsageError
from airrace.files.checkpoint import inputs_hash, read_checkpoint, stale_stages
from airrace.files.inputs import Document, Inputs, inputs_from_documents, load_inputs
from airrace.files.inputs.document import AIRCRAFT, TRACKS, read_document
from airrace.files.inputs.inputs import DocumentReader, read_named
from airrace.files.inputs.objects import CourseAndAir, document_of_objects
from airrace.files.inputs.overrides import value_text
from airrace.flights.results.comparison import Comparison
from airrace.model.aircraft import Aircraft
from airrace.model.environment import Air
from airrace.model.track.course import Course
from airrace.options import AircraftGiven, SettingsGiven, TrackGiven, Values
from airrace.procedure import procedure
from airrace.procedure.formulation import ensure_same_passings, passings_of
from airrace.procedure.restart import SourceRun
from airrace.procedure.result import StageResult, Status
from airrace.procedure.schedule import checks_mesh
from airrace.procedure.settings import GuessKind, MeshCheck, SearchEffort
from airrace.procedure.stage import Stage
from airrace.race import Race
from airrace.runs.output import documents_of, ensure_free
from airrace.runs.reserve_attempts import PlannedReserve, asked_text
from airrace.runs.run_state import RunState, compare_stages, new_run, run_of_checkpoint
from airrace.runs.stage_view import StageView
from airrace.runs.stored_inputs import library_versions, stored_documents

logger = logging.getLogger(__name__)


def document_or_path(given: TrackGiven | AircraftGiven | None) -> str | Path | Document | None:
    """Return a name or a path as it is, and an object as the document that holds it."""
    match given:
        case Race(course, _, air):
            return document_of_objects(CourseAndAir(course, air), _file_name(course.name))
        case Course():
            still = Air(elevation=given.origin.elevation)
            return document_of_objects(CourseAndAir(given, still), _file_name(given.name))
        case Aircraft():
            return document_of_objects(given, _file_name(given.name))
        case _:
            return given


def aircraft_of(track: TrackGiven | None, aircraft: AircraftGiven | None) -> AircraftGiven | None:
    """Return the aircraft that is asked for: the one that is named, else that of a race."""
    return track.aircraft if aircraft is None and isinstance(track, Race) else aircraft


def value_texts(values: Values) -> list[str]:
    """Return values as `key=value` texts, as `--set` takes them."""
    if isinstance(values, Mapping):
        return [f"{key}={value_text(value)}" for key, value in values.items()]
    return [values] if isinstance(values, str) else list(values)


def chosen_texts(group: str, **chosen: object) -> list[str]:
    """Return values of a group that have options of their own as `key=value` texts; None leaves a value alone."""
    plain = {name: value.value if isinstance(value, Enum) else value for name, value in chosen.items()}
    return [f"{group}.{name}={value}" for name, value in plain.items() if value is not None]


def in_force(overrides: Sequence[str]) -> tuple[str, ...]:
    """Return overrides, `key=value`, without those that a later one replaces, itself or what it is part of."""
    keys = [text.partition("=")[0].strip() for text in overrides]
    return tuple(
        text
        for place, (text, key) in enumerate(zip(overrides, keys, strict=True))
        if not any(key == later or key.startswith(f"{later}.") for later in keys[place + 1 :])
    )


def read_inputs(
    track: TrackGiven,
    aircraft: AircraftGiven | None = None,
    settings: SettingsGiven | None = None,
    set: Values = (),
    **chosen: str | GuessKind | SearchEffort | MeshCheck | float | None,
) -> Inputs:
    """Return what is given for a race, as objects.

    Args:
        track, aircraft, settings, set: see `optimize`.
        chosen: settings that have arguments of their own; None for what the settings say.

    Raises:
        InputError: they are not valid; it carries all findings.
        UsageError: no course is given.
    """
    source = document_or_path(track)
    if source is None:
        raise UsageError("a course is needed: a name, a file or an object")
    return load_inputs(
        source,
        aircraft=document_or_path(aircraft_of(track, aircraft)),
        settings=settings,
        overrides=[*value_texts(set), *chosen_texts("settings", **chosen)],
    )


def _file_name(name: str) -> str:
    """Return a name as a file could bear it: runs are called after it."""
    return "_".join("".join(letter if letter.isalnum() else " " for letter in name).lower().split()) or "course"


MESH_CHECK_OVERRIDE = "settings.mesh_check="
"""The prefix of an override that says which stages have a mesh check."""


@dataclass(frozen=True)
class PlannedStage:
    """A stage of a plan.

    Attributes:
        stage: which one.
        reason: why it runs, a clause for the user; empty where it is reused.
        unchecked: why it is reused but checked on a second mesh first, a clause; empty where it is not.
    """

    stage: Stage
    reason: str
    unchecked: str = ""

    @property
    def action(self) -> str:
        """The word for what is done with the stage: `run`, `check` or `keep`."""
        return "run" if self.reason else "check" if self.unchecked else "keep"

    def as_object(self) -> dict[str, object]:
        return {"stage": self.stage.value, "action": self.action, "reason": self.reason or self.unchecked}

    def __str__(self) -> str:
        reason = self.reason or self.unchecked
        return f"{self.stage.value}: {self.action}{reason and f' ({reason})'}"


@dataclass(frozen=True)
class ExecutionPlan:
    """A run and what is to be computed of it.

    Attributes:
        run: the run as it stands.
        until: the last stage.
        reused: results that need not be computed again, though some may still need a mesh check.
        steps: every stage up to the last, with the reason why it runs; empty for a run of which nothing exists.
        start: another run to start from; None to start from the course alone.
    """

    run: RunState
    until: Stage
    reused: tuple[StageResult, ...] = ()
    steps: tuple[PlannedStage, ...] = ()
    start: RunState | None = None

    def compare(self, results: Sequence[StageResult]) -> Comparison | None:
        """Compare the flight with that of the run that it started from; None where it has none, or none in common."""
        if self.start is None:
            return None
        start, run = self.start, self.run
        before = [StageView(start.inputs, result, start.checkpoint.versions) for result in start.results]
        after = [StageView(run.inputs, result, run.checkpoint.versions) for result in results]
        return compare_stages(before, after, (self.start.label, self.run.label))

    @property
    def reserve(self) -> PlannedReserve | None:
        """The search for a reserve that follows the last stage; None where none is asked for, or it has ended."""
        reserve = self.run.inputs.reserve
        if reserve is None or reserve.found is not None or self.until is not procedure.STAGES[-1]:
            return None
        attempts = self.run.attempts if self.steps and all(step.action == "keep" for step in self.steps) else ()
        return PlannedReserve(reserve.probability, len(attempts), done=bool(attempts) and attempts[-1].attempt.done)

    @property
    def stages(self) -> tuple[Stage, ...]:
        """The stages of the run up to the last, reused ones as well."""
        if self.steps:
            return tuple(step.stage for step in self.steps)
        without_homotopy = self.run.inputs.settings.guess is GuessKind.PLAN
        return tuple(procedure.STAGES)[1 if without_homotopy else 0 : procedure.STAGES.index(self.until) + 1]


def stage_by_name(text: str | Stage | None) -> Stage:
    """Return the stage that a user names, by default the last available one.

    Raises:
        UsageError: no such stage, or not one that can be run.
    """
    if text is None:
        return procedure.STAGES[-1]
    for stage in procedure.STAGES:
        if text in (stage, stage.value):
            return stage
    raise UsageError(f"there is no stage {text!r}; available: {', '.join(stage.value for stage in procedure.STAGES)}")


@dataclass(frozen=True)
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

    def inputs(self, before: RunState) -> Inputs:
        """Return the inputs of a run with these changes; stored overrides are made before the new ones.

        Raises:
            InputError: the inputs are not valid; it carries all findings.
        """
        findings: list[Finding] = []
        stored_inputs = before.checkpoint.inputs
        track, aircraft, settings = stored_documents(stored_inputs)
        if self.track is not None:
            track = read_named(TRACKS, self.track, findings)
        texts = in_force([*stored_inputs.overrides, *self.overrides])
        if self.aircraft is not None:
            aircraft = read_named(AIRCRAFT, self.aircraft, findings)
        elif track is not None and any(text.partition("=")[0].strip() == "aircraft" for text in self.overrides):
            reader = DocumentReader(texts)
            _, aircraft = reader.track_and_aircraft(track, None)
            findings += reader.findings
        if self.settings is not None:
            settings = read_document(Path(self.settings), findings)
        if findings or track is None or aircraft is None:
            raise InputError(findings)
        return inputs_from_documents(track, aircraft, settings, texts)


def open_source_run(path: Path) -> RunState:
    """Open the run to start from, with one warning if other versions have written it.

    Its flight is only a start, and what is found is certified anew, so other versions do no harm.

    Raises:
        CheckpointError: the file is damaged, or of another schema.
        InputError: this version of airrace does not accept its inputs.
    """
    checkpoint = read_checkpoint(path)
    differing = [
        f"{name} {checkpoint.versions.get(name, 'unknown')}"
        for name, number in library_versions().items()
        if checkpoint.versions.get(name) != number
    ]
    if differing:
        logger.warning(
            "%s was written with %s; its flight is only a start, and what is found is certified anew",
            path,
            ", ".join(differing),
        )
    return run_of_checkpoint(checkpoint, path)


def plan_new_run(
    inputs: Inputs,
    *,
    until: str | Stage | None = None,
    path: Path | None = None,
    start: RunState | str | Path | None = None,
) -> ExecutionPlan:
    """Return the plan to fly all stages of a course up to the last.

    Args:
        inputs: course, aircraft, air and settings.
        until: the last stage; None for the last one there is.
        path: the checkpoint to be written; None for a run that is held in memory alone.
        start: another run, or its file, whose highest stage that holds is started from.

    Raises:
        UsageError: no such stage; the other run has other passings or no optimum, or the file to be written is read.
        CheckpointError: the other run cannot be read.
    """
    last = stage_by_name(until)
    if inputs.reserve is not None and last is not procedure.STAGES[-1]:
        raise UsageError(f"a reserve takes {procedure.STAGES[-1].value}, the last stage: leave out --until")
    if inputs.remark:
        logger.warning("%s: %s", inputs.track.path, inputs.remark)
    run = new_run(inputs, path)
    before = start.path if isinstance(start, RunState) else start
    if path is not None:
        ensure_free(path, force=True, sources=[*documents_of(inputs), before])
    if start is None:
        return ExecutionPlan(run, last)
    source = start if isinstance(start, RunState) else open_source_run(Path(start))
    _ensure_startable(source, run, last)
    return ExecutionPlan(run, last, start=source)


def plan_changed_run(
    before: RunState, changes: Changes, *, until: str | Stage | None = None, path: Path | None = None
) -> ExecutionPlan:
    """Return a new run with other inputs, started from the highest stage that holds of one that exists.

    Args:
        before: the run that exists.
        changes: what is otherwise.
        until: the last stage; None for the last one that the other run holds.
        path: the checkpoint to be written; None for a run that is held in memory alone.

    Raises:
        InputError: the changed inputs are not valid; it carries all findings.
        UsageError: there is nothing to start from, or the file to be written is one that is read.
    """
    if until is None and not before.results:
        raise UsageError(f"{before.label} has no finished stage to start from")
    last = before.results[-1].stage if until is None else stage_by_name(until)
    run = new_run(_with_its_own_reserve(changes, before), path)
    if path is not None:
        ensure_free(path, force=True, sources=[*documents_of(run.inputs), before.path])
    first = _ensure_startable(before, run, last)
    stages = procedure.STAGES[procedure.STAGES.index(first) : procedure.STAGES.index(last) + 1]
    reasons = [f"started from the one of {before.label}", *(f"{stage.value} runs before it" for stage in stages)]
    steps = tuple(PlannedStage(stage, reason) for stage, reason in zip(stages, reasons, strict=False))
    return ExecutionPlan(run, last, steps=steps, start=before)


def _with_its_own_reserve(changes: Changes, before: RunState) -> Inputs:
    """Return the changed inputs: margins of a reserve stay, and say where they were measured; for another reserve that
    is asked for, they are searched for again.
    """
    reserve, after = before.inputs.reserve, changes.inputs(before)
    if reserve is None or reserve.found is None or after.reserve is None or after.reserve.found is None:
        return after
    if asked_text(after.reserve) != asked_text(reserve):
        return changes.with_overrides(["margins=null", "rules.reserve.found=null"]).inputs(before)
    source = reserve.found.source or before.label
    return changes.with_overrides([f"rules.reserve.found.source={value_text(source)}"]).inputs(before)


def _ensure_startable(before: RunState, run: RunState, until: Stage) -> Stage:
    """Return the stage of another run that is started from.

    Raises:
        UsageError: it has other passings, or no certified or solved stage up to `until`.
    """
    passings_before, passings = (passings_of(state.inputs.race.course) for state in (before, run))
    ensure_same_passings(passings, passings_before, before.label)
    stages = procedure.STAGES[: procedure.STAGES.index(until) + 1]
    return SourceRun(before.label, before.results).usable_optima(stages)[0].stage


def plan_resumed_run(
    run: RunState,
    *,
    until: str | Stage | None = None,
    from_stage: str | Stage | None = None,
    mesh_check: MeshCheck | str | None = None,
) -> ExecutionPlan:
    """Return what is left of a run: the stages after the last one that still stands, and mesh checks to be completed.

    A stage that follows one that runs, runs, too. One that was solved on one mesh is reused, and checked on a second
    one if it is the last one or if all are to be.

    Args:
        run: the stored run, its inputs understood anew.
        until: the last stage; None for the last one there is.
        from_stage: a stage that is computed again although it may still stand; None for none.
        mesh_check: which stages have a mesh check from now on; None for what the run's settings say.

    Raises:
        InputError: `mesh_check` is not known.
        UsageError: no such stage, or `from_stage` comes after `until`.
    """
    again = None if from_stage is None else stage_by_name(from_stage)
    last = stage_by_name(until)
    run = run if mesh_check is None else _with_mesh_check(run, mesh_check)
    if again is not None and procedure.STAGES.index(again) > procedure.STAGES.index(last):
        raise UsageError(f"{again.value} comes after {last.value}, the last stage: nothing would run")
    stale = dict(stale_stages(run.checkpoint, inputs_hash(run.checkpoint.inputs.resolved)))
    steps: list[PlannedStage] = []
    reused: list[StageResult] = []
    for number, stage in enumerate(procedure.STAGES[: procedure.STAGES.index(last) + 1]):
        stored_stage = run.checkpoint.stage(stage)
        if stage is again:
            reason = "asked for"
        elif steps and steps[-1].reason:
            reason = f"{steps[-1].stage.value} runs before it"
        elif stored_stage is not None:
            reason = stale.get(stage, "") or _unfit(stored_stage.result)
        elif _went_without(run, stage, procedure.STAGES[number + 1 :], again, stale):
            continue
        else:
            reason = "not finished"
        unchecked = ""
        if stored_stage is not None and not reason:
            reused.append(stored_stage.result)
            if stored_stage.result.status is Status.SOLVED and checks_mesh(run.inputs.settings, stage, last):
                unchecked = "it was solved on one mesh"
        steps.append(PlannedStage(stage, reason, unchecked))
    return ExecutionPlan(run, last, tuple(reused), tuple(steps))


def _with_mesh_check(run: RunState, mesh_check: MeshCheck | str) -> RunState:
    """Return the same run, of which other stages are to be checked on a second mesh. Its stages stand as they did."""
    stored_inputs = run.checkpoint.inputs
    mesh_check_text = mesh_check.value if isinstance(mesh_check, MeshCheck) else mesh_check
    overrides = (
        *(text for text in stored_inputs.overrides if not text.startswith(MESH_CHECK_OVERRIDE)),
        f"{MESH_CHECK_OVERRIDE}{mesh_check_text}",
    )
    return run.with_inputs(inputs_from_documents(*stored_documents(stored_inputs), overrides))


def _went_without(
    run: RunState, stage: Stage, later: Sequence[Stage], from_stage: Stage | None, stale: Mapping[Stage, str]
) -> bool:
    """Return whether a stage that is not stored is not needed either.

    A run from a plan has no homotopy; one that was started from another run has no stages below its first, and needs
    them only where nothing of its own stands.
    """
    if stage is Stage.HOMOTOPY and run.inputs.settings.guess is GuessKind.PLAN:
        return any(run.checkpoint.stage(later_stage) is not None for later_stage in later)
    before = later if from_stage not in later else later[: later.index(from_stage)]
    for earlier in before:
        stored_stage = run.checkpoint.stage(earlier)
        if earlier not in stale and stored_stage is not None and not _unfit(stored_stage.result):
            return True
    return False


def _unfit(result: StageResult) -> str:
    """Return why nothing can be built on a stored stage; empty if something can."""
    if result.outcome is not Status.SOLVED:
        return f"it ended {result.outcome.value}"
    if result.certificate is not None and not result.holds:
        return "it is not certified"
    return ""
