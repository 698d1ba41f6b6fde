"""A safe and strict reader of YAML, which constructs no Python objects from the text.

The text is parsed event by event with a limit on depth and size, by libyaml where PyYAML includes it (several times
faster), else by PyYAML's own parser; libyaml's composer, which recurses without limit, is not used. Anchors, aliases
and tags are refused, a duplicate key is an error, and plain scalars follow the core schema of YAML 1.2 (`1e3` is a
number; `no`, `on` and `12:30` are text) instead of PyYAML's YAML 1.1. `012`, `.nan` and `.inf` are refused.
"""

import math
import re
from collections.abc import Iterator

import yaml

from airrace.errors import Finding, InputError
from airrace.files.inputs.nodes import (
    DEPTH_MAX,
    KEY_LENGTH_MAX,
    REREAD_MAX,
    SIZE_MAX,
    VALUES_MAX,
    KeyPath,
    MappingEntry,
    MappingNode,
    Node,
    Place,
    ScalarNode,
    ScalarValue,
    SequenceNode,
    dotted,
)

Loader = type[yaml.SafeLoader]
PURE: Loader = yaml.SafeLoader
FAST: Loader = getattr(yaml, "CSafeLoader", PURE)

_NULL = re.compile(r"(|~|null|Null|NULL)")
_BOOLEAN = re.compile(r"(true|True|TRUE|false|False|FALSE)")
_INTEGER = re.compile(r"([-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+)")
_LEADING_ZERO = re.compile(r"[-+]?0[0-9]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_FORBIDDEN = re.compile("[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufefe\uff00-\ufffd\U00010000-\U0010ffff]")
_NOT_FINITE = re.compile(r"([-+]?(\.inf|\.Inf|\.INF)|\.nan|\.NaN|\.NAN)")


def plain_scalar(text: str) -> ScalarValue:
    """Return the value of an unquoted scalar.

    Raises:
        ValueError: the scalar is refused; its text says why.
    """
    if _NULL.fullmatch(text):
        return None
    if _BOOLEAN.fullmatch(text):
        return text.lower() == "true"
    if _LEADING_ZERO.fullmatch(text):
        digits = text.lstrip("+-0") or "0"
        raise ValueError(f"`{text}` is ambiguous (YAML 1.1 takes it as octal); write `{digits}`, or quote it as text")
    if _NOT_FINITE.fullmatch(text):
        raise ValueError(f"`{text}` is not a finite number; leave the key out where there is no limit")
    if _INTEGER.fullmatch(text):
        return _integer(text)
    if _FLOAT.fullmatch(text):
        value = float(text)
        if not math.isfinite(value):
            raise ValueError(f"`{text}` is too large for a number")
        return value
    return text


def is_plain_text(text: str) -> bool:
    """Return whether a scalar of this text, unquoted, is this very text: no number, no truth value, and not refused."""
    try:
        return plain_scalar(text) == text
    except ValueError:
        return False


def quote(text: str) -> str:
    """Return a text as a double-quoted scalar, which is read back as this very text."""
    letters = ""
    for letter in text:
        if letter in '"\\':
            letters += "\\" + letter
        else:
            letters += letter if letter.isprintable() else f"\\U{ord(letter):08x}"
    return f'"{letters}"'


def _integer(text: str) -> int:
    base = {"0o": 8, "0x": 16}.get(text[:2], 10)
    # 20 digits are enough for every number of 64 bits; more would only take time to convert.
    value = int(text, base) if len(text.lstrip("+-")) <= 20 else 2**63
    if abs(value) >= 2**63:
        raise ValueError(f"`{text[:24]}` is too large for a whole number")
    return value


def read_yaml(file: str, text: str, loader: Loader = FAST) -> Node:
    """Return the content of a YAML text as a tree.

    Args:
        file: the name findings carry.
        text: one YAML document.
        loader: whose parser makes the events.

    Raises:
        InputError: the text is refused; it carries every finding, up to a syntax error, which ends the reading.
    """
    if len(text) > SIZE_MAX:
        raise InputError([Finding(file, 0, 0, "", f"is too large: at most {SIZE_MAX} characters are read")])
    _check_characters(file, text)
    reader = _TreeBuilder(file)
    try:
        node = reader.document(_events(text, loader))
    except _Abort:
        raise InputError(reader.findings) from None
    except yaml.MarkedYAMLError as error:
        if loader is not PURE and len(text) <= REREAD_MAX:
            read_yaml(file, text, PURE)
        raise InputError([*reader.findings, _syntax_error(file, error)]) from None
    if reader.findings:
        raise InputError(reader.findings)
    return node


def _check_characters(file: str, text: str) -> None:
    """Refuse control characters, byte order marks and the like, which are no part of YAML."""
    if match := _FORBIDDEN.search(text):
        line = text.count("\n", 0, match.start()) + 1
        column = match.start() - text.rfind("\n", 0, match.start())
        message = f"the character U+{ord(match.group()):04X} is not allowed in YAML"
        raise InputError([Finding(file, line, column, "", message)])


def _events(text: str, loader: Loader) -> Iterator[yaml.Event]:
    # ignore: the stub leaves the stream and the events of `parse` untyped.
    return yaml.parse(text, Loader=loader)  # pyright: ignore[reportUnknownMemberType, reportUnknownVariableType]


def _syntax_error(file: str, error: yaml.MarkedYAMLError) -> Finding:
    mark = error.problem_mark or error.context_mark
    message = f"not valid YAML: {error.problem or error.context or 'cannot be parsed'}"
    if error.problem and "'\\t'" in error.problem:
        message = "not valid YAML: a tab; indent with spaces"
    return Finding(file, mark.line + 1 if mark else 0, mark.column + 1 if mark else 0, "", message)


class _Abort(Exception):
    """A signal that reading on would be useless or dangerous; the reason is among the findings."""


class _TreeBuilder:
    """A builder of nodes from events, which lives for one text."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.findings: list[Finding] = []
        self._nodes = 0

    def document(self, events: Iterator[yaml.Event]) -> Node:
        node: Node | None = None
        for event in events:
            if isinstance(event, (yaml.StreamStartEvent, yaml.StreamEndEvent, yaml.DocumentEndEvent)):
                continue
            if isinstance(event, yaml.DocumentStartEvent):
                if node is not None:
                    self._refuse(event, (), "a second YAML document (`---`); one file holds one document")
                    raise _Abort
                continue
            node = self._node(event, events, ())
        if node is None:
            self.findings.append(Finding(self.file, 0, 0, "", "is empty"))
            raise _Abort
        return node

    def _node(self, event: yaml.Event, events: Iterator[yaml.Event], path: KeyPath) -> Node:
        place = self._place(event)
        self._nodes += 1
        if self._nodes > VALUES_MAX:
            self._refuse(event, (), f"more than {VALUES_MAX} values; nothing behind this one is read")
            raise _Abort
        if isinstance(event, yaml.AliasEvent):
            self._refuse(event, path, f"aliases (`*{event.anchor}`) are not supported; write the value out")
            return ScalarNode(place, None)
        self._refuse_decoration(event, path)
        if isinstance(event, yaml.ScalarEvent):
            return ScalarNode(place, self._scalar(event, path))
        if len(path) >= DEPTH_MAX:
            self._refuse(event, (), f"nested more than {DEPTH_MAX} levels deep")
            raise _Abort
        if isinstance(event, yaml.SequenceStartEvent):
            return SequenceNode(place, tuple(self._items(events, path)))
        return MappingNode(place, self._entries(events, path))

    def _items(self, events: Iterator[yaml.Event], path: KeyPath) -> Iterator[Node]:
        index = 0
        while not isinstance(event := next(events), yaml.SequenceEndEvent):
            yield self._node(event, events, (*path, index))
            index += 1

    def _entries(self, events: Iterator[yaml.Event], path: KeyPath) -> dict[str, MappingEntry]:
        entries: dict[str, MappingEntry] = {}
        while not isinstance(event := next(events), yaml.MappingEndEvent):
            key_event, key = event, self._key(event, events, path)
            value = self._node(next(events), events, (*path, key or "?"))
            if key in entries:
                self._refuse(key_event, (*path, key), f"duplicate key; first in line {entries[key].key_place.line}")
            elif key:
                entries[key] = MappingEntry(self._place(key_event), value)
        return entries

    def _key(self, event: yaml.Event, events: Iterator[yaml.Event], path: KeyPath) -> str:
        """Return the text of a key before the value rules; empty if it was refused."""
        if isinstance(event, yaml.ScalarEvent):
            self._refuse_decoration(event, path)
            if not event.value:
                self._refuse(event, path, "a key is empty")
            if len(event.value) > KEY_LENGTH_MAX:
                self._refuse(event, path, f"a key is longer than {KEY_LENGTH_MAX} characters")
                return event.value[:KEY_LENGTH_MAX]
            return event.value
        self._refuse(event, path, "a key must be plain text, not a list, a mapping or an alias")
        self._node(event, events, (*path, "?"))
        return ""

    def _scalar(self, event: yaml.ScalarEvent, path: KeyPath) -> ScalarValue:
        if event.style:  # quoted or block text
            return event.value
        try:
            return plain_scalar(event.value)
        except ValueError as error:
            self._refuse(event, path, str(error))
            return None

    def _refuse_decoration(self, event: yaml.Event, path: KeyPath) -> None:
        if isinstance(event, yaml.NodeEvent) and event.anchor is not None:
            self._refuse(event, path, f"anchors (`&{event.anchor}`) are not supported; write the value out")
        if isinstance(event, (yaml.ScalarEvent, yaml.CollectionStartEvent)) and event.tag is not None:
            self._refuse(event, path, f"tags (`{event.tag}`) are not supported; remove it, or quote what is text")

    def _refuse(self, event: yaml.Event, path: KeyPath, message: str) -> None:
        place = self._place(event)
        self.findings.append(Finding(self.file, place.line, place.column, dotted(path), message))

    def _place(self, event: yaml.Event) -> Place:
        mark = event.start_mark
        return Place(self.file, mark.line + 1, mark.column + 1)
