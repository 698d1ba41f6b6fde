"""`airrace batch` flying real courses: as a single run would, whatever happens to its processes."""

import json
import os
import signal
import time
from pathlib import Path

import pytest
from airrace_command import HALF_CUBAN, POINT_MASS, SIXTEEN, airrace, children, inside, start, wait_for
from waiting import PATIENCE, wait_until_gone

FAST = (*POINT_MASS, "--set", "settings.guess=plan", "--set", "settings.search=off")
WIND = ("--sweep", "environment.wind.speed_kt=10", "--set", "environment.wind.from_deg=270")
# Takes a few seconds: time enough to be killed in the middle.
ALONE = ("course.laps=1", "settings.search=off")
ONE_LAP = tuple(word for setting in ALONE for word in ("--set", setting))
linux_only = pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="finds processes through /proc")


def test_a_job_finds_what_a_run_of_its_own_finds(tmp_path: Path) -> None:
    ran = airrace("batch", HALF_CUBAN, *FAST, *WIND, "--json", cwd=tmp_path)
    assert ran.code == 0
    (job,) = ran.answer["jobs"]
    single = ("--set", "environment.wind.speed_kt=10", "--set", "environment.wind.from_deg=270")
    alone = inside("optimize", HALF_CUBAN, *FAST, *single, "--threads", "1", "--json", cwd=tmp_path)
    assert job["race_time_s"] == pytest.approx(alone.race_time, rel=1e-9)
    assert job["certified"]
    assert inside("verify", job["checkpoint"], cwd=tmp_path).code == 0
    again = inside("batch", HALF_CUBAN, *FAST, *WIND, "--json", cwd=tmp_path)
    assert [job["kept"] for job in again.answer["jobs"]] == [True]  # type: ignore[attr-defined]


@pytest.mark.slow
def test_a_job_whose_limits_contradict_each_other_costs_the_others_nothing(tmp_path: Path) -> None:
    limits = ("--sweep", "rules.ceiling_m=150,1000")
    ran = airrace("batch", HALF_CUBAN, *FAST, *limits, "--json", cwd=tmp_path)
    assert ran.code == 4
    states = {job["name"]: job["state"] for job in ran.answer["jobs"]}  # type: ignore[attr-defined]
    assert states == {"half_cuban_eight,ceiling_m=150": "infeasible", "half_cuban_eight,ceiling_m=1000": "certified"}


@linux_only
@pytest.mark.parametrize("number", [signal.SIGKILL, pytest.param(signal.SIGINT, marks=pytest.mark.slow)])
def test_nothing_outlives_a_batch_that_is_ended_and_the_next_one_goes_on(
    number: signal.Signals, tmp_path: Path
) -> None:
    arguments = ("batch", SIXTEEN, *POINT_MASS, *ONE_LAP)
    with start(*arguments, cwd=tmp_path) as running:
        wait_for(running, "point-mass started")
        time.sleep(0.2)  # in the middle of the solve
        family = descendants(running.pid)
        assert len(family) >= 2  # the job and its solver
        running.send_signal(number)
        running.communicate(timeout=PATIENCE)
    assert running.returncode == (130 if number is signal.SIGINT else -number)
    wait_until_gone(*family)
    ran = airrace(*arguments, "--json", cwd=tmp_path)
    assert ran.code == 0
    assert "again (it was" in ran.err
    assert "homotopy started" not in ran.err


@linux_only
@pytest.mark.slow
def test_a_job_or_a_solver_that_is_killed_is_flown_to_its_end_by_the_next_attempt(tmp_path: Path) -> None:
    with start("batch", SIXTEEN, *POINT_MASS, *ONE_LAP, "--retries", "2", "--json", cwd=tmp_path) as running:
        wait_for(running, "point-mass started")
        time.sleep(0.2)  # in the middle of the solve
        (job,) = children(running.pid)
        (solver, *_) = children(job)
        os.kill(job, signal.SIGKILL)
        wait_until_gone(solver)
        wait_for(running, "point-mass started")
        time.sleep(0.2)  # in the middle of the solve
        (job,) = children(running.pid)
        (solver, *_) = children(job)
        os.kill(solver, signal.SIGKILL)
        out, err = running.communicate(timeout=PATIENCE)
    assert running.returncode == 0, err
    (answer,) = json.loads(out)["jobs"]
    killed, crashed = answer["retries"]
    assert killed == "its process was killed (out of memory?)"
    assert "status -9" in crashed
    assert "out of memory?" in crashed
    assert answer["certified"]


@pytest.mark.slow
def test_a_damaged_checkpoint_is_noticed_and_flown_again(tmp_path: Path) -> None:
    arguments = ("batch", HALF_CUBAN, *FAST, "--json")
    before = airrace(*arguments, cwd=tmp_path).answer["jobs"][0]
    path = tmp_path / before["checkpoint"]
    path.write_bytes(path.read_bytes()[:-100])
    ran = airrace(*arguments, cwd=tmp_path)
    (after,) = ran.answer["jobs"]
    assert ran.code == 0
    assert after["reason"].startswith("its checkpoint has changed")
    assert after["race_time_s"] == pytest.approx(before["race_time_s"], rel=1e-9)


@pytest.mark.slow
def test_a_further_stage_is_flown_on_top_of_those_that_are_finished(tmp_path: Path) -> None:
    plan = ("--set", "settings.guess=plan", "--set", "settings.search=off")
    assert airrace("batch", HALF_CUBAN, "--until", "point-mass", *plan, cwd=tmp_path).code == 0
    ran = airrace("batch", HALF_CUBAN, "--until", "transfer-function", *plan, "--json", cwd=tmp_path)
    assert ran.code == 0
    assert "again (the last stage was point-mass and is transfer-function)" in ran.err
    assert "point-mass started" not in ran.err
    (job,) = ran.answer["jobs"]
    assert [stage["stage"] for stage in job["stages"]] == ["point-mass", "transfer-function"]


def descendants(process: int) -> list[int]:
    """All processes that a process has started, and those have."""
    processes: list[int] = []
    for child in children(process):
        processes += [child, *descendants(child)]
    return processes
