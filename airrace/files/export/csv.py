"""Comma-separated values: the flight as one table, the passages as another.

The stream is to be opened with `newline=""`. Numbers have ten significant digits, not-a-number is `nan`.
"""

import csv
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TextIO

import numpy as np

from airrace.files.export.csv_cells import text_cell
from airrace.files.export.flight_table import (
    NO_DERIVED,
    Derived,
    HistoryColumn,
    Sampler,
    display_columns,
    flight_tables,
    pieces,
)
from airrace.files.export.globe import printable, stamp
from airrace.flights.results import Flight, Stamp
from airrace.procedure.result import StageResult


@dataclass(frozen=True)
class FlightOrigin:
    """The origin of a flight: the name of its track, its stamp, and the version of airrace."""

    track: str
    stamp: Stamp
    version: str

    def attributes(self, result: StageResult) -> dict[str, Any]:  # Any: texts and numbers
        """Return what the flight of a stage is, for the head of a dataset or a data frame."""
        return {
            "track": self.track,
            "aircraft": self.stamp.aircraft,
            "stage": result.stage.value,
            "race_time_s": result.trajectory.race_time if result.is_flight else float("nan"),
            "status": result.status.value,
            "certified": int(result.certified),  # netCDF has no truth values, and a text is always true
            **self.stamp.properties(),
            "airrace_version": self.version,
        }


def export_csv(
    result: StageResult,
    stream: TextIO,
    *,
    rate_hz: float | None = None,
    derived: Derived = NO_DERIVED,
    sampler: Sampler | None = None,
    provenance: FlightOrigin | None = None,
) -> None:
    """Write the flight of a stage: lines `# key: value`, a header `time_s,x_m,...,phase`, and one row per time.

    The other arguments are those of `flight_table`; a provenance goes into the comments.

    Raises:
        UsageError: the rate cannot be exported.
    """
    tables = flight_tables(result.trajectory, rate_hz, derived, sampler)
    entries = {"stage": result.stage.value}
    if result.is_flight:
        entries["race time"] = f"{result.trajectory.race_time:.6f} s"
    else:
        entries["flight"] = f"none was found ({result.outcome.value}); this is where the solver gave up"
    solved = " (solved on one mesh, the race time not confirmed on a second one)"
    entries["certified"] = "yes" if result.certified else f"no{solved if result.holds else ''}"
    if provenance is not None:
        names = {"track": provenance.track, "aircraft": provenance.stamp.aircraft}
        if provenance.stamp.failed:
            entries["certified"] = f"no ({', '.join(provenance.stamp.failed)})"
        entries["certified"] += f"; {_further(provenance.stamp)}"
        entries = {**names, **entries, "airrace version": provenance.version}
    _write_comments(entries, stream)
    _write_rows(((table.columns, table.phases) for table in tables), stream)


def export_flight_csv(flight: Flight, stream: TextIO, *, rate_hz: float | None = None) -> None:
    """Write all histories of a flight of any source, with the leg of each row.

    Args:
        rate_hz: rows per second, positive; None for one row per time of the flight.
    """
    race_time = f"{flight.race_time:.6f} s" if np.isfinite(flight.race_time) else "not finished"
    entries = {"track": flight.course.name, "aircraft": flight.aircraft.name, "flight": flight.label}
    if flight.source.begins is not None:
        entries["flight"] += f"; its clock starts {stamp(flight.source.begins, 0.0)}"
    entries |= {"race time": f"{race_time}; {_further(flight.stamp)}", "airrace version": flight.source.version}
    _write_comments(entries, stream)
    parts = [flight] if rate_hz is None else (flight.at(times) for times in pieces(flight.times_at_rate(rate_hz)))
    _write_rows(map(_columns_and_phases, parts), stream)


def _further(stamp: Stamp) -> str:
    """Return the entries of a stamp besides stage, certificate and aircraft.

    They share a line with another entry, so that the number of lines before the table stays what readers skip.
    """
    entries = stamp.entries().items()
    return "; ".join(f"{name}: {value}" for name, value in entries if name not in ("stage", "certificate", "aircraft"))


def _write_comments(entries: Mapping[str, str], stream: TextIO) -> None:
    for key, value in entries.items():
        stream.write(f"# {key}: {printable(value)}\n")


def _columns_and_phases(flight: Flight) -> tuple[Sequence[HistoryColumn], Sequence[str]]:
    columns = [HistoryColumn("time_s", flight.time)]
    for history in flight.histories.values():
        columns.extend(display_columns(history.quantity, history.values))
    passings = [crossing for crossing in flight.crossings if crossing.found]
    following = np.searchsorted([passing.time for passing in passings], flight.time)
    indices: list[int] = np.clip(following, 0, len(passings) - 1).tolist()
    return columns, [passings[index].name for index in indices]


def _write_rows(parts: Iterable[tuple[Sequence[HistoryColumn], Sequence[str]]], stream: TextIO) -> None:
    """Write a table that comes in pieces, each with its columns and the names of the legs of its rows."""
    writer = csv.writer(stream, lineterminator="\n")
    for number, (columns, phases) in enumerate(parts):
        if number == 0:
            writer.writerow([*(text_cell(column.header) for column in columns), "phase"])
        # Adding zero turns -0 into 0.
        texts = ([f"{value:.10g}" for value in (column.values + 0.0).tolist()] for column in columns)
        writer.writerows(zip(*texts, map(text_cell, phases), strict=True))
