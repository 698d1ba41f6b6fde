"""`airrace batch --cluster` flying real courses: what comes back is what is flown here."""

import json
from pathlib import Path

import pytest
from airrace_command import HALF_CUBAN, POINT_MASS, airrace

pytest.importorskip("distributed")

from clusters import Cluster

FAST = (*POINT_MASS, "--set", "settings.guess=plan", "--set", "settings.explore=off")
WINDS = ("--sweep", "environment.wind.speed_kt=0,10", "--set", "environment.wind.from_deg=270")


def test_a_cluster_finds_what_this_machine_finds_and_its_checkpoints_can_be_trusted(tmp_path: Path) -> None:
    with Cluster(tmp_path / "cluster") as cluster:
        cluster.worker()
        cluster.worker()
        ran = airrace("batch", HALF_CUBAN, *FAST, *WINDS, "--cluster", cluster.address, "--json", cwd=tmp_path)
    assert ran.code == 0
    jobs = json.loads(ran.out)["jobs"]
    assert len(jobs) == 2
    alone = ("--set", "environment.wind.speed_kt=10", "--set", "environment.wind.from_deg=270", "--threads", "1")
    here = airrace("optimize", HALF_CUBAN, *FAST, *alone, "--json", cwd=tmp_path)
    times = {job["name"]: job["race_time_s"] for job in jobs}
    assert times["half_cuban_eight,speed_kt=10"] == pytest.approx(here.race_time, rel=1e-9)
    assert airrace("verify", jobs[0]["checkpoint"], cwd=tmp_path).code == 0
    # Flown here or there: it is done.
    again = airrace("batch", HALF_CUBAN, *FAST, *WINDS, "--json", cwd=tmp_path)
    assert [job["kept"] for job in json.loads(again.out)["jobs"]] == [True, True]
