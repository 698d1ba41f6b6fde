"""Handicaps: what the day costs a race against still standard air, in many hours and with the course rotated.

    handicap = optimum in the air of the day - optimum in still standard air at the level of the sea

So a time flown without its handicap is what the flight would have taken in still standard air: the pilot's own gap to
the optimum stays, wind, density and place go. All optima are solved warm from that of one run, and keep its route. The
interval of a handicap follows from the errors of the wind, to first order, by the multipliers of the day's optimum.
"""

import cmath
import logging
import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Self

from airrace.errors import InputError, NotCertified, UsageError
from airrace.files.inputs import Inputs
from airrace.files.inputs.air import ORIGIN, WIND
from airrace.files.inputs.weather import Weather
from airrace.flights.results.stamp import air_text
from airrace.flights.safety.disturbances import WIND_DIRECTION_ERROR_DEG, WIND_SPEED_ERROR_KT
from airrace.flights.sensitivity.lagrangian import sensitivities
from airrace.model.environment import Air, StaticWind
from airrace.model.parameters import Parameter
from airrace.optimal_control.quantities import DEGREE, KNOT
from airrace.pages.views.tables import Cell, Column, Table, Value
from airrace.procedure.result import Silent
from airrace.procedure.stage import Stage
from airrace.race import Race
from airrace.runs.batch.jobs import sweep_of
from airrace.runs.execute import execute
from airrace.runs.execution_plan import Changes, ExecutionPlan, plan_changed_run, plan_new_run
from airrace.runs.flight_sources import open_file, source_of
from airrace.runs.output import FlightName
from airrace.runs.run_state import RunState, new_run
from airrace.runs.session import Session, ensure_of_one_stage, optimum_of
from airrace.runs.stage_view import StageView
from airrace.runtime.standard_streams import stem_of

logger = logging.getLogger(__name__)

NO_WIND = f"{WIND}=null"
STANDARD_AIR = (
    *(NO_WIND, "environment.thermals=null", "origin.elevation_m=0"),
    *("environment.temperature_offset_K=0", "environment.pressure_offset_hPa=0"),
)
"""What makes the air of a course still standard air at the level of the sea."""
DEFAULT_STAGE = Stage.POINT_MASS


@dataclass(frozen=True)
class WindError:
    """The errors of a wind that 95 % of winds are within: of its speed, kt, and of its direction, deg."""

    speed: float = WIND_SPEED_ERROR_KT
    direction: float = WIND_DIRECTION_ERROR_DEG

    def __post_init__(self) -> None:
        if not (0.0 <= self.speed <= 50.0 and 0.0 <= self.direction <= 180.0):
            raise UsageError("the errors of a wind are up to 50 kt and up to 180 degrees")

    def across(self, wind_speed: float) -> float:
        """Return the error across a wind of a speed, kt.

        It is what the error of the direction moves the wind by. A wind that is slower than the error of its speed may
        also be a calm, and so come from anywhere: winds up to that error fill a disc, whose half width at this wind
        the error is at least. So it is that of the speed in a calm, and changes without a jump.
        """
        in_disc = math.sqrt(max(0.0, self.speed**2 - wind_speed**2))
        return max(wind_speed * self.direction * DEGREE, in_disc)

    def of_race_time(self, optimum: StageView) -> float:
        """Return the error of an optimum's race time, s; NaN where it has no sensitivity to the wind."""
        race = optimum.inputs.race
        wind = race.air.wind or StaticWind(0.0, 0.0)  # a calm that a wind differs from in numbers alone
        race = replace(race, air=replace(race.air, wind=wind))
        winds = [
            Parameter(f"{WIND}.along_kt", 0.0, lambda race, along: _with_wind(race, complex(along, 0.0))),
            Parameter(f"{WIND}.across_kt", 0.0, lambda race, across: _with_wind(race, complex(0.0, across))),
        ]
        try:
            slopes = [slope.per_unit for slope in sensitivities(winds, race, optimum.inputs.settings, optimum.result)]
        except NotCertified:
            return math.nan
        return (
            math.hypot(slopes[0] * self.speed, slopes[1] * self.across(wind.speed / KNOT))
            if len(slopes) == 2
            else math.nan
        )


def _with_wind(race: Race, change_kt: complex) -> Race:
    """Return a race whose wind blows otherwise: so much more from where it comes from, and from the right of that."""
    wind = race.air.wind or StaticWind(0.0, 0.0)
    velocity = cmath.rect(1.0, wind.origin) * (wind.speed + KNOT * change_kt)
    changed = replace(wind, origin=cmath.phase(velocity), speed=abs(velocity))
    return replace(race, air=replace(race.air, wind=changed))


@dataclass(frozen=True)
class Handicap:
    """What an hour's air costs an aircraft.

    Attributes:
        aircraft: its name.
        hour: its name; empty where there is only one.
        heading: by which the course is rotated clockwise, deg.
        air: over the ground; None where the inputs are not valid.
        race_time: of the optimum in it, s; NaN where there is none.
        standard: that in still standard air, s; NaN likewise.
        error: of the handicap by that of the wind, s; NaN where it is not known.
        message: why there is no optimum; empty where there is.
    """

    aircraft: str
    hour: str
    heading: float
    air: Air | None
    race_time: float
    standard: float
    error: float
    message: str = ""

    @property
    def seconds(self) -> float:
        """The handicap, s: positive where the day costs time."""
        return self.race_time - self.standard

    @property
    def interval(self) -> tuple[float, float]:
        """The interval in which it lies by the error of the wind, s."""
        return self.seconds - self.error, self.seconds + self.error


@dataclass(frozen=True)
class FlightHandicap:
    """A flight and the handicap of the air in which it was flown.

    Attributes:
        label: its name.
        race_time: without penalties, s.
        stage: the fidelity of the optima that the handicap is of.
        handicap: of its course, aircraft and air.
    """

    label: str
    race_time: float
    stage: str
    handicap: Handicap

    @property
    def result(self) -> float:
        """What it would have taken in still standard air, s."""
        return self.race_time - self.handicap.seconds


@dataclass(frozen=True)
class HandicapResult:
    """The handicaps of a course.

    Attributes:
        course: its name.
        stage: the fidelity of all optima.
        handicaps: aircraft by aircraft, hour by hour, heading by heading.
        flights: in the order in which they were named.
    """

    course: str
    stage: str
    handicaps: tuple[Handicap, ...]
    flights: tuple[FlightHandicap, ...] = ()

    @property
    def _several_aircraft(self) -> bool:
        return len({row.aircraft for row in self.handicaps}) > 1

    @property
    def messages(self) -> tuple[str, ...]:
        """Why optima are missing."""
        rows = [*self.handicaps, *(flight.handicap for flight in self.flights)]
        return tuple(f"{place_of(row)}: {row.message}" for row in rows if row.message)

    def behind(self, handicap: Handicap) -> float:
        """Return what an aircraft's optimum is behind the fastest one in the same air, s."""
        times = [
            other.race_time
            for other in self.handicaps
            if (other.hour, other.heading) == (handicap.hour, handicap.heading) and math.isfinite(other.race_time)
        ]
        return handicap.race_time - min(times, default=math.nan)

    def table(self) -> Table:
        """Return one row per handicap."""
        several = self._several_aircraft
        columns = (
            Column("aircraft" if several else "", key="aircraft"),
            Column("hour" if any(row.hour for row in self.handicaps) else "", key="hour"),
            Column("rotated" if any(row.heading for row in self.handicaps) else "", "deg", "g", key="heading_deg"),
            Column("air", key="air", wraps=True),
            *(Column(form=".6g", key=key) for key in ("wind_from_deg", "wind_kt")),
            Column("optimum", "s", ".3f", key="race_time_s"),
            Column("standard", "s", ".3f", key="standard_s"),
            *HANDICAP,
            Column("behind" if several else "", "s", ".3f", key="behind_s"),
            Column(key="message"),
        )
        rows: list[list[Cell | Value]] = []
        for row in self.handicaps:
            wind = None if row.air is None else row.air.wind
            origin = None if wind is None else round(math.degrees(wind.origin) % 360.0, 9)
            speed = None if row.air is None else 0.0 if wind is None else wind.speed / KNOT
            air = row.message if row.air is None else air_text(row.air)
            words = [row.aircraft, row.hour, row.heading, air, origin, speed]
            rows.append([*words, row.race_time, row.standard, *_numbers(row), self.behind(row), row.message])
        notes = [
            "standard: optimum in still standard air",
            "handicap: positive where the day costs time; from, to: by the error of the wind",
        ]
        solved = [row for row in self.handicaps if math.isfinite(row.seconds)]
        if len(solved) > 1 and not several:
            fastest = min(solved, key=lambda row: row.seconds)
            notes.append(f"fastest: {place_of(fastest)}, {fastest.seconds:+.3f} s")
        return Table(f"{self.course}: handicaps against still standard air, {self.stage}", columns, rows, notes)

    def summaries(self) -> Iterator[Table]:
        """Yield every aircraft's mean, least and largest handicap, by heading and by hour, where there are several of
        both."""
        if len({row.heading for row in self.handicaps}) > 1 and len({row.hour for row in self.handicaps}) > 1:
            heading = Column("rotated", "deg", "g", key="heading_deg")
            yield self._summary("which way the course should lie", heading, lambda row: row.heading)
            yield self._summary("which hour is best", Column("hour", key="hour"), lambda row: row.hour)

    def _summary(self, title: str, column: Column, label: Callable[[Handicap], str | float]) -> Table:
        groups: dict[tuple[str, str | float], list[float]] = {}
        for row in self.handicaps:
            groups.setdefault((row.aircraft, label(row)), []).append(row.seconds)
        several = self._several_aircraft
        columns = [Column("aircraft" if several else "", key="aircraft"), column]
        columns += [Column(name, "s", "+z.3f", key=f"{name}_s") for name in ("mean", "least", "most")]
        columns.append(Column("spread", "s", ".3f", key="spread_s"))
        rows: list[tuple[str, str | float, float, float, float, float]] = []
        for (aircraft, value), seconds in groups.items():
            mean, least, most = sum(seconds) / len(seconds), min(seconds), max(seconds)
            if math.isnan(mean):  # an optimum is missing, so this mean would be over other weather than the others
                least = most = math.nan
            rows.append((aircraft, value, mean, least, most, most - least))
        notes: list[str] = []
        complete = [row for row in rows if math.isfinite(row[2])]
        if complete and not several:
            fastest, evenest = min(complete, key=lambda row: row[2]), min(complete, key=lambda row: row[5])
            words = (f"{column.text(row[1])} {column.unit}".strip() for row in (fastest, evenest))
            notes = ["fastest: {}; most even: {}".format(*words)]
        return Table(title, columns, rows, notes)

    def flight_table(self) -> Table:
        """Return the flights without their handicaps."""
        other_stages = any(flight.stage != self.stage for flight in self.flights)
        columns = [Column("flight", key="flight"), Column("aircraft", key="aircraft")]
        columns.append(Column("handicap by" if other_stages else "", key="stage"))
        columns += [Column("flown", "s", ".3f", key="flown_s"), *HANDICAP, Column("result", "s", ".3f", key="result_s")]
        rows: list[list[Cell | Value]] = []
        for flight in self.flights:
            row = flight.handicap
            rows.append([flight.label, row.aircraft, flight.stage, flight.race_time, *_numbers(row), flight.result])
        return Table("flights", columns, rows, ["result: flown without the handicap; penalties are not in it"])

    def tables(self) -> Iterator[Table]:
        """Yield the tables that there is something in, as people read them."""
        summaries = list(self.summaries())
        if not summaries:
            yield self.table().shortened()
        yield from summaries
        if self.flights:
            yield self.flight_table()

    def as_object(self) -> dict[str, object]:
        """Return it for JSON: null where nothing is known."""
        return {
            "course": self.course,
            "stage": self.stage,
            "handicaps": self.table().objects(),
            "summaries": [table.objects() for table in self.summaries()],
            "flights": self.flight_table().objects(),
            "messages": list(self.messages),
        }


HANDICAP = (
    Column("handicap", "s", "+z.3f", key="handicap_s"),
    *(Column("from", "s", "+z.3f", key="from_s"), Column("to", "s", "+z.3f", key="to_s")),
)


def _numbers(handicap: Handicap) -> tuple[float, float, float]:
    return (handicap.seconds, *handicap.interval)


def place_of(handicap: Handicap) -> str:
    """Return aircraft, hour and rotation of a handicap in words."""
    rotated = f"rotated by {handicap.heading:g} deg" if handicap.heading else ""
    return ", ".join(filter(None, (handicap.aircraft, handicap.hour, rotated)))


def headings_of(text: str | None) -> list[float]:
    """Return the angles in degrees of a list and ranges, such as `0:360:15`.

    Raises:
        UsageError: it is none, or an angle is beyond a full turn.
    """
    expected = "expected degrees from -360 to 360, such as 0:360:15, or 0,30,60"
    try:
        angles = [float(value) for value in sweep_of("heading_deg", (text or "0").split(",")).values]
    except ValueError as error:
        raise UsageError(f"--headings {text}: {error}; {expected}") from error
    for angle in angles:
        if not -360.0 <= angle <= 360.0:
            raise UsageError(f"--headings {text}: {angle:g} is out of range; {expected}")
    return angles


@dataclass(frozen=True)
class OpenedFlight:
    """A flight that is to be freed of its handicap.

    Attributes:
        label: its name.
        race_time: without penalties, s.
        run: of its course, aircraft and air.
        plan: by which that run is solved first; None where it is.
        stage: whose optima the handicap is of.
    """

    label: str
    race_time: float
    run: RunState
    plan: ExecutionPlan | None
    stage: Stage

    @classmethod
    def of(cls, text: str, stage: Stage | None) -> Self:
        """Open a flight, `RUN.h5`, `RUN.h5:STAGE` or `LOG.h5`.

        Args:
            text: its name.
            stage: see `stage_of`.

        Raises:
            CheckpointError: the file cannot be read.
            UsageError: the run has no such stage, or it is no optimum.
        """
        name = FlightName.of(text)
        opened = open_file(name.path)
        flight = source_of(opened, name.stage).flight()
        if isinstance(opened, RunState):
            return cls(flight.label, flight.race_time, opened, None, stage_of(opened, stage))
        plan = plan_course(opened.inputs, stage)
        return cls(flight.label, flight.race_time, plan.run, plan, plan.until)


def stage_of(run: RunState, asked: Stage | None) -> Stage:
    """Return the stage of a run whose optimum all others are solved from.

    Args:
        run: a finished one.
        asked: which stage; None for the point mass, or the last one of a run that has none.

    Raises:
        UsageError: the run has no such stage, or it is no optimum.
    """
    if asked is None and run.results and DEFAULT_STAGE not in run:
        asked = run.results[-1].stage
        logger.warning("%s has no %s; the handicap is by %s", run.label, DEFAULT_STAGE.value, asked.value)
    return optimum_of(run, asked or DEFAULT_STAGE).stage


def plan_course(inputs: Inputs, stage: Stage | None) -> ExecutionPlan:
    """Return the plan to solve a course up to a stage, by default the point mass.

    A reserve is not searched for, which takes thousands of flights; margins that it has stay.
    """
    if inputs.reserve is not None:
        inputs = Changes(overrides=["rules.reserve=null"]).inputs(new_run(inputs))
    return plan_new_run(inputs, until=stage or DEFAULT_STAGE)


def start_overrides(overrides: Sequence[str], hours: Sequence[Weather]) -> list[str]:
    """Return the values with which courses and aircraft are solved first: in a calm where all hours have a wind.

    So a profile may be told of winds of which the course has none.
    """
    return [*overrides, NO_WIND] if all(hour.wind is not None for hour in hours) else list(overrides)


def name_of_aircraft(inputs: Inputs) -> str:
    """Return the name of the file of an aircraft."""
    return stem_of(Path(inputs.aircraft.path))


@dataclass(frozen=True)
class HandicapSolver:
    """A solver of handicaps by warm sessions.

    Attributes:
        overrides: values that are otherwise than in the runs.
        wind_error: of all winds.
        threads: that evaluate derivatives.
        tell: hears of every optimum, in words.
    """

    overrides: Sequence[str]
    wind_error: WindError
    threads: int
    tell: Callable[[str], None]

    def execute(self, plan: ExecutionPlan, label: str) -> RunState:
        """Return a run with all stages of a plan."""
        self.tell(f"{label}: solving {plan.until.value}")
        run = plan.run
        for state in execute(plan, threads=self.threads, progress=Silent()):
            run = state
        return run

    def solve(self, run: RunState, stage: Stage, hours: Sequence[Weather], headings: Sequence[float]) -> list[Handicap]:
        """Return the handicaps of a run by one of its stages, hour by hour, heading by heading.

        Every optimum is solved from that of the run, so that none depends on which others are asked for.
        """
        aircraft, handicaps = name_of_aircraft(run.inputs), list[Handicap]()
        course_air = Changes(overrides=[*self.overrides, NO_WIND]).inputs(run).race.air  # its elevation, temperature
        with Session(run, stage, threads=self.threads) as session:
            own = {} if self.overrides else {run.race.air: session.optimum}
            standard_texts = [*self.overrides, *STANDARD_AIR]
            standard_air = Changes(overrides=standard_texts).inputs(run).race.air
            standard = own.get(standard_air) or session.solve(standard_texts)
            standard_time = standard.race_time if standard.result.holds else math.nan
            optima = {**own, standard_air: standard}  # the same air is solved once
            errors: dict[Air, float] = {}
            for weather, heading in product(hours, headings):
                row = Handicap(aircraft, weather.hour, heading, None, math.nan, standard_time, math.nan)
                texts = [*self.overrides, *weather.overrides(course_air)]
                try:
                    ground_air = Changes(overrides=texts).inputs(run).race.air
                    row = replace(row, air=ground_air)
                    air, rotated_texts = _rotated(ground_air, heading)
                    if air not in optima:
                        optima[air] = self._optimum(session, [*texts, *rotated_texts], standard)
                except InputError as error:
                    handicaps.append(replace(row, message=error.findings[0].message))
                    continue
                optimum = optima[air]
                if not optimum.result.holds:
                    row = replace(row, message=optimum.message or f"the flight is {optimum.status}")
                elif math.isnan(standard_time):
                    row = replace(row, race_time=optimum.race_time, message="there is no flight in still standard air")
                else:
                    if air not in errors:
                        errors[air] = self.wind_error.of_race_time(optimum)
                    row = replace(row, race_time=optimum.race_time, error=errors[air])
                handicaps.append(row)
                if len(hours) * len(headings) > 1:
                    self.tell(f"{place_of(row)}: {row.message or f'{row.seconds:+z.3f} s'}")
        return handicaps

    def _optimum(self, session: Session, texts: Sequence[str], standard: StageView) -> StageView:
        """Return the optimum under some values; where none is found from the run's, from that in still standard air."""
        optimum = session.solve(texts)
        if not optimum.result.holds and standard.result.holds:
            optimum = session.solve(texts, start=standard)
        return optimum

    def solve_flight(self, flight: OpenedFlight) -> FlightHandicap:
        """Return a flight with the handicap of the air that it flew in."""
        run = flight.run if flight.plan is None else self.execute(flight.plan, flight.label)
        (handicap,) = replace(self, overrides=()).solve(run, flight.stage, [Weather()], [0.0])
        return FlightHandicap(flight.label, flight.race_time, flight.stage.value, handicap)


def _rotated(air: Air, heading: float) -> tuple[Air, list[str]]:
    """Return the air over a course that is rotated clockwise, as the course sees it, and what sets it.

    A course that is rotated with all that stands around it flies as before in a wind rotated the other way.
    """
    wind = air.wind
    if wind is None or wind.speed == 0.0:
        return replace(air, wind=None), [NO_WIND]
    if not heading:
        return air, []
    origin = (math.degrees(wind.origin) - heading) % 360.0
    return replace(air, wind=replace(wind, origin=math.radians(origin))), [f"{ORIGIN}={origin:.10g}"]


def find_handicaps(
    source: RunState | ExecutionPlan,
    aircraft: Sequence[str | Path],
    hours: Sequence[Weather],
    headings: Sequence[float],
    flights: Sequence[str],
    stage: Stage | None,
    solver: HandicapSolver,
) -> HandicapResult:
    """Return the handicaps of a course; see `airrace.handicap`. All files are read before anything is solved.

    Args:
        source: a run, whose optimum all others are solved from, or the plan of one that is solved first.
        aircraft: other aircraft, each of which is flown from that optimum first.
        hours, headings: all of whose combinations are flown.
        flights: by name.
        stage: see `stage_of`.
        solver: of the handicaps.
    """
    run = source if isinstance(source, RunState) else source.run
    last = stage_of(run, stage) if isinstance(source, RunState) else source.until
    start = start_overrides(solver.overrides, hours)
    ensure_of_one_stage(run, Changes(overrides=start).inputs(run))
    changes = [Changes(aircraft=other, overrides=start) for other in aircraft]
    names = [name_of_aircraft(inputs) for inputs in (run.inputs, *(change.inputs(run) for change in changes))]
    ((name, number),) = Counter(names).most_common(1)
    if number > 1:
        raise UsageError(f"two aircraft have one name, {name}; leave one out, or rename its file")
    opened = [OpenedFlight.of(text, stage) for text in flights]
    if isinstance(source, ExecutionPlan):
        run = solver.execute(source, run.label)
    plans = [plan_changed_run(run, change, until=last) for change in changes]
    runs = [run, *(solver.execute(plan, name) for plan, name in zip(plans, names[1:], strict=True))]
    handicaps: list[Handicap] = []
    for run_of_aircraft in runs:
        handicaps += solver.solve(run_of_aircraft, last, hours, headings)
    flown = tuple(map(solver.solve_flight, opened))
    return HandicapResult(run.race.course.name, last.value, tuple(handicaps), flown)
