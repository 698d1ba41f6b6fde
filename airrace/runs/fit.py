"""Aircraft fitted to flight logs: drag polar, power and roll rate, and how well the logs tell them.

The bias and the scatter of the estimate are measured where the truth is known [B. Efron & R. J. Tibshirani, An
Introduction to the Bootstrap, 1993]: the optimum of the fitted aircraft is recorded as the logs were, and fitted again.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from airrace.flights.logs.csv_log import ColumnLayout
from airrace.flights.logs.deviations import place_roundings
from airrace.flights.logs.identification import (
    FACTORS,
    RATE_MIN,
    SAMPLES_MIN,
    Estimate,
    RecordedPath,
    RollRate,
    estimate_factors,
    measure_roll_rate,
    recorded_path,
)
from airrace.flights.logs.log_flight import LogFlight, flight_from_log
from airrace.flights.logs.reading import read_log
from airrace.flights.logs.recording import refuse
from airrace.flights.logs.smoothing import smooth
from airrace.model.aircraft import Aircraft
from airrace.model.environment import Air, StaticWind
from airrace.optimal_control.quantities import KNOT
from airrace.optimal_control.trajectory import Array
from airrace.pages.views.tables import Column, Table
from airrace.procedure.result import Progress
from airrace.procedure.settings import SearchEffort
from airrace.procedure.stored_stages import sampler
from airrace.race import Race
from airrace.runs.aircraft_file import AircraftFile, AircraftOrigin, aircraft_text
from airrace.runs.execute import execute
from airrace.runs.execution_plan import (
    plan_new_run,
    read_inputs,
)
from airrace.runs.run_state import RunState
from airrace.runtime.process import available_cores
from airrace.runtime.standard_streams import stem_of

BOOTSTRAP_REPLICATES = 6
"""Recordings of the optimum that are fitted."""
BIAS_SHARE = 0.5
"""Share of the bias that counts as a standard deviation, for the pilot does not fly the optimum."""
_MARKS = (("fitted", "to the logs, with its standard deviation"),)
PROVENANCE = AircraftOrigin("An aircraft that is fitted to flight logs", _MARKS, "flight logs")
_COLUMNS = (
    Column("number", key="number"),
    Column("unit", key="unit"),
    Column("start", form=".4g", key="start"),
    Column("fitted", form=".4g", key="fitted"),
    Column("deviation", "%", ".1f", key="deviation_percent"),
    Column("remark", key="remark"),
)


@dataclass(frozen=True, eq=False)
class FittedLog:
    """A log that is fitted: its file, its flight, places (north, east, up; m) over time, and their rounding."""

    path: Path
    recorded: LogFlight
    time: Array
    places: Array
    least: Array

    def along(self, places: Array, until: float) -> RecordedPath:
        """Return what is fitted of it from the first passing up to so many s after it, with its places or others."""
        path, begin = smooth(self.time, places, least=self.least), self.recorded.offset
        return recorded_path(path, self.time, places, begin, begin + until)

    @property
    def fitted_path(self) -> RecordedPath:
        """What is fitted of it."""
        return self.along(self.places, float(self.recorded.flight.time[-1]))


@dataclass(frozen=True, eq=False)
class FittedAircraft:
    """An aircraft that was fitted to logs.

    Attributes:
        start, aircraft: before and after.
        estimate: factors, winds and their covariance, the bias taken away.
        bias: of the factors, as it was measured, shape (3,).
        roll: the factor of the roll rate; None where it is not visible.
        logs: what was fitted.
        path: of its file; None where none is written.
    """

    start: Aircraft
    aircraft: Aircraft
    estimate: Estimate
    bias: Array
    roll: RollRate | None
    logs: tuple[FittedLog, ...]
    path: Path | None = None

    @property
    def table(self) -> Table:
        """The numbers before and after with standard deviations; correlations, winds and what is left as notes."""
        visible, percent = self.estimate.visible.tolist(), (100.0 * self.estimate.deviations).tolist()
        before, after = _numbers(self.start), _numbers(self.aircraft)
        deviations = [deviation if show else None for deviation, show in zip(percent[:FACTORS], visible, strict=True)]
        deviations.append(100.0 * self.roll.deviation if self.roll else None)
        rows: list[list[str | float | None]] = [
            [*old, new, deviation, "not visible in the data: left as it was" if deviation is None else ""]
            for old, (_, _, new), deviation in zip(before, after, deviations, strict=True)
        ]
        pairs = [(i, j) for i in range(FACTORS) for j in range(i) if visible[i] and visible[j]]
        correlations = ", ".join(f"{after[j][0]} and {after[i][0]} {self.correlations[j, i]:+.2f}" for i, j in pairs)
        notes = [f"correlations: {correlations}"] if correlations else []
        for log, wind, off in zip(self.logs, self.estimate.winds, percent[FACTORS::2], strict=True):
            speed, origin = math.hypot(*wind) / KNOT, math.degrees(math.atan2(-wind[1], -wind[0])) % 360.0
            blows = f"{speed:.1f} kt from {origin:.0f} deg"
            notes.append(f"{log.path.name}: wind beside that of the course {blows}, +-{off / 100.0 / KNOT:.1f} kt")
        notes.append("no log shows the lags of roll and load factor, for none records the stick: left as they were")
        ailerons = ", full ailerons in the quickest roll" if self.roll else ""
        notes.append(f"full power is assumed from the first gate to the last{ailerons}")
        return Table(
            f"{self.aircraft.name}, fitted to {', '.join(log.path.name for log in self.logs)}", _COLUMNS, rows, notes
        )

    def file_text(self, template: AircraftFile, name: str) -> str:
        """Return the text of its file, with the numbers that were fitted marked; all others are the template's."""
        pairs = zip(
            (("drag", "C_D0"), ("drag", "k"), ("propulsion", "P_max")),
            self.estimate.deviations[:FACTORS],
            self.estimate.visible,
            strict=True,
        )
        deviations = {key: deviation for key, deviation, visible in pairs if visible}
        if self.roll is not None:
            rolling = (("roll", "C_lxi"), ("yaw", "C_nxi"), ("point_mass", "p"))
            deviations |= dict.fromkeys(rolling, self.roll.deviation)
        relations = {key: f"fitted, +-{100.0 * deviation:.1f} %" for key, deviation in deviations.items()}
        return aircraft_text(template, name, self.aircraft, relations, origin=PROVENANCE)

    @property
    def correlations(self) -> Array:
        """The correlations of the factors, shape (3, 3)."""
        deviations = self.estimate.deviations[:FACTORS]
        return self.estimate.covariance[:FACTORS, :FACTORS] / np.outer(deviations, deviations)


def _numbers(aircraft: Aircraft) -> tuple[tuple[str, str, float], ...]:
    """Return names, units and values of what is fitted."""
    drag, kilowatts, rate = aircraft.drag, aircraft.propulsion.P_max / 1000.0, math.degrees(aircraft.point_mass.p)
    return ("C_D0", "", drag.C_D0), ("k", "", drag.k), ("power", "kW", kilowatts), ("roll rate", "deg/s", rate)


def fit_logs(paths: Sequence[Path], race: Race, layout: ColumnLayout, progress: Progress) -> FittedAircraft:
    """Return the aircraft of a race, fitted to the logs of it.

    Args:
        paths: of the logs; the wind is found for each.
        race: course, aircraft from which the fit starts, and air.
        layout: of CSV files.
        progress: who watches the optimum with which bias and scatter are measured.

    Raises:
        InputError: a log is not valid, or the logs tell too little.
    """
    start, logs = race.aircraft, tuple(_read(path, race, layout) for path in paths)
    roll = measure_roll_rate(start, [log.recorded for log in logs])
    race = race if roll is None else Race(race.course, roll.aircraft(start), race.air)
    estimate = estimate_factors(race.aircraft, race.air, [log.fitted_path for log in logs])
    if not (estimate.visible.any() and np.isfinite(estimate.covariance).all()):
        missing = "that takes turns and straights at several speeds; more logs would help"
        refuse(str(paths[0]), 0, f"tells neither drag nor power: {missing}")
    estimate, bias = _correct(estimate, race, logs, progress)
    return FittedAircraft(start, estimate.aircraft(race.aircraft), estimate, bias, roll, logs)


def _read(path: Path, race: Race, layout: ColumnLayout) -> FittedLog:
    """Return a log as it is fitted; refuse it where it does not pass the course, or its positions are too few."""
    log_flight = flight_from_log(read_log(path, layout), race, label=stem_of(path))
    positions = log_flight.recording.select(np.isfinite(log_flight.recording.columns["x"]))
    count, lasting = len(positions.time), float(positions.time[-1] - positions.time[0])
    if count < SAMPLES_MIN or count < RATE_MIN * lasting:
        least = f"at least {RATE_MIN:g} per second, {SAMPLES_MIN} in all"
        refuse(str(path), 0, f"holds {count} positions in {lasting:.0f} s of the race; a fit needs {least}")
    places = np.stack([positions.columns[name] for name in ("x", "y", "height")])
    return FittedLog(path, log_flight, positions.time, places, place_roundings(positions))


def _correct(estimate: Estimate, race: Race, logs: Sequence[FittedLog], progress: Progress) -> tuple[Estimate, Array]:
    """Return an estimate without its bias, its covariance enlarged to what was measured, and the bias."""
    aircraft, wind = estimate.aircraft(race.aircraft), estimate.winds.mean(axis=0)
    run = _optimum(Race(race.course, aircraft, _with_wind(race.air, wind)), progress)
    if not math.isfinite(run.race_time):
        refuse(str(logs[0].path), 0, f"makes an aircraft that cannot fly the course: {run.message}")
    at, last = sampler(run.race, run.results[-1]), run.race_time
    random = np.random.default_rng(len(logs))  # the same inputs give the same aircraft
    errors: list[Array] = []
    for _ in range(BOOTSTRAP_REPLICATES):
        paths: list[RecordedPath] = []
        for log in logs:
            states = at(np.clip(log.time - log.recorded.offset, 0.0, last))
            noise = log.fitted_path.noise[:, None]
            places = np.stack([states["x"], states["y"], -states["z"]])
            paths.append(log.along(places + noise * random.standard_normal(places.shape), last))
        again = estimate_factors(aircraft, race.air, paths)
        errors.append(np.concatenate([again.factors * estimate.visible, (again.winds - wind).ravel()]))
    table, visible = np.array(errors), np.append(estimate.visible, np.ones(2 * len(logs), np.bool_))
    bias = table.mean(axis=0)
    squares = np.sum((table - bias) ** 2, axis=0) / (len(errors) - 1)
    scatter = float((squares / estimate.deviations**2)[visible].mean())
    covariance = estimate.covariance * max(1.0, scatter) * (1.0 + 1.0 / len(errors))
    covariance += BIAS_SHARE**2 * np.outer(bias, bias)
    factors, winds = estimate.factors - bias[:FACTORS], estimate.winds - bias[FACTORS:].reshape(-1, 2)
    return replace(estimate, factors=factors, winds=winds, covariance=covariance), bias[:FACTORS]


def _with_wind(air: Air, wind: Array) -> Air:
    """Return the air with a wind added to its own, north and east, m/s."""
    own = air.wind or StaticWind(0.0, 0.0)
    north, east = own.north + float(wind[0]), own.east + float(wind[1])
    blows = replace(own, origin=math.atan2(-east, -north) % math.tau, speed=math.hypot(north, east))
    return replace(air, wind=blows)


def _optimum(race: Race, progress: Progress) -> RunState:
    """Return the run of a race, its routes not searched."""
    plan = plan_new_run(read_inputs(race, search=SearchEffort.OFF))
    return [*execute(plan, threads=available_cores(), progress=progress)][-1]
