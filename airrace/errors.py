"""One tree of errors: everything airrace raises on purpose derives from `AirraceError`."""

import os
from dataclasses import dataclass


class AirraceError(Exception):
    """Root of all errors that are raised on purpose; its text is meant for the user."""


@dataclass(frozen=True, order=True)
class Finding:
    """One thing that is wrong in an input file.

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
    """The user's input is not valid; carries every finding, not only the first."""

    def __init__(self, findings: list[Finding]) -> None:
        self.findings = sorted(findings)
        super().__init__("\n".join(str(finding) for finding in self.findings))


class UsageError(AirraceError):
    """A command was called in a way that cannot work (an output that exists, an unknown stage)."""


class CheckpointError(AirraceError):
    """A checkpoint cannot be trusted or read."""


class NotCertified(AirraceError):
    """What was asked for can only be told of an optimum that holds."""


class StorageError(AirraceError):
    """The system refused: disk full, no permission, no memory."""


class ClusterError(AirraceError):
    """A cluster's scheduler cannot be reached, or it or its workers cannot be used."""


class SolverCrash(AirraceError):
    """The solver process died or stopped answering."""


class KernelError(AirraceError):
    """A compiled kernel could not be built or loaded (the caller falls back to casadi's own evaluation)."""


def debugging() -> bool:
    """Whether the user asked for tracebacks and for the library's own log, with AIRRACE_DEBUG."""
    return os.environ.get("AIRRACE_DEBUG", "0") not in ("", "0")
