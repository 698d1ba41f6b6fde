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


@pytest.fixture(scope="module", name="program")
def written_program(script: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> tuple[ca.Function, dict[str, Any]]:
    stage = half_cuban()["point-mass"]
    function, document = script.write_program(stage, "half_cuban_eight", tmp_path_factory.mktemp("races"))
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


def test_another_solver_finds_the_optimum_from_the_start(program: Any) -> None:
    function, data = program
    x, p = ca.MX.sym("x", len(data["x"])), ca.MX.sym("p", len(data["p"]))
    f, g = function(x, p)
    quiet = {"ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes"}
    solver = ca.nlpsol("solver", "ipopt", {"x": x, "p": p, "f": f, "g": g}, quiet)
    bounds = {name: data[name] for name in ("lbx", "ubx", "lbg", "ubg")}
    found = solver(x0=data["start"], p=data["p"], **bounds)
    assert solver.stats()["success"]
    assert float(found["f"]) == pytest.approx(data["objective"], abs=1e-5)  # IPOPT relaxes bounds by 1e-8
    x_scaled = np.asarray(found["x"]).ravel()
    duration = [place for place, name in enumerate(data["x_names"]) if name.startswith("duration of ")]
    assert x_scaled[duration] == pytest.approx(np.array(data["x"])[duration], abs=1e-3)
