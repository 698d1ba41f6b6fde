"""Fairness: what aircraft and air are worth on a course, so that flights under different conditions can be compared.

The optimum of every aircraft is found in every wind and density, each started from the nearest one that is known. The
normalised time of a flight is what it would have taken in still standard air at the level of the sea,

    normalised = optimum there + (time - optimum in the air of the flight)

so that the pilot's own gap stays and wind and density go. The handicap of an aircraft is what its optimum in still
standard air is behind that of the fastest one. What gates favour whom follows from the sensitivities of those optima.
"""

import cmath
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from airrace.errors import NotCertified, UsageError
from airrace.files.inputs import Inputs, inputs_from_documents
from airrace.files.inputs.air import ORIGIN, OTHER_SPEED, SPEED, WIND, overrides_of, winds_named
from airrace.flights.results import Flight
from airrace.pages.views.tables import Column, Table
from airrace.procedure.result import Silent
from airrace.procedure.stage import Stage
from airrace.runs.batch.jobs import Combination, Sweep, combinations, job_name
from airrace.runs.execute import execute
from airrace.runs.execution_plan import plan_new_run, plan_resumed_run
from airrace.runs.flight_sources import open_file, source_of
from airrace.runs.output import FlightName
from airrace.runs.run_state import RunState, adopt_checkpoint, new_run
from airrace.runs.stage_data import stage_sensitivities
from airrace.runs.stage_view import StageView
from airrace.runs.stored_inputs import resolved_text
from airrace.runtime.standard_streams import stem_of

ELEVATION = "origin.elevation_m"
"""The only key of the air that is none of the environment."""
STANDARD_AIR: Combination = (
    *((WIND, "null"), ("environment.thermals", "null"), (ELEVATION, "0")),
    *(("environment.temperature_offset_K", "0"), ("environment.pressure_offset_hPa", "0")),
)
"""What makes the air of a course still standard air at the level of the sea."""
FAVOURS_SHOWN = 12
"""The largest number of a gate's numbers that are shown to people."""


def airs_of(winds: str | None, sweeps: Sequence[Sweep] = ()) -> tuple[Combination, ...]:
    """Return what is set in still standard air, and in every wind of a rose, e.g. of `0,5,10kt@8`, and swept air.

    Raises:
        UsageError: it is no rose, or a key is none of the air.
    """
    for sweep in sweeps:
        if sweep.key != ELEVATION and not sweep.key.startswith("environment."):
            text = f"`{sweep.key}` is no key of the air, which are those of `environment`, and `{ELEVATION}`"
            raise UsageError(text)
    rose = ((),) if winds is None else tuple(map(overrides_of, winds_named(winds)))
    return (STANDARD_AIR, *((*wind, *swept) for swept, wind in product(combinations(sweeps), rose)))


def air_text(air: Combination) -> str:
    """Return a condition in words, e.g. `10 kt from 45, temperature_offset_K=20`."""
    if air == STANDARD_AIR:
        return "still standard air"
    values = dict(air)
    wind = f"{values[SPEED]} kt from {values[ORIGIN]}" if {SPEED, ORIGIN} <= values.keys() else ""
    words = {WIND, OTHER_SPEED, SPEED, ORIGIN} if wind else {WIND}
    wind = wind or ("calm" if WIND in values else "")
    values_of_rest = (f"{key.rpartition('.')[2]}={value}" for key, value in air if key not in words)
    return ", ".join(filter(None, (wind, *values_of_rest))) or "as the course says"


@dataclass(frozen=True)
class Optimum:
    """The optimum of one aircraft in one air.

    Attributes:
        time: race time, s; NaN where none was found.
        message: why there is none, or none that is certified; empty else.
        stage: of its run; None where none was found.
    """

    time: float
    message: str
    stage: StageView | None


@dataclass(frozen=True)
class NormalisedFlight:
    """A flight, and the optima of its aircraft in the air that it flew in (`optimum`) and in still standard air, s.

    `race_time` is without penalties, s.
    """

    label: str
    aircraft: str
    race_time: float
    optimum: float
    standard: float

    @property
    def time(self) -> float:
        """What it would have taken in still standard air, s."""
        return self.standard + self.race_time - self.optimum


@dataclass(frozen=True)
class Favour:
    """A number of a gate by its key, and what a usual step of it costs, s, aircraft by aircraft."""

    key: str
    step: str
    costs: tuple[float, ...]

    @property
    def difference(self) -> float:
        """The largest cost without the least, s."""
        return max(self.costs) - min(self.costs)


@dataclass(frozen=True)
class Fairness:
    """What aircraft and air are worth on a course.

    Attributes:
        course: its name.
        stage: the fidelity of all optima.
        aircraft: by name.
        airs: the conditions, still standard air first, by what is set.
        optima: air by air, each aircraft by aircraft.
        favours: numbers of the gates, the largest differences first.
        flights: the fastest first.
    """

    course: str
    stage: Stage
    aircraft: tuple[str, ...]
    airs: tuple[Combination, ...]
    optima: tuple[tuple[Optimum, ...], ...]
    favours: tuple[Favour, ...] = ()
    flights: tuple[NormalisedFlight, ...] = ()

    @property
    def behind(self) -> tuple[tuple[float, ...], ...]:
        """What every aircraft is behind the fastest, s, air by air; NaN where an optimum is missing."""
        table: list[tuple[float, ...]] = []
        for row in self.optima:
            fastest = min((optimum.time for optimum in row if math.isfinite(optimum.time)), default=math.nan)
            table.append(tuple(optimum.time - fastest for optimum in row))
        return tuple(table)

    @property
    def messages(self) -> tuple[str, ...]:
        """What is missing or not certified."""
        messages: list[str] = []
        for air, row in zip(self.airs, self.optima, strict=True):
            for name, optimum in zip(self.aircraft, row, strict=True):
                if optimum.message:
                    messages.append(f"{name}, {air_text(air)}: {optimum.message}")
        return tuple(messages)

    def air_table(self) -> Table:
        """Return the optima of all aircraft in all airs."""
        names = self.aircraft
        columns = [Column("air", key="air"), *(Column(name, "s", ".3f", key=f"{name}_s") for name in names)]
        columns += [Column(f"{name} behind", "s", ".3f", key=f"{name}_behind_s") for name in names if len(names) > 1]
        rows = [
            [air_text(air), *(optimum.time for optimum in row), *(behind if len(names) > 1 else ())]
            for air, row, behind in zip(self.airs, self.optima, self.behind, strict=True)
        ]
        return Table(f"{self.stage.value} optima", columns, rows)

    def aircraft_table(self) -> Table:
        """Return handicaps and spreads."""
        forms = {"handicap": "handicap_s", "least": "least_s", "most": "most_s", "spread": "spread_s"}
        columns = [
            Column("aircraft", key="aircraft"),
            *(Column(name, "s", ".3f", key=key) for name, key in forms.items()),
        ]
        rows: list[list[str | float]] = []
        for number, name in enumerate(self.aircraft):
            times = [row[number].time for row in self.optima if math.isfinite(row[number].time)] or [math.nan]
            handicaps = [row[number] for row in self.behind if math.isfinite(row[number])] or [math.nan]
            rows.append([name, self.behind[0][number], min(handicaps), max(handicaps), max(times) - min(times)])
        notes = ["least, most: handicap in all airs", "spread: slowest without fastest air"]
        return Table("what aircraft and air are worth", columns, rows, notes)

    def gate_table(self) -> Table:
        """Return what steps of the gates' numbers cost every aircraft."""
        columns = (
            *(Column("number", key="key"), Column("step", key="step")),
            *(Column(name, "ms", "+z.2f", key=f"{name}_ms") for name in self.aircraft),
            *(Column("favours", key="favours"), Column("by", "ms", ".2f", key="by_ms")),
        )
        rows: list[list[str | float]] = []
        for favour in self.favours:
            favoured = self.aircraft[favour.costs.index(min(favour.costs))]
            costs = (1e3 * cost for cost in favour.costs)
            rows.append([favour.key, favour.step, *costs, favoured, 1e3 * favour.difference])
        notes = ["a step the other way costs the opposite, and favours another"]
        return Table("what a step of a gate costs, and whom it favours", columns, rows, notes)

    def flight_table(self) -> Table:
        """Return the flights with their normalised times."""
        columns = [Column("flight", key="flight"), Column("aircraft", key="aircraft")]
        for name in ("flown", "optimum", "gap", "standard", "normalised"):
            columns.append(Column(name, "s", ".3f", key=f"{name}_s"))
        rows: list[list[str | float]] = []
        for flight in self.flights:
            gap = flight.race_time - flight.optimum
            times = (flight.race_time, flight.optimum, gap, flight.standard, flight.time)
            rows.append([flight.label, flight.aircraft, *times])
        notes = ["normalised: standard + gap; penalties are not in it"]
        if any(flight.race_time < flight.optimum for flight in self.flights):
            notes.append("a flight that is faster than its optimum breaks a limit of it, or its air was another")
        return Table("flights as of still standard air", columns, rows, notes)

    def tables(self) -> Iterator[Table]:
        """Yield the tables that there is something in, as people read them."""
        yield self.air_table()
        yield self.aircraft_table()
        gates = self.gate_table()
        if gates.rows:
            yield Table(gates.title, gates.columns, gates.rows[:FAVOURS_SHOWN], gates.notes)
        if self.flights:
            yield self.flight_table()

    def as_object(self) -> dict[str, object]:
        """Return it for JSON: null where nothing is known."""
        optima = [
            {**row, "set": dict(air), "certified": [not optimum.message for optimum in optima]}
            for row, air, optima in zip(self.air_table().objects(), self.airs, self.optima, strict=True)
        ]
        return {
            "course": self.course,
            "stage": self.stage.value,
            "optima": optima,
            "aircraft": self.aircraft_table().objects(),
            "gates": self.gate_table().objects(),
            "flights": self.flight_table().objects(),
            "messages": list(self.messages),
        }


@dataclass(frozen=True)
class RecordedFlight:
    """A flight to be normalised: its file's stem, its run unless it is a log, and its inputs."""

    flight: Flight
    stem: str
    run: RunState | None
    inputs: Inputs


class OptimumSolver:
    """A solver that finds the optimum of the same inputs once.

    Args:
        until: the last stage.
        folder: where runs are stored and found again; None for nowhere.
        threads: that evaluate derivatives.
        cold: whether each is found from the course alone as well, and the faster one taken.
        tell: hears of every optimum, in words.
    """

    def __init__(
        self, until: Stage, folder: Path | None, threads: int, cold: bool, tell: Callable[[str], None]
    ) -> None:
        self.until, self._folder, self._threads, self._cold, self._tell = until, folder, threads, cold, tell
        self._solved: dict[str, tuple[Optimum, RunState]] = {}  # by the text of the inputs

    def solve(self, inputs: Inputs, stem: str, air: str, start: RunState | None = None) -> tuple[Optimum, RunState]:
        """Return the optimum of inputs and its run; where none is found from the start, from the course alone."""
        key, name = resolved_text(inputs), job_name(Path(stem), None, (("air", air),))
        if key not in self._solved:
            optimum, run = self._run(inputs, name, start)
            if start is not None and (self._cold or optimum.stage is None):
                cold_optimum, cold_run = self._run(inputs, f"{name},cold", None)
                if optimum.stage is None or cold_optimum.time < optimum.time:
                    optimum, run = cold_optimum, cold_run
            self._tell(f"{stem}, {air}: " + (f"{optimum.time:.3f} s" if optimum.stage else optimum.message))
            self._solved[key] = optimum, run
        return self._solved[key]

    def _run(self, inputs: Inputs, name: str, start: RunState | None) -> tuple[Optimum, RunState]:
        path = None if self._folder is None else self._folder / f"{name}.h5"
        stored_run = adopt_checkpoint(new_run(inputs, path))
        if self.until in stored_run:
            plan = plan_resumed_run(stored_run, until=self.until)
        else:
            usable = start is not None and any(result.holds for result in start.results)
            plan = plan_new_run(inputs, until=self.until, path=path, start=start if usable else None)
        run = plan.run
        if not plan.steps or any(step.action != "keep" for step in plan.steps):
            for state in execute(plan, threads=self._threads, progress=Silent()):
                run = state
        for stage in run.stages:
            if stage.stage is self.until and stage.result.holds:
                return Optimum(stage.race_time, run.message, stage), run
        return Optimum(math.nan, run.message or "no flight was found", None), run


def find_fairness(
    course: str,
    inputs_of: Mapping[str, Inputs],
    airs: Sequence[Combination],
    flights: Sequence[RecordedFlight],
    solver: OptimumSolver,
) -> Fairness:
    """Return what aircraft and air are worth on a course; see `airrace.fairness`.

    Args:
        course: its name.
        inputs_of: the inputs with each aircraft, by its name.
        airs: the conditions, still standard air first.
        flights: whose times are normalised.
        solver: of the optima.
    """
    inputs_in_airs = {name: [_in_air(inputs, air) for air in airs] for name, inputs in inputs_of.items()}
    columns: list[list[Optimum]] = []
    for name, inputs_by_air in inputs_in_airs.items():
        column: list[Optimum] = []
        starts: list[tuple[Combination, RunState]] = []
        for air, inputs in zip(airs, inputs_by_air, strict=True):
            start = min(starts, key=lambda start: _distance(start[0], air), default=None)
            optimum, run = solver.solve(inputs, f"{course},{name}", air_text(air), start and start[1])
            column.append(optimum)
            if optimum.stage is not None:
                starts.append((air, run))
        columns.append(column)
    optima = tuple(zip(*columns, strict=True))
    normalised = tuple(_normalise(flight, solver) for flight in flights)
    fastest_first = tuple(sorted(normalised, key=lambda flight: (math.isnan(flight.time), flight.time)))
    return Fairness(course, solver.until, tuple(inputs_of), tuple(airs), optima, _favours(optima[0]), fastest_first)


def _in_air(inputs: Inputs, air: Combination) -> Inputs:
    """Return inputs in another air; a wind keeps the profile of that of the course."""
    documents = inputs.track, inputs.aircraft, inputs.settings_file
    return inputs_from_documents(*documents, [*inputs.overrides, *(f"{key}={value}" for key, value in air)])


def _distance(first: Combination, second: Combination) -> float:
    """Return how unlike two airs are, kt; another value of a key is as much as a wind of 5 kt, a judgement."""
    winds: list[complex] = []
    for air in (first, second):
        values = dict(air)
        winds.append(cmath.rect(float(values.get(SPEED, 0.0)), math.radians(float(values.get(ORIGIN, 0.0)))))
    differences = [pair for pair in {*first} ^ {*second} if not pair[0].startswith(WIND)]
    return abs(winds[0] - winds[1]) + 5.0 * len(differences)


def _favours(standards: Sequence[Optimum]) -> tuple[Favour, ...]:
    """Return what the numbers of the gates cost every aircraft; none where an optimum is missing or stands alone."""
    views = [optimum.stage for optimum in standards if optimum.stage is not None]
    if len(views) < max(2, len(standards)):
        return ()
    try:
        tables = [stage_sensitivities(view.inputs, view.result, "track") for view in views]
    except NotCertified:
        return ()
    favours: list[Favour] = []
    for key, sensitivity in tables[0].items():
        if key.startswith("gates.") and all(key in table for table in tables):
            step = f"+{sensitivity.usual_step:.3g}" + ("" if sensitivity.unit == "1" else f" {sensitivity.unit}")
            costs = tuple(table[key].per_unit * sensitivity.usual_step for table in tables)
            favours.append(Favour(key, step, costs))
    return tuple(sorted(favours, key=lambda favour: favour.difference, reverse=True))


def open_flight(text: str) -> RecordedFlight:
    """Open a flight, `RUN.h5`, `RUN.h5:STAGE` or `LOG.h5`."""
    name = FlightName.of(text)
    run_or_log = open_file(name.path)
    run = run_or_log if isinstance(run_or_log, RunState) else None
    return RecordedFlight(
        source_of(run_or_log, name.stage).flight(), stem_of(name.path), run, _in_air(run_or_log.inputs, ())
    )


def _normalise(recorded: RecordedFlight, solver: OptimumSolver) -> NormalisedFlight:
    """Return a flight with the optima of its aircraft in its own and in still standard air."""
    flight, inputs, stem = recorded.flight, recorded.inputs, recorded.stem
    own_air_optimum, run = solver.solve(inputs, stem, "as flown", recorded.run)
    standard_optimum, _ = solver.solve(_in_air(inputs, STANDARD_AIR), stem, "still standard air", run)
    return NormalisedFlight(
        flight.label, flight.aircraft.name, flight.race_time, own_air_optimum.time, standard_optimum.time
    )
