"""The examples of the docstrings and of the page on Python run as they are written."""

import doctest
import re
from functools import cache
from importlib import import_module
from pathlib import Path

import pytest

import airrace
from airrace.api.run import Run

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
MODULES = sorted(
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for path in (ROOT / "airrace").rglob("*.py")
    if ">>> " in path.read_text(encoding="utf-8")
)


@cache
def example_run() -> Run:
    """The run that the docstrings speak of."""
    return airrace.optimize("half_cuban_eight", until="point-mass", search="off")


def test_the_doors_of_the_package_have_examples() -> None:
    assert {"airrace.api.optimize", "airrace.api.run", "airrace.runs.stage_view"} <= set(MODULES)


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_of_a_module_hold(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    tried = doctest.testmod(import_module(name), extraglobs={"airrace": airrace, "run": example_run()})
    assert tried.attempted > 0
    assert tried.failed == 0


def page_of(course: str) -> str:
    """The code of the page, flown on a course."""
    blocks = re.findall(r"```python\n(.+?)```", PAGE, re.DOTALL)
    assert len(blocks) >= 6
    return "\n".join(blocks).replace("rovinj_2014", course)


def test_the_page_on_python_runs_on_a_short_course(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(compile(page_of("half_cuban_eight"), "python.md", "exec"), names)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["flight.csv", "lighter.h5", "rovinj.h5"]
    run, mine = names["run"], names["mine"]
    assert isinstance(run, Run)
    assert isinstance(mine, Run)
    assert run.certified
    assert mine.certified, mine.message


@pytest.mark.slow
def test_the_page_on_python_runs_as_it_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(compile(page_of("rovinj_2014"), "python.md", "exec"), names)
    run = names["run"]
    assert isinstance(run, Run)
    assert f"{run.race_time:.3f} s" in PAGE
