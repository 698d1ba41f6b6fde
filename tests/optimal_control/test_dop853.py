"""scipy's integrator without its package: the same code, and the package itself where the code lies elsewhere."""

import inspect
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from scipy.integrate import DOP853  # pyright: ignore[reportUnknownVariableType] - untyped in scipy

from airrace.optimal_control import reference_integration as module


@pytest.fixture
def loaded_anew() -> Iterator[None]:
    module.dop853.cache_clear()
    yield
    module.dop853.cache_clear()


def test_the_integrator_is_the_file_of_the_installed_scipy() -> None:
    own = module.dop853()
    assert inspect.getsourcefile(own) == inspect.getsourcefile(DOP853)  # pyright: ignore[reportUnknownArgumentType]


def test_the_package_around_it_is_not_loaded() -> None:
    program = "import sys; from airrace.optimal_control.reference_integration import dop853; dop853()"
    look = f"{program}; print('scipy.integrate' in sys.modules)"
    told = subprocess.run([sys.executable, "-c", look], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "False"


def test_all_of_it_is_loaded_where_scipy_keeps_the_file_elsewhere(
    monkeypatch: pytest.MonkeyPatch, loaded_anew: None
) -> None:
    monkeypatch.setattr(module, "FOLDER", Path("elsewhere"))
    monkeypatch.setattr(module, "ALIAS", "integrators_of_a_test")
    assert module.dop853() is DOP853
