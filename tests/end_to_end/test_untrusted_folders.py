"""An untrusted working directory holds files with the names of Python's modules: none of them is ever run."""

import subprocess
import sys
from pathlib import Path

import pytest
from airrace_command import airrace
from clusters import Cluster
from every_command import BATCH, COMMANDS, OPTIMIZE, RUN, furnish

MARK = "executed"
NAMES = ("numpy", "types")
"""A library's, which processes import late, and one of those that Python itself imports as it starts."""
LEAVES_A_MARK = f"open(__file__ + '.{MARK}', 'w').close()\n"


def untrusted(folder: Path) -> Path:
    """Fill a folder with such modules, and with inputs."""
    for name in NAMES:
        (folder / f"{name}.py").write_text(LEAVES_A_MARK, encoding="utf-8")
    return furnish(folder)


def assert_nothing_was_executed(folder: Path) -> None:
    assert not list(folder.glob(f"*.{MARK}"))
    assert not (folder / "__pycache__").exists()


def test_python_itself_does_run_them(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "airrace", "tracks"]
    subprocess.run(command, cwd=untrusted(tmp_path), capture_output=True, check=False)
    assert list(tmp_path.glob(f"*.{MARK}"))


STARTS = [
    (*OPTIMIZE, "--search", "quick", "--threads", "2"),
    BATCH,
    ("export", "parquet", RUN),
    ("plot", RUN),
    ("--help",),
]
"""One of each kind: with solvers, with jobs, with large libraries imported late, with none."""


@pytest.mark.parametrize(
    "command",
    [pytest.param(words, id=" ".join(words), marks=() if words in STARTS else pytest.mark.slow) for words in COMMANDS],
)
def test_no_command_runs_a_file_of_the_working_directory(command: tuple[str, ...], tmp_path: Path) -> None:
    ran = airrace(*command, cwd=untrusted(tmp_path))
    assert ran.code == 0, ran.err
    assert_nothing_was_executed(tmp_path)


@pytest.mark.slow
def test_no_worker_of_a_cluster_runs_a_file_of_its_working_directory(tmp_path: Path) -> None:
    with Cluster(untrusted(tmp_path)) as cluster:
        cluster.worker()
        ran = airrace(*BATCH, "--cluster", cluster.address, cwd=tmp_path)
    assert ran.code == 0, ran.err
    assert_nothing_was_executed(tmp_path)
