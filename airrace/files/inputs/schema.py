"""The base of all schemas, and the validation of documents: errors name file, line, key and what would be right."""

import re
from collections.abc import Iterator
from types import NoneType, UnionType
from typing import Annotated, Any, ClassVar, Literal, TypeVar, Union, get_args, get_origin

from annotated_types import Ge, Gt, Le, Lt
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from airrace.errors import Finding, InputError
from airrace.files.inputs.document import Document
from airrace.files.inputs.nodes import KeyPath, MappingNode, Node, Reporter, ScalarNode, SequenceNode, most_similar
from airrace.files.inputs.yaml_reader import read_yaml
from airrace.optimal_control.quantities import DEGREE, KNOT

# Any: annotations of arbitrary type, inspected at run time.
Annotation = Any

SI = {"_deg": DEGREE, "_deg_s": DEGREE, "_kt": KNOT, "_kW": 1000.0, "_hPa": 100.0}
"""The SI value of units, by the ending of the key; all other units are SI."""
DECIMAL_COMMA = re.compile(r"[-+]?[0-9]+,[0-9]+")
"""A number as it is written in many countries, but not in YAML."""
RANGE_WORDS: dict[type, tuple[str, str]] = {
    Gt: ("gt", "above"),
    Ge: ("ge", "at least"),
    Lt: ("lt", "below"),
    Le: ("le", "at most"),
}


class Schema(BaseModel):
    """A mapping of a document: unknown keys are errors, nothing is converted, numbers are finite.

    A field is named as in the object that is built of it; its alias, if it has one, is its key in the document.
    `what` names the element in messages ("a level gate"), `form` says how it is written. Where a bare text may stand
    for the mapping, `shorthand` is the key whose value it is.
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)
    what: ClassVar[str] = "this element"
    form: ClassVar[str] = "a mapping (`key: value` lines)"
    shorthand: ClassVar[str | None] = None

    def arguments(self) -> dict[str, Any]:  # Any: values of any type, checked already
        """Return the values that are given, by field: numbers in SI."""
        arguments: dict[str, Any] = {}
        for name, info in type(self).model_fields.items():
            value, key = getattr(self, name), info.alias or name
            if isinstance(value, float):
                value *= si_factor(key)
            if value is not None:
                arguments[name] = value
        return arguments


class ShorthandSchema(Schema):
    """A mapping for which a bare text may stand."""

    @model_validator(mode="before")
    @classmethod
    def _write_out(cls, value: object) -> object:
        return {cls.shorthand: value} if isinstance(value, str) else value


def optional(description: str, alias: str | None = None) -> Any:  # Any: the declaration of a field of any type
    """Return the declaration of a key that may be left out, with None in its place."""
    return Field(default=None, alias=alias, description=description)


def si_factor(key: str) -> float:
    """Return the SI value of the unit of a key."""
    return next((factor for ending, factor in SI.items() if key.endswith(ending)), 1.0)


def schema_of(annotation: Annotation) -> type[Schema] | None:
    """Return the schema that is expected here, if it is one and the same for all; else None."""
    plain = bare(annotation)
    return plain if isinstance(plain, type) and issubclass(plain, Schema) else None


def field_of(owner: type[Schema] | None, name: str) -> FieldInfo | None:
    """Return what a schema declares of one of its keys; None if it has no such key."""
    fields = owner.model_fields.items() if owner else ()
    return next((info for key, info in fields if name == (info.alias or key)), None)


def keys_of(owner: type[Schema] | None) -> list[str]:
    """Return the keys as documents write them."""
    return [info.alias or key for key, info in owner.model_fields.items()] if owner else []


def languages_of(model: type[Schema]) -> tuple[str, ...]:
    """Return what may stand at `schema` in the documents that a model reads, the newest first."""
    return tuple(str(language) for language in get_args(model.model_fields["schema_"].annotation))


def language_of(model: type[Schema]) -> str:
    """Return what stands at `schema` in new documents that a model reads, e.g. `airrace/track/2`."""
    return languages_of(model)[0]


def inner(annotation: Annotation, part: str | int) -> Annotation:
    """Return what is expected one step further down: of a key, of an entry, of an item; None where nothing is."""
    plain = bare(annotation)
    schema = schema_of(plain)
    if schema is not None:
        field = field_of(schema, str(part))
        return field.annotation if field else None
    if get_origin(plain) is dict:
        return get_args(plain)[1]
    return get_args(plain)[0] if get_origin(plain) is list else None


def bare(annotation: Annotation) -> Annotation:
    """Return an annotation without `Annotated[...]` and `| None`."""
    while not isinstance(annotation, type):
        if get_origin(annotation) is Annotated:
            annotation = get_args(annotation)[0]
            continue
        types = members(annotation)
        if len(types) != 1:
            return annotation
        annotation = types[0]
    return annotation


def members(annotation: Annotation) -> list[Annotation]:
    """Return the types of a union, without None."""
    if isinstance(annotation, type) or get_origin(annotation) not in (Union, UnionType):
        return []
    return [member for member in get_args(annotation) if member is not NoneType]


def tags_of(annotation: Annotation) -> dict[str, Annotation]:
    """Return the members of a tagged union by their tags."""
    tags: dict[str, Annotation] = {}
    for member in members(bare(annotation)):
        field = field_of(schema_of(member), "type")
        if field and get_origin(field.annotation) is Literal:
            tags |= dict.fromkeys(get_args(field.annotation), member)
    return tags


Model = TypeVar("Model", bound=Schema)


def read_mapping(document: Document, model: type[Schema]) -> MappingNode:
    """Return the tree of a document.

    Raises:
        InputError: it is no YAML, or no mapping.
    """
    root = read_yaml(document.path, document.text)
    if isinstance(root, MappingNode):
        return root
    message = f"must be a mapping that begins with `schema: {language_of(model)}`"
    raise InputError([Finding(document.path, root.place.line, root.place.column, "", message)])


def read_entry(model: type[Model], document: Document) -> tuple[Model, Reporter]:
    """Return the content of a document, and the reporter for further findings about it.

    Raises:
        InputError: the document is not valid; it carries all findings.
    """
    reporter = Reporter(read_mapping(document, model), [])
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
            field = field_of(owner, name)
            text = f": {field.description}" if field and field.description else ""
            reporter.key(path, f"missing; {owner.what if owner else 'it'} needs `{name}`{text}")
        case "extra_forbidden":
            keys = keys_of(owner)
            parents = [key for key in keys if name in keys_of(schema_of(inner(owner, key)))]
            # On the command line the prefix of another document may be missing.
            prefixes = reporter.other_prefixes if len(path) == 1 and reporter.is_set(path) else ()
            hint = f"; it belongs in `{parents[0]}`" if parents else reporter.suggestion(name, [*keys, *prefixes])
            reporter.key(path, f"unknown key `{name}`{hint}")
        case "union_tag_not_found":
            reporter.key((*path, "type"), f"missing; `type` is one of: {', '.join(tags_of(annotation))}")
        case "union_tag_invalid":
            tag = str(error.get("ctx", {}).get("tag", ""))
            reporter.value((*path, "type"), f"unknown type `{tag}`{reporter.suggestion(tag, tags_of(annotation))}")
        case _:
            reporter.value(path, _mismatch(error, annotation, _limits(owner, name, annotation)))


def _mismatch(error: ErrorDetails, annotation: Annotation, limits: str) -> str:
    """Return what should stand here, and what does."""
    value = error["input"]
    actual = _description(value)
    match error["type"]:
        case "float_type" | "int_type" | "int_from_float":
            whole = "a whole number" if error["type"].startswith("int") else "a number"
            comma = isinstance(value, str) and DECIMAL_COMMA.fullmatch(value)
            point = f"; write it with a decimal point, {value.replace(',', '.')}" if comma else ""
            return f"must be {whole}{limits}, not {actual}{point}"
        case "greater_than" | "greater_than_equal" | "less_than" | "less_than_equal":
            return f"must be{limits}, not {actual}"
        case "string_type":
            quote = "; quote it if it is meant as text" if isinstance(value, (int, float)) else ""
            return f"must be text, not {actual}{quote}"
        case "bool_type":
            return f"must be true or false, not {actual}"
        case "literal_error":
            choices = [str(choice) for choice in get_args(bare(annotation))]
            similar = most_similar(str(value), choices)
            hint = f"; did you mean `{similar}`?" if similar else ""
            return f"must be one of {', '.join(choices)}, not {actual}{hint}"
        case "model_type" | "dict_type" | "model_attributes_type":
            return f"must be {(schema_of(annotation) or Schema).form}, not {actual}"
        case "list_type":
            return f"must be a list (`[a, b]` or `- a` lines), not {actual}"
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


def _limits(owner: type[Schema] | None, name: str, annotation: Annotation) -> str:
    """Return the range that a field, or an entry of a mapping, declares, e.g. ` above 0 and at most 85`."""
    field = field_of(owner, name)
    declared: list[object] = list(field.metadata) if field else []
    for expected in members(field.annotation) if field else [annotation]:
        if get_origin(expected) is Annotated:
            declared += get_args(expected)[1:]
    texts: list[str] = []
    for limit in declared:
        if type(limit) in RANGE_WORDS:
            key, word = RANGE_WORDS[type(limit)]
            texts.append(f"{word} {getattr(limit, key)}")
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
