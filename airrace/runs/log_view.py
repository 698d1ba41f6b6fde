"""A flight log: the flight that was made of it, and what it would be penalised for."""

import math
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

import numpy as np

from airrace.errors import CheckpointError, UsageError
from airrace.files.checkpoint import LogCheckpoint, RawLog, StoredHistory, StoredPassing, StoredReceiver, write_log
from airrace.files.export.csv import export_flight_csv
from airrace.files.inputs import Inputs, inputs_from_documents
from airrace.flights.logs.violations import Violation
from airrace.flights.results import Basis, Flight, History, Penalty, Source, TimedCrossing, Verification
from airrace.flights.results.clearances import with_distances
from airrace.flights.results.cost_to_go import CostToGoLoss
from airrace.pages.views.log_tables import passings_table, penalties_text, violations_table
from airrace.procedure.result import GateSplit
from airrace.runs.json_objects import cost_to_go_object, finite, legs_object, stamp_object, verification_object
from airrace.runs.output import write_or_return
from airrace.runs.stage_data import Splits
from airrace.runs.stored_inputs import library_versions, stored_documents, stored_inputs
from airrace.runtime.standard_streams import stem_of

if TYPE_CHECKING:
    from airrace.flights.logs.csv_log import ColumnLayout
    from airrace.flights.logs.log_flight import LogFlight

RATES = 1e-3, 1e4
"""Rows per second that may be asked for, Hz."""


@dataclass(frozen=True, eq=False)
class LogView:
    """A log of a flight through a course.

    Attributes:
        inputs: course, aircraft and air, as they were given.
        recorded: what its file holds.
        verification: the outcome of making the flight of the stored log once more; None where that was no question.
        cost_to_go: its losses by the cost to go of a run; None where that was no question. It is stored nowhere.
        displaced: sentences on the gates that by this and other logs stand elsewhere; they are stored nowhere, either.
        remade: the flight that follows from the stored log, where it was made; None elsewhere.
    """

    inputs: Inputs
    recorded: LogCheckpoint
    verification: Verification | None = None
    cost_to_go: CostToGoLoss | None = None
    displaced: tuple[str, ...] = ()
    remade: "LogFlight | None" = None

    @property
    def violations(self) -> tuple[Violation, ...]:
        """The rules that the flight would break, certain ones first, each in the order of the course."""
        return self.recorded.violations

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences for readers of the flight."""
        return self.recorded.log.remarks

    @property
    def penalty(self) -> float:
        """The penalties of all violations that are certain, s: infinity where one ends the race, else NaN where no rule
        states the penalty of one.
        """
        penalties = [violation.penalty for violation in self.violations if violation.certain]
        return math.inf if math.inf in penalties else float(sum(penalties))

    @property
    def race_time_deviation(self) -> float:
        """The standard deviation of the race time, s; NaN where there is none."""
        return math.hypot(self.recorded.passings[0].deviation, self.recorded.passings[-1].deviation)

    @property
    def assumption(self) -> str:
        """The accuracy that judgements assume, in words."""
        return self.recorded.log.receiver.assumption

    @property
    def begins(self) -> datetime | None:
        """When the flight's clock starts; None where the log knows no date."""
        log = self.recorded.log
        return datetime.fromisoformat(log.begins) + timedelta(seconds=log.offset) if log.begins else None

    def flight(self, label: str | None = None) -> Flight:
        """Return the flight; see `airrace.flights.results`.

        Args:
            label: what people call it; None for the name of the log.

        Raises:
            CheckpointError: the passings are not those of its course.
        """
        checkpoint, race = self.recorded, self.inputs.race
        names = [passage.name for passage in race.course.passages]
        if [passing.passing for passing in checkpoint.passings] != names:
            raise CheckpointError("the flight log is damaged: its passings are not those of its course")
        histories: dict[str, History] = {}
        for history in checkpoint.histories:
            histories[history.quantity.name] = History(history.quantity, history.values, Basis(history.basis))
        crossings: list[TimedCrossing] = []
        for passage, passing in zip(race.course.passages, checkpoint.passings, strict=True):
            values: dict[str, float] = {}
            if math.isfinite(passing.time):
                row = min(int(np.searchsorted(checkpoint.time, passing.time - 1e-9)), len(checkpoint.time) - 1)
                values = {name: float(history.values[row]) for name, history in histories.items()}
            crossings.append(TimedCrossing(passage, passing.time, values))
        source = Source(
            label or checkpoint.label,
            version=checkpoint.versions.get("airrace", ""),
            remark=" ".join(self.remarks),
            verification=self.verification,
            begins=self.begins,
            penalties=penalties_text(self.violations),
            displaced=self.displaced,
            called_penalties=tuple(
                Penalty(violation.passing, violation.rule, violation.time, violation.penalty)
                for violation in sorted(self.violations, key=lambda violation: violation.time)
                if violation.certain and math.isfinite(violation.time)
            ),
        )
        return with_distances(Flight(race, source, checkpoint.time, histories, tuple(crossings)))

    @property
    def splits(self) -> Splits:
        """The gate splits of the passings that were made."""
        crossings = [crossing for crossing in self.flight().crossings if crossing.found]
        return Splits(
            tuple(
                GateSplit(
                    crossing.name,
                    crossing.time,
                    V_K=crossing.value("V_K"),
                    height=crossing.value("height"),
                    n_z=crossing.value("n_z"),
                    bank=crossing.value("mu"),
                    climb=crossing.value("gamma"),
                    heading=crossing.value("chi"),
                )
                for crossing in crossings
            )
        )

    def to_csv(self, path: str | Path | None = None, rate: float | None = None) -> str:
        """Return or write all histories as comma-separated values.

        Args:
            path: a file to be written; None for none.
            rate: rows per second; None for all times of the flight.

        Returns:
            The text; empty where a file is written, which may be larger than the memory.

        Raises:
            UsageError: the rate cannot be exported.
            StorageError: the system refused.
        """
        return write_or_return(path, lambda stream: self.write_csv(stream, rate))

    def write_csv(self, stream: TextIO, rate: float | None = None) -> None:
        """Write all histories as comma-separated values, as `to_csv` does, to a stream that is open."""
        if rate is not None and not RATES[0] <= rate <= RATES[1]:
            raise UsageError(f"a rate of {rate:g} Hz cannot be exported; it must lie in {RATES[0]:g} to {RATES[1]:g}")
        export_flight_csv(self.flight(), stream, rate_hz=rate)

    def as_object(self) -> dict[str, object]:
        """Return what `airrace show --json` prints of it: SI units and radians, violations in their own units."""
        flight, log = self.flight(), self.recorded.log
        verification = {} if self.verification is None else verification_object(self.verification)
        return {
            "flown": True,
            "track": flight.course.name,
            "aircraft": flight.aircraft.name,
            "stamp": stamp_object(flight.stamp),
            "log": log.path,
            "format": log.format,
            "begins": log.begins or None,
            "start_in_log_s": log.offset,
            "race_time_s": finite(flight.race_time),
            "race_time_deviation_s": finite(self.race_time_deviation),
            "assumption": self.assumption,
            **verification,
            "penalty_s": finite(self.penalty),
            "race_over": math.isinf(self.penalty),
            "passings": passings_table(flight).objects(),
            "violations": violations_table(self.violations).objects(),
            **legs_object(flight),
            **({} if self.cost_to_go is None else {"cost_to_go": cost_to_go_object(self.cost_to_go)}),
            "histories": {name: history.basis.value for name, history in flight.histories.items()},
            "remarks": list(self.remarks),
        }

    def save(self, path: str | Path) -> None:
        """Write it into a file, replacing what is there.

        Raises:
            StorageError: the system refused.
            CheckpointError: it cannot be stored, for instance because it would be too large.
        """
        write_log(Path(path), self.recorded)


def new_log_view(inputs: Inputs, log_flight: "LogFlight") -> LogView:
    """Return a flight log that is stored nowhere yet."""
    flight, log = log_flight.flight, log_flight.recording
    checkpoint = LogCheckpoint(
        inputs=stored_inputs(inputs),
        versions=library_versions(),
        log=RawLog(
            path=log.path,
            format=log.format,
            begins="" if log.begins is None else log.begins.isoformat(),
            offset=log_flight.offset,
            time=log.time,
            lines=log.lines,
            columns=log.columns,
            remarks=log_flight.remarks,
            receiver=StoredReceiver(
                math.nan if log_flight.noise is None else log_flight.noise,
                math.nan if log.accuracy is None else log.accuracy,
                log.barometric,
                log_flight.assumption,
            ),
        ),
        time=flight.time,
        histories=tuple(
            StoredHistory(history.quantity, history.values, history.basis.value)
            for history in flight.histories.values()
        ),
        passings=tuple(_stored_passing(log_flight, crossing) for crossing in flight.crossings),
        violations=log_flight.violations,
        label=flight.label,
    )
    return LogView(inputs, checkpoint)


def _stored_passing(log_flight: "LogFlight", crossing: TimedCrossing) -> StoredPassing:
    deviation = log_flight.known[crossing.name].time if crossing.found else math.nan
    return StoredPassing(crossing.name, crossing.time, deviation)


def open_log(checkpoint: LogCheckpoint) -> LogView:
    """Return a flight log that was read from its file; its inputs are understood anew from their stored texts.

    Raises:
        InputError: this version of airrace no longer accepts them.
    """
    track, aircraft, _ = stored_documents(checkpoint.inputs)
    overrides = [text for text in checkpoint.inputs.overrides if not text.strip().startswith("settings.")]
    return LogView(inputs_from_documents(track, aircraft, None, overrides), checkpoint)


def fly_log_through(
    log: Path,
    inputs: Inputs,
    *,
    layout: "ColumnLayout | None" = None,
    noise: float | None = None,
    run: int | None = None,
    name: str | None = None,
    height_offset: float = 0.0,
) -> LogView:
    """Return a log as a flight through a course that is at hand; arguments and errors are those of `import_log`."""
    # Imported here: imported logs are read without whatever makes a flight of a log.
    from airrace.flights.logs.log_flight import flight_from_log
    from airrace.flights.logs.reading import read_log

    recording = read_log(log, layout, aircraft=name)
    log_flight = flight_from_log(
        recording,
        inputs.race,
        label=stem_of(log),
        penalties=inputs.penalties,
        noise=noise,
        run=run,
        height_offset=height_offset,
    )
    return new_log_view(inputs, log_flight)
