"""Compiled or not, a kernel is the same function; and without a compiler everything still works."""

import contextlib
import logging
import os
import pickle
import signal
import stat
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kept import compile_quickly
from kernel_comparison import needs_compiler
from small_problems import rich_system

from airrace.optimal_control import kernel_library
from airrace.optimal_control.background_compilation import FIRST_RUN, is_first_run
from airrace.optimal_control.compiler_process import AUTOGROUP, PRIORITY
from airrace.optimal_control.kernel_library import cache_folder, find_compiler
from airrace.optimal_control.kernels import Kernel, Kernels, build_kernels, compile_kernels, needs_compiling, prepare
from airrace.optimal_control.one_at_a_time import alone
from airrace.optimal_control.runge_kutta import DORMAND_PRINCE_5, RK4

posix_only = pytest.mark.skipif(os.name != "posix", reason="asks for owners and modes of files")
SLOW_COMPILER = """#!/bin/sh
touch "$STARTED"
exec sleep 60
"""


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty kernel cache."""
    folder = tmp_path / "kernels"
    monkeypatch.setenv("AIRRACE_CACHE_DIR", str(folder))
    return folder


@pytest.fixture
def quick_cache(cache: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty kernel cache, for kernels that are compiled quickly."""
    compile_quickly(monkeypatch)
    return cache


@pytest.fixture
def no_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "")


def evaluations(kernel: Kernel, seed: int) -> list[np.ndarray]:
    """All outputs of a kernel's functions at a random point, the same for every kernel of these sizes."""
    random = np.random.default_rng(seed)
    point = [random.normal(size=kernel.hessian.size1_in(index)) for index in range(4)]
    outputs = [kernel.value(*point[:3]), *kernel.jacobian(*point[:3]), *kernel.hessian(*point)]
    return [np.asarray(one.full()) for one in outputs]


def assert_same(one: Kernels, other: Kernels) -> None:
    assert one.path is not None
    assert other.path is not None
    for seed in range(3):
        for mine, yours in ((one.step, other.step), (one.path, other.path)):
            for value, expected in zip(evaluations(mine, seed), evaluations(yours, seed), strict=True):
                assert value == pytest.approx(expected, rel=1e-12, abs=1e-12)


@needs_compiler
@pytest.mark.usefixtures("quick_cache")
@pytest.mark.parametrize("scheme", [RK4, DORMAND_PRINCE_5])
def test_compiled_kernels_equal_the_virtual_machine(scheme) -> None:
    compiled = build_kernels(rich_system(), scheme, compiled=True)
    assert compiled.compiled
    assert_same(compiled, build_kernels(rich_system(), scheme, compiled=False))


@pytest.mark.usefixtures("no_compiler")
def test_without_a_compiler_the_virtual_machine_takes_over(cache: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, logger="airrace"):
        kernels = build_kernels(rich_system(), RK4, compiled=True)
    assert not kernels.compiled
    assert [record.levelname for record in caplog.records] == ["WARNING"]
    assert "compiler" in caplog.text
    assert_same(kernels, build_kernels(rich_system(), RK4, compiled=False))
    assert not list(cache.glob("*"))


def test_a_compiler_that_fails_leaves_no_trace(
    cache: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("CC", "false")
    assert not build_kernels(rich_system(), RK4, compiled=True).compiled
    assert "false failed" in caplog.text
    assert not list(cache.glob("*"))


def test_a_cache_that_cannot_be_written_is_done_without(
    cache: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache.parent.joinpath("file").write_text("not a folder")
    monkeypatch.setenv("AIRRACE_CACHE_DIR", str(cache.parent / "file" / "kernels"))
    assert not build_kernels(rich_system(), RK4, compiled=True).compiled
    assert "cache" in caplog.text or "compiler" in caplog.text


@needs_compiler
def test_the_second_build_needs_no_compiler(quick_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = build_kernels(rich_system(), RK4, compiled=True)
    kept = {path: path.stat().st_mtime_ns for path in quick_cache.iterdir()}
    assert len(list(quick_cache.glob("*.so"))) == 1
    monkeypatch.setenv("CC", "")
    second = build_kernels(rich_system(), RK4, compiled=True)
    assert second.compiled
    assert_same(first, second)
    assert {path: path.stat().st_mtime_ns for path in quick_cache.iterdir()} == kept


@needs_compiler
def test_compiling_is_announced_only_where_it_will_happen(quick_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert needs_compiling(rich_system(), RK4)
    monkeypatch.setenv("CC", "")
    assert not needs_compiling(rich_system(), RK4)
    monkeypatch.delenv("CC")
    build_kernels(rich_system(), RK4, compiled=True)
    assert not needs_compiling(rich_system(), RK4)


def truncated(library: bytes) -> bytes:
    return library[: len(library) // 2]


def flipped(library: bytes) -> bytes:
    middle = len(library) // 2
    return library[:middle] + bytes([library[middle] ^ 1]) + library[middle + 1 :]


@needs_compiler
@pytest.mark.parametrize("damage", [truncated, flipped, lambda library: b"", lambda library: b"not a library"])
def test_a_damaged_library_is_compiled_again(
    quick_cache: Path, damage: Callable[[bytes], bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    build_kernels(rich_system(), RK4, compiled=True)
    (library,) = quick_cache.glob("*.so")
    whole = library.read_bytes()
    library.unlink()  # a new file: the old one is mapped into this process
    damaged = damage(whole)
    library.write_bytes(damaged)
    monkeypatch.setenv("CC", "")
    assert not build_kernels(rich_system(), RK4, compiled=True).compiled
    monkeypatch.delenv("CC")
    again = build_kernels(rich_system(), RK4, compiled=True)
    assert again.compiled
    assert library.read_bytes() != damaged
    assert_same(again, build_kernels(rich_system(), RK4, compiled=False))


@needs_compiler
def test_every_scheme_has_its_own_library(quick_cache: Path) -> None:
    build_kernels(rich_system(), RK4, compiled=True)
    build_kernels(rich_system(), DORMAND_PRINCE_5, compiled=True)
    assert len(list(quick_cache.glob("*.so"))) == 2


def test_cache_folder_follows_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("AIRRACE_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "airrace" / "kernels"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert cache_folder() == tmp_path / ".cache" / "airrace" / "kernels"


@needs_compiler
def test_kernels_prepared_in_the_background_need_no_compiler_later(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for scheme in (RK4, DORMAND_PRINCE_5):
        prepare(rich_system(), scheme)
    deadline = time.monotonic() + 120.0
    while any(needs_compiling(rich_system(), scheme) for scheme in (RK4, DORMAND_PRINCE_5)):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    monkeypatch.setenv("CC", "")
    for scheme in (RK4, DORMAND_PRINCE_5):
        prepared = build_kernels(rich_system(), scheme, compiled=True)
        assert prepared.compiled
        assert_same(prepared, build_kernels(rich_system(), scheme, compiled=False))
    while len(list(cache.iterdir())) > 4:  # the last lock is given back
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_the_first_run_is_told_from_later_ones_by_the_age_of_the_cache(cache: Path) -> None:
    assert is_first_run()
    cache.mkdir()
    library = cache / "some.so"
    library.touch()
    assert is_first_run()
    os.utime(library, times=(time.time() - 2.0 * FIRST_RUN,) * 2)
    (cache / "newer.so").touch()
    assert not is_first_run()


@needs_compiler
def test_a_preparation_that_failed_is_made_up_for(quick_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "false")
    prepare(rich_system(), RK4)
    monkeypatch.delenv("CC")
    assert build_kernels(rich_system(), RK4, compiled=True).compiled


@needs_compiler
def test_what_is_there_is_not_prepared_again(quick_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    build_kernels(rich_system(), RK4, compiled=True)
    monkeypatch.setattr(subprocess, "Popen", lambda *_, **__: pytest.fail("a process was started"))
    prepare(rich_system(), RK4)


@pytest.mark.usefixtures("no_compiler")
def test_without_a_compiler_nothing_is_prepared(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(subprocess, "Popen", lambda *_, **__: pytest.fail("a process was started"))
    prepare(rich_system(), RK4)
    assert not cache.exists()


@contextlib.contextmanager
def preparing(folder: Path, *, own_session: bool = False) -> Iterator[subprocess.Popen[bytes]]:
    """A process that prepares kernels with a compiler that never ends, and has come as far as to start it."""
    compiler, started = folder / "slow-compiler", folder / "started"
    compiler.write_text(SLOW_COMPILER)
    compiler.chmod(0o755)
    environment = dict(os.environ, CC=str(compiler), STARTED=str(started))
    command = [sys.executable, "-m", "airrace.optimal_control.compiler_process"]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stderr=pipe, env=environment, start_new_session=own_session) as process:
        assert process.stdin is not None
        process.stdin.write(pickle.dumps((environment, rich_system(), RK4)))
        process.stdin.close()
        deadline = time.monotonic() + 60.0
        while not started.exists() and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.02)
        yield process
        process.send_signal(signal.SIGTERM)


def test_a_preparation_that_is_ended_leaves_nothing_behind(cache: Path, tmp_path: Path) -> None:
    with preparing(tmp_path) as process:
        assert {one.suffix for one in cache.iterdir()} == {".lock", ".parts"}
        process.send_signal(signal.SIGTERM)
        assert process.wait(timeout=30.0) == 128 + signal.SIGTERM
        assert process.stderr is not None
        assert process.stderr.read() == b""
    assert not list(cache.iterdir())


@pytest.mark.skipif(
    not AUTOGROUP.exists() or not AUTOGROUP.read_text(),  # it is empty where processes are grouped otherwise
    reason="priorities count beyond sessions",
)
@pytest.mark.usefixtures("cache")
def test_a_preparation_gives_way_beyond_its_session_and_lowers_no_other(tmp_path: Path) -> None:
    here = AUTOGROUP.read_text()
    for own_session in (False, True):
        folder = tmp_path / str(own_session)
        folder.mkdir()
        with preparing(folder, own_session=own_session) as process:
            lowered = min(19, os.getpriority(os.PRIO_PROCESS, 0) + PRIORITY)
            assert os.getpriority(os.PRIO_PROCESS, process.pid) == lowered
            group = Path(f"/proc/{process.pid}/autogroup").read_text()
            assert group.split()[-1] == (str(PRIORITY) if own_session else here.split()[-1])
    assert AUTOGROUP.read_text() == here


COUNTING_COMPILER = """#!/bin/sh
for argument; do case "$argument" in *.c) echo "$argument" >> "$COUNTED";; esac; done
exec {compiler} "$@"
"""


@pytest.fixture
def counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A file with a line for every source that is compiled."""
    compiler, lines = tmp_path / "counting-compiler", tmp_path / "counted"
    compiler.write_text(COUNTING_COMPILER.format(compiler=find_compiler()))
    compiler.chmod(0o755)
    lines.touch()
    monkeypatch.setenv("CC", str(compiler))
    monkeypatch.setenv("COUNTED", str(lines))
    return lines


@needs_compiler
def test_processes_do_not_compile_the_same_system_side_by_side(cache: Path, counted: Path) -> None:
    order = pickle.dumps((dict(os.environ), rich_system(), RK4))
    command = [sys.executable, "-m", "airrace.optimal_control.compiler_process"]
    processes = [subprocess.Popen(command, stdin=subprocess.PIPE) for _ in range(3)]
    for process in processes:
        assert process.stdin is not None
        process.stdin.write(order)
        process.stdin.close()
    assert [process.wait() for process in processes] == [0, 0, 0]
    compiled = [Path(line).name for line in counted.read_text().splitlines()]
    assert len(compiled) == len(set(compiled))
    assert {one.suffix for one in cache.iterdir()} == {".so", ".sha256"}


@needs_compiler
def test_what_an_ended_process_has_compiled_is_not_compiled_again(
    quick_cache: Path, counted: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    finish = kernel_library._finish
    finished: list[object] = []

    def ended_after_two(*work: Any) -> None:
        finish(*work)
        finished.append(work)
        if len(finished) == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr(kernel_library, "_finish", ended_after_two)
    with pytest.raises(KeyboardInterrupt):
        compile_kernels(rich_system(), RK4, at_once=1)
    assert len(list(quick_cache.glob("*.parts/*.o"))) == 2
    before = len(counted.read_text().splitlines())
    compile_kernels(rich_system(), RK4, at_once=1)
    compiled = [Path(line).name for line in counted.read_text().splitlines()]
    assert not {*compiled[:2]} & {*compiled[before:]}
    assert {one.suffix for one in quick_cache.iterdir()} == {".so", ".sha256"}


def test_a_lock_whose_holder_died_is_free(tmp_path: Path) -> None:
    path = tmp_path / "some.lock"
    program = f"""
import os, pathlib, signal
from airrace.optimal_control.one_at_a_time import alone
with alone(pathlib.Path({str(path)!r})):
    os.kill(os.getpid(), signal.SIGKILL)
"""
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == -signal.SIGKILL
    assert path.exists()
    with alone(path):
        pass
    assert not path.exists()


@needs_compiler
@posix_only
def test_a_library_that_somebody_else_may_have_written_is_compiled_again(cache: Path) -> None:
    build_kernels(rich_system(), RK4, compiled=True)
    (library,) = cache.glob("*.so")
    assert (mode_of(cache), mode_of(library)) == (0o700, 0o600)
    library.chmod(0o620)
    assert needs_compiling(rich_system(), RK4)
    library.chmod(0o600)
    cache.chmod(0o777)
    assert needs_compiling(rich_system(), RK4)
    build_kernels(rich_system(), RK4, compiled=True)
    assert mode_of(cache) == 0o755
    assert not needs_compiling(rich_system(), RK4)


@needs_compiler
@posix_only
def test_the_folder_of_somebody_else_is_not_used_and_it_is_said(
    cache: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    cache.mkdir()
    monkeypatch.setattr(os, "geteuid", lambda: cache.stat().st_uid + 1)
    if cache.stat().st_uid == 0:
        os.chown(cache, 54321, -1)  # what belongs to root is trusted
    assert not build_kernels(rich_system(), RK4, compiled=True).compiled
    assert "belongs to another user" in caplog.text
    assert list(cache.iterdir()) == []


def test_a_user_without_a_home_has_a_cache_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    for name in ("AIRRACE_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(Path, "home", homeless)
    assert cache_folder() == Path(tempfile.gettempdir()) / f"airrace-kernels-{os.geteuid()}"


def mode_of(path: Path) -> int:
    """The permissions of a file or folder."""
    return stat.S_IMODE(path.stat().st_mode)
