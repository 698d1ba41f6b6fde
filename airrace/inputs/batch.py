"""The language `airrace/batch/1` of `batch.yaml`: which courses, and the settings of each."""

import re
from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from airrace.inputs.document import Document
from airrace.inputs.nodes import Reporter
from airrace.inputs.schema import Schema, optional, read_entry
from airrace.inputs.yaml_reader import plain_scalar

Value = str | int | float | bool
Files = Annotated[list[str], Field(min_length=1, max_length=100_000)]

_OF_A_BATCH = re.compile(r"^schema:\s*[\"']?airrace/batch/", re.MULTILINE)


class BatchEntry(Schema):
    """A whole batch file. Paths are relative to it."""

    what: ClassVar[str] = "a batch"
    schema_: Literal["airrace/batch/1"] = Field(alias="schema", description="the language of this file and its version")
    notes: str = Field(default="", description="whatever a reader should know")
    courses: Files = Field(description="track files, patterns such as `tracks/*.yaml`, or courses that come along")
    aircraft: Files | None = optional("aircraft files, each of which flies every course; without them the tracks' own")
    settings: str | None = optional("a settings file")
    set: dict[str, Value] = Field(default_factory=dict[str, Value], description="single values, as `--set` gives them")
    sweep: dict[str, str | list[Value]] = Field(
        default_factory=dict[str, str | list[Value]],
        description="values that are tried in turn, as `--sweep` gives them: a list, or a range `first:last:step`",
    )
    until: str | None = optional("the last stage")


def is_batch(document: Document) -> bool:
    """Return whether a document says it is a batch, be it right or wrong in everything else."""
    return _OF_A_BATCH.search(document.text) is not None


def read_batch(document: Document) -> tuple[BatchEntry, Reporter]:
    """Return the content of a batch file, and the reporter for what else is found to be wrong with it.

    Raises:
        InputError: the inputs are not valid; it carries all findings.
    """
    return read_entry(BatchEntry, document)


def value_text(value: Value) -> str:
    """Return a value as `--set` would be given it: text that looks like something else is quoted."""
    if isinstance(value, bool):
        return str(value).lower()
    if not isinstance(value, str):
        return repr(value)
    try:
        is_plain = plain_scalar(value) == value and value[:1] not in ("'", '"')
    except ValueError:
        is_plain = False
    return value if is_plain else "'" + value.replace("'", "''") + "'"


def set_texts(values: Mapping[str, Value]) -> list[str]:
    """Return `key=value` for each of the values."""
    return [f"{key}={value_text(value)}" for key, value in values.items()]
