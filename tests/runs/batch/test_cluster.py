"""Jobs on a real scheduler and real workers, on loopback: they are flown as on one machine."""

import logging
import os
import pickle
import signal
import socket
import time
from pathlib import Path

import pytest
from batch_examples import Watched, flown, job, policy
from cluster_examples import VERSIONS, await_slots, plan_with, pool_of, started
from cluster_log import Log
from clusters import Cluster
from stand_in_job import CHECKPOINT
from waiting import PATIENCE, wait_until, wait_until_gone

from airrace.errors import ClusterError
from airrace.runs.batch import cluster as cluster_module
from airrace.runs.batch.cluster import ClusterPool
from airrace.runs.batch.supervision import supervise

pytest.importorskip("distributed")


pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks for processes in /proc")


@pytest.mark.slow
def test_whatever_one_job_does_the_others_are_flown_as_on_one_machine(
    cluster: Cluster, tmp_path: Path, log: Log
) -> None:
    manners = "fine,crash,infeasible,killed,exit,hang,not-certified,slow,no-checkpoint"
    plan = plan_with(tmp_path, manners)
    results = flown(plan, policy(timeout=10.0), pool_of(cluster, log))
    assert [result.code for result in results] == [0, 8, 4, 8, 8, 6, 5, 0, 8]
    by_manner = dict(zip(manners.split(","), results, strict=True))
    assert by_manner["crash"].message == "its process crashed (SIGABRT)"
    assert by_manner["crash"].retries == ("its process crashed (SIGABRT)",)
    assert by_manner["hang"].message == "stopped after 10 s (--timeout)"
    again = plan_with(tmp_path, manners)
    kept = {step.swept[0][1] for step in again.steps if step.action == "keep"}
    assert kept == {"fine", "infeasible", "not-certified", "slow"}


def test_checkpoints_travel_both_ways(cluster: Cluster, tmp_path: Path, log: Log) -> None:
    (result,) = flown(plan_with(tmp_path, "crash-once"), pool=pool_of(cluster, log))
    assert result.code == 0
    assert log.of("oval,notes=crash-once") == ["new", "resumed"]
    assert (tmp_path / "oval,notes=crash-once.h5").read_bytes() == CHECKPOINT
    assert os.getpid() not in log.workers("oval,notes=crash-once")


def test_a_job_is_small_as_it_travels() -> None:
    assert len(pickle.dumps(job())) < 1000


def test_stages_are_reported_in_order_and_with_the_worker(cluster: Cluster, tmp_path: Path, log: Log) -> None:
    with pool_of(cluster, log) as pool:
        await_slots(pool, 3)
        assert pool.submit(job(), tmp_path / "oval.h5", None).result().code == 0
        reports = [pool.progress.get(timeout=PATIENCE) for _ in range(3)]
    assert {name for name, _ in reports} == {"oval"}
    assert [next(iter(report)) for _, report in reports] == ["started", "stage_started", "stage_finished"]
    assert reports[0][1]["started"].startswith("127.0.0.1:")


def test_as_many_jobs_run_at_a_time_as_there_are_threads_or_as_are_asked_for(cluster: Cluster, log: Log) -> None:
    with pool_of(cluster, log) as pool:
        await_slots(pool, 3)
    with pool_of(cluster, log, slots=2) as pool:
        await_slots(pool, 2)


def test_jobs_that_are_stopped_say_so_and_leave_no_process(cluster: Cluster, tmp_path: Path, log: Log) -> None:
    with pool_of(cluster, log) as pool:
        await_slots(pool, 3)
        futures = [
            pool.submit(job(name, overrides=("notes=hang",)), tmp_path / f"{name}.h5", None)
            for name in ("a", "b", "c", "queued")
        ]
        wait_until(lambda: len(log.lines) == 3)
        pool.stop_asked.set()
        assert [future.result().code for future in futures] == [130] * 4
        wait_until_gone(*log.processes())
        time.sleep(0.5)
        assert len(log.lines) == 3  # what was queued is never begun


def test_without_a_worker_jobs_end_when_the_wait_is_over_and_a_late_worker_flies_the_rest(
    tmp_path: Path, log: Log, caplog: pytest.LogCaptureFixture
) -> None:
    with Cluster(tmp_path / "cluster") as cluster:
        with caplog.at_level(logging.WARNING):
            (result,) = flown(plan_with(tmp_path, "fine"), pool=pool_of(cluster, log, wait=0.5))
        assert "waiting for one, for 0.5 s at most" in caplog.text
        assert (result.code, log.lines) == (8, [])
        assert result.message == f"no worker at {cluster.address} for 0.5 s"
        cluster.worker()
        (result,) = flown(plan_with(tmp_path, "fine"), pool=pool_of(cluster, log))
        assert result.code == 0


def test_an_unreachable_scheduler_is_reported_before_anything_starts(tmp_path: Path, log: Log) -> None:
    with started("tcp://127.0.0.1:9", tmp_path, log) as running:
        out, err = running.communicate(timeout=PATIENCE)
    assert (running.returncode, out) == (8, "")
    assert err.startswith("airrace: cannot reach the scheduler tcp://127.0.0.1:9: ")
    assert err.count("\n") == 1
    assert not (tmp_path / "batch").exists()


@pytest.mark.parametrize(
    ("versions", "words"),
    [
        ({"airrace": "9.9"}, "airrace"),
        ({"airrace": VERSIONS["airrace"], "numpy": "0.1"}, "has numpy "),
        ({"airrace": VERSIONS["airrace"], "an-absent-library": "1"}, "has no an-absent-library"),
    ],
)
def test_workers_with_other_versions_are_refused(cluster: Cluster, versions: dict[str, str], words: str) -> None:
    with pytest.raises(ClusterError, match=words), ClusterPool(cluster.address, (), versions):
        pass


@pytest.mark.parametrize("address", ["nowhere", "tcp://", "xyz://127.0.0.1:1", "tcp://no-such-host.invalid:1"])
def test_an_address_that_is_none_is_one_clear_error(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_module, "CONNECT_TIME", 1.0)
    with pytest.raises(ClusterError, match="cannot reach the scheduler"), ClusterPool(address, (), VERSIONS):
        pass


def test_somebody_who_listens_and_is_silent_is_no_scheduler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_module, "CONNECT_TIME", 1.0)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(ClusterError, match="no answer within 1 s"), ClusterPool(address, (), VERSIONS):
            pass


def test_a_worker_with_other_versions_that_comes_later_gets_no_jobs(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with (
        Cluster(tmp_path / "cluster") as cluster,
        ClusterPool(cluster.address, (), {**VERSIONS, "numpy": "0.1"}) as pool,
        caplog.at_level(logging.WARNING),
    ):
        cluster.worker()
        expected = f"gets no jobs: it has numpy {VERSIONS['numpy']}, here is 0.1"
        wait_until(lambda: pool.slots == 0 and expected in caplog.text)
        assert pool.slots == 0


def test_nothing_flies_on_when_the_pool_is_left(cluster: Cluster, tmp_path: Path, log: Log) -> None:
    with pool_of(cluster, log) as pool:
        await_slots(pool, 3)
        pool.submit(job(overrides=("notes=deaf",)), tmp_path / "oval.h5", None)
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
    arguments = ("--sweep", "notes=fine,hang-first", "--json")
    with started(cluster, tmp_path, log, *arguments) as running:
        wait_until(lambda: (tmp_path / "batch/oval,notes=fine.h5").exists() and len(log.lines) == 2)
        running.send_signal(signal.SIGINT)
        running.communicate(timeout=PATIENCE)
    assert running.returncode == 130
    wait_until_gone(*log.processes())
    with started(cluster, tmp_path, log, *arguments) as running:
        running.communicate(timeout=PATIENCE)
    assert running.returncode == 0
    assert log.of("oval,notes=fine") == ["new"]
    assert log.of("oval,notes=hang-first") == ["new", "new"]


def test_a_worker_killed_in_mid_run_loses_no_job_and_doubles_none(tmp_path: Path, log: Log) -> None:
    notes = ",".join(["hang-first", *(f"fine-{number}" for number in range(20)), "slow"])
    hanging = "oval,notes=hang-first"
    watched, finished_before = Watched(), list[str]()
    with Cluster(tmp_path / "cluster") as cluster:
        workers = {worker.pid: worker for worker in (cluster.worker(2), cluster.worker(2))}
        plan = plan_with(tmp_path, notes)

        def kill_in_mid_run() -> bool:
            ended = [line.split()[0] for line in watched.lines if " ended " in line]
            if not finished_before and len(ended) >= 6 and log.of(hanging):
                finished_before.extend(ended)
                workers[log.workers(hanging)[0]].kill()
            return False

        with pool_of(cluster, log) as pool:
            await_slots(pool, 4)
            results = supervise(plan, pool, policy(), watched, stop_asked=kill_in_mid_run)
    assert [result.code for result in results] == [0] * 22
    assert len(finished_before) >= 6
    assert all(log.of(name) == ["new"] for name in finished_before)
    for step in plan.steps:
        assert watched.lines.count(f"{step.name} ended 0") == 1
    assert len(log.of(hanging)) == 2
    assert len(set(log.workers(hanging))) == 2
    assert len([step for step in plan.steps if len(log.of(step.name)) > 1]) <= 2  # as the worker has threads
    assert {step.action for step in plan_with(tmp_path, notes).steps} == {"keep"}


@pytest.mark.slow
def test_a_job_ends_with_its_worker_though_no_other_could_take_it(tmp_path: Path, log: Log) -> None:
    with Cluster(tmp_path / "cluster") as cluster:
        worker = cluster.worker()

        def kill_in_mid_run() -> bool:
            if log.lines:
                worker.kill()
            return False

        with pool_of(cluster, log) as pool:
            plan = plan_with(tmp_path, "hang")
            (result,) = supervise(plan, pool, policy(retries=0), Watched(), stop_asked=kill_in_mid_run)
    assert (result.code, result.message) == (8, "its worker is gone")
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

        with pool_of(cluster, log, wait=1.0) as pool:
            results = supervise(plan, pool, policy(retries=0), Watched(), stop_asked=kill_in_mid_run)
    assert results[0].code == 8
    assert results[0].message
    assert {result.code for result in results} <= {0, 8}
    assert all(len(log.of(step.name)) <= 1 for step in plan.steps)
