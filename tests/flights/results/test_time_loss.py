"""Where the time went: parts that add up, what explains them, and the same words wherever they are told."""

import math
from functools import cache
from xml.etree import ElementTree

import numpy as np
import pytest
from example_flights import circling, half_cuban, rovinj, windy

from airrace.cli.run_tables import comparison_texts
from airrace.flights.results import Flight
from airrace.flights.results.comparison import Comparison, compare_flights
from airrace.flights.results.time_loss import Cause, loss_along, loss_parts, time_loss
from airrace.model.environment import g0
from airrace.pages.report.flight_page import flight_page
from airrace.pages.views.map_model import LOSS_COLOURS, by_loss, map_model
from airrace.pages.views.plan_svg import plan_svg
from airrace.runs.json_objects import comparison_object

RADIUS = 400.0


def circle(speed: float, radius: float = RADIUS, label: str = "circle") -> Flight:
    """Half a circle."""
    bank = math.atan(speed**2 / (radius * g0))
    return circling(rovinj(), speed=speed, bank=bank, seconds=math.pi * radius / speed, label=label)


@cache
def optima() -> Comparison:
    return compare_flights(half_cuban().flight(label="still"), windy().flight(label="windy"))


def test_parts_add_up_to_every_leg_and_losses_to_the_difference_of_the_race_times() -> None:
    lost = time_loss(optima())
    for one in lost.losses:
        assert sum(one.parts.values()) == pytest.approx(one.amount, abs=1e-9)
    assert sum(one.amount for one in lost.losses) == pytest.approx(abs(optima().difference), abs=1e-9)


def test_parts_change_their_sign_when_the_flights_change_places() -> None:
    there = compare_flights(optima().flight, optima().reference)
    for mine, its in zip(optima().legs, there.legs, strict=True):
        parts, others = loss_parts(optima(), mine), loss_parts(there, its)
        assert [parts[one] for one in Cause] == pytest.approx([-others[one] for one in Cause], abs=1e-12)


def test_the_rest_of_the_energy_is_small_where_all_of_it_is_explained() -> None:
    """A flight at a constant speed gains by power what it loses by drag, so that only the way and the entry differ."""
    slower = time_loss(compare_flights(circle(80.0), circle(75.0)))
    for one in slower.losses:
        assert one.parts[Cause.ENTRY] == pytest.approx(one.amount, rel=1e-3)
        assert one.parts[Cause.WAY] == pytest.approx(0.0, abs=1e-5)
        assert one.causes[0] is Cause.ENTRY
        assert "10 kt slower in" in one.text
    wider = time_loss(compare_flights(circle(80.0), circle(80.0, 1.1 * RADIUS)))
    for one in wider.losses:
        assert one.parts[Cause.WAY] == pytest.approx(one.amount, rel=1e-3)
        assert one.parts[Cause.LIFT] < 0.0
        assert one.causes[0] is Cause.WAY


def test_a_flight_loses_nothing_against_itself() -> None:
    lost = time_loss(compare_flights(circle(80.0), circle(80.0)))
    assert not lost.costliest
    assert not lost.title


def test_the_rate_along_the_way_sums_to_the_difference() -> None:
    comparison = compare_flights(circle(80.0), circle(76.0, 1.05 * RADIUS))
    places, rate = loss_along(comparison)
    assert places.shape == (*rate.shape, 2)
    known = np.isfinite(rate)
    length = math.pi * RADIUS
    assert np.mean(rate[known]) * length == pytest.approx(comparison.difference, rel=0.01)
    assert np.hypot(places[known, 0], places[known, 1] - 1.05 * RADIUS) == pytest.approx(1.05 * RADIUS, rel=1e-3)


def test_the_slower_flight_is_told_of_whichever_comes_first() -> None:
    fast, slow = circle(80.0, label="fast"), circle(75.0, label="slow")
    there, back = (time_loss(compare_flights(*pair)) for pair in ((fast, slow), (slow, fast)))
    assert [one.text for one in there.costliest] == [one.text for one in back.costliest]
    assert there.title == back.title == "three things that cost slow most against fast"


def test_terminal_object_and_report_tell_the_same() -> None:
    lost, comparison = time_loss(optima()), optima()
    texts = [one.text for one in lost.costliest]
    assert texts
    printed = " ".join("\n".join(comparison_texts([comparison], every=False)).split())
    flights: list[object] = comparison_object(comparison.reference, [comparison])["flights"]  # type: ignore[assignment]
    told = flights[0]["costs"]["costliest"]  # type: ignore[index]
    page = flight_page([comparison.reference, comparison.flight])
    assert [one["text"] for one in told] == texts
    for text in texts:
        assert text in printed
        assert text in page.replace("&#x27;", "'")
    assert page.index(texts[0]) < page.index("<table")


def test_two_flights_are_held_against_each_other_and_both_against_the_reference() -> None:
    flights = [circle(80.0, label="best"), circle(76.0, label="ada"), circle(70.0, label="bo")]
    comparisons = [compare_flights(flights[0], one) for one in flights[1:]]
    texts = list(comparison_texts(comparisons, every=True))
    table = next(one for one in texts if one.startswith("both against best"))
    *_, last = table.strip().splitlines()
    times = [one.race_time for one in flights]
    expected = [times[0], times[1] - times[0], times[2] - times[0], times[2] - times[1]]
    assert [float(one) for one in last.split()[1:]] == pytest.approx(expected, abs=6e-4)
    assert any(one.startswith("three things that cost bo most against ada") for one in texts)
    rivals: object = comparison_object(flights[0], comparisons)["rivals"]
    assert rivals["difference_s"] == pytest.approx(expected[3])  # type: ignore[index]


def test_the_map_is_drawn_in_the_colours_of_the_loss_with_its_scale() -> None:
    comparison = compare_flights(circle(80.0), circle(75.0))
    track = by_loss(comparison)
    assert track.least == -track.greatest
    assert {colour for _, colour in track.pieces()} <= set(LOSS_COLOURS[4:])
    root = ElementTree.fromstring(
        plan_svg(map_model(rovinj()).with_track(track.line[np.isfinite(track.values)]), track)
    )
    texts = [one.text or "" for one in root.iter("{http://www.w3.org/2000/svg}text")]
    assert any("wins" in one for one in texts)
    assert any("loses" in one for one in texts)
