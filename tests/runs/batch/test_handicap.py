"""Handicaps: laws of rotated, mirrored and still air, their intervals, other aircraft, flights, and the command."""

import csv
import json
import math
import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
from command import run as run_command

import airrace
from airrace.api.run import Run
from airrace.errors import AirraceError, UsageError
from airrace.files.inputs import load_inputs
from airrace.files.inputs.weather import weather_named
from airrace.model.environment import Air
from airrace.procedure.stage import Stage
from airrace.runs.batch.handicap import (
    STANDARD_AIR,
    FlightHandicap,
    Handicap,
    HandicapResult,
    WindError,
    headings_of,
    plan_course,
    start_overrides,
)

COURSE = "half_cuban_eight"
SOLVED_AGAIN = 1e-3
"""The difference of race times that are solved from different starts, on meshes of their own, s."""


@cache
def course() -> Run:
    """The point mass on a course that is symmetric to the plane of its heading, north."""
    return airrace.optimize(COURSE, until="point-mass", search="off")


@cache
def windy() -> Run:
    """The same in 10 kt on a hot day."""
    values = ["environment.wind.from_deg=180", "environment.wind.speed_kt=10", "environment.temperature_offset_K=20"]
    return airrace.optimize(COURSE, until="point-mass", search="off", set=values)


@cache
def headed(heading: int) -> Run:
    """The course rotated clockwise; as it is symmetric, the other way is its mirror image."""
    text = load_inputs(COURSE).track.text
    lines = {f"heading_deg: {angle}\n": f"heading_deg: {(angle + heading) % 360}\n" for angle in (0, 180)}
    for line, rotated_line in lines.items():
        text = text.replace(line, rotated_line)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "rotated.yaml")
        file.write_text(text, encoding="utf-8")
        return airrace.optimize(file, until="point-mass", search="off")


def of(run: Run, wind: str | None = None, **options: object) -> Handicap:
    """The only handicap of a run."""
    (handicap,) = airrace.handicap(run, wind=wind, **options).handicaps  # type: ignore[arg-type]
    return handicap


def test_a_handicap_in_still_standard_air_is_exactly_zero() -> None:
    for run in (course(), windy()):
        handicap = of(run, "0/0", qnh=1013.25, temperature=15)
        assert handicap.seconds == 0.0
        assert handicap.error > 0.0
    assert of(course()).seconds == 0.0
    assert of(course(), headings="70").seconds == 0.0


def test_what_sets_still_standard_air_sets_it_whatever_the_course_says() -> None:
    changed = ["environment.wind.from_deg=90", "environment.wind.speed_m_s=5", "origin.elevation_m=700"]
    assert load_inputs(COURSE, overrides=[*changed, *STANDARD_AIR]).race.air == Air()


def test_a_run_without_a_weather_has_the_handicap_of_its_own_air() -> None:
    own, told = of(windy()), of(course(), "180/10", temperature=35)
    assert own.seconds == pytest.approx(told.seconds, abs=SOLVED_AGAIN)
    assert own.air == told.air


def test_winds_from_either_side_of_a_symmetric_course_cost_the_same() -> None:
    left, right = of(course(), "270/10"), of(course(), "90/10")
    assert left.seconds == pytest.approx(right.seconds, abs=SOLVED_AGAIN)
    assert abs(left.seconds) > 20 * SOLVED_AGAIN
    assert left.error == pytest.approx(right.error, rel=0.05)


def test_a_course_that_is_rotated_in_a_wind_that_is_rotated_has_the_same_handicap() -> None:
    straight, both = of(course(), "60/10"), of(headed(40), "100/10")
    assert both.seconds == pytest.approx(straight.seconds, abs=SOLVED_AGAIN)
    assert both.error == pytest.approx(straight.error, rel=0.05)


def test_headings_rotate_the_course() -> None:
    by_heading = of(course(), "100/10", headings="40")
    assert by_heading.seconds == pytest.approx(of(headed(40), "100/10").seconds, abs=SOLVED_AGAIN)
    assert by_heading.seconds != pytest.approx(of(course(), "100/10").seconds, abs=20 * SOLVED_AGAIN)
    assert by_heading.air == of(course(), "100/10").air  # the wind over the ground is as it was told


def test_a_mirrored_course_in_a_mirrored_wind_has_the_same_handicap() -> None:
    assert of(headed(-40), "290/10").seconds == pytest.approx(of(headed(40), "70/10").seconds, abs=SOLVED_AGAIN)


def test_heading_zero_is_the_plain_answer_and_no_answer_depends_on_others() -> None:
    plain = of(course(), "200/9")
    first, *others = airrace.handicap(course(), wind="200/9", headings="0:360:90").handicaps
    assert (first.seconds, first.error) == (plain.seconds, plain.error)
    assert [row.heading for row in others] == [90.0, 180.0, 270.0]
    assert of(course(), "200/9", headings="270").seconds == others[-1].seconds


def test_sensitivities_predict_a_small_handicap() -> None:
    view = windy().stage("point-mass")
    prices = view.sensitivities("environment")
    told = of(windy(), "181/10.5", temperature=35.5)
    expected = 0.5 * prices["environment.wind.speed_kt"].per_unit + prices["environment.wind.from_deg"].per_unit
    expected += 0.5 * prices["environment.temperature_offset_K"].per_unit
    assert told.seconds - of(windy()).seconds == pytest.approx(expected, rel=0.05, abs=1e-4)


def test_an_interval_is_what_winds_at_its_errors_cost_to_first_order() -> None:
    middle = of(course(), "30/12", wind_speed_error_kt=0.5, wind_direction_error_deg=2.0)
    by_speed = 0.5 * (of(course(), "30/12.5").seconds - of(course(), "30/11.5").seconds)
    by_direction = 0.5 * (of(course(), "32/12").seconds - of(course(), "28/12").seconds)
    assert middle.error == pytest.approx(math.hypot(by_speed, by_direction), rel=0.02)
    assert middle.interval == (middle.seconds - middle.error, middle.seconds + middle.error)
    assert of(course(), "30/12", wind_speed_error_kt=0.0, wind_direction_error_deg=0.0).error == 0.0


def test_a_calm_may_be_a_wind_from_anywhere() -> None:
    assert of(course(), "0/0").error == pytest.approx(of(course(), "0/0.01").error, rel=0.02)
    ahead, astern = (of(course(), f"{origin}/0.5").seconds for origin in (0, 180))
    error = of(course(), "0/0", wind_speed_error_kt=0.5).error
    assert error == pytest.approx(0.5 * abs(ahead - astern), rel=0.05)
    with pytest.raises(UsageError, match="errors of a wind"):
        WindError(-1.0)


def test_an_interval_does_not_jump_where_the_wind_is_as_fast_as_the_error_of_its_speed() -> None:
    below, above = of(course(), "90/2.99"), of(course(), "90/3.01")
    assert below.error == pytest.approx(above.error, rel=0.03)


@pytest.mark.parametrize("error", [WindError(), WindError(3.0, 0.0), WindError(3.0, 90.0), WindError(0.0, 15.0)])
def test_the_error_across_a_wind_leads_from_that_of_the_speed_to_that_of_the_direction(error: WindError) -> None:
    assert error.across(0.0) == error.speed
    assert error.across(20.0) == pytest.approx(20.0 * math.radians(error.direction))
    steps = [abs(error.across(0.001 * (knots + 1)) - error.across(0.001 * knots)) for knots in range(6000)]
    assert max(steps) < 0.1


def test_hours_and_headings_tell_the_best_of_both(tmp_path: Path) -> None:
    file, table = tmp_path / "hours.csv", tmp_path / "handicaps.csv"
    file.write_text("hour,from_deg,speed_kt,temperature_C\nmorning,0,2,10\nnoon,0,15,30\n")
    result = airrace.handicap(course(), hours=file, headings="0:360:180", output=table)
    assert [(row.hour, row.heading) for row in result.handicaps] == [
        ("morning", 0.0),
        ("morning", 180.0),
        ("noon", 0.0),
        ("noon", 180.0),
    ]
    headings, hours = result.summaries()
    assert [row["mean_s"] for row in hours.objects()] == pytest.approx(
        [sum(row.seconds for row in result.handicaps[first : first + 2]) / 2 for first in (0, 2)]
    )
    assert headings.notes == ["fastest: 180 deg; most even: 180 deg"]
    rows = list(csv.DictReader(table.read_text().splitlines()))
    assert [float(row["handicap_s"]) for row in rows] == pytest.approx([row.seconds for row in result.handicaps])


@pytest.mark.parametrize(
    "options",
    [
        {"flights": ["none.h5"]},
        {"aircraft": ["pc9", "pc9"]},
        {"aircraft": ["none.yaml"]},
    ],
)
def test_nothing_is_solved_before_all_that_is_named_is_found_to_be_there(options: dict[str, list[str]]) -> None:
    told: list[str] = []
    with pytest.raises(AirraceError):
        airrace.handicap(course(), headings="0,90", tell=told.append, **options)  # type: ignore[arg-type]
    with pytest.raises(AirraceError):  # a course that is still to be solved
        airrace.handicap(COURSE, headings="0,90", tell=told.append, **options)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="settings"):
        airrace.handicap(course(), aircraft=["pc9"], set=["settings.search=thorough"], tell=told.append)
    assert told == []


def test_a_run_without_a_point_mass_has_the_handicap_of_its_last_stage(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    run = airrace.optimize(COURSE, guess="plan", search="off")
    bare = replace(run, checkpoint=replace(run.checkpoint, stages=())).with_stage(run.results[-1])
    bare.save(tmp_path / "bare.h5")
    result = airrace.handicap(bare, wind="0/10")
    assert result.stage == "six-dof"
    assert "has no point-mass; the handicap is by six-dof" in caplog.text
    whole = airrace.handicap(run, wind="0/10", stage="six-dof")
    assert result.handicaps[0].seconds == whole.handicaps[0].seconds
    beside = airrace.handicap(course(), flights=[str(tmp_path / "bare.h5")])
    assert (beside.stage, beside.flights[0].handicap.seconds) == ("point-mass", 0.0)
    heads, cells = beside.flight_table().texts()
    assert cells[heads.index("handicap by")] == "six-dof"
    with pytest.raises(UsageError, match="no stage 'point-mass'"):
        airrace.handicap(bare, stage="point-mass")


def test_a_course_with_a_reserve_is_solved_without_a_search_for_it() -> None:
    plan = plan_course(load_inputs(COURSE, overrides=["rules.reserve.probability=0.9"]), None)
    assert (plan.until, plan.reserve, plan.run.inputs.reserve) == (Stage.POINT_MASS, None, None)


def test_a_profile_is_that_of_winds_of_which_the_course_has_none() -> None:
    profile = ["environment.wind.profile=power", "environment.wind.exponent=0.3"]
    whole = ["environment.wind.from_deg=240", "environment.wind.speed_kt=10", *profile]
    assert of(course(), "240/10", set=profile).seconds == of(course(), set=whole).seconds
    assert of(course(), "240/10", set=profile).seconds != of(course(), "240/10").seconds
    assert of(course(), "0/0", set=profile).seconds == 0.0
    plan = start_overrides(profile, [weather_named("240/10", None, None)])
    assert load_inputs(COURSE, overrides=plan).race.air.wind is None  # a course that is solved first


def row(aircraft: str, seconds: float, hour: str = "", heading: float = 0.0, message: str = "") -> Handicap:
    return Handicap(aircraft, hour, heading, Air(), 50.0 + seconds, 50.0, 0.1, message)


def test_aircraft_are_behind_the_fastest_in_the_same_air() -> None:
    rows = (row("a", 0.5, "x"), row("a", -1.0, "y"), row("b", 3.2, "x"), row("b", 3.4, "y"))
    result = HandicapResult("course", "point-mass", rows)
    assert [result.behind(row) for row in rows] == pytest.approx([0.0, 0.0, 2.7, 4.4])
    assert "aircraft" in result.table().texts()[0]


def test_a_missing_optimum_is_reported_and_left_out() -> None:
    rows = (row("a", math.nan, "x", 30.0, "no flight was found"), row("a", -1.0, "y", 30.0), row("a", 0.0, "z"))
    result = HandicapResult("course", "point-mass", rows)
    assert result.messages == ("a, x, rotated by 30 deg: no flight was found",)
    assert result.as_object()["handicaps"][0]["handicap_s"] is None  # type: ignore[index]
    assert "fastest: a, y, rotated by 30 deg, -1.000 s" in result.table().notes


def test_headings_that_lack_an_optimum_are_not_compared() -> None:
    times = {("x", 0.0): 0.1, ("x", 30.0): math.nan, ("y", 0.0): 0.4, ("y", 30.0): -9.0}
    rows = tuple(row("a", seconds, hour, heading) for (hour, heading), seconds in times.items())
    headings, hours = HandicapResult("course", "point-mass", rows).summaries()
    assert [entry["mean_s"] for entry in headings.objects()] == [pytest.approx(0.25), None]
    assert [entry["spread_s"] for entry in hours.objects()] == [None, pytest.approx(9.4)]
    assert headings.notes == ["fastest: 0 deg; most even: 0 deg"]


def test_a_flight_without_its_handicap_keeps_the_pilot_s_own_gap() -> None:
    assert FlightHandicap("a", 57.3, "point-mass", row("a", 1.0)).result == pytest.approx(56.3)


def test_an_air_that_cannot_be_flown_is_a_row_and_the_others_are_solved(tmp_path: Path) -> None:
    file = tmp_path / "hours.csv"
    file.write_text("hour,temperature_C\nfrost,-45\nmild,20\n")
    frost, mild = airrace.handicap(course(), hours=file, set=["origin.elevation_m=-400"]).handicaps
    assert math.isnan(frost.seconds)
    assert "temperature" in frost.message or "-60" in frost.message
    assert mild.seconds < 0.0  # the air is denser below the level of the sea


@pytest.mark.parametrize("text", ["0:x", "0:360:-10", "x", "10,10", "1e400", "nan", "-inf", "361", "0:720:90"])
def test_headings_that_are_none_are_refused(text: str) -> None:
    with pytest.raises(UsageError, match="--headings"):
        headings_of(text)


def test_the_command_compares_aircraft_and_frees_flights_of_their_handicaps(tmp_path: Path) -> None:
    still, flown = tmp_path / "still.h5", tmp_path / "windy.h5"
    course().save(still)
    windy().save(flown)
    said = run_command("handicap", str(still), "--aircraft", "pc9", "--wind", "90/10", "--flight", str(flown))
    assert said.code == 0, said.err
    again = run_command("handicap", str(still), "--flight", f"{flown}:point-mass", "--json", "--aircraft", "pc9")
    told = json.loads(again.out)
    (flight,) = told["flights"]
    standard, other = told["handicaps"]
    assert flight["result_s"] == pytest.approx(standard["standard_s"], abs=2 * SOLVED_AGAIN)
    assert flight["handicap_s"] == pytest.approx(of(windy()).seconds, abs=1e-6)
    alone = airrace.optimize(COURSE, aircraft="pc9", until="point-mass", search="off")
    assert other["standard_s"] == pytest.approx(alone.race_time, abs=0.02)


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        (("--wind", "x"), 2, "--wind x: expected degrees and knots"),
        (("--stage", "nonsense"), 2, "nonsense"),
        (("--hours", "none.csv"), 3, "none.csv: cannot be read"),
        (("--flight", "none.h5"), 7, "there is no checkpoint none.h5"),
        (("--aircraft", "edge540"), 2, "two aircraft have one name, edge540"),
        (("--wind-speed-error", "-1"), 2, "the errors of a wind"),
        (("--output", "run.h5"), 2, "run.h5"),
        (("--set", "settings.search=thorough"), 2, "settings.search"),
    ],
)
def test_bad_calls_end_with_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], code: int, told: str
) -> None:
    monkeypatch.chdir(tmp_path)
    course().save("run.h5")
    said = run_command("handicap", "run.h5", *words, "--quiet")
    assert (said.code, told in said.err) == (code, True), (said.code, said.err)
    assert "Traceback" not in said.err
