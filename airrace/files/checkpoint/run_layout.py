"""The layout of a run file, as `docs/reference/checkpoint.md` has it, and what a flight must keep to be taken."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from airrace.errors import CheckpointError
from airrace.files.checkpoint.checkpoint import Checkpoint, StoredAttempt, StoredStage
from airrace.files.checkpoint.codec import Hint, RecordLayout
from airrace.files.checkpoint.hdf5 import Attribute, Reader, Writer
from airrace.model.frames import QUATERNION
from airrace.optimal_control.certificate import RefinementReason
from airrace.optimal_control.quantities import Quantity
from airrace.optimal_control.trajectory import Array, Indices, Trajectory
from airrace.procedure.result import OUTCOMES, MeshRecord, StageResult
from airrace.procedure.stage import STAGES, Stage

SCHEMA = 7
"""The version of this layout; a reader refuses every other."""
OTHER_SCHEMA = (
    "Its inputs can be flown again: docs/how_to/hdf5.md (Extract the inputs) writes the texts /inputs/track/text, "
    "/inputs/aircraft/text and, where there is one, /inputs/settings/text into files; call `airrace optimize "
    "TRACK.yaml --aircraft AIRCRAFT.yaml --settings SETTINGS.yaml` with `--set` for each of /inputs/overrides. With "
    "`rules.reserve.found.…` among them, leave these and `margins.…` out, which a search for a reserve has written"
)
"""What to do with a run of another schema."""
QUANTITY_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,63}")
DECLARATION = {"units": str, "long_name": str, "scale": float, "lower": float, "upper": float, "row": int}
"""The attributes that declare a quantity; `row` is its place among those beside it."""
FURTHER = {"rate_of": str, "basis": str}
"""Attributes of a history that are absent where they say nothing."""


@dataclass(frozen=True, eq=False)
class StoredHistory:
    """A history: its declaration, its values over the time axis, and whether a log's was measured or derived."""

    quantity: Quantity
    values: Array
    basis: str = ""


@dataclass(frozen=True)
class HistoryGroup:
    """A group of histories over the series `axis` beside it, in the order of their rows."""

    axis: str

    def write(self, group: Writer, name: str, value: tuple[StoredHistory, ...]) -> None:
        """Write histories."""
        within = group.group(name)
        names: list[str] = []
        for row, history in enumerate(value):
            quantity = history.quantity
            if not QUANTITY_NAME.fullmatch(quantity.name) or quantity.name in names:
                raise CheckpointError(f"{quantity.name!r} is not a name of its own for a quantity: it cannot be stored")
            names.append(quantity.name)
            bounds = float(quantity.scale), float(quantity.lower), float(quantity.upper)
            declared: tuple[Attribute, ...] = (quantity.unit, quantity.text, *bounds, row)
            further = {"rate_of": quantity.rate_of, "basis": history.basis}
            attributes = dict(zip(DECLARATION, declared, strict=True)) | {
                key: text for key, text in further.items() if text
            }
            within.dataset(quantity.name, float, history.values, attributes, self.axis)

    def read(self, group: Reader, name: str) -> tuple[StoredHistory, ...]:
        """Return the histories, or raise a `CheckpointError` that names what is no history."""
        within = group.group(name)
        rows: dict[int, StoredHistory] = {}
        for symbol in within.names:
            values = within.dataset(symbol, float)
            attributes: dict[str, Any] = {**within.attributes(DECLARATION | FURTHER, symbol)}  # Any: as declared
            if not DECLARATION.keys() <= attributes.keys() or not QUANTITY_NAME.fullmatch(symbol):
                raise CheckpointError(
                    f"{within.path}/{symbol}: is not declared as a quantity ({', '.join(DECLARATION)})"
                )
            unit, text, scale, lower, upper, row = (attributes[key] for key in DECLARATION)
            quantity = Quantity(symbol, unit, scale, lower, upper, text, attributes.get("rate_of", ""))
            rows[row] = StoredHistory(quantity, values, attributes.get("basis", ""))
        if sorted(rows) != list(range(len(within.names))):
            raise CheckpointError(f"{within.path}: the rows of its quantities are not 0, 1, 2, ...")
        return tuple(rows[row] for row in sorted(rows))


def ensure_lengths(histories: tuple[StoredHistory, ...], length: int, path: str) -> None:
    """Refuse histories that do not have a value for each place of their axis."""
    for history in histories:
        if len(history.values) != length:
            where = f"{path}/{history.quantity.name}"
            raise CheckpointError(f"{where}: {len(history.values)} values instead of {length}")


@dataclass(frozen=True, eq=False)
class StoredTrajectory:
    """A trajectory as it is stored: the histories one by one, the controls over the beginnings of the intervals."""

    phases: tuple[str, ...]
    first_node: Indices
    durations: Array
    time: Array
    interval_time: Array
    states: tuple[StoredHistory, ...]
    controls: tuple[StoredHistory, ...]


def stored_trajectory(trajectory: Trajectory) -> StoredTrajectory:
    """Return a trajectory as it is stored."""
    states = tuple(map(StoredHistory, trajectory.states, trajectory.state))
    controls = tuple(map(StoredHistory, trajectory.controls, trajectory.control))
    nodes = trajectory.first_node, trajectory.durations, trajectory.time, trajectory.time[:-1]
    return StoredTrajectory(trajectory.phases, *nodes, states, controls)


def trajectory_of(stored: StoredTrajectory, path: str) -> Trajectory:
    """Return the trajectory that is stored at a path, whose lengths and nodes belong together."""
    first_node, phases, intervals = stored.first_node, len(stored.phases), len(stored.time) - 1
    if intervals < 0 or not np.array_equal(stored.interval_time, stored.time[:-1], equal_nan=True):
        raise CheckpointError(f"{path}/interval_time: does not hold the beginnings of the intervals")
    if len(stored.durations) != phases:
        raise CheckpointError(f"{path}/durations: {len(stored.durations)} durations of {phases} phases")
    within = len(first_node) == phases + 1 and first_node[0] == 0 and first_node[-1] == intervals
    if not within or bool(np.any(first_node[1:] < first_node[:-1])):
        raise CheckpointError(f"{path}/first_node: does not divide {intervals} intervals into the phases")
    declared: list[tuple[Quantity, ...]] = []
    values: list[Array] = []
    for name, histories, length in (
        ("states", stored.states, intervals + 1),
        ("controls", stored.controls, intervals),
    ):
        ensure_lengths(histories, length, f"{path}/{name}")
        declared.append(tuple(history.quantity for history in histories))
        rows = [history.values for history in histories]
        values.append(np.array(rows, np.float64).reshape(len(rows), length))
    nodes = first_node, stored.durations, stored.time
    return Trajectory(stored.phases, *nodes, declared[0], values[0], declared[1], values[1])


def _validate_mesh(mesh: MeshRecord, path: str) -> MeshRecord:
    intervals = len(mesh.why)
    nodes = intervals + 1 if intervals else 0
    if (len(mesh.coarser), len(mesh.defect), len(mesh.drift)) != (nodes, intervals, intervals):
        raise CheckpointError(f"{path}: its series do not belong to the same intervals")
    if not np.isin(mesh.why, list(RefinementReason)).all():
        raise CheckpointError(f"{path}/why: holds reasons that do not exist")
    return mesh


def _validate_attempt(stored: StoredAttempt, path: str) -> StoredAttempt:
    attempt = stored.attempt
    counts = attempt.broken, attempt.outside, attempt.over_g
    numbers = attempt.risk, attempt.load_weight, attempt.lift
    if min(counts) < 0 or max(counts) > attempt.flights or not all(0.0 <= number < math.inf for number in numbers):
        raise CheckpointError(f"{path}/attempt: counts or risks that no attempt can have")
    if (stored.result is not None) is not (attempt.flights > 0):
        raise CheckpointError(f"{path}/flight: {attempt.flights} flights were counted along it")
    return stored


ROUNDED = 1e-9
"""The largest difference between the durations of the phases and the times of their nodes, as a fraction of the race
time: both are sums of the same numbers in another order."""

LARGEST = 1e30
"""The largest magnitude of a number of a flight, in SI units.

No quantity of a flight comes near it, and products of a few such numbers still are finite.
"""
LENGTH_ERROR = 0.1
"""The largest distance of the length of an attitude's quaternion from 1; a flight keeps it at 1 but for rounding."""


def validate_result(result: StageResult, path: str) -> StageResult:
    """Return a stage, or refuse one whose flight no aircraft can fly.

    Where no flight was found the numbers are those at which the solver gave up, and anything goes.

    Raises:
        CheckpointError: another outcome than those of stages; conditions of pylons that no flight has; a lower bound
            of the race time that no search leads to; a mesh of another flight; histories, times, multipliers or splits
            that are not finite or larger than `LARGEST`; time that runs backwards, does not begin at 0, or does not
            pass as the durations of the phases have it; a quaternion that is no attitude.
    """
    if result.outcome not in OUTCOMES:
        raise CheckpointError(f"{path}/outcome: unknown outcome {result.outcome.value!r}")
    if len(result.mesh.why) not in (0, len(result.trajectory.time) - 1):
        raise CheckpointError(f"{path}/mesh: does not belong to {len(result.trajectory.time) - 1} intervals")
    legs = len(result.trajectory.phases)
    for condition in result.pylon_conditions:
        finite = math.isfinite(condition.error) and math.isfinite(condition.roll_acceleration)
        if not (finite and 0 <= condition.leg < legs and 0.0 <= condition.share <= 1.0):
            raise CheckpointError(f"{path}/pylon_conditions: no place or no number of a flight of {legs} legs")
    if (bound := result.search.bound) is not None:
        numbers = [bound.race_time, *(window.slack for window in bound.windows)]
        finite = all(math.isfinite(number) for number in numbers)
        is_bounded = bool(bound.windows) or (bound.stopped and bound.seconds == 0.0)
        if not (finite and is_bounded and bound.race_time > 0.0 and 0.0 <= bound.seconds <= bound.race_time):
            raise CheckpointError(f"{path}/search/bound: no lower bound of a race time")
    if not result.is_flight:
        return result
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
    rows = {state.name: values for state, values in zip(trajectory.states, trajectory.state, strict=True)}
    ensure_attitudes(rows, f"{path}/states")
    return result


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
    """Refuse quaternions that are no attitudes; no check where there are none.

    Raises:
        CheckpointError: the length of a quaternion is not within `LENGTH_ERROR` of 1.
    """
    if not all(name in histories for name in QUATERNION):
        return
    length: Array = np.sqrt(sum(histories[name] ** 2 for name in QUATERNION))
    if not (np.abs(length - 1.0) <= LENGTH_ERROR).all():
        raise CheckpointError(f"{path}: the quaternion {', '.join(QUATERNION)} is not of length 1")


def _stage_at(path: str) -> Stage:
    """Return the stage of a result by its path; a reserve is searched for in the last one."""
    _, folder, name, *_ = path.split("/")
    return Stage(name) if folder == "stages" else STAGES[-1]


LAYOUTS = {
    Checkpoint: RecordLayout(
        {
            "stages": Hint(
                entries=lambda: [stage.value for stage in STAGES], entry=lambda stored: stored.result.stage.value
            ),
            "attempts": Hint("reserve", absent=True),
        }
    ),
    StoredStage: RecordLayout({"result": Hint(inline=True)}),
    StoredAttempt: RecordLayout({"result": Hint("flight")}, unpack=_validate_attempt),
    StageResult: RecordLayout(
        {
            "stage": Hint(value_at=_stage_at),
            "trajectory": Hint(inline=True),
            "constraint_multipliers": Hint("", "1", "multipliers of the constraints"),
            "bound_multipliers": Hint("", "1", "multipliers of the simple bounds"),
            "suggested_changes": Hint(absent=True),
            "alternatives": Hint(outermost=True),
            "pylon_conditions": Hint(absent=True),
        },
        unpack=validate_result,
    ),
    Trajectory: RecordLayout(
        {
            "first_node": Hint("", "1", "node at which each phase begins, and the last node"),
            "durations": Hint("", "s", "duration of each phase"),
            "time": Hint("", "s", "time at the nodes"),
            "interval_time": Hint("", "s", "time at the start of the intervals"),
            "states": Hint(special=HistoryGroup("time")),
            "controls": Hint(special=HistoryGroup("interval_time")),
        },
        StoredTrajectory,
        stored_trajectory,
        trajectory_of,
    ),
    MeshRecord: RecordLayout(
        {
            "why": Hint("", "1", "why each interval is as long as it is"),
            "coarser": Hint("", "1", "1 for nodes of the mesh whose race time was compared"),
            "defect": Hint("", "scaled", "deviation of the replay from the next node"),
            "drift": Hint("", "1", "distance of the Hamiltonian from -1"),
        },
        unpack=_validate_mesh,
    ),
}
"""The layouts of the records of runs."""
