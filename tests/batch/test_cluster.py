"""Jobs on a real scheduler and real workers, on loopback: they are flown as on one machine."""

import logging
import os
import time
from pathlib import Path

import pytest

pytest.importorskip("distributed")

from batch_examples import flown, job
from cluster_examples import await_slots, endings, executor_of, heard, plan_with
from cluster_log import Log
from clusters import Cluster
from stand_in_job import CHECKPOINT
from waiting import alive, wait_until

from airrace.batch.executor import Attempt, FailureKind, StageFinished, Started
from airrace.batch.supervision import Policy

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks for processes in /proc")


def test_whatever_one_job_does_the_others_are_flown_as_on_one_machine(
    cluster: Cluster, tmp_path: Path, log: Log
) -> None:
    manners = "fine,crash,infeasible,killed,exit,hang,not-certified,slow,no-checkpoint"
    plan = plan_with(tmp_path, manners)
    results = flown(plan, Policy(timeout=10.0), executor_of(cluster, log))
    assert [result.code for result in results] == [0, 8, 4, 8, 8, 6, 5, 0, 8]
    by_manner = dict(zip(manners.split(","), results, strict=True))
    assert by_manner["crash"].message == "its process crashed (SIGABRT)"
    assert by_manner["crash"].retries == ("its process crashed (SIGABRT)",)
    assert by_manner["hang"].message == "stopped after 10 s (--timeout)"
    again = plan_with(tmp_path, manners)
    kept = {step.swept[0][1] for step in again.steps if step.action == "keep"}
    assert kept == {"fine", "infeasible", "not-certified", "slow"}


def test_checkpoints_travel_both_ways(cluster: Cluster, tmp_path: Path, log: Log) -> None:
    (result,) = flown(plan_with(tmp_path, "crash-once"), executor=executor_of(cluster, log))
    assert result.code == 0
    assert log.of("oval,notes=crash-once") == ["new", "resumed"]
    assert (tmp_path / "oval,notes=crash-once.h5").read_bytes() == CHECKPOINT
    assert os.getpid() not in log.workers("oval,notes=crash-once")


def test_a_flight_is_told_in_order_and_where_it_is(cluster: Cluster, tmp_path: Path, log: Log) -> None:
    path = tmp_path / "oval.h5"
    with executor_of(cluster, log) as executor:
        executor.submit(Attempt(job(), 1, path, None))
        events = heard(executor, endings)
    assert [type(event).__name__ for event in events] == ["Started", "StageStarted", "StageFinished", "Ended"]
    assert isinstance(events[0], Started)
    assert events[0].where.startswith("127.0.0.1:")
    assert path.read_bytes() == CHECKPOINT


def test_a_stage_that_is_not_the_last_comes_back_while_the_job_is_under_way(
    cluster: Cluster, tmp_path: Path, log: Log
) -> None:
    path = tmp_path / "oval.h5"
    with executor_of(cluster, log) as executor:
        executor.submit(Attempt(job(overrides=("notes=stage-then-hang",), until="six-dof"), 1, path, None))
        events = heard(executor, lambda events: any(isinstance(event, StageFinished) for event in events))
        assert not endings(events)
        assert path.read_bytes() == CHECKPOINT


def test_as_many_jobs_run_at_a_time_as_there_are_threads_or_as_are_asked_for(cluster: Cluster, log: Log) -> None:
    with executor_of(cluster, log) as executor:
        await_slots(executor, 3)
    with executor_of(cluster, log, slots=2) as executor:
        heard(executor, lambda _: sum(executor._threads.values()) == 3)
        assert executor.slots == 2


def test_jobs_that_are_stopped_say_so_and_leave_no_process(cluster: Cluster, tmp_path: Path, log: Log) -> None:
    with executor_of(cluster, log) as executor:
        await_slots(executor, 3)
        for name in ("a", "b", "c", "queued"):
            executor.submit(Attempt(job(name, overrides=("notes=hang-once",)), 1, tmp_path / f"{name}.h5", None))
        events = heard(executor, lambda events: sum(isinstance(event, Started) for event in events) == 3)
        wait_until(lambda: len(log.lines) == 3)
        executor.stop()
        ended = endings([*events, *executor.events(0.0)])
    assert {name: (one.code, one.fault) for name, one in ended.items()} == dict.fromkeys(
        ("a", "b", "c", "queued"), (130, FailureKind.STOPPED)
    )
    assert not any(map(alive, log.processes()))
    time.sleep(0.5)
    assert len(log.lines) == 3  # what was queued is never begun
    begun = {event.name for event in events if isinstance(event, Started)}
    assert {name for name in begun if (tmp_path / f"{name}.h5").read_bytes() == CHECKPOINT} == begun


def test_without_a_worker_jobs_end_when_the_wait_is_over_and_a_late_worker_flies_the_rest(
    tmp_path: Path, log: Log, caplog: pytest.LogCaptureFixture
) -> None:
    with Cluster(tmp_path / "cluster") as cluster:
        with caplog.at_level(logging.WARNING):
            (result,) = flown(plan_with(tmp_path, "fine"), executor=executor_of(cluster, log, wait=0.5))
        assert "waiting for one, for 0.5 s at most" in caplog.text
        assert (result.code, log.lines) == (8, [])
        assert result.message == f"no worker at {cluster.address} for 0.5 s"
        cluster.worker()
        (result,) = flown(plan_with(tmp_path, "fine"), executor=executor_of(cluster, log))
        assert result.code == 0
