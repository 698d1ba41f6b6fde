"""The `airrace` command and its subcommands.

The modules of the commands import nothing heavy; each command imports what it needs when it is called.
"""

import sys
from typing import Annotated, cast

import typer

from airrace.cli.aircraft import aircraft, fit
from airrace.cli.batch import batch, handicap, sweep
from airrace.cli.command import Command
from airrace.cli.courses import check, design, doctor, init, schema, tracks
from airrace.cli.flights import brief, card, compare, export, film, follow, import_log, plot, report
from airrace.cli.optimize import optimize, resume, sensitivity, show, verify
from airrace.cli.printed_result import json_line
from airrace.cli.safety import footprint, safety
from airrace.runs.command_result import ExitCode

app = typer.Typer(
    name="airrace",
    help="Find the fastest flight through an air-race course.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.add_typer(export)
for _name, _command in {
    "optimize": optimize,
    "resume": resume,
    "import": import_log,
    "report": report,
    "film": film,
    "card": card,
    "show": show,
    "brief": brief,
    "compare": compare,
    "follow": follow,
    "plot": plot,
    "verify": verify,
    "sensitivity": sensitivity,
    "footprint": footprint,
    "safety": safety,
    "check": check,
    "design": design,
    "batch": batch,
    "sweep": sweep,
    "handicap": handicap,
    "tracks": tracks,
    "init": init,
    "aircraft": aircraft,
    "fit": fit,
    "schema": schema,
    "doctor": doctor,
}.items():
    app.command(_name, cls=Command)(_command)

# The base of all errors in a command's arguments. It belongs to click, whose place depends on typer's version.
_CallError = cast(type[typer.BadParameter], typer.BadParameter.__base__)


def _print_version(print_version: bool) -> None:
    if print_version:
        from importlib.metadata import version

        print(f"airrace {version('airrace')}")
        raise typer.Exit


@app.callback()
def common(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and leave.")
    ] = False,
) -> None:
    """Find the fastest flight through an air-race course."""


def run() -> int:
    """Run the command of `sys.argv`; return its exit code.

    Raises:
        BaseException: an interrupt, or what became of one, or stdout that cannot be written, outside of a command's
            own body.
    """
    try:
        code = app(standalone_mode=False)
    except _CallError as error:
        _refuse(error, as_json="--json" in sys.argv)
        return int(ExitCode.USAGE)
    except typer.Abort as error:  # into which typer turns the end of the input
        raise KeyboardInterrupt from error
    except SystemExit as error:  # which typer makes of a reader of its help that has gone
        raise error.__context__ or error from None
    return int(code or 0)


def _refuse(error: typer.BadParameter, *, as_json: bool) -> None:
    """Print why no command was run; a script that reads stdout learns it, too."""
    if as_json:
        print(json_line({"error": error.format_message(), "findings": []}))
    error.show()
