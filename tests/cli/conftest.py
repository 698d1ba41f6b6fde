"""A folder in which the command line flies nothing."""

from pathlib import Path

import fake_optimizer
import pytest


@pytest.fixture
def fake_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, empty; stages come from `fake_optimizer`."""
    monkeypatch.chdir(tmp_path)
    fake_optimizer.install(monkeypatch)
    return tmp_path
