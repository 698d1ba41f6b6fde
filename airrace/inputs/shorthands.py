"""Shorthands: texts that stand for a mapping (`g1` for `{gate: g1}`) are written out, so schemas know one form only."""

import dataclasses

from airrace.inputs.nodes import Entry, MappingNode, Node, ScalarNode, SequenceNode
from airrace.inputs.schema import Annotation, bare, inner, member_of, members, schema_of, tags_of


def expanded(root: MappingNode, schema: Annotation) -> MappingNode:
    """Return a document with every shorthand written out; all places stay as they are."""
    entries = {key: _entry(key, entry, schema) for key, entry in root.entries.items()}
    return MappingNode(root.place, entries)


def _entry(key: str, entry: Entry, owner: Annotation) -> Entry:
    value = _expanded(entry.value, inner(owner, key))
    return entry if value is entry.value else dataclasses.replace(entry, value=value)


def _expanded(node: Node, expected: Annotation) -> Node:
    """Return a node with shorthands written out; the node itself where nothing in it is a shorthand."""
    if expected is None:
        return node
    match node:
        case ScalarNode(value=str()):
            schema = schema_of(expected)
            if schema is None or schema.shorthand is None:
                return node
            return MappingNode(node.place, {schema.shorthand: Entry(node.place, node)})
        case ScalarNode():
            return node
        case SequenceNode(items=items):
            within = inner(expected, 0)
            if not _knows_shorthands(within):
                return node
            return dataclasses.replace(node, items=tuple(_expanded(item, within) for item in items))
        case MappingNode(entries=entries):
            if not _knows_shorthands(expected):
                return node
            chosen = member_of(expected, str(node.scalar("type"))) if tags_of(expected) else expected
            return MappingNode(node.place, {key: _entry(key, entry, chosen) for key, entry in entries.items()})


def _knows_shorthands(expected: Annotation) -> bool:
    """Return whether a shorthand may stand anywhere within; most parts of a document are skipped by that."""
    if expected is None:
        return False
    schema = schema_of(expected)
    if schema is not None:
        fields = (info.annotation for info in schema.model_fields.values())
        return schema.shorthand is not None or any(_knows_shorthands(one) for one in fields)
    return any(_knows_shorthands(one) for one in members(bare(expected))) or _knows_shorthands(inner(expected, 0))
