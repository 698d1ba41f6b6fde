"""The end of a command: one JSON object or a few lines, and an exit code. Never a raw traceback."""

import json
import logging
import sys
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import asdict

import typer

from airrace import interrupts
from airrace.runs.answer import Answer, record_failure
from airrace.runs.exit_codes import ExitCode, of_error, worst
from airrace.views.plain_text import one_line, styled
from airrace.views.streams import abandon_stdout

FINDINGS_SHOWN = 20
"""The largest number of findings that are printed for people."""


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
    """A handler that prints what libraries and airrace itself log, unless a view of the run under way shows it."""

    def emit(self, record: logging.LogRecord) -> None:
        print(f"airrace: {record.levelname.lower()}: {record.getMessage()}", file=sys.stderr)


def _say(answer: Answer, *, as_json: bool) -> None:
    """Print the answer: the object or the texts on stdout.

    Findings and errors go to stderr either way, for whoever watches a script.
    """
    if answer.error:
        answer.fields["error"] = answer.error
        answer.fields["findings"] = [asdict(finding) for finding in answer.findings]
    texts = [json.dumps(answer.fields, allow_nan=False)] if as_json else answer.texts
    try:
        if texts:
            print("\n\n".join(styled(text).removesuffix("\n") for text in texts))
        sys.stdout.flush()
    except BrokenPipeError:  # the reader has closed the pipe and needs no message
        answer.code = worst((answer.code, ExitCode.SYSTEM))
        abandon_stdout()
    except OSError as error:
        answer.fail(of_error(error), f"cannot write to stdout: {error.strerror}")
        abandon_stdout()
    if answer.code is ExitCode.INTERRUPTED:
        interrupts.hear()  # who listens to signals in another way, as a batch does, has told it by now
    for finding in answer.findings[:FINDINGS_SHOWN]:
        print(one_line(str(finding)), file=sys.stderr)
    if len(answer.findings) > FINDINGS_SHOWN:
        print(f"... (the first {FINDINGS_SHOWN} are shown; --json has more)", file=sys.stderr)
    if answer.error:
        print(f"airrace: {answer.error}", file=sys.stderr)
