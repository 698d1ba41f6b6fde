"""Measures with units, as flight manuals give them."""

import pytest

from airrace.errors import UsageError
from airrace.inputs.measures import AREA, CLIMB, LENGTH, LOAD_FACTOR, MASS, POWER, ROLL_RATE, SPEED, Measure, parse


@pytest.mark.parametrize(
    ("text", "measure", "value"),
    [
        ("100kt", SPEED, 51.444444),
        ("100 KT", SPEED, 51.444444),
        ("180km/h", SPEED, 50.0),
        ("100 mph", SPEED, 44.704),
        ("50.5 m/s", SPEED, 50.5),
        ("3000ft/min", CLIMB, 15.24),
        ("900 m/min", CLIMB, 15.0),
        ("300hp", POWER, 223709.96),
        ("300 PS", POWER, 220649.63),
        ("1000lb", MASS, 453.59237),
        ("24ft", LENGTH, 7.3152),
        ("100ft2", AREA, 9.290304),
        ("9.1 m\N{SUPERSCRIPT TWO}", AREA, 9.1),
        ("10", LOAD_FACTOR, 10.0),
        ("180", ROLL_RATE, 3.14159265),
        ("180 deg/s", ROLL_RATE, 3.14159265),
    ],
)
def test_a_number_with_its_unit_is_a_measure(text: str, measure: Measure, value: float) -> None:
    assert parse(text, measure, "--figure") == pytest.approx(value, rel=1e-7)


@pytest.mark.parametrize(
    ("text", "measure", "words"),
    [
        ("57", SPEED, "--figure: '57' has no unit; give one of kt, km/h, mph, m/s, e.g. 57kt"),
        ("57 furlongs", SPEED, "--figure: 'furlongs' is no unit of it; known are kt, km/h, mph, m/s"),
        ("fast", SPEED, "--figure: 'fast' is no number with a unit (kt, km/h, mph, m/s)"),
        ("", MASS, "--figure: '' is no number with a unit (kg, lb)"),
        ("1e9kg", MASS, "is no unit of it"),
        ("1,5m", LENGTH, "is no number with a unit (m, ft)"),
        ("nan kt", SPEED, "is no number with a unit"),
        ("-50kt", SPEED, "--figure: -50kt is beyond 10 to 550 kt"),
        ("0kg", MASS, "--figure: 0kg is beyond 50 to 50000 kg"),
        ("0.5", LOAD_FACTOR, "--figure: 0.5 is beyond 1.1 to 25 g"),
    ],
)
def test_what_is_no_measure_is_refused_with_what_would_be_right(text: str, measure: Measure, words: str) -> None:
    with pytest.raises(UsageError) as refused:
        parse(text, measure, "--figure")
    assert words in str(refused.value)
