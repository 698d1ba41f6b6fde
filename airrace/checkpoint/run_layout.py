"""The layout of a checkpoint as a tree, as `docs/reference/checkpoint.md` has it; a test holds the two together."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from airrace.checkpoint.checkpoint import (
    Checkpoint,
    ReserveAttempt,
    StoredAttempt,
    StoredDocument,
    StoredInputs,
    StoredStage,
)
from airrace.checkpoint.hdf5 import Attribute, Group, GroupReader, Node, Series, StoredTable, table_of
from airrace.errors import CheckpointError
from airrace.frames import QUATERNION
from airrace.optimal_control.certificate import Certificate, Curvature, Item, SecondOrder
from airrace.procedure.result import (
    OUTCOMES,
    Attempt,
    GateSplit,
    MeshRecord,
    Note,
    NoteKind,
    PylonCondition,
    PylonSide,
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
from airrace.trajectory import Array, Trajectory

SCHEMA = 7
"""The version of this layout; a reader refuses every other."""
OTHER_SCHEMA = (
    "Its inputs can be flown again: docs/how_to/hdf5.md (Extract the inputs) writes the texts /inputs/track/text, "
    "/inputs/aircraft/text and, where there is one, /inputs/settings/text into files; call `airrace optimize "
    "TRACK.yaml --aircraft AIRCRAFT.yaml --settings SETTINGS.yaml` with `--set` for each of /inputs/overrides. With "
    "`rules.reserve.found.…` among them, leave these and `margins.…` out, which a search for a reserve has written"
)
"""What to do with a run of another schema."""
CONTENT = "content"
"""The attribute that tells files of another kind from runs, which have none."""
QUANTITY_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,63}")


@dataclass(frozen=True)
class Version:
    """A row of the table of versions."""

    name: str
    version: str


@dataclass(frozen=True)
class NoteRow:
    """A row of the table of notes; `kind` is the value of a `NoteKind`."""

    kind: str
    text: str


@dataclass(frozen=True)
class SecondOrderRow:
    """The one row that says what the curvature tells, see `SecondOrder`; `curvature` is the value of a `Curvature`."""

    curvature: str
    threshold: float
    least: float
    phase: str
    quantity: str
    active: int
    weakly_active: int

    @classmethod
    def of(cls, one: SecondOrder) -> "SecondOrderRow":
        """Return the row of a verdict."""
        where = one.phase, one.quantity
        return cls(one.curvature.value, one.threshold, one.least, *where, one.active, one.weakly_active)

    def verdict(self) -> SecondOrder:
        """Return the verdict of the row.

        Raises:
            ValueError: the curvature is of an unknown kind.
        """
        kind, where = Curvature(self.curvature), (self.phase, self.quantity)
        return SecondOrder(kind, self.threshold, self.least, *where, self.active, self.weakly_active)


@dataclass(frozen=True)
class PylonConditionRow:
    """A row of the table of conditions on pylons; `side` is the value of a `PylonSide`."""

    element: str
    post: int
    leg: int
    share: float
    side: str
    error: float
    roll_acceleration: float


@dataclass(frozen=True)
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
    stages: dict[str, Node] = {}
    for stored in checkpoint.stages:
        name = stored.result.stage.value
        hashes = {"inputs_hash": stored.inputs_hash, "chain_hash": stored.chain_hash}
        stages[name] = Group({**hashes, **_encode_stage(stored.result, f"/stages/{name}")})
    attempts = {
        f"{number}": Group(_encode_attempt(one, f"/reserve/{number}"))
        for number, one in enumerate(checkpoint.attempts, start=1)
    }
    members: dict[str, Node] = {
        "inputs": inputs_group(checkpoint.inputs),
        "versions": versions_table(checkpoint.versions),
        "stages": Group(stages),
    }
    return Group(members | ({"reserve": Group(attempts)} if attempts else {}), {"schema": SCHEMA})


def _encode_attempt(stored: StoredAttempt, path: str) -> dict[str, Node]:
    members: dict[str, Node] = {
        "attempt": table_of(ReserveAttempt, [stored.attempt]),
        "overrides": StoredTable({"override": stored.overrides}),
        "chain_hash": stored.chain_hash,
    }
    if stored.result is not None:
        members["flight"] = Group(_encode_stage(stored.result, f"{path}/flight"))
    return members


def _encode_stage(result: StageResult, path: str) -> dict[str, Node]:
    """Return a result with its alternatives."""
    alternatives: dict[str, Node] = {
        f"{number}": Group(_encode_result(alternative, f"{path}/alternatives/{number}"))
        for number, alternative in enumerate(result.alternatives, start=1)
    }
    return {**_encode_result(result, path), "alternatives": Group(alternatives)}


def inputs_group(inputs: StoredInputs) -> Group:
    """Return the inputs as a group, as runs and flight logs store them."""
    documents = {"track": inputs.track, "aircraft": inputs.aircraft, "settings": inputs.settings}
    return Group(
        {
            **{name: Group({"path": one.path, "text": one.text}) for name, one in documents.items() if one},
            "overrides": StoredTable({"override": inputs.overrides}),
            "resolved": inputs.resolved,
        }
    )


def versions_table(versions: Mapping[str, str]) -> StoredTable:
    """Return versions by name as a table, as runs and flight logs store them."""
    return table_of(Version, [Version(name, number) for name, number in versions.items()])


def _encode_result(result: StageResult, path: str) -> dict[str, Node]:
    trajectory, mesh, search = result.trajectory, result.mesh, result.search
    summary = SearchSummary(search.converged_to_best, search.converged_elsewhere, search.failed, search.seconds)
    members: dict[str, Node] = {
        "outcome": result.outcome.value,
        "message": result.message,
        "notes": table_of(NoteRow, [NoteRow(note.kind.value, note.text) for note in result.notes]),
        "time": series(trajectory.time, "s", "time at the nodes"),
        "interval_time": series(trajectory.time[:-1], "s", "time at the start of the intervals"),
        "states": _encode_histories(trajectory.states, trajectory.state, f"{path}/time"),
        "controls": _encode_histories(trajectory.controls, trajectory.control, f"{path}/interval_time"),
        "phases": StoredTable({"phase": trajectory.phases}),
        "first_node": integers(trajectory.first_node, "node at which each phase begins, and the last node"),
        "durations": series(trajectory.durations, "s", "duration of each phase"),
        "constraint_multipliers": series(result.constraint_multipliers, "1", "multipliers of the constraints"),
        "bound_multipliers": series(result.bound_multipliers, "1", "multipliers of the simple bounds"),
        "mesh": Group(
            {
                "why": integers(mesh.why, "why each interval is as long as it is"),
                "coarser": integers(mesh.coarser, "1 for nodes of the mesh whose race time was compared"),
                "defect": series(mesh.defect, "scaled", "deviation of the replay from the next node"),
                "drift": series(mesh.drift, "1", "distance of the Hamiltonian from -1"),
            }
        ),
        "splits": table_of(GateSplit, result.splits),
        "attempts": table_of(Attempt, result.attempts),
        "timings": table_of(Timings, [result.timings]),
        "provenance": table_of(StageProvenance, [result.provenance]),
        "search": Group(
            {
                "routes": table_of(Route, search.routes),
                "loops": StoredTable({"loop": search.loops}),
                "summary": table_of(SearchSummary, [summary]),
            }
        ),
    }
    if result.pylon_conditions:
        members["pylon_conditions"] = table_of(
            PylonConditionRow,
            [
                PylonConditionRow(
                    one.element, one.post, one.leg, one.share, one.side.value, one.error, one.roll_acceleration
                )
                for one in result.pylon_conditions
            ],
        )
    if result.suggested_changes:
        members["suggested_changes"] = table_of(SuggestedChange, result.suggested_changes)
    if result.certificate is not None:
        items, judged = table_of(Item, result.certificate.items), result.certificate.second_order
        members["certificate"] = Group(
            {
                "solver_status": result.certificate.solver_status,
                "items": items,
                "second_order": table_of(SecondOrderRow, [] if judged is None else [SecondOrderRow.of(judged)]),
            }
        )
    return members


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
        raise CheckpointError("this is a flight log, not a run; show, report, compare, plot and export take it")
    schema = root.attributes.get("schema")
    if schema != SCHEMA:
        raise CheckpointError(
            f"the checkpoint's schema is {schema}; this airrace reads schema {SCHEMA} alone. {OTHER_SCHEMA}"
        )
    place = GroupReader("", root).expecting("inputs", "versions", "stages", optional=("reserve",))
    stages = place.group("stages")
    if unknown := set(stages.node.members) - {stage.value for stage in STAGES}:
        raise CheckpointError(f"/stages: unknown stage {min(unknown)!r}")
    stored = (_decode_stage(stages.group(one.value), one) for one in STAGES if one.value in stages.node.members)
    attempts = _decode_attempts(place.group("reserve")) if "reserve" in place.node.members else ()
    return Checkpoint(inputs_of(place.group("inputs")), versions_of(place), tuple(stored), attempts)


def _decode_attempts(place: GroupReader) -> tuple[StoredAttempt, ...]:
    numbers = [str(number) for number in range(1, len(place.node.members) + 1)]
    groups = [place.expecting(*numbers).group(number) for number in numbers]
    return tuple(_decode_attempt(group) for group in groups)


def _decode_attempt(place: GroupReader) -> StoredAttempt:
    place.expecting("attempt", "overrides", "chain_hash", optional=("flight",))
    attempt, result = place.row("attempt", ReserveAttempt), None
    counts, numbers = (attempt.outside, attempt.over_load), (attempt.risk, attempt.load_risk, attempt.lift)
    if min(counts) < 0 or max(counts) > attempt.flights or not all(0.0 <= one < math.inf for one in numbers):
        raise CheckpointError(f"{place.path}/attempt: counts or risks that no attempt can have")
    if ("flight" in place.node.members) is not (attempt.flights > 0):
        raise CheckpointError(f"{place.path}/flight: {attempt.flights} flights were counted along it")
    if attempt.flights:
        flight = place.group("flight").expecting(*_MEMBERS, "alternatives", optional=_OPTIONAL)
        result = _decode_whole(flight, STAGES[-1])
    return StoredAttempt(attempt, place.texts("overrides", "override"), result, place.text("chain_hash"))


def inputs_of(place: GroupReader) -> StoredInputs:
    """Return the inputs that a group holds, as runs and flight logs store them.

    Raises:
        CheckpointError: a member is missing, unknown or of the wrong kind.
    """
    place.expecting("track", "aircraft", "overrides", "resolved", optional=("settings",))
    documents: dict[str, StoredDocument] = {}
    for name in {"track", "aircraft", "settings"} & set(place.node.members):
        document = place.group(name).expecting("path", "text")
        documents[name] = StoredDocument(document.text("path"), document.text("text"))
    overrides, resolved = place.texts("overrides", "override"), place.text("resolved")
    return StoredInputs(documents["track"], documents["aircraft"], documents.get("settings"), overrides, resolved)


def versions_of(place: GroupReader) -> dict[str, str]:
    """Return the versions that stand at a place, by name."""
    return {row.name: row.version for row in place.rows("versions", Version)}


_MEMBERS = (
    *("outcome", "message", "notes", "time", "interval_time", "states", "controls", "phases", "first_node"),
    *("durations", "constraint_multipliers", "bound_multipliers", "mesh", "splits", "attempts", "timings"),
    *("provenance", "search"),
)
_OPTIONAL = ("certificate", "pylon_conditions", "suggested_changes")


def _decode_stage(place: GroupReader, stage: Stage) -> StoredStage:
    place.expecting(*_MEMBERS, "inputs_hash", "chain_hash", "alternatives", optional=_OPTIONAL)
    return StoredStage(_decode_whole(place, stage), place.text("inputs_hash"), place.text("chain_hash"))


def _decode_whole(place: GroupReader, stage: Stage) -> StageResult:
    """Return a result with its alternatives."""
    alternatives = place.group("alternatives")
    numbers = [str(number) for number in range(1, len(alternatives.node.members) + 1)]
    groups = [alternatives.expecting(*numbers).group(one).expecting(*_MEMBERS, optional=_OPTIONAL) for one in numbers]
    return replace(_decode_result(place, stage), alternatives=tuple(_decode_result(group, stage) for group in groups))


def _decode_result(place: GroupReader, stage: Stage) -> StageResult:
    trajectory = _decode_trajectory(place)
    outcome = place.text("outcome")
    if outcome not in [one.value for one in OUTCOMES]:
        raise CheckpointError(f"{place.path}/outcome: unknown outcome {outcome[:40]!r}")
    try:
        notes = tuple(Note(NoteKind(row.kind), row.text) for row in place.rows("notes", NoteRow))
    except ValueError as error:
        raise CheckpointError(f"{place.path}/notes: {str(error)[:80]}") from error
    certificate = None
    if "certificate" in place.node.members:
        certificate = _decode_certificate(place.group("certificate"))
    search = place.group("search").expecting("routes", "loops", "summary")
    summary = search.row("summary", SearchSummary)
    result = StageResult(
        stage=stage,
        outcome=Status(outcome),
        message=place.text("message"),
        trajectory=trajectory,
        constraint_multipliers=place.floats("constraint_multipliers"),
        bound_multipliers=place.floats("bound_multipliers"),
        certificate=certificate,
        splits=place.rows("splits", GateSplit),
        attempts=place.rows("attempts", Attempt),
        timings=place.row("timings", Timings),
        provenance=place.row("provenance", StageProvenance),
        mesh=_decode_mesh(place.group("mesh"), len(trajectory.time) - 1),
        search=SearchReport(
            search.rows("routes", Route),
            summary.converged_to_best,
            summary.converged_elsewhere,
            summary.failed,
            summary.seconds,
            search.texts("loops", "loop"),
        ),
        notes=notes,
        pylon_conditions=_decode_pylon_conditions(place, len(trajectory.phases)),
        suggested_changes=(
            place.rows("suggested_changes", SuggestedChange) if "suggested_changes" in place.node.members else ()
        ),
    )
    ensure_possible(result, place.path)
    return result


def _decode_pylon_conditions(place: GroupReader, legs: int) -> tuple[PylonCondition, ...]:
    if "pylon_conditions" not in place.node.members:
        return ()
    found: list[PylonCondition] = []
    for row in place.rows("pylon_conditions", PylonConditionRow):
        if row.side not in [side.value for side in PylonSide]:
            raise CheckpointError(f"{place.path}/pylon_conditions: unknown side {row.side[:40]!r}")
        if not (
            0 <= row.leg < legs
            and 0.0 <= row.share <= 1.0
            and abs(row.error) < math.inf
            and abs(row.roll_acceleration) < math.inf
        ):
            raise CheckpointError(f"{place.path}/pylon_conditions: no place or no number of a flight of {legs} legs")
        at, side = (row.element, row.post, row.leg, row.share), PylonSide(row.side)
        found.append(PylonCondition(*at, side, row.error, row.roll_acceleration))
    return tuple(found)


def _decode_mesh(place: GroupReader, intervals: int) -> MeshRecord:
    place.expecting("why", "coarser", "defect", "drift")
    why, coarser = place.integers("why"), place.integers("coarser")
    defect, drift = place.floats("defect"), place.floats("drift")
    lengths = (len(why), len(coarser), len(defect), len(drift))
    if lengths not in ((0, 0, 0, 0), (intervals, intervals + 1, intervals, intervals)):
        raise CheckpointError(f"{place.path}: does not belong to {intervals} intervals")
    if not np.isin(why, [reason.value for reason in RefinementReason]).all() or not np.isin(coarser, (0, 1)).all():
        raise CheckpointError(f"{place.path}: has unknown entries")
    return MeshRecord(why.astype(np.int8), coarser.astype(np.bool_), defect, drift)


def _decode_certificate(place: GroupReader) -> Certificate:
    place.expecting("solver_status", "items", "second_order")
    try:
        judged = [row.verdict() for row in place.rows("second_order", SecondOrderRow)]
    except ValueError as error:
        raise CheckpointError(f"{place.path}/second_order: {str(error)[:80]}") from error
    if len(judged) > 1:
        raise CheckpointError(f"{place.path}/second_order: has {len(judged)} rows")
    items = place.rows("items", Item)
    return Certificate(place.text("solver_status"), items, judged[0] if judged else None)


def _decode_trajectory(place: GroupReader) -> Trajectory:
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
    states, state = decode_histories(place.group("states"), intervals + 1)
    controls, control = decode_histories(place.group("controls"), intervals)
    return Trajectory(phases, first_node, durations, time, states, state, controls, control)


def decode_histories(place: GroupReader, length: int) -> tuple[tuple[Quantity, ...], Array]:
    """Return declarations and values, shape (n, length), in the order of their rows.

    Raises:
        CheckpointError: a member is no history of this length that is declared, or the rows have gaps.
    """
    rows: dict[int, tuple[Quantity, Array]] = {}
    for name in place.node.members:
        values = place.floats(name)
        if len(values) != length:
            raise CheckpointError(f"{place.path}/{name}: {len(values)} values instead of {length}")
        quantity, row = _declaration_of(name, place.series(name).attributes, f"{place.path}/{name}")
        rows[row] = (quantity, values)
    if sorted(rows) != list(range(len(place.node.members))):
        raise CheckpointError(f"{place.path}: the rows of its quantities are not 0, 1, 2, ...")
    ordered = [rows[row] for row in sorted(rows)]
    history = np.array([values for _, values in ordered], np.float64).reshape(len(ordered), length)
    return tuple(quantity for quantity, _ in ordered), history


def _declaration_of(name: str, attributes: Mapping[str, Attribute], path: str) -> tuple[Quantity, int]:
    """Return the quantity that attributes declare, and its row."""
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


ROUNDED = 1e-9
"""The largest difference between the durations of the phases and the times of their nodes, as a fraction of the race
time: both are sums of the same numbers in another order."""

LARGEST = 1e30
"""The largest magnitude of a number of a flight, in SI units.

No quantity of a flight comes near it, and products of a few such numbers still are finite.
"""
LENGTH_ERROR = 0.1
"""The largest distance of the length of an attitude's quaternion from 1; a flight keeps it at 1 but for rounding."""


def ensure_possible(result: StageResult, path: str) -> None:
    """Refuse a stage whose flight no aircraft can fly.

    Where no flight was found the numbers are those at which the solver gave up, and anything goes.

    Raises:
        CheckpointError: histories, times, multipliers or splits are not finite or larger than `LARGEST`; time runs
            backwards, does not begin at 0, or does not pass as the durations of the phases have it; a quaternion is
            no attitude.
    """
    if not result.is_flight:
        return
    trajectory = result.trajectory
    for name, values in (
        ("durations", trajectory.durations),
        ("time", trajectory.time),
        ("states", trajectory.state),
        ("controls", trajectory.control),
        ("constraint_multipliers", result.constraint_multipliers),
        ("bound_multipliers", result.bound_multipliers),
    ):
        ensure_sizes(values, f"{path}/{name}")
    numbers = [[value for value in vars(split).values() if isinstance(value, float)] for split in result.splits]
    ensure_sizes(np.array(numbers), f"{path}/splits")
    if not (trajectory.durations > 0.0).all():
        raise CheckpointError(f"{path}/durations: a phase takes no time")
    if trajectory.time[0] != 0.0 or not (np.diff(trajectory.time) > 0.0).all():
        raise CheckpointError(f"{path}/time: does not run forwards from 0")
    passed: Array = np.diff(trajectory.time[trajectory.first_node])
    if not (np.abs(passed - trajectory.durations) <= ROUNDED * trajectory.race_time).all():
        raise CheckpointError(f"{path}/time: does not pass as the durations of the phases have it")
    rows = {one.name: values for one, values in zip(trajectory.states, trajectory.state, strict=True)}
    ensure_attitudes(rows, f"{path}/states")


def ensure_sizes(values: Array, path: str) -> None:
    """Refuse numbers that nothing can be calculated with.

    Raises:
        CheckpointError: one of them is not finite, or larger than `LARGEST`.
    """
    if not np.isfinite(values).all():
        raise CheckpointError(f"{path}: holds numbers that are not finite")
    if (np.abs(values) > LARGEST).any():
        raise CheckpointError(f"{path}: holds numbers larger than {LARGEST:g}")


def ensure_attitudes(histories: Mapping[str, Array], path: str) -> None:
    """Refuse quaternions that are no attitudes; nothing is asked where there are none.

    Raises:
        CheckpointError: the length of a quaternion is not within `LENGTH_ERROR` of 1.
    """
    if not all(name in histories for name in QUATERNION):
        return
    length: Array = np.sqrt(sum(histories[name] ** 2 for name in QUATERNION))
    if not (np.abs(length - 1.0) <= LENGTH_ERROR).all():
        raise CheckpointError(f"{path}: the quaternion {', '.join(QUATERNION)} is not of length 1")
