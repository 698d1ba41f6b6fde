"""The clocks of `scripts/ladder_shares.py`, which `scripts/benchmark_ladder.py --shares` reads."""

import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

SCRIPTS = Path(__file__).parents[2] / "scripts"
pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="the clocks need Linux")


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], dict[str, Any], float]:
    """What the clocks and the command tell of a run of two stages, and the seconds that it took."""
    folder = tmp_path_factory.mktemp("shares")
    out, told = folder / "run.h5", folder / "shares.json"
    options = ("--until", "transfer-function", "--explore", "off", "--guess", "plan", "--threads", "1")
    command = [sys.executable, str(SCRIPTS / "ladder_shares.py"), str(told), "optimize", "half_cuban_eight"]
    begun = time.perf_counter()
    run = subprocess.run(
        [*command, "--output", str(out), *options, "--json"], check=True, capture_output=True, text=True
    )
    return json.loads(told.read_text()), json.loads(run.stdout), time.perf_counter() - begun


def test_every_second_belongs_to_one_stage_and_one_part(
    flown: tuple[dict[str, Any], dict[str, Any], float],
) -> None:
    clocks, _, seconds = flown
    assert list(clocks) == ["-", "point-mass", "transfer-function"]
    for stage in clocks.values():
        assert stage["wall"] == pytest.approx(sum(stage["parts"].values()))
        assert min(stage["parts"].values()) >= 0.0
    assert seconds - 0.5 < sum(stage["wall"] for stage in clocks.values()) <= seconds + 0.02


def test_the_parts_of_the_solver_are_those_that_the_run_tells(
    flown: tuple[dict[str, Any], dict[str, Any], float],
) -> None:
    clocks, answer, _ = flown
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


def test_processor_time_is_that_of_both_processes(flown: tuple[dict[str, Any], dict[str, Any], float]) -> None:
    """Both work on a stage, on one thread each, so no stage takes more of it than twice its seconds."""
    clocks, _, _ = flown
    for name in ("point-mass", "transfer-function"):
        assert 0.0 < clocks[name]["processor"] < 2.0 * clocks[name]["wall"] + 0.1
