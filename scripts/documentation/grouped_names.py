"""Docstrings in which several names share a description, `north, east: position, m`, for mkdocstrings.

The reader of docstrings knows one name per entry. So such an entry becomes one for each name.
"""

import re

from griffe import Extension, Object

GROUPED = re.compile(r"^    (?P<names>\w+(?:, \w+)+): (?P<text>.*(?:\n {8}.*)*)", re.MULTILINE)


def separated(docstring: str) -> str:
    """The docstring with an entry for every name."""

    def entries(found: re.Match[str]) -> str:
        return "\n".join(f"    {name}: {found['text']}" for name in found["names"].split(", "))

    return GROUPED.sub(entries, docstring)


class GroupedNames(Extension):
    """Separates the names in the docstrings of everything that is shown."""

    def on_object(self, *, obj: Object, **_: object) -> None:
        """Called for every object that was read."""
        if obj.docstring:
            obj.docstring.value = separated(obj.docstring.value)
