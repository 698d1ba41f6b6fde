"""Which limits a flight reaches, for how long and where."""

import math
from dataclasses import replace

import numpy as np
import pytest
from example_flights import circling, half_cuban, rovinj

from airrace.flights.results import Basis, Flight, History, legs_of
from airrace.flights.results.active_limits import active_limits
from airrace.model.track.course import Rules
from airrace.optimal_control.quantities import Quantity
from airrace.pages.views.stage_tables import limits_table


def limited(flight: Flight, name: str, values: np.ndarray, lower: float, upper: float) -> Flight:
    """The flight with one more history, in rad, between bounds."""
    history = History(Quantity(name, "rad", 0.2, lower, upper, "deflection, to the left"), values, Basis.SOLVED)
    return replace(flight, histories={**flight.histories, name: history})


def test_a_limit_is_reported_with_its_duration_and_the_leg_on_which_it_holds_longest() -> None:
    flight = circling(rovinj())
    first, second, *_ = legs_of(flight)
    values = np.zeros(len(flight.time))
    values[first.rows[:5]] = -0.4
    values[second.rows[5:]] = 0.4 - 1e-7
    (one,) = [one for one in active_limits(limited(flight, "eta", values, -0.4, 0.4)) if one.text == "deflection"]
    held = np.diff(flight.time)[second.rows[5] : second.rows[-1]].sum()
    assert (one.value, one.unit, one.leg) == (0.4, "rad", second.name)
    assert one.duration == pytest.approx(held + flight.time[first.rows[4]] - flight.time[first.rows[0]], abs=0.1)
    apart = active_limits(limited(flight, "eta", values, -0.4, 0.5))
    assert [one.value for one in apart if one.text == "deflection"] == [-0.4]
    assert not [one for one in active_limits(limited(flight, "eta", values, -0.5, 0.5)) if one.text == "deflection"]


def test_rates_and_what_distances_tell_are_left_out_and_angles_are_shown_in_degrees() -> None:
    flight = half_cuban().flight()
    found = active_limits(flight)
    assert [one.duration for one in found] == sorted((one.duration for one in found), reverse=True)
    assert not [one for one in found if "rate of" in one.text or "height" in one.text]
    load = next(one for one in found if one.text == "load factor" and one.value > 0.0)
    assert (load.value, load.unit) == (flight.course.rules.n_z.upper, "g")
    held = np.abs(flight["n_z"] - load.value) < 1e-2
    assert load.duration == pytest.approx(float(np.diff(flight.time)[held[1:] & held[:-1]].sum()), abs=0.05)
    texts = {row[0]: row[1] for row in limits_table(flight).texts()[1:]}
    assert texts["throttle"] == "1"
    assert texts["roll rate about the velocity"] == "420 deg/s"
    assert len(limits_table(flight, most=2).rows) == 2


def test_a_distance_that_is_used_up_is_a_limit_and_one_with_room_is_none() -> None:
    flight = circling(rovinj())
    lowest = float(flight["height"].min())

    def with_floor(height: float) -> Flight:
        rules: Rules = flight.course.rules
        rules = replace(rules, height=replace(rules.height, lower=height))
        return replace(flight, race=replace(flight.race, course=replace(flight.course, rules=rules)))

    (floor,) = [one for one in active_limits(with_floor(lowest - 1e-3)) if one.text == "floor"]
    assert floor.value == lowest - 1e-3
    assert math.isnan(floor.duration)
    assert floor.leg in {leg.name for leg in legs_of(flight)}
    assert not [one for one in active_limits(with_floor(lowest - 0.1)) if one.text == "floor"]


def test_a_flight_that_misses_a_passing_reaches_no_limit() -> None:
    flight = half_cuban().flight()
    lost = replace(flight.crossings[1], time=math.nan)
    assert active_limits(replace(flight, crossings=(flight.crossings[0], lost, *flight.crossings[2:]))) == ()
