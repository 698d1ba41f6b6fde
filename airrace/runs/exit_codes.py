"""Exit codes: what the shell learns of a run."""

from collections.abc import Iterable
from enum import IntEnum

from airrace.errors import (
    CheckpointError,
    ClusterError,
    InputError,
    NotCertified,
    OutOfTime,
    SolverCrash,
    StorageError,
    UsageError,
    is_lack_of_memory,
)


class ExitCode(IntEnum):
    """An exit code of a command; scripts may rely on their values."""

    DONE = 0
    BUG = 1
    USAGE = 2
    INVALID_INPUT = 3
    INFEASIBLE = 4
    NOT_CERTIFIED = 5
    TIMEOUT = 6
    BAD_CHECKPOINT = 7
    SYSTEM = 8
    INTERRUPTED = 130


PRECEDENCE = (
    ExitCode.INTERRUPTED,
    ExitCode.BUG,
    ExitCode.SYSTEM,
    ExitCode.BAD_CHECKPOINT,
    ExitCode.INVALID_INPUT,
    # A usage error ends a command before anything else can go wrong; its rank only completes the order.
    ExitCode.USAGE,
    ExitCode.NOT_CERTIFIED,
    ExitCode.TIMEOUT,
    ExitCode.INFEASIBLE,
    ExitCode.DONE,
)


def worst(codes: Iterable[ExitCode]) -> ExitCode:
    """Return the one code that is reported when several apply; `DONE` without any."""
    return min(codes, key=PRECEDENCE.index, default=ExitCode.DONE)


def of_error(error: BaseException) -> ExitCode:
    """Return the code of an exception that ended a command; one that nobody foresaw is a bug."""
    match error:
        case KeyboardInterrupt():
            return ExitCode.INTERRUPTED
        case UsageError():
            return ExitCode.USAGE
        case InputError():
            return ExitCode.INVALID_INPUT
        case NotCertified():
            return ExitCode.NOT_CERTIFIED
        case OutOfTime():
            return ExitCode.TIMEOUT
        case CheckpointError():
            return ExitCode.BAD_CHECKPOINT
        case StorageError() | ClusterError() | SolverCrash() | OSError():
            return ExitCode.SYSTEM
        case _ if is_lack_of_memory(error):
            return ExitCode.SYSTEM
        case _:
            return ExitCode.BUG
