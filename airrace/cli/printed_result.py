"""What commands print: tables and pictures as text, and in the end one JSON object or a few lines, and an exit code.

Never a raw traceback.
"""

import codecs
import io
import json
import logging
import math
import shlex
import sys
import textwrap
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from airrace.errors import UsageError
from airrace.pages.views.plain_text import keep_colours, one_line
from airrace.pages.views.tables import Table
from airrace.runs.command_result import CommandResult, ExitCode, of_error, record_failure
from airrace.runtime import interrupts
from airrace.runtime.standard_streams import ONE_ON_STDOUT, STANDARD, abandon_stdout

if TYPE_CHECKING:
    from rich.console import RenderableType

FINDINGS_SHOWN = 20
"""The largest number of findings that are printed for people."""
UNLIMITED_WIDTH = 200
"""Columns that are enough for every table where no terminal sets a limit."""
PAGE = 80
"""Columns of a page: of tables that are wrapped to it where no terminal sets a limit."""


@dataclass
class PrintedResult(CommandResult):
    """The result of a command on the command line.

    Attributes:
        as_json: whether its object is printed instead of its texts.
        quiet: whether neither is, but what goes wrong.
    """

    as_json: bool = False
    quiet: bool = False

    @property
    def shows(self) -> bool:
        """Whether texts are printed; where not, they need not be made."""
        return not self.as_json and not self.quiet

    def ensure_room(self, *outputs: Path | None) -> None:
        """Refuse to write more than one thing to stdout; texts are left out where something else goes there.

        Raises:
            UsageError: there would be two.
        """
        if [*outputs, STANDARD if self.as_json else None].count(STANDARD) > 1:
            raise UsageError(ONE_ON_STDOUT)
        self.quiet = self.quiet or STANDARD in outputs

    def add(self, *contents: "Table | RenderableType", columns: int = UNLIMITED_WIDTH) -> None:
        """Add tables, pictures or texts to what is printed for people."""
        if self.shows:
            self.texts += [
                content if isinstance(content, str) else render(content, columns=columns) for content in contents
            ]

    def add_files(self, *paths: Path | None, remark: str = "", **fields: object) -> None:
        """Fill in the result of a command that has written files; one that was written to stdout is left out.

        Args:
            paths: the files; None where none was asked for.
            remark: what there is to be said of them, a clause.
            fields: what else the object holds.
        """
        files = [path for path in paths if path is not None and path != STANDARD]
        self.fields.update(fields, written=[{"path": str(path), "bytes": path.stat().st_size} for path in files])
        self.add(*(f"{path} is written{remark}" for path in files))


@contextmanager
def printed_result(
    *, as_json: bool, quiet: bool = False, verbose: bool = False
) -> Generator[PrintedResult, None, None]:
    """Run a command's body; turn whatever it raises into its result, print it, and leave with its exit code.

    Args:
        as_json: print the object on stdout.
        quiet: print no texts.
        verbose: print the library's own log on stderr.

    Raises:
        typer.Exit: with the code, unless it is 0.
    """
    command_result = PrintedResult(as_json=as_json, quiet=quiet)
    log = _Log()
    logging.getLogger().addHandler(log)
    logging.getLogger("airrace").setLevel(logging.INFO if verbose else logging.NOTSET)
    try:
        yield command_result
    except (Exception, KeyboardInterrupt) as error:  # the edge of the program: every error ends here
        record_failure(command_result, error)
    finally:
        logging.getLogger().removeHandler(log)
    _print_result(command_result, as_json=as_json)
    if command_result.code is not ExitCode.DONE:
        raise typer.Exit(int(command_result.code))


class _Log(logging.Handler):
    """A handler that prints what libraries and airrace itself log, unless a view of the run under way shows it."""

    def emit(self, record: logging.LogRecord) -> None:
        print(f"airrace: {record.levelname.lower()}: {record.getMessage()}", file=sys.stderr)


def _print_result(command_result: CommandResult, *, as_json: bool) -> None:
    """Print the result: the object or the texts on stdout.

    Findings and errors go to stderr either way, where a script logs them.
    """
    if command_result.error:
        command_result.fields["error"] = command_result.error
        command_result.fields["findings"] = [asdict(finding) for finding in command_result.findings]
    texts = [json_line(command_result.fields)] if as_json else command_result.texts
    try:
        if texts:
            print("\n\n".join(keep_colours(text).removesuffix("\n") for text in texts))
        sys.stdout.flush()
    except BrokenPipeError:  # the reader has seen enough
        abandon_stdout()
    except OSError as error:
        command_result.fail(of_error(error), f"cannot write to stdout: {error.strerror}")
        abandon_stdout()
    if command_result.code is ExitCode.INTERRUPTED:
        interrupts.acknowledge()  # who listens to signals in another way, as a batch does, has set that up by now
    for finding in command_result.findings[:FINDINGS_SHOWN]:
        print(one_line(str(finding)), file=sys.stderr)
    if len(command_result.findings) > FINDINGS_SHOWN:
        print(f"... (the first {FINDINGS_SHOWN} are shown; --json has more)", file=sys.stderr)
    if command_result.error:
        print(_for_stderr(f"airrace: {command_result.error}"), file=sys.stderr)


def _for_stderr(message: str) -> str:
    """Return a message in one line, for whatever reads it; on a terminal that is too narrow for it in several."""
    if not sys.stderr.isatty():
        return message
    from rich.console import Console  # imported here, for it takes 0.05 s to load

    return "\n".join(
        textwrap.fill(line, Console(stderr=True).width, break_on_hyphens=False, break_long_words=False)
        for line in message.splitlines()
    )


def json_line(fields: Mapping[str, object]) -> str:
    """Return an object as JSON in a line that no runner of workflows obeys: `##`, of texts alone, is escaped."""
    return json.dumps(fields, allow_nan=False).replace("##", r"#\u0023")


def render(content: "Table | RenderableType", *, columns: int = UNLIMITED_WIDTH) -> str:
    """Return a table or a picture as text for stdout.

    Without a terminal the text is plain, whatever the environment says of colours; where stdout takes no Unicode, rules
    are of ASCII.

    Where a terminal is too narrow for a table, columns that can be missed are left out, and then words are broken. What
    is still too wide keeps its width, and the terminal wraps its lines: a number cut short would be a wrong one.

    Args:
        content: what is shown.
        columns: to use where there is no terminal; more where the content cannot be narrower.
    """
    from airrace.pages.views.terminal import PlainConsole  # imported here, for it takes 0.05 s to load

    terminal = sys.stdout.isatty()
    buffer = io.BytesIO()
    text = io.TextIOWrapper(buffer, encoding=_encoding(), errors="backslashreplace", newline="\n")
    console = PlainConsole(
        file=text,
        force_terminal=terminal,
        no_color=None if terminal else True,
        width=None if terminal else columns,
        highlight=False,
    )
    free = console.options.update(max_width=UNLIMITED_WIDTH)

    def narrowest(table: Table) -> int:
        return console.measure(table.rich(), options=free).minimum

    if isinstance(content, Table) and terminal:
        content = _fitted(content, console.width, narrowest)
    drawing = content.rich() if isinstance(content, Table) else content
    console.width = max(console.width, console.measure(drawing, options=free).minimum)
    console.print(drawing)
    text.flush()
    return "\n".join(line.rstrip() for line in buffer.getvalue().decode(_encoding()).splitlines())


def _fitted(table: Table, columns: int, narrowest: Callable[[Table], int]) -> Table:
    """Return a table without the columns that a terminal is too narrow for; if that does not do, its words are broken.

    Args:
        table: as it would be shown where nothing sets a limit.
        columns: of the terminal.
        narrowest: returns the columns that a table needs.
    """
    while narrowest(table) > columns and (narrowed := table.narrowed()) is not None:
        table = narrowed
    if narrowest(table) > columns:
        broken = [column if column.form else replace(column, wraps=True) for column in table.columns]
        table = replace(table, columns=broken)
    return table


def paragraph(text: str, *, begin: str = "", page: int = PAGE) -> str:
    """Return a text in lines that fit the terminal and are no longer than a page; names stay whole.

    Args:
        text: without line breaks.
        begin: stands before it; later lines are set below what comes after that.
        page: columns of the page.
    """
    return textwrap.fill(
        text,
        min(terminal_columns() or page, page),
        initial_indent=begin,
        subsequent_indent=len(begin) * " ",
        break_on_hyphens=False,
        break_long_words=False,
    )


def command_lines(words: Sequence[str], begin: str) -> str:
    """Return a command as a shell takes it, over several lines where the terminal is too narrow for one.

    Args:
        words: of the command, each quoted by itself.
        begin: stands before it.
    """
    columns, lines = terminal_columns() or UNLIMITED_WIDTH, [begin]
    for word in map(shlex.quote, words):
        if len(lines[-1]) + len(word) + 2 > columns and lines[-1].strip():
            lines[-1] += "\\"
            lines.append(" " * (len(begin) + 2))
        lines[-1] += f"{word} "
    return "\n".join(line.rstrip() for line in lines)


def takes_unicode() -> bool:
    """Return whether stdout can show more than ASCII."""
    return _encoding().startswith("utf")


def full_columns(table: Table) -> int:
    """Return the columns that a table takes where nothing limits it."""
    from airrace.pages.views.terminal import PlainConsole  # as above

    return PlainConsole(file=io.StringIO(), width=10_000).measure(table.rich()).maximum  # columns that limit no table


def terminal_columns() -> int | None:
    """Return the columns of the terminal behind stdout; None if there is none."""
    from rich.console import Console  # as above

    return Console().width if sys.stdout.isatty() else None


def number(value: float, digits: int) -> str:
    """Return a number with so many decimals, a dash where it is not finite."""
    return f"{value:z.{digits}f}" if math.isfinite(value) else "-"


def _encoding() -> str:
    """Return the encoding of stdout, as Python spells it."""
    return codecs.lookup(sys.stdout.encoding or "utf-8").name
