"""Texts of strangers cannot command a terminal."""

import html
import io
import re
import subprocess
import sys
import unicodedata
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.table import Table
from rich.text import Text

from airrace.views.plain_console import PlainConsole
from airrace.views.plain_text import escaped, plain, styled
from airrace.views.streams import SafeStream

ROOT = Path(__file__).parents[2]
TITLE = "\x1b]0;pwned\a"
COLOUR = re.compile(r"\x1b\[[0-9;]*m")


def commands(text: str) -> list[str]:
    """The characters that a terminal would obey."""
    return [sign for sign in text if sign not in "\t\n" and unicodedata.category(sign) == "Cc"]


@given(st.text())
def test_no_control_character_is_left(text: str) -> None:
    assert commands(plain(text)) == []
    assert len(plain(text)) == len(text)
    assert plain(plain(text)) == plain(text)


@given(st.text(st.characters(exclude_categories=["Cc", "Cf", "Cs"])))
def test_what_is_harmless_stays_as_it_is(text: str) -> None:
    assert plain(text) == styled(text) == text


@given(st.text(st.sampled_from("\x1b[]0;31mHJ\a\x9bx")))
def test_of_escapes_only_colours_are_left(text: str) -> None:
    assert commands(COLOUR.sub("", styled(text))) == []


def test_the_direction_of_reading_is_not_turned() -> None:
    assert plain("g1\u202e2g") == "g1\ufffd2g"


def test_what_is_no_character_is_shown_as_that() -> None:
    name = b"caf\xe9.yaml".decode("utf-8", "surrogateescape")
    assert plain(name) == styled(name) == "caf\ufffd.yaml"


@given(st.text())
def test_a_text_in_a_page_is_apart_from_the_rest_and_can_be_written(text: str) -> None:
    isolated = escaped(text)
    isolated.encode("utf-8")
    inside = isolated.removeprefix("<bdi>").removesuffix("</bdi>")
    assert not set("<>\"'\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069\x00") & set(inside)
    assert html.unescape(inside) == plain(text)


def test_a_name_that_is_read_from_the_right_is_isolated_in_a_page() -> None:
    assert escaped("\u05e9\u05e2\u05e8 1") == "<bdi>\u05e9\u05e2\u05e8 1</bdi>"
    assert escaped("g1\u202e2g & \u2212 1.5") == "g1\ufffd2g &amp; \u2212 1.5"


def test_a_table_on_a_terminal_keeps_its_own_colours_alone() -> None:
    file = io.StringIO()
    table = Table(title=f"Reno{TITLE}")
    table.add_column(f"gate{TITLE}", style="bold red")
    table.add_row(f"g1{TITLE}")
    table.add_row(Text(f"g2{TITLE}"))
    PlainConsole(file=file, force_terminal=True, color_system="standard", width=60).print(table)
    assert "\x1b[1;31m" in file.getvalue()
    assert commands(COLOUR.sub("", file.getvalue())) == []
    assert file.getvalue().count("pwne") == 4


def test_a_watched_stream_shows_what_a_live_view_would_send() -> None:
    shown, sent = io.StringIO(), io.StringIO()
    SafeStream(shown).write("\x1b[2J")
    SafeStream(SafeStream(sent), commanded=True).write("\x1b[2J")
    assert (shown.getvalue(), sent.getvalue()) == ("␛[2J", "\x1b[2J")


@pytest.mark.parametrize("where", ["the name of the race", "a key", "the file"])
def test_a_hostile_course_commands_no_terminal(where: str, tmp_path: Path) -> None:
    text = (ROOT / "tracks" / "half_cuban_eight.yaml").read_text(encoding="utf-8")
    escaped = r'"\e]0;pwned\a"'
    match where:
        case "the name of the race":
            text = re.sub(r"(?m)^name: .*$", lambda _: f"name: {escaped}", text)
        case "a key":
            text += f"{escaped}: 1\n"
        case _:
            text += "unknown: 1\n"
    path = tmp_path / (f"a{TITLE}.yaml" if where == "the file" else "a.yaml")
    path.write_text(text, encoding="utf-8")
    command = [sys.executable, "-m", "airrace", "check", str(path)]
    ran = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120.0)
    assert ran.returncode == (0 if where == "the name of the race" else 3)
    assert "pwned" in ran.stdout + ran.stderr
    assert commands(ran.stdout + ran.stderr) == []
