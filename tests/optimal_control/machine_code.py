"""Machine code of the package, installed for one test in this process; else only the solver process has it."""

from types import ModuleType

import pytest

from airrace.errors import KernelError
from airrace.optimal_control import kernel_library


def installed_for_now(module: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    """Install a module's machine code until the test ends, which is skipped where there is no compiler."""
    try:
        kernel_library.find_compiler()
    except KernelError:
        pytest.skip("no C compiler")
    monkeypatch.setattr(module, "_installed", [])
    module.install.cache_clear()
    assert module.install()
