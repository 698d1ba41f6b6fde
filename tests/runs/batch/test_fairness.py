"""Fairness: the winds that are meant, laws of handicaps and normalised times, and the command."""

import csv
import math
from pathlib import Path

import pytest
from command import run

import airrace
from airrace.errors import UsageError
from airrace.files.inputs import load_inputs
from airrace.files.inputs.air import WIND, overrides_of, winds_named
from airrace.optimal_control.quantities import KNOT
from airrace.procedure.stage import Stage
from airrace.runs.batch.fairness import (
    STANDARD_AIR,
    Fairness,
    NormalisedFlight,
    Optimum,
    air_text,
    airs_of,
)

COURSE = "half_cuban_eight"
QUICK = ("settings.search=off", "settings.guess=plan")


def test_the_airs_of_a_rose_say_what_is_set() -> None:
    assert [air_text(one) for one in airs_of("0,5kt@2")[1:]] == ["calm", "5 kt from 0", "5 kt from 180"]
    windy = dict(airs_of("7.5kt@1")[1])
    assert windy == {f"{WIND}.speed_m_s": "null", f"{WIND}.speed_kt": "7.5", f"{WIND}.from_deg": "0"}
    with pytest.raises(UsageError, match="rose"):
        airs_of("5@x")


@pytest.mark.parametrize("given", [(), ("from_deg=90", "speed_m_s=5"), ("from_deg=90", "speed_kt=5", "profile=power")])
def test_a_wind_is_set_whatever_speed_the_course_has(given: tuple[str, ...]) -> None:
    given = tuple(f"{WIND}.{text}" for text in given)
    for wind in winds_named("0,7.5kt@3"):
        blown = load_inputs(COURSE, overrides=[*given, *(f"{key}={value}" for key, value in overrides_of(wind))])
        found = blown.race.air.wind
        assert (found.speed if found else 0.0) == pytest.approx(wind.speed_kt * KNOT)
        assert found is None or found.origin == pytest.approx(math.radians(wind.from_deg))
        assert found is None or (found.profile.value == "power") == (f"{WIND}.profile=power" in given)


def test_airs_that_differ_have_different_texts() -> None:
    """They name the files of the runs."""
    wind, values = airs_of("5kt@2")[1:], [((f"{WIND}.exponent", text),) for text in ("0.1", "0.2")]
    speeds = [((f"{WIND}.speed_kt", text),) for text in ("5", "6")]
    airs = [*wind, *values, *speeds, *((*one, *value) for one in wind for value in values)]
    assert len({air_text(one) for one in airs}) == len(airs)


def test_still_standard_air_is_without_wind_at_the_level_of_the_sea() -> None:
    windy = ["environment.wind.from_deg=90", "environment.wind.speed_m_s=5", "origin.elevation_m=700"]
    changed = [*windy, "environment.temperature_offset_K=20", *(f"{key}={value}" for key, value in STANDARD_AIR)]
    assert load_inputs(COURSE, overrides=changed).race.air == load_inputs(COURSE).race.air


def some(*times: float) -> Fairness:
    """Optima of two aircraft in still standard air, calm, and a wind."""
    rows = tuple(tuple(Optimum(time, "", None) for time in times[n : n + 2]) for n in range(0, len(times), 2))
    airs = airs_of("0,10kt@1")
    return Fairness("course", Stage.POINT_MASS, ("fast", "slow"), airs[: len(rows)], rows)


def test_handicaps_and_spreads_follow_from_the_optima() -> None:
    found = some(50.0, 53.0, 50.5, 53.2, 49.0, 53.4)
    assert [round(behind[1], 9) for behind in found.behind] == [3.0, 2.7, 4.4]
    fast, slow = found.aircraft_table().objects()
    assert [fast[key] for key in ("handicap_s", "least_s", "most_s", "spread_s")] == pytest.approx([0, 0, 0, 1.5])
    assert [slow[key] for key in ("handicap_s", "least_s", "most_s", "spread_s")] == pytest.approx([3, 2.7, 4.4, 0.4])


def test_a_missing_optimum_is_left_out_of_handicaps_and_reported() -> None:
    found = some(50.0, math.nan)
    assert found.aircraft_table().objects()[1]["handicap_s"] is None
    assert found.as_object()["optima"][0]["slow_s"] is None  # type: ignore[index]
    assert "-" in found.air_table().text()


def test_a_normalised_time_keeps_the_gap_and_leaves_wind_and_density_out() -> None:
    flight = NormalisedFlight("a", "edge", race_time=57.3, optimum=56.0, standard=55.0)
    assert flight.time == pytest.approx(56.3)
    assert NormalisedFlight("a", "edge", 56.0, 56.0, 55.0).time == 55.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fairness")


@pytest.fixture(scope="module")
def found(folder: Path) -> Fairness:
    """Two aircraft in a wind along the course and one against it; and the optimum in such a wind as a flight."""
    return airrace.fairness(
        COURSE,
        aircraft=["edge540", "pc9"],
        winds="0,15kt@2",
        set=QUICK,
        until="point-mass",
        output=folder,
        flights=[str(windy(folder))],
    )


def windy(folder: Path) -> Path:
    """The optimum of the Edge in 10 kt of wind on a hot day."""
    path = folder / "windy.h5"
    if not path.exists():
        wind = ["environment.wind.from_deg=180", "environment.wind.speed_kt=10", "environment.temperature_offset_K=20"]
        airrace.optimize(COURSE, aircraft="edge540", set=[*wind, *QUICK], until="point-mass", output=path)
    return path


def test_in_calm_at_the_level_of_the_sea_optima_are_those_of_still_standard_air(found: Fairness) -> None:
    assert load_inputs(COURSE).race.air.elevation == 0.0
    assert found.optima[1] == found.optima[0]
    assert not found.messages
    assert all(one.stage and one.stage.certified for row in found.optima for one in row)


def test_warm_starts_find_the_optima_that_are_found_from_the_course_alone(found: Fairness) -> None:
    tail = airrace.optimize(
        COURSE, aircraft="pc9", until="point-mass", set=[*QUICK, *(f"{key}={value}" for key, value in found.airs[3])]
    )
    assert found.optima[3][1].time == pytest.approx(tail.race_time, abs=0.01)


def test_the_optimum_of_an_aircraft_in_a_wind_normalises_to_its_optimum_in_still_standard_air(found: Fairness) -> None:
    (flight,) = found.flights
    assert flight.race_time == pytest.approx(flight.optimum, abs=0.002)
    assert flight.race_time != pytest.approx(flight.standard, abs=0.01)
    assert flight.time == pytest.approx(found.optima[0][0].time, abs=0.003)


def test_gates_that_favour_one_aircraft_cost_the_other_more(found: Fairness) -> None:
    assert found.favours
    for row, one in zip(found.gate_table().objects(), found.favours, strict=True):
        assert row["favours"] == found.aircraft[0 if one.costs[0] <= one.costs[1] else 1]
        assert one.difference == pytest.approx(abs(one.costs[0] - one.costs[1]))
    sensitivities = found.optima[0][0].stage.sensitivities("track")  # type: ignore[union-attr]
    one = found.favours[0]
    assert one.costs[0] == pytest.approx(sensitivities[one.key].per_unit * sensitivities[one.key].usual_step)


def test_the_command_takes_up_what_is_there_and_tells_tables_and_values(found: Fairness, folder: Path) -> None:
    kept = {path.name: path.stat().st_mtime_ns for path in folder.glob("*.h5")}
    table = folder / "optima.csv"
    words = ["fairness", COURSE, "--aircraft", "edge540", "--aircraft", "pc9", "--winds", "0,15kt@2"]
    words += ["--until", "point-mass", "--output", str(folder), "--csv", str(table)]
    said = run(*words, *(word for text in QUICK for word in ("--set", text)))
    assert said.code == 0, said.err
    assert "what a step of a gate costs, and whom it favours" in said.out
    assert {path.name: path.stat().st_mtime_ns for path in folder.glob("*.h5")} == kept
    with table.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["air"] for row in rows] == [air_text(air) for air in found.airs]
    assert [float(row["pc9_s"]) for row in rows] == pytest.approx([row[1].time for row in found.optima])


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        (("--winds", "x"), 2, "no rose of winds"),
        (("--until", "nonsense"), 2, "nonsense"),
        (("--flight", "none.h5"), 7, "there is no checkpoint none.h5"),
        (("--output", "file"), 2, "file is not a folder; name one with --output"),
        (("--sweep", "rules.n_z_max=8,9"), 2, "`rules.n_z_max` is no key of the air"),
    ],
)
def test_bad_calls_end_with_one_sentence_before_anything_is_solved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], code: int, told: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("file").touch()
    said = run("fairness", COURSE, *words)
    assert said.code == code, said.err
    assert told in said.err
    assert said.err.count("\n") == 1, said.err
