"""The result of a command or a job: an object for scripts, texts for people, an exit code and a sentence."""

import traceback
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import TYPE_CHECKING

from airrace.errors import (
    CheckpointError,
    ClusterError,
    Finding,
    InputError,
    NotCertified,
    OutOfTime,
    SolverCrash,
    StorageError,
    UsageError,
    debugging,
    is_lack_of_memory,
)
from airrace.runtime import interrupts
from airrace.runtime.process import SYSTEM_ERROR

if TYPE_CHECKING:
    from airrace.flights.results import Verification


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
    SYSTEM = SYSTEM_ERROR
    INTERRUPTED = interrupts.EXIT_CODE


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
    """Return the code of an exception that ended a command; an unforeseen one is a bug."""
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


@dataclass
class CommandResult:
    """A result as far as it is known.

    Attributes:
        fields: the object printed with `--json`; a failing command prints what it holds by then.
        code: the exit code.
        error: one sentence on what went wrong; empty if nothing did.
        findings: what is wrong with the input files.
        texts: what is printed on stdout without `--json`, in order, an empty line between two.
    """

    fields: dict[str, object] = field(default_factory=dict[str, object])
    code: ExitCode = ExitCode.DONE
    error: str = ""
    findings: Sequence[Finding] = ()
    texts: list[str] = field(default_factory=list[str])

    def fail(self, code: ExitCode, error: str, findings: Sequence[Finding] = ()) -> None:
        """Record a failure; of several, the one that takes precedence is reported."""
        if code is self.code or worst((self.code, code)) is not code:
            return
        self.code, self.error, self.findings = code, error, findings

    def fail_if_refuted(self, verifications: "Mapping[str, Verification | None]") -> None:
        """Record the failure of the first verification that failed of those that are shown, by what they are called."""
        for name, verification in verifications.items():
            if verification is not None and verification.refutation:
                self.fail(ExitCode.NOT_CERTIFIED, f"{name}: {verification.refutation}")


def empty_result(track: str | None) -> dict[str, object]:
    """Return the object of a run of which nothing is known yet."""
    return {"track": track, "certified": False, "race_time_s": None, "wall_s": None, "stages": []}


def record_failure(command_result: CommandResult, error: BaseException) -> None:
    """Turn what ended a command's body into its result's code, sentence and findings."""
    if debugging():
        traceback.print_exception(error)
    if interrupts.caused(error):
        interrupts.acknowledge()
        error = KeyboardInterrupt()
    code = of_error(error)
    match error:
        case InputError():
            count = error.count
            command_result.fail(
                code, f"the input is not valid: {count} finding{'' if count == 1 else 's'}", error.findings
            )
        case KeyboardInterrupt():
            command_result.fail(code, "interrupted")
        case _ if is_lack_of_memory(error):
            command_result.fail(code, "out of memory")
        case _ if code is ExitCode.BUG:
            text = " ".join(f"{type(error).__name__}: {error}".split())
            command_result.fail(code, f"this is a bug: {text} (AIRRACE_DEBUG=1 shows where)")
        case _:
            command_result.fail(code, str(error) or type(error).__name__)
