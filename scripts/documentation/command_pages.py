"""The page of all commands, written from the command line itself, so that it says what `--help` says."""

from collections.abc import Iterator
from typing import Any

import typer
import typer.main

from airrace.cli.main import app

# Any: the classes of commands and parameters are click's, and where they lie depends on typer's version.
Command = Any
Parameter = Any

TITLE = "Commands"
OPENING = (
    "This page is generated from the command line; `airrace COMMAND --help` prints the same text. "
    "[The command line](../command_line.md) explains how the commands belong together."
)


def commands_page() -> str:
    """Every command with its usage, its arguments and its options, as a page of Markdown."""
    sections = [_section(name, command) for name, command in commands()]
    return "\n\n".join([f"# {TITLE}", OPENING, *sections]) + "\n"


def commands() -> Iterator[tuple[str, Command]]:
    """Every command that does something, with the words that call it."""

    def walk(name: str, command: Command) -> Iterator[tuple[str, Command]]:
        if not hasattr(command, "list_commands"):
            yield name, command
            return
        context = typer.Context(command)
        for word in command.list_commands(context):
            yield from walk(f"{name} {word}", command.get_command(context, word))

    yield from walk("airrace", typer.main.get_command(app))


def _section(name: str, command: Command) -> str:
    context = typer.Context(command, info_name=name)
    usage = " ".join(command.get_usage(context).removeprefix("Usage:").split())
    parts = [f"## {name}", command.help.strip(), f"    {usage}"]
    of_kind: dict[str, list[tuple[str, str]]] = {"argument": [], "option": []}
    for parameter in command.get_params(context):
        record = parameter.get_help_record(context)
        if record is not None:
            of_kind[parameter.param_type_name].append(record)
    for kind, records in of_kind.items():
        if records:
            parts.append("\n".join([f"| {kind} | meaning |", "|---|---|", *(_row(*record) for record in records)]))
    return "\n\n".join(parts)


def _row(written: str, meaning: str) -> str:
    """A row of a table; a bar within code ends no cell."""
    return f"| `{' '.join(written.split())}` | {' '.join(meaning.split()).replace('|', chr(92) + '|')} |"
