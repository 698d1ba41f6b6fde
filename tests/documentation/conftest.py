"""The run with which the code of the pages works, and the site that is built of them."""

import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from disk_cache import cached_across_workers
from pages import ROOT, build


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
    """The file in a folder."""
    run = tmp_path_factory.mktemp("flown") / "rovinj.h5"
    run.write_bytes(flown_file())
    return run


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built site."""
    output = tmp_path_factory.mktemp("site")
    built = build(ROOT, output)
    assert built.returncode == 0, built.stdout + built.stderr
    return output
