"""Texts of strangers on a terminal and in pages: names, messages and paths cannot command them.

A track file may name a gate with the sequence that sets a terminal's title, moves its cursor or answers in the user's
name, or with marks that turn the direction of reading. Such characters are shown as what they are, one sign each.
"""

import html
import re
import unicodedata

_CONTROLS = {code: 0x2400 + code for code in range(0x20) if chr(code) not in "\t\n"} | {0x7F: 0x2421}
_UNSEEN = (*range(0x80, 0xA0), 0x061C, 0x200E, 0x200F, *range(0x202A, 0x202F), *range(0x2066, 0x206A))
_NO_CHARACTERS = range(0xD800, 0xE000)  # bytes in names of files that are not UTF-8
_SHOWN = _CONTROLS | dict.fromkeys((*_UNSEEN, *_NO_CHARACTERS), 0xFFFD)
_SHOWN_STYLED = {code: sign for code, sign in _SHOWN.items() if code != 0x1B}
_COMMAND = re.compile(r"\x1b(?!\[[0-9;]*m)")
"""An escape that begins anything but a change of colour or weight."""


def plain(text: str) -> str:
    """Return a text in which control characters are shown instead of obeyed; lines and tabs stay."""
    return text.translate(_SHOWN)


def one_line(text: str) -> str:
    """Return a text in which line breaks and tabs are shown as well, so that it cannot pass for two messages."""
    return plain(text).translate({0x09: 0x2409, 0x0A: 0x240A, 0x2028: 0xFFFD, 0x2029: 0xFFFD})


def escaped(text: str) -> str:
    """Return a text as HTML, apart from what stands around it: names that are read from the right turn nothing else."""
    shown = html.escape(plain(text))
    from_the_right = any(unicodedata.bidirectional(sign) in ("R", "AL", "AN") for sign in text)
    return f"<bdi>{shown}</bdi>" if from_the_right else shown


def styled(text: str) -> str:
    """Return a text in which only colours and weights are obeyed, as of a table that was rendered for a terminal."""
    return _COMMAND.sub(chr(_SHOWN[0x1B]), text).translate(_SHOWN_STYLED)
