"""Whatever dies or is stopped on a cluster, no job is lost, none doubled, and none flies on by itself."""

import re
import signal
import time
from pathlib import Path

import pytest

pytest.importorskip("distributed")

from batch_examples import Watched, job
from cluster_examples import await_slots, endings, executor_of, heard, plan_with, started
from cluster_log import Log
from clusters import Cluster
from waiting import PATIENCE, wait_until, wait_until_gone

from airrace.batch.executor import Attempt, FailureKind
from airrace.batch.supervision import Policy, supervise

GONE = re.compile(r"its worker( 127\.0\.0\.1:\d+)? is gone")
"""The reason to try a job again; a worker that is killed before it could tell what it has begun is not named."""

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks for processes in /proc")


def test_nothing_flies_on_when_the_executor_is_left(cluster: Cluster, tmp_path: Path, log: Log) -> None:
    with executor_of(cluster, log) as executor:
        executor.submit(Attempt(job(overrides=("notes=deaf",)), 1, tmp_path / "oval.h5", None))
        wait_until(lambda: log.lines)
    wait_until_gone(*log.processes())


def test_nothing_flies_on_when_the_parent_is_killed(cluster: Cluster, tmp_path: Path, log: Log) -> None:
    with started(cluster, tmp_path, log, "--set", "notes=hang") as running:
        wait_until(lambda: log.lines)
        running.kill()
        running.communicate(timeout=PATIENCE)
    wait_until_gone(*log.processes())


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
            results = supervise(plan, executor, Policy(), watched, stop_asked=kill_in_mid_run)
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
            executor.submit(Attempt(job(overrides=("notes=hang",)), 1, tmp_path / "oval.h5", None))
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
            executor.submit(Attempt(job(overrides=("notes=hang",)), 1, tmp_path / "oval.h5", None))
            events = heard(executor, lambda events: log.lines and events)
            worker.kill()
            ended = endings([*events, *heard(executor, endings)])
            assert executor.slots == 0
    assert ended["oval"].fault is FailureKind.LOST
    assert ended["oval"].message.startswith("its worker 127.0.0.1:")
    wait_until_gone(*log.processes())


def test_jobs_are_accounted_for_when_the_scheduler_dies(tmp_path: Path, log: Log) -> None:
    with Cluster(tmp_path / "cluster") as cluster:
        cluster.worker(2)
        plan = plan_with(tmp_path, "hang,fine,slow,slow2")

        def kill_in_mid_run() -> bool:
            if log.of("oval,notes=hang"):
                cluster.kill_scheduler()
            return False

        with executor_of(cluster, log, wait=1.0) as executor:
            results = supervise(plan, executor, Policy(retries=0), Watched(), stop_asked=kill_in_mid_run)
    assert results[0].code == 8
    assert results[0].message
    assert {result.code for result in results} <= {0, 8}
    assert all(len(log.of(step.name)) <= 1 for step in plan.steps)
