"""The safety of a flight as tables: what closed-loop flights along it break, and their scatter at gates and legs."""

import math
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.special import stdtrit

from airrace.errors import OutOfTime, UsageError
from airrace.flights.results.penalties import NONE_KNOWN, Penalties
from airrace.flights.safety.disturbances import Disturbances, Gusts, Scatter
from airrace.flights.safety.monte_carlo import (
    CONFIDENCE,
    CONTACT,
    LOAD,
    OVER_G,
    QUANTITIES,
    SHARES,
    Count,
    Nearness,
    SafetyResult,
    Stretch,
    Watch,
    fewest,
    fly_closed_loop,
    unwatched,
)
from airrace.flights.safety.over_g import LOAD_ALLOWED
from airrace.flights.safety.pilot import PilotModel
from airrace.flights.safety.replanning import Replanning, ensure_replanned
from airrace.optimal_control.quantities import KNOT
from airrace.optimal_control.trajectory import Array
from airrace.pages.views.tables import Column, Table, Value
from airrace.procedure.cost_to_go import CostToGo, new_service
from airrace.procedure.result import Silent, StageResult
from airrace.procedure.settings import Settings
from airrace.procedure.solver_session import SolverSession
from airrace.race import Race
from airrace.runs.output import write_text
from airrace.runs.verdict import verdict
from airrace.runtime.process import available_cores

Begin = Callable[[str], None]
"""Is told the words of what is flown next, which takes a time of its own."""


def unannounced(title: str) -> None:
    """Tell nobody."""


_DEGREES = 180.0 / math.pi
_UNITS = {
    "lateral": ("m", 1.0),
    "height": ("m", 1.0),
    "bank": ("deg", _DEGREES),
    "load_factor": ("g", 1.0),
    "time": ("s", 1.0),
}
"""Unit and factor of every quantity."""
_WORDS = {
    "pylon": "wing touches a pylon or an obstacle",
    "ground": "wing tip touches the ground",
    "missed": "gate missed",
    "lost": "line lost",
    "clearance": "wing tip too near to a pylon at its gate",
    "height": "gate too high or too low",
    "bank": "bank beyond its tolerance at a gate",
    "course": "gate crossed too much askew",
    "climb": "climb angle beyond its limits at a gate",
    "speed": "start too fast",
    "tolerance": "another tolerance at a gate",
    "flight clearance": "wing too near to a pylon or an obstacle",
    "floor": "below the floor",
    "ceiling": "above the ceiling",
    "crowd": "too near to the crowd",
    "safety line": "across a safety line",
    "airspace": "out of the airspace",
    OVER_G: "over-g that counts by the rules",
    LOAD: "load factor beyond its limit, however short",
}
_BREACHES = {
    "clearance": "near",
    "height": "too high or low",
    "bank": "wrong bank",
    "course": "askew",
    "climb": "too steep",
    "speed": "too fast",
}
"""The kinds of breaches at gates as heads of columns, no two of which are alike."""
COUNTS = (
    Column("flights that", key="what"),
    Column("flights", form="d", key="flights"),
    Column("share", "%", ".1f", key="share_percent"),
    Column("from", "%", ".1f", key="lower_percent"),
    Column("to", "%", ".1f", key="upper_percent"),
)
REPLAN_MIN, REPLAN_MAX = 0.1, 10.0
"""The times between which a line may be replanned, s: the shortest is a pilot's delay."""
LINES = (
    Column("line", key="line"),
    Column("flights", form="d", key="finished"),
    Column("race time", "s", ".3f", key="mean_race_time_s"),
    Column("+/-", "s", ".3f", key="race_time_interval_s"),
    Column("contact", "%", ".1f", key="contact_percent"),
    Column("from", "%", ".1f", key="contact_lower_percent"),
    Column("to", "%", ".1f", key="contact_upper_percent"),
    Column("rules", "%", ".1f", key="outside_percent"),
    Column("n_z", "%", ".1f", key="load_factor_percent"),
    Column("lateral", "m", ".2f", key="lateral_95_m"),
    Column("height", "m", ".2f", key="height_95_m"),
)


@dataclass(frozen=True, eq=False)
class ReplannedFlights:
    """The same flights, of the same disturbances, with the line replanned.

    Attributes:
        interval: between two lines of a flight, s.
        result: all numbers.
    """

    interval: float
    result: SafetyResult


DISTANCES = (
    Column("from", key="thing", wraps=True),
    Column("asked", "m", ".1f", key="required_m"),
    Column("least", "m", "z.1f", key="least_m"),
    Column("99.7 % keep", "m", "z.1f", key="kept_m"),
    Column("too near", form="d", key="too_near"),
    Column("share", "%", ".1f", key="too_near_percent"),
    Column("at most", "%", ".1f", key="too_near_upper_percent"),
)
IMPACTS = (
    Column("impacts and", key="thing", wraps=True),
    Column("nearest", "m", "z.1f", key="least_m"),
    Column("99.7 % keep", "m", "z.1f", key="kept_m"),
    Column("hit or beyond", form="d", key="too_near"),
    Column("share", "%", ".1f", key="too_near_percent"),
    Column("at most", "%", ".1f", key="too_near_upper_percent"),
)
_FROM_WHERE = (
    "people, lines and border: from the aircraft's centre; obstacles: from the wing; ground: from the lower wing tip; "
    "too near: flights nearer than asked by more than 0.1 m; at most: upper end of the interval of confidence 95 %"
)
_WHERE_IT_FALLS = (
    "impacts lie between a fall in vacuum and one with drag, half the span to either side; nearest: 0 on people, "
    "negative beyond a line or the border; hit or beyond: flights in which a fall at any instant would hit people or "
    "end beyond the line"
)


@dataclass(frozen=True, repr=False)
class SafetyCase:
    """Closed-loop flights along a stage's optimum, in tables.

    Attributes:
        label: what people call the flight.
        stage: whose optimum it is.
        result: all numbers, SI and radians.
        uncertified: why the optimum is not certified, a sentence; empty where it is.
        no_crowd: whether the course names no crowd, so that nothing is known of distances from people.
        replanned: the same flights with their line replanned; None where they were not flown.
        none_replanned: whether they were asked for, and the time was over before any of them was flown.
    """

    label: str
    stage: str
    result: SafetyResult
    uncertified: str
    no_crowd: bool
    replanned: ReplannedFlights | None = None
    none_replanned: bool = False

    @property
    def is_cut(self) -> bool:
        """Whether the time was over before all was flown."""
        results = [self.result, *([self.replanned.result] if self.replanned else [])]
        return self.none_replanned or any(result.flights < result.asked for result in results)

    @property
    def remarks(self) -> list[str]:
        """Sentences that belong to the numbers."""
        flights, asked = self.result.flights, self.result.asked
        cut = f"the time was over after {flights} of {asked} flights" if flights < asked else ""
        none_replanned = "the time was over before any flight along replanned lines" if self.none_replanned else ""
        remarks = [remark for remark in (self.uncertified, self.result.note, cut, none_replanned) if remark]
        if self.no_crowd:
            remarks.append("the course names no crowd: distances from people were not looked at")
        return remarks

    def tables(self) -> list[Table]:
        """Return all tables: counts, distances, gates and legs; of replanned lines as well, and both compared."""
        scatter = [self.gates_table().without_empty_columns(), self.legs_table().without_empty_columns()]
        tables = [self.counts_table(), self.distances_table(), *scatter]
        if self.replanned is None:
            return tables
        words = _replanned_words(self.replanned.interval)
        case = replace(self, label=f"{self.label}, {words}", result=self.replanned.result)
        gates = case.gates_table().without_empty_columns()
        return [*tables, case.counts_table(), case.distances_table(), gates, self.lines_table()]

    def lines_table(self) -> Table:
        """Return the optimum as the line, and below it the replanned one, with what came of their flights."""
        rows, notes = [["the optimum", *_line_values(self.result)]], list[str]()
        if self.replanned is not None:
            rows.append([_replanned_words(self.replanned.interval), *_line_values(self.replanned.result)])
            replanned, optimum = self.replanned.result.race_times, self.result.race_times
            both = min(len(replanned), len(optimum))  # a time limit may have ended the flights of one earlier
            mean, interval = _mean(replanned[:both] - optimum[:both])
            notes.append(f"replanning changes the time of the same flight by {mean:+.3f} s +/- {interval:.3f} s")
        notes.append(
            "contact: touch, miss or lose; rules: break any but the load factor; n_z: exceed that; lateral, height: "
            "median over the gates of what 95 % do not exceed; +/-, from, to: intervals of confidence 95 %"
        )
        return Table(f"{self.label}: the line that is followed", LINES, rows, notes)

    def counts_table(self) -> Table:
        """Return how many flights broke what."""
        result, scatter = self.result, self.result.scatter
        title = f"{self.label}: {result.flights} closed-loop flights, {scatter.gusts.value} gusts"
        if scatter.gusts.value == "none":
            title = f"{self.label}: {result.flights} closed-loop flights without gusts"
        always = (*CONTACT, "floor", OVER_G, LOAD, *(() if self.no_crowd else ("crowd",)))
        kinds = [kind for kind in _WORDS if result.counts[kind].flights or kind in always]
        rows = [
            count_row("touch a pylon or the ground, miss a gate or lose the line", result.contact),
            count_row("break any rule", result.broken),
            *(count_row(f"  {_WORDS[kind]}", result.counts[kind]) for kind in kinds),
        ]
        shares = (("mass", scatter.mass), ("power", scatter.power), ("density", scatter.density))
        note = (
            f"standard deviations: wind {scatter.wind / KNOT:.3g} kt north and east, "
            f"{', '.join(f'{what} {100.0 * share:.3g} %' for what, share in shares)}, rolls "
            f"{1000.0 * scatter.timing:.3g} ms; delay of the pilot {result.pilot.delay:g} s; seed {result.seed}; "
            "from, to: interval of confidence 95 %"
        )
        over_g = f"over-g: {result.load_rule.text}; {result.pulls} pulls in all; {LOAD_ALLOWED:g} g are not counted"
        return Table(title, COUNTS, rows, [note, over_g, *self.remarks])

    def distances_table(self) -> Table:
        """Return how near the flights come to people, lines, border, obstacles and the ground."""
        title = "least distances of all flights, and what 99.7 % of them keep"
        return Table(title, DISTANCES, [_nearness_row(nearness) for nearness in self.result.distances], [_FROM_WHERE])

    def impacts_table(self) -> Table:
        """Return how near falls of the flights come to people, lines and border; no row where none were let fall."""
        rows = [[name, *numbers] for name, _, *numbers in map(_nearness_row, self.result.impacts)]
        return Table("impacts of falls from every instant of all flights", IMPACTS, rows, [_WHERE_IT_FALLS])

    def gates_table(self) -> Table:
        """Return the scatter at every gate."""
        return _stretches("at", [*QUANTITIES, "time"], self.result.gates)

    def legs_table(self) -> Table:
        """Return the largest scatter on every leg."""
        return _stretches("leg to", QUANTITIES, self.result.legs)

    def as_object(self) -> dict[str, object]:
        """Return the object that `airrace safety --json` prints."""
        if self.replanned is not None:
            case = replace(self, result=self.replanned.result, replanned=None)
            replanned = {"every_s": self.replanned.interval, **case.as_object()}
            own = replace(self, replanned=None).as_object()
            return {**own, "lines": self.lines_table().objects(), "replanned": replanned}
        result, scatter = self.result, self.result.scatter
        return {
            "flight": self.label,
            "stage": self.stage,
            "race_time_s": result.race_time,
            "flights": result.flights,
            "flights_asked": result.asked,
            "seed": result.seed,
            "gusts": scatter.gusts.value,
            "wind_error_kt": scatter.wind / KNOT,
            "mass_error_percent": 100.0 * scatter.mass,
            "power_error_percent": 100.0 * scatter.power,
            "density_error_percent": 100.0 * scatter.density,
            "roll_timing_s": scatter.timing,
            "pilot_delay_s": result.pilot.delay,
            "contact": _count_object(result.contact),
            "outside": _count_object(result.outside),
            "broken": _count_object(result.broken),
            "over_g": {"rule": result.load_rule.text, "pulls": result.pulls},
            "counts": {kind: _count_object(count) for kind, count in result.counts.items()},
            "pylons": [
                {"pylon": name, **_count_object(count), "least_distance_m": least}
                for name, (count, least) in result.pylons.items()
            ],
            "distances": self.distances_table().objects(),
            "impacts": self.impacts_table().objects(),
            "gates": self.gates_table().objects(),
            "legs": self.legs_table().objects(),
            "remarks": self.remarks,
        }

    def to_csv(self, path: str | Path | None = None) -> str:
        """Return the scatter at the gates as comma-separated values, one row per passage.

        Args:
            path: a file to be written; None for none.

        Raises:
            StorageError: the system refused.
        """
        text = self.gates_table().csv(".6g")
        if path is not None:
            write_text(Path(path), text)
        return text

    def __repr__(self) -> str:
        return "\n\n".join(f"{table.title}\n{table.text()}" for table in self.tables())

    def _repr_html_(self) -> str:
        return "".join(table.html() for table in self.tables())


def fly_safety_case(
    race: Race,
    result: StageResult,
    label: str,
    flights: int,
    disturbances: Disturbances,
    *,
    seed: int,
    threads: int | None,
    replan: tuple[float, Settings] | None = None,
    penalties: Penalties = NONE_KNOWN,
    falls: bool = False,
    watch: Watch = unwatched,
    begin: Begin = unannounced,
    until: float = math.inf,
) -> SafetyCase:
    """Fly a stage's optimum many times.

    Args:
        race, result: what is simulated.
        label: what people call it.
        flights, seed, threads: see `airrace.flights.safety.monte_carlo.fly_closed_loop`.
        disturbances: of the flights.
        replan: the time between two lines, s, and the settings by which the race is solved, to fly the same flights
            with the line replanned as well; None to leave that.
        penalties, falls, watch, until: likewise.
        begin: is told of replanned flights before they are watched: they take much longer.

    Raises:
        UsageError: an argument is out of range, or the stage is none that could be simulated.
        SolverCrash: a solver process died.
    """
    if replan is not None and not REPLAN_MIN <= replan[0] <= REPLAN_MAX:
        raise UsageError(
            f"a new line every {replan[0]:g} s is out of range: it must be every {REPLAN_MIN:g} to {REPLAN_MAX:g} s"
        )
    if seed < 0:
        raise UsageError(f"a seed of {seed} is out of range: it must be 0 or larger")
    scatter, pilot = scatter_of(disturbances), PilotModel(delay=disturbances.delay_s)
    if replan is not None and result.is_flight:
        ensure_replanned(replan[0], result.trajectory.race_time, disturbances.delay_s)

    def fly(replanning: Replanning | None = None) -> SafetyResult:
        return fly_closed_loop(
            race,
            result,
            flights=flights,
            scatter=scatter,
            pilot=pilot,
            seed=seed,
            threads=threads,
            replanning=replanning,
            penalties=penalties,
            falls=falls,
            watch=watch,
            until=until,
        )

    closed_loop, replanned = fly(), None
    if replan is not None and time.monotonic() <= until:
        with _replanning(race, result, *replan, threads or available_cores(), until) as replanning:
            begin(f"{label}, {_replanned_words(replan[0])}")
            try:
                replanned = ReplannedFlights(replan[0], fly(replanning))
            except OutOfTime:
                replanned = None
    (_, why) = verdict([result])
    uncertified = f"the optimum is not certified: {why}" if why else ""
    return SafetyCase(
        label,
        result.stage.value,
        closed_loop,
        uncertified,
        no_crowd=not race.course.crowd,
        replanned=replanned,
        none_replanned=replan is not None and replanned is None,
    )


def _replanned_words(interval: float) -> str:
    """Return what lines are called that are replanned so often, s."""
    return f"replanned every {interval:g} s"


@contextmanager
def _replanning(
    race: Race, result: StageResult, interval: float, settings: Settings, threads: int, until: float
) -> Generator[Replanning]:
    """Yield what replans lines, with solver processes that end with it."""
    rest = CostToGo.of_result(race, settings, result)
    with new_service(1) as service, closing(SolverSession(service, settings, Silent(), threads)) as session:
        yield Replanning(rest, session, interval, until)


def _line_values(result: SafetyResult) -> list[Value]:
    """Return what stands behind the name of a line, see `LINES`."""
    contact, gates = result.contact, result.gates[1:]
    shares = (contact.share, contact.lower, contact.upper, result.outside.share, result.counts[LOAD].share)
    spread = [np.median([gate.deviations[name].quantiles[0] for gate in gates]) for name in ("lateral", "height")]
    finished = int(np.isfinite(result.race_times).sum())
    return [finished, *_mean(result.race_times), *(100.0 * share for share in shares), *map(float, spread)]


def _mean(values: Array) -> tuple[float, float]:
    """Return the mean of the finite values and the half width of its interval; NaN of too few."""
    values = values[np.isfinite(values)]
    if len(values) < 2:
        return float(values.mean()) if len(values) else math.nan, math.nan
    widest = stdtrit(len(values) - 1, 0.5 + 0.5 * CONFIDENCE)  # of Student's distribution
    return float(values.mean()), float(widest * values.std(ddof=1) / math.sqrt(len(values)))


def scatter_of(disturbances: Disturbances) -> Scatter:
    """Return disturbances in SI units, as shares, and as one of the gusts that there are.

    Raises:
        UsageError: there are no such gusts, or an error is out of range.
    """
    wind, mass, power = disturbances.wind_error_kt, disturbances.mass_error_percent, disturbances.power_error_percent
    density, timing = disturbances.density_error_percent, disturbances.roll_timing_s
    if disturbances.gusts not in list(Gusts):
        raise UsageError(f"there are no gusts {disturbances.gusts!r}; known are {', '.join(Gusts)}")
    for error, (what, unit, most) in zip((wind, mass, power, density, timing), _ERRORS, strict=True):
        if not 0.0 <= error <= most:
            raise UsageError(
                f"an error of {error:g}{unit} in the {what} is out of range: it must be 0 to {most:g}{unit}"
            )
    return Scatter(Gusts(disturbances.gusts), wind * KNOT, 0.01 * mass, 0.01 * power, 0.01 * density, timing)


_ERRORS = (
    ("wind", " kt", 30.0),
    ("mass", " %", 20.0),
    ("power", " %", 20.0),
    ("density", " %", 20.0),
    ("rolls", " s", 0.2),
)
"""What an error is of, its unit, and the largest that the linear pilot could mean anything for; judgements."""


def count_row(what: str, count: Count) -> list[Value]:
    """Return a row below `COUNTS`."""
    return [what, count.flights, 100.0 * count.share, 100.0 * count.lower, 100.0 * count.upper]


def _nearness_row(nearness: Nearness) -> list[Value]:
    """Return a row below `DISTANCES`."""
    thing, nearer = nearness.thing, nearness.nearer
    shares = (100.0 * nearer.share, 100.0 * nearer.upper)
    return [thing.text, thing.required, nearness.least, nearness.kept, nearer.flights, *shares]


def _count_object(count: Count) -> dict[str, float]:
    return {"flights": count.flights, "share": count.share, "lower": count.lower, "upper": count.upper}


def _stretches(where: str, quantities: Sequence[str], stretches: Sequence[Stretch]) -> Table:
    """Return a table with the quantiles of every quantity for people, and all that is known for CSV and JSON."""
    columns, at_gates = [Column(where, key="passage")], "time" in quantities
    for name in quantities:
        unit, _ = _UNITS[name]
        form = ".1f" if unit == "deg" else ".2f"
        head = name.replace("load_factor", "n_z")
        for rank, share in enumerate(SHARES):
            key = f"{name}_{100 * share:g}_{unit}".replace(".", "")
            columns.append(Column(f"{head} {100 * share:g}" if rank else head, unit, form, key, rank=rank))
        columns.append(Column("", unit, form, f"{name}_mean_{unit}"))
        if at_gates:
            columns.append(Column("", unit, form, f"{name}_linear_{unit}"))
    kinds = list(dict.fromkeys(kind for stretch in stretches for kind in stretch.breaches))
    columns += [Column(_BREACHES.get(kind, kind), "%", ".0f", f"{kind}_percent") for kind in kinds]
    rows: list[list[Value]] = []
    for stretch in stretches:
        row: list[Value] = [stretch.name]
        for name in quantities:
            deviation, factor = stretch.deviations[name], _UNITS[name][1]
            row += [factor * quantile for quantile in deviation.quantiles]
            row.append(factor * deviation.mean)
            if at_gates:
                row.append(factor * deviation.linear)
        row += [100.0 * stretch.breaches[kind].share if kind in stretch.breaches else 0.0 for kind in kinds]
        rows.append(row)
    at_gate = "right: flights that break a tolerance there; near: the wing tip too near to a pylon"
    notes = [at_gate if at_gates else "over-g: flights with a pull on the leg that counts"] if kinds else []
    quantiles = [deviation.quantiles[-1] for stretch in stretches for deviation in stretch.deviations.values()]
    if not all(map(math.isfinite, quantiles)):
        flights_needed = ", ".join(f"{100 * share:g} % of {fewest(share)}" for share in SHARES)
        notes.append(f"-: too few flights came so far; needed are for {flights_needed} or more")
    place = "" if at_gates else ", at the worst place of every leg"
    title = f"95 % and 99.7 % of the flights deviate from the optimum by no more than this{place}"
    return Table(title, columns, rows, notes)
