"""Notebooks are stored executed, from top to bottom and without an error, and run as they stand."""

import json
from pathlib import Path
from typing import Any

import pytest
from pages import DOCS

NOTEBOOKS = sorted(DOCS.rglob("*.ipynb"))
Cell = dict[str, Any]  # Any: JSON of any shape


def cells(path: Path) -> list[Cell]:
    return json.loads(path.read_text(encoding="utf-8"))["cells"]


def code(path: Path) -> list[Cell]:
    return [cell for cell in cells(path) if cell["cell_type"] == "code"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_every_cell_was_executed_in_order_and_kept_its_outputs(path: Path) -> None:
    executed = code(path)
    assert [cell["execution_count"] for cell in executed] == list(range(1, len(executed) + 1))
    assert all(cell["outputs"] for cell in executed)
    assert {output["output_type"] for cell in executed for output in cell["outputs"]} <= {
        "display_data",
        "execute_result",
        "stream",
    }


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_begins_with_its_title_and_tells_nothing_of_its_machine(path: Path) -> None:
    assert "".join(cells(path)[0]["source"]).startswith("# ")
    text = path.read_text(encoding="utf-8")
    assert not any(folder in text for folder in ("/home/", "/root/", "/tmp/", "/Users/"))


@pytest.mark.slow  # it flies several races
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    names: dict[str, Any] = {}  # Any: whatever the notebook defines
    for number, cell in enumerate(code(path), start=1):
        exec(compile("".join(cell["source"]), f"{path.name}, cell {number}", "exec"), names)


def test_there_is_a_notebook() -> None:
    assert NOTEBOOKS
