"""The pages of the input languages, written from the JSON Schemas that `airrace schema` prints."""

import math
from collections.abc import Iterator
from enum import Enum
from typing import Any

from airrace.files.inputs.json_schema import LANGUAGES, json_schema
from airrace.files.inputs.schema import Schema
from airrace.files.inputs.settings import CertificateEntry, MeshEntry, SettingsEntry, SolverEntry
from airrace.procedure.settings import Settings

# Any: JSON of any shape.
Node = dict[str, Any]

TITLES = {
    "track": "Keys of a track",
    "aircraft": "Keys of an aircraft",
    "settings": "Keys of the settings",
    "batch": "Keys of a batch",
    "log": "Keys of a log's mapping",
}
GUIDES = {
    "track": "[Describing a course](../course.md) explains the language by examples.",
    "aircraft": "[My own aircraft](../how_to/aircraft.md) tells where the numbers come from.",
    "settings": "[Settings](../settings.md) says how they are given.",
    "batch": "[Many courses at once](../batches.md) explains batches by examples.",
    "log": "[Flight logs](../flown_logs.md) explains mappings by examples.",
}


def language_page(language: str) -> str:
    """Every key of a language with its values, its default and its meaning, as a page of Markdown.

    Args:
        language: one of `LANGUAGES`.
    """
    schema = json_schema(language)
    if language == "settings":
        _tell_defaults(schema)
    opening = (
        f"This page is generated from the schema by which the files are read. "
        f"`airrace schema {language}` prints it for editors. {GUIDES[language]}"
    )
    sections = [_table(schema)]
    sections += [_section(name, node) for name, node in schema["definitions"].items()]
    return "\n\n".join([f"# {TITLES[language]}", opening, *sections]) + "\n"


def language_pages() -> Iterator[tuple[str, str]]:
    """The name and the page of every language."""
    for language in LANGUAGES:
        yield language, language_page(language)


def _tell_defaults(schema: Node) -> None:
    """Write into the schema of the settings what holds where nothing is said, in the units of the keys."""
    settings = Settings()
    models: list[tuple[type[Schema], object]] = [
        (SettingsEntry, settings),
        (MeshEntry, settings.mesh),
        (SolverEntry, settings.solver),
        (CertificateEntry, settings.certificate),
    ]
    for entry, values in models:
        node = schema["definitions"].get(entry.__name__, schema)
        for name, field in entry.model_fields.items():
            value = getattr(values, name, None)
            value = value.value if isinstance(value, Enum) else value
            if isinstance(value, int | float | str):
                key = field.alias or name
                in_degrees = key.endswith("_deg")
                node["properties"][key]["default"] = f"{math.degrees(float(value)):g}" if in_degrees else value


def _section(name: str, node: Node) -> str:
    """A part of the language under a heading of its own."""
    mapping, notes = node, []
    if "anyOf" in node:
        text, mapping = node["anyOf"]
        meant = next(key for key, one in mapping["properties"].items() if one["description"] == text["description"])
        notes = [f"A bare text stands for a mapping with this text as its `{meant}`."]
    described = mapping.get("description") or node.get("description")
    notes += [_sentence(described)] if described else []
    title = node.get("title", name)
    heading = f"`{title}`" if "_" in title else title[0].upper() + title[1:]
    return "\n\n".join([f"## {heading} {{ #{name} }}", *notes, _table(mapping)])


def _table(mapping: Node) -> str:
    required = mapping.get("required", [])
    lines = ["| key | value | default | meaning |", "|---|---|---|---|"]
    for key, node in mapping["properties"].items():
        default = "required" if key in required else _default(node)
        lines.append(f"| `{key}` | {_value(node)} | {default} | {node.get('description', '')} |")
    return "\n".join(lines)


def _default(node: Node) -> str:
    if "default" not in node:
        return ""
    value = node["default"]
    return f"`{str(value).lower() if isinstance(value, bool) else value}`"


def _value(node: Node) -> str:
    """What may stand there, in words."""
    if "$ref" in node:
        name = node["$ref"].rpartition("/")[2]
        return f"[{_spaced(name)}](#{name})"
    if "allOf" in node:
        return _value(node["allOf"][0])
    if "const" in node:
        return f"`{node['const']}`"
    if "enum" in node:
        return " or ".join(f"`{one}`" for one in node["enum"])
    for key in ("oneOf", "anyOf"):
        if key in node:
            return " or ".join(dict.fromkeys(_value(one) for one in node[key]))
    return _plain(node)


def _plain(node: Node) -> str:
    match node["type"]:
        case "array":
            return f"list of: {_value(node['items'])}{_count(node, 'Items')}"
        case "object":
            return f"by name: {_value(node['additionalProperties'])}{_count(node, 'Properties')}"
        case "integer" | "number" as kind:
            return ("whole number" if kind == "integer" else "number") + _range(node)
        case "boolean":
            return "`true` or `false`"
        case _:
            return "text"


def _range(node: Node) -> str:
    """The ends of a range; `minimum` and `maximum` belong to it, the exclusive ones do not."""
    if "minimum" in node and "maximum" in node:
        return f" from {node['minimum']:g} to {node['maximum']:g}"
    ends = {"minimum": "at least", "exclusiveMinimum": "above", "maximum": "at most", "exclusiveMaximum": "below"}
    said = [f"{word} {node[key]:g}" for key, word in ends.items() if key in node]
    return f" {' and '.join(said)}" if said else ""


def _count(node: Node, what: str) -> str:
    return f", at most {node[f'max{what}']}" if f"max{what}" in node else ""


def _spaced(name: str) -> str:
    """`LevelGateEntry` as "level gate"."""
    words = "".join(f" {letter.lower()}" if letter.isupper() else letter for letter in name.removesuffix("Entry"))
    return words.strip()


def _sentence(text: str) -> str:
    return text if text.endswith(".") else f"{text}."
