"""Air races as nonlinear programs in files: what they hold is optimal, and another solver finds it."""

import importlib.util
import json
from pathlib import Path
from types import ModuleType
from typing import Any

import casadi as ca
import numpy as np
import pytest
from example_flights import half_cuban

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module", name="script")
def loaded_script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("race_programs", ROOT / "scripts" / "race_programs.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module", name="folder")
def folder_of_programs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("programs") / "races"
    folder.mkdir()
    return folder


@pytest.fixture(scope="module", name="program")
def written_program(script: ModuleType, folder: Path) -> tuple[ca.Function, dict[str, Any]]:
    function, document = script.write_program(half_cuban()["point-mass"], "half_cuban_eight", folder)
    return ca.Function.load(str(function)), json.loads(document.read_text(encoding="utf-8"))


def test_the_stored_optimum_obeys_the_optimality_conditions(script: ModuleType, program: Any) -> None:
    function, data = program
    measured = script.residuals(function, data)
    assert measured == pytest.approx(data["residuals"], rel=1e-6, abs=1e-12)
    assert max(measured.values()) < 1e-6
    assert data["certified"]
    assert data["race_time_s"] == pytest.approx(half_cuban().race_time)
    assert 0.0 < data["objective"] - data["race_time_s"] < 0.02
    assert len(data["x_names"]) == len(data["x"]) == len(data["start"]) == len(data["lam_x"])
    assert len(data["g_names"]) == len(data["lbg"]) == len(data["lam_g"])


@pytest.mark.parametrize("key", ["x", "lam_g", "lam_x"])
def test_residuals_see_a_solution_that_is_none(script: ModuleType, program: Any, key: str) -> None:
    function, data = program
    moved = np.array(data[key])
    moved[np.argmax(np.abs(moved))] *= 1.01
    assert max(script.residuals(function, data | {key: moved.tolist()}).values()) > 1e-4


def test_the_code_of_the_page_finds_the_optimum_with_another_solver(
    program: Any, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, data = program
    page = (ROOT / "docs" / "race_programs.md").read_text(encoding="utf-8")
    code = page.partition("```python\n")[2].partition("```")[0]
    assert code.count("\n") <= 13
    monkeypatch.chdir(folder.parent)
    names: dict[str, Any] = {}  # Any: whatever the page defines
    exec(compile(code, "race_programs.md", "exec"), names)
    assert names["solver"].stats()["success"]
    assert float(names["optimum"]["f"]) == pytest.approx(data["objective"], abs=1e-5)  # IPOPT relaxes bounds by 1e-8
    x = np.asarray(names["optimum"]["x"]).ravel()
    durations = [place for place, name in enumerate(data["x_names"]) if name.startswith("duration of ")]
    assert x[durations] == pytest.approx(np.array(data["x"])[durations], abs=1e-3)
