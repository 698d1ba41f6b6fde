"""`airrace batch --cluster` flying real courses: what comes back is what is flown here."""

import json
from pathlib import Path

import pytest
from airrace_command import HALF_CUBAN, POINT_MASS, airrace

pytest.importorskip("distributed")

from clusters import Cluster

FAST = (*POINT_MASS, "--set", "settings.guess=plan", "--set", "settings.search=off")
WIND = ("--sweep", "environment.wind.speed_kt=10", "--set", "environment.wind.from_deg=270")


@pytest.mark.slow
def test_a_cluster_finds_what_this_machine_finds_and_its_checkpoints_can_be_trusted(tmp_path: Path) -> None:
    with Cluster(tmp_path / "cluster") as cluster:
        cluster.worker()
        ran = airrace("batch", HALF_CUBAN, *FAST, *WIND, "--cluster", cluster.address, "--json", cwd=tmp_path)
    assert ran.code == 0
    (job,) = json.loads(ran.out)["jobs"]
    alone = ("--set", "environment.wind.speed_kt=10", "--set", "environment.wind.from_deg=270", "--threads", "1")
    here = airrace("optimize", HALF_CUBAN, *FAST, *alone, "--json", cwd=tmp_path)
    assert job["race_time_s"] == pytest.approx(here.race_time, rel=1e-9)
    assert airrace("verify", job["checkpoint"], cwd=tmp_path).code == 0
    # Flown here or there: it is done.
    again = airrace("batch", HALF_CUBAN, *FAST, *WIND, "--json", cwd=tmp_path)
    assert [job["kept"] for job in json.loads(again.out)["jobs"]] == [True]
