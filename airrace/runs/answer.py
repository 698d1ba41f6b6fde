"""The answer of a command or a job: an object for scripts, texts for people, an exit code and a sentence."""

import traceback
from collections.abc import Sequence
from dataclasses import dataclass, field

from airrace import interrupts
from airrace.errors import Finding, InputError, debugging, is_lack_of_memory
from airrace.runs.exit_codes import ExitCode, of_error, worst


@dataclass
class Answer:
    """An answer as far as it is known.

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


def empty_result(track: str | None) -> dict[str, object]:
    """Return the object of a run of which nothing is known yet."""
    return {"track": track, "certified": False, "race_time_s": None, "wall_s": None, "stages": []}


def record_failure(answer: Answer, error: BaseException) -> None:
    """Turn what ended a command's body into its answer's code, sentence and findings."""
    if debugging():
        traceback.print_exception(error)
    if interrupts.caused(error):
        interrupts.hear()
        error = KeyboardInterrupt()
    code = of_error(error)
    match error:
        case InputError():
            count = error.count
            answer.fail(code, f"the input is not valid: {count} finding{'' if count == 1 else 's'}", error.findings)
        case KeyboardInterrupt():
            answer.fail(code, "interrupted")
        case _ if is_lack_of_memory(error):
            answer.fail(code, "out of memory")
        case _ if code is ExitCode.BUG:
            text = " ".join(f"{type(error).__name__}: {error}".split())
            answer.fail(code, f"this is a bug: {text} (AIRRACE_DEBUG=1 shows where)")
        case _:
            answer.fail(code, str(error) or type(error).__name__)
