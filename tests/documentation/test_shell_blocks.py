"""What the pages tell people to type is something that the command understands."""

import re
import shlex
from collections.abc import Iterator
from typing import cast

import pytest
import typer.core
import typer.main
from pages import PAGES, ROOT, languages, name_of, shell_lines

from airrace.cli.main import app

ENDS = ("|", ">", "&&", ";", "&")
"""Where the shell takes over from the command."""

CALL_ERROR = cast(type[Exception], typer.BadParameter.__base__)
"""The base of all errors in the way a command was called; where it lies depends on typer's version."""


def calls() -> Iterator[tuple[str, list[str]]]:
    """Every call of airrace, as the words that follow it; a call behind `&&` is one of its own."""
    for page, line in shell_lines():
        words = shlex.split(re.sub(r"\[[^]]*\]", "", line), comments=True)
        for start, word in enumerate(words):
            if word != "airrace" or (start and words[start - 1] not in ENDS):
                continue
            end = next((index for index in range(start, len(words)) if words[index] in ENDS), len(words))
            yield page, words[start + 1 : end]


CALLS = list(calls())


def test_the_pages_call_the_command() -> None:
    assert len(CALLS) > 40
    assert {page for page, _ in CALLS} >= {"README.md", "docs/tutorial.md", "docs/command_line.md"}


@pytest.mark.parametrize(("page", "words"), CALLS, ids=[f"{page}: airrace {' '.join(words)}" for page, words in CALLS])
def test_every_call_in_the_pages_is_understood(page: str, words: list[str]) -> None:
    parse(words)


@pytest.mark.parametrize(
    "words", ["optimize --nonsense x.yaml", "optimize", "show x.h5 y.h5", "optimize --alternatives 0 x.yaml"]
)
def test_a_call_that_is_wrong_would_be_found(words: str) -> None:
    with pytest.raises(CALL_ERROR):
        parse(words.split())


def parse(words: list[str]) -> None:
    """Read the words as the command line does, and call nothing."""
    command = typer.main.get_command(app)
    while isinstance(command, typer.core.TyperGroup):
        name, *words = words
        command = command.get_command(typer.Context(command), name)
        assert command is not None, name
    command.make_context("airrace", words)


def test_no_block_is_in_a_language_that_no_test_reads() -> None:
    assert languages() <= {"python", "yaml", "sh", "diff"}


def test_scripts_that_the_pages_run_exist() -> None:
    texts = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    scripts = set(re.findall(r"python ((?:scripts|tests)/[\w/]+\.py)", texts))
    assert len(scripts) > 5
    assert {script for script in scripts if not (ROOT / script).exists()} == set()


def test_a_page_is_named_as_it_lies_in_the_repository() -> None:
    assert name_of(ROOT / "docs" / "how_to" / "ci.md") == "docs/how_to/ci.md"
