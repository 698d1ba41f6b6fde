"""The layout of a checkpoint as a tree, with `N` intervals and `N + 1` nodes:

/                                   attribute schema
/inputs/track, aircraft, settings   path, text (settings only where there was a file)
/inputs/overrides, resolved
/versions                           table: name, version
/stages/STAGE/
    outcome, message, inputs_hash, chain_hash
    notes                           table: kind, text
    time, interval_time             s, dimension scales: the nodes, the beginnings of the intervals
    states/NAME, controls/NAME      (N + 1,) and (N,), each with its declaration: units, long_name, scale,
                                    lower, upper, its row in the vector, and rate_of where it is the time
                                    derivative of a state: that state's name
    phases                          table: one name per row
    first_node, durations
    constraint_multipliers, bound_multipliers
    mesh/why, coarser, defect, drift    (N,) but for coarser, which is (N + 1,); empty where nothing was measured
    certificate/solver_status, items   (absent where the stage is not certified by design)
    splits, attempts, timings, provenance    tables, SI and radians
    search/routes, loops, summary         tables: other routes that were tried
    suggested_changes                   table: what would resolve conflicts of limits; only where there are any
    alternatives/N/                     flights on other routes, but for the hashes like the stage itself
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from airrace.checkpoint.checkpoint import Checkpoint, StoredDocument, StoredInputs, StoredStage
from airrace.checkpoint.group_reader import Place, ensure_possible
from airrace.checkpoint.hdf5 import Attribute, Group, Node, R, Series, Table, rows_of, table_of
from airrace.errors import CheckpointError
from airrace.optimal_control.certificate import Certificate, Item
from airrace.procedure.result import (
    OUTCOMES,
    Attempt,
    GateSplit,
    MeshRecord,
    Note,
    NoteKind,
    RefinementReason,
    Route,
    SearchReport,
    StageProvenance,
    StageResult,
    Status,
    SuggestedChange,
    Timings,
)
from airrace.procedure.stage import STAGES, Stage
from airrace.quantities import Quantity
from airrace.records import record
from airrace.trajectory import Array, Trajectory

SCHEMA = 5
"""The version of this layout; a reader refuses every other."""
CONTENT = "content"
"""The attribute that tells files of another kind from runs, which have none."""
QUANTITY_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,63}")


@record
class Version:
    """A row of the table of versions."""

    name: str
    version: str


@record
class NoteRow:
    """A row of the table of notes; `kind` is the value of a `NoteKind`."""

    kind: str
    text: str


@record
class SearchSummary:
    """The one row that says how exploring went, see `SearchReport`."""

    converged_to_best: int
    converged_elsewhere: int
    failed: int
    seconds: float


def encode(checkpoint: Checkpoint) -> Group:
    """Return the checkpoint as a tree.

    Raises:
        CheckpointError: a quantity's name cannot name an HDF5 dataset, or a trajectory contradicts itself.
    """
    versions = [Version(name, version) for name, version in checkpoint.versions.items()]
    members: dict[str, Node] = {
        "inputs": inputs_group(checkpoint.inputs),
        "versions": table_of(Version, versions),
        "stages": Group({stored.result.stage.value: _encode_stage(stored) for stored in checkpoint.stages}),
    }
    return Group(members, {"schema": SCHEMA})


def inputs_group(inputs: StoredInputs) -> Group:
    """Return the inputs as a group, as runs and flown logs store them."""
    members: dict[str, Node] = {
        "track": _encode_document(inputs.track),
        "aircraft": _encode_document(inputs.aircraft),
        "overrides": Table({"override": inputs.overrides}),
        "resolved": inputs.resolved,
    }
    if inputs.settings is not None:
        members["settings"] = _encode_document(inputs.settings)
    return Group(members)


def _encode_document(document: StoredDocument) -> Group:
    return Group({"path": document.path, "text": document.text})


def _encode_stage(stored: StoredStage) -> Group:
    path = f"/stages/{stored.result.stage.value}"
    alternatives = {
        f"{number}": Group(_encode_result(alternative, f"{path}/alternatives/{number}"))
        for number, alternative in enumerate(stored.result.alternatives, start=1)
    }
    hashes = {"inputs_hash": stored.inputs_hash, "chain_hash": stored.chain_hash}
    return Group({**hashes, **_encode_result(stored.result, path), "alternatives": Group(alternatives)})


def _encode_result(result: StageResult, path: str) -> dict[str, Node]:
    members: dict[str, Node] = {
        "outcome": result.outcome.value,
        "message": result.message,
        "notes": table_of(NoteRow, [NoteRow(note.kind.value, note.text) for note in result.notes]),
        **_encode_trajectory(result.trajectory, path),
        "constraint_multipliers": series(result.constraint_multipliers, "1", "multipliers of the constraints"),
        "bound_multipliers": series(result.bound_multipliers, "1", "multipliers of the simple bounds"),
        "mesh": _encode_mesh(result.mesh),
        "splits": table_of(GateSplit, result.splits),
        "attempts": table_of(Attempt, result.attempts),
        "timings": table_of(Timings, [result.timings]),
        "provenance": table_of(StageProvenance, [result.provenance]),
        "search": _encode_explored(result.search),
    }
    if result.suggested_changes:
        members["suggested_changes"] = table_of(SuggestedChange, result.suggested_changes)
    if result.certificate is not None:
        members["certificate"] = _encode_certificate(result.certificate)
    return members


def _encode_trajectory(trajectory: Trajectory, path: str) -> dict[str, Node]:
    return {
        "time": series(trajectory.time, "s", "time at the nodes"),
        "interval_time": series(trajectory.time[:-1], "s", "time at the beginning of the intervals"),
        "states": _encode_histories(trajectory.states, trajectory.state, f"{path}/time"),
        "controls": _encode_histories(trajectory.controls, trajectory.control, f"{path}/interval_time"),
        "phases": Table({"phase": trajectory.phases}),
        "first_node": integers(trajectory.first_node, "node at which each phase begins, and the last node"),
        "durations": series(trajectory.durations, "s", "duration of each phase"),
    }


def _encode_mesh(record: MeshRecord) -> Group:
    return Group(
        {
            "why": integers(record.why, "why each interval is as long as it is"),
            "coarser": integers(record.coarser, "1 for nodes of the mesh whose race time was compared"),
            "defect": series(record.defect, "scaled", "deviation of the replay from the next node"),
            "drift": series(record.drift, "1", "distance of the Hamiltonian from -1"),
        }
    )


def _encode_explored(explored: SearchReport) -> Group:
    summary = SearchSummary(explored.converged_to_best, explored.converged_elsewhere, explored.failed, explored.seconds)
    return Group(
        {
            "routes": table_of(Route, explored.routes),
            "loops": Table({"loop": explored.loops}),
            "summary": table_of(SearchSummary, [summary]),
        }
    )


def _encode_certificate(certificate: Certificate) -> Group:
    return Group({"solver_status": certificate.solver_status, "items": table_of(Item, certificate.items)})


def _encode_histories(declared: tuple[Quantity, ...], values: Array, axis: str) -> Group:
    members: dict[str, Node] = {}
    for row, (quantity, history) in enumerate(zip(declared, values, strict=True)):
        if not QUANTITY_NAME.fullmatch(quantity.name) or quantity.name in members:
            raise CheckpointError(f"{quantity.name!r} is not a name of its own for a quantity: it cannot be stored")
        members[quantity.name] = Series(np.asarray(history, np.float64), declaration(quantity, row), axis)
    return Group(members)


def declaration(quantity: Quantity, row: int) -> dict[str, Attribute]:
    """Return the attributes that declare a quantity, with its row among those beside it."""
    attributes: dict[str, Attribute] = {
        "units": quantity.unit,
        "long_name": quantity.text,
        "scale": float(quantity.scale),
        "lower": float(quantity.lower),
        "upper": float(quantity.upper),
        "row": row,
    }
    return attributes | ({"rate_of": quantity.rate_of} if quantity.rate_of else {})


def series(values: Array, units: str, long_name: str) -> Series:
    """Return numbers with their unit and meaning."""
    return Series(np.asarray(values, np.float64), {"units": units, "long_name": long_name})


def integers(values: Sequence[int] | NDArray[np.generic], long_name: str) -> Series:
    """Return whole numbers with their meaning."""
    return Series(np.asarray(values, np.int64), {"units": "1", "long_name": long_name})


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
    stored = [_decode_stage(stages.group(stage.value), stage) for stage in STAGES if stage.value in stages.node.members]
    return Checkpoint(inputs_of(place.group("inputs")), {row.name: row.version for row in versions}, tuple(stored))


def inputs_of(place: Place) -> StoredInputs:
    """Return the inputs that a group holds, as runs and flown logs store them.

    Raises:
        CheckpointError: a member is missing, unknown or of the wrong kind.
    """
    place.expecting("track", "aircraft", "overrides", "resolved", optional=("settings",))
    return StoredInputs(
        track=_decode_document(place.group("track")),
        aircraft=_decode_document(place.group("aircraft")),
        settings=_decode_document(place.group("settings")) if "settings" in place.node.members else None,
        overrides=place.texts("overrides", "override"),
        resolved=place.text("resolved"),
    )


def _decode_document(place: Place) -> StoredDocument:
    place.expecting("path", "text")
    return StoredDocument(place.text("path"), place.text("text"))


_TRAJECTORY = ("time", "interval_time", "states", "controls", "phases", "first_node", "durations")
_HASHES = ("inputs_hash", "chain_hash")
_TEXTS = ("outcome", "message")
_MULTIPLIERS = ("constraint_multipliers", "bound_multipliers")
_TABLES = ("notes", "splits", "attempts", "timings", "provenance")
_OPTIONAL = ("certificate", "suggested_changes")
_MEMBERS = (*_TRAJECTORY, *_TEXTS, *_MULTIPLIERS, *_TABLES, "mesh", "search")


def _decode_stage(place: Place, stage: Stage) -> StoredStage:
    place.expecting(*_MEMBERS, *_HASHES, "alternatives", optional=_OPTIONAL)
    alternatives = place.group("alternatives")
    numbers = [str(number) for number in range(1, len(alternatives.node.members) + 1)]
    alternatives.expecting(*numbers)
    found = tuple(
        _decode_result(alternatives.group(one).expecting(*_MEMBERS, optional=_OPTIONAL), stage) for one in numbers
    )
    result = replace(_decode_result(place, stage), alternatives=found)
    return StoredStage(result, place.text("inputs_hash"), place.text("chain_hash"))


def _decode_result(place: Place, stage: Stage) -> StageResult:
    trajectory = _decode_trajectory(place)
    result = StageResult(
        stage=stage,
        outcome=_outcome(place),
        message=place.text("message"),
        trajectory=trajectory,
        constraint_multipliers=place.floats("constraint_multipliers"),
        bound_multipliers=place.floats("bound_multipliers"),
        certificate=_decode_certificate(place.group("certificate")) if "certificate" in place.node.members else None,
        splits=rows_of(GateSplit, place.table("splits"), f"{place.path}/splits"),
        attempts=rows_of(Attempt, place.table("attempts"), f"{place.path}/attempts"),
        timings=_one_row(place, "timings", Timings),
        provenance=_one_row(place, "provenance", StageProvenance),
        mesh=_decode_mesh(place.group("mesh"), len(trajectory.time) - 1),
        search=_decode_explored(place.group("search")),
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


def _outcome(place: Place) -> Status:
    text = place.text("outcome")
    for outcome in OUTCOMES:
        if outcome.value == text:
            return outcome
    raise CheckpointError(f"{place.path}/outcome: unknown outcome {text[:40]!r}")


def _decode_certificate(place: Place) -> Certificate:
    place.expecting("solver_status", "items")
    items = rows_of(Item, place.table("items"), f"{place.path}/items")
    return Certificate(place.text("solver_status"), items)


def _decode_explored(place: Place) -> SearchReport:
    place.expecting("routes", "loops", "summary")
    summary = _one_row(place, "summary", SearchSummary)
    routes = rows_of(Route, place.table("routes"), f"{place.path}/routes")
    return SearchReport(
        routes,
        summary.converged_to_best,
        summary.converged_elsewhere,
        summary.failed,
        summary.seconds,
        place.texts("loops", "loop"),
    )


def _decode_mesh(place: Place, intervals: int) -> MeshRecord:
    place.expecting("why", "coarser", "defect", "drift")
    why, coarser = place.integers("why"), place.integers("coarser")
    defect, drift = place.floats("defect"), place.floats("drift")
    lengths = (len(why), len(coarser), len(defect), len(drift))
    if lengths not in ((0, 0, 0, 0), (intervals, intervals + 1, intervals, intervals)):
        raise CheckpointError(f"{place.path}: does not belong to {intervals} intervals")
    if not np.isin(why, [reason.value for reason in RefinementReason]).all() or not np.isin(coarser, (0, 1)).all():
        raise CheckpointError(f"{place.path}: has unknown entries")
    return MeshRecord(why.astype(np.int8), coarser.astype(np.bool_), defect, drift)


def _decode_trajectory(place: Place) -> Trajectory:
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
    states, state = _decode_histories(place.group("states"), intervals + 1)
    controls, control = _decode_histories(place.group("controls"), intervals)
    return Trajectory(phases, first_node, durations, time, states, state, controls, control)


def _decode_histories(place: Place, length: int) -> tuple[tuple[Quantity, ...], Array]:
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
