"""Whatever happens while a checkpoint is written, its name leads to a whole one."""

import errno
import os
import signal
import stat
import subprocess
import sys
import time
from contextlib import AbstractContextManager
from pathlib import Path

import pytest
from checkpoint_examples import assert_same, example_checkpoint

from airrace.errors import StorageError
from airrace.files.checkpoint import atomic, read_checkpoint, write_checkpoint
from airrace.files.checkpoint.atomic import replace_file, replacing

HERE = str(Path(__file__).parent)

WRITE_ON_A_FULL_DISK = """
import resource, sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from checkpoint_examples import example_checkpoint
from airrace.files.checkpoint import write_checkpoint
from airrace.errors import StorageError
checkpoint = example_checkpoint(intervals=4000)
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))  # the system refuses any further byte, even to root
try:
    write_checkpoint(Path(sys.argv[1]), checkpoint)
except StorageError as error:
    sys.exit(f"refused: {error}")
"""

HOLD_OPEN = """
import sys, time
from pathlib import Path
from airrace.files.checkpoint.atomic import replacing
with replacing(Path(sys.argv[1])) as file:
    file.write(b"half of it")
    file.flush()
    print("begun", flush=True)
    sys.stdin.read()
"""

WRITE_FOR_EVER = """
import itertools, sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from checkpoint_examples import example_checkpoint
from airrace.files.checkpoint import write_checkpoint
checkpoints = [example_checkpoint(intervals=4000), example_checkpoint(intervals=6000)]
for checkpoint in itertools.cycle(checkpoints):
    write_checkpoint(Path(sys.argv[1]), checkpoint)
    print("written", flush=True)
"""


def test_a_full_disk_keeps_the_old_checkpoint_and_leaves_nothing_beside_it(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    write_checkpoint(path, example_checkpoint())
    before = path.read_bytes()
    command = [sys.executable, "-c", WRITE_ON_A_FULL_DISK, str(path), HERE]
    child = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert child.stderr == f"refused: cannot write {path}: File too large\n"
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_killed_writer_leaves_a_whole_checkpoint(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    for delay in (0.0, 0.004, 0.009, 0.017, 0.031):
        command = [sys.executable, "-c", WRITE_FOR_EVER, str(path), HERE]
        with subprocess.Popen(command, stdout=subprocess.PIPE) as child:
            assert child.stdout is not None
            assert child.stdout.readline() == b"written\n"
            time.sleep(delay)
            child.send_signal(signal.SIGKILL)
        intervals = len(read_checkpoint(path).stages[-1].result.trajectory.time) - 1
        assert intervals in (4000, 6000)


@pytest.mark.parametrize("name", ["missing/run.h5", "file/run.h5", "x" * 300])
def test_a_place_that_cannot_be_written_is_a_storage_error(tmp_path: Path, name: str) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(StorageError, match="cannot write"):
        write_checkpoint(tmp_path / name, example_checkpoint())
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]


def test_what_is_no_regular_file_is_not_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    for name in ("pipe", "folder"):
        with pytest.raises(StorageError, match="not a regular file"):
            write_checkpoint(tmp_path / name, example_checkpoint())
    assert stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode)


@pytest.mark.parametrize(
    ("call", "raised", "caught"),
    [
        ("replace", PermissionError(13, "Permission denied"), pytest.raises(StorageError, match="Permission denied")),
        ("fsync", KeyboardInterrupt(), pytest.raises(KeyboardInterrupt)),
    ],
)
def test_a_failed_rename_and_an_interrupt_leave_the_old_file_alone(
    call: str,
    raised: BaseException,
    caught: AbstractContextManager[object],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    path = tmp_path / "run.h5"
    path.write_bytes(b"old")

    def refuse(*_: object) -> None:
        raise raised

    monkeypatch.setattr(os, call, refuse)
    with caught:
        replace_file(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_symbolic_link_is_followed_and_kept(tmp_path: Path) -> None:
    (tmp_path / "runs").mkdir()
    link = tmp_path / "run.h5"
    link.symlink_to("runs/first.h5")
    write_checkpoint(link, example_checkpoint())
    assert link.is_symlink()
    assert_same(read_checkpoint(tmp_path / "runs" / "first.h5").stages, example_checkpoint().stages)


def test_a_new_file_has_the_user_s_usual_permissions(tmp_path: Path) -> None:
    (tmp_path / "usual").touch()
    replace_file(tmp_path / "run.h5", b"new")
    assert (tmp_path / "run.h5").stat().st_mode == (tmp_path / "usual").stat().st_mode


@pytest.mark.parametrize("name", ["x" * 252 + ".h5", "š" * 127])
def test_the_longest_names_can_be_written(tmp_path: Path, name: str) -> None:
    replace_file(tmp_path / name, b"new")
    assert (tmp_path / name).read_bytes() == b"new"


def test_a_file_that_somebody_is_reading_is_replaced_a_moment_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Windows refuses to replace a file that is open."""
    replace, refused = os.replace, [True, True]

    def replace_when_closed(partial: Path, target: Path) -> None:
        if refused:
            refused.pop()
            raise PermissionError(13, "it is being used by another process")
        replace(partial, target)

    monkeypatch.setattr(os, "replace", replace_when_closed)
    path = tmp_path / "run.h5"
    replace_file(path, b"new")
    assert path.read_bytes() == b"new"
    refused += [True] * 10
    with pytest.raises(StorageError, match="being used"):
        replace_file(path, b"newer")
    assert list(tmp_path.iterdir()) == [path]


def beginning(path: Path) -> "subprocess.Popen[bytes]":
    """A process that has begun to write a file and ends when its stdin does."""
    command = [sys.executable, "-c", HOLD_OPEN, str(path)]
    running = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert running.stdout is not None
    assert running.stdout.readline() == b"begun\n"
    return running


@pytest.mark.parametrize("name", ["run.h5", "x" * 60 + ".h5", "[run] (*).h5"])
def test_what_killed_writers_have_left_goes_with_the_next_writing_and_what_live_ones_write_stays(
    tmp_path: Path, name: str
) -> None:
    path = tmp_path / name
    with beginning(path) as killed, beginning(path) as alive, beginning(tmp_path / "other.h5") as other:
        for one in (killed, other):
            one.kill()
            one.wait()
        assert len(list(tmp_path.iterdir())) == 3
        replace_file(path, b"new")
        assert path.read_bytes() == b"new"
        left = sorted(entry.name[:6] for entry in tmp_path.iterdir() if entry != path)
        assert left == sorted([f".{name[:5]}", ".other"])
        alive.communicate()
    assert alive.returncode == 0
    assert path.read_bytes() == b"half of it"
    replace_file(tmp_path / "other.h5", b"new")
    assert sorted(tmp_path.iterdir()) == sorted([path, tmp_path / "other.h5"])


def test_many_who_write_one_file_at_once_do_not_hinder_one_another(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    program = """
import sys
from pathlib import Path
from airrace.files.checkpoint.atomic import replace_file
for _ in range(100):
    replace_file(Path(sys.argv[1]), b"x" * 10_000)
"""
    running = [subprocess.Popen([sys.executable, "-c", program, str(path)]) for _ in range(4)]
    assert [one.wait() for one in running] == [0] * 4
    assert list(tmp_path.iterdir()) == [path]
    assert path.read_bytes() == b"x" * 10_000


def test_where_files_cannot_be_locked_they_are_written_and_only_without_any_locks_what_was_left_goes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    path, left = tmp_path / "run.h5", tmp_path / ".run.h5.0123abcd.partial"
    left.write_bytes(b"half of it")
    monkeypatch.setattr(atomic.fcntl, "flock", refuse)
    replace_file(path, b"new")
    assert sorted(tmp_path.iterdir()) == [left, path]
    monkeypatch.setattr(atomic, "fcntl", None)  # as on Windows
    replace_file(path, b"newer")
    assert list(tmp_path.iterdir()) == [path]
    assert path.read_bytes() == b"newer"


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o444, 0o666])
def test_who_may_read_a_file_stays_as_it_was(tmp_path: Path, mode: int) -> None:
    path = tmp_path / "run.h5"
    replace_file(path, b"old")
    path.chmod(mode)
    with replacing(path) as file:
        (partial,) = tmp_path.glob(".*.partial")
        assert stat.S_IMODE(partial.stat().st_mode) == mode
        file.write(b"new")
    assert path.read_bytes() == b"new"
    assert stat.S_IMODE(path.stat().st_mode) == mode
