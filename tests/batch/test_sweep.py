"""Sweeps: which values a text stands for, and how several multiply."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from airrace.batch.sweep import combinations, count, cover, parse_sweep, sweep_of
from airrace.inputs.overrides import parse_overrides

WIND = "environment.wind.speed_kt"
FROM = "environment.wind.from_deg"


@pytest.mark.parametrize(
    ("text", "values"),
    [
        (f"{WIND}=0,5,10", ("0", "5", "10")),
        (f"{WIND}=0:20:5", ("0", "5", "10", "15", "20")),
        (f"{WIND}=0:18:5", ("0", "5", "10", "15")),
        (f"{WIND}=20:0:-10", ("20", "10", "0")),
        (f"{WIND}=3:3:1", ("3",)),
        ("rules.n_z_max=8:9:0.25", ("8", "8.25", "8.5", "8.75", "9")),
        (f"{WIND}=0, 2 ,10:30:10", ("0", "2", "10", "20", "30")),
        ("settings.guess=plan,homotopy", ("plan", "homotopy")),
        ("rules=rbar-2014,rbar-2016", ("rbar-2014", "rbar-2016")),
        (f"{WIND}=5.0,7.50,-0", ("5", "7.5", "0")),
        ("notes=12:30", ("12:30",)),
    ],
)
def test_texts_stand_for_lists_and_ranges(text: str, values: tuple[str, ...]) -> None:
    assert parse_sweep(text).values == values


def test_a_full_circle_of_directions_is_closed_once() -> None:
    assert parse_sweep(f"{FROM}=0:360:45").values == ("0", "45", "90", "135", "180", "225", "270", "315")
    assert parse_sweep(f"{FROM}=-180:180:90").values == ("-180", "-90", "0", "90")
    assert parse_sweep(f"{FROM}=360:0:-120").values == ("360", "240", "120")


def test_a_range_of_directions_that_is_no_full_circle_includes_its_last_value() -> None:
    assert parse_sweep(f"{FROM}=0:90:45").values == ("0", "45", "90")
    assert parse_sweep(f"{FROM}=0:360:100").values == ("0", "100", "200", "300")


def test_degrees_that_are_no_direction_are_not_a_circle() -> None:
    assert parse_sweep("gates.f.roll_deg=0:360:180").values == ("0", "180", "360")


@pytest.mark.parametrize(
    ("text", "word"),
    [
        (WIND, "form"),
        ("=1,2", "form"),
        ("a..b=1", "form"),
        (f"{WIND}=", "no values"),
        (f"{WIND}=1,,2", "missing between"),
        (f"{WIND}=0:10:0", "never arrives"),
        (f"{WIND}=0:10:-1", "never arrives"),
        (f"{WIND}=5,5.0", "given twice"),
        (f"{WIND}=0:10:5,10", "given twice"),
        (f"{WIND}=0:100000:0.01", "more than"),
    ],
)
def test_what_is_no_sweep_is_refused_with_the_reason(text: str, word: str) -> None:
    with pytest.raises(ValueError, match=word):
        parse_sweep(text)


def test_several_sweeps_multiply_and_the_last_runs_fastest() -> None:
    sweeps = (sweep_of("a", ["1", "2"]), sweep_of("b", ["x", "y", "z"]))
    found = list(combinations(sweeps))
    assert len(found) == count(sweeps) == 6
    assert found[0] == (("a", "1"), ("b", "x"))
    assert found[1] == (("a", "1"), ("b", "y"))
    assert len(set(found)) == 6


def test_no_sweep_is_one_combination() -> None:
    assert list(combinations(())) == [()]
    assert list(cover(())) == [()]


@given(st.lists(st.integers(1, 9), min_size=1, max_size=4))
def test_every_value_occurs_in_the_cover_which_is_no_longer_than_the_longest_sweep(lengths: list[int]) -> None:
    sweeps = [sweep_of(f"k{number}", [*map(str, range(length))]) for number, length in enumerate(lengths)]
    covered = list(cover(sweeps))
    assert len(covered) == max(lengths)
    assert set(covered) <= set(combinations(sweeps))
    for sweep in sweeps:
        assert {dict(one)[sweep.key] for one in covered} == set(sweep.values)


@given(st.integers(-500, 500), st.integers(1, 40), st.integers(1, 30))
def test_ranges_are_exact_in_decimals(first: int, step: int, steps: int) -> None:
    last = first + step * steps
    values = parse_sweep(f"k={first / 10}:{last / 10}:{step / 10}").values
    assert len(values) == steps + 1
    assert [float(value) for value in values] == [(first + step * number) / 10 for number in range(steps + 1)]


@given(st.decimals(-1000, 1000, places=3))
def test_values_mean_to_set_what_they_were_written_as(value: object) -> None:
    (swept,) = parse_sweep(f"k={value:f}").values
    (override,) = parse_overrides([f"k={swept}"], [])
    assert override.value.value == float(str(value))
