"""Errors, their exit codes, and those of the operating system."""

import ast
import errno
import itertools
import subprocess
import sys
from pathlib import Path

import pytest

from airrace import errors
from airrace.__main__ import exit_code
from airrace.errors import OutOfTime, is_lack_of_memory
from airrace.runs.command_result import PRECEDENCE, CommandResult, ExitCode, of_error, record_failure, worst

EXPECTED = {
    errors.InputError([]): 3,
    errors.UsageError("x"): 2,
    errors.CheckpointError("x"): 7,
    errors.NotCertified("x"): 5,
    errors.StorageError("x"): 8,
    errors.ClusterError("x"): 8,
    errors.SolverCrash("x"): 8,
    MemoryError(): 8,
    OSError(28, "no space"): 8,
    KeyboardInterrupt(): 130,
    ZeroDivisionError(): 1,
    errors.KernelError("should have been handled"): 1,
}


@pytest.mark.parametrize("error", EXPECTED, ids=lambda error: type(error).__name__)
def test_every_error_has_its_code(error: BaseException) -> None:
    assert of_error(error) == EXPECTED[error]


def test_every_code_has_one_rank() -> None:
    assert sorted(PRECEDENCE) == sorted(ExitCode)


def test_of_two_codes_the_graver_one_is_reported_in_any_order() -> None:
    documented = [130, 1, 8, 7, 3, 5, 6, 4, 0]
    for graver, milder in itertools.combinations(documented, 2):
        assert worst([ExitCode(milder), ExitCode(graver)]) == graver
        assert worst([ExitCode(graver), ExitCode(milder)]) == graver


def test_nothing_wrong_is_done() -> None:
    assert worst([]) is ExitCode.DONE


ROOT = Path(__file__).parents[2]
UNMAPPED = "libhdf5-9e18f0c6.so.320.0.0: failed to map segment from shared object"


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        ImportError(UNMAPPED),
        ImportError("x.so: Cannot allocate memory"),
        OSError("libcasadi.so: failed to map segment from shared object"),  # as ctypes raises it
        OSError(errno.ENOMEM, "Cannot allocate memory"),
    ],
)
def test_lack_of_memory_is_the_systems_and_reported_as_that(error: Exception) -> None:
    answer = CommandResult()
    record_failure(answer, error)
    assert (answer.code, answer.error) == (ExitCode.SYSTEM, "out of memory")


@pytest.mark.parametrize(
    "error", [OSError("libcasadi.so: cannot open shared object file"), OSError(errno.EIO, UNMAPPED)]
)
def test_other_errors_of_libraries_and_files_are_no_lack_of_memory(error: OSError) -> None:
    assert not is_lack_of_memory(error)


def test_lack_of_memory_outside_of_a_command_is_reported_likewise(capsys: pytest.CaptureFixture[str]) -> None:
    assert exit_code(OSError("libcasadi.so: failed to map segment from shared object")) == ExitCode.SYSTEM
    assert capsys.readouterr().err == "airrace: out of memory\n"


def test_a_library_that_is_not_there_is_a_bug() -> None:
    assert of_error(ImportError("No module named 'nowhere'")) is ExitCode.BUG


def test_a_run_out_of_time_is_a_timeout() -> None:
    assert of_error(OutOfTime("there is no time left")) is ExitCode.TIMEOUT


PROGRAM = """
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, ({limit}, {limit}))
sys.argv = ["airrace", "check", "half_cuban_eight"]
from airrace.__main__ import main
main()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="limits the address space")
def test_too_little_memory_for_the_libraries_is_reported_in_a_sentence() -> None:
    """No limit is too small for the interpreter and large enough for all that is loaded."""
    limit = 160 * 2**20
    ran = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(limit=limit)],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
        cwd=ROOT,
        env={"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PATH": "/usr/bin:/bin"},
    )
    assert ran.returncode == ExitCode.SYSTEM, ran.stderr
    assert "out of memory" in ran.stderr
    assert "Traceback" not in ran.stderr


LIMITED = """
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, ({limit}, {limit}))
sys.argv = ["airrace", *{arguments!r}]
from airrace.__main__ import main
main()
"""
COMMANDS = (
    ("check", "half_cuban_eight"),
    ("optimize", "half_cuban_eight", "--until", "point-mass", "--guess", "plan", "--search", "off"),
    ("batch", "half_cuban_eight", "--until", "point-mass", "--set", "settings.guess=plan", "--retries", "0"),
)


@pytest.mark.skipif(sys.platform != "linux", reason="limits the address space")
@pytest.mark.parametrize("mebibytes", [100, 200, 240])
@pytest.mark.parametrize("arguments", COMMANDS, ids=lambda arguments: arguments[0])
def test_too_little_address_space_is_no_bug_and_no_traceback(
    arguments: tuple[str, ...], mebibytes: int, tmp_path: Path
) -> None:
    ran = subprocess.run(
        [sys.executable, "-c", LIMITED.format(limit=mebibytes * 2**20, arguments=arguments)],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
        cwd=tmp_path,
    )
    assert ran.returncode == ExitCode.SYSTEM or (ran.returncode, arguments[0]) == (0, "check"), ran.stderr
    assert "Traceback" not in ran.stderr
    assert "Error" not in ran.stderr
    assert "bug" not in ran.stderr
    if ran.returncode:
        assert "out of memory" in ran.stderr


def test_every_error_that_is_raised_says_something() -> None:
    """Its text is meant for the user, so none is raised as a class alone or without arguments."""
    meant = {name for name, kind in vars(errors).items() if isinstance(kind, type) and issubclass(kind, Exception)}
    silent: list[str] = []
    for path in Path(errors.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            raised = node.exc if isinstance(node, ast.Raise) else None
            said = raised.args if isinstance(raised, ast.Call) else []
            kind = raised.func if isinstance(raised, ast.Call) else raised
            if isinstance(kind, ast.Name) and kind.id in meant and not said:
                silent.append(f"{path.name}:{node.lineno}: {kind.id}")
    assert silent == []
