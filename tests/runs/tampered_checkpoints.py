"""Checkpoints whose numbers were edited and whose checksum and hashes were computed anew."""

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from disk_cache import cached_across_workers

import airrace
from airrace.files.checkpoint import Checkpoint
from airrace.optimal_control.certificate import Certificate, Curvature, Item
from airrace.optimal_control.trajectory import Trajectory
from airrace.procedure.result import MeshRecord, Note, NoteKind, StageProvenance, StageResult, Status
from airrace.procedure.stage import Stage
from airrace.runs.run_state import run_of_checkpoint

Tampering = Callable[[Checkpoint], Checkpoint]
HOMOTOPY, POINT_MASS, TRANSFER = Stage.HOMOTOPY, Stage.POINT_MASS, Stage.TRANSFER_FUNCTION


@cached_across_workers
def genuine() -> Checkpoint:
    """Three stages of a small course, the last of them certified."""
    return airrace.optimize("half_cuban_eight", until="transfer-function", search="off").checkpoint


def resealed(checkpoint: Checkpoint, results: Iterable[StageResult]) -> Checkpoint:
    """The results under the inputs of a checkpoint, with valid hashes."""
    checkpoint = replace(checkpoint, stages=())
    for result in results:
        checkpoint = checkpoint.with_stage(result)
    return checkpoint


def edited(record: Any, path: str, value: Any) -> Any:  # Any: records of any kind
    """A record with one number replaced, or changed by a function.

    Args:
        record: a dataclass, or a tuple of them.
        path: names of fields, separated by points; in a tuple a number, a `name`, or `*` for all.
        value: the new value, or the function that computes it from the old one.
    """
    if not path:
        return value(record) if callable(value) else value
    head, _, rest = path.partition(".")
    if not isinstance(record, tuple):
        return replace(record, **{head: edited(getattr(record, head), rest, value)})
    entries = list(record)
    for row, entry in enumerate(entries):
        if head in ("*", str(row), getattr(entry, "name", None)):
            entries[row] = edited(entry, rest, value)
    assert entries != list(record), path
    return tuple(entries)


def stage(stage: Stage, *edits: tuple[str, Any]) -> Tampering:
    """Edits of one stage, each a path and a value of `edited`."""

    def tamper(checkpoint: Checkpoint) -> Checkpoint:
        results: list[StageResult] = []
        for stored in checkpoint.stages:
            result = stored.result
            if result.stage is stage:
                for path, value in edits:
                    result = edited(result, path, value)
            results.append(result)
        return resealed(checkpoint, results)

    return tamper


def last(path: str, value: Any) -> Tampering:
    return stage(TRANSFER, (path, value))


def point_mass(path: str, value: Any) -> Tampering:
    return stage(POINT_MASS, (path, value))


def guess(path: str, value: Any) -> Tampering:
    return stage(HOMOTOPY, (path, value))


def without(stage: Stage) -> Tampering:
    return lambda checkpoint: resealed(
        checkpoint, [stored.result for stored in checkpoint.stages if stored.result.stage is not stage]
    )


def versions(**numbers: str) -> Tampering:
    return lambda checkpoint: replace(checkpoint, versions={**checkpoint.versions, **numbers})


def without_version(checkpoint: Checkpoint) -> Checkpoint:
    names = checkpoint.versions.keys() - {"scipy"}
    return replace(checkpoint, versions={name: checkpoint.versions[name] for name in names})


def higher_entry(checkpoint: Checkpoint) -> Checkpoint:
    """Another text of the track, and all hashes renewed as if it had been solved."""
    text = checkpoint.inputs.track.text
    assert "height_m: 80" in text
    inputs = edited(checkpoint.inputs, "track.text", text.replace("height_m: 80", "height_m: 81"))
    understood = run_of_checkpoint(replace(checkpoint, inputs=inputs), None).checkpoint
    return resealed(understood, [stored.result for stored in understood.stages])


def times(factor: float) -> Callable[[Any], Any]:
    return lambda value: factor * value


def backwards(rows: tuple[Any, ...]) -> tuple[Any, ...]:
    return rows[::-1]


def without_first(rows: Any) -> Any:
    return rows[1:]


def without_item(name: str) -> Callable[[tuple[Item, ...]], tuple[Item, ...]]:
    return lambda items: tuple(item for item in items if item.name != name)


def largest_scaled(values: np.ndarray) -> np.ndarray:
    """The largest number of an array, a hundredth larger."""
    values = values.copy()
    values[int(np.abs(values).argmax())] *= 1.01
    return values


def node(row: int, column: int, value: Callable[[float], float]) -> Callable[[np.ndarray], np.ndarray]:
    def set_node(values: np.ndarray) -> np.ndarray:
        values = values.copy()
        values[row, column] = value(values[row, column])
        return values

    return set_node


def interval(value: float) -> Callable[[np.ndarray], np.ndarray]:
    """Controls of an interval so large that an integrator would follow them in ever smaller steps."""

    def set_interval(control: np.ndarray) -> np.ndarray:
        control = control.copy()
        control[:, 1] = value
        return control

    return set_interval


def node_moved(time: np.ndarray) -> np.ndarray:
    """A node within a leg, a hundredth of an interval later; the legs take as long as before."""
    time = time.copy()
    time[3] += 0.01 * (time[4] - time[3])
    return time


def without_last_leg(trajectory: Trajectory) -> Trajectory:
    end = int(trajectory.first_node[-2])
    return replace(
        trajectory,
        phases=trajectory.phases[:-1],
        first_node=trajectory.first_node[:-1],
        durations=trajectory.durations[:-1],
        time=trajectory.time[: end + 1],
        state=trajectory.state[:, : end + 1],
        control=trajectory.control[:, :end],
    )


def axes_swapped(rows: tuple[Any, ...]) -> tuple[Any, ...]:
    first, second, *rest = rows
    return (second, first, *rest)


def few_nodes(coarser: np.ndarray) -> np.ndarray:
    """Another coarser mesh, of hardly more than the ends of the first leg and the nodes of the rest."""
    marks = coarser.copy()
    marks[1:100] = False
    return marks


def with_alternative(checkpoint: Checkpoint) -> Checkpoint:
    """An alternative that was never solved."""
    stored = checkpoint.stage(POINT_MASS)
    assert stored is not None
    slower = edited(edited(stored.result, "trajectory.time", times(1.01)), "trajectory.durations", times(1.01))
    return point_mass("alternatives", (slower,))(checkpoint)


def with_itself(checkpoint: Checkpoint) -> Checkpoint:
    """The flight once more, as its own alternative."""
    stored = checkpoint.stage(POINT_MASS)
    assert stored is not None
    return point_mass("alternatives", (stored.result,))(checkpoint)


def shorter(stage_of_run: Stage) -> Tampering:
    """All legs and the axis, a thousandth shorter."""
    return stage(stage_of_run, ("trajectory.time", times(0.999)), ("trajectory.durations", times(0.999)))


def share_of_limit(item: Item) -> Item:
    return replace(item, value=item.value + 0.05 * item.limit)


ITEMS = "certificate.items"
GUESS_CERTIFICATE = Certificate("interior-point: solved", (Item("race_time_change", 0, 1),))
NO_MESH = MeshRecord(np.zeros(0, np.int8), np.zeros(0, np.bool_), np.zeros(0), np.zeros(0))

FOUND: dict[str, Tampering] = {
    "time axis scaled": last("trajectory.time", times(0.995)),
    "time axis of a guess scaled": guess("trajectory.time", times(0.995)),
    "time of a node": last("trajectory.time", node_moved),
    "race time": shorter(TRANSFER),
    "race time of the stage below": shorter(POINT_MASS),
    "times of splits": last("splits.*.time", times(0.9999)),
    "speeds at gates of a guess": guess("splits.*.V_K", times(1.1)),
    "headings at gates": last("splits.*.heading", times(1.5)),
    "names of gates": last("splits.*.name", lambda name: f"{name}x"),
    "no splits": last("splits", ()),
    "order of splits": last("splits", backwards),
    "states swapped": last("trajectory.states", axes_swapped),
    "states of a guess swapped": guess("trajectory.states", axes_swapped),
    "controls swapped": point_mass("trajectory.controls", axes_swapped),
    "unit of a state": last("trajectory.states.0.unit", "km"),
    "scale of a state": last("trajectory.states.0.scale", 7.0),
    "limit of a state": last("trajectory.states.3.upper", 200.0),
    "meaning of a state": last("trajectory.states.0.text", "west"),
    "name of a state": last("trajectory.states.0.name", "north"),
    "rate of a control": point_mass("trajectory.controls.0.rate_of", ""),
    "a state missing": stage(
        TRANSFER,
        ("trajectory.states", lambda states: (*states[:2], *states[3:])),
        ("trajectory.state", lambda state: np.delete(state, 2, axis=0)),
    ),
    "a control missing": stage(TRANSFER, ("trajectory.controls", without_first), ("trajectory.control", without_first)),
    "a leg missing": last("trajectory", without_last_leg),
    "names of legs": last("trajectory.phases", lambda names: tuple(f"{name}!" for name in names)),
    "order of a guess's legs": guess("trajectory.phases", backwards),
    "a state": last("trajectory.state", node(0, 20, lambda value: value + 1.0)),
    "a control": last("trajectory.control", node(0, 20, lambda value: value + 0.2)),
    "a control beyond integration": last("trajectory.control", interval(1e29)),
    "a control beyond integration, backwards": point_mass("trajectory.control", interval(-1e12)),
    "limits a tenth lower": point_mass(f"{ITEMS}.*.limit", times(0.9)),
    "KKT error divided": last(f"{ITEMS}.kkt_error.value", times(1e-6)),
    "replay divided": point_mass(f"{ITEMS}.replay_gate.value", times(1e-6)),
    "change of race time": last(f"{ITEMS}.race_time_change", share_of_limit),
    "Hamiltonian residual divided": last(f"{ITEMS}.hamiltonian_drift.value", times(1e-6)),
    "variation halved": last(f"{ITEMS}.variation_n_z_cmd.value", times(0.5)),
    "unit of an item": last(f"{ITEMS}.replay_gate.unit", "km"),
    "place of an item": last(f"{ITEMS}.hamiltonian_drift.where", "g99"),
    "name of an item": last(f"{ITEMS}.kkt_error.name", "kkt"),
    "words of the solver": last("certificate.solver_status", "interior-point: perfect"),
    "words of the solver in its item": last(f"{ITEMS}.solver.where", "perfect"),
    "kind of the curvature": last("certificate.second_order.curvature", Curvature.INDEFINITE),
    "place of the curvature": point_mass("certificate.second_order.phase", "g99"),
    "curvature that counts as zero": last("certificate.second_order.threshold", 2e-2),
    "least curvature": last("certificate.second_order.least", 1e-1),
    "number of weakly active limits": last("certificate.second_order.weakly_active", 0),
    "no curvature": last("certificate.second_order", None),
    "an item missing": last(ITEMS, without_item("hamiltonian_drift")),
    "race times not compared": last(ITEMS, without_item("race_time_change")),
    "an item more": last(ITEMS, lambda items: (*items, Item("approved", 0.0, 1.0))),
    "order of items": last(ITEMS, backwards),
    "no certificate": last("certificate", None),
    "no certificate below": point_mass("certificate", None),
    "a guess with a certificate": guess("certificate", GUESS_CERTIFICATE),
    "a failure below": point_mass("outcome", Status.NOT_CERTIFIED),
    "a message": last("message", "the fastest flight that anyone can fly"),
    "a message of a guess": guess("message", "certified by the race director"),
    "a note of a guess": last("notes", (Note(NoteKind.PLANNED_PHASES, "left as planned"),)),
    "a note on a mesh check": last("notes", (Note(NoteKind.MESH_CHECK, "not confirmed"),)),
    "a note on a simpler route": last("notes", (Note(NoteKind.SIMPLER_ROUTE, "approved by the race director"),)),
    "a note on the start": point_mass("notes", (Note(NoteKind.START, "approved by the race director"),)),
    "cost of the regularisation": last("provenance.regularisation", 0.0),
    "start of a stage": last("provenance.source_stage", "six-dof"),
    "start from another run": last(
        "provenance", lambda start: replace(start, source_stage="homotopie", source_run="other.h5")
    ),
    "start of the point mass": point_mass("provenance.source_stage", "transfer-function"),
    "tracking error without a start": point_mass("provenance", StageProvenance(0.006, "", "", 3.0, 1.0, 0.0)),
    "negative tracking error": last("provenance.tracking_error", -1.0),
    "defect of the mesh": last("mesh.defect", times(1e-6)),
    "drift of the mesh": point_mass("mesh.drift", times(1e-6)),
    "coarser mesh": last("mesh.coarser", few_nodes),
    "coarser mesh of all nodes": last("mesh.coarser", np.ones_like),
    "no record of the mesh": last("mesh", NO_MESH),
    "multipliers of limits": last("constraint_multipliers", largest_scaled),
    "multipliers of another problem": last("constraint_multipliers", np.zeros(1)),
    "no multipliers": point_mass("constraint_multipliers", np.zeros(0)),
    "multipliers of bounds": last("bound_multipliers", largest_scaled),
    "no multipliers of bounds": last("bound_multipliers", np.zeros(0)),
    "another version": versions(casadi="1.0"),
    "a version more": versions(fortran="77"),
    "a version missing": without_version,
    "first stage dropped": without(HOMOTOPY),
    "stage in the middle dropped": without(POINT_MASS),
    "last stage dropped": without(TRANSFER),
    "an alternative": with_alternative,
    "an alternative that is the flight itself": with_itself,
    "seconds of the solver": last("timings.solve", 0.001),
    "endless seconds": last("timings.wall", math.inf),
    "no attempts": point_mass("attempts", ()),
    "negative iterations": last("attempts.*.iterations", -1),
    "height of the entry gate": higher_entry,
}
"""Changes that `verify` has to find, by what they change."""

UNVERIFIABLE: dict[str, Tampering] = {
    "iterations": last("attempts.*.iterations", 1),
    "wall time": last("timings.wall", 0.5),
    "reasons of the mesh": last("mesh.why", lambda reasons: np.full_like(reasons, 3)),
    "tracking error of the start": last("provenance.tracking_error", 0.01),
}
"""Changes of what leaves no trace in a flight, which no measurement can find."""
