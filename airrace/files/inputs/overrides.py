"""Overrides: `--set key=value` replaces, adds or (with `null`) takes out single values of the documents."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

from airrace.errors import Finding, InputError
from airrace.files.inputs.nodes import KeyPath, MappingEntry, MappingNode, Node, Place, ScalarNode, SequenceNode, dotted
from airrace.files.inputs.schema import Annotation, Schema, inner, schema_of, tags_of
from airrace.files.inputs.yaml_reader import is_plain_text, plain_scalar, quote, read_yaml

FILE = "--set"
PLACE = Place(FILE, 0, 0)
PREFIXED = ("aircraft", "settings")
"""The documents other than the track, whose names stand before the key."""
QUOTES, INDICATORS = ("'", '"'), ("[", "{", "&", "*", "!", "|", ">")
"""What a value begins with that is quoted, and what no single value begins with."""


@dataclass(frozen=True)
class Override:
    """A replacement: in which document (`track`, `aircraft`, `settings`), where, by what."""

    document: str
    path: KeyPath
    value: ScalarNode


def parse_overrides(texts: Sequence[str], findings: list[Finding]) -> list[Override]:
    """Return the overrides of `key=value` texts; invalid ones are reported."""
    overrides: list[Override] = []
    for text in texts:
        key, equals, value = text.partition("=")
        names = key.strip().split(".")
        try:
            if not equals or not all(names):
                raise ValueError(f"`{text}` is not of the form key=value, e.g. rules.n_z_max=12")
            node = ScalarNode(PLACE, _scalar(value.strip()))
        except ValueError as error:
            findings.append(Finding(FILE, 0, 0, key.strip(), str(error)))
            continue
        document = names.pop(0) if len(names) > 1 and names[0] in PREFIXED else "track"
        overrides.append(Override(document, tuple(names), node))
    return overrides


def apply_overrides(
    root: MappingNode, overrides: Sequence[Override], findings: list[Finding], schema: type[Schema]
) -> MappingNode:
    """Return the document with the replacements made, in order; missing mappings on the way are created.

    A shorthand of the `schema` is expanded where a replacement reaches into it.
    """
    for override in overrides:
        try:
            root = cast(MappingNode, _replace(root, override.path, override.value, schema))
        except ValueError as error:
            prefix = (override.document,) if override.document in PREFIXED else ()
            findings.append(Finding(FILE, 0, 0, dotted((*prefix, *override.path)), str(error)))
    return root


def value_text(value: str | int | float | bool) -> str:
    """Return a value as `--set` takes it: text that looks like something else is quoted."""
    if isinstance(value, bool):
        return str(value).lower()
    if not isinstance(value, str):
        return repr(value)
    is_plain = is_plain_text(value) and value == value.strip() and not value.startswith((*QUOTES, *INDICATORS))
    return value if is_plain else quote(value)


def _scalar(text: str) -> str | int | float | bool | None:
    """Return a value by the rules of the files: quoted text as YAML, everything else as a plain scalar."""
    if text.startswith(QUOTES):
        try:
            node = read_yaml(FILE, text)
        except InputError as error:
            raise ValueError(error.findings[0].message) from None
        if isinstance(node, ScalarNode):
            return node.value
        raise ValueError("only a single value can be set")
    if text.startswith(INDICATORS):
        raise ValueError("only a single value can be set; edit the file for more")
    return plain_scalar(text)


def _replace(node: Node | None, path: KeyPath, value: ScalarNode, expected: Annotation) -> Node:
    """Return a copy of `node` with the entry at `path` replaced.

    Raises:
        ValueError: the path leads through a single value, or to an item a list does not have.
    """
    if not path:
        return value
    name, remaining = str(path[0]), path[1:]
    schema = schema_of(expected)
    if node is None:
        node = MappingNode(PLACE)
    elif isinstance(node, ScalarNode) and isinstance(node.value, str) and schema and schema.shorthand:
        node = MappingNode(node.place, {schema.shorthand: MappingEntry(node.place, node)})
    if isinstance(node, MappingNode):
        entries = dict(node.entries)
        entry, annotation = entries.get(name), tags_of(expected).get(str(node.scalar("type")), expected)
        if value.value is None and not remaining:
            entries.pop(name, None)
        else:
            place = entry.key_place if entry and remaining else PLACE
            child = _replace(entry.value if entry else None, remaining, value, inner(annotation, name))
            entries[name] = MappingEntry(place, child)
        return MappingNode(node.place, entries)
    if isinstance(node, SequenceNode):
        if not (name.isascii() and name.isdigit() and int(name) < len(node.items)):
            raise ValueError(f"the list has items 0 to {len(node.items) - 1}, none named `{name}`")
        items = list(node.items)
        items[int(name)] = _replace(items[int(name)], remaining, value, inner(expected, 0))
        return SequenceNode(node.place, tuple(items))
    raise ValueError(f"`{name}` cannot be set inside the single value {node.value!r}")
