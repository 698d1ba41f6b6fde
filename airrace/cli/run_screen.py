"""What `optimize`, `resume` and `show` print: the summary on one screen, and whatever else of a run was asked for.

The summary is race time and verdict, the table of the gates, what limits the flight, the most important remarks, and
the commands that come next.
"""

import itertools
import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from airrace.cli.printed_result import PAGE, command_lines, paragraph, render
from airrace.cli.run_tables import (
    ROUTES_MAX,
    distance_tables,
    items_table,
    laps_text,
    leg_tables,
    mesh_table,
    near_miss_table,
)
from airrace.errors import InputError, UsageError
from airrace.files.checkpoint import Checkpoint, inputs_hash, stale_stages
from airrace.files.inputs.objects import is_of_objects
from airrace.flights.results import Flight, Stamp, Verification
from airrace.flights.results.clearances import near_misses
from airrace.flights.results.flight_facts import sustained_loads
from airrace.model.track.course import ClearanceRule
from airrace.pages.views.plain_text import one_line
from airrace.pages.views.stage_tables import (
    bound_text,
    claim,
    limits_table,
    search_table,
    splits_table,
    stages_table,
    verdict_words,
)
from airrace.pages.views.tables import Table
from airrace.procedure.result import UNVERIFIABLE, StageResult, Status
from airrace.procedure.stage import STAGES, Stage
from airrace.runs.execution_plan import in_force
from airrace.runs.json_objects import legs_object, run_object, stage_object, stamp_object, verification_object
from airrace.runs.run_state import RunState, ensure_readable, run_of_checkpoint
from airrace.runs.stored_inputs import stored_documents
from airrace.runs.verdict import downgrade_stale, is_certified
from airrace.runs.verification import with_verifications
from airrace.runtime.standard_streams import STANDARD, name_of

logger = logging.getLogger(__name__)

DOES_NOT_STAND = "NOT certified: its items may hold, but the stage does not stand"
REFUSED = "this version of airrace refuses the inputs"
CANNOT_VERIFY = f"Not verifiable: {', '.join(UNVERIFIABLE[:-1])} and {UNVERIFIABLE[-1]}."


LIMITS_MAX = 5
"""The largest number of limits in its table."""
REMARKS_MAX = 3
"""The largest number of remarks."""


@dataclass(frozen=True)
class Parts:
    """What is shown of a run besides the summary.

    Attributes:
        stages: the table of the stages.
        routes: the routes that were tried.
        certificate: the items of the certificate of the last stage that is shown, and what is claimed of it.
        legs: every leg of the flight, and its least distances.
        every: all of it, of all stages that are shown, with meshes and all remarks.
    """

    stages: bool = False
    routes: bool = False
    certificate: bool = False
    legs: bool = False
    every: bool = False


@dataclass(frozen=True)
class StoredStages:
    """The stages of a run as `optimize`, `resume` and `show` show them, and the flight of one of them.

    Attributes:
        checkpoint: that holds them.
        path: of its file; None or `-` where there is none to be named.
        every: all stages of the run; those that no longer stand are not certified.
        results: the stages that are shown, in their order.
        verifications: the outcome of measuring each of them again; empty for those that were just solved.
        flight: that of the stage that was asked for, by default of the last one that found a flight; None where there
            is none, or where this version of airrace does not accept the stored inputs.
        stage: the name of the stage that the flight belongs to; empty without one.
        stamps: what the flights of the stages are; none where this version does not accept the stored inputs.
    """

    checkpoint: Checkpoint
    path: Path | None
    every: tuple[StageResult, ...]
    results: tuple[StageResult, ...]
    verifications: Mapping[Stage, Verification]
    flight: Flight | None = None
    stage: str = ""
    stamps: Mapping[Stage, Stamp] = field(default_factory=dict[Stage, Stamp])

    @property
    def verified(self) -> bool | None:
        """Whether all stages that are shown are verified; None where some are not, and none is refuted."""
        outcomes = [verification.verified for verification in self.verifications.values()]
        return False if False in outcomes else True if outcomes and all(outcomes) else None

    def as_object(self) -> dict[str, object]:
        """Return the object of the run, with `legs` and `laps` in the stage whose flight is shown.

        `verified` is null where not all of it was measured again.
        """
        wall = sum(result.timings.wall for result in self.every)
        track = one_line(Path(self.checkpoint.inputs.track.path).stem)
        legs = {} if self.flight is None else {self.stage: legs_object(self.flight)}
        stages = [
            stage_object(result)
            | legs.get(result.stage.value, {})
            | verification_object(self.verifications[result.stage])
            | ({"stamp": stamp_object(self.stamps[result.stage])} if result.stage in self.stamps else {})
            for result in self.results
        ]
        run = run_object(track, self.results, wall, certified=is_certified(self.every))
        return run | {"stages": stages, "verified": self.verified}


def stored_stages(checkpoint: Checkpoint, path: Path, stage: str | None, *, verify: bool) -> StoredStages:
    """Choose what is shown.

    Args:
        checkpoint: read from a file.
        path: of that file.
        stage: the name of the only stage that is shown; None for all.
        verify: whether these are measured again.

    Raises:
        UsageError: the run has no such stage.
    """
    run, refusal = None, ""
    selected_stages = [
        stored_stage.result.stage
        for stored_stage in checkpoint.stages
        if stage in (None, stored_stage.result.stage.value)
    ]
    try:
        run = with_verifications(ensure_readable(run_of_checkpoint(checkpoint, path)), selected_stages, verify=verify)
        every = run.valid_results
    except InputError as error:  # the stages may stand on these inputs as they are stored
        refusal = str(error.findings[0])
        stale = dict(stale_stages(checkpoint, inputs_hash(checkpoint.inputs.resolved)))
        stored_results = (stored_stage.result for stored_stage in checkpoint.stages)
        every = tuple(downgrade_stale(result, stale.get(result.stage, "")) for result in stored_results)
    results = tuple(result for result in every if stage in (None, result.stage.value))
    if stage is not None and not results:
        names = ", ".join(result.stage.value for result in every) or "none"
        raise UsageError(f"this run has no stage {stage!r}; it has: {names}")
    name = next((result.stage.value for result in reversed(results) if result.is_flight), None)
    verifications = (
        run.verifications if run is not None else {stage_: Verification(None, REFUSED) for stage_ in selected_stages}
    )
    if run is not None:
        flight = None if name is None else run.flight(name)
        stamps = {view.stage: view.stamp for view in run.stages}
        return StoredStages(checkpoint, path, every, results, verifications, flight, name or "", stamps)
    if name is not None:
        logger.warning("legs and laps are left out: %s: %s", REFUSED, refusal)
    return StoredStages(checkpoint, path, every, results, verifications)


def solved_stages(run: RunState) -> StoredStages:
    """Return what is shown of a run whose stages were just solved, or kept; it has at least one."""
    last, every = run.stage(), run.results
    flight = last.flight() if last.result.is_flight else None
    name = "" if flight is None else last.name
    return StoredStages(run.checkpoint, run.path, every, every, {}, flight, name, {last.stage: last.stamp})


def run_texts(stored: StoredStages, parts: Parts, further: Iterable[str] = ()) -> Iterator[str]:
    """Yield the summary, the parts that were asked for, and the next commands, in lines that fit the terminal.

    Args:
        shown: the stages.
        parts: what is shown besides the summary.
        further: texts that come before the next commands.
    """
    yield from _answer(stored, every=parts.every)
    if stored.results:
        yield from _part_texts(stored, parts)
    yield from further
    if commands := next_commands(stored):
        yield "\n".join(command_lines(words, "      " if number else "next: ") for number, words in enumerate(commands))


def _part_texts(stored: StoredStages, parts: Parts) -> Iterator[str]:
    if parts.stages or parts.every:
        yield render(stages_table(stored.results), columns=PAGE)
    if parts.routes or parts.every:
        yield from _routes(stored.results)
    if parts.every:
        for result in stored.results:
            yield from _stage_texts(result, with_splits=result.stage.value != stored.stage)
    if parts.certificate or parts.every:
        yield from _certificate_texts(stored, stored.results if parts.every else stored.results[-1:])
    if (parts.legs or parts.every) and stored.flight is not None:
        tables = [*leg_tables(stored.flight), *distance_tables(stored.flight)]
        if parts.every and (misses := near_misses(stored.flight)):
            tables.append(near_miss_table(misses))
        yield from (render(table, columns=PAGE) for table in tables)


def _answer(stored: StoredStages, *, every: bool) -> Iterator[str]:
    """Yield what fits one screen; with `every` all limits and remarks."""
    if not stored.results:
        yield "no stage is finished yet"
    else:
        last = stored.results[-1]
        circumstances = stored.stamps[last.stage].circumstances if last.stage in stored.stamps else ""
        yield "\n".join(paragraph(text) for text in (_headline(stored), circumstances) if text)
        if stored.flight is not None and last.stage.value == stored.stage:
            laps = laps_text(stored.flight)
            yield render(splits_table(last.splits, laps), columns=PAGE)
            limits = limits_table(stored.flight, None if every else LIMITS_MAX)
            # A rough optimum stays a little off its limits, so nothing can be told of how long it keeps to them.
            if limits.rows and last.has_race_time and not last.is_rough:
                yield render(limits, columns=PAGE)
    remarks = list(_remarks(stored))
    selected_remarks = remarks if every else remarks[:REMARKS_MAX]
    lines = [paragraph(remark, begin="note: ") for remark in selected_remarks]
    if len(selected_remarks) < len(remarks):
        lines.append(f"{len(remarks) - len(selected_remarks)} more with --all")
    if lines:
        yield "\n".join(lines)


def _headline(stored: StoredStages) -> str:
    """Return race time and verdict of the last stage, and whether it was verified where that was a question."""
    last = stored.results[-1]
    race_time = f"{last.trajectory.race_time:.3f} s, " if last.has_race_time else ""
    verification = stored.verifications.get(last.stage)
    suffix = f"; {verification.outcome}" if verification is not None else ""
    return f"{last.stage.value}: {race_time}{verdict_words(last)}{suffix}"


def _remarks(stored: StoredStages) -> Iterator[str]:
    """Yield what is to be known of the stages, the most important first: what does not hold, then what is near it."""
    for result in reversed(stored.results):
        if result.remarks:
            # Beside what is verified it must not read as if it were, too.
            verification = stored.verifications.get(result.stage)
            noted = ", as noted when it was solved" if verification is not None and verification.verified else ""
            yield f"{result.stage.value}{noted}: {result.remarks}"
    unverified = {one: found for one, found in stored.verifications.items() if found.verified is None and found.reason}
    yield from _verification_lines(unverified, len(stored.verifications))
    if stored.flight is not None:
        yield from _flight_remarks(stored.flight)
    for result in stored.results:
        yield from (f"a needless loop: {loop}" for loop in result.search.loops)
        if result.search.bound is not None:
            yield bound_text(result.search.bound)


def _flight_remarks(flight: Flight) -> Iterator[str]:
    """Yield what is measured of a flight and no limit of it: near misses of pylons, loads sustained for too long."""
    if misses := near_misses(flight):
        least = min(misses, key=lambda near_miss: near_miss.clearance.margin)
        away, more = least.clearance, len(misses) - 1
        text = f"the wing is {away.distance:.2f} m from {away.text} {least.where}, required {away.required:g} m"
        text += f"; {more} more near miss{'' if more == 1 else 'es'} (--all)" if more else ""
        if flight.course.rules.clearance is not ClearanceRule.FLIGHT:
            text += (
                "; the rules measure the wing tips at the instant of a passing alone, and `--set "
                "rules.clearance=flight` keeps it clear all along"
            )
        yield text
    yield from (load.text for load in sustained_loads(flight))


def next_commands(stored: StoredStages) -> list[list[str]]:
    """Return the words of the two commands that most likely come next; fewer where there is no more to do, or no file
    to be named.
    """
    if stored.path is None or stored.path == STANDARD:
        return []
    run, last = str(stored.path), stored.every[-1] if stored.every else None
    resume = ["airrace", "resume", run]
    if last is None:
        return [resume]
    if not last.is_flight:
        return _milder_commands(stored, last) if last.suggested_changes else [resume]
    if not last.holds:
        show_certificate = [] if last.certificate is None else [["airrace", "show", run, "--certificate"]]
        return [*show_certificate, resume]
    stamp = stored.stamps.get(last.stage)
    searching = stamp is not None and stamp.reserve is not None and stamp.reserve.measured is None
    higher = last.stage in STAGES and last.stage is not list(STAGES)[-1]
    return [["airrace", "brief", run], resume if higher or searching else ["airrace", "report", run]]


def _milder_commands(stored: StoredStages, last: StageResult) -> list[list[str]]:
    """Return the words of the command that flies a course with the first suggested change that has a key.

    There is none with several conflicts, for the changes that are reported of them were not flown together, nor where a
    document of the run has no file.
    """
    change = next((suggestion for suggestion in last.suggested_changes if suggestion.key), None)
    inputs = stored.checkpoint.inputs
    track, aircraft, settings = stored_documents(inputs)
    documents = [track, aircraft] if settings is None else [track, aircraft, settings]
    if any(is_of_objects(document) or document.path == name_of(STANDARD) for document in documents):
        return []
    if change is None or any(suggestion.conflict != change.conflict for suggestion in last.suggested_changes):
        return []
    words = ["airrace", "optimize", track.path, "--aircraft", aircraft.path]
    if settings is not None:
        words += ["--settings", settings.path]
    for text in in_force([*inputs.overrides, f"{change.key}={change.needed:g}"]):
        words += ["--set", text]
    return [[*words, "--output", "NEW.h5"]]


def _routes(results: Sequence[StageResult]) -> Iterator[str]:
    searches = [result.search for result in results if result.search.routes]
    if not searches:
        yield "no other routes were tried"
    yield from (render(search_table(search, most=ROUTES_MAX), columns=PAGE) for search in searches)


def _stage_texts(result: StageResult, *, with_splits: bool) -> Iterator[str]:
    """Yield the gates of a stage other than that of the summary, and its mesh."""
    tables: list[Table] = []
    if with_splits and result.splits and result.is_flight:
        outcome = f"race time {result.trajectory.race_time:.3f} s" if result.has_race_time else result.status.value
        tables.append(splits_table(result.splits, f"{result.stage.value}: {outcome}"))
    if len(result.mesh.why):
        tables.append(mesh_table(result))
    yield from (render(table, columns=PAGE) for table in tables)


def _certificate_texts(stored: StoredStages, results: Sequence[StageResult]) -> Iterator[str]:
    """Yield what is claimed of the last of some stages, their certificates, and what was verified."""
    last = results[-1]
    before = itertools.takewhile(lambda result: result.stage is not last.stage, stored.every)
    if claim_text := claim([*before, last]):
        yield paragraph(f"{last.stage.value}: {claim_text}")
    for result in results:
        if result.certificate is not None:
            stands = result.outcome is Status.SOLVED or not result.certificate.holds
            title = f"{result.stage.value}: " if len(results) > 1 else ""
            yield render(items_table(result.certificate, "" if stands else DOES_NOT_STAND, title), columns=PAGE)
    verifications = {
        result.stage: stored.verifications[result.stage] for result in results if result.stage in stored.verifications
    }
    if verifications:
        yield from _verification_texts(verifications)


def _verification_texts(verifications: Mapping[Stage, Verification]) -> Iterator[str]:
    """Yield the outcomes of measuring stages again, and what cannot be verified."""
    yield "\n".join(map(paragraph, _verification_lines(verifications, len(verifications))))
    if any(verification.verified for verification in verifications.values()):
        yield paragraph(CANNOT_VERIFY)


def _verification_lines(verifications: Mapping[Stage, Verification], count: int) -> Iterator[str]:
    """Yield the outcomes of measuring some of `count` stages again, equal words once.

    What was refuted the remark on its stage tells.
    """
    alike: dict[str, list[str]] = {}
    for stage, verification in verifications.items():
        alike.setdefault(verification.remark, []).append(stage.value)
    for words, stages in alike.items():
        yield f"{'all stages' if len(stages) == count > 1 else ', '.join(stages)}: {words}"
