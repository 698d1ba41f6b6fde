"""The files in docs/examples run as they stand."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from pages import DOCS, ROOT

from airrace.files.inputs import Document, load_inputs
from airrace.files.inputs.schema import read_entry
from airrace.files.inputs.settings import BatchEntry

EXAMPLES = DOCS / "examples"
FAST = {"first_flight.py", "goddard.py", "own_problem.py", "read_hdf5.py"}
COMMAND = f'exec "{sys.executable}" -P -m airrace "$@"\n'
PROGRAMS = sorted(path for path in EXAMPLES.iterdir() if path.suffix in {".py", ".sh"})


@pytest.mark.parametrize(
    "path", [pytest.param(one, id=one.name, marks=() if one.name in FAST else pytest.mark.slow) for one in PROGRAMS]
)
def test_an_example_runs(path: Path, tmp_path: Path) -> None:
    folder, commands = tmp_path / "examples", tmp_path / "bin"
    shutil.copytree(EXAMPLES, folder)
    commands.mkdir()
    (commands / "airrace").write_text(f"#!/bin/sh\n{COMMAND}")
    (commands / "airrace").chmod(0o755)
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PATH": f"{commands}:{os.environ['PATH']}"}
    command = [sys.executable, path.name] if path.suffix == ".py" else ["sh", "-e", path.name]
    ran = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout + ran.stderr


@pytest.mark.parametrize(("name", "lines_max"), [("goddard.py", 20), ("free_flying_robot.py", 25)])
def test_a_textbook_problem_is_stated_in_few_lines(name: str, lines_max: int) -> None:
    statement, _, _ = (EXAMPLES / name).read_text(encoding="utf-8").partition("solution = ")
    lines = [line for line in statement.splitlines() if line.strip() and not line.startswith('"""')]
    assert len(lines) <= lines_max


def test_the_yaml_of_the_examples_is_valid() -> None:
    inputs = load_inputs(EXAMPLES / "sprint.yaml", settings=EXAMPLES / "careful.yaml")
    assert inputs.settings.certificate.race_time == 0.002
    _, reporter = read_entry(BatchEntry, Document("winds.yaml", (EXAMPLES / "winds.yaml").read_text(encoding="utf-8")))
    assert reporter.findings == []


def test_the_page_lists_every_example() -> None:
    listed = re.findall(r"\]\(examples/([^)]+)\)", (DOCS / "examples.md").read_text(encoding="utf-8"))
    assert sorted(listed) == sorted(path.name for path in EXAMPLES.iterdir())
