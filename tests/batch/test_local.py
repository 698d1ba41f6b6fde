"""Processes of this machine: whatever one of them does touches it alone, and none is left behind."""

import json
import os
import signal
from pathlib import Path

import pytest
from batch_examples import STAND_IN, flown, job, planned, starts, write_course
from waiting import text_of, wait_until, wait_until_gone

from airrace.batch.executor import Attempt, AttemptResult, Ended, FailureKind
from airrace.batch.local import LocalExecutor
from airrace.batch.plan import BatchPlan
from airrace.batch.process import JOB_COMMAND
from airrace.batch.record import Choice, read_record
from airrace.batch.supervision import Policy
from airrace.process import started_apart
from airrace.runs.command_result import ExitCode

linux_only = pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="finds processes through /proc")


def fly(folder: Path, notes: str, timeout: float | None = None) -> AttemptResult:
    """One attempt at a job that behaves in a certain way."""
    order = Attempt(job(overrides=(f"notes={notes}",)), 1, folder / "oval.h5", timeout)
    with LocalExecutor(STAND_IN, 1) as executor:
        executor.submit(order)
        return wait_for_end(executor)


def wait_for_end(executor: LocalExecutor) -> AttemptResult:
    return wait_until(lambda: [event.ending for event in executor.events(1.0) if isinstance(event, Ended)])[0]


def test_an_answer_comes_with_its_run(tmp_path: Path) -> None:
    ended = fly(tmp_path, "fine")
    assert (ended.code, ended.fault, ended.message) == (0, FailureKind.NONE, "")
    assert ended.run is not None
    assert ended.run["race_time_s"] == 10.0


def test_an_infeasible_course_is_an_answer(tmp_path: Path) -> None:
    ended = fly(tmp_path, "infeasible")
    assert (ended.code, ended.fault) == (4, FailureKind.NONE)


def test_a_crash_is_told_with_its_signal(tmp_path: Path) -> None:
    ended = fly(tmp_path, "crash")
    assert (ended.code, ended.fault, ended.message) == (8, FailureKind.CRASHED, "its process crashed (SIGABRT)")


def test_a_process_that_ends_without_an_answer_is_told_with_its_last_words(tmp_path: Path) -> None:
    ended = fly(tmp_path, "exit")
    assert (ended.code, ended.fault) == (8, FailureKind.CRASHED)
    assert ended.message == "its process crashed (exit code 3): the last words"


def test_a_process_that_talks_nonsense_has_not_answered(tmp_path: Path) -> None:
    ended = fly(tmp_path, "astray")
    assert (ended.code, ended.fault, ended.message) == (8, FailureKind.CRASHED, "its process crashed (exit code 0)")


def test_a_killed_process_is_suspected_to_have_used_up_the_memory(tmp_path: Path) -> None:
    ended = fly(tmp_path, "killed")
    assert (ended.code, ended.fault, ended.message) == (
        8,
        FailureKind.KILLED,
        "its process was killed (out of memory?)",
    )


def test_a_killed_solver_is_suspected_likewise(tmp_path: Path) -> None:
    assert fly(tmp_path, "solver-killed").message == "the solver process died (status -9) (out of memory?)"


def test_a_hang_is_stopped_when_its_time_is_up(tmp_path: Path) -> None:
    ended = fly(tmp_path, "hang", timeout=0.5)
    assert (ended.code, ended.fault, ended.message) == (6, FailureKind.TIMED_OUT, "stopped after 0.5 s (--timeout)")


@linux_only
def test_a_process_that_does_not_listen_is_killed_with_its_family(tmp_path: Path) -> None:
    ended = fly(tmp_path, "deaf", timeout=5.0)
    assert ended.fault is FailureKind.TIMED_OUT
    wait_until_gone(int((tmp_path / "oval.child").read_text()))


def test_a_command_that_cannot_be_started_is_an_ending(tmp_path: Path) -> None:
    with LocalExecutor(["/nowhere/python"], 1) as executor:
        executor.submit(Attempt(job(), 1, tmp_path / "oval.h5", None))
        ended = wait_for_end(executor)
    assert (ended.code, ended.fault) == (8, FailureKind.CRASHED)
    assert "could not be started" in ended.message


@linux_only
def test_nothing_is_left_running_when_the_executor_is_left(tmp_path: Path) -> None:
    with LocalExecutor(STAND_IN, 2) as executor:
        for name in ("a", "b"):
            executor.submit(Attempt(job(name, overrides=("notes=deaf",)), 1, tmp_path / f"{name}.h5", None))
        family = [int(text_of(tmp_path / f"{name}.child")) for name in ("a", "b")]
        family += [int(text_of(tmp_path / f"{name}.starts").split()[0]) for name in ("a", "b")]
    wait_until_gone(*family)


def test_job_ends_when_nobody_is_left_to_hear_its_answer(tmp_path: Path) -> None:
    process = started_apart(JOB_COMMAND)
    assert process.stdin is not None
    plan = planned(write_course(tmp_path), folder=tmp_path)
    order = {"job": plan.steps[0].job.as_object(), "checkpoint": str(tmp_path / "oval.h5")}
    process.stdin.write(json.dumps(order).encode() + b"\n")
    out, _ = process.communicate(timeout=30.0)  # which closes its standard input
    assert process.returncode == ExitCode.INTERRUPTED
    assert b"ended" not in out


def test_jobs_that_are_stopped_say_so(tmp_path: Path) -> None:
    with LocalExecutor(STAND_IN, 2) as executor:
        for name in ("a", "b"):
            executor.submit(Attempt(job(name, overrides=("notes=hang",)), 1, tmp_path / f"{name}.h5", None))
            text_of(tmp_path / f"{name}.starts")
        executor.stop()
        endings = {event.name: event.ending for event in executor.events(0.0) if isinstance(event, Ended)}
    assert {name: (one.code, one.fault) for name, one in endings.items()} == {
        "a": (130, FailureKind.STOPPED),
        "b": (130, FailureKind.STOPPED),
    }


def test_a_retry_goes_on_from_the_jobs_own_checkpoint(tmp_path: Path) -> None:
    plan = planned(write_course(tmp_path), folder=tmp_path, overrides=("notes=crash-once",))
    (result,) = flown(plan)
    assert result.code == 0
    assert result.retries == ("its process crashed (SIGABRT)",)
    assert starts(tmp_path, "oval") == ["new", "resumed"]


def test_a_second_call_goes_on_where_the_first_ran_out_of_time_and_a_third_has_nothing_to_do(tmp_path: Path) -> None:
    def plan() -> BatchPlan:
        return planned(write_course(tmp_path), folder=tmp_path, overrides=("notes=hang-once",))

    assert flown(plan(), Policy(timeout=5.0))[0].code == 6
    assert flown(plan(), Policy(timeout=300.0))[0].code == 0
    assert flown(plan(), Policy(timeout=300.0))[0].code == 0
    assert starts(tmp_path, "oval") == ["new", "resumed"]


def test_whatever_one_job_does_the_others_are_flown(tmp_path: Path) -> None:
    manners = ["fine", "crash", "infeasible", "killed", "exit", "hang", "not-certified", "slow", "no-checkpoint"]
    plan = planned(write_course(tmp_path), folder=tmp_path, sweeps=[f"notes={','.join(manners)}"])
    results = flown(plan, Policy(timeout=10.0), slots=3)
    assert [result.code for result in results] == [0, 8, 4, 8, 8, 6, 5, 0, 8]
    again = planned(write_course(tmp_path), folder=tmp_path, sweeps=[f"notes={','.join(manners)}"])
    kept = {step.swept[0][1] for step in again.steps if step.action == "keep"}
    assert kept == {"fine", "infeasible", "not-certified", "slow"}
    reasons = {step.swept[0][1]: step.reason for step in again.steps if step.action == "fly"}
    assert reasons["crash"] == "it failed: its process crashed (SIGABRT)"
    assert reasons["hang"] == "it failed: stopped after 10 s (--timeout)"


def test_a_forced_job_begins_anew(tmp_path: Path) -> None:
    course = write_course(tmp_path)
    flown(planned(course, folder=tmp_path))
    flown(planned(course, folder=tmp_path, choice=Choice.ALL), Policy(choice=Choice.ALL))
    assert starts(tmp_path, "oval") == ["new", "new"]


@pytest.mark.slow
def test_three_hundred_jobs_of_which_some_are_killed_are_all_accounted_for_and_never_repeated(tmp_path: Path) -> None:
    course = write_course(tmp_path)
    sweeps = [f"rules.n_z_max=8:{8 + 0.01 * 299:.2f}:0.01"]
    plan = planned(course, folder=tmp_path, sweeps=sweeps, overrides=("notes=slow",))
    assert len(plan.steps) == 300
    killed: set[str] = set()
    sizes: list[int] = []

    class Killing(LocalExecutor):
        begun = 0

        def submit(self, order: Attempt) -> None:
            super().submit(order)
            self.begun += 1
            sizes.append(resident())
            if self.begun % 20 == 0:  # 5 %
                os.kill(int(text_of(order.checkpoint.with_suffix(".starts")).split()[-2]), signal.SIGKILL)
                killed.add(order.job.name)

    results = flown(plan, executor=Killing(STAND_IN, 4))
    assert [result.code for result in results] == [0] * 300
    assert {step.name for step, result in zip(plan.steps, results, strict=True) if result.retries} == killed
    assert len(killed) >= 15
    for step in plan.steps:
        assert len(starts(tmp_path, step.name)) == (2 if step.name in killed else 1)
        record = read_record(tmp_path, step.name)
        assert record is not None
        assert record.ended
    assert max(sizes[100:]) - sizes[50] < 4 * 2**20
    again = planned(course, folder=tmp_path, sweeps=sweeps, overrides=("notes=slow",))
    assert {step.action for step in again.steps} == {"keep"}


def resident() -> int:
    """Memory of this process, bytes (Linux; elsewhere 0)."""
    status = Path("/proc/self/statm")
    return int(status.read_text().split()[1]) * os.sysconf("SC_PAGESIZE") if status.exists() else 0
