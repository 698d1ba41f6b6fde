"""The folder in which the code of the pages runs, and the modules that generate pages."""

import importlib
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest
from disk_cache import cached_across_workers
from pages import ROOT

MODULES = (
    "api_pages",
    "command_pages",
    "flow_tables",
    "grouped_names",
    "language_pages",
    "mathml",
    "notebook_pages",
    "site_hooks",
)


@cached_across_workers
def flown_file() -> bytes:
    """The file of a certified run of Rovinj 2014 up to the point mass, straight from the plan."""
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "rovinj.h5"
        track = ROOT / "tracks" / "rovinj_2014.yaml"
        options = ["--until", "point-mass", "--guess", "plan", "--search", "off", "--output", str(run), "--quiet"]
        command = [sys.executable, "-c", "from airrace.__main__ import main; main()", "optimize", str(track), *options]
        subprocess.run(command, check=True)
        return run.read_bytes()


@pytest.fixture(scope="session")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """That file in a folder."""
    run = tmp_path_factory.mktemp("flown") / "rovinj.h5"
    run.write_bytes(flown_file())
    return run


@pytest.fixture(scope="session")
def generators() -> Iterator[dict[str, ModuleType]]:
    """The modules in `scripts/documentation/`, by name."""
    folder = str(ROOT / "scripts" / "documentation")
    sys.path.insert(0, folder)
    yield {name: importlib.import_module(name) for name in MODULES}
    sys.path.remove(folder)
    for name in MODULES:
        del sys.modules[name]
