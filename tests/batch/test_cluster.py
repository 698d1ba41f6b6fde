"""Jobs on a real scheduler and real workers, on loopback: they are flown as on one machine."""

import hashlib
import logging
import os
import re
import signal
import socket
import time
from dataclasses import replace
from pathlib import Path

import pytest
from batch_examples import Watched, flown, job, policy
from cluster_examples import VERSIONS, await_slots, endings, executor_of, heard, plan_with, started
from cluster_log import Log
from clusters import Cluster
from stand_in_job import CHECKPOINT
from waiting import PATIENCE, alive, wait_until, wait_until_gone

from airrace.batch import cluster as cluster_module
from airrace.batch.cluster import AttemptReply, ClusterExecutor, Connection, DamagedPayload, Payload, receive_checkpoint
from airrace.batch.supervision import AttemptResult, FailureKind, JobAttempt, StageFinished, Started, supervise
from airrace.errors import ClusterError

pytest.importorskip("distributed")


pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks for processes in /proc")


@pytest.mark.slow
def test_whatever_one_job_does_the_others_are_flown_as_on_one_machine(
    cluster: Cluster, tmp_path: Path, log: Log
) -> None:
    manners = "fine,crash,infeasible,killed,exit,hang,not-certified,slow,no-checkpoint"
    plan = plan_with(tmp_path, manners)
    results = flown(plan, policy(timeout=10.0), executor_of(cluster, log))
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
        executor.submit(JobAttempt(job(), 1, path, None))
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
        executor.submit(JobAttempt(job(overrides=("notes=stage-then-hang",), until="six-dof"), 1, path, None))
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
            executor.submit(JobAttempt(job(name, overrides=("notes=hang-once",)), 1, tmp_path / f"{name}.h5", None))
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


pytest.importorskip("distributed")


def test_a_parcel_knows_whether_it_was_damaged(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"flown")
    parcel = Payload.of(tmp_path / "a")
    assert parcel is not None
    assert parcel.unpack() == b"flown"
    assert parcel.sha256 == hashlib.sha256(b"flown").hexdigest()
    with pytest.raises(DamagedPayload):
        Payload(b"flawn", parcel.sha256).unpack()
    assert Payload.of(tmp_path / "b") is None


def test_a_checkpoint_that_was_damaged_on_its_way_is_a_failed_attempt_and_not_written(tmp_path: Path) -> None:
    path = tmp_path / "oval.h5"
    path.write_bytes(b"before")
    done = AttemptResult(0, "", 1.0, run={"race_time_s": 10.0, "stages": []})
    stage = StageFinished("oval", "point-mass", "solved", 10.0, True)
    stages, ending = receive_checkpoint(
        JobAttempt(job(), 1, path, None), AttemptReply(done, (stage,), Payload(b"flawn", "0" * 64))
    )
    assert (stages, ending.code, ending.fault, ending.run) == ((), 8, FailureKind.LOST, None)
    assert ending.message.startswith("its checkpoint came back damaged on its way (sha256 ")
    assert path.read_bytes() == b"before"


pytest.importorskip("distributed")


def test_an_unreachable_scheduler_is_told_before_anything_starts(tmp_path: Path, log: Log) -> None:
    with started("tcp://127.0.0.1:9", tmp_path, log) as running:
        out, err = running.communicate(timeout=PATIENCE)
    assert (running.returncode, out) == (8, "")
    assert err.startswith("airrace: cannot reach the scheduler tcp://127.0.0.1:9: ")
    assert err.count("\n") == 1
    assert not (tmp_path / "batch").exists()


def test_tasks_are_called_off_called_upon_and_forgotten(cluster: Cluster) -> None:
    connection = Connection(cluster.address, VERSIONS)
    try:
        workers = connection.threads()
        assert sorted(workers.values()) == [1, 2]
        assert connection.call(os.path.basename, "a/b", workers=list(workers)) == dict.fromkeys(workers, "b")
        queued = [connection.submit(time.sleep, 1.0, key=f"sleep-{n}", workers=list(workers)) for n in range(6)]
        connection.client.cancel(queued)
        assert [future.status for future in queued] == ["cancelled"] * 6
        done = connection.submit(len, "abc", key="length", workers=list(workers))
        assert done.result(timeout=PATIENCE) == 3
        connection.forget(done, "length")
        wait_until(lambda: connection.submit(len, "abcd", key="length", workers=list(workers)).result(PATIENCE) == 4)
    finally:
        connection.close()


@pytest.mark.parametrize(
    ("versions", "words"),
    [
        ({"airrace": "9.9"}, "airrace"),
        ({"airrace": VERSIONS["airrace"], "numpy": "0.1"}, "has numpy "),
        ({"airrace": VERSIONS["airrace"], "an-absent-library": "1"}, "has no an-absent-library"),
    ],
)
def test_workers_with_other_versions_are_refused(cluster: Cluster, versions: dict[str, str], words: str) -> None:
    with pytest.raises(ClusterError, match=words), ClusterExecutor(cluster.address, (), versions):
        pass


@pytest.mark.parametrize("address", ["nowhere", "tcp://", "xyz://127.0.0.1:1", "tcp://no-such-host.invalid:1"])
def test_an_address_that_is_none_is_one_clear_error(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_module, "TIMES", replace(cluster_module.TIMES, connect=1.0))
    with pytest.raises(ClusterError, match="cannot reach the scheduler"), ClusterExecutor(address, (), VERSIONS):
        pass


def test_somebody_who_listens_and_is_silent_is_no_scheduler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_module, "TIMES", replace(cluster_module.TIMES, connect=1.0))
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(ClusterError, match="no answer within 1 s"), ClusterExecutor(address, (), VERSIONS):
            pass


def test_a_worker_with_other_versions_that_comes_later_gets_no_jobs(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with Cluster(tmp_path / "cluster") as cluster:
        connection = Connection(cluster.address, {**VERSIONS, "numpy": "0.1"})
        try:
            cluster.worker()
            with caplog.at_level(logging.WARNING):
                wait_until(lambda: connection.threads() == {} and caplog.records)
                assert connection.threads() == {}
            (record,) = caplog.records
            assert f"gets no jobs: it has numpy {VERSIONS['numpy']}, here is 0.1" in record.getMessage()
        finally:
            connection.close()


pytest.importorskip("distributed")


GONE = re.compile(r"its worker( 127\.0\.0\.1:\d+)? is gone")
"""The reason to try a job again; a worker that is killed before it could tell what it has begun is not named."""


def test_nothing_flies_on_when_the_executor_is_left(cluster: Cluster, tmp_path: Path, log: Log) -> None:
    with executor_of(cluster, log) as executor:
        executor.submit(JobAttempt(job(overrides=("notes=deaf",)), 1, tmp_path / "oval.h5", None))
        wait_until(lambda: log.lines)
    wait_until_gone(*log.processes())


def test_nothing_flies_on_when_the_parent_is_killed(cluster: Cluster, tmp_path: Path, log: Log) -> None:
    with started(cluster, tmp_path, log, "--set", "notes=hang") as running:
        wait_until(lambda: log.lines)
        running.kill()
        running.communicate(timeout=PATIENCE)
    wait_until_gone(*log.processes())


@pytest.mark.slow  # on one machine it goes on by the same loop
def test_an_interrupted_batch_goes_on_later(cluster: Cluster, tmp_path: Path, log: Log) -> None:
    arguments = ("--sweep", "notes=fine,hang-once", "--json")
    with started(cluster, tmp_path, log, *arguments) as running:
        wait_until(lambda: (tmp_path / "batch/oval,notes=fine.h5").exists() and len(log.lines) == 2)
        running.send_signal(signal.SIGINT)
        running.communicate(timeout=PATIENCE)
    assert running.returncode == 130
    with started(cluster, tmp_path, log, *arguments) as running:
        running.communicate(timeout=PATIENCE)
    assert running.returncode == 0
    assert log.of("oval,notes=fine") == ["new"]
    assert log.of("oval,notes=hang-once") == ["new", "resumed"]


def test_a_worker_killed_in_mid_run_loses_no_job_and_doubles_none(tmp_path: Path, log: Log) -> None:
    notes = ",".join(["stage-then-hang", *(f"fine-{number}" for number in range(20)), "slow"])
    hanging = "oval,notes=stage-then-hang"
    watched, finished_before = Watched(), list[str]()
    with Cluster(tmp_path / "cluster") as cluster:
        workers = {worker.pid: worker for worker in (cluster.worker(2), cluster.worker(2))}
        plan = plan_with(tmp_path, notes)

        def kill_in_mid_run() -> bool:
            ended = [line.split()[0] for line in watched.lines if " ended " in line]
            if not finished_before and len(ended) >= 6 and f"{hanging} homotopy solved" in watched.lines:
                finished_before.extend(ended)
                workers[log.workers(hanging)[0]].kill()
            return False

        with executor_of(cluster, log) as executor:
            await_slots(executor, 4)
            results = supervise(plan, executor, policy(), watched, stop_asked=kill_in_mid_run)
    assert [result.code for result in results] == [0] * 22
    assert len(finished_before) >= 6
    assert all(log.of(name) == ["new"] for name in finished_before)
    for step, result in zip(plan.steps, results, strict=True):
        assert watched.lines.count(f"{step.name} ended 0") == 1
        assert all(GONE.fullmatch(reason) for reason in result.retries)
        assert len(log.of(step.name)) <= 1 + len(result.retries)  # dask has begun nothing again by itself
    retried = {step.name for step, result in zip(plan.steps, results, strict=True) if result.retries}
    assert hanging in retried
    assert len(retried) <= 2  # as many as the worker has threads
    assert log.of(hanging) == ["new", "resumed"]  # behind the stage that had come back before
    assert len(set(log.workers(hanging))) == 2
    assert {step.action for step in plan_with(tmp_path, notes).steps} == {"keep"}


@pytest.mark.slow
def test_a_task_that_dask_begins_again_by_itself_is_not_flown(tmp_path: Path, log: Log) -> None:
    with Cluster(tmp_path / "cluster") as cluster:
        workers = {worker.pid: worker for worker in (cluster.worker(), cluster.worker())}
        with executor_of(cluster, log) as executor:
            await_slots(executor, 2)
            executor.submit(JobAttempt(job(overrides=("notes=hang",)), 1, tmp_path / "oval.h5", None))
            wait_until(lambda: log.lines)
            workers[log.workers("oval")[0]].kill()
            time.sleep(3.0)  # nobody looks after it, so dask moves it to the other worker
            ended = endings(heard(executor, endings))
    assert ended["oval"].fault is FailureKind.LOST
    assert log.of("oval") == ["new"]


@pytest.mark.slow
def test_a_job_ends_with_its_worker_though_no_other_could_take_it(tmp_path: Path, log: Log) -> None:
    with Cluster(tmp_path / "cluster") as cluster:
        worker = cluster.worker()
        with executor_of(cluster, log) as executor:
            await_slots(executor, 1)
            executor.submit(JobAttempt(job(overrides=("notes=hang",)), 1, tmp_path / "oval.h5", None))
            events = heard(executor, lambda events: log.lines and events)
            worker.kill()
            ended = endings([*events, *heard(executor, endings)])
            assert executor.slots == 0
    assert ended["oval"].fault is FailureKind.LOST
    assert ended["oval"].message.startswith("its worker 127.0.0.1:")
    wait_until_gone(*log.processes())


@pytest.mark.slow
def test_jobs_are_accounted_for_when_the_scheduler_dies(tmp_path: Path, log: Log) -> None:
    with Cluster(tmp_path / "cluster") as cluster:
        cluster.worker(2)
        plan = plan_with(tmp_path, "hang,fine,slow,slow2")

        def kill_in_mid_run() -> bool:
            if log.of("oval,notes=hang"):
                cluster.kill_scheduler()
            return False

        with executor_of(cluster, log, wait=1.0) as executor:
            results = supervise(plan, executor, policy(retries=0), Watched(), stop_asked=kill_in_mid_run)
    assert results[0].code == 8
    assert results[0].message
    assert {result.code for result in results} <= {0, 8}
    assert all(len(log.of(step.name)) <= 1 for step in plan.steps)
