"""Comma-separated values: the flight as one table, the passages as another.

The stream is to be opened with `newline=""`. Numbers have ten significant digits, not-a-number is `nan`.
"""

import csv
from dataclasses import dataclass
from types import MappingProxyType
from typing import TextIO

import numpy as np

from airrace.export.columns import DEGREE, KNOT, Column, Derived, columns_of
from airrace.export.sampling import Sampler, at_nodes, at_rate
from airrace.procedure.result import StageResult
from airrace.trajectory import Array


@dataclass(frozen=True)
class Provenance:
    """Whose flight it is: names of track and aircraft, and the version of airrace that found it."""

    track: str
    aircraft: str
    version: str


NO_DERIVED: Derived = MappingProxyType({})


def export_csv(
    result: StageResult,
    stream: TextIO,
    *,
    rate_hz: float | None = None,
    derived: Derived = NO_DERIVED,
    sampler: Sampler | None = None,
    provenance: Provenance | None = None,
    comments: bool = True,
) -> None:
    """Write the flight: a header row `time_s,x_m,...,phase`, then one row per time.

    Args:
        result: the stage to export.
        stream: receives the text.
        rate_hz: rows per second from the start to the end, both included; None for one row per node of the mesh.
        derived: further columns.
        sampler: gives the states between the nodes; without one they are interpolated linearly, see `sampling`.
        provenance: names for the comments.
        comments: begin with lines `# key: value` that say which flight this is.

    Raises:
        UsageError: the rate cannot be exported.
    """
    trajectory = result.trajectory
    samples = at_nodes(trajectory) if rate_hz is None else at_rate(trajectory, rate_hz, sampler)
    columns = columns_of(trajectory, samples, derived)
    phases = np.array(trajectory.phases)[samples.phase]
    if comments:
        _write_comments(result, provenance, stream)
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([*(column.header for column in columns), "phase"])
    writer.writerows(zip(*(_formatted(column.values) for column in columns), phases.tolist(), strict=True))


def export_splits_csv(result: StageResult, stream: TextIO) -> None:
    """Write the passages: when, how long since the one before (the first: since the start), and how each was flown."""
    splits = result.splits
    time = np.array([split.time for split in splits], np.float64)
    speed = np.array([split.V_K for split in splits], np.float64)
    columns = (
        Column("time_s", time),
        Column("leg_s", np.diff(time, prepend=result.trajectory.time[0])),
        Column("V_K_m_s", speed),
        Column("V_K_kt", speed / KNOT),
        Column("height_m", np.array([split.height for split in splits], np.float64)),
        Column("n_z", np.array([split.n_z for split in splits], np.float64)),
        Column("bank_deg", np.array([split.bank for split in splits], np.float64) / DEGREE),
        Column("climb_deg", np.array([split.climb for split in splits], np.float64) / DEGREE),
        Column("heading_deg", _compass(np.array([split.heading for split in splits], np.float64))),
    )
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["passage", *(column.header for column in columns)])
    names = [split.name for split in splits]
    writer.writerows(zip(names, *(_formatted(column.values) for column in columns), strict=True))


def _write_comments(result: StageResult, provenance: Provenance | None, stream: TextIO) -> None:
    entries = {"stage": result.stage.value}
    if result.is_flight:
        entries["race time"] = f"{result.trajectory.race_time:.6f} s"
    else:
        entries["flight"] = f"none was found ({result.outcome.value}); this is where the solver gave up"
    entries["certified"] = "yes" if result.certified else "no"
    if provenance is not None:
        names = {"track": provenance.track, "aircraft": provenance.aircraft}
        entries = {**names, **entries, "airrace version": provenance.version}
    for key, value in entries.items():
        stream.write(f"# {key}: {' '.join(value.split())}\n")  # a name may hold line breaks, a comment may not


def _formatted(values: Array) -> list[str]:
    return np.char.mod("%.10g", values + 0.0).tolist()  # adding zero turns -0 into 0


def _compass(heading: Array) -> Array:
    """Degrees from 0 up to, not including, 360 also after rounding."""
    return np.mod(np.round(heading / DEGREE, 7), 360.0)
