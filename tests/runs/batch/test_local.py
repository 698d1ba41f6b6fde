"""Processes of this machine: whatever one of them does touches it alone, and none is left behind."""

import json
import os
import signal
import threading
import time
from concurrent.futures import Future
from dataclasses import asdict
from pathlib import Path

import pytest
from batch_examples import STAND_IN, Watched, ending, flown, job, plan_of, planned, policy, starts, step, write_course
from waiting import text_of, wait_until_gone

from airrace.errors import ClusterError, StorageError
from airrace.runs.batch import supervision
from airrace.runs.batch.jobs import Job
from airrace.runs.batch.local import JOB_COMMAND, LocalPool
from airrace.runs.batch.planning import BatchPlan, JobResult
from airrace.runs.batch.record import Repeat, read_record
from airrace.runs.batch.supervision import AttemptResult, JobPool, supervise
from airrace.runs.command_result import ExitCode
from airrace.runtime.process import spawn_detached

linux_only = pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="finds processes through /proc")


def fly(folder: Path, notes: str, timeout: float | None = None) -> AttemptResult:
    """One attempt at a job that behaves in a certain way."""
    with LocalPool(STAND_IN, 1) as pool:
        return pool.submit(job(overrides=(f"notes={notes}",)), folder / "oval.h5", timeout).result()


@pytest.mark.parametrize(
    ("notes", "timeout", "code", "message"),
    [
        ("fine", None, 0, ""),
        ("infeasible", None, 4, "point-mass: the course is infeasible"),
        ("crash", None, 8, "its process crashed (SIGABRT)"),
        ("exit", None, 8, "its process crashed (exit code 3): the last words"),
        ("astray", None, 8, "its process crashed (exit code 0)"),  # nonsense is no answer
        ("killed", None, 8, "its process was killed (out of memory?)"),
        ("hang", 0.5, 6, "stopped after 0.5 s (--timeout)"),
    ],
)
def test_an_attempt_ends_with_its_answer_or_with_why_there_is_none(
    notes: str, timeout: float | None, code: int, message: str, tmp_path: Path
) -> None:
    ended = fly(tmp_path, notes, timeout)
    assert (ended.code, ended.message) == (code, message)
    if notes == "fine":
        assert ended.run is not None
        assert ended.run["race_time_s"] == 10.0


@linux_only
@pytest.mark.slow
def test_a_process_that_does_not_listen_is_killed_with_its_family(tmp_path: Path) -> None:
    ended = fly(tmp_path, "deaf", timeout=5.0)
    assert ended.code == ExitCode.TIMEOUT
    wait_until_gone(int((tmp_path / "oval.child").read_text()))


def test_a_command_that_cannot_be_started_is_an_ending(tmp_path: Path) -> None:
    with LocalPool(["/nowhere/python"], 1) as pool:
        ended = pool.submit(job(), tmp_path / "oval.h5", None).result()
    assert ended.code == ExitCode.SYSTEM
    assert "could not be started" in ended.message


@linux_only
def test_nothing_is_left_running_when_the_pool_is_left(tmp_path: Path) -> None:
    with LocalPool(STAND_IN, 2) as pool:
        for name in ("a", "b"):
            pool.submit(job(name, overrides=("notes=deaf",)), tmp_path / f"{name}.h5", None)
        family = [int(text_of(tmp_path / f"{name}.child")) for name in ("a", "b")]
        family += [int(text_of(tmp_path / f"{name}.starts").split()[0]) for name in ("a", "b")]
    wait_until_gone(*family)


def test_job_ends_when_nobody_is_left_to_hear_its_answer(tmp_path: Path) -> None:
    process = spawn_detached(JOB_COMMAND)
    assert process.stdin is not None
    plan = planned(write_course(tmp_path), folder=tmp_path)
    order = {"job": asdict(plan.steps[0].job), "checkpoint": str(tmp_path / "oval.h5")}
    process.stdin.write(json.dumps(order).encode() + b"\n")
    out, _ = process.communicate(timeout=30.0)  # which closes its standard input
    assert process.returncode == ExitCode.INTERRUPTED
    assert b"ended" not in out


def test_jobs_that_are_stopped_say_so(tmp_path: Path) -> None:
    with LocalPool(STAND_IN, 2) as pool:
        futures = [
            pool.submit(job(name, overrides=("notes=hang",)), tmp_path / f"{name}.h5", None) for name in ("a", "b")
        ]
        for name in ("a", "b"):
            text_of(tmp_path / f"{name}.starts")
        pool.stop_asked.set()
        assert [future.result().code for future in futures] == [130, 130]


def test_a_retry_goes_on_from_the_jobs_own_checkpoint(tmp_path: Path) -> None:
    plan = planned(write_course(tmp_path), folder=tmp_path, overrides=("notes=crash-once",))
    (result,) = flown(plan)
    assert result.code == 0
    assert result.retries == ("its process crashed (SIGABRT)",)
    assert starts(tmp_path, "oval") == ["new", "resumed"]


def test_a_second_call_goes_on_where_the_first_ran_out_of_time_and_a_third_has_nothing_to_do(tmp_path: Path) -> None:
    def plan() -> BatchPlan:
        return planned(write_course(tmp_path), folder=tmp_path, overrides=("notes=hang-once",))

    assert flown(plan(), policy(timeout=5.0))[0].code == 6
    assert flown(plan(), policy(timeout=300.0))[0].code == 0
    assert flown(plan(), policy(timeout=300.0))[0].code == 0
    assert starts(tmp_path, "oval") == ["new", "resumed"]


@pytest.mark.usefixtures("impatient")
def test_whatever_one_job_does_the_others_are_flown(tmp_path: Path) -> None:
    manners = ["fine", "crash", "infeasible", "killed", "exit", "hang", "not-certified", "slow", "no-checkpoint"]
    plan = planned(write_course(tmp_path), folder=tmp_path, sweeps=[f"notes={','.join(manners)}"])
    results = flown(plan, policy(timeout=60.0), slots=3)
    assert [result.code for result in results] == [0, 8, 4, 8, 8, 6, 5, 0, 8]
    again = planned(write_course(tmp_path), folder=tmp_path, sweeps=[f"notes={','.join(manners)}"])
    kept = {step.swept[0][1] for step in again.steps if step.action == "keep"}
    assert kept == {"fine", "infeasible", "not-certified", "slow"}
    reasons = {step.swept[0][1]: step.reason for step in again.steps if step.action == "fly"}
    assert reasons["crash"] == "it failed: its process crashed (SIGABRT)"
    assert reasons["hang"] == "it failed: stopped after 0.5 s (--timeout)"


def test_a_forced_job_begins_anew(tmp_path: Path) -> None:
    course = write_course(tmp_path)
    flown(planned(course, folder=tmp_path))
    flown(planned(course, folder=tmp_path, repeat=Repeat.ALL), policy(force=True))
    assert starts(tmp_path, "oval") == ["new", "new"]


@pytest.mark.slow
def test_three_hundred_jobs_of_which_some_are_killed_are_all_accounted_for_and_never_repeated(tmp_path: Path) -> None:
    course = write_course(tmp_path)
    sweeps = [f"rules.n_z_max=8:{8 + 0.01 * 299:.2f}:0.01"]
    plan = planned(course, folder=tmp_path, sweeps=sweeps, overrides=("notes=slow",))
    assert len(plan.steps) == 300
    killed: set[str] = set()
    sizes: list[int] = []

    class Killing(LocalPool):
        begun = 0

        def submit(self, job: Job, checkpoint: Path, timeout: float | None) -> "Future[AttemptResult]":
            future = super().submit(job, checkpoint, timeout)
            self.begun += 1
            sizes.append(resident())
            if self.begun % 20 == 0:  # 5 %
                os.kill(int(text_of(checkpoint.with_suffix(".starts")).split()[-2]), signal.SIGKILL)
                killed.add(job.name)
            return future

    results = flown(plan, pool=Killing(STAND_IN, 4))
    assert [result.code for result in results] == [0] * 300
    assert {step.name for step, result in zip(plan.steps, results, strict=True) if result.retries} == killed
    assert len(killed) >= 15
    for planned_job in plan.steps:
        assert len(starts(tmp_path, planned_job.name)) == (2 if planned_job.name in killed else 1)
        record = read_record(tmp_path, planned_job.name)
        assert record is not None
        assert record.ended
    assert max(sizes[100:]) - sizes[50] < 4 * 2**20
    again = planned(course, folder=tmp_path, sweeps=sweeps, overrides=("notes=slow",))
    assert {step.action for step in again.steps} == {"keep"}


def resident() -> int:
    """Memory of this process, bytes (Linux; elsewhere 0)."""
    status = Path("/proc/self/statm")
    return int(status.read_text().split()[1]) * os.sysconf("SC_PAGESIZE") if status.exists() else 0


CRASH = AttemptResult(8, "its process crashed (SIGSEGV)", 0.5)


class Scripted(JobPool):
    """Ends every job as its script says, and jobs that are to wait when it is stopped."""

    def __init__(self, script: dict[str, list[AttemptResult]], slots: int = 2, waiting: tuple[str, ...] = ()) -> None:
        super().__init__()
        self.script = script
        self.begun: list[str] = []
        self.most = 0
        self._slots, self._waiting, self._under_way, self._lock = slots, waiting, 0, threading.Lock()

    @property
    def slots(self) -> int:
        return self._slots

    def run(self, job: Job, checkpoint: Path, timeout: float | None) -> AttemptResult:
        with self._lock:
            self.begun.append(job.name)
            self._under_way += 1
            self.most = max(self.most, self._under_way)
        time.sleep(0.02)
        with self._lock:
            self._under_way -= 1
        if job.name in self._waiting:
            self.stop_asked.wait()
            return AttemptResult(130, "interrupted", 0.5)
        answer = self.script.get(job.name, [ending()]).pop(0)
        if answer.run is not None:
            checkpoint.write_bytes(b"flown")
        return answer


def test_results_come_in_the_order_of_the_plan_and_no_more_run_than_there_are_slots(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, *(job(f"j{number}") for number in range(7)))
    pool = Scripted({"j3": [ending(4, None, "infeasible")]}, slots=3)
    results = flown(plan, pool=pool)
    assert [result.code for result in results] == [0, 0, 0, 4, 0, 0, 0]
    assert 1 < pool.most <= 3


@pytest.mark.parametrize("retries", [0, 1, 3])
@pytest.mark.parametrize("accident", [CRASH, ending(8, None, "the solver process died")])
def test_an_accident_is_tried_again_as_often_as_is_allowed_and_its_reasons_kept(
    accident: AttemptResult, retries: int, tmp_path: Path
) -> None:
    pool = Scripted({"oval": [accident] * 9})
    (result,) = flown(plan_of(tmp_path, job()), policy(retries=retries), pool)
    assert result.code == 8
    assert len(pool.begun) == retries + 1
    assert result.retries == (accident.message,) * retries
    record = read_record(tmp_path, "oval")
    assert record is not None
    assert record.retries == result.retries
    (result,) = flown(plan_of(tmp_path, job("other")), pool=Scripted({"other": [accident, ending()]}))
    assert (result.code, result.retries) == (0, (accident.message,))


@pytest.mark.parametrize(
    "answer",
    [
        ending(4, None, "infeasible"),
        ending(5, 10.0, "not certified"),
        ending(3, None, "not valid"),
        ending(1, None, "a bug"),
        AttemptResult(6, "stopped after 1 s", 1.0),
    ],
)
def test_an_honest_answer_is_not_asked_for_again(answer: AttemptResult, tmp_path: Path) -> None:
    pool = Scripted({"oval": [answer]})
    (result,) = flown(plan_of(tmp_path, job()), pool=pool)
    assert result.code == answer.code
    assert len(pool.begun) == 1


def test_jobs_under_way_and_jobs_not_begun_are_interrupted_and_finished_ones_kept(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, *(job(f"j{number}") for number in range(5)))
    watched = Watched()
    with Scripted({}, waiting=("j1", "j2")) as pool:
        results = supervise(
            plan, pool, policy(), watched, stop_asked=lambda: any("ended 0" in line for line in watched.lines)
        )
    assert [result.code for result in results] == [0, 130, 130, 130, 130]
    assert "j3" not in pool.begun
    records = [read_record(tmp_path, f"j{number}") for number in range(5)]
    assert records[0] is not None
    assert records[0].code == 0
    assert records[4] is None


def test_what_is_kept_is_not_flown(tmp_path: Path) -> None:
    pool = Scripted({})
    plan = BatchPlan(tmp_path, (step(job("old"), result=JobResult(0, race_time=9.0), reason=""), step(job("new"))))
    results = flown(plan, pool=pool)
    assert pool.begun == ["new"]
    assert results[0].race_time == 9.0


def test_a_pool_may_have_no_room_for_a_while_and_report_of_jobs_that_have_ended(tmp_path: Path) -> None:
    class Later(Scripted):
        asked = 0

        @property
        def slots(self) -> int:
            self.asked += 1
            return int(self.asked > 3)

    pool = Later({})
    pool.progress.put(("stranger", {"stage_started": "point-mass"}))
    (result,) = flown(plan_of(tmp_path, job()), pool=pool)
    assert result.code == 0


def test_jobs_that_nothing_can_run_any_more_end_with_the_reason(tmp_path: Path) -> None:
    class Broken(Scripted):
        @property
        def slots(self) -> int:
            if self.begun:
                raise ClusterError("no worker")
            return 1

    results = flown(plan_of(tmp_path, job("a"), job("b")), pool=Broken({}, waiting=("a",)))
    assert [(result.code, result.message) for result in results] == [(8, "no worker")] * 2


def test_success_without_a_checkpoint_is_no_success(tmp_path: Path) -> None:
    class Forgetful(Scripted):
        def run(self, job: Job, checkpoint: Path, timeout: float | None) -> AttemptResult:
            return ending()

    (result,) = flown(plan_of(tmp_path, job()), pool=Forgetful({}))
    assert (result.code, result.message) == (8, "its checkpoint is missing")


def test_a_disk_that_takes_no_records_costs_no_other_job(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write = supervision.write_record

    def refuse_one(folder: Path, name: str, record: object) -> None:
        if name == "full":
            raise StorageError("cannot write full.json: No space left on device")
        write(folder, name, record)  # type: ignore[arg-type]

    monkeypatch.setattr(supervision, "write_record", refuse_one)
    results = flown(plan_of(tmp_path, job("full"), job("fine")), pool=Scripted({}))
    assert [result.code for result in results] == [8, 0]
    assert "No space left" in results[0].message
