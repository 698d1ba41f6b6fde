"""Validation of a document: its errors name file, line, key, what is wrong and what would be right."""

import difflib
import re
from collections.abc import Iterator
from typing import TypeVar, get_args

from annotated_types import Ge, Gt, Le, Lt
from pydantic import ValidationError
from pydantic_core import ErrorDetails

from airrace.inputs.nodes import KeyPath, MappingNode, Node, Reporter, ScalarNode, SequenceNode
from airrace.inputs.schema import (
    Annotation,
    Schema,
    bare,
    constraints_of,
    field_of,
    inner,
    keys_of,
    member_of,
    schema_of,
    tags_of,
)

Model = TypeVar("Model", bound=Schema)
DECIMAL_COMMA = re.compile(r"[-+]?[0-9]+,[0-9]+")
"""A number as it is written in many countries, but not in YAML."""


def validate(model: type[Model], reporter: Reporter) -> Model | None:
    """Return the document as an instance of `model`; None if it is not one, and then there are findings."""
    valueless = set(_valueless((), reporter.root))
    for path in valueless:
        comma = "; a number has a decimal point, not a comma" if str(path[-1]).isdecimal() else ""
        reporter.value(path, f"has no value; give one, or leave the key out{comma}")
    try:
        validated = model.model_validate(reporter.root.plain())
    except ValidationError as error:
        for details in error.errors(include_url=False):
            _report(model, details, reporter, valueless)
        return None
    return None if valueless else validated


def _valueless(path: KeyPath, node: Node) -> Iterator[KeyPath]:
    match node:
        case ScalarNode(value=None):
            yield path
        case ScalarNode():
            return
        case SequenceNode(items=items):
            for index, item in enumerate(items):
                yield from _valueless((*path, index), item)
        case MappingNode(entries=entries):
            for key, entry in entries.items():
                yield from _valueless((*path, key), entry.value)


def _report(model: type[Schema], error: ErrorDetails, reporter: Reporter, valueless: set[KeyPath]) -> None:
    path, owner, annotation = _resolve(model, error["loc"])
    if path in valueless:
        return
    name = path[-1] if path else ""
    match error["type"]:
        case "missing":
            text = _description(owner, str(name))
            reporter.key(path, f"missing; {owner.what if owner else 'it'} needs `{name}`{text}")
        case "extra_forbidden":
            fields = keys_of(owner) if owner else []
            others = reporter.other_documents(path)
            belongs = _belongs(owner, str(name)) if owner else ""
            told = belongs or reporter.suggestion(str(name), [*fields, *others])
            reporter.key(path, f"unknown key `{name}`{told}")
        case "union_tag_not_found":
            choices = ", ".join(tags_of(annotation))
            reporter.key((*path, "type"), f"missing; `type` is one of: {choices}")
        case "union_tag_invalid":
            tag = str(error.get("ctx", {}).get("tag", ""))
            reporter.value((*path, "type"), f"unknown type `{tag}`{reporter.suggestion(tag, tags_of(annotation))}")
        case _:
            reporter.value(path, _mismatch(error, annotation, owner, str(name)))


def _mismatch(error: ErrorDetails, annotation: Annotation, owner: type[Schema] | None, name: str) -> str:
    """Return what should stand here, and what does."""
    found = _described(error["input"])
    match error["type"]:
        case "float_type" | "int_type" | "int_from_float":
            whole = "a whole number" if error["type"].startswith("int") else "a number"
            return f"must be {whole}{_limits(owner, name)}, not {found}{_with_point(error['input'])}"
        case "greater_than" | "greater_than_equal" | "less_than" | "less_than_equal":
            return f"must be{_limits(owner, name)}, not {found}"
        case "string_type":
            quote = "; quote it if it is meant as text" if isinstance(error["input"], (int, float)) else ""
            return f"must be text, not {found}{quote}"
        case "bool_type":
            return f"must be true or false, not {found}"
        case "literal_error":
            choices = [str(choice) for choice in get_args(bare(annotation))]
            return f"must be one of {', '.join(choices)}, not {found}{_near(error['input'], choices)}"
        case "model_type" | "dict_type" | "model_attributes_type":
            return f"must be {_form(annotation)}, not {found}"
        case "list_type":
            return f"must be a list (`[a, b]` or `- a` lines), not {found}"
        case "string_too_short" | "too_short":
            return "must not be empty"
        case "too_long":
            return f"has too many entries; at most {error.get('ctx', {}).get('max_length')}"
        case _:
            return error["msg"]


def _with_point(value: object) -> str:
    """Return how a number with a decimal comma is written; empty for whatever else."""
    if not isinstance(value, str) or not DECIMAL_COMMA.fullmatch(value):
        return ""
    return f"; write it with a decimal point, {value.replace(',', '.')}"


def _belongs(owner: type[Schema], name: str) -> str:
    """Return in which of the mappings beside it a key belongs; empty if in none."""
    for key in keys_of(owner):
        nested = schema_of(inner(owner, key))
        if nested is not None and name in keys_of(nested):
            return f"; it belongs in `{key}`"
    return ""


def _form(annotation: Annotation) -> str:
    return (schema_of(annotation) or Schema).form


def _near(value: object, choices: list[str]) -> str:
    similar = difflib.get_close_matches(str(value), choices, n=1)
    return f"; did you mean `{similar[0]}`?" if similar else ""


def _described(value: object) -> str:
    match value:
        case bool():
            return f"`{str(value).lower()}`"
        case int() | float():
            return f"{value:g}" if isinstance(value, float) else str(value)
        case str():
            return f"the text `{value[:40]}`"
        case dict():
            return "a mapping"
        case list():
            return "a list"
        case _:
            return "nothing"


def _limits(owner: type[Schema] | None, name: str) -> str:
    """Return the range that a field declares as a text, e.g. ` above 0 and at most 85`."""
    texts: list[str] = []
    for limit in constraints_of(field_of(owner, name)):
        match limit:
            case Gt(gt=value):
                texts.append(f"above {value}")
            case Ge(ge=value):
                texts.append(f"at least {value}")
            case Lt(lt=value):
                texts.append(f"below {value}")
            case Le(le=value):
                texts.append(f"at most {value}")
            case _:
                continue
    return " " + " and ".join(texts) if texts else ""


def _description(owner: type[Schema] | None, name: str) -> str:
    found = field_of(owner, name)
    return f": {found.description}" if found and found.description else ""


def _resolve(model: type[Schema], location: KeyPath) -> tuple[KeyPath, type[Schema] | None, Annotation]:
    """Return the path in the document, the mapping that owns its last key, and what is expected there.

    The path that pydantic gives has tags of unions in between.
    """
    path: list[str | int] = []
    owner: type[Schema] | None = None
    annotation: Annotation = model
    for part in location:
        member = member_of(annotation, part)
        if member is not None:
            annotation = member
            continue
        path.append(part)
        owner, annotation = schema_of(annotation), inner(annotation, part)
    return tuple(path), owner, annotation
