"""Aircraft fitted to flight logs: drag polar, power and roll rate, and how well the logs tell them.

The bias and the scatter of the estimate are measured where the truth is known [B. Efron & R. J. Tibshirani, An
Introduction to the Bootstrap, 1993]: the optimum of the fitted aircraft is recorded as the logs were, and fitted again.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from airrace.errors import UsageError
from airrace.files.inputs.log_layout import read_layout, with_columns
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
from airrace.procedure.result import Progress, Silent
from airrace.procedure.settings import SearchEffort
from airrace.procedure.stored_stages import sampler
from airrace.race import Race
from airrace.runs.aircraft import Provenance, aircraft_text, read_aircraft_file
from airrace.runs.execute import execute
from airrace.runs.output import documents_of, ensure_free, write_text
from airrace.runs.plan import (
    AircraftGiven,
    TrackGiven,
    Values,
    document_or_path,
    plan_new_run,
    read_inputs,
    value_texts,
)
from airrace.runs.run_state import RunState
from airrace.runtime.process import available_cores
from airrace.runtime.standard_streams import stem_of

BOOTSTRAP_REPLICATES = 6
"""Recordings of the optimum that are fitted."""
BIAS_SHARE = 0.5
"""Share of the bias that counts as a standard deviation, for the pilot does not fly the optimum."""
_MARKS = (("fitted", "to the logs, with its standard deviation"),)
PROVENANCE = Provenance("An aircraft that is fitted to flight logs", _MARKS, "flight logs")
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
        path: of its file; None where none is written.
        start, aircraft: before and after.
        estimate: factors, winds and their covariance, the bias taken away.
        bias: of the factors, as it was measured, shape (3,).
        roll: the factor of the roll rate; None where it is not visible.
        logs: what was fitted.
    """

    path: Path | None
    start: Aircraft
    aircraft: Aircraft
    estimate: Estimate
    bias: Array
    roll: RollRate | None
    logs: tuple[FittedLog, ...]

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

    @property
    def correlations(self) -> Array:
        """The correlations of the factors, shape (3, 3)."""
        deviations = self.estimate.deviations[:FACTORS]
        return self.estimate.covariance[:FACTORS, :FACTORS] / np.outer(deviations, deviations)


def _numbers(aircraft: Aircraft) -> tuple[tuple[str, str, float], ...]:
    """Return names, units and values of what is fitted."""
    drag, kilowatts, rate = aircraft.drag, aircraft.propulsion.P_max / 1000.0, math.degrees(aircraft.point_mass.p)
    return ("C_D0", "", drag.C_D0), ("k", "", drag.k), ("power", "kW", kilowatts), ("roll rate", "deg/s", rate)


def fit(
    logs: str | Path | Sequence[str | Path],
    track: TrackGiven,
    *,
    aircraft: AircraftGiven,
    output: str | Path | None = None,
    force: bool = False,
    set: Values = (),
    mapping: str | Path | None = None,
    columns: Sequence[str] = (),
    progress: Progress | None = None,
) -> FittedAircraft:
    """Fit the drag polar, the power and the roll rate of an aircraft to flight logs of races at full power.

    Args:
        logs: one log or several of the same aircraft, as of `airrace.import_log`; the wind is found for each.
        track: the course that they pass, see `airrace.optimize`, with the wind as far as it is known.
        aircraft: from which the fit starts: a shipped one, a file or an `Aircraft`.
        output: the file of the fitted aircraft; None for none.
        force: whether an existing file is overwritten.
        set: single values of the course that are otherwise.
        mapping, columns: of the logs, see `airrace.import_log`.
        progress: who watches the optimum with which bias and scatter are measured.

    Raises:
        InputError: course, aircraft, mapping or a log are not valid, or the logs tell too little.
        UsageError: no log is given, or the file exists.
        StorageError: the folder does not exist or takes no files.
    """
    paths = [Path(log) for log in ([logs] if isinstance(logs, str | Path) else logs)]
    if not paths:
        raise UsageError("a fit needs a log")
    if any(text.startswith("aircraft.") for text in value_texts(set)):
        raise UsageError("numbers of the aircraft are changed in its file, from which the fit starts")
    target = None if output is None else Path(output)
    source = document_or_path(aircraft)
    assert source is not None  # for an aircraft is given
    if target is not None:
        ensure_free(target, force=force, sources=[*paths, track, source, mapping])
    inputs, template = read_inputs(track, aircraft, set=set), read_aircraft_file(source)
    if target is not None:
        ensure_free(target, force=True, sources=documents_of(inputs))
    layout = with_columns(ColumnLayout() if mapping is None else read_layout(Path(mapping))[0], columns)
    read = tuple(_read(path, inputs.race, layout) for path in paths)
    race, roll = inputs.race, measure_roll_rate(inputs.race.aircraft, [log.recorded for log in read])
    race = race if roll is None else Race(race.course, roll.aircraft(race.aircraft), race.air)
    estimate = estimate_factors(race.aircraft, race.air, [log.fitted_path for log in read])
    if not (estimate.visible.any() and np.isfinite(estimate.covariance).all()):
        missing = "that takes turns and straights at several speeds; more logs would help"
        refuse(str(paths[0]), 0, f"tells neither drag nor power: {missing}")
    estimate, bias = _correct(estimate, race, read, progress or Silent())
    fitted_aircraft = estimate.aircraft(race.aircraft)
    if target is not None:
        name = Path(source).stem if isinstance(source, str | Path) else inputs.race.aircraft.name
        write_text(
            target, aircraft_text(template, name, fitted_aircraft, _relations(estimate, roll), origin=PROVENANCE)
        )
    return FittedAircraft(target, inputs.race.aircraft, fitted_aircraft, estimate, bias, roll, read)


def _relations(estimate: Estimate, roll: RollRate | None) -> dict[tuple[str, str], str]:
    """Return the marks of the numbers that were fitted."""
    pairs = zip((("drag", "C_D0"), ("drag", "k"), ("propulsion", "P_max")), estimate.deviations[:FACTORS], strict=True)
    deviations = {key: deviation for (key, deviation), visible in zip(pairs, estimate.visible, strict=True) if visible}
    rolling = (("roll", "C_lxi"), ("yaw", "C_nxi"), ("point_mass", "p"))
    deviations |= {} if roll is None else dict.fromkeys(rolling, roll.deviation)
    return {key: f"fitted, +-{100.0 * deviation:.1f} %" for key, deviation in deviations.items()}


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
