"""What the script is told: the format in full, numbers that survive, texts that can end nothing."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from example_flights import half_cuban, windy
from hypothesis import given
from hypothesis import strategies as st
from report_pages import HOSTILE, circle, dense, everything_flown, renamed

from airrace.quantities import KNOT
from airrace.report.contents import FORMAT, POSE, Contents, pack, unpack
from airrace.report.flight_contents import STRIPS, contents_of, short_labels
from airrace.results import Flight
from airrace.results.comparison import compare_flights
from airrace.views.map_model import map_model


def told(*flights: Flight) -> Any:
    """What the script reads. Any: it is JSON."""
    return json.loads(text_of(*flights))


def text_of(*flights: Flight) -> str:
    comparisons = [compare_flights(flights[0], other) for other in flights[1:]]
    return contents_of(flights, comparisons, map_model(flights[0].race)).as_json()


@given(st.lists(st.floats(width=32)))
def test_numbers_survive_to_the_last_bit_of_32(values: list[float]) -> None:
    assert np.array_equal(unpack(pack(np.array(values))), np.array(values, np.float32), equal_nan=True)


def test_the_format_is_as_its_documentation_has_it() -> None:
    page = told(circle(), circle(25.0).labelled("slower"))
    assert page["format"] == FORMAT
    assert list(page) == ["format", "course", "flights", "strips", "colours", "differences"]
    assert list(page["course"]) == ["elements", "crowd", "lines", "airspace", "frame"]
    assert list(page["flights"][0]) == ["label", "aircraft", "race_time", "passings", "time", "histories"]
    assert list(page["strips"][0]) == ["title", "unit", "digits", "lines", "limits", "wraps", "least"]
    assert list(page["colours"][0]) == ["title", "history", "unit", "digits", "signed"]
    assert list(page["differences"][0]) == ["flight", "time", "difference"]


@pytest.mark.parametrize("seconds", [20.0, 31.0])
def test_every_history_has_a_value_per_time_and_the_pose_is_there(seconds: float) -> None:
    (flight,) = told(circle(seconds))["flights"]
    count = len(unpack(flight["time"]))
    assert count == 401
    assert set(POSE) <= set(flight["histories"])
    assert {len(unpack(text)) for text in flight["histories"].values()} == {count}


def test_the_pose_is_that_of_the_flight() -> None:
    flown = half_cuban().flight()
    (flight,) = told(flown)["flights"]
    for name, history in {"north": "x", "east": "y", "height": "height", "q0": "b0", "q3": "b3"}.items():
        np.testing.assert_allclose(unpack(flight["histories"][name]), flown[history], atol=1e-4)
    np.testing.assert_allclose(unpack(flight["histories"]["V_K"]) * KNOT, flown["V_K"], rtol=1e-6)


def test_limits_are_drawn_in_the_unit_of_their_strip() -> None:
    run = half_cuban()
    strips = {strip["title"]: strip for strip in told(run.flight())["strips"]}
    rules, aircraft = run.race.course.rules, run.race.aircraft
    allowed = rules.n_z.intersect(aircraft.envelope.n_z)
    assert {limit["value"] for limit in strips["Load factor"]["limits"]} == {allowed.lower, allowed.upper}
    fastest = math.degrees(min(rules.p, aircraft.point_mass.p))
    assert max(limit["value"] for limit in strips["Roll rate"]["limits"]) == pytest.approx(fastest)


def test_a_strip_of_which_nothing_is_known_is_left_out() -> None:
    assert {strip["title"] for strip in told(circle())["strips"]} == {
        "Speed", "Height", "Load factor", "Bank", "Climb", "Energy height"
    }  # fmt: skip
    assert "Surfaces" in {drawn.title for drawn in STRIPS}


def test_the_clock_starts_at_the_first_passing() -> None:
    late = circle()
    shifted = replace(
        late, time=late.time + 100.0, crossings=tuple(replace(one, time=one.time + 100.0) for one in late.crossings)
    )
    assert told(shifted)["flights"] == told(late)["flights"]
    (difference,) = told(late, shifted)["differences"]
    np.testing.assert_allclose(unpack(difference["difference"]), 0.0, atol=1e-9)


def test_a_flight_that_misses_its_last_passing_has_no_race_time() -> None:
    whole = circle()
    lost = replace(whole, crossings=(*whole.crossings[:-1], replace(whole.crossings[-1], time=math.nan)))
    (flight,) = told(lost)["flights"]
    assert flight["race_time"] is None
    assert len(flight["passings"]) == len(whole.crossings) - 1


def test_labels_are_as_short_as_tells_flights_of_one_file_apart() -> None:
    one, two = circle().labelled("a:six-dof"), circle().labelled("a:point-mass")
    assert short_labels([one, two]) == ["six-dof", "point-mass"]
    assert short_labels([one, two.labelled("b:point-mass")]) == ["a:six-dof", "b:point-mass"]
    assert short_labels([circle().labelled("a")]) == ["a"]


@pytest.mark.parametrize("name", HOSTILE)
def test_names_survive_and_hold_nothing_that_could_end_a_script(name: str) -> None:
    flight = renamed(name)
    text = text_of(flight, flight.labelled(f"{flight.label} again"))
    assert not set("<>&") & set(text)
    assert text.isascii()
    page = json.loads(text)
    assert page["flights"][0]["aircraft"]["name"] == name
    assert name in {element["name"] for element in page["course"]["elements"]}


def test_numbers_that_json_does_not_know_are_refused() -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        Contents({"frame": [math.inf]}, [], [], []).as_json()


def test_a_course_with_everything_is_told(tmp_path: Path) -> None:
    flight = everything_flown(tmp_path)
    course = told(flight)["course"]
    elements = {element["name"]: element for element in course["elements"]}
    assert set(elements) == {passage.element.name for passage in flight.course.passages}
    assert (elements["q/1"]["label"], elements["q/2"]["label"], elements["roll"]["label"]) == ("q", "", "roll")
    assert len(elements["start"]["posts"]) == 2
    assert len(elements["corner"]["posts"]) == 1
    assert elements["corner"]["reach"] is not None
    assert elements["roll"]["posts"] == []
    assert {crowd["name"]: len(crowd["corners"]) for crowd in course["crowd"]} == {
        "stands": 2,
        "tower": 1,
        "village": 3,
    }
    assert [crowd["closed"] for crowd in course["crowd"]] == [False, False, True]
    assert [line["name"] for line in course["lines"]] == ["beach"]
    assert len(course["airspace"]) == 4


def test_pylons_of_a_gate_stand_its_width_apart_and_rise_above_its_heights() -> None:
    flight = circle()
    gates = {passage.element.name: passage.element for passage in flight.course.passages}
    for element in told(flight)["course"]["elements"]:
        gate = gates[element["name"]]
        if len(element["posts"]) == 2:
            assert math.dist(*element["posts"]) == pytest.approx(gate.width)  # type: ignore[attr-defined]
            assert element["top"] > element["heights"][1] >= element["place"][2] - 20.0


def test_what_stands_nowhere_is_told_where_the_flight_passed_it() -> None:
    flight = half_cuban().flight()
    places = {element["name"]: element["place"] for element in told(flight)["course"]["elements"]}
    vertical = next(one for one in flight.crossings if one.name == "1:vertical")
    np.testing.assert_allclose(places["vertical"], [vertical.value(name) for name in ("x", "y", "height")])


def test_a_minute_of_flight_takes_little_room() -> None:
    text = json.dumps(told(dense(half_cuban().flight(), 60.0), dense(windy().flight(), 60.0)))
    assert len(text) < 1_500_000
