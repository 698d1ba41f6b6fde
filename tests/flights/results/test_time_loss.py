"""Where the time went: parts that add up, what explains them, and the same words wherever they are told."""

import math
import re
from dataclasses import replace as with_
from decimal import Decimal
from functools import cache
from xml.etree import ElementTree

import numpy as np
import pytest
from example_flights import circling, half_cuban, rovinj, windy

from airrace.cli.run_tables import comparison_texts
from airrace.flights.results import Flight
from airrace.flights.results.comparison import Comparison, compare_flights
from airrace.flights.results.time_loss import BY, Cause, common_causes, leg_losses, loss_along, loss_parts, time_loss
from airrace.model.environment import g0
from airrace.pages.report.flight_page import flight_page
from airrace.pages.views.comparison_tables import loss_head, loss_text, part_text
from airrace.pages.views.map_model import LOSS_COLOURS, by_loss, map_model
from airrace.pages.views.plan_svg import plan_svg
from airrace.pages.views.tables import units_named
from airrace.runs.json_objects import comparison_object

RADIUS = 400.0
"""m."""


def circle(speed: float, radius: float = RADIUS, label: str = "circle") -> Flight:
    """Half a circle."""
    bank = math.atan(speed**2 / (radius * g0))
    return circling(rovinj(), speed=speed, bank=bank, seconds=math.pi * radius / speed, label=label)


@cache
def optima() -> Comparison:
    return compare_flights(half_cuban().flight(label="still"), windy().flight(label="windy"))


def traded() -> Flight:
    """The circle, slower on its second leg, left faster; the speed so won is gone after the third."""
    flight = circle(80.0, label="traded")
    places = np.linspace(0.0, 1.0, len(flight.time)) * (len(flight.crossings) - 1)
    speeds = np.interp(places, [0.0, 1.0, 1.5, 2.0, 3.0], [80.0, 80.0, 68.0, 86.0, 80.0])
    steps = np.diff(flight.time) * 80.0 * 0.5 * (1.0 / speeds[1:] + 1.0 / speeds[:-1])
    time = np.concatenate([[0.0], np.cumsum(steps)])
    histories = {**flight.histories}
    for name in ("V_K", "V_A"):
        histories[name] = with_(histories[name], values=speeds)
    crossings = tuple(
        with_(crossing, time=float(np.interp(crossing.time, flight.time, time))) for crossing in flight.crossings
    )
    return with_(flight, time=time, histories=histories, crossings=crossings)


def comparisons() -> tuple[Comparison, ...]:
    """Optima in two winds, and a circle beside a slower, a wider and a lighter one."""
    light = with_(rovinj().aircraft, airframe=with_(rovinj().aircraft.airframe, m=0.9 * rovinj().aircraft.airframe.m))
    lighter = circling(with_(rovinj(), aircraft=light), speed=78.0, label="lighter")
    circles = [compare_flights(circle(80.0), flight) for flight in (circle(75.0), circle(80.0, 1.1 * RADIUS), lighter)]
    return optima(), *circles


@pytest.mark.parametrize("number", range(4))
def test_causes_add_up_to_every_loss_and_losses_to_the_difference_of_the_race_times(number: int) -> None:
    comparison = comparisons()[number]
    lost = time_loss(comparison)
    for loss in lost.losses:
        assert sum(loss.causes.values()) == pytest.approx(loss.amount, abs=1e-9)
    assert sum(loss.amount for loss in lost.losses) == pytest.approx(abs(comparison.difference), abs=1e-9)
    assert [leg.name for loss in lost.losses for leg in loss.legs] == [leg.name for leg in comparison.legs]


@pytest.mark.parametrize("number", range(4))
def test_the_parts_that_are_printed_add_up_to_the_number_beside_them(number: int) -> None:
    """To the last digit: every number is read from the sentence."""
    for loss in time_loss(comparisons()[number]).losses:
        assert sum(part.amount for part in loss.parts) == pytest.approx(loss.amount, abs=1e-9)
        text = re.sub(r" \([^)]*\)", "", loss_text(loss))
        (total,) = re.findall(r"^(-?\d+\.\d\d) s from", text)
        costs, wins = re.findall(r"(\d+\.\d\d) s by", text), re.findall(r"(\d+\.\d\d) s won by", text)
        assert sum(map(Decimal, costs)) - sum(map(Decimal, wins)) == Decimal(total)
        if loss.turning_point:
            (before, verb, behind) = re.findall(r": (\d+\.\d\d) s (lost|won) to .*, (\d+\.\d\d) s", text)[0]
            traded = Decimal(before) - Decimal(behind)
            assert (traded if verb == "lost" else -traded) == Decimal(total)


@pytest.mark.parametrize("number", range(4))
def test_losses_leg_by_leg_are_those_of_whichever_flight_takes_longer_with_its_causes(number: int) -> None:
    comparison = comparisons()[number]
    losses = leg_losses(comparison)
    assert [loss.amount for loss in losses] == pytest.approx([abs(leg.difference) for leg in comparison.legs])
    for loss, leg in zip(losses, comparison.legs, strict=True):
        assert (loss.begin, loss.end) == (leg.reference.before.name, leg.name)
        assert sum(loss.causes.values()) == pytest.approx(loss.amount, abs=1e-12)
        assert loss.legs[0].reference.time <= loss.legs[0].flight.time


def test_what_is_lost_on_a_leg_to_win_the_next_is_one_loss() -> None:
    """A circle that is slow on its second leg and leaves it faster than the other one."""
    comparison = compare_flights(circle(80.0), traded())
    lost = time_loss(comparison)
    trade = next(loss for loss in lost.losses if comparison.legs[1] in loss.legs)
    assert len(trade.legs) > 1
    assert trade.turning_point
    assert trade.causes[Cause.CARRIED] < 0.0
    assert trade.amount < comparison.legs[1].difference


def test_a_slow_start_is_one_loss_up_to_the_leg_on_which_something_else_costs_more() -> None:
    lost = time_loss(compare_flights(circle(80.0), circle(75.0)))
    (loss,) = lost.losses
    entry = loss.causes[Cause.ENTRY] + loss.causes[Cause.CARRIED]
    assert entry == pytest.approx(loss.amount, rel=1e-3)


def test_what_the_pilot_can_do_comes_before_what_the_builder_can() -> None:
    lost = time_loss(comparisons()[3])
    for loss in lost.losses:
        order = [BY.index("rest" if part.cause is None else part.cause.by) for part in loss.parts]
        assert order == sorted(order)
    builder = (Cause.DRAG, Cause.POWER)
    assert any(loss.causes[cause] != 0.0 for loss in lost.losses for cause in builder)
    for comparison in comparisons()[:3]:
        assert all(loss.causes[cause] == 0.0 for loss in time_loss(comparison).losses for cause in builder)


def test_more_drag_and_less_power_are_the_builders_and_change_nothing_of_the_pilots() -> None:
    """The same path and speeds, flown by another aircraft: nothing is lost, and its drag takes what its power gives."""
    drag = with_(rovinj().aircraft.drag, C_D0=1.2 * rovinj().aircraft.drag.C_D0)
    draggy = circling(with_(rovinj(), aircraft=with_(rovinj().aircraft, drag=drag)), speed=80.0, label="draggy")
    same = circling(rovinj(), speed=80.0)
    comparison = compare_flights(same, draggy)
    for leg in comparison.legs:
        parts = loss_parts(comparison, leg)
        assert parts[Cause.DRAG] > 1e-3
        assert parts[Cause.DRAG] + parts[Cause.ENERGY] == pytest.approx(0.0, abs=1e-9)


def test_an_aircraft_with_more_drag_costs_time_on_every_leg_whichever_flight_comes_first() -> None:
    drag = with_(rovinj().aircraft.drag, C_D0=4.0 * rovinj().aircraft.drag.C_D0)
    draggy = circling(with_(rovinj(), aircraft=with_(rovinj().aircraft, drag=drag)), speed=80.0, label="draggy")
    same = circling(rovinj(), speed=80.0)
    assert common_causes(compare_flights(same, draggy), other_wind=False) == ([], [Cause.DRAG])
    assert common_causes(compare_flights(draggy, same), other_wind=False) == ([Cause.DRAG], [])
    assert common_causes(compare_flights(same, circle(75.0)), other_wind=False) == ([], [])


def test_parts_change_their_sign_when_the_flights_change_places() -> None:
    for comparison in comparisons():
        swapped = compare_flights(comparison.flight, comparison.reference)
        for leg, swapped_leg in zip(comparison.legs, swapped.legs, strict=True):
            parts, swapped_parts = loss_parts(comparison, leg), loss_parts(swapped, swapped_leg)
            assert list(parts.values()) == pytest.approx([-part for part in swapped_parts.values()], abs=1e-12)


def test_the_rest_of_the_energy_is_small_where_all_of_it_is_explained() -> None:
    """A flight at a constant speed gains by power what it loses by drag, so that only the way and the entry differ."""
    slower = time_loss(compare_flights(circle(80.0), circle(75.0)))
    (loss,) = slower.losses
    assert loss.parts[0].cause in (Cause.ENTRY, Cause.CARRIED)
    assert "10 kt slower in" in loss_text(loss)
    wider = time_loss(compare_flights(circle(80.0), circle(80.0, 1.1 * RADIUS)))
    for loss in wider.losses:
        assert loss.causes[Cause.WAY] == pytest.approx(loss.amount, rel=1e-3)
        assert loss.causes[Cause.LIFT] < 0.0
        assert loss.parts[0].cause is Cause.WAY


def test_units_are_those_that_are_asked_for() -> None:
    (loss,) = time_loss(compare_flights(circle(80.0), circle(75.0))).losses
    assert "18 km/h slower in" in loss_text(loss, units_named("kmh-m"))


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
    assert [loss_text(loss) for loss in there.costliest] == [loss_text(loss) for loss in back.costliest]
    assert there.title == back.title == "one thing that costs slow most against fast"


def test_terminal_object_and_report_tell_the_same() -> None:
    lost, comparison = time_loss(optima()), optima()
    texts = [loss_text(loss) for loss in lost.costliest]
    assert texts
    printed = " ".join("\n".join(comparison_texts([comparison], every=False)).split())
    flights: list[object] = comparison_object(comparison.reference, [comparison])["flights"]  # type: ignore[assignment]
    told = flights[0]["costs"]["costliest"]  # type: ignore[index]
    page = flight_page([comparison.reference, comparison.flight])
    assert [one["text"] for one in told] == texts
    for text in texts:
        assert text in printed
    for loss in lost.costliest:
        assert loss_head(loss) in page
        assert all(part_text(part) in page for part in loss.parts if part.hundredths)
    assert page.index(loss_head(lost.costliest[0])) < page.index("<table")


def test_two_flights_are_held_against_each_other_and_both_against_the_reference() -> None:
    flights = [circle(80.0, label="best"), circle(76.0, label="ada"), circle(70.0, label="bo")]
    comparisons = [compare_flights(flights[0], one) for one in flights[1:]]
    texts = list(comparison_texts(comparisons, every=True))
    table = next(one for one in texts if one.startswith("both against best"))
    *_, last = table.strip().splitlines()
    times = [one.race_time for one in flights]
    expected = [times[0], times[1] - times[0], times[2] - times[0], times[2] - times[1]]
    assert [float(one) for one in last.split()[1:]] == pytest.approx(expected, abs=6e-4)
    assert any(one.startswith("one thing that costs bo most against ada") for one in texts)
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
