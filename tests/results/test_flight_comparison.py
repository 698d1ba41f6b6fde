"""Two flights on one clock."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from example_flights import circling, half_cuban, rovinj, windy
from typer.testing import CliRunner

from airrace.cli import flight_tables
from airrace.cli.flight_tables import comparison_texts
from airrace.cli.main import app
from airrace.errors import UsageError
from airrace.procedure.result import State
from airrace.report.flight_page import flight_page
from airrace.results.comparison import Comparison, compare_flights, conditions
from airrace.results.flight import Crossing, Flight, Source
from airrace.runs.json_objects import comparison_object
from airrace.track.limits import Crowd, CrowdShape, SafetyLine
from airrace.track.polygons import Point

KNOT = 1852.0 / 3600.0


def optima() -> Comparison:
    return compare_flights(half_cuban().flight(label="still"), windy().flight(label="windy"))


def without_passing(flight: Flight, number: int) -> Flight:
    """A flight that misses a gate."""
    lost = Crossing(flight.crossings[number].passage, float("nan"), {})
    return replace(flight, crossings=(*flight.crossings[:number], lost, *flight.crossings[number + 1 :]))


def test_a_flight_compared_with_itself_differs_nowhere() -> None:
    flight = half_cuban().flight()
    comparison = compare_flights(flight, flight)
    assert comparison.tie
    assert comparison.difference == 0.0
    assert not np.any(comparison.progress.difference)
    for leg in comparison.legs:
        assert (leg.difference, leg.cumulative, leg.by_way, leg.by_speed) == (0.0, 0.0, 0.0, 0.0)
        assert leg.differences == ()
    assert list(conditions(flight, flight)) == []


def test_the_difference_along_the_course_ends_at_the_difference_of_the_race_times() -> None:
    comparison = optima()
    assert comparison.progress.difference[0] == 0.0
    assert comparison.progress.difference[-1] == pytest.approx(comparison.difference, abs=1e-9)
    assert comparison.legs[-1].cumulative == pytest.approx(comparison.difference, abs=1e-12)
    assert sum(leg.difference for leg in comparison.legs) == pytest.approx(comparison.difference, abs=1e-12)


def test_the_difference_at_every_passing_is_the_difference_of_the_clocks() -> None:
    comparison = optima()
    here = np.searchsorted(comparison.progress.distance, comparison.progress.passings - 1e-9)
    for row, leg in zip(here[1:], comparison.legs, strict=True):
        assert comparison.progress.difference[row] == pytest.approx(leg.cumulative, abs=1e-9)


def test_flights_that_change_places_change_the_sign() -> None:
    here = optima()
    there = compare_flights(here.other, here.reference)
    assert there.difference == -here.difference
    np.testing.assert_allclose(there.progress.difference, -here.progress.difference, atol=1e-12)
    for one, other in zip(here.legs, there.legs, strict=True):
        assert other.by_way == pytest.approx(-one.by_way, abs=1e-12)
        assert [two.name for two in other.differences] == [two.name for two in one.differences]


def test_what_is_lost_by_the_way_and_by_the_speed_adds_up() -> None:
    for leg in optima().legs:
        assert leg.by_way + leg.by_speed == pytest.approx(leg.difference, abs=1e-9)


def test_a_wider_circle_at_the_same_speed_is_lost_by_the_way_alone() -> None:
    """Both turn once around at 80 m/s; the larger bank takes the smaller circle."""
    race = rovinj()
    turns = [circling(race, bank=bank, seconds=seconds) for bank, seconds in ((1.0, 20.0), (0.8, 25.0))]
    for leg in compare_flights(*turns).legs:
        assert leg.by_speed == pytest.approx(0.0, abs=1e-5)
        assert leg.by_way == pytest.approx(leg.difference, abs=1e-5)


def test_a_slower_flight_of_the_same_way_is_lost_by_the_speed_alone() -> None:
    """`tan(bank) = V^2 / (g0 r)`: circles of one radius, at 80 and at 75 m/s."""
    race = rovinj()
    bank = float(np.arctan(np.tan(1.0) * (75.0 / 80.0) ** 2))
    fast, slow = circling(race, bank=1.0), circling(race, speed=75.0, bank=bank, seconds=20.0 * 80.0 / 75.0)
    for leg in compare_flights(fast, slow).legs:
        assert leg.by_way == pytest.approx(0.0, abs=1e-4)
        assert leg.by_speed == pytest.approx(leg.difference, abs=1e-4)
        (speed,) = [one for one in leg.differences if one.name == "speed_in"]
        assert speed.reference - speed.other == pytest.approx(5.0 / KNOT)
        assert speed.text == "9.7 kt slower in"


def test_legs_are_sorted_by_what_is_lost() -> None:
    lost = [leg.difference for leg in optima().by_loss]
    assert lost == sorted(lost, reverse=True)


def test_five_milliseconds_are_a_tie() -> None:
    race = rovinj()
    assert compare_flights(circling(race, seconds=20.0), circling(race, seconds=20.004)).tie
    assert not compare_flights(circling(race, seconds=20.0), circling(race, seconds=20.006)).tie


def test_a_missed_gate_leaves_the_rest_of_the_clock_as_it_is() -> None:
    whole = circling(rovinj(), seconds=21.0)
    comparison = compare_flights(circling(rovinj()), without_passing(whole, 3))
    assert np.isnan(comparison.legs[2].difference)
    assert comparison.difference == pytest.approx(1.0)
    assert comparison.progress.difference[-1] == pytest.approx(1.0)
    assert np.isnan(comparison.progress.difference).any()
    assert np.isnan(comparison.by_loss[-1].difference)


def test_flights_of_other_passings_are_refused() -> None:
    with pytest.raises(UsageError, match=re.escape("passing 0 is 0:entry (manoeuvre) in the one and 0:g0 (gate)")):
        compare_flights(circling(rovinj()), half_cuban().flight())
    flight = circling(rovinj())
    course = replace(flight.course, passages=flight.course.passages[:-1])
    shorter = replace(flight, race=replace(flight.race, course=course))
    with pytest.raises(UsageError, match="the one has 16 passings, the other 17"):
        compare_flights(flight, shorter)


def test_conditions_that_differ_are_told() -> None:
    told = {what: (first, second) for what, first, second in conditions(half_cuban().flight(), windy().flight())}
    assert told == {"wind": ("none", "20 kt from 70 deg")}
    flight = circling(rovinj())
    line = SafetyLine("beach", Point(-10.0, 0.0), Point(10.0, 0.0), keep_right=True, margin=5.0)
    crowd = Crowd("stands", CrowdShape.POINT, (Point(0.0, 0.0),), 30.0)
    passages = (*flight.course.passages[:-1], replace(flight.course.passages[-1], safety_lines=(line,)))
    course = replace(flight.course, passages=passages, crowd=(crowd,))
    other = replace(flight, race=replace(flight.race, course=course))
    assert list(conditions(flight, other)) == [("safety lines", "none", "beach"), ("people", "none", "stands")]
    moved = replace(other, race=replace(other.race, course=replace(course, crowd=(replace(crowd, distance=40.0),))))
    assert list(conditions(other, moved)) == [("people", "stands", "stands otherwise")]


@pytest.mark.parametrize(
    ("state", "words"),
    [
        (None, ""),
        (State.CERTIFIED, ""),
        (State.SOLVED, "x is solved on one mesh"),
        (State.GUESS, "x is a guess"),
        (State.NOT_CERTIFIED, "x is not certified"),
    ],
)
def test_the_trust_that_a_flight_deserves_is_told_in_its_own_word(state: State | None, words: str) -> None:
    reference = circling(rovinj())
    other = replace(reference, source=Source("x", state=state))
    verdict, *_ = comparison_texts(compare_flights(reference, other), every=False)
    assert [line.strip() for line in verdict.splitlines()[1:]] == ([words] if words else [])
    good = state not in (State.GUESS, State.NOT_CERTIFIED)
    assert flight_page([other]).good == good
    told = comparison_object(other, [])["reference"]
    assert isinstance(told, dict)
    assert told["state"] == (None if state is None else state.value)


@pytest.fixture
def files(tmp_path: Path) -> tuple[str, str]:
    paths = tmp_path / "still.h5", tmp_path / "windy.h5"
    for run, path in zip((half_cuban(), windy()), paths, strict=True):
        run.save(path)
    return str(paths[0]), str(paths[1])


def run(*arguments: str) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, ["compare", *arguments])
    return result.exit_code, result.stdout, result.stderr


def test_the_command_tells_the_difference_in_eighty_columns(files: tuple[str, str]) -> None:
    code, out, _ = run(*files, "--all")
    assert code == 0
    assert out.startswith("windy against still: ")
    assert "wind: 20 kt from 70 deg against none" in out
    assert max(len(line) for line in out.splitlines()) <= 80


def test_the_command_says_ties(files: tuple[str, str]) -> None:
    code, out, _ = run(files[0], files[0])
    assert code == 0
    assert "a tie within 5 ms" in out


def test_the_object_holds_the_same_numbers(files: tuple[str, str]) -> None:
    code, out, _ = run(*files, "--json")
    answer = json.loads(out)
    (flight,) = answer["flights"]
    comparison = optima()
    assert code == 0
    assert (answer["reference"]["label"], flight["label"]) == ("still", "windy")
    assert flight["difference_s"] == pytest.approx(comparison.difference)
    assert [leg["passing"] for leg in flight["legs"]] == [leg.name for leg in comparison.legs]
    assert flight["progress"]["difference_s"][-1] == pytest.approx(comparison.difference)
    assert not flight["tie"]


def test_the_object_holds_every_word_of_the_table(files: tuple[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(flight_tables, "PAGE", 300)  # so that no words are wrapped
    (flight,) = json.loads(run(*files, "--json")[1])["flights"]
    table = run(*files, "--all")[1].splitlines()
    assert any(leg["differs"] for leg in flight["legs"])
    for leg in flight["legs"]:
        (row,) = [line for line in table if line.split()[:1] == [leg["passing"]]]
        numbers, words = row.split()[1:5], " ".join(row.split()[5:])
        assert words == "; ".join(one["text"] for one in leg["differs"])
        named = ("flight_s", "difference_s", "by_longer_way_s", "by_lower_speed_s")
        assert [float(one) for one in numbers] == pytest.approx([leg[name] for name in named], abs=5.1e-4)


def test_the_drawing_is_written_and_not_overwritten(files: tuple[str, str], tmp_path: Path) -> None:
    drawing = tmp_path / "two.svg"
    assert run(*files, "--plot", str(drawing))[0] == 0
    assert drawing.read_bytes().startswith(b"<?xml")
    code, _, err = run(*files, "--plot", str(drawing))
    assert code == 2
    assert err.count("\n") == 1
    assert "--force" in err


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (("{still}",), 2, "a comparison takes two flights or more"),
        (("{still}", "{still}:six-dof"), 2, "this run has no stage 'six-dof'"),
        (("{still}", "none.h5"), 7, "none.h5"),
        (("{still}", "{still}", "--plot", "a.jpg"), 2, "cannot draw into a.jpg"),
    ],
)
def test_what_cannot_be_compared_is_refused_in_a_sentence(
    files: tuple[str, str], arguments: tuple[str, ...], code: int, said: str
) -> None:
    ended, out, err = run(*(one.format(still=files[0]) for one in arguments))
    assert (ended, out) == (code, "")
    assert said in err
    assert err.count("\n") == 1
