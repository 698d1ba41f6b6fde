"""Exit codes: every error has one, and of several the right one is told."""

import itertools

import pytest

from airrace import errors
from airrace.runs.command_result import PRECEDENCE, ExitCode, of_error, worst

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


def test_of_two_codes_the_graver_one_is_told_in_any_order() -> None:
    documented = [130, 1, 8, 7, 3, 5, 6, 4, 0]
    for graver, milder in itertools.combinations(documented, 2):
        assert worst([ExitCode(milder), ExitCode(graver)]) == graver
        assert worst([ExitCode(graver), ExitCode(milder)]) == graver


def test_nothing_wrong_is_done() -> None:
    assert worst([]) is ExitCode.DONE
