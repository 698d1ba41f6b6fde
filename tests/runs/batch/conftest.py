"""A cluster that tests of one file share, the log of its stand-ins, and the command in a folder of its own."""

from collections.abc import Iterator
from concurrent.futures import Future
from importlib.metadata import version
from pathlib import Path

import pytest
from batch_examples import STAND_IN, Shell, write_course
from cluster_log import Log
from clusters import Cluster
from waiting import wait_until

import airrace.runs.batch.local as process_module
from airrace.runs.batch.jobs import Job
from airrace.runs.batch.local import LocalPool
from airrace.runs.batch.supervision import AttemptResult


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    """Two workers, of one thread and of two, which have joined; nobody kills them."""
    from airrace.runs.batch.cluster import ClusterPool  # needs a library without which no cluster is tested

    with Cluster(tmp_path_factory.mktemp("cluster")) as one:
        one.worker(1)
        one.worker(2)
        with ClusterPool(one.address, (), {"airrace": version("airrace")}) as pool:
            wait_until(lambda: pool.slots == 3)
        yield one


@pytest.fixture
def log(tmp_path: Path) -> Log:
    return Log(tmp_path / "starts")


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Jobs that hang run out of whatever time they have after half a second; the others keep theirs."""
    submit = LocalPool.submit

    def sooner(pool: LocalPool, job: Job, checkpoint: Path, timeout: float | None) -> "Future[AttemptResult]":
        hangs = timeout is not None and "notes=hang" in job.overrides
        return submit(pool, job, checkpoint, 0.5 if hangs else timeout)

    monkeypatch.setattr(LocalPool, "submit", sooner)


@pytest.fixture
def airrace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Shell:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(process_module, "JOB_COMMAND", STAND_IN)
    monkeypatch.delenv("GITHUB_ACTIONS", raising=False)
    write_course(tmp_path)
    return Shell(tmp_path)
