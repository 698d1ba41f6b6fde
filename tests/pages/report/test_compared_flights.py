"""Flights compared on a page: its numbers are those of the object for programs, in the units that are asked for."""

import re
from typing import Any

import numpy as np
import pytest
from example_flights import half_cuban, windy
from report_pages import circle, labelled, read, unpack

from airrace.flights.results.comparison import compare_flights
from airrace.optimal_control.quantities import FOOT
from airrace.pages.report.flight_page import flight_page
from airrace.pages.views.tables import units_named
from airrace.runs.json_objects import comparison_object


def cells_of(page: str, title: str) -> list[list[str]]:
    """The texts of the table below a heading."""
    body = page[page.index(f"<h2>{title}</h2>") :]
    rows = re.findall(r"<tr[^>]*>(.*?)</tr>", body[: body.index("</table>")])[1:]
    return [[re.sub("<[^>]*>", "", cell) for cell in re.findall(r"<td.*?</td>", row)] for row in rows]


def number(text: str) -> float:
    return float(text.replace("\N{MINUS SIGN}", "-"))


@pytest.mark.parametrize("units", ["kt-m", "kt-ft", "kmh-m"])
def test_every_number_of_a_comparison_is_that_of_the_object(units: str) -> None:
    """Race times, the table of the legs, and what costs most, read from the page."""
    first, second = half_cuban().flight(label="still"), windy().flight(label="windy")
    comparison = compare_flights(first, second)
    page = flight_page([first, second], units=units_named(units))
    data: Any = comparison_object(first, [comparison])  # Any: it is what becomes JSON
    (flight,) = data["flights"]

    times = [number(row[2]) for row in cells_of(page, "Flights")]
    assert times == [round(data["reference"]["race_time_s"], 3), round(flight["race_time_s"], 3)]
    legs = {leg["passing"]: leg for leg in flight["legs"]}
    rows = cells_of(page, "Where windy loses and wins")
    assert [row[0] for row in rows] == [leg.name for leg in comparison.by_loss]
    for name, time, lost, in_all, by_way, by_speed, _ in rows:
        leg = legs[name]
        keys = ("flight_s", "difference_s", "cumulative_s", "by_longer_way_s", "by_lower_speed_s")
        shown = [number(text) for text in (time, "0" if lost == "a tie" else lost, in_all, by_way, by_speed)]
        expected = [0.0 if key == "difference_s" and leg["tie"] else round(leg[key], 3) for key in keys]
        assert shown == pytest.approx(expected, abs=1e-9)
    losses = page[page.index('<ol class="losses">') : page.index("</ol>")]
    items = re.findall(r"<button[^>]*>(.*?)</button><ul>(.*?)</ul>", losses)
    assert len(items) == len(flight["costs"]["costliest"])
    for (head, clauses), item in zip(items, flight["costs"]["costliest"], strict=True):
        assert number(head.split()[0]) == pytest.approx(item["lost_s"], abs=0.005001)
        parts = re.findall(r"<li>(\d+\.\d\d) s (by|won by)", clauses)
        amounts = [number(amount) * (1.0 if verb == "by" else -1.0) for amount, verb in parts]
        assert amounts == [part["shown_s"] for part in item["parts"] if part["shown_s"]]
        assert sum(amounts) == pytest.approx(number(head.split()[0]), abs=1e-9)


def test_the_units_of_the_page_are_those_that_are_asked_for() -> None:
    page = flight_page([circle()], units=units_named("kt-ft"))
    contents = read(page).contents
    strip = next(strip for strip in contents["strips"] if strip["title"] == "Height")
    assert strip["unit"] == "ft"
    histories = contents["flights"][0]["histories"]
    height = circle()["height"]
    np.testing.assert_allclose(unpack(histories["height"]), height / FOOT, rtol=1e-6)
    np.testing.assert_allclose(unpack(histories["up"]), height, rtol=1e-6)
    assert re.search(r"<small>ft</small>", page)
    assert not re.search(r"<small>(m|km/h)</small>", page)


def test_sectors_of_recorded_flights_are_those_of_the_object() -> None:
    flights = [circle(), labelled(circle(25.0), "slower"), labelled(circle(22.0), "later")]
    comparisons = [compare_flights(flights[0], flight) for flight in flights[1:]]
    data: Any = comparison_object(flights[0], comparisons)["sectors"]  # Any: it is what becomes JSON
    rows = cells_of(flight_page(flights), "3 recorded flights, sector by sector")
    assert len(rows) == len(data["legs"])
    for (name, best, of, mean, deviation, spread, chosen), leg in zip(rows, data["legs"], strict=True):
        assert (name, of, chosen) == (leg["passing"], leg["best_flight"], leg["best_race_flight"])
        expected = [round(leg[key], 3) for key in ("best_s", "mean_s", "deviation_s", "spread_s")]
        assert [number(text) for text in (best, mean, deviation, spread)] == expected
