"""The weather of an hour: what it sets, what an altimeter would show in it, and files of hours."""

from pathlib import Path

import pytest

from airrace.errors import InputError, UsageError
from airrace.files.inputs import load_inputs
from airrace.files.inputs.air import WIND, Wind
from airrace.files.inputs.weather import FREEZING, Weather, read_hours, weather_named
from airrace.model.environment import (
    LAPSE,
    P_ISA,
    PRESSURE_EXPONENT,
    T_ISA,
    Air,
    atmosphere_parameters,
    pressure,
    temperature,
)

COURSE = "half_cuban_eight"
WINDY = ["environment.wind.from_deg=90", "environment.wind.speed_m_s=5", "environment.wind.profile=power"]


@pytest.mark.parametrize("elevation", [0.0, 700.0])
@pytest.mark.parametrize("celsius", [-10.0, 15.0, 35.0])
def test_an_altimeter_set_to_the_qnh_shows_the_height_of_the_course(elevation: float, celsius: float) -> None:
    weather = Weather(qnh=1003.0, temperature=celsius)
    place = [f"origin.elevation_m={elevation}"]
    air = load_inputs(COURSE, overrides=[*place, *weather.overrides(Air(elevation=elevation))]).race.air
    numbers = atmosphere_parameters(air)
    assert float(temperature(0.0, numbers)) == pytest.approx(celsius + FREEZING)
    shown = 100300.0 * ((T_ISA - LAPSE * elevation) / T_ISA) ** PRESSURE_EXPONENT
    assert float(pressure(0.0, numbers)) == pytest.approx(shown)


def test_standard_weather_is_standard_air_to_the_last_bit() -> None:
    standard = weather_named("350/0", P_ISA / 100.0, T_ISA - FREEZING)
    windy = load_inputs(COURSE, overrides=[*WINDY, "environment.temperature_offset_K=20"])
    texts = [*windy.overrides, *standard.overrides(windy.race.air)]
    assert load_inputs(COURSE, overrides=texts).race.air == Air()


def test_a_wind_keeps_the_profile_of_the_course_and_what_is_not_told_stays() -> None:
    before = load_inputs(COURSE, overrides=[*WINDY, "environment.temperature_offset_K=20"]).race.air
    after = load_inputs(COURSE, overrides=[*WINDY, *weather_named("10/8", None, None).overrides(before)]).race.air
    assert before.wind
    assert after.wind
    assert after.wind.profile is before.wind.profile
    assert f"{WIND}.speed_kt=8" in weather_named("10/8", None, None).overrides(before)
    assert Weather().overrides(before) == []


@pytest.mark.parametrize(
    ("wind", "qnh", "celsius", "said"),
    [
        ("x/5", None, None, "--wind: from_deg: `x` is no number"),
        ("/5", None, None, "expected degrees and knots"),
        ("24012", None, None, "expected degrees and knots, such as 240/12"),
        ("240/nan", None, None, "--wind: speed_kt: must lie between 0 and 100, not nan"),
        ("400/5", None, None, "--wind: from_deg: must lie between 0 and 360, not 400"),
        (None, 29.92, None, "--qnh: qnh_hPa: must lie between 914 and 1113, not 29.92"),
        (None, None, 90.0, "--temperature: temperature_C: must lie between -45 and 60, not 90"),
    ],
)
def test_a_weather_that_is_none_is_refused(wind: str, qnh: float, celsius: float, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        weather_named(wind, qnh, celsius)


def test_hours_take_what_is_not_in_the_file_from_the_options(tmp_path: Path) -> None:
    file = tmp_path / "hours.csv"
    file.write_text("\ufeffhour, from_deg, speed_kt, qnh_hPa\n09:00, 240, 4, 1018\nnoon,,,\nevening,,0,\n")
    common = Weather(wind=Wind(6.0, 90.0), temperature=20.0)
    assert read_hours(file, common) == [
        Weather("09:00", Wind(4.0, 240.0), 1018.0, 20.0),
        Weather("noon", Wind(6.0, 90.0), None, 20.0),
        Weather("evening", Wind(0.0, 0.0), None, 20.0),
    ]


def test_rows_and_columns_that_a_spreadsheet_leaves_empty_are_skipped(tmp_path: Path) -> None:
    file = tmp_path / "hours.csv"
    file.write_text("hour,from_deg,speed_kt,,\n09:00,240,4,,\n,,,,\n12:00,250,10\n, ,\n,,,,\n")
    assert read_hours(file, Weather()) == [Weather("09:00", Wind(4.0, 240.0)), Weather("12:00", Wind(10.0, 250.0))]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "1:1: there is no column `hour`"),
        ("hour\n", "1:1: there is no hour in it"),
        ("hour,wind\na,5\n", "1:1: wind: there is no such column; known are hour, from_deg"),
        ("hour,qnh_hPa\na,1013\nb,x\n", "3:1: qnh_hPa: `x` is no number"),
        ("hour,qnh_hPa\na,29.92\n", "2:1: qnh_hPa: must lie between 914 and 1113, not 29.92"),
        ("hour,temperature_C\na,nan\n", "2:1: temperature_C: must lie between -45 and 60, not nan"),
        (
            "hour,from_deg,speed_kt\na,240,\n",
            "2:1: from_deg: a wind needs both its direction, `from_deg`, and",
        ),
        ("hour,qnh_hPa\na,1013,5\n", "2:1: more cells than columns"),
        ("hour,qnh_hPa\n,1013\n", "2:1: the hour has no name"),
        ("hour\na\na\n", "3:1: hour: a stands there twice"),
        ("hour,qnh_hPa\n,,\n", "1:1: there is no hour in it"),
        ("hour\na\n" + 140_000 * "x" + "\n", "3:1: is no line of a CSV file: field larger than field limit"),
        (140_000 * "x" + "\n", "1:1: is no line of a CSV file: field larger than field limit"),
    ],
)
def test_a_fault_of_a_file_of_hours_is_told_with_its_line(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "hours.csv"
    file.write_text(text)
    with pytest.raises(InputError) as caught:
        read_hours(file, Weather())
    assert said in str(caught.value)
    assert str(caught.value).startswith(str(file))


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    (tmp_path / "binary").write_bytes(b"hour\n\xff\xfe\n")
    for name, why in (("none", "No such file"), ("", "directory"), ("binary", "is no UTF-8 text")):
        with pytest.raises(InputError, match=why):
            read_hours(tmp_path / name, Weather())
