"""A flight log as it is stored: what it was imported with, what was recorded, and the flight that was made of it."""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airrace.checkpoint.checkpoint import StoredInputs
from airrace.checkpoint.hdf5 import Group, GroupReader, Node, Series, StoredTable, table_of
from airrace.checkpoint.run_layout import (
    CONTENT,
    QUANTITY_NAME,
    declaration,
    decode_histories,
    ensure_attitudes,
    ensure_sizes,
    inputs_group,
    inputs_of,
    integers,
    series,
    versions_of,
    versions_table,
)
from airrace.errors import CheckpointError
from airrace.logs.violations import Violation
from airrace.quantities import Quantity
from airrace.trajectory import Array


@dataclass(frozen=True, eq=False)
class StoredHistory:
    """A history: its declaration, its values over the flight's time axis, and whether it was measured or derived."""

    quantity: Quantity
    values: Array
    basis: str


@dataclass(frozen=True)
class StoredPassing:
    """A passing, with its time, s after the start; NaN where it was not made."""

    passing: str
    time: float


@dataclass(frozen=True)
class StoredReceiver:
    """What is known of the errors of a log's positions.

    Attributes:
        noise: standard deviation that was given, m; NaN where it is estimated.
        accuracy: standard deviation of an error that all positions share, or that wanders for seconds, m.
        barometric: whether heights are those of a barometer.
    """

    noise: float
    accuracy: float
    barometric: bool


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
"""The content of such a file."""
LOG_SCHEMA = 1
"""The version of this layout; a reader refuses every other."""
BASES = ("measured", "derived")


def encode_log(recorded: LogCheckpoint) -> Group:
    """Return a flight log as a tree.

    Raises:
        CheckpointError: a name cannot name an HDF5 dataset.
    """
    log = recorded.log
    members: dict[str, Node] = {
        "inputs": inputs_group(recorded.inputs),
        "versions": versions_table(recorded.versions),
        "log": Group(
            {
                "path": log.path,
                "format": log.format,
                "begins": log.begins,
                "time": series(log.time, "s", "time after the first sample of the log"),
                "line": integers(log.lines, "line of the log"),
                "offset": series(np.array([log.offset]), "s", "time of the log at which the flight's clock starts"),
                "columns": Group({_named(name): series(one, "", "") for name, one in log.columns.items()}),
                "remarks": StoredTable({"remark": log.remarks}),
                "receiver": table_of(StoredReceiver, [log.receiver]),
            }
        ),
        "flight": Group(
            {
                "label": recorded.label,
                "time": series(recorded.time, "s", "time after the start"),
                "histories": Group(
                    {
                        _named(one.quantity.name): Series(
                            one.values, {**declaration(one.quantity, row), "basis": one.basis}, "/flight/time"
                        )
                        for row, one in enumerate(recorded.histories)
                    }
                ),
                "passings": table_of(StoredPassing, recorded.passings),
                "violations": table_of(Violation, recorded.violations),
            }
        ),
    }
    return Group(members, {CONTENT: FLIGHT_LOG, "schema": LOG_SCHEMA})


def is_log_checkpoint(root: Group) -> bool:
    """Return whether a tree is that of a flight log."""
    return root.attributes.get(CONTENT) == FLIGHT_LOG


def decode_log(root: Group) -> LogCheckpoint:
    """Return the flight log that a tree holds.

    Raises:
        CheckpointError: another content or schema; a member that is missing, unknown or of the wrong kind; shapes that
            contradict each other, or numbers that no flight can have.
    """
    schema = root.attributes.get("schema")
    if not is_log_checkpoint(root) or schema != LOG_SCHEMA:
        raise CheckpointError(f"the flight log's schema is {schema}; this airrace reads schema {LOG_SCHEMA}")
    place = GroupReader("", root).expecting("inputs", "versions", "log", "flight")
    flight = place.group("flight").expecting("label", "time", "histories", "passings", "violations")
    time = flight.floats("time")
    ensure_sizes(time, f"{flight.path}/time")
    if len(time) < 2 or not (np.diff(time) > 0.0).all():
        raise CheckpointError(f"{flight.path}/time: does not run forwards")
    histories = _histories(flight.group("histories"), len(time))
    passings = flight.rows("passings", StoredPassing)
    known = [one.time for one in passings if not np.isnan(one.time)]
    if any(not time[0] <= one <= time[-1] for one in known) or any(a > b for a, b in itertools.pairwise(known)):
        raise CheckpointError(f"{flight.path}/passings: do not follow one another within the flight")
    return LogCheckpoint(
        inputs=inputs_of(place.group("inputs")),
        versions=versions_of(place),
        log=_log(place.group("log")),
        time=time,
        histories=histories,
        passings=passings,
        violations=flight.rows("violations", Violation),
        label=flight.text("label"),
    )


def _named(name: str) -> str:
    if not QUANTITY_NAME.fullmatch(name):
        raise CheckpointError(f"{name!r} is not a name for a quantity: it cannot be stored")
    return name


def _log(place: GroupReader) -> RawLog:
    place.expecting("path", "format", "begins", "time", "line", "offset", "columns", "remarks", "receiver")
    time, lines, offset = place.floats("time"), place.integers("line"), place.floats("offset")
    columns = place.group("columns")
    values = {name: columns.floats(name) for name in columns.node.members}
    if len(offset) != 1 or {len(lines), *(len(one) for one in values.values())} != {len(time)}:
        raise CheckpointError(f"{place.path}: its columns are not equally long")
    for name, recorded in {**values, "time": time, "offset": offset}.items():
        ensure_sizes(recorded[~np.isnan(recorded)], f"{place.path}/{name}")
    path, log_format, begins = (place.text(name) for name in ("path", "format", "begins"))
    receiver = place.row("receiver", StoredReceiver)
    if not 0.0 <= receiver.accuracy < np.inf or receiver.noise <= 0.0:
        raise CheckpointError(f"{place.path}/receiver: no receiver has such errors")
    remarks = place.texts("remarks", "remark")
    return RawLog(path, log_format, begins, float(offset[0]), time, lines, values, remarks, receiver)


def _histories(place: GroupReader, length: int) -> tuple[StoredHistory, ...]:
    found: list[StoredHistory] = []
    for quantity, values in zip(*decode_histories(place, length), strict=True):
        path, basis = f"{place.path}/{quantity.name}", place.series(quantity.name).attributes.get("basis", "")
        ensure_sizes(values, path)
        if basis not in BASES:
            raise CheckpointError(f"{path}: is neither {' nor '.join(BASES)}")
        found.append(StoredHistory(quantity, values, str(basis)))
    histories = {one.quantity.name: one.values for one in found}
    needed = ("x", "y", "z", "height", "V_K", "n_z", "chi", "gamma", "mu")
    if missing := [one for one in needed if one not in histories]:
        raise CheckpointError(f"{place.path}: {missing[0]!r} is missing")
    ensure_attitudes(histories, place.path)
    return tuple(found)
