"""Texts of strangers on a terminal and in pages, and the streams they go through: names cannot command them.

A track file may name a gate with the sequence that sets a terminal's title, moves its cursor or answers in the user's
name, or with marks that turn the direction of reading. Such characters are shown as what they are, one sign each.
"""

import contextlib
import html
import io
import os
import re
import sys
import textwrap
import unicodedata
from typing import Any, TextIO, cast

_CONTROLS = {code: 0x2400 + code for code in range(0x20) if chr(code) not in "\t\n"} | {0x7F: 0x2421}
_UNSEEN = (*range(0x80, 0xA0), 0x061C, 0x200E, 0x200F, *range(0x202A, 0x202F), *range(0x2066, 0x206A))
_NO_CHARACTERS = (*range(0xD800, 0xE000), 0xFFFE, 0xFFFF)  # bytes in names of files that are not UTF-8; none of XML
_SHOWN = _CONTROLS | dict.fromkeys((*_UNSEEN, *_NO_CHARACTERS), 0xFFFD)
_SHOWN_STYLED = {code: sign for code, sign in _SHOWN.items() if code != 0x1B}
_COMMAND = re.compile(r"\x1b(?!\[[0-9;]*m)")
"""An escape that begins anything but a change of colour or weight."""
_TO_A_RUNNER = re.compile(r"^([^\S\n]*:):|(##\w*)\[", re.MULTILINE)
"""How commands to runners of workflows begin: `::` at the start of a line (GitHub), `##[` or `##vso[` anywhere."""
_LINKED = re.compile(r":(?=//)|www(?=\.)|[@#]|\bgh(?=-\d)", re.IGNORECASE)
"""The beginning of what GitHub's Markdown makes a link or a mention of without any marks around it.

An address, a mention, an issue (`#12`, `owner/name#12`, `GH-12`).
"""
_COMMIT = re.compile(r"(?<![a-z\d])[a-f\d]{7,}(?![a-z\d])", re.IGNORECASE)
"""What GitHub makes a link of where a commit has that number."""
_MARKS = re.compile(r"[\\`*~\[\]|]|_(?![^\W_])|(?<![^\W_])_")
"""Marks of Markdown; an underscore within a word is none."""


def plain(text: str) -> str:
    """Return a text in which control characters are shown instead of obeyed; lines and tabs stay."""
    return text.translate(_SHOWN)


def one_line(text: str) -> str:
    """Return a text in which line breaks and tabs are shown as well, so that it cannot pass for two messages."""
    return plain(text).translate({0x09: 0x2409, 0x0A: 0x240A, 0x2028: 0xFFFD, 0x2029: 0xFFFD})


def inert(text: str) -> str:
    """Return a text, as long as before, of which no line is a command to a runner of workflows that reads along."""
    return _TO_A_RUNNER.sub(lambda match: f"{match[1]}\N{RATIO}" if match[1] else f"{match[2]}\uff3b", text)


def escape_markdown(text: str) -> str:
    """Return a text as one line of GitHub's Markdown, also of a table: it is no link, mention, emphasis, code or HTML.

    What a repository itself has declared to be a reference, such as `TICKET-12`, becomes a link all the same.
    """
    shown = " ".join(plain(text).split()).replace("&", "&amp;").replace("<", "&lt;")
    shown = _MARKS.sub(r"\\\g<0>", shown)
    # GitHub looks for these in what was rendered, where backslashes and entities are gone: a comment parts the text.
    shown = _LINKED.sub(r"\g<0><!-- -->", shown)
    return _COMMIT.sub(lambda match: "<!-- -->".join(textwrap.wrap(match[0], 6)), shown)


def escape_html(text: str) -> str:
    """Return a text as HTML, apart from what stands around it: names that are read from the right turn nothing else."""
    shown = html.escape(plain(text))
    from_the_right = any(unicodedata.bidirectional(sign) in ("R", "AL", "AN") for sign in text)
    return f"<bdi>{shown}</bdi>" if from_the_right else shown


def keep_colours(text: str) -> str:
    """Return a text in which only colours and weights are obeyed, as of a table that was rendered for a terminal.

    No line of it is a command to a runner of workflows either.
    """
    return inert(_COMMAND.sub(chr(_SHOWN[0x1B]), text).translate(_SHOWN_STYLED))


class SafeStream(io.TextIOBase):
    """A stream whose reader may have gone: what cannot be written is lost, and nothing else is.

    Progress and messages go through it. A full disk behind `2>`, or a reader that has gone away, must not end a run.
    Lines that begin with a name are no commands to a runner of workflows, however many pieces they come in.

    Args:
        stream: what is written to; of another watched stream, the one behind it.
        commanded: whether control characters in the texts are meant for the terminal, as those of a live view are, and
            not to be shown as what they are; or lines for a runner of workflows.
    """

    def __init__(self, stream: TextIO, *, commanded: bool = False) -> None:
        self._stream: TextIO = stream._stream if isinstance(stream, SafeStream) else stream
        self._commanded = commanded
        self._line = ""  # that is not ended yet

    def write(self, text: str) -> int:
        """Write a text, or lose it; return its length."""
        with contextlib.suppress(OSError, ValueError):  # ValueError: the stream is closed
            self._stream.write(text if self._commanded else self._shown(text))
        return len(text)

    def _shown(self, text: str) -> str:
        whole = self._line + plain(text)
        self._line = whole.rpartition("\n")[2]
        return inert(whole)[len(whole) - len(text) :]

    def flush(self) -> None:
        """Write what is buffered, or lose it."""
        with contextlib.suppress(OSError, ValueError):
            self._stream.flush()

    def isatty(self) -> bool:
        """Tell whether it is a terminal."""
        return not self._stream.closed and self._stream.isatty()

    def fileno(self) -> int:
        """Return the file descriptor."""
        return self._stream.fileno()

    @property
    def encoding(self) -> str:  # pyright: ignore[reportIncompatibleVariableOverride] as a property it can be read as well
        """The encoding of the stream."""
        return self._stream.encoding

    @property
    def errors(self) -> str | None:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The treatment of characters that the encoding lacks."""
        return self._stream.errors

    @property
    def buffer(self) -> Any:  # Any: as `TextIO.buffer` of streams without one
        """The binary stream behind it."""
        return self._stream.buffer


class PlainStream(io.TextIOBase):
    """A stream of a long text for people or programs, in which control characters are shown as in `keep_colours`.

    Args:
        stream: what is written to.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write a text; return its length."""
        self._stream.write(keep_colours(text))
        return len(text)


def secure() -> None:
    """Make the standard streams such that a command can be run.

    A descriptor that the shell has closed (`>&-`) is taken by something that only looks like it, so that no file that
    is opened later gets its number and, with it, what is printed: stdout refuses to be written, stdin is empty and
    stderr loses what is written to it. A name that the encoding of stdout lacks is printed with backslashes. What
    stderr refuses is lost.
    """
    for descriptor, flags in ((0, os.O_RDONLY), (1, os.O_RDONLY), (2, os.O_WRONLY)):
        if not _is_open(descriptor):
            os.open(os.devnull, flags)  # gets the lowest number that is free: this one
    sys.stdin = sys.stdin or _stream(0, "r")
    sys.stdout = sys.stdout or _stream(1, "w")
    sys.stderr = sys.stderr or _stream(2, "w")
    cast(io.TextIOWrapper, sys.stdout).reconfigure(errors="backslashreplace")
    if not isinstance(sys.stderr, SafeStream):
        sys.stderr = SafeStream(sys.stderr)


def _stream(descriptor: int, mode: str) -> TextIO:
    """Open a stream that lives as long as the process."""
    return cast(TextIO, open(descriptor, mode, encoding="utf-8", closefd=False))


def _is_open(descriptor: int) -> bool:
    try:
        os.fstat(descriptor)
    except OSError:
        return False
    return True
