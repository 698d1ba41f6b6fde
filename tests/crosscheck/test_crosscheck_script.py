"""The script's verdict is its exit code."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest
from craft import ROOT

pytest.importorskip("jsbsim")


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """`scripts/crosscheck.py` with few states and no arguments."""
    spec = importlib.util.spec_from_file_location("crosscheck_script", ROOT / "scripts/crosscheck.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, spec.name, module)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "STATES", 10)
    monkeypatch.setattr(sys, "argv", ["crosscheck.py"])
    return module


def test_within_the_limits_it_succeeds(script: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    assert script.main() == 0
    assert "NO" not in capsys.readouterr().out


@pytest.mark.parametrize("limit", ["FORCE_LIMIT", "ANGULAR_LIMIT"])
def test_beyond_a_limit_it_fails(
    script: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], limit: str
) -> None:
    monkeypatch.setattr(script, limit, 1e-15)
    assert script.main() == 1
    assert "NO" in capsys.readouterr().out


def test_a_run_that_is_not_there_is_named(
    script: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(sys, "argv", ["crosscheck.py", str(tmp_path / "none.h5")])
    assert script.main() == 2
    assert "none.h5" in capsys.readouterr().err
