"""Loosening a limit must not make a race slower: sweeps of limits from tight to loose, and the case that shows it."""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from study_jobs import CERTIFIED, Job, Record, Study, inputs_of, race_time
from study_tables import SLOWER, Claim, difference, seconds, table, time_or_outcome

from airrace.errors import InputError
from airrace.planning.race import Race
from airrace.quantities import Interval
from airrace.track.gates import Element, Gate, Passing, Pylon, Tolerances

SHARE_MAX = 0.01  # of pairs that may be violated


@dataclass(frozen=True)
class Limit:
    """One limit: the keys that make it, and their values tight to loose."""

    name: str
    keys: tuple[str, ...]
    values: tuple[tuple[float, ...], ...]

    @staticmethod
    def between(name: str, keys: Sequence[str], tight: Sequence[float], loose: Sequence[float], points: int) -> "Limit":
        """Values at equal steps from the tightest to the loosest."""
        shares = [number / (points - 1) for number in range(points)]
        values = [tuple(a + share * (b - a) for a, b in zip(tight, loose, strict=True)) for share in shares]
        return Limit(name, tuple(keys), tuple(tuple(float(f"{one:.4g}") for one in some) for some in values))

    def label(self, value: tuple[float, ...]) -> str:
        """A value for the table."""
        return " to ".join(f"{one:g}" for one in value)

    def overrides(self, value: tuple[float, ...]) -> tuple[str, ...]:
        """What sets the limit to a value."""
        return tuple(f"{key}={one:g}" for key, one in zip(self.keys, value, strict=True))


CLIMB = ("gate_defaults.climb_min_deg", "gate_defaults.climb_max_deg")
RANGES = {
    "n_z_max": (("rules.n_z_max",), (6.0,), (12.0,)),
    "roll_rate": (("rules.roll_rate_max_deg_s",), (120.0,), (420.0,)),
    "crossing": (("gate_defaults.crossing_max_deg",), (10.0,), (60.0,)),
    "climb": (CLIMB, (-5.0, 10.0), (-45.0, 45.0)),
    "bank_tolerance": (("gate_defaults.bank_tolerance_deg",), (2.0,), (18.0,)),
    "clearance": (("gate_defaults.clearance_m",), (1.3,), (0.1,)),
    "speed_cap": (("aircraft.envelope.speed_max_m_s",), (84.0,), (128.0,)),
}


def limits(points: int, given: Sequence[str] = ()) -> list[Limit]:
    """All limits, or those that are given as `NAME` or `NAME=VALUE,VALUE,...` (of climb: `-5:10,-45:45`).

    Raises:
        ValueError: a name is not known, or a value is not a number.
    """
    if not given:
        return [Limit.between(name, *ends, points) for name, ends in RANGES.items()]
    found: list[Limit] = []
    for text in given:
        name, _, values = text.partition("=")
        if name not in RANGES:
            raise ValueError(f"`{name}` is no limit; known are {', '.join(RANGES)}")
        limit = Limit.between(name, *RANGES[name], points)
        if values:
            pairs = tuple(tuple(float(one) for one in value.split(":")) for value in values.split(","))
            if any(len(one) != len(limit.keys) for one in pairs):
                raise ValueError(f"`{text}` must give {len(limit.keys)} number(s) per value, divided by a colon")
            limit = replace(limit, values=pairs)
        found.append(limit)
    return found


@dataclass(frozen=True)
class Flown:
    """One flight of a sweep."""

    value: str
    record: Record


@dataclass(frozen=True)
class Series:
    """One limit on one course, tight to loose."""

    course: str
    limit: str
    flights: tuple[Flown, ...]

    @property
    def certified(self) -> list[Flown]:
        return [one for one in self.flights if one.record["outcome"] == CERTIFIED]

    @property
    def pairs(self) -> list[tuple[Flown, Flown]]:
        """Neighbours among the certified flights, the tighter first."""
        return list(itertools.pairwise(self.certified))

    @property
    def violations(self) -> list[tuple[Flown, Flown]]:
        return [(tight, loose) for tight, loose in self.pairs if slower(loose.record, tight.record)]


def slower(one: Record, other: Record) -> bool:
    """Whether one certified race is slower than another by more than rounding and meshes explain."""
    a, b = race_time(one), race_time(other)
    return a is not None and b is not None and a - b > SLOWER


def values_flown(course: str, limit: Limit, base: Job) -> list[tuple[float, ...]]:
    """The values that make a difference on a course; none unless there are two. Prints what is left out, and why."""
    kept: list[tuple[float, ...]] = []
    last: Race | None = None
    refused = 0
    for value in limit.values:
        try:
            race = felt(inputs_of(course, (*base.overrides, *limit.overrides(value))).race)
        except InputError as error:
            print(f"skipped: {limit.name} of {limit.label(value)} on {course}: {error.findings[0].message}")
            refused += 1
            continue
        if race != last:
            kept.append(value)
        last = race
    if len(kept) > 1:
        return kept
    if refused < len(limit.values):
        print(f"skipped: {limit.name} on {course}: changes nothing there")
    return []


def felt(race: Race) -> Race:
    """The race without limits that nobody feels: beyond the aircraft's own, or tolerances of what is passed exactly."""
    rules, aircraft = race.course.rules, race.aircraft
    n_z = replace(rules.n_z, upper=min(rules.n_z.upper, aircraft.envelope.n_z.upper))
    rules = replace(rules, n_z=n_z, p=min(rules.p, aircraft.point_mass.p))
    passages = tuple(replace(one, element=_felt(one.element)) for one in race.course.passages)
    return replace(race, course=replace(race.course, rules=rules, passages=passages))


def _felt(element: Element) -> Element:
    match element:
        case Gate(passing=Passing.POINT, tolerances=allowed):
            return replace(element, tolerances=Tolerances(0.0, Interval(), 0.0, allowed.climb, allowed.crossing))
        case Pylon(tolerances=allowed):
            return replace(element, tolerances=replace(allowed, bank=0.0))  # its bank is free
        case _:
            return element


def sweep(study: Study, courses: Sequence[str], chosen: Sequence[Limit], base: Job) -> list[Series]:
    """Fly all limits on all courses, as far as they can take them."""
    tried = ((course, limit, values_flown(course, limit, base)) for course, limit in itertools.product(courses, chosen))
    plans = [one for one in tried if one[2]]
    jobs = [
        [replace(base, course=course, overrides=(*base.overrides, *limit.overrides(value))) for value in values]
        for course, limit, values in plans
    ]
    records = iter(study.fly(job for some in jobs for job in some))
    return [
        Series(course, limit.name, tuple(Flown(limit.label(value), next(records)) for value in values))
        for course, limit, values in plans
    ]


def report(found: Sequence[Series]) -> list[Claim]:
    """Print what the sweeps found; the claim that at most one pair in a hundred is violated."""
    names = list(dict.fromkeys(one.limit for one in found))
    rows = [_counts(name, [one for one in found if one.limit == name]) for name in names]
    rows.append(_counts("all", found))
    headings = ("limit", "courses", "flights", "certified", "pairs", "violations", "share")
    table("Pairs of a tighter and a looser limit", headings, rows)
    rows = [
        (one.course, one.limit, *_told(tight), *_told(loose), _slower_by(tight, loose))
        for one in found
        for tight, loose in one.violations
    ]
    headings = ("course", "limit", "tighter", "race time s", "looser", "race time s", "slower by s")
    table("Violations: the looser limit is slower", headings, rows)
    rows = [
        (one.course, one.limit, flight.value, flight.record["outcome"], flight.record.get("message", ""))
        for one in found
        for flight in one.flights
        if flight.record["outcome"] != CERTIFIED
    ]
    table("Not certified", ("course", "limit", "value", "outcome", "message"), rows)
    pairs = sum(len(one.pairs) for one in found)
    violations = sum(len(one.violations) for one in found)
    text = f"at most {SHARE_MAX:.0%} of the pairs are slower by more than 5 ms: {violations} of {pairs}"
    return [Claim(text, pairs > 0 and violations <= SHARE_MAX * pairs)]


def _counts(name: str, found: Sequence[Series]) -> tuple[str, ...]:
    flights, certified = sum(len(one.flights) for one in found), sum(len(one.certified) for one in found)
    pairs, violations = sum(len(one.pairs) for one in found), sum(len(one.violations) for one in found)
    share = f"{100 * violations / pairs:.1f} %" if pairs else seconds(None)
    return (
        name,
        str(len({one.course for one in found})),
        str(flights),
        str(certified),
        str(pairs),
        str(violations),
        share,
    )


def _told(flight: Flown) -> tuple[str, str]:
    return flight.value, seconds(race_time(flight.record))


def _slower_by(tight: Flown, loose: Flown) -> str:
    return difference(race_time(loose.record), race_time(tight.record))


CASE_COURSE = "abu_dhabi_2016"
CASE = (
    "gate_defaults.climb_min_deg=-5",
    "gate_defaults.climb_max_deg=10",
    "gate_defaults.crossing_max_deg=10",
    "rules.roll_rate_max_deg_s=200",
)
CASE_ROWS = (*((n_z, None) for n_z in (10.0, 9.5, 9.0, 8.6, 8.5, 8.0)), (8.0, 86.0))
CASE_SLOWEST = 54.65  # s, without a speed cap
GUESSES = ("plan", "homotopy")


@dataclass(frozen=True)
class Row:
    """One flight of the case; without a speed cap the aircraft's own holds."""

    n_z: float
    cap: float | None
    guess: str
    record: Record

    def __str__(self) -> str:
        return f"{self.n_z:g} g" + ("" if self.cap is None else f", {self.cap:g} m/s") + f", {self.guess}"

    def tighter(self, other: "Row") -> bool:
        """Whether no limit is looser than the other's."""
        return self.n_z <= other.n_z and (self.cap or float("inf")) <= (other.cap or float("inf"))


def case(study: Study, base: Job) -> list[Row]:
    """Fly the case from both guesses."""
    rows = list(itertools.product(CASE_ROWS, GUESSES))
    jobs: list[Job] = []
    for (n_z, cap), guess in rows:
        overrides = [*base.overrides, *CASE, f"rules.n_z_max={n_z:g}", f"settings.guess={guess}"]
        overrides += [] if cap is None else [f"aircraft.envelope.speed_max_m_s={cap:g}"]
        jobs.append(replace(base, course=CASE_COURSE, overrides=tuple(overrides)))
    return [Row(*limit, guess, record) for (limit, guess), record in zip(rows, study.fly(jobs), strict=True)]


def backwards(rows: Sequence[Row]) -> Iterator[tuple[Row, Row]]:
    """Pairs of a row and one with looser limits that is slower, whatever they start from."""
    for tight, loose in itertools.permutations(rows, 2):
        same = loose.tighter(tight)  # the same limits, another guess
        if tight.tighter(loose) and not same and slower(loose.record, tight.record):
            yield tight, loose


def report_case(rows: Sequence[Row]) -> list[Claim]:
    """Print the table of the case; its claims."""
    lines: list[tuple[str, ...]] = []
    for (n_z, cap), some in itertools.groupby(rows, key=lambda row: (row.n_z, row.cap)):
        flown = {row.guess: row.record for row in some}
        times = [time_or_outcome(flown[guess]) for guess in GUESSES]
        lines.append((f"{n_z:g}", seconds(cap, 0), *times))
    table("Abu Dhabi 2016 with tight gates", ("n_z max g", "speed cap m/s", "plan s", "homotopy s"), lines)
    wrong = list(backwards(rows))
    listed = [
        (str(tight), seconds(race_time(tight.record)), str(loose), seconds(race_time(loose.record)))
        for tight, loose in wrong
    ]
    table("Slower than with tighter limits", ("tighter limit", "race time s", "limit", "race time s"), listed)
    times = [race_time(row.record) for row in rows if row.cap is None]
    fast = all(time is not None and time <= CASE_SLOWEST for time in times)
    return [
        Claim("all rows are certified", all(race_time(row.record) is not None for row in rows)),
        Claim(f"no row without a speed cap is slower than {CASE_SLOWEST} s", fast),
        Claim("no row is more than 5 ms slower than one with tighter limits", not wrong),
    ]
