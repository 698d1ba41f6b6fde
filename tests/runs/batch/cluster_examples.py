"""Jobs on a cluster for the tests, flown by stand-ins that leave a log: by a pool, or by the command."""

import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

from batch_examples import planned, write_course
from cluster_log import Log
from clusters import Cluster
from waiting import wait_until

from airrace.runs.batch.cluster import ClusterPool
from airrace.runs.batch.planning import BatchPlan

VERSIONS = {"airrace": version("airrace"), "numpy": version("numpy")}
STAND_IN = Path(__file__).with_name("cluster_stand_in.py")
PROGRAM = """
import sys
import airrace.runs.batch.local as process
from airrace.__main__ import main
process.JOB_COMMAND = (sys.executable, "-S", {stand_in!r}, {log!r})
main()
"""


def pool_of(cluster: Cluster, log: Log, slots: int | None = None, wait: float = 60.0) -> ClusterPool:
    return ClusterPool(cluster.address, ("-S", str(STAND_IN), str(log.path)), VERSIONS, slots, wait)


def plan_with(folder: Path, notes: str) -> BatchPlan:
    return planned(write_course(folder), folder=folder, sweeps=[f"notes={notes}"])


def await_slots(pool: ClusterPool, number: int) -> None:
    wait_until(lambda: pool.slots == number)


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
