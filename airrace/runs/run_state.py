"""A run: what it was asked for, what is finished of it, and its conversion from and to a checkpoint."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Self

from airrace.errors import CheckpointError, UsageError
from airrace.files.checkpoint import (
    Checkpoint,
    ReserveAttempt,
    StoredAttempt,
    inputs_hash,
    read_checkpoint,
    stale_stages,
    write_checkpoint,
)
from airrace.files.inputs import Inputs, inputs_from_documents
from airrace.flights.results import Flight, Verification
from airrace.flights.results.comparison import Comparison, compare_flights
from airrace.pages.views.plain_text import one_line
from airrace.procedure import stored_stages
from airrace.procedure.result import StageResult
from airrace.procedure.stage import Stage
from airrace.race import Race
from airrace.runs.json_objects import run_object, stage_object, stamp_object, warnings_object
from airrace.runs.reserve_attempts import attempts_of
from airrace.runs.stage_data import Splits
from airrace.runs.stage_view import StageView, run_page
from airrace.runs.stored_inputs import (
    current_versions,
    library_versions,
    resolved_text,
    stored_documents,
    stored_inputs,
)
from airrace.runs.verdict import downgrade_stale, is_certified, run_line, verdict


@dataclass(frozen=True, eq=False, repr=False)
class RunState:
    """A race that is solved stage by stage: what was asked for, and the stages that are finished.

    It is a value: what continues or changes it returns another one.

    Attributes:
        inputs: course, aircraft, air and settings, with the documents that they come from.
        checkpoint: what a file holds of the run.
        path: its file, which is renewed after every stage; None for a run that is held in memory alone.
        verifications: of the stages that are shown, the outcome of measuring them again.
    """

    inputs: Inputs
    checkpoint: Checkpoint
    path: Path | None = None
    verifications: Mapping[Stage, Verification] = field(default_factory=dict[Stage, Verification])

    @property
    def name(self) -> str:
        """The name of the track: that of its file."""
        return one_line(Path(self.inputs.track.path).stem)

    @property
    def label(self) -> str:
        """The name by which users call the run: that of its file, or of the track."""
        return self.name if self.path is None else self.path.name

    @property
    def race(self) -> Race:
        """The race: course, aircraft and air."""
        return self.inputs.race

    @property
    def results(self) -> tuple[StageResult, ...]:
        """The finished stages as the procedure left them, in their order."""
        return tuple(stage.result for stage in self.checkpoint.stages)

    @property
    def valid_results(self) -> tuple[StageResult, ...]:
        """The finished stages; those that no longer stand or are refuted are not certified."""
        return tuple(stage.result for stage in self.stages)

    @property
    def stale(self) -> Mapping[Stage, str]:
        """The stages that no longer stand, each with the reason, a clause."""
        return dict(stale_stages(self.checkpoint, inputs_hash(self.checkpoint.inputs.resolved)))

    @property
    def stages(self) -> tuple[StageView, ...]:
        """The finished stages in their order; one that no longer stands or is refuted is not certified."""
        stale, attempts = self.stale, len(self.attempts)
        return tuple(self._view(result, stale.get(result.stage, ""), attempts) for result in self.results)

    @property
    def attempts(self) -> tuple[StoredAttempt, ...]:
        """The attempts of a search for the run's reserve that has not ended, as far as they stand."""
        return attempts_of(self.checkpoint, self.inputs.reserve)

    def _view(self, result: StageResult, stale: str, attempts: int) -> StageView:
        verification = self.verifications.get(result.stage)
        reported = downgrade_stale(result, stale, "" if verification is None else verification.refutation)
        return StageView(self.inputs, reported, self.checkpoint.versions, stale, verification, attempts)

    def stage(self, name: str | Stage | None = None) -> StageView:
        """Return the stage of this name, by default the last one.

        Raises:
            UsageError: it is not in this run.
        """
        stages = {stage.name: stage for stage in self.stages}
        if not stages:
            raise UsageError("no stage of this run is finished yet")
        stage_name = list(stages)[-1] if name is None else name.value if isinstance(name, Stage) else name
        if stage_name not in stages:
            raise UsageError(f"this run has no stage {stage_name!r}; it has: {', '.join(stages)}")
        return stages[stage_name]

    def __getitem__(self, name: str | Stage) -> StageView:
        return self.stage(name)

    def __contains__(self, name: object) -> bool:
        return any(name in (result.stage, result.stage.value) for result in self.results)

    def __iter__(self) -> Iterator[StageView]:
        return iter(self.stages)

    @property
    def race_time(self) -> float:
        """The race time of the last stage, s; NaN if that found no flight."""
        return self.stages[-1].race_time if self.results else math.nan

    @property
    def splits(self) -> Splits:
        """The gate splits of the last stage: when and how every gate was passed; empty if that found no flight."""
        return self.stages[-1].splits if self.results else Splits(())

    @property
    def certified(self) -> bool:
        """Whether the last stage is certified, and none before it failed."""
        return is_certified(self.valid_results)

    @property
    def message(self) -> str:
        """The sentence that says why the run is not certified; empty if it is."""
        return verdict(self.valid_results)[1] if self.results else "no stage is finished yet"

    def with_stage(self, result: StageResult) -> Self:
        """Return this run with one more finished stage, which replaces the stages from there on."""
        return replace(self, checkpoint=self.checkpoint.with_stage(result))

    def with_attempt(self, attempt: ReserveAttempt, flown: "RunState | None") -> Self:
        """Return this run with one more attempt of the search for its reserve.

        Args:
            attempt: what was measured.
            flown: the run with its margins; None where there is no flight with them.
        """
        overrides, result = ((), None) if flown is None else (tuple(flown.inputs.overrides), flown.results[-1])
        return replace(self, checkpoint=self.checkpoint.with_attempt(attempt, overrides, result))

    def attempt_run(self, stored: StoredAttempt) -> "RunState | None":
        """Return the run that an attempt has flown, held in memory alone; None where it found no flight.

        Raises:
            InputError: this version of airrace does not accept its inputs.
            CheckpointError: its flight is not that of the model.
        """
        if stored.result is None:
            return None
        inputs = inputs_from_documents(*stored_documents(self.checkpoint.inputs), stored.overrides)
        return ensure_readable(new_run(inputs).with_stage(stored.result))

    def with_inputs(self, inputs: Inputs) -> Self:
        """Return this run with inputs by which the race is the same, so that its stages stand."""
        return replace(self, inputs=inputs, checkpoint=replace(self.checkpoint, inputs=stored_inputs(inputs)))

    def with_mesh_check(self, result: StageResult) -> Self:
        """Return this run with a finished stage as its mesh check left it; later stages stay."""
        return replace(self, checkpoint=self.checkpoint.with_mesh_check(result))

    def moved(self, path: Path) -> Self:
        """Return this run with another file, which is not written yet."""
        return replace(self, path=path)

    def save(self, path: str | Path) -> Path:
        """Write the run into a file, which every command of `airrace` takes.

        A file that exists is replaced as a whole.

        Returns:
            The path.

        Raises:
            StorageError: the system refused; a file that exists is left as it is.
        """
        write_checkpoint(Path(path), self.checkpoint)
        return Path(path)

    def flight(self, stage: str | Stage | None = None, label: str | None = None) -> Flight:
        """Return the flight of a stage, by default of the last one; see `StageView.flight`."""
        return self.stage(stage).flight(label)

    def as_object(self) -> dict[str, object]:
        """Return the object that `airrace optimize --json` prints."""
        summary = run_object(
            self.name, self.valid_results, sum(result.timings.wall for result in self.results), certified=self.certified
        )
        return summary | {"stages": stages_object(self, self.valid_results)}

    def __repr__(self) -> str:
        return f"<Run {run_line(self.name, self.valid_results)}>"

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the stages, the splits of the last one, and its flight from above."""
        return run_page(self.race, self.name, self.valid_results)

    def _ipython_key_completions_(self) -> list[str]:
        """Return the names that notebooks complete within the brackets of `run[...]`."""
        return [result.stage.value for result in self.results]


def compare_stages(
    before: Sequence[StageView], after: Sequence[StageView], labels: tuple[str, str]
) -> Comparison | None:
    """Hold the highest stage that holds in both of two runs of the one against that of the other.

    Args:
        before, after: the stages of the runs; those before are the reference.
        labels: of the runs, as users call them.

    Returns:
        None if no stage holds in both.

    Raises:
        UsageError: they fly other passings.
    """
    earlier = {stage.name: stage for stage in before if stage.result.holds}
    common = [stage for stage in after if stage.result.holds and stage.name in earlier]
    if not common:
        return None
    name = common[-1].name
    first, second = (f"{label}:{name}" for label in labels)
    return compare_flights(earlier[name].flight(first), common[-1].flight(second))


def new_run(inputs: Inputs, path: Path | None = None) -> RunState:
    """Return a run of which nothing is finished yet."""
    return RunState(inputs, Checkpoint(stored_inputs(inputs), current_versions()), path)


def open_run(path: Path) -> RunState:
    """Return the run in a file.

    Raises:
        CheckpointError: there is no such file, it is not a whole, undamaged checkpoint, or its flights are not those
            of its stages' models.
        InputError: this version of airrace no longer accepts its inputs.
    """
    return ensure_readable(run_of_checkpoint(read_checkpoint(path), path))


def ensure_readable(run: RunState) -> RunState:
    """Return a run whose flights can be read by the models of their stages.

    Raises:
        CheckpointError: a stage has other histories, or another number of legs.
    """
    for result in run.results:
        stored_stages.ensure_matches_model(run.race, result)
    return run


def run_of_checkpoint(checkpoint: Checkpoint, path: Path | None) -> RunState:
    """Return a run read from its checkpoint; its inputs are understood anew from their stored texts.

    Raises:
        InputError: this version of airrace no longer accepts them.
    """
    texts = checkpoint.inputs
    inputs = inputs_from_documents(*stored_documents(texts), texts.overrides)
    # Stages link to the configuration they were computed from; new ones to the one understood now.
    current = replace(checkpoint, inputs=replace(texts, resolved=resolved_text(inputs)))
    return RunState(inputs, current, path)


def adopt_checkpoint(run: RunState) -> RunState:
    """Return a new run together with the stages that still stand of the checkpoint at its path.

    What is damaged, of other inputs or from other versions, is left aside.
    """
    if run.path is None:
        return run
    try:
        earlier = read_checkpoint(run.path)
    except CheckpointError:
        return run
    if any(earlier.versions.get(name) != number for name, number in library_versions().items()):
        return run
    stale = {stage for stage, _ in stale_stages(earlier, inputs_hash(run.checkpoint.inputs.resolved))}
    stages = tuple(stage for stage in earlier.stages if stage.result.stage not in stale)
    return replace(run, checkpoint=replace(run.checkpoint, stages=stages, attempts=earlier.attempts))


def stages_object(run: RunState, results: Sequence[StageResult]) -> list[dict[str, object]]:
    """Return `stages` of a run: the last one that found a flight has `near_misses` and `sustained_loads`.

    Args:
        run: whose stages they are.
        results: its stages as they may be reported, in order.
    """
    stages = [stage_object(result) for result in results]
    stamps = {stage.stage: stage.stamp for stage in run.stages}
    for result, stage in zip(results, stages, strict=True):
        if result.stage in stamps:
            stage["stamp"] = stamp_object(stamps[result.stage])
    for result, stage in zip(reversed(results), reversed(stages), strict=True):
        if result.is_flight:
            stage |= warnings_object(StageView(run.inputs, result, {}).flight())
            break
    return stages
