"""Flying the stages of a run and keeping each as soon as it is finished: what `optimize` and `resume` share."""

import json
import os
import platform
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

from airrace.checkpoint import (
    Checkpoint,
    StoredDocument,
    StoredInputs,
    inputs_hash,
    read_checkpoint,
    stale_stages,
    write_checkpoint,
)
from airrace.checkpoint.atomic import replace_file
from airrace.cli.answer import Answer
from airrace.cli.comparison import comparison_object, comparison_table
from airrace.cli.exit_codes import ExitCode
from airrace.cli.live import watching
from airrace.cli.summary import summarise
from airrace.cli.tables import rendered, result_tables, stages_table
from airrace.cli.ways_table import ways_table
from airrace.documents import Document, Inputs, inputs_from_documents
from airrace.errors import CheckpointError, StorageError, UsageError
from airrace.extensions import extension_versions
from airrace.procedure import run as procedure
from airrace.procedure.progress import Progress
from airrace.procedure.restart import Another
from airrace.procedure.result import Stage, StageResult


@dataclass(frozen=True)
class Run:
    """A run as it stands before this command flies the rest of it."""

    inputs: Inputs
    checkpoint: Checkpoint
    path: Path

    @property
    def name(self) -> str:
        """The track's name: that of its file."""
        return Path(self.inputs.track.path).stem


def new_run(inputs: Inputs, path: Path) -> Run:
    """A run of which nothing is finished yet."""
    stored = StoredInputs(
        track=_stored(inputs.track),
        aircraft=_stored(inputs.aircraft),
        settings=None if inputs.settings_file is None else _stored(inputs.settings_file),
        overrides=tuple(inputs.overrides),
        resolved=resolved_text(inputs),
    )
    return Run(inputs, Checkpoint(stored, {**library_versions(), "python": platform.python_version()}), path)


def library_versions() -> dict[str, str]:
    """Versions of airrace, of the libraries and of the extensions that its numbers depend on."""
    return {name: version(name) for name in ("airrace", "casadi", "numpy", "scipy")} | extension_versions()


def resolved_text(inputs: Inputs) -> str:
    """The configuration as understood; equal configurations give equal texts."""
    return json.dumps(inputs.resolved, sort_keys=True, allow_nan=False)


def stored_run(checkpoint: Checkpoint, path: Path) -> Run:
    """A run read from its checkpoint; its inputs are understood anew from their stored texts.

    Raises:
        InputError: this version of airrace no longer accepts them.
    """
    stored = checkpoint.inputs
    inputs = inputs_from_documents(
        document_of(stored.track),
        document_of(stored.aircraft),
        None if stored.settings is None else document_of(stored.settings),
        stored.overrides,
    )
    # Stages link to the configuration they were computed from; new ones to the one understood now.
    current = replace(checkpoint, inputs=replace(stored, resolved=resolved_text(inputs)))
    return Run(inputs, current, path)


def taken_up(run: Run) -> Run:
    """A new run together with the stages that still stand of the checkpoint at its path.

    What is damaged, of other inputs or from other versions, is left aside.
    """
    try:
        earlier = read_checkpoint(run.path)
    except CheckpointError:
        return run
    if any(earlier.versions.get(name) != number for name, number in library_versions().items()):
        return run
    stale = {stage for stage, _ in stale_stages(earlier, inputs_hash(run.checkpoint.inputs.resolved))}
    standing = tuple(one for one in earlier.stages if one.result.stage not in stale)
    return replace(run, checkpoint=replace(run.checkpoint, stages=standing))


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


def fly_stages(
    answer: Answer,
    run: Run,
    *,
    finished: Sequence[StageResult],
    until: Stage,
    threads: int,
    progress: Progress,
    start: Another | None = None,
) -> Sequence[StageResult]:
    """Run the stages that are not finished, write the checkpoint after each, and fill in the answer's object.

    Args:
        answer: what the command has to say.
        run: as it stands.
        finished: the stages that are kept.
        until: the last stage.
        threads: threads that evaluate derivatives.
        progress: who watches.
        start: another run to start from; None to start from the course alone.

    Returns:
        All stages of the run by now, in order.
    """
    started = time.perf_counter()
    results = list(finished)
    checkpoint = run.checkpoint
    try:
        # Written before anything is computed: whatever ends the run, `resume` can take it up.
        write_checkpoint(run.path, checkpoint)
        for result in procedure.optimise(
            run.inputs.race,
            run.inputs.settings,
            until=until,
            threads=threads,
            finished=tuple(finished),
            start=() if start is None else start.results,
            start_name="" if start is None else start.name,
            progress=progress,
        ):
            checkpoint = checkpoint.with_stage(result)
            write_checkpoint(run.path, checkpoint)
            results.append(result)
    except KeyboardInterrupt:
        kept = ", ".join(result.stage.value for result in results) or "none"
        remedy = f"go on with `airrace resume {run.path}` (finished: {kept})"
        if start is not None and not results:  # going on would climb from the course alone
            remedy = f"no stage is finished; start from {start.name} again with --force"
        answer.fail(ExitCode.INTERRUPTED, f"interrupted; {remedy}")
    finally:
        summarise(answer, run.name, results, time.perf_counter() - started)
        if start is not None:
            answer.fields["compared"] = comparison_object(start, results)
    return results


def stage_named(text: str | None) -> Stage:
    """The stage a user names, the last available one by default.

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


def ensure_free(path: Path, *, force: bool, remedy: str = "") -> None:
    """Refuse an output that exists, and find out now whether its folder can be written to.

    Args:
        remedy: what to do besides `--force`, a clause.

    Raises:
        UsageError: the file exists and `force` is not given, or it is a folder.
        StorageError: the folder does not exist or takes no files.
    """
    if path.is_dir():
        raise UsageError(f"{path} is a folder; name a file in it")
    if path.exists() and not force:
        raise UsageError(f"{path} exists; {remedy}overwrite it with --force")
    try:
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        raise StorageError(f"cannot write to the folder {path.parent}: {error.strerror}") from error


def write_text(path: Path, text: str) -> None:
    """Write a file as a whole.

    Raises:
        StorageError: the system refused.
    """
    replace_file(path, text.encode())


def available_cores() -> int:
    """Cores this process may use, which can be fewer than the machine has."""
    return len(os.sched_getaffinity(0)) if os.name == "posix" and platform.system() == "Linux" else os.cpu_count() or 1


def _stored(document: Document) -> StoredDocument:
    return StoredDocument(document.path, document.text)


def document_of(stored: StoredDocument) -> Document:
    """A stored document as it was read."""
    return Document(stored.path, stored.text)
