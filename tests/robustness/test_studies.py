"""Short versions of the robustness studies: they find nothing, and they go on where they stopped."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).parents[2] / "scripts" / "experiments"
linux_only = pytest.mark.skipif(sys.platform != "linux", reason="finds processes through /proc and limits files")


def study(name: str, count: int, log: Path) -> str:
    """What a study prints that finds nothing."""
    command = [sys.executable, str(SCRIPTS / f"{name}.py"), "--count", str(count), "--log", str(log)]
    ran = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600.0)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    return ran.stdout


def test_mutated_files_are_refused_or_read_whole(tmp_path: Path) -> None:
    log = tmp_path / "log.jsonl"
    study("mutations", 10, log)
    first = log.read_text(encoding="utf-8")
    told = study("mutations", 30, log)
    assert "seed 1, 30 trials" in told
    assert log.read_text(encoding="utf-8").startswith(first)
    assert [json.loads(line)["number"] for line in log.read_text(encoding="utf-8").splitlines()] == list(range(30))


def test_a_fault_in_the_log_is_told_and_ends_the_study_with_code_1(tmp_path: Path) -> None:
    log = tmp_path / "log.jsonl"
    record = {"seed": 1, "number": 0, "kind": "a kind", "outcome": "done", "faults": ["a traceback"]}
    log.write_text(json.dumps(record) + "\n", encoding="utf-8")
    command = [sys.executable, str(SCRIPTS / "mutations.py"), "--count", "1", "--log", str(log)]
    ran = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600.0)
    assert ran.returncode == 1
    assert "number 0, a kind: a traceback" in ran.stdout


def test_extreme_courses_are_flown_or_refused_with_a_reason_in_time(tmp_path: Path) -> None:
    """Too much mass, two gates in one place, a climb of 900 m, floor and ceiling at one height."""
    log = tmp_path / "log.jsonl"
    assert "faults: 0" in study("extremes", 4, log)
    records = [json.loads(line) for line in log.read_text(encoding="utf-8").splitlines()]
    assert [one["outcome"] for one in records] == ["refused", "done", "done", "done"]
    assert "the wing cannot carry the aircraft" in records[0]["reason"]


@linux_only
@pytest.mark.slow
@pytest.mark.parametrize("name", ["signals", "full_disks"])
def test_no_command_loses_what_it_has(name: str, tmp_path: Path) -> None:
    assert "faults: 0" in study(name, 12, tmp_path / "log.jsonl")


@pytest.mark.slow
def test_courses_spoilt_by_one_limit_are_told_which_and_fly_with_what_is_suggested(tmp_path: Path) -> None:
    assert "faults: 0" in study("infeasible", 3, tmp_path / "log.jsonl")
