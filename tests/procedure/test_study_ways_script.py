"""The study of ways counts right what it is told, goes on where it was, and its random starts lift what they say."""

import importlib
import itertools
import json
import math
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from races import SHIPPED, prepared

from airrace.dynamics.point_mass import PointMassState
from airrace.frames import rotation
from airrace.planning.planning_model import cruise
from airrace.procedure.guess import guess
from airrace.procedure.settings import Settings

ROOT = Path(__file__).parents[2]
NAMES = ("jobs", "tables", "limits", "comparisons", "random", "draws", "ways", "flight")
COURSE = "half_cuban_eight"
Fly = Callable[[Any, float], dict[str, Any]]  # Any: a job, of a module that is imported at run time


@pytest.fixture(scope="module")
def modules() -> Iterator[dict[str, ModuleType]]:
    """The script and its neighbours, by the second word of their names."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "scripts"))
        yield {name: importlib.import_module(f"study_{name}") for name in NAMES}
        for name in (*(f"study_{name}" for name in NAMES), "survey_courses"):
            sys.modules.pop(name, None)


@pytest.fixture
def canned(modules: dict[str, ModuleType], monkeypatch: pytest.MonkeyPatch) -> Callable[[Fly], list[Any]]:
    """Flights that are told instead of flown; hands out the list of what was asked for."""

    def tell(fly: Fly) -> list[Any]:
        asked: list[Any] = []

        def flown(job: Any, timeout: float) -> dict[str, Any]:
            asked.append(job)
            return fly(job, timeout)

        monkeypatch.setattr(modules["jobs"], "flown", flown)
        return asked

    return tell


def record(race_time: float | None, outcome: str = "certified", **more: Any) -> dict[str, Any]:
    return {"outcome": outcome, "race_time_s": race_time, "seconds": 1.0, "message": "", **more}


def value(job: Any, key: str) -> str:
    """What a job sets a key to."""
    return {one.partition("=")[0]: one.partition("=")[2] for one in job.overrides}[key]


def series(limits: ModuleType, *records: dict[str, Any]) -> Any:
    flights = tuple(limits.Flown(str(number), one) for number, one in enumerate(records))
    return limits.Series("course", "n_z_max", flights)


def test_pairs_are_neighbours_among_certified_flights(modules: dict[str, ModuleType]) -> None:
    infeasible = record(None, "infeasible")
    found = series(modules["limits"], infeasible, record(60.0), record(59.0, "not certified"), record(58.0), infeasible)
    assert [(a.value, b.value) for a, b in found.pairs] == [("1", "3")]
    assert series(modules["limits"], infeasible, record(60.0)).pairs == []


def test_a_violation_is_a_looser_limit_that_is_slower_by_more_than_5_ms(modules: dict[str, ModuleType]) -> None:
    found = series(modules["limits"], *(record(time) for time in (60.0, 60.0049, 60.0101, 59.0, 74.0)))
    assert [(a.value, b.value) for a, b in found.violations] == [("1", "2"), ("3", "4")]


def test_limits_run_from_tight_to_loose(modules: dict[str, ModuleType]) -> None:
    limits = {one.name: one for one in modules["limits"].limits(4)}
    assert [len(one.values) for one in limits.values()] == [4] * 7
    for name, one in limits.items():
        for tight, loose in itertools.pairwise(one.values):
            wider = [b > a for a, b in zip(tight, loose, strict=True)]
            assert wider == {"climb": [False, True], "clearance": [False]}.get(name, [True])
    (given,) = modules["limits"].limits(4, ["climb=-5:10,-45:45"])
    assert given.overrides(given.values[0]) == ("gate_defaults.climb_min_deg=-5", "gate_defaults.climb_max_deg=10")
    for wrong in ("height", "n_z_max=x", "climb=5,10"):
        with pytest.raises(ValueError, match=r"height|'x'|2 number"):
            modules["limits"].limits(4, [wrong])


def test_a_sweep_counts_and_lists_what_it_was_told(
    modules: dict[str, ModuleType], canned: Callable[[Fly], list[Any]], capsys: pytest.CaptureFixture[str]
) -> None:
    times = {"8": 9.0, "9": 8.5, "10": 8.6, "11": None}
    asked = canned(
        lambda job, _: record(time := times[value(job, "rules.n_z_max")], "certified" if time else "infeasible")
    )
    assert modules["ways"].main([COURSE, "--only", "n_z_max=8,9,10,11", "--only", "crossing"]) == 1
    printed = capsys.readouterr().out
    assert len(asked) == 4
    assert f"skipped: crossing on {COURSE}: changes nothing there" in printed
    assert "| all | 1 | 4 | 3 | 2 | 1 | 50.0 % |" in printed
    assert f"| {COURSE} | n_z_max | 9 | 8.500 | 10 | 8.600 | +0.100 |" in printed
    assert f"| {COURSE} | n_z_max | 11 | infeasible |  |" in printed
    assert "FAILS: at most 1% of the pairs are slower by more than 5 ms: 1 of 2" in printed


def test_a_limit_that_nobody_feels_is_not_swept(
    modules: dict[str, ModuleType], canned: Callable[[Fly], list[Any]], capsys: pytest.CaptureFixture[str]
) -> None:
    asked = canned(lambda *_: record(8.0))
    command = ["sixteen_phases", "--only", "n_z_max=8,12,13", "--only", "bank_tolerance", "--only", "clearance=3,1"]
    assert modules["ways"].main(command) == 0
    assert [value(job, "rules.n_z_max") for job in asked] == ["8", "12"]  # the aircraft's own limit is 12 g
    printed = capsys.readouterr().out
    assert "skipped: bank_tolerance on sixteen_phases: changes nothing there" in printed
    asked = canned(lambda *_: record(8.0))
    assert modules["ways"].main(["rovinj_2014", "--only", "clearance=9,1,0.5"]) == 0
    assert [value(job, "gate_defaults.clearance_m") for job in asked] == ["1", "0.5"]
    assert "skipped: clearance of 9 on rovinj_2014: a width of 13 m" in capsys.readouterr().out


def test_an_interrupted_study_goes_on_where_it_was(
    modules: dict[str, ModuleType], canned: Callable[[Fly], list[Any]], tmp_path: Path
) -> None:
    def interrupted(job: Any, _: float) -> dict[str, Any]:
        if value(job, "rules.n_z_max") == "10":
            raise KeyboardInterrupt
        return record(8.0, "died" if value(job, "rules.n_z_max") == "9" else "certified")

    file, command = tmp_path / "study.jsonl", [COURSE, "--only", "n_z_max=8,9,10,11"]
    canned(interrupted)
    assert modules["ways"].main([*command, "--output", str(file)]) == 130
    file.write_text(file.read_text(encoding="utf-8") + '{"job": "cut sho', encoding="utf-8")
    kept = len(modules["jobs"].Log(file).records)
    assert 1 <= kept <= 2  # 8, perhaps 11; what died is tried again
    asked = canned(lambda *_: record(8.0))
    assert modules["ways"].main([*command, "--output", str(file)]) == 0
    assert {"9", "10"} <= {value(job, "rules.n_z_max") for job in asked}
    assert len(asked) == 4 - kept
    asked = canned(lambda *_: record(8.0))
    assert modules["ways"].main([*command, "--output", str(file)]) == 0
    assert asked == []


def test_rows_of_the_case_are_held_against_all_rows_with_tighter_limits(
    modules: dict[str, ModuleType], canned: Callable[[Fly], list[Any]], capsys: pytest.CaptureFixture[str]
) -> None:
    caps = "aircraft.envelope.speed_max_m_s"

    def as_it_was(job: Any, _: float) -> dict[str, Any]:
        if any(one.startswith(caps) for one in job.overrides):
            return record(58.91)
        wrong = value(job, "rules.n_z_max") in ("8", "8.5") and value(job, "settings.guess") == "plan"
        return record(74.5 if wrong else 54.3)

    asked = canned(as_it_was)
    assert modules["ways"].main(["--case"]) == 1
    printed = capsys.readouterr().out
    assert len(asked) == len(set(asked)) == 14
    assert "| 8 g, homotopy | 54.300 | 8.5 g, plan | 74.500 |" in printed
    assert "| 8 g, 86 m/s, plan | 58.910 | 8 g, plan | 74.500 |" in printed
    assert "| 8.5 g, plan | 74.500 | 8 g" not in printed
    assert printed.count("FAILS") == 2
    canned(lambda *_: record(54.3))
    assert modules["ways"].main(["--case"]) == 0


def test_images_of_a_course_must_take_as_long_and_go_the_mirrored_way(
    modules: dict[str, ModuleType], canned: Callable[[Fly], list[Any]], capsys: pytest.CaptureFixture[str]
) -> None:
    def told(side: str) -> list[dict[str, Any]]:
        return [
            {"way": f"over the top to the {side}", "race_time_s": 8.0},
            {"way": "flat", "race_time_s": 9.0},
            {"way": "lost", "race_time_s": None},
        ]

    canned(lambda job, _: record(8.0, ways=told("left" if job.change == "mirrored" else "right")))
    assert modules["ways"].main(["--symmetry", COURSE, "--wind", "8"]) == 0
    assert "8 m/s from 200°" in capsys.readouterr().out
    canned(lambda job, _: record(8.006 if job.change == "moved" else 8.0, ways=told("right")))
    assert modules["ways"].main(["--symmetry", COURSE]) == 1
    assert capsys.readouterr().out.count("FAILS") == 2


def test_exploring_is_held_against_the_best_refined_start(
    modules: dict[str, ModuleType], canned: Callable[[Fly], list[Any]], capsys: pytest.CaptureFixture[str]
) -> None:
    def fly(job: Any, _: float) -> dict[str, Any]:
        if job.starts:  # every third is lost, the others are the faster the later
            rows = [
                {"number": one, "race_time_s": None if one % 3 == 0 else 60.0 - 0.01 * one, "seconds": 0.5}
                for one in job.starts
            ]
            return record(None, "solved", starts=rows)
        if job.refine is not None:
            return record(60.0 + 0.01 * job.refine)
        return record({"off": 61.0, "quick": 60.12, "thorough": 60.104}[job.search])

    asked = canned(fly)
    assert modules["ways"].main(["--random", "25", COURSE]) == 0
    assert [len(job.starts) for job in asked if job.starts] == [10, 10, 5]
    refined = [job.refine for job in asked if job.refine is not None]
    assert sorted(refined) == [10, 11, 13, 14, 16, 17, 19, 20, 22, 23]
    cells = "| 59.770 | 60.100 | 16 of 25 | 22 | 61.000 | 60.120 | 60.104 | +0.020 | +0.004 |"
    assert cells in capsys.readouterr().out
    canned(lambda job, timeout: fly(job, timeout) if job.search != "thorough" else record(60.106))
    assert modules["ways"].main(["--random", "25", COURSE]) == 1


def test_exploring_that_is_slower_or_loses_the_certificate_is_told(
    modules: dict[str, ModuleType], canned: Callable[[Fly], list[Any]], capsys: pytest.CaptureFixture[str]
) -> None:
    ways = [{"way": "flat", "race_time_s": 7.9}]
    canned(lambda job, _: record(8.0 if job.search == "off" else 7.9, ways=ways))
    assert modules["ways"].main(["--found", COURSE]) == 0
    assert f"| {COURSE} | 8.000 | 7.900 | -0.100 | flat | 0.0 | 0.00 |" in capsys.readouterr().out
    assert modules["ways"].main(["--seeds", "2"]) == 0
    canned(lambda job, _: record(8.0) if job.search == "off" else record(None, "infeasible"))
    assert modules["ways"].main(["--seeds", "2"]) == 1
    assert "but seed 0, seed 1; 0 of 2 are faster" in capsys.readouterr().out
    canned(lambda job, _: record(8.0 if job.search == "off" else 8.006))
    assert modules["ways"].main(["--found", COURSE]) == 1


def test_what_cannot_be_studied_is_refused(modules: dict[str, ModuleType], capsys: pytest.CaptureFixture[str]) -> None:
    for wrong in (["nowhere"], ["--only", "height"], ["--points", "1"], ["--wind", "x"], ["--case", "--found"]):
        with pytest.raises(SystemExit) as ended:
            modules["ways"].main(wrong)
        assert ended.value.code == 2
        assert "error:" in capsys.readouterr().err


@pytest.mark.slow
def test_a_job_is_flown_in_a_process_and_one_that_takes_too_long_is_stopped(modules: dict[str, ModuleType]) -> None:
    jobs = modules["jobs"]
    flight = jobs.Job(COURSE, ("settings.guess=plan", "settings.search=off"), change="mirrored")
    flown = jobs.flown(flight, 300.0)
    assert (flown["outcome"], flown["message"]) == ("certified", "")
    assert flown["race_time_s"] == pytest.approx(8.634, abs=0.005)
    refused = jobs.flown(jobs.Job(COURSE, ("rules.n_z=8",)), 300.0)
    assert refused["outcome"] == "refused"
    assert "n_z" in refused["message"]
    assert jobs.flown(flight, 0.1)["outcome"] == "out of time"


def test_a_job_is_read_as_it_was_written(modules: dict[str, ModuleType]) -> None:
    job = modules["jobs"].Job("seed 3", ("rules.n_z_max=8",), "quick", "moved", (1, 2), 4, 2)
    assert modules["jobs"].Job.read(job.key) == job
    assert json.loads(job.key)["course"] == "seed 3"


def test_a_pace_has_the_radius_and_the_speed_asked_for(modules: dict[str, ModuleType]) -> None:
    race = SHIPPED["rovinj_2014"]
    usual = cruise(race.aircraft, race.course.rules)
    chosen = modules["draws"].pace(usual, 0.4, 0.9)
    assert pytest.approx(0.9 * usual.V) == chosen.V
    assert chosen.radius == pytest.approx(0.4 * usual.radius)


def test_random_starts_are_the_same_by_name_and_differ_between_names(modules: dict[str, ModuleType]) -> None:
    race = SHIPPED["rovinj_2014"]
    flight = prepared(race)
    one, again, other = (
        modules["draws"].drawn(flight, race, Settings(), name)[2].state for name in ("a 0", "a 0", "a 1")
    )
    np.testing.assert_array_equal(one, again)
    assert one.shape != other.shape or not np.array_equal(one, other)


def test_a_lift_rises_in_the_turn_alone_and_the_attitude_follows_it(modules: dict[str, ModuleType]) -> None:
    race, draws = SHIPPED["rovinj_2014"], modules["draws"]
    flight = prepared(race)
    legs = flight.plan.legs
    (number, *_) = [index for index, leg in enumerate(legs) if draws.is_long(leg)]
    path = legs[number].path
    mesh = [(1.0 / 400,) * 400] * len(legs)
    planned = guess(flight.plan, mesh).state
    flat = planned[:, 400 * number : 400 * (number + 1) + 1]
    lifted = flat.copy()
    draws.lift(lifted, legs[number], 80.0)
    before, after = PointMassState[np.ndarray].split(flat), PointMassState[np.ndarray].split(lifted)
    rise = before.z - after.z
    assert rise[[0, -1]] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert rise.max() == pytest.approx(80.0, rel=1e-3)
    assert rise.min() >= 0.0
    s = np.linspace(0.0, path.length, 401)
    straight = np.abs(path.curvature(0.5 * (s[1:] + s[:-1]))) < 1e-9
    assert np.abs(np.diff(rise)[straight]).max(initial=0.0) < 1.0
    turning = np.flatnonzero(~straight)[5:-5]
    for node in turning[::20]:
        R = rotation([float(one[node]) for one in (after.q0, after.q1, after.q2, after.q3)])
        slope = (rise[node + 1] - rise[node - 1]) / (s[2] - s[0])
        assert -R[2][0] / math.hypot(R[0][0], R[1][0]) == pytest.approx(slope, abs=0.05)
    others = [name for name in PointMassState.names() if name not in ("z", "q0", "q1", "q2", "q3")]
    for name in others:
        np.testing.assert_array_equal(getattr(before, name), getattr(after, name))
