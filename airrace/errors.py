"""The tree of errors: everything that airrace raises on purpose derives from `AirraceError`."""

import errno
import os
import signal
from dataclasses import dataclass


class AirraceError(Exception):
    """The root of all errors that are raised on purpose; its text is meant for the user."""


@dataclass(frozen=True, order=True)
class Finding:
    """A single fault of an input file.

    `line` and `column` count from 1; both are 0 where the finding concerns the whole file.
    `key` is the dotted path of the entry, e.g. `gates.g4.heading_deg`; empty for syntax errors.
    """

    file: str
    line: int
    column: int
    key: str
    message: str

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}:{self.column}" if self.line else self.file
        return f"{place}: {self.key}: {self.message}" if self.key else f"{place}: {self.message}"


class InputError(AirraceError):
    """An error in the user's input; it carries every finding, or the first of each file where there are very many.

    Attributes:
        findings: sorted by file and place.
        count: of all findings, also of those that are left out.
    """

    def __init__(self, findings: list[Finding], count: int | None = None) -> None:
        self.findings = sorted(findings)
        self.count = len(findings) if count is None else count
        super().__init__("\n".join(str(finding) for finding in self.findings))


class UsageError(AirraceError):
    """A call of a command that cannot work (an output that exists, an unknown stage)."""


class CheckpointError(AirraceError):
    """An error of a checkpoint that cannot be trusted or read."""


class NotCertified(AirraceError):
    """An error of a request that can only be answered for an optimum that holds."""


class StorageError(AirraceError):
    """A refusal of the operating system: the disk is full, permission or memory is lacking."""


class ClusterError(AirraceError):
    """An error of a cluster: its scheduler cannot be reached, or it or its workers cannot be used."""


class OutOfTime(AirraceError):
    """An error of a run that is not finished within the time that it was given; what it has finished is stored."""


class SolverCrash(AirraceError):
    """An error of the solver process, which died or stopped answering.

    Attributes:
        status: that it ended with, negative for a signal; None where it has not died.
    """

    def __init__(self, text: str, status: int | None = None) -> None:
        super().__init__(text)
        self.status = status

    @property
    def is_fault(self) -> bool:
        """Whether it is one of the solver's own code, such as an address that does not exist: others may do better."""
        return self.status in (-signal.SIGSEGV, -signal.SIGABRT, -signal.SIGFPE, -signal.SIGILL)


class KernelError(AirraceError):
    """An error of a function or a variant that the native library cannot evaluate on this processor."""


def is_lack_of_memory(error: BaseException) -> bool:
    """Tell whether an error says that there is not enough memory: for an object, or for a library to be loaded."""
    if isinstance(error, MemoryError) or (isinstance(error, OSError) and error.errno == errno.ENOMEM):
        return True
    # A library that cannot be loaded is an ImportError, or an OSError without a number (ctypes).
    unnumbered = isinstance(error, ImportError | RuntimeError) or (isinstance(error, OSError) and error.errno is None)
    lacking = ("failed to map segment", "cannot allocate memory", "bad_alloc", "can't start new thread")
    return unnumbered and any(text in str(error).lower() for text in lacking)


def debugging() -> bool:
    """Return whether the user asked for tracebacks and for the library's own log, with `AIRRACE_DEBUG`."""
    return os.environ.get("AIRRACE_DEBUG", "0") not in ("", "0")
