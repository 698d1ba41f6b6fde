"""How a command ends: one JSON object or a few lines, and an exit code. Never a raw traceback."""

import json
import logging
import os
import sys
import traceback
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field

import typer

from airrace.errors import Finding, InputError
from airrace.runs.exit_codes import ExitCode, of_error, worst


@dataclass
class Answer:
    """What a command has to say so far.

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
        """Record a failure; of several, the one that takes precedence speaks."""
        if code is self.code or worst((self.code, code)) is not code:
            return
        self.code, self.error, self.findings = code, error, findings


def unflown(track: str | None) -> dict[str, object]:
    """The object of a run of which nothing is known yet."""
    return {"track": track, "certified": False, "race_time_s": None, "wall_s": None, "stages": []}


@contextmanager
def answering(fields: Mapping[str, object] | None = None, *, as_json: bool) -> Generator[Answer, None, None]:
    """Run a command's body; turn whatever it raises into its answer, print it, and leave with its exit code.

    Args:
        fields: what the object holds from the start, so that its shape does not depend on how far the command came.
        as_json: print the object on stdout.

    Raises:
        typer.Exit: with the code, unless it is 0.
    """
    answer = Answer(dict(fields or {}))
    warnings = _Warnings(logging.WARNING)
    logging.getLogger().addHandler(warnings)
    try:
        yield answer
    except (Exception, KeyboardInterrupt) as error:  # the edge of the program: every error ends here
        record_failure(answer, error)
    finally:
        logging.getLogger().removeHandler(warnings)
    _say(answer, as_json=as_json)
    if answer.code is not ExitCode.DONE:
        raise typer.Exit(int(answer.code))


class _Warnings(logging.Handler):
    """Says what libraries log, this one among them, unless a view of the run under way shows it."""

    def emit(self, record: logging.LogRecord) -> None:
        print(f"airrace: {record.levelname.lower()}: {record.getMessage()}", file=sys.stderr)


def debugging() -> bool:
    """Whether the user asked for tracebacks and the library's own log."""
    return os.environ.get("AIRRACE_DEBUG", "0") not in ("", "0")


def record_failure(answer: Answer, error: BaseException) -> None:
    """Turn what ended a command's body into its answer's code, sentence and findings."""
    if debugging():
        traceback.print_exception(error)
    code = of_error(error)
    match error:
        case InputError():
            count = len(error.findings)
            answer.fail(code, f"the input is not valid: {count} finding{'' if count == 1 else 's'}", error.findings)
        case KeyboardInterrupt():
            answer.fail(code, "interrupted")
        case MemoryError():
            answer.fail(code, "out of memory")
        case _ if code is ExitCode.BUG:
            text = " ".join(f"{type(error).__name__}: {error}".split())
            answer.fail(code, f"this is a bug: {text} (AIRRACE_DEBUG=1 shows where)")
        case _:
            answer.fail(code, str(error) or type(error).__name__)


def _say(answer: Answer, *, as_json: bool) -> None:
    """stdout gets the object or the texts; the words go to stderr either way, for whoever watches a script."""
    if answer.error:
        answer.fields["error"] = answer.error
        answer.fields["findings"] = [asdict(finding) for finding in answer.findings]
    texts = [json.dumps(answer.fields, allow_nan=False)] if as_json else answer.texts
    try:
        if texts:
            print("\n\n".join(text.removesuffix("\n") for text in texts))
        sys.stdout.flush()
    except BrokenPipeError:  # a reader that has seen enough needs no telling
        answer.code = worst((answer.code, ExitCode.SYSTEM))
        _abandon_stdout()
    except OSError as error:
        answer.fail(of_error(error), f"cannot write to stdout: {error.strerror}")
        _abandon_stdout()
    for finding in answer.findings:
        print(finding, file=sys.stderr)
    if answer.error:
        print(f"airrace: {answer.error}", file=sys.stderr)


def _abandon_stdout() -> None:
    """What is still buffered cannot be written either; let the interpreter's last flush go nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
