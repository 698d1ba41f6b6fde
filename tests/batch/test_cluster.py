"""Jobs on a real scheduler and real workers, on loopback: whatever dies, no job is lost and none doubled."""

import logging
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path

import pytest

pytest.importorskip("distributed")

from batch_examples import Watched, flown, job, planned, write_course
from clusters import Cluster, wait_until
from stand_in_job import CHECKPOINT

from airrace.batch import cluster_connection
from airrace.batch.cluster import ClusterExecutor
from airrace.batch.cluster_connection import Connection
from airrace.batch.executor import Ended, Ending, Event, Fault, Order, StageFinished, Started
from airrace.batch.plan import Plan
from airrace.batch.supervision import Policy, supervise
from airrace.errors import ClusterError

VERSIONS = {"airrace": version("airrace"), "numpy": version("numpy")}
STAND_IN = Path(__file__).with_name("cluster_stand_in.py")
PROGRAM = """
import sys
import airrace.batch.process as process
from airrace.__main__ import main
process.JOB_COMMAND = (sys.executable, "-S", {stand_in!r}, {log!r})
main()
"""

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks for processes in /proc")


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    """Two workers, of one thread and of two; nobody kills them."""
    with Cluster(tmp_path_factory.mktemp("cluster")) as one:
        one.worker(1)
        one.worker(2)
        yield one


class Log:
    """Every start of a stand-in."""

    def __init__(self, path: Path) -> None:
        self.path = path

    @property
    def lines(self) -> list[list[str]]:
        return [line.split() for line in self.path.read_text().splitlines()] if self.path.exists() else []

    def of(self, name: str) -> list[str]:
        """How each process of a job began: `new` or `resumed`."""
        return [how for one, _, _, how in self.lines if one == name]

    def processes(self) -> list[int]:
        return [int(process) for _, process, _, _ in self.lines]

    def workers(self, name: str) -> list[int]:
        """The process of the worker of each start of a job."""
        return [int(worker) for one, _, worker, _ in self.lines if one == name]


@pytest.fixture
def log(tmp_path: Path) -> Log:
    return Log(tmp_path / "starts")


def executor_of(cluster: Cluster, log: Log, slots: int | None = None, wait: float = 60.0) -> ClusterExecutor:
    return ClusterExecutor(cluster.address, ("-S", str(STAND_IN), str(log.path)), VERSIONS, slots, wait)


def plan_with(folder: Path, notes: str) -> Plan:
    return planned(write_course(folder), folder=folder, sweeps=[f"notes={notes}"])


def alive(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def heard(executor: ClusterExecutor, enough: Callable[[list[Event]], object], within: float = 30.0) -> list[Event]:
    """Events until there are enough of them."""
    events: list[Event] = []
    deadline = time.monotonic() + within
    while not enough(events):
        assert time.monotonic() < deadline, events
        events += executor.events(0.5)
    return events


def await_slots(executor: ClusterExecutor, number: int) -> None:
    wait_until(lambda: executor.events(0.5) is not None and executor.slots == number, 30.0)


def endings(events: list[Event]) -> dict[str, Ending]:
    """How jobs ended; none of them twice."""
    ended = [event for event in events if isinstance(event, Ended)]
    assert len({event.name for event in ended}) == len(ended)
    return {event.name: event.ending for event in ended}


def test_whatever_one_job_does_the_others_are_flown_as_on_one_machine(
    cluster: Cluster, tmp_path: Path, log: Log
) -> None:
    manners = "fine,crash,infeasible,killed,exit,hang,not-certified,slow,no-checkpoint"
    plan = plan_with(tmp_path, manners)
    results = flown(plan, Policy(timeout=2.0), executor_of(cluster, log))
    assert [result.code for result in results] == [0, 8, 4, 8, 8, 6, 5, 0, 8]
    by_manner = dict(zip(manners.split(","), results, strict=True))
    assert by_manner["crash"].message == "its process crashed (SIGABRT)"
    assert by_manner["crash"].retries == ("its process crashed (SIGABRT)",)
    assert by_manner["hang"].message == "stopped after 2 s (--timeout)"
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
        executor.submit(Order(job(), 1, path, None))
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
        executor.submit(Order(job(overrides=("notes=stage-then-hang",), until="six-dof"), 1, path, None))
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
            executor.submit(Order(job(name, overrides=("notes=hang-once",)), 1, tmp_path / f"{name}.h5", None))
        events = heard(executor, lambda events: sum(isinstance(event, Started) for event in events) == 3)
        wait_until(lambda: len(log.lines) == 3)
        began = time.monotonic()
        executor.stop()
        assert time.monotonic() - began < 10.0
        ended = endings([*events, *executor.events(0.0)])
    assert {name: (one.code, one.fault) for name, one in ended.items()} == dict.fromkeys(
        ("a", "b", "c", "queued"), (130, Fault.STOPPED)
    )
    assert not any(map(alive, log.processes()))
    time.sleep(0.5)
    assert len(log.lines) == 3  # what was queued is never begun
    begun = {event.name for event in events if isinstance(event, Started)}
    assert {name for name in begun if (tmp_path / f"{name}.h5").read_bytes() == CHECKPOINT} == begun


def test_nothing_flies_on_when_the_executor_is_left(cluster: Cluster, tmp_path: Path, log: Log) -> None:
    with executor_of(cluster, log) as executor:
        executor.submit(Order(job(overrides=("notes=deaf",)), 1, tmp_path / "oval.h5", None))
        wait_until(lambda: log.lines)
    wait_until(lambda: not any(map(alive, log.processes())))


def test_nothing_flies_on_when_the_parent_is_killed(cluster: Cluster, tmp_path: Path, log: Log) -> None:
    with started(cluster, tmp_path, log, "--set", "notes=hang") as running:
        wait_until(lambda: log.lines, 60.0)
        running.kill()
        running.communicate(timeout=30.0)
    wait_until(lambda: not any(map(alive, log.processes())))


def test_an_interrupted_batch_goes_on_later(cluster: Cluster, tmp_path: Path, log: Log) -> None:
    arguments = ("--sweep", "notes=fine,hang-once", "--json")
    with started(cluster, tmp_path, log, *arguments) as running:
        wait_until(lambda: (tmp_path / "batch/oval,notes=fine.h5").exists() and len(log.lines) == 2, 60.0)
        running.send_signal(signal.SIGINT)
        running.communicate(timeout=30.0)
    assert running.returncode == 130
    with started(cluster, tmp_path, log, *arguments) as running:
        running.communicate(timeout=60.0)
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
        assert all(reason.startswith("its worker 127.0.0.1:") for reason in result.retries)
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
            executor.submit(Order(job(overrides=("notes=hang",)), 1, tmp_path / "oval.h5", None))
            wait_until(lambda: log.lines)
            workers[log.workers("oval")[0]].kill()
            time.sleep(3.0)  # nobody looks after it, so dask moves it to the other worker
            ended = endings(heard(executor, endings))
    assert ended["oval"].fault is Fault.LOST
    assert log.of("oval") == ["new"]


@pytest.mark.slow
def test_a_job_ends_with_its_worker_though_no_other_could_take_it(tmp_path: Path, log: Log) -> None:
    with Cluster(tmp_path / "cluster") as cluster:
        worker = cluster.worker()
        with executor_of(cluster, log) as executor:
            await_slots(executor, 1)
            executor.submit(Order(job(overrides=("notes=hang",)), 1, tmp_path / "oval.h5", None))
            events = heard(executor, lambda events: log.lines and events)
            worker.kill()
            ended = endings([*events, *heard(executor, endings, within=15.0)])
            assert executor.slots == 0
    assert ended["oval"].fault is Fault.LOST
    assert ended["oval"].message.startswith("its worker 127.0.0.1:")
    wait_until(lambda: not any(map(alive, log.processes())))


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


def test_an_unreachable_scheduler_is_told_before_anything_starts(tmp_path: Path, log: Log) -> None:
    began = time.monotonic()
    with started("tcp://127.0.0.1:9", tmp_path, log) as running:
        out, err = running.communicate(timeout=60.0)
    assert time.monotonic() - began < 10.0
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
        connection.cancel(queued)
        assert [future.status for future in queued] == ["cancelled"] * 6
        done = connection.submit(len, "abc", key="length", workers=list(workers))
        assert done.result(timeout=20.0) == 3
        connection.forget(done, "length")
        wait_until(lambda: connection.submit(len, "abcd", key="length", workers=list(workers)).result(20.0) == 4)
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
    monkeypatch.setattr(cluster_connection, "CONNECT", 1.0)
    with pytest.raises(ClusterError, match="cannot reach the scheduler"), ClusterExecutor(address, (), VERSIONS):
        pass


def test_somebody_who_listens_and_is_silent_is_no_scheduler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_connection, "CONNECT", 1.0)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        began = time.monotonic()
        with pytest.raises(ClusterError, match="no answer within 1 s"), ClusterExecutor(address, (), VERSIONS):
            pass
        assert time.monotonic() - began < 5.0


def test_a_worker_with_other_versions_that_comes_later_gets_no_jobs(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with Cluster(tmp_path / "cluster") as cluster:
        connection = Connection(cluster.address, {**VERSIONS, "numpy": "0.1"})
        try:
            cluster.worker()
            with caplog.at_level(logging.WARNING):
                wait_until(lambda: connection.threads() == {} and caplog.records, 30.0)
                assert connection.threads() == {}
            (record,) = caplog.records
            assert f"gets no jobs: it has numpy {VERSIONS['numpy']}, here is 0.1" in record.getMessage()
        finally:
            connection.close()


def started(cluster: Cluster | str, folder: Path, log: Log, *arguments: str) -> "subprocess.Popen[str]":
    """`airrace batch oval.yaml --cluster ...`, its jobs flown by stand-ins."""
    write_course(folder)
    address = cluster if isinstance(cluster, str) else cluster.address
    program = PROGRAM.format(stand_in=str(STAND_IN), log=str(log.path))
    options = ("--until", "point-mass", "--cluster", address, *arguments)
    return subprocess.Popen(
        [sys.executable, "-c", program, "batch", "oval.yaml", *options],
        cwd=folder,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
