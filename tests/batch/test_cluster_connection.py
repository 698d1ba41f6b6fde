"""Schedulers that cannot be reached and workers that are refused; the tasks of those that are not."""

import logging
import os
import socket
import time
from pathlib import Path

import pytest

pytest.importorskip("distributed")

from cluster_examples import VERSIONS, started
from cluster_log import Log
from clusters import Cluster
from waiting import PATIENCE, wait_until

from airrace.batch import cluster_connection
from airrace.batch.cluster import ClusterExecutor
from airrace.batch.cluster_connection import Connection
from airrace.errors import ClusterError

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks for processes in /proc")


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
        connection.cancel(queued)
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
    monkeypatch.setattr(cluster_connection, "CONNECT", 1.0)
    with pytest.raises(ClusterError, match="cannot reach the scheduler"), ClusterExecutor(address, (), VERSIONS):
        pass


def test_somebody_who_listens_and_is_silent_is_no_scheduler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_connection, "CONNECT", 1.0)
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
