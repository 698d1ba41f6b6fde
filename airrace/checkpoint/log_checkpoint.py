"""A flown log as it is stored: what it was imported with, what was recorded, and the flight that was made of it."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from airrace.checkpoint.checkpoint import StoredInputs
from airrace.logs.violations import Violation
from airrace.quantities import Quantity
from airrace.records import record
from airrace.trajectory import Array


@record
class StoredHistory:
    """A history: its declaration, its values over the flight's time axis, and whether it was measured or derived."""

    quantity: Quantity
    values: Array
    basis: str


@record
class StoredPassing:
    """A passing, with its time, s after the start; NaN where it was not made."""

    passing: str
    time: float


@record
class RecordedLog:
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
    """

    path: str
    format: str
    begins: str
    offset: float
    time: Array
    lines: NDArray[np.int64]
    columns: Mapping[str, Array]
    remarks: tuple[str, ...]


@record
class Recorded:
    """All that the file of a flown log holds.

    Attributes:
        inputs: course and aircraft, as documents and as resolved.
        versions: of airrace and of the libraries that its numbers depend on, by name.
        log: what was recorded.
        time: of the flight, s after the start, rising, shape (n,).
        histories: of the flight, in their order.
        passings: one per passage of the course.
        breaches: of the rules.
        label: what people call the flight by.
    """

    inputs: StoredInputs
    versions: Mapping[str, str]
    log: RecordedLog
    time: Array
    histories: tuple[StoredHistory, ...]
    passings: tuple[StoredPassing, ...]
    breaches: tuple[Violation, ...]
    label: str
