"""The base of all schemas, and validation whose errors name file, line, key, what is wrong and what would be right."""

import difflib
from collections.abc import Iterable, Iterator
from types import NoneType, UnionType
from typing import Annotated, Any, ClassVar, Literal, TypeVar, Union, get_args, get_origin

from annotated_types import Ge, Gt, Le, Lt
from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from airrace.documents.nodes import KeyPath, MappingNode, Node, Reporter, ScalarNode, SequenceNode

# Any: annotations of arbitrary type, inspected at run time.
Annotation = Any


class Schema(BaseModel):
    """A mapping of a document: unknown keys are errors, nothing is converted, numbers are finite.

    `what` names the element in messages ("a level gate"), `form` says how it is written.
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)
    what: ClassVar[str] = "this element"
    form: ClassVar[str] = "a mapping (`key: value` lines)"


Model = TypeVar("Model", bound=Schema)


def validate(model: type[Model], reporter: Reporter) -> Model | None:
    """The document as an instance of `model`; None if it is not one, and then there are findings."""
    valueless = set(_valueless((), reporter.root))
    for path in valueless:
        reporter.value(path, "has no value; give one, or leave the key out")
    try:
        validated = model.model_validate(reporter.root.plain())
    except ValidationError as error:
        for details in error.errors(include_url=False):
            _report(model, details, reporter, valueless)
        return None
    return None if valueless else validated


def suggestion(word: str, known: Iterable[str]) -> str:
    """`; did you mean ...?`, or all choices where nothing is similar."""
    choices = list(known)
    similar = difflib.get_close_matches(word, choices, n=1)
    if similar:
        return f"; did you mean `{similar[0]}`?"
    return f"; known here: {', '.join(choices)}" if choices else ""


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
            fields = _keys(owner) if owner else []
            reporter.key(path, f"unknown key `{name}`{suggestion(str(name), fields)}")
        case "union_tag_not_found":
            choices = ", ".join(_tags(annotation))
            reporter.key((*path, "type"), f"missing; `type` is one of: {choices}")
        case "union_tag_invalid":
            tag = str(error.get("ctx", {}).get("tag", ""))
            reporter.value((*path, "type"), f"unknown type `{tag}`{suggestion(tag, _tags(annotation))}")
        case "value_error":
            reporter.value(path, error["msg"].removeprefix("Value error, "))
        case _:
            reporter.value(path, _mismatch(error, annotation, owner, str(name)))


def _mismatch(error: ErrorDetails, annotation: Annotation, owner: type[Schema] | None, name: str) -> str:
    """What should stand here, and what does."""
    found = _described(error["input"])
    match error["type"]:
        case "float_type" | "int_type" | "int_from_float":
            whole = "a whole number" if error["type"].startswith("int") else "a number"
            return f"must be {whole}{_limits(owner, name)}, not {found}"
        case "greater_than" | "greater_than_equal" | "less_than" | "less_than_equal":
            return f"must be{_limits(owner, name)}, not {found}"
        case "string_type":
            quote = "; quote it if it is meant as text" if isinstance(error["input"], (int, float)) else ""
            return f"must be text, not {found}{quote}"
        case "bool_type":
            return f"must be true or false, not {found}"
        case "literal_error":
            choices = [str(choice) for choice in get_args(_bare(annotation))]
            return f"must be one of {', '.join(choices)}, not {found}{_near(error['input'], choices)}"
        case "model_type" | "dict_type" | "model_attributes_type":
            return f"must be {_form(annotation)}, not {found}"
        case "list_type":
            return f"must be a list (`[a, b]` or `- a` lines), not {found}"
        case "string_too_short" | "too_short":
            return "must not be empty"
        case _:
            return error["msg"]


def _form(annotation: Annotation) -> str:
    bare = _bare(annotation)
    return bare.form if isinstance(bare, type) and issubclass(bare, Schema) else Schema.form


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
    """The range a field declares: ` above 0 and at most 85`."""
    texts: list[str] = []
    for limit in _constraints(_field(owner, name)):
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


def _constraints(found: FieldInfo | None) -> Iterator[object]:
    if found is None:
        return
    yield from found.metadata
    for member in _members(found.annotation):
        if get_origin(member) is Annotated:
            yield from get_args(member)[1:]


def _field(owner: type[Schema] | None, name: str) -> FieldInfo | None:
    if owner is None:
        return None
    for key, info in owner.model_fields.items():
        if name == (info.alias or key):
            return info
    return None


def _keys(owner: type[Schema]) -> list[str]:
    return [info.alias or key for key, info in owner.model_fields.items()]


def _description(owner: type[Schema] | None, name: str) -> str:
    found = _field(owner, name)
    return f": {found.description}" if found and found.description else ""


def _resolve(model: type[Schema], location: KeyPath) -> tuple[KeyPath, type[Schema] | None, Annotation]:
    """The path in the document (pydantic's has tags of unions in between), the mapping that owns its last key,
    and what is expected there."""
    path: list[str | int] = []
    owner: type[Schema] | None = None
    annotation: Annotation = model
    for part in location:
        annotation = _bare(annotation)
        member = _member(annotation, part)
        if member is not None:
            annotation = member
            continue
        path.append(part)
        owner, annotation = _descend(annotation, part)
    return tuple(path), owner, annotation


def _descend(annotation: Annotation, part: str | int) -> tuple[type[Schema] | None, Annotation]:
    if isinstance(annotation, type) and issubclass(annotation, Schema):
        found = _field(annotation, str(part))
        return annotation, found.annotation if found else None
    if get_origin(annotation) is dict:
        return None, get_args(annotation)[1]
    if get_origin(annotation) is list:
        return None, get_args(annotation)[0]
    return None, None


def _bare(annotation: Annotation) -> Annotation:
    """Without `Annotated[...]` and `| None`."""
    while True:
        if get_origin(annotation) is Annotated:
            annotation = get_args(annotation)[0]
            continue
        members = _members(annotation)
        if len(members) != 1:
            return annotation
        annotation = members[0]


def _members(annotation: Annotation) -> list[Annotation]:
    if get_origin(annotation) not in (Union, UnionType):
        return []
    return [member for member in get_args(annotation) if member is not NoneType]


def _member(annotation: Annotation, tag: str | int) -> type[Schema] | None:
    """The member of a tagged union that carries this tag."""
    for member in _members(annotation):
        if tag in _tag_of(member):
            return member
    return None


def _tags(annotation: Annotation) -> list[str]:
    return [tag for member in _members(_bare(annotation)) for tag in _tag_of(member)]


def _tag_of(member: Annotation) -> list[str]:
    found = _field(member, "type") if isinstance(member, type) and issubclass(member, Schema) else None
    return list(get_args(found.annotation)) if found and get_origin(found.annotation) is Literal else []
