"""The native library is chosen by processor or by name, and done without where it is missing."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from kernel_results import variants

from airrace.errors import KernelError
from airrace.optimal_control.native import library as module
from airrace.optimal_control.native.library import library, library_path, open_library

PRINT = """from airrace.optimal_control.native.library import library
found = library()
print(found.variant if found else None)"""


def chosen(**environment: str) -> str:
    """The variant that a process with this environment takes."""
    command = [sys.executable, "-P", "-c", PRINT]
    ran = subprocess.run(command, env={**os.environ, **environment}, capture_output=True, text=True, check=True)
    return ran.stdout.strip()


def test_the_widest_variant_is_taken_unless_another_is_named() -> None:
    known = list(variants())
    assert chosen(AIRRACE_NATIVE="") == known[-1]
    for name in known:
        assert chosen(AIRRACE_NATIVE=name) == name
    assert chosen(AIRRACE_NATIVE="off") == chosen(AIRRACE_NATIVE="mmx") == "None"


def test_a_variant_that_the_processor_does_not_execute_is_refused() -> None:
    path = library_path()
    assert path is not None
    with pytest.raises(KernelError, match="no variant mmx"):
        open_library(path, "mmx")


def test_a_file_that_cannot_be_loaded_is_done_without(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    broken = tmp_path / "airrace_native.so"
    broken.write_bytes(b"no library")
    monkeypatch.setattr(module, "library_path", lambda: broken)
    library.cache_clear()
    try:
        assert library() is None
    finally:
        library.cache_clear()
    assert "casadi evaluates, slower" in caplog.text
