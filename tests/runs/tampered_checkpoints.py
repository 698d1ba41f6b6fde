"""Ways to forge a run: each changes one thing of a checkpoint as a stranger would who can seal and link it again."""

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from disk_cache import cached_across_workers

import airrace
from airrace.files.checkpoint import Checkpoint
from airrace.optimal_control.certificate import Certificate, Curvature, Item
from airrace.optimal_control.trajectory import Trajectory
from airrace.procedure.result import MeshRecord, Note, NoteKind, StageProvenance, StageResult, Status
from airrace.procedure.stage import Stage
from airrace.runs.run import run_of_checkpoint

replace = dataclasses.replace
Change = Callable[[StageResult], StageResult]
Tampering = Callable[[Checkpoint], Checkpoint]
HOMOTOPY, POINT_MASS, TRANSFER = Stage.HOMOTOPY, Stage.POINT_MASS, Stage.TRANSFER_FUNCTION


@cached_across_workers
def genuine() -> Checkpoint:
    """Three stages of a small course, the last of them certified."""
    return airrace.optimize("half_cuban_eight", until="transfer-function", search="off").checkpoint


def resealed(checkpoint: Checkpoint, results: list[StageResult]) -> Checkpoint:
    """The results under the inputs of a checkpoint, with hashes as they should be."""
    forged = replace(checkpoint, stages=())
    for result in results:
        forged = forged.with_stage(result)
    return forged


def at(stage: Stage, change: Change) -> Tampering:
    """A change of one stage."""
    return lambda checkpoint: resealed(
        checkpoint,
        [change(one.result) if one.result.stage is stage else one.result for one in checkpoint.stages],
    )


def last(change: Change) -> Tampering:
    return at(TRANSFER, change)


def without(stage: Stage) -> Tampering:
    return lambda checkpoint: resealed(
        checkpoint, [one.result for one in checkpoint.stages if one.result.stage is not stage]
    )


def flown(change: Callable[[Trajectory], Trajectory]) -> Change:
    return lambda result: replace(result, trajectory=change(result.trajectory))


def certificate(change: Callable[[Certificate], Certificate]) -> Change:
    def changed(result: StageResult) -> StageResult:
        assert result.certificate is not None
        return replace(result, certificate=change(result.certificate))

    return changed


def items(change: Callable[[Item], Item], name: str = "") -> Change:
    """A change of one item of the certificate, or of all."""
    return certificate(
        lambda one: replace(one, items=tuple(change(i) if name in ("", i.name) else i for i in one.items))
    )


def splits(**factors: float) -> Change:
    """Numbers of all gate splits but the first, multiplied."""

    def changed(result: StageResult) -> StageResult:
        first, *others = result.splits
        rows = [replace(one, **{name: by * getattr(one, name) for name, by in factors.items()}) for one in others]
        return replace(result, splits=(first, *rows))

    return changed


def provenance(**values: Any) -> Change:
    return lambda result: replace(result, provenance=replace(result.provenance, **values))


def mesh(change: Callable[[MeshRecord], MeshRecord]) -> Change:
    return lambda result: replace(result, mesh=change(result.mesh))


def scaled_time(by: float) -> Change:
    return flown(lambda one: replace(one, time=by * one.time))


def moved_node(one: Trajectory) -> Trajectory:
    """A node within a leg, a hundredth of an interval later; the legs take as long as before."""
    time = one.time.copy()
    time[3] += 0.01 * (time[4] - time[3])
    return replace(one, time=time)


def faster(one: Trajectory) -> Trajectory:
    """All legs and the axis, a thousandth shorter."""
    return replace(one, time=0.999 * one.time, durations=0.999 * one.durations)


def swapped(names: tuple[str, str], kind: str) -> Change:
    """The declarations of two histories exchanged, and so their labels."""

    def changed(one: Trajectory) -> Trajectory:
        declared = list(getattr(one, kind))
        places = [next(row for row, each in enumerate(declared) if each.name == name) for name in names]
        declared[places[0]], declared[places[1]] = declared[places[1]], declared[places[0]]
        return replace(one, **{kind: tuple(declared)})

    return flown(changed)


def declared(kind: str, row: int, **values: Any) -> Change:
    def changed(one: Trajectory) -> Trajectory:
        rows = list(getattr(one, kind))
        rows[row] = replace(rows[row], **values)
        return replace(one, **{kind: tuple(rows)})

    return flown(changed)


def dropped(kind: str, values: str, row: int) -> Change:
    """A history that is missing by name."""

    def changed(one: Trajectory) -> Trajectory:
        rows = list(getattr(one, kind))
        rows.pop(row)
        return replace(one, **{kind: tuple(rows), values: np.delete(getattr(one, values), row, axis=0)})

    return flown(changed)


def without_a_leg(one: Trajectory) -> Trajectory:
    node = int(one.first_node[-2])
    return replace(
        one,
        phases=one.phases[:-1],
        first_node=one.first_node[:-1],
        durations=one.durations[:-1],
        time=one.time[: node + 1],
        state=one.state[:, : node + 1],
        control=one.control[:, :node],
    )


def one_number(name: str, by: float) -> Change:
    """The largest number of an array of the result, multiplied."""

    def changed(result: StageResult) -> StageResult:
        values = np.array(getattr(result, name))
        values[int(np.abs(values).argmax())] *= by
        return replace(result, **{name: values})

    return changed


def nudged(kind: str) -> Change:
    """One number of the histories, a hundredth of its scale further."""

    def changed(one: Trajectory) -> Trajectory:
        quantities = one.states if kind == "state" else one.controls
        values = getattr(one, kind).copy()
        values[0, values.shape[1] // 2] += 0.01 * quantities[0].scale
        return replace(one, **{kind: values})

    return flown(changed)


def unflyable(value: float) -> Callable[[Trajectory], Trajectory]:
    """Controls of an interval so large that an integrator would follow them in steps as small as they are many."""

    def changed(one: Trajectory) -> Trajectory:
        control = one.control.copy()
        control[:, 1] = value
        return replace(one, control=control)

    return changed


def coarser_elsewhere(one: MeshRecord) -> MeshRecord:
    """Another coarser mesh, of hardly more than the ends of the first leg and the nodes of the others."""
    marks = one.coarser.copy()
    marks[1:100] = False
    return replace(one, coarser=marks)


def with_rival(result: StageResult) -> StageResult:
    """An alternative that was never flown."""
    slower = replace(
        result.trajectory, durations=1.01 * result.trajectory.durations, time=1.01 * result.trajectory.time
    )
    return replace(result, alternatives=(replace(result, trajectory=slower, alternatives=()),))


def versions(**changed: str) -> Tampering:
    return lambda checkpoint: replace(checkpoint, versions={**checkpoint.versions, **changed})


def without_version(checkpoint: Checkpoint) -> Checkpoint:
    return replace(checkpoint, versions={name: one for name, one in checkpoint.versions.items() if name != "scipy"})


def texts(old: str, new: str) -> Tampering:
    """Another text of the track, and all links renewed as if it had been flown."""

    def changed(checkpoint: Checkpoint) -> Checkpoint:
        track = checkpoint.inputs.track
        assert old in track.text
        inputs = replace(checkpoint.inputs, track=replace(track, text=track.text.replace(old, new)))
        understood = run_of_checkpoint(replace(checkpoint, inputs=inputs), None).checkpoint
        return resealed(understood, [one.result for one in understood.stages])

    return changed


def second_order(**changed: object) -> Change:
    def told(one: Certificate) -> Certificate:
        assert one.second_order is not None
        return replace(one, second_order=replace(one.second_order, **changed))

    return certificate(told)


def million(item: Item) -> Item:
    return replace(item, value=item.value / 1e6)


FOUND: dict[str, Tampering] = {
    "time axis scaled": last(scaled_time(0.995)),
    "time axis scaled in a guess": at(HOMOTOPY, scaled_time(0.995)),
    "time of a node moved": last(flown(moved_node)),
    "race time": last(flown(faster)),
    "race time of the stage below": at(POINT_MASS, flown(faster)),
    "splits halved": last(splits(time=0.5)),
    "splits a millisecond shorter": last(splits(time=0.9999)),
    "splits emptied": last(lambda result: replace(result, splits=())),
    "splits without the last": last(lambda result: replace(result, splits=result.splits[:-1])),
    "splits in another order": last(lambda result: replace(result, splits=result.splits[::-1])),
    "splits of another stage": at(POINT_MASS, lambda result: replace(result, splits=result.splits[:1] * 5)),
    "speeds at gates": last(splits(V_K=1.1)),
    "loads at gates": last(splits(n_z=0.5)),
    "heights at gates": last(splits(height=1.01)),
    "climb at gates": last(splits(climb=0.5)),
    "headings at gates": last(splits(heading=1.5)),
    "names of gates": last(
        lambda result: replace(result, splits=tuple(replace(one, name=f"{one.name}x") for one in result.splits))
    ),
    "splits of a guess": at(HOMOTOPY, splits(V_K=1.1)),
    "states swapped": last(swapped(("x", "y"), "states")),
    "states of a guess swapped": at(HOMOTOPY, swapped(("x", "y"), "states")),
    "controls swapped": at(POINT_MASS, swapped(("n_z_dot", "n_y_dot"), "controls")),
    "unit of a state": last(declared("states", 0, unit="km")),
    "scale of a state": last(declared("states", 0, scale=7.0)),
    "limit of a state": last(declared("states", 3, upper=200.0)),
    "meaning of a state": last(declared("states", 0, text="west")),
    "rate of a control": at(POINT_MASS, declared("controls", 0, rate_of="")),
    "a state missing": last(dropped("states", "state", 2)),
    "a state of a guess missing": at(HOMOTOPY, dropped("states", "state", 2)),
    "a control missing": last(dropped("controls", "control", 0)),
    "a state by another name": last(declared("states", 0, name="north")),
    "a leg missing": last(flown(without_a_leg)),
    "names of legs": last(flown(lambda one: replace(one, phases=tuple(f"{name}!" for name in one.phases)))),
    "legs in another order": at(POINT_MASS, flown(lambda one: replace(one, phases=one.phases[::-1]))),
    "names of a guess's legs": at(HOMOTOPY, flown(lambda one: replace(one, phases=one.phases[::-1]))),
    "a state": last(nudged("state")),
    "a control": at(POINT_MASS, nudged("control")),
    "a control that nothing can fly": last(flown(unflyable(1e29))),
    "a control that nothing can fly backwards": at(POINT_MASS, flown(unflyable(-1e12))),
    "certificate divided by a million": last(items(million)),
    "limits divided by a million": last(items(lambda item: replace(item, limit=item.limit / 1e6))),
    "limits a tenth lower": at(POINT_MASS, items(lambda item: replace(item, limit=0.9 * item.limit))),
    "error of optimality divided": last(items(million, "kkt_error")),
    "replay divided": at(POINT_MASS, items(million, "replay_gate")),
    "change of race time divided": last(items(million, "race_time_change")),
    "drift divided": last(items(million, "hamiltonian_drift")),
    "variation halved": last(items(lambda item: replace(item, value=0.5 * item.value), "variation_n_z_cmd")),
    "unit of an item": last(items(lambda item: replace(item, unit="km"), "replay_gate")),
    "place of an item": last(items(lambda item: replace(item, where="g99"), "hamiltonian_drift")),
    "name of an item": last(items(lambda item: replace(item, name="kkt"), "kkt_error")),
    "words of the solver": last(certificate(lambda one: replace(one, solver_status="interior-point: perfect"))),
    "words of the solver in its item": last(items(lambda item: replace(item, where="perfect"), "solver")),
    "kind of the curvature": last(second_order(curvature=Curvature.INDEFINITE)),
    "place of the curvature": at(POINT_MASS, second_order(phase="g99")),
    "curvature that counts as zero": last(second_order(threshold=2e-2)),
    "least curvature": last(second_order(least=1e-1)),
    "number of weakly active limits": last(second_order(weakly_active=0)),
    "no curvature": last(certificate(lambda one: replace(one, second_order=None))),
    "an item missing": last(
        certificate(lambda one: replace(one, items=tuple(i for i in one.items if i.name != "hamiltonian_drift")))
    ),
    "race times not compared": last(
        certificate(lambda one: replace(one, items=tuple(i for i in one.items if i.name != "race_time_change")))
    ),
    "an item more": last(certificate(lambda one: replace(one, items=(*one.items, Item("approved", 0.0, 1.0))))),
    "items in another order": last(certificate(lambda one: replace(one, items=one.items[::-1]))),
    "no certificate": last(lambda result: replace(result, certificate=None)),
    "no certificate below": at(POINT_MASS, lambda result: replace(result, certificate=None)),
    "a guess with a certificate": at(
        HOMOTOPY,
        lambda result: replace(
            result, certificate=Certificate("interior-point: solved", (Item("race_time_change", 0, 1),))
        ),
    ),
    "a failure below": at(POINT_MASS, lambda result: replace(result, outcome=Status.NOT_CERTIFIED)),
    "a message": last(lambda result: replace(result, message="the fastest flight that anyone can fly")),
    "a message of a guess": at(HOMOTOPY, lambda result: replace(result, message="certified by the race director")),
    "a note of a guess": last(
        lambda result: replace(result, notes=(Note(NoteKind.PLANNED_PHASES, "left as planned"),))
    ),
    "a note on a mesh check": last(lambda result: replace(result, notes=(Note(NoteKind.MESH_CHECK, "not confirmed"),))),
    "cost of the regularisation": last(provenance(regularisation=0.0)),
    "start of a stage": last(provenance(source_stage="six-dof")),
    "start of a stage from another run": last(provenance(source_stage="homotopie", source_run="other.h5")),
    "start of the point mass": at(POINT_MASS, provenance(source_stage="transfer-function")),
    "straying without a start": at(
        POINT_MASS, lambda result: replace(result, provenance=StageProvenance(0.006, "", "", 3.0, 1.0, 0.0))
    ),
    "straying backwards": last(provenance(tracking_error=-1.0)),
    "replay of the mesh": last(mesh(lambda one: replace(one, defect=one.defect / 1e6))),
    "drift of the mesh": at(POINT_MASS, mesh(lambda one: replace(one, drift=one.drift / 1e6))),
    "coarser mesh": last(mesh(coarser_elsewhere)),
    "coarser mesh that is none": last(mesh(lambda one: replace(one, coarser=np.ones_like(one.coarser)))),
    "no record of the mesh": last(
        mesh(lambda _: MeshRecord(np.zeros(0, np.int8), np.zeros(0, np.bool_), np.zeros(0), np.zeros(0)))
    ),
    "multipliers of limits": last(one_number("constraint_multipliers", 1.01)),
    "multipliers of another problem": last(lambda result: replace(result, constraint_multipliers=np.zeros(1))),
    "no multipliers": at(POINT_MASS, lambda result: replace(result, constraint_multipliers=np.zeros(0))),
    "multipliers of bounds": last(one_number("bound_multipliers", 1.01)),
    "no multipliers of bounds": last(lambda result: replace(result, bound_multipliers=np.zeros(0))),
    "version of airrace": versions(airrace="9.0.0"),
    "version of casadi": versions(casadi="1.0"),
    "version of python": versions(python="2.7.18"),
    "a version more": versions(fortran="77"),
    "a version missing": without_version,
    "first stage dropped": without(HOMOTOPY),
    "stage in the middle dropped": without(POINT_MASS),
    "last stage dropped": without(TRANSFER),
    "an alternative": at(POINT_MASS, with_rival),
    "seconds of the solver": last(lambda result: replace(result, timings=replace(result.timings, solve=0.001))),
    "endless seconds": last(lambda result: replace(result, timings=replace(result.timings, wall=math.inf))),
    "no attempts": at(POINT_MASS, lambda result: replace(result, attempts=())),
    "fewer iterations than none": last(
        lambda result: replace(result, attempts=tuple(replace(one, iterations=-1) for one in result.attempts))
    ),
    "a gate that stands elsewhere": texts("height_m: 80", "height_m: 81"),
}
"""Changes that `verify` has to find, by what they change."""

UNVERIFIABLE: dict[str, Tampering] = {
    "iterations": last(
        lambda result: replace(result, attempts=tuple(replace(one, iterations=1) for one in result.attempts))
    ),
    "wall time": last(lambda result: replace(result, timings=replace(result.timings, wall=0.5))),
    "reasons of the mesh": last(mesh(lambda one: replace(one, why=np.full_like(one.why, 3)))),
    "tracking error of the start": last(provenance(tracking_error=0.01)),
}
"""Changes of what leaves no trace in a flight: nobody can find them without a signature, so it is called hearsay."""
