"""Validation of a document: its errors name file, line, key, what is wrong and what would be right."""

import difflib
import re
from collections.abc import Iterator
from typing import TypeVar, get_args

from annotated_types import Ge, Gt, Le, Lt
from pydantic import ValidationError
from pydantic_core import ErrorDetails

from airrace.errors import Finding, InputError
from airrace.inputs.document import Document
from airrace.inputs.nodes import KeyPath, MappingNode, Node, Reporter, ScalarNode, SequenceNode
from airrace.inputs.schema import (
    Annotation,
    Schema,
    bare,
    constraints_of,
    field_of,
    inner,
    keys_of,
    schema_of,
    tags_of,
)
from airrace.inputs.yaml_reader import read_yaml

Model = TypeVar("Model", bound=Schema)
DECIMAL_COMMA = re.compile(r"[-+]?[0-9]+,[0-9]+")
"""A number as it is written in many countries, but not in YAML."""


def read_mapping(document: Document, schema: str) -> MappingNode:
    """Return the tree of a document.

    Raises:
        InputError: it is no YAML, or no mapping.
    """
    root = read_yaml(document.path, document.text)
    if isinstance(root, MappingNode):
        return root
    message = f"must be a mapping that begins with `schema: {schema}`"
    raise InputError([Finding(document.path, root.place.line, root.place.column, "", message)])


def read_entry(model: type[Model], document: Document, schema: str) -> tuple[Model, Reporter]:
    """Return the content of a document, and the reporter for what else is found to be wrong with it.

    Raises:
        InputError: the document is not valid; it carries all findings.
    """
    reporter = Reporter(read_mapping(document, schema), [])
    entry = validate(model, reporter)
    if entry is None:
        raise InputError(reporter.findings)
    return entry, reporter


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
    name = str(path[-1]) if path else ""
    match error["type"]:
        case "missing":
            found = field_of(owner, name)
            text = f": {found.description}" if found and found.description else ""
            reporter.key(path, f"missing; {owner.what if owner else 'it'} needs `{name}`{text}")
        case "extra_forbidden":
            known = keys_of(owner) if owner else []
            nested = [(key, schema_of(inner(owner, key))) for key in known]
            places = [f"; it belongs in `{key}`" for key, schema in nested if schema and name in keys_of(schema)]
            meant = places[0] if places else reporter.suggestion(name, [*known, *reporter.other_documents(path)])
            reporter.key(path, f"unknown key `{name}`{meant}")
        case "union_tag_not_found":
            reporter.key((*path, "type"), f"missing; `type` is one of: {', '.join(tags_of(annotation))}")
        case "union_tag_invalid":
            tag = str(error.get("ctx", {}).get("tag", ""))
            reporter.value((*path, "type"), f"unknown type `{tag}`{reporter.suggestion(tag, tags_of(annotation))}")
        case _:
            reporter.value(path, _mismatch(error, annotation, _limits(owner, name)))


def _mismatch(error: ErrorDetails, annotation: Annotation, limits: str) -> str:
    """Return what should stand here, and what does."""
    value = error["input"]
    found = _description(value)
    match error["type"]:
        case "float_type" | "int_type" | "int_from_float":
            whole = "a whole number" if error["type"].startswith("int") else "a number"
            comma = isinstance(value, str) and DECIMAL_COMMA.fullmatch(value)
            point = f"; write it with a decimal point, {value.replace(',', '.')}" if comma else ""
            return f"must be {whole}{limits}, not {found}{point}"
        case "greater_than" | "greater_than_equal" | "less_than" | "less_than_equal":
            return f"must be{limits}, not {found}"
        case "string_type":
            quote = "; quote it if it is meant as text" if isinstance(value, (int, float)) else ""
            return f"must be text, not {found}{quote}"
        case "bool_type":
            return f"must be true or false, not {found}"
        case "literal_error":
            choices = [str(choice) for choice in get_args(bare(annotation))]
            similar = difflib.get_close_matches(str(value), choices, n=1)
            meant = f"; did you mean `{similar[0]}`?" if similar else ""
            return f"must be one of {', '.join(choices)}, not {found}{meant}"
        case "model_type" | "dict_type" | "model_attributes_type":
            return f"must be {(schema_of(annotation) or Schema).form}, not {found}"
        case "list_type":
            return f"must be a list (`[a, b]` or `- a` lines), not {found}"
        case "string_too_short" | "too_short":
            return "must not be empty"
        case "too_long":
            return f"has too many entries; at most {error.get('ctx', {}).get('max_length')}"
        case _:
            return error["msg"]


def _description(value: object) -> str:
    match value:
        case bool():
            return f"`{str(value).lower()}`"
        case int():
            return str(value)
        case float():
            return f"{value:g}"
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


def _resolve(model: type[Schema], location: KeyPath) -> tuple[KeyPath, type[Schema] | None, Annotation]:
    """Return the path in the document, the mapping that owns its last key, and what is expected there.

    The path that pydantic gives has tags of unions in between.
    """
    path: list[str | int] = []
    owner: type[Schema] | None = None
    annotation: Annotation = model
    for part in location:
        member = tags_of(annotation).get(str(part))
        if member is not None:
            annotation = member
            continue
        path.append(part)
        owner, annotation = schema_of(annotation), inner(annotation, part)
    return tuple(path), owner, annotation
