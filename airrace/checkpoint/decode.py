"""The reader of a checkpoint's tree: exactly the layout of `encode.py`, or an error that says where it differs."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from airrace.checkpoint.checkpoint import Checkpoint, StoredDocument, StoredInputs, StoredStage
from airrace.checkpoint.encode import CONTENT, QUANTITY_NAME, SCHEMA, NoteRow, SearchSummary, Version
from airrace.checkpoint.group_reader import Place
from airrace.checkpoint.sanity_checks import ensure_possible
from airrace.checkpoint.tree import Attribute, Group, R, rows_of
from airrace.errors import CheckpointError
from airrace.optimal_control.certificate import Certificate, Item
from airrace.procedure.result import (
    Attempt,
    GateSplit,
    MeshRecord,
    Note,
    NoteKind,
    Outcome,
    RefinementReason,
    SearchReport,
    StageProvenance,
    StageResult,
    SuggestedChange,
    Timings,
    Way,
)
from airrace.procedure.stage import STAGES, Stage
from airrace.quantities import Quantity
from airrace.trajectory import Array, Trajectory


def decode(root: Group) -> Checkpoint:
    """Return the checkpoint that a tree holds.

    Raises:
        CheckpointError: another schema; a member that is missing, unknown or of the wrong kind; shapes that
            contradict each other, or numbers that no flight can have.
    """
    if CONTENT in root.attributes:
        raise CheckpointError("this is a flown log, not a run; show, report, compare, plot and export take it")
    schema = root.attributes.get("schema")
    if schema != SCHEMA:
        raise CheckpointError(f"the checkpoint's schema is {schema}; this airrace reads schema {SCHEMA}")
    place = Place("", root).expecting("inputs", "versions", "stages")
    versions = rows_of(Version, place.table("versions"), "/versions")
    stages = place.group("stages")
    unknown = set(stages.node.members) - {stage.value for stage in STAGES}
    if unknown:
        raise CheckpointError(f"/stages: unknown stage {min(unknown)!r}")
    stored = [_stage(stages.group(stage.value), stage) for stage in STAGES if stage.value in stages.node.members]
    return Checkpoint(inputs_of(place.group("inputs")), {row.name: row.version for row in versions}, tuple(stored))


def inputs_of(place: Place) -> StoredInputs:
    """Return the inputs that a group holds, as runs and flown logs store them.

    Raises:
        CheckpointError: a member is missing, unknown or of the wrong kind.
    """
    place.expecting("track", "aircraft", "overrides", "resolved", optional=("settings",))
    return StoredInputs(
        track=_document(place.group("track")),
        aircraft=_document(place.group("aircraft")),
        settings=_document(place.group("settings")) if "settings" in place.node.members else None,
        overrides=place.texts("overrides", "override"),
        resolved=place.text("resolved"),
    )


def _document(place: Place) -> StoredDocument:
    place.expecting("path", "text")
    return StoredDocument(place.text("path"), place.text("text"))


_TRAJECTORY = ("time", "interval_time", "states", "controls", "phases", "first_node", "durations")
_HASHES = ("inputs_hash", "chain_hash")
_TEXTS = ("outcome", "message")
_MULTIPLIERS = ("constraint_multipliers", "bound_multipliers")
_TABLES = ("notes", "splits", "attempts", "timings", "provenance")
_OPTIONAL = ("certificate", "suggested_changes")
_MEMBERS = (*_TRAJECTORY, *_TEXTS, *_MULTIPLIERS, *_TABLES, "mesh", "search")


def _stage(place: Place, stage: Stage) -> StoredStage:
    place.expecting(*_MEMBERS, *_HASHES, "alternatives", optional=_OPTIONAL)
    alternatives = place.group("alternatives")
    numbers = [str(number) for number in range(1, len(alternatives.node.members) + 1)]
    alternatives.expecting(*numbers)
    found = tuple(_result(alternatives.group(one).expecting(*_MEMBERS, optional=_OPTIONAL), stage) for one in numbers)
    result = replace(_result(place, stage), alternatives=found)
    return StoredStage(result, place.text("inputs_hash"), place.text("chain_hash"))


def _result(place: Place, stage: Stage) -> StageResult:
    trajectory = _trajectory(place)
    result = StageResult(
        stage=stage,
        outcome=_outcome(place),
        message=place.text("message"),
        trajectory=trajectory,
        constraint_multipliers=place.floats("constraint_multipliers"),
        bound_multipliers=place.floats("bound_multipliers"),
        certificate=_certificate(place.group("certificate")) if "certificate" in place.node.members else None,
        splits=rows_of(GateSplit, place.table("splits"), f"{place.path}/splits"),
        attempts=rows_of(Attempt, place.table("attempts"), f"{place.path}/attempts"),
        timings=_one_row(place, "timings", Timings),
        provenance=_one_row(place, "provenance", StageProvenance),
        mesh=_mesh(place.group("mesh"), len(trajectory.time) - 1),
        search=_explored(place.group("search")),
        notes=_notes(place),
        suggested_changes=_suggested_changes(place) if "suggested_changes" in place.node.members else (),
    )
    ensure_possible(result, place.path)
    return result


def _suggested_changes(place: Place) -> tuple[SuggestedChange, ...]:
    return rows_of(SuggestedChange, place.table("suggested_changes"), f"{place.path}/suggested_changes")


def _notes(place: Place) -> tuple[Note, ...]:
    rows = rows_of(NoteRow, place.table("notes"), f"{place.path}/notes")
    try:
        return tuple(Note(NoteKind(row.kind), row.text) for row in rows)
    except ValueError as error:
        raise CheckpointError(f"{place.path}/notes: {str(error)[:80]}") from error


def _one_row(place: Place, name: str, record: type[R]) -> R:
    rows = rows_of(record, place.table(name), f"{place.path}/{name}")
    if len(rows) != 1:
        raise CheckpointError(f"{place.path}/{name}: {len(rows)} rows instead of one")
    return rows[0]


def _outcome(place: Place) -> Outcome:
    text = place.text("outcome")
    for outcome in Outcome:
        if outcome.value == text:
            return outcome
    raise CheckpointError(f"{place.path}/outcome: unknown outcome {text[:40]!r}")


def _certificate(place: Place) -> Certificate:
    place.expecting("solver_status", "items")
    items = rows_of(Item, place.table("items"), f"{place.path}/items")
    return Certificate(place.text("solver_status"), items)


def _explored(place: Place) -> SearchReport:
    place.expecting("ways", "loops", "summary")
    summary = _one_row(place, "summary", SearchSummary)
    ways = rows_of(Way, place.table("ways"), f"{place.path}/ways")
    return SearchReport(
        ways, summary.led, summary.elsewhere, summary.lost, summary.seconds, place.texts("loops", "loop")
    )


def _mesh(place: Place, intervals: int) -> MeshRecord:
    place.expecting("why", "coarser", "defect", "drift")
    why, coarser = place.integers("why"), place.integers("coarser")
    defect, drift = place.floats("defect"), place.floats("drift")
    lengths = (len(why), len(coarser), len(defect), len(drift))
    if lengths not in ((0, 0, 0, 0), (intervals, intervals + 1, intervals, intervals)):
        raise CheckpointError(f"{place.path}: does not belong to {intervals} intervals")
    if not np.isin(why, [reason.value for reason in RefinementReason]).all() or not np.isin(coarser, (0, 1)).all():
        raise CheckpointError(f"{place.path}: has unknown entries")
    return MeshRecord(why.astype(np.int8), coarser.astype(np.bool_), defect, drift)


def _trajectory(place: Place) -> Trajectory:
    time = place.floats("time")
    intervals = len(time) - 1
    phases = place.texts("phases", "phase")
    first_node = place.integers("first_node")
    durations = place.floats("durations")
    if intervals < 0 or not np.array_equal(place.floats("interval_time"), time[:-1], equal_nan=True):
        raise CheckpointError(f"{place.path}/interval_time: does not hold the beginnings of the intervals")
    if len(durations) != len(phases):
        raise CheckpointError(f"{place.path}/durations: {len(durations)} durations of {len(phases)} phases")
    within = len(first_node) == len(phases) + 1 and first_node[0] == 0 and first_node[-1] == intervals
    if not within or bool(np.any(first_node[1:] < first_node[:-1])):
        raise CheckpointError(f"{place.path}/first_node: does not divide {intervals} intervals into the phases")
    states, state = _histories(place.group("states"), intervals + 1)
    controls, control = _histories(place.group("controls"), intervals)
    return Trajectory(phases, first_node, durations, time, states, state, controls, control)


def _histories(place: Place, length: int) -> tuple[tuple[Quantity, ...], Array]:
    """Return declarations and values, shape (n, length), in the order of their rows."""
    rows: dict[int, tuple[Quantity, Array]] = {}
    for name in place.node.members:
        values = place.floats(name)
        if len(values) != length:
            raise CheckpointError(f"{place.path}/{name}: {len(values)} values instead of {length}")
        quantity, row = declaration_of(name, place.series(name).attributes, f"{place.path}/{name}")
        rows[row] = (quantity, values)
    if sorted(rows) != list(range(len(place.node.members))):
        raise CheckpointError(f"{place.path}: the rows of its quantities are not 0, 1, 2, ...")
    ordered = [rows[row] for row in sorted(rows)]
    history = np.array([values for _, values in ordered], np.float64).reshape(len(ordered), length)
    return tuple(quantity for quantity, _ in ordered), history


def declaration_of(name: str, attributes: Mapping[str, Attribute], path: str) -> tuple[Quantity, int]:
    """Return the quantity that attributes declare, and its row.

    Raises:
        CheckpointError: they declare none.
    """
    match attributes:
        case {
            "units": str(unit),
            "long_name": str(text),
            "scale": float(scale),
            "lower": float(lower),
            "upper": float(upper),
            "row": int(row),
        } if QUANTITY_NAME.fullmatch(name):
            rate_of = attributes.get("rate_of", "")
            if not isinstance(rate_of, str):
                raise CheckpointError(f"{path}: does not name the state that it is the rate of")
            return Quantity(name, unit, scale, lower, upper, text, rate_of), row
        case _:
            raise CheckpointError(f"{path}: is not declared as a quantity (units, long_name, scale, lower, upper, row)")
