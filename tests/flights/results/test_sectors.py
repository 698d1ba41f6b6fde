"""Flights sector by sector: the best race is one that the joints allow, and never slower than the fastest flight."""

import itertools
import math
from dataclasses import replace as with_

import pytest
from example_flights import circling, rovinj

from airrace.errors import UsageError
from airrace.flights.results import Flight
from airrace.flights.results.sectors import JOINT, Joint, sector_times
from airrace.model.environment import g0
from airrace.optimal_control.quantities import KNOT
from airrace.pages.views.comparison_tables import sectors_notes

RADIUS = 400.0
"""m."""
ANYTHING = Joint(*(math.inf for _ in range(6)))
NOTHING = Joint(*(-math.inf for _ in range(6)))


def circle(label: str, speed: float = 80.0, height: float = 50.0) -> Flight:
    bank = math.atan(speed**2 / (RADIUS * g0))
    seconds = math.pi * RADIUS / speed
    return circling(rovinj(), speed=speed, bank=bank, height=height, seconds=seconds, label=label)


def delayed(flight: Flight, label: str, place: int, seconds: float) -> Flight:
    """The same flight, which makes all passings from one on so many seconds later."""
    late = tuple(
        with_(crossing, time=crossing.time + seconds * (number >= place))
        for number, crossing in enumerate(flight.crossings)
    )
    return with_(flight, crossings=late, source=with_(flight.source, label=label))


def flights() -> list[Flight]:
    """Three that fly the same path, each slow on another sector."""
    return [delayed(circle(""), name, place, 0.3) for name, place in (("ada", 2), ("bo", 5), ("cy", 9))]


def test_sectors_that_fit_together_make_the_race_without_any_slow_one() -> None:
    sectors = sector_times(flights())
    assert sectors.best_race == pytest.approx(circle("").race_time, abs=1e-9)
    assert sectors.best_race == pytest.approx(sectors.sum_of_best, abs=1e-9)
    for place, number in enumerate(sectors.choice):
        assert sectors.sectors[place].times[number] == pytest.approx(sectors.sectors[place].best_time)


def test_the_best_race_lies_between_the_sum_of_the_best_and_the_fastest_flight() -> None:
    mixed = [circle("a", 80.0), circle("b", 81.0), delayed(circle("c", 82.0), "c", 3, 2.0), circle("d", 80.0, 52.0)]
    for joint in (NOTHING, JOINT, ANYTHING):
        sectors = sector_times(mixed, joint)
        assert sectors.sum_of_best - 1e-9 <= sectors.best_race <= sectors.fastest.race_time + 1e-9
    assert sector_times(mixed, ANYTHING).best_race == pytest.approx(sector_times(mixed, ANYTHING).sum_of_best)
    assert sector_times(mixed, NOTHING).best_race == pytest.approx(sector_times(mixed, NOTHING).fastest.race_time)


def test_every_joint_of_the_best_race_keeps_what_is_said_of_it() -> None:
    mixed = [circle("a", 80.0), circle("b", 81.0), delayed(circle("c", 82.0), "c", 3, 2.0), circle("d", 80.0, 52.0)]
    sectors = sector_times(mixed)
    for place, (before, after) in enumerate(itertools.pairwise(sectors.choice), start=1):
        crossing, other = mixed[before].crossings[place], mixed[after].crossings[place]
        assert before == after or JOINT.fits(crossing, other)


def test_energy_is_never_won_at_a_joint() -> None:
    """One may go on as a flight that is slower or lower, but not as one that is faster."""
    slow, fast = circle("slow", 80.0).crossings[4], circle("fast", 80.0 + 2.0 * KNOT).crossings[4]
    assert JOINT.fits(fast, slow)
    assert not JOINT.fits(slow, fast)


def test_mean_and_spread_are_those_of_the_times() -> None:
    sectors = sector_times(flights())
    for place, sector in enumerate(sectors.sectors):
        slow = place + 1 in (2, 5, 9)
        assert sector.spread == pytest.approx(0.3 * slow, abs=1e-9)
        assert sector.mean - sector.best_time == pytest.approx(0.1 * slow, abs=1e-9)
        assert sector.deviation == pytest.approx(math.sqrt(0.03) * slow, abs=1e-9)


def test_a_flight_that_lacks_a_passing_lends_its_other_sectors() -> None:
    ada, bo, cy = flights()
    gap = with_(ada, crossings=(*ada.crossings[:4], with_(ada.crossings[4], time=math.nan), *ada.crossings[5:]))
    sectors = sector_times([gap, bo, cy])
    assert sectors.best_race == pytest.approx(circle("").race_time, abs=1e-9)
    assert len(sectors.sectors[3].complete) == len(sectors.sectors[4].complete) == 2


def test_the_joints_are_said() -> None:
    notes = " ".join(sectors_notes(sector_times(flights())))
    assert "speed within 5 kt, height within 5 m, place within 5 m, course and climb within 5 deg" in notes
    assert "0.300 s less than" in notes


def test_flights_of_other_courses_are_refused() -> None:
    first = circle("first")
    shorter = with_(first, crossings=first.crossings[:-1])
    course = with_(first.race.course, passages=first.race.course.passages[:-1])
    with pytest.raises(UsageError, match="cannot be compared"):
        sector_times([first, with_(shorter, race=with_(first.race, course=course))])
