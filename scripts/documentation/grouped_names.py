"""Docstrings as mkdocstrings reads them: an entry for every name, and for every option of a command.

Its reader knows one name per entry, so `north, east: position, m` becomes an entry for each. What an option of a
command means stands in its annotation, and becomes an entry where the docstring has none.
"""

import inspect
import re
from importlib import import_module

from griffe import Extension, Function, Object

from airrace.options import Option

GROUPED = re.compile(r"^    (?P<names>\w+(?:, \w+)+): (?P<text>.*(?:\n {8}.*)*)", re.MULTILINE)
SECTION = re.compile(r"^(?=(?:Returns|Raises):$)", re.MULTILINE)


def separated(docstring: str) -> str:
    """The docstring with an entry for every name."""

    def entries(found: re.Match[str]) -> str:
        return "\n".join(f"    {name}: {found['text']}" for name in found["names"].split(", "))

    return GROUPED.sub(entries, docstring)


def with_options(docstring: str, function: object) -> str:
    """The docstring of a command's function with an entry for every option."""
    entries = [
        f"    {name}: {option.help}\n"
        for name, parameter in inspect.signature(function).parameters.items()
        for option in getattr(parameter.annotation, "__metadata__", ())
        if isinstance(option, Option) and f"\n    {name}: " not in docstring
    ]
    if not entries:
        return docstring
    if "\nArgs:\n" in docstring:
        return docstring.replace("\nArgs:\n", f"\nArgs:\n{''.join(entries)}", 1)
    before, *after = SECTION.split(docstring, maxsplit=1)
    return f"{before.rstrip()}\n\nArgs:\n{''.join(entries)}\n{''.join(after)}"


class GroupedNames(Extension):
    """Completes the docstrings of everything that is shown."""

    def on_object(self, *, obj: Object, **_: object) -> None:
        """Called for every object that was read."""
        if obj.docstring:
            obj.docstring.value = separated(obj.docstring.value)
            if isinstance(obj, Function) and obj.path.startswith("airrace.api.") and obj.parent.is_module:
                function = getattr(import_module(obj.parent.path), obj.name)
                obj.docstring.value = with_options(obj.docstring.value, function)
