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
    search/ways, loops, summary         tables: other routes that were tried
    suggested_changes                   table: what would resolve conflicts of limits; only where there are any
    alternatives/N/                     flights on other routes, but for the hashes like the stage itself
"""

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from airrace.checkpoint.checkpoint import Checkpoint, StoredDocument, StoredInputs, StoredStage
from airrace.checkpoint.tree import Attribute, Group, Node, Series, Table, table_of
from airrace.errors import CheckpointError
from airrace.optimal_control.certificate import Certificate, Item
from airrace.procedure.result import (
    Attempt,
    GateSplit,
    MeshRecord,
    SearchReport,
    StageProvenance,
    StageResult,
    SuggestedChange,
    Timings,
    Way,
)
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

    led: int
    elsewhere: int
    lost: int
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
        "stages": Group({stored.result.stage.value: _stage(stored) for stored in checkpoint.stages}),
    }
    return Group(members, {"schema": SCHEMA})


def inputs_group(inputs: StoredInputs) -> Group:
    """Return the inputs as a group, as runs and flown logs store them."""
    members: dict[str, Node] = {
        "track": _document(inputs.track),
        "aircraft": _document(inputs.aircraft),
        "overrides": Table({"override": inputs.overrides}),
        "resolved": inputs.resolved,
    }
    if inputs.settings is not None:
        members["settings"] = _document(inputs.settings)
    return Group(members)


def _document(document: StoredDocument) -> Group:
    return Group({"path": document.path, "text": document.text})


def _stage(stored: StoredStage) -> Group:
    path = f"/stages/{stored.result.stage.value}"
    alternatives = {
        f"{number}": Group(_result(alternative, f"{path}/alternatives/{number}"))
        for number, alternative in enumerate(stored.result.alternatives, start=1)
    }
    hashes = {"inputs_hash": stored.inputs_hash, "chain_hash": stored.chain_hash}
    return Group({**hashes, **_result(stored.result, path), "alternatives": Group(alternatives)})


def _result(result: StageResult, path: str) -> dict[str, Node]:
    members: dict[str, Node] = {
        "outcome": result.outcome.value,
        "message": result.message,
        "notes": table_of(NoteRow, [NoteRow(note.kind.value, note.text) for note in result.notes]),
        **_trajectory(result.trajectory, path),
        "constraint_multipliers": series(result.constraint_multipliers, "1", "multipliers of the constraints"),
        "bound_multipliers": series(result.bound_multipliers, "1", "multipliers of the simple bounds"),
        "mesh": _mesh(result.mesh),
        "splits": table_of(GateSplit, result.splits),
        "attempts": table_of(Attempt, result.attempts),
        "timings": table_of(Timings, [result.timings]),
        "provenance": table_of(StageProvenance, [result.provenance]),
        "search": _explored(result.search),
    }
    if result.suggested_changes:
        members["suggested_changes"] = table_of(SuggestedChange, result.suggested_changes)
    if result.certificate is not None:
        members["certificate"] = _certificate(result.certificate)
    return members


def _trajectory(trajectory: Trajectory, path: str) -> dict[str, Node]:
    return {
        "time": series(trajectory.time, "s", "time at the nodes"),
        "interval_time": series(trajectory.time[:-1], "s", "time at the beginning of the intervals"),
        "states": _histories(trajectory.states, trajectory.state, f"{path}/time"),
        "controls": _histories(trajectory.controls, trajectory.control, f"{path}/interval_time"),
        "phases": Table({"phase": trajectory.phases}),
        "first_node": integers(trajectory.first_node, "node at which each phase begins, and the last node"),
        "durations": series(trajectory.durations, "s", "duration of each phase"),
    }


def _mesh(record: MeshRecord) -> Group:
    return Group(
        {
            "why": integers(record.why, "why each interval is as long as it is"),
            "coarser": integers(record.coarser, "1 for nodes of the mesh whose race time was compared"),
            "defect": series(record.defect, "scaled", "deviation of the replay from the next node"),
            "drift": series(record.drift, "1", "distance of the Hamiltonian from -1"),
        }
    )


def _explored(explored: SearchReport) -> Group:
    summary = SearchSummary(explored.led, explored.elsewhere, explored.lost, explored.seconds)
    return Group(
        {
            "ways": table_of(Way, explored.ways),
            "loops": Table({"loop": explored.loops}),
            "summary": table_of(SearchSummary, [summary]),
        }
    )


def _certificate(certificate: Certificate) -> Group:
    return Group({"solver_status": certificate.solver_status, "items": table_of(Item, certificate.items)})


def _histories(declared: tuple[Quantity, ...], values: Array, axis: str) -> Group:
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
