"""The clocks of `scripts/ladder_shares.py`, which `scripts/benchmark_ladder.py --shares` reads."""

import itertools
import json
import runpy
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

SCRIPTS = Path(__file__).parents[2] / "scripts"
pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="the clocks need Linux")


Told = tuple[dict[str, Any], dict[str, Any]]


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Told:
    """What the clocks and the command tell of a run of two stages."""
    folder = tmp_path_factory.mktemp("shares")
    out, told = folder / "run.h5", folder / "shares.json"
    options = ("--until", "transfer-function", "--search", "off", "--guess", "plan", "--threads", "1")
    command = [sys.executable, str(SCRIPTS / "ladder_shares.py"), str(told), "optimize", "half_cuban_eight"]
    run = subprocess.run(
        [*command, "--output", str(out), *options, "--json"], check=True, capture_output=True, text=True
    )
    return json.loads(told.read_text()), json.loads(run.stdout)


def test_every_second_belongs_to_one_stage_and_one_part(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a clock that goes on by a second whenever it is read."""
    shares = runpy.run_path(str(SCRIPTS / "ladder_shares.py"))
    ticks = itertools.count()
    monkeypatch.setattr(time, "perf_counter", lambda: float(next(ticks)))
    clocks = shares["Clocks"]()
    loading = clocks.parts["-"]["loading"]
    clocks.enter("point-mass")
    clocks.begin("replay")
    clocks.begin("simulation")
    clocks.end()
    clocks.end()
    clocks.charge()
    clocks.solved(waited=1.0, solver=0.75, derivatives=0.5)  # which reads the clock once
    clocks.enter("-")
    told = clocks.told()
    assert told["point-mass"]["parts"] == dict.fromkeys(shares["PARTS"], 0.0) | {
        "derivatives": 0.5,
        "linear algebra": 0.25,
        "putting together": 0.25,
        "replay": 2.0,
        "simulation": 1.0,
        "other": 3.0,
    }
    assert sum(stage["wall"] for stage in told.values()) == loading + next(ticks) - 1


def test_every_stage_that_is_flown_has_its_parts(flown: Told) -> None:
    clocks, _ = flown
    assert list(clocks) == ["-", "point-mass", "transfer-function"]
    for stage in clocks.values():
        assert stage["wall"] == pytest.approx(sum(stage["parts"].values()))
        assert min(stage["parts"].values()) >= 0.0


def test_the_parts_of_the_solver_are_those_that_the_run_tells(flown: Told) -> None:
    clocks, answer = flown
    for stage in answer["stages"]:
        parts = clocks[stage["stage"]]["parts"]
        assert parts["derivatives"] == pytest.approx(stage["derivatives_s"])
        assert parts["derivatives"] + parts["linear algebra"] == pytest.approx(stage["solve_s"])
        assert parts["putting together"] > 0.0
        assert parts["replay"] > 0.0
    assert clocks["transfer-function"]["parts"]["simulation"] > 0.0
    assert clocks["point-mass"]["parts"]["simulation"] == 0.0
    assert clocks["-"]["parts"]["input and output"] > 0.0
    assert clocks["-"]["parts"]["loading"] > 0.0


def test_processor_time_is_that_of_both_processes(flown: Told) -> None:
    """Both work on a stage, on one thread each, so no stage takes more of it than twice its seconds."""
    clocks, _ = flown
    for name in ("point-mass", "transfer-function"):
        assert 0.0 < clocks[name]["processor"] < 2.0 * clocks[name]["wall"] + 0.1
