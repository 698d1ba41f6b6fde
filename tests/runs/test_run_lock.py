"""One run is flown by one process at a time."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from airrace.errors import UsageError
from airrace.runs.execute import run_lock
from airrace.runs.output import ensure_free

HOLDER = """
import sys
from pathlib import Path
from airrace.runs.execute import run_lock
with run_lock(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "run.h5"


def test_second_process_is_refused_until_the_first_has_ended(path: Path) -> None:
    command = [sys.executable, "-c", HOLDER, str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(UsageError, match=r"run\.h5 is being written by another process"), run_lock(path):
            pass
        holder.kill()
        holder.wait()
        with run_lock(path):
            pass


def test_link_to_a_run_is_the_same_run(path: Path) -> None:
    link = path.with_name("link.h5")
    link.symlink_to(path)
    with run_lock(path), pytest.raises(UsageError, match="being written"), run_lock(link):
        pass


def test_nothing_is_left_behind(path: Path) -> None:
    with run_lock(path):
        assert [one.name for one in path.parent.iterdir()] == [".run.h5.lock"]
    assert list(path.parent.iterdir()) == []


def test_runs_in_memory_and_in_folders_that_take_no_files_need_no_lock(tmp_path: Path) -> None:
    with run_lock(None), run_lock(tmp_path / "missing" / "run.h5"):
        pass


def test_output_on_a_circle_of_links_is_refused(tmp_path: Path) -> None:
    from airrace.errors import StorageError
    from airrace.files.checkpoint.atomic import replace_file

    (tmp_path / "one.h5").symlink_to("two.h5")
    (tmp_path / "two.h5").symlink_to("one.h5")
    with pytest.raises(StorageError, match="it is a link that leads in a circle"):
        ensure_free(tmp_path / "one.h5", force=True)
    with pytest.raises(StorageError, match="too many levels"):
        replace_file(tmp_path / "one.h5", b"new")
    assert os.readlink(tmp_path / "one.h5") == "two.h5"
