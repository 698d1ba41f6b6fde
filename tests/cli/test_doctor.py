"""`airrace doctor` tells what works, what does not, and what is missing for which command."""

import json
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import pytest
from typer.testing import CliRunner

from airrace.cli import installation
from airrace.cli.main import app


def examined() -> tuple[int, dict[str, dict[str, str]], dict[str, Any]]:  # Any: JSON
    ran = CliRunner().invoke(app, ["doctor", "--json"])
    told = json.loads(ran.stdout)
    return ran.exit_code, {one["name"]: one for one in told["components"]}, told


def test_an_installation_that_works_is_healthy() -> None:
    code, components, told = examined()
    assert (code, told["healthy"]) == (0, True)
    assert {"Python", "airrace", "casadi", "numpy", "typer", "native library", "cores", "solver"} <= set(components)
    assert components["casadi"]["found"] == version("casadi")
    assert components["solver"]["found"].startswith("a known answer in ")
    assert "pytest" not in components


def test_a_wrong_answer_is_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    class Wrong:
        objective, status = 1.9, "Solve_Succeeded"

    monkeypatch.setattr(installation, "solve", lambda *_: Wrong())
    code, components, told = examined()
    assert (code, told["healthy"]) == (1, False)
    assert components["solver"]["fault"] == "1.900000 s instead of 2 s (Solve_Succeeded)"
    assert told["error"] == "this installation does not work: solver"


def test_what_is_missing_is_told_with_what_needs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def without(name: str) -> str:
        if name in ("matplotlib", "h5py"):
            raise PackageNotFoundError(name)
        return version(name)

    monkeypatch.setattr(installation, "version", without)
    monkeypatch.setattr(installation, "solve_known_problem", lambda: "a known answer")
    code, components, _ = examined()
    assert code == 1
    assert components["h5py"]["fault"] == "it is not installed"
    assert components["matplotlib"]["fault"] == ""
    assert components["matplotlib"]["needed_for"].startswith("plot, check --plot")
    assert (
        "missing, needed for plot, check --plot, compare --plot: pip install"
        in CliRunner().invoke(app, ["doctor"]).stdout
    )


def test_the_variant_of_the_native_library_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    assert installation.native_variant() in ("baseline", "avx2", "avx512")
    monkeypatch.setattr(installation, "library", lambda: None)
    assert installation.native_variant() == "none: casadi evaluates, some ten times slower"
