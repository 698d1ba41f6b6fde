"""A flight log as it is stored: what it was imported with, what was recorded, and the flight that was made of it."""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airrace.errors import CheckpointError
from airrace.files.checkpoint.checkpoint import StoredInputs
from airrace.files.checkpoint.codec import Hint, RecordLayout
from airrace.files.checkpoint.hdf5 import Reader, Writer
from airrace.files.checkpoint.run_layout import (
    QUANTITY_NAME,
    HistoryGroup,
    StoredHistory,
    ensure_attitudes,
    ensure_lengths,
    ensure_sizes,
)
from airrace.flights.logs.violations import Violation
from airrace.optimal_control.trajectory import Array


@dataclass(frozen=True)
class StoredPassing:
    """A passing, with its time, s after the start, and the standard deviation of that, s; NaN where it was not made."""

    passing: str
    time: float
    deviation: float


@dataclass(frozen=True)
class StoredReceiver:
    """What is known of the errors of a log's positions.

    Attributes:
        noise: standard deviation that was given, m; NaN where it is estimated.
        accuracy: standard deviation of all that positions are off by together, m, as stated; NaN where it was not.
        barometric: whether heights are those of a barometer.
        assumption: the accuracy that judgements assume, in words.
    """

    noise: float
    accuracy: float
    barometric: bool
    assumption: str


@dataclass(frozen=True, eq=False)
class RawLog:
    """The part of a log that the flight was made from, as it was read.

    Attributes:
        path: of the log, as it was given.
        format: `csv`, `gpx`, `igc` or `acmi`.
        begins: when its first sample was taken, ISO 8601 in UTC; empty where it knows no date.
        offset: the time of the log at which the flight's clock starts, s.
        time: of the samples, s after the first one of the log, shape (m,).
        lines: of the file that they come from, shape (m,).
        columns: what was recorded, by the names of histories, in SI units, each of shape (m,).
        remarks: sentences on the log.
        receiver: the errors of its positions.
    """

    path: str
    format: str
    begins: str
    offset: float
    time: Array
    lines: NDArray[np.int64]
    columns: Mapping[str, Array]
    remarks: tuple[str, ...]
    receiver: StoredReceiver


@dataclass(frozen=True, eq=False)
class LogCheckpoint:
    """All that the file of a flight log holds.

    Attributes:
        inputs: course and aircraft, as documents and as resolved.
        versions: of airrace and of the libraries that its numbers depend on, by name.
        log: what was recorded.
        time: of the flight, s after the start, rising, shape (n,).
        histories: of the flight, in their order.
        passings: one per passage of the course.
        violations: of the rules.
        label: what people call the flight by.
    """

    inputs: StoredInputs
    versions: Mapping[str, str]
    log: RawLog
    time: Array
    histories: tuple[StoredHistory, ...]
    passings: tuple[StoredPassing, ...]
    violations: tuple[Violation, ...]
    label: str


FLIGHT_LOG = "flight log"
"""The attribute `content` of such a file."""
LOG_SCHEMA = 1
"""The version of this layout; a reader refuses every other."""
BASES = ("measured", "derived")
NEEDED = ("x", "y", "z", "height", "V_K", "n_z", "chi", "gamma", "mu")
"""The histories that every flight has."""


class Columns:
    """A group of series by name."""

    def write(self, group: Writer, name: str, value: Mapping[str, Array]) -> None:
        """Write the columns of a log."""
        within = group.group(name)
        for column, recorded in value.items():
            if not QUANTITY_NAME.fullmatch(column):
                raise CheckpointError(f"{column!r} is not a name for a quantity: it cannot be stored")
            within.dataset(column, float, recorded, {"units": "", "long_name": ""})

    def read(self, group: Reader, name: str) -> dict[str, Array]:
        """Return the columns of a log."""
        within = group.group(name)
        return {column: within.dataset(column, float) for column in within.names}


def _validate_log(log: RawLog, path: str) -> RawLog:
    if {len(log.lines), *(len(column) for column in log.columns.values())} != {len(log.time)}:
        raise CheckpointError(f"{path}: its columns are not equally long")
    for name, recorded in {**log.columns, "time": log.time, "offset": np.array([log.offset])}.items():
        ensure_sizes(recorded[~np.isnan(recorded)], f"{path}/{name}")
    if log.receiver.accuracy <= 0.0 or log.receiver.noise <= 0.0:
        raise CheckpointError(f"{path}/receiver: no receiver has such errors")
    return log


def _validate_flight(flight: LogCheckpoint, path: str) -> LogCheckpoint:
    time, path = flight.time, f"{path}/flight"
    ensure_sizes(time, f"{path}/time")
    if len(time) < 2 or not (np.diff(time) > 0.0).all():
        raise CheckpointError(f"{path}/time: does not run forwards")
    ensure_lengths(flight.histories, len(time), f"{path}/histories")
    histories = {history.quantity.name: history.values for history in flight.histories}
    for history in flight.histories:
        where = f"{path}/histories/{history.quantity.name}"
        ensure_sizes(history.values, where)
        if history.basis not in BASES:
            raise CheckpointError(f"{where}: is neither {' nor '.join(BASES)}")
    if missing := [name for name in NEEDED if name not in histories]:
        raise CheckpointError(f"{path}/histories: {missing[0]!r} is missing")
    ensure_attitudes(histories, f"{path}/histories")
    times = [passing.time for passing in flight.passings if not np.isnan(passing.time)]
    within = all(time[0] <= passed <= time[-1] for passed in times)
    if not within or any(earlier > later for earlier, later in itertools.pairwise(times)):
        raise CheckpointError(f"{path}/passings: do not follow one another within the flight")
    return flight


LOG_LAYOUTS = {
    RawLog: RecordLayout(
        {
            "offset": Hint("", "s", "time of the log at which the flight's clock starts"),
            "time": Hint("", "s", "time after the first sample of the log"),
            "lines": Hint("line", "1", "line of the log"),
            "columns": Hint(special=Columns()),
        },
        unpack=_validate_log,
    ),
    LogCheckpoint: RecordLayout(
        {
            "time": Hint("flight/time", "s", "time after the start"),
            "histories": Hint("flight/histories", special=HistoryGroup("time")),
            "passings": Hint("flight/passings"),
            "violations": Hint("flight/violations"),
            "label": Hint("flight/label"),
        },
        unpack=_validate_flight,
    ),
}
"""The layouts of the records of flight logs; their inputs are stored like those of runs."""
