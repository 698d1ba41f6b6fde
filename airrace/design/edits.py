"""Edits of a YAML text in place: comments, order, quotes and spaces of all that is not concerned stay as they are.

The text is composed with the marks of its nodes, only after the strict reader has taken it. What was edited is read
again: it must hold exactly what was asked for, else the edit is refused.
"""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import yaml

from airrace.errors import UsageError
from airrace.files.inputs.document import Document
from airrace.files.inputs.nodes import KeyPath, dotted
from airrace.files.inputs.yaml_reader import FAST, is_plain_text, quote, read_yaml


@dataclass(frozen=True)
class Put:
    """A value put at a path: in the place of what stands there, or else behind the last key of its mapping."""

    path: KeyPath
    value: Any  # JSON, here and below


@dataclass(frozen=True)
class Insert:
    """An item put into a list before the one at the path's end, or behind the last one."""

    path: KeyPath
    value: Any


@dataclass(frozen=True)
class Remove:
    """An entry removed, and with the last one of a mapping or a list that itself."""

    path: KeyPath


Edit = Put | Insert | Remove


def edit_document(document: Document, edits: Sequence[Edit]) -> Document:
    """Return a document with edits made one after another.

    Raises:
        InputError: the text is no YAML of this language.
        UsageError: the text has a form that cannot be edited in place.
    """
    text = document.text
    for edit in edits:
        content: Any = read_yaml(document.path, text).plain()
        try:
            _change(content, edit)
        except (KeyError, IndexError, TypeError, AttributeError) as error:
            raise UsageError(f"there is no {dotted(edit.path)}") from error
        text = _Text(text).apply(edit)
        if read_yaml(document.path, text).plain() != content:
            raise UsageError(f"{dotted(edit.path)} has a form that cannot be edited in place; edit the file by hand")
    return Document(document.path, text)


def flow_text(value: Any) -> str:
    """Return a value as YAML on one line."""
    match value:
        case dict():
            entries = cast(dict[str, Any], value).items()
            return "{" + ", ".join(f"{flow_text(key)}: {flow_text(entry)}" for key, entry in entries) + "}"
        case list():
            return "[" + ", ".join(map(flow_text, cast(list[Any], value))) + "]"
        case float():
            return f"{value:.12g}"
        case str() if re.fullmatch(r"\w[\w-]*", value) and is_plain_text(value):
            return value
        case str():
            return quote(value)
        case _:
            return json.dumps(value)


def _change(plain: Any, edit: Edit) -> None:
    """Make an edit in the values of a document."""
    holder, last = plain, edit.path[-1]
    for part in edit.path[:-1]:
        if isinstance(edit, Put) and isinstance(part, str):
            holder[part] = holder.get(part) or {}
        holder = holder[part]
    match edit:
        case Put():
            holder[last] = edit.value
        case Insert():
            holder.insert(last, edit.value)
        case Remove():
            del holder[last]
            if not holder and len(edit.path) > 1:
                _change(plain, Remove(edit.path[:-1]))


class _Text:
    """A YAML text with the marks of its nodes."""

    def __init__(self, text: str) -> None:
        self.text = text
        # ignore: the stub leaves what it takes untyped.
        self.root = cast(yaml.Node, yaml.compose(text, Loader=FAST))  # pyright: ignore[reportUnknownMemberType]
        self.newline = "\r\n" if "\r\n" in text else "\n"

    def apply(self, edit: Edit) -> str:
        holders, path = [self.root], edit.path  # those above the end of the path, as far as there are any
        for part in path[:-1]:
            if (index := _index(holders[-1], part)) is None:
                break
            holders.append(_children(holders[-1])[index][1])
        if isinstance(edit, Remove):
            while len(holders) > 1 and len(_children(holders[-1])) == 1:
                holders.pop()
            return self._without(holders[-1], cast(int, _index(holders[-1], path[len(holders) - 1])))
        holder, at = holders[-1], path[len(holders) - 1]
        value, index = edit.value, _index(holders[-1], at)
        for part in reversed(path[len(holders) :]):  # of a mapping that is missing as a whole
            value = {part: value}
        if isinstance(edit, Put) and index is not None:
            return self._with_value(_children(holder)[index][1], flow_text(value))
        if isinstance(holder, yaml.ScalarNode):  # an empty value
            return self._with_value(holder, flow_text({at: value}))
        item = flow_text(value) if isinstance(edit, Insert) else f"{flow_text(at)}: {flow_text(value)}"
        return self._with_item(cast(yaml.CollectionNode, holder), index, item)

    def _with_value(self, node: yaml.Node, value: str) -> str:
        begin, end = node.start_mark.index, self._end(node)
        tail = self.text[end:]
        if (comment := re.match(r"( +)#", tail)) and "\n" not in self.text[begin:end]:
            width = len(comment[1]) + end - begin - len(value)  # it stays in its column where there is room
            tail = " " * max(1, width) + tail[len(comment[1]) :]
        return self.text[:begin] + (" " if begin == end else "") + value + tail

    def _with_item(self, holder: yaml.CollectionNode, before: int | None, item: str) -> str:
        entries = _children(holder)
        if holder.flow_style:
            if before is not None:
                return self._splice(_begin(entries[before][0]), 0, f"{item}, ")
            end = self._end(entries[-1][1]) if entries else _begin(holder) + 1
            return self._splice(end, 0, f"{', ' if entries else ''}{item}")
        line = " " * holder.start_mark.column + ("- " if isinstance(holder, yaml.SequenceNode) else "") + item
        if before is not None:
            return self._splice(self._line_begin(entries[before][0]), 0, f"{line}{self.newline}")
        return self._splice(self._line_end(entries[-1][1]), 0, f"{self.newline}{line}")

    def _without(self, holder: yaml.Node, index: int) -> str:
        entries = _children(holder)
        (key, value), last = entries[index], index == len(entries) - 1
        begin, end = _begin(key), self._end(value)
        if not cast(yaml.CollectionNode, holder).flow_style:
            begin, end = self._line_begin(key), self._line_end(value) + len(self.newline)
        elif not last:
            end = _begin(entries[index + 1][0])
        elif index:
            begin = self._end(entries[index - 1][1])
        return self._splice(begin, end - begin, "")

    def _splice(self, at: int, length: int, new: str) -> str:
        return self.text[:at] + new + self.text[at + length :]

    def _end(self, node: yaml.Node) -> int:
        """Return where the last scalar or bracket of a node ends; a block's own mark lies behind comments, too."""
        if isinstance(node, yaml.CollectionNode) and not node.flow_style and node.value:
            return self._end(_children(node)[-1][1])
        return _begin(node) + len(self.text[_begin(node) : node.end_mark.index].rstrip())

    def _line_end(self, node: yaml.Node) -> int:
        end = self.text.find(self.newline, self._end(node))
        return len(self.text) if end < 0 else end

    def _line_begin(self, node: yaml.Node) -> int:
        """Return the begin of the line of a block's entry; refuse one that begins behind another one on it."""
        begin = self.text.rfind("\n", 0, _begin(node)) + 1
        if self.text[begin : _begin(node)].strip() not in ("", "-"):
            raise UsageError(f"line {node.start_mark.line + 1} holds two entries: edit the file by hand")
        return begin


def _begin(node: yaml.Node) -> int:
    return node.start_mark.index


def _children(node: yaml.Node) -> list[tuple[yaml.Node, yaml.Node]]:
    """Return the entries of a mapping, key and value, or the items of a list, which are their own keys."""
    if isinstance(node, yaml.MappingNode):
        return cast(list[tuple[yaml.Node, yaml.Node]], node.value)
    return [(item, item) for item in cast(list[yaml.Node], node.value)] if isinstance(node, yaml.SequenceNode) else []


def _index(node: yaml.Node, part: str | int) -> int | None:
    if isinstance(part, int):
        return part if part < len(_children(node)) else None
    keys = [cast(str, key.value) for key, _ in _children(node)]
    return keys.index(part) if part in keys else None
