"""Names in GitHub's Markdown: none of them is a link, a mention, emphasis or code, and words stay readable."""

import html
import re

import pytest

from airrace.pages.views.plain_text import escape_markdown

REFERENCE = re.compile(r"#\d|\bgh-\d|@\w|://|www\.|\b[0-9a-f]{7,40}\b", re.IGNORECASE)
COMMENT = "<!-- -->"


def rendered(text: str) -> str:
    """What a reader sees."""
    return html.unescape(re.sub(r"\\([!-/:-@\[-`{-~])", r"\1", text.replace(COMMENT, "")))


@pytest.mark.parametrize(
    "name",
    [
        *("#12", "gate #12", "gh-3", "GH-3", "owner/repo#4", "@team", "a@b.org", "http://a.b", "WWW.a.b"),
        *("deadbee", "0123456789abcdef0123456789abcdef01234567", "gates 1234567, 7654321"),
    ],
)
def test_what_is_rendered_holds_no_reference_in_one_piece(name: str) -> None:
    """GitHub looks for references in what was rendered, so neither a backslash nor an entity hides one."""
    shown = escape_markdown(name)
    assert REFERENCE.search(name)
    assert not any(REFERENCE.search(rendered(piece)) for piece in shown.split(COMMENT))
    assert rendered(shown) == name


@pytest.mark.parametrize("name", ["*a*", "**a**", "_b_", "__b__", "a _b_ c", "~c~", "`d`", "[e](f)", "a|b", "\\*"])
def test_marks_are_shown_as_they_are(name: str) -> None:
    shown = escape_markdown(name)
    assert not re.search(r"(?<!\\)[*~`\[\]|]|(?<!\\)\b_|_\b(?<!\\_)", shown.replace("\\\\", ""))
    assert rendered(shown) == name


@pytest.mark.parametrize("name", ["half_cuban_eight", "Rovinj 2014", "1:g4 -> 1:g5", "high-3", "60.123", "decade_x"])
def test_names_without_marks_stay_as_they_are(name: str) -> None:
    assert escape_markdown(name) == name
