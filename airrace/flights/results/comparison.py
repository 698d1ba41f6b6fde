"""Two flights of the same passings on one clock: the difference of time along the course, leg by leg, and its causes.

Progress is the distance, counted leg by leg: at a share `s` of a leg both flights have covered that share of their own
way through it. So the difference of time

    D(s) = t_other(s) - t_reference(s),        D(start) = 0,        D(finish) = difference of the race times

is zero for a flight and itself, and changes its sign when the flights change places. A leg takes `t = L w` with its
way `L` and the mean `w` of the time per metre, so what is lost on it is, exactly,

    t' - t = (L' - L) (w + w')/2 + (w' - w) (L + L')/2        by the longer way and by the lower speed
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from airrace.errors import UsageError
from airrace.flights.results.flight import Basis, Flight, Lap, Leg, laps_of, legs_of, way
from airrace.model.environment import Air
from airrace.model.track.course import Course, PilotLimits, Rules
from airrace.optimal_control.quantities import KNOT, Interval
from airrace.optimal_control.trajectory import Array
from airrace.procedure.formulation import passings_of

if TYPE_CHECKING:
    from airrace.flights.results.cost_to_go import CostToGoLoss

DIFFERENCES_MAX = 4
"""The greatest number of differences that are reported of one leg."""
NAMES_MAX = 3
"""The greatest number of gates that are named as standing elsewhere."""


@dataclass(frozen=True)
class Difference:
    """One thing that two flights do otherwise on a leg.

    Attributes:
        name: what it is, e.g. `roll_begins`.
        reference, value: its values in the reference and in the flight.
        unit: of both.
        words: of the flight, e.g. "rolls {} later"; `{}` stands for the difference with its unit.
        digits: decimals of the difference in words.
        weight: the difference over the least that is reported; at least 1.
    """

    name: str
    reference: float
    value: float
    unit: str
    words: str
    digits: int
    weight: float


@dataclass(frozen=True)
class LegMeasure:
    """How one quantity is measured on a leg.

    Attributes:
        name: of the difference.
        of: from a flight and its leg to the value; NaN where it is unknown.
        unit: of the value.
        least: the smallest difference that is reported, in that unit.
        more, less: the words for a flight whose value is larger or smaller; `{}` stands for the difference with its
            unit. Empty where that is unknown.
        digits: decimals of the difference in words.
        most: a larger difference is not reported: something else has been measured in the one flight than in the other.
    """

    name: str
    of: Callable[[Flight, Leg], float]
    unit: str
    least: float
    more: str
    less: str
    digits: int
    most: float = math.inf


def differences(
    reference: Flight, before: Leg, other: Flight, after: Leg, measures: Sequence[LegMeasure], most: int
) -> tuple[Difference, ...]:
    """Return what the other flight does otherwise on a leg that both completed, at most so many differences.

    The most telling difference comes first.
    """
    reported: list[Difference] = []
    for measure in measures:
        first, second = measure.of(reference, before), measure.of(other, after)
        apart = abs(second - first)
        words = measure.more if second > first else measure.less
        if words and measure.least <= apart <= measure.most:  # NaN is no difference
            weight = apart / measure.least
            reported.append(Difference(measure.name, first, second, measure.unit, words, measure.digits, weight))
    return tuple(sorted(reported, key=lambda difference: -difference.weight)[:most])


def _roll_begins(flight: Flight, leg: Leg) -> float:
    """Return when the aircraft first rolls fast, s after the passing that begins the leg; NaN where it never does."""
    # A roll begins at 1 rad/s.
    rolling = np.flatnonzero(np.abs(flight.values("p_Kbar")[leg.rows]) >= 1.0)
    return float(flight.time[leg.rows][rolling[0]]) - leg.before.time if len(rolling) else math.nan


def _mean_load_factor(flight: Flight, leg: Leg) -> float:
    time, n_z = flight.time[leg.rows], flight.values("n_z")[leg.rows]
    return float(np.sum(0.5 * (n_z[1:] + n_z[:-1]) * np.diff(time)) / (time[-1] - time[0]))


def is_vague(flight: Flight, name: str) -> bool:
    """Return whether a history is derived from a recording of positions, which flattens its peaks."""
    return not flight.source.stage and name in flight and flight.basis(name) is Basis.DERIVED


def _greatest_load_factor(flight: Flight, leg: Leg) -> float:
    """Return the greatest load factor, g; NaN where it is too vague."""
    if is_vague(flight, "n_z"):
        return math.nan
    return float(flight.values("n_z")[leg.rows].max())


MEASURES = (
    LegMeasure("roll_begins", _roll_begins, "s", 0.02, "rolls {} later", "rolls {} earlier", 2, most=1.0),
    LegMeasure("speed_in", lambda _, leg: leg.before.value("V_K") / KNOT, "kt", 0.5, "{} faster in", "{} slower in", 1),
    LegMeasure(
        "least_speed",
        lambda flight, leg: float(flight.values("V_K")[leg.rows].min()) / KNOT,
        "kt",
        1.0,
        "slowest {} faster",
        "slowest {} slower",
        1,
    ),
    LegMeasure("way", lambda flight, leg: float(way(flight, leg)[-1]), "m", 1.0, "{} longer way", "{} shorter way", 0),
    LegMeasure(
        "greatest_height",
        lambda flight, leg: float(flight.values("height")[leg.rows].max()),
        "m",
        1.0,
        "{} higher",
        "{} lower",
        0,
    ),
    LegMeasure("mean_load_factor", _mean_load_factor, "g", 0.1, "{} more on average", "{} less on average", 1),
    LegMeasure("greatest_load_factor", _greatest_load_factor, "g", 0.2, "pulls {} more", "pulls {} less", 1),
    LegMeasure(
        "energy_lost",
        lambda _, leg: leg.before.value("h_E") - leg.after.value("h_E"),
        "m",
        3.0,
        "loses {} more energy",
        "loses {} less energy",
        0,
    ),
)
"""What is measured on every leg."""


def conditions(reference: Flight, other: Flight) -> Iterator[tuple[str, str, str]]:
    """Yield every condition that differs: what it is, and how it is in the one flight and in the other, in words."""
    if reference.source.stage != other.source.stage:
        yield "stage", reference.source.stage or "as flown", other.source.stage or "as flown"
    if reference.aircraft != other.aircraft:
        first, second = reference.aircraft.name, other.aircraft.name
        yield ("aircraft", first, second) if first != second else ("aircraft", first, f"{second} with other numbers")
    if reference.air.wind != other.air.wind:
        yield "wind", _wind(reference.air), _wind(other.air)
    if replace(reference.air, wind=None) != replace(other.air, wind=None):
        yield "air of the day", _day(reference.air), _day(other.air)
    rules, other_rules = reference.course.rules, other.course.rules
    for kind, left, right in ((Rules, rules, other_rules), (PilotLimits, rules.pilot, other_rules.pilot)):
        for field in fields(kind):
            first, second = getattr(left, field.name), getattr(right, field.name)
            if first != second and not isinstance(first, PilotLimits):
                yield f"rules: {field.name}", _rule_text(first), _rule_text(second)
    for what, left, right in (
        ("safety lines", reference.course.safety_lines, other.course.safety_lines),
        ("people", reference.course.crowd, other.course.crowd),
        ("obstacles", reference.course.obstacles, other.course.obstacles),
    ):
        if left != right:
            first, second = (", ".join(thing.name for thing in things) or "none" for things in (left, right))
            yield what, first, second if first != second else f"{second} otherwise"
    pairs = zip(reference.course.passages, other.course.passages, strict=True)
    moved = list(dict.fromkeys(left.element.name for left, right in pairs if left.element != right.element))
    if moved:
        names = [*moved[:NAMES_MAX], *(["..."] if len(moved) > NAMES_MAX else [])]
        yield "gates", "as in its course", f"otherwise: {', '.join(names)}"


def _wind(air: Air) -> str:
    if air.wind is None:
        return "none"
    return f"{air.wind.speed / KNOT:.0f} kt from {math.degrees(air.wind.origin) % 360.0:.0f} deg"


def _day(air: Air) -> str:
    thermals = f", {len(air.thermals)} thermals" if air.thermals else ""
    return f"{air.temperature_offset:+.1f} K and {air.pressure_offset / 100.0:+.1f} hPa from the standard{thermals}"


def _rule_text(value: Interval | Enum | float) -> str:
    match value:
        case Interval():
            return f"{value.lower:g} to {value.upper:g}"
        case Enum():
            return str(value.value)
        case bool():
            return "yes" if value else "no"
        case _:
            return f"{value:g}" if math.isfinite(value) else "none"


TIE = 0.005
"""The difference of time below which two flights are a tie, s.

Race times are certified to a few thousandths of a second (`race_time_change`).
"""
SHARES = np.linspace(0.0, 1.0, 41)
"""The shares of every leg at which the difference of time is given."""


@dataclass(frozen=True)
class LegComparison:
    """One leg in two flights.

    Attributes:
        reference, flight: the leg in the reference and in the flight.
        cumulative: what the flight has lost from the start up to the end of this leg, s; negative where it has won.
        by_way, by_speed: what it loses on the leg by its longer way and by its lower speed, s; they add up.
        differences: what it flies otherwise, the most telling first.
    """

    reference: Leg
    flight: Leg
    cumulative: float
    by_way: float
    by_speed: float
    differences: tuple[Difference, ...]

    @property
    def name(self) -> str:
        """The name of the passing that the leg ends in."""
        return self.reference.name

    @property
    def difference(self) -> float:
        """The time that the flight loses on the leg, s; negative where it wins, NaN where one of them lacks it."""
        return self.flight.time - self.reference.time

    @property
    def tie(self) -> bool:
        """Whether the leg takes both equally long, within `TIE`."""
        return abs(self.difference) <= TIE


@dataclass(frozen=True, eq=False)
class RelativeProgress:
    """The difference of time along the course.

    Attributes:
        distance: way of the reference from the start, m, rising, shape (k,); of a leg that it lacks, of the flight.
        difference: what the flight has lost up to there, s, shape (k,); NaN on legs that one of them lacks.
        passings: at which distance the passings are made, m, shape (n,).
    """

    distance: Array
    difference: Array
    passings: Array


@dataclass(frozen=True)
class Comparison:
    """One flight compared with a reference.

    Attributes:
        reference, flight: the flights.
        legs: in race order.
        progress: the difference of time along the course.
        cost_to_go: what the flight lost by the cost to go of the reference's run; None where that was no question.
    """

    reference: Flight
    flight: Flight
    legs: tuple[LegComparison, ...]
    progress: RelativeProgress
    cost_to_go: "CostToGoLoss | None" = None

    @property
    def difference(self) -> float:
        """The time that the flight loses in all, s; negative where it is faster, NaN where one has no race time."""
        return self.flight.race_time - self.reference.race_time

    @property
    def tie(self) -> bool:
        """Whether the race takes both equally long, within `TIE`."""
        return abs(self.difference) <= TIE

    @property
    def certified(self) -> bool:
        """Whether both are certified optima; of others some hundredths of a second may be those of a mesh."""
        return bool(self.reference.source.certified and self.flight.source.certified)

    @property
    def by_loss(self) -> tuple[LegComparison, ...]:
        """The legs, first the one on which the flight loses most; incomplete ones last."""
        return tuple(sorted(self.legs, key=lambda leg: math.inf if math.isnan(leg.difference) else -leg.difference))

    @property
    def laps(self) -> tuple[tuple[Lap, Lap], ...]:
        """Every lap of the reference with that of the flight."""
        return tuple(zip(laps_of(self.reference), laps_of(self.flight), strict=True))


def compare_flights(reference: Flight, other: Flight) -> Comparison:
    """Compare two flights of the same passings.

    Aircraft, rules, wind and fidelity may differ, and so may the places of the gates.

    Raises:
        UsageError: the courses have other passings; names the first that differs.
    """
    ensure_comparable((reference.label, reference.course), (other.label, other.course))
    starts = reference.crossings[0].time, other.crossings[0].time
    legs: list[LegComparison] = []
    distance, difference, passings = [np.zeros(1)], [np.zeros(1)], [0.0]
    for before, after in zip(legs_of(reference), legs_of(other), strict=True):
        so_far = (after.after.time - starts[1]) - (before.after.time - starts[0])
        ways = [way(flight, leg) for flight, leg in ((reference, before), (other, after)) if leg.is_complete]
        lost, by_way, by_speed, leg_differences = np.full(len(SHARES), np.nan), math.nan, math.nan, ()
        if before.is_complete and after.is_complete:
            times, other_times = (
                np.interp(SHARES, along / along[-1], flight.time[leg.rows])
                for along, flight, leg in zip(ways, (reference, other), (before, after), strict=True)
            )
            lost = (other_times - starts[1]) - (times - starts[0])
            (L, L_other), (t, t_other) = (float(along[-1]) for along in ways), (before.time, after.time)
            w, w_other = t / L, t_other / L_other
            by_way, by_speed = (L_other - L) * 0.5 * (w + w_other), (w_other - w) * 0.5 * (L + L_other)
            leg_differences = differences(reference, before, other, after, MEASURES, DIFFERENCES_MAX)
        legs.append(LegComparison(before, after, so_far, by_way, by_speed, leg_differences))
        length = float(ways[0][-1]) if ways else 0.0
        distance.append((passings[-1] + SHARES * length)[1:])
        passings.append(passings[-1] + length)
        difference.append(lost[1:])
    progress = RelativeProgress(np.concatenate(distance), np.concatenate(difference), np.array(passings))
    return Comparison(reference, other, tuple(legs), progress)


def ensure_comparable(reference: tuple[str, Course], other: tuple[str, Course]) -> None:
    """Refuse flights of courses with other passings.

    Args:
        reference, other: what each flight is called, and its course.

    Raises:
        UsageError: naming the first passing that differs.
    """
    (label, course), (other_label, other_course) = reference, other
    passings, other_passings = passings_of(course), passings_of(other_course)
    for number, (passing, other_passing) in enumerate(zip(passings, other_passings, strict=False)):
        if passing != other_passing:
            first, second = (f"{name} ({kind})" for name, kind in (other_passing, passing))
            raise UsageError(
                f"{other_label} and {label} cannot be compared: passing {number} "
                f"is {first} in the one and {second} in the other"
            )
    if len(passings) != len(other_passings):
        raise UsageError(
            f"{other_label} and {label} cannot be compared: "
            f"the one has {len(other_passings)} passings, the other {len(passings)}"
        )
