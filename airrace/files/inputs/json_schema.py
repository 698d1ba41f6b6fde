"""The languages as JSON Schema (draft-07), for editors and other programs.

Everything is derived from the models that read the documents. What a JSON Schema cannot say is left to `airrace check`:
which keys exclude one another, that names refer to something, and that `1.0` is no whole number.
"""

import json
from collections.abc import Callable
from typing import Any, cast

from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema

from airrace.files.inputs.aircraft import AircraftEntry
from airrace.files.inputs.log_columns import LogEntry
from airrace.files.inputs.rules import RulesEntry, preset_names
from airrace.files.inputs.schema import Schema
from airrace.files.inputs.settings import BatchEntry, SettingsEntry
from airrace.files.inputs.track import track_language

DIALECT = "http://json-schema.org/draft-07/schema#"
LANGUAGES: dict[str, Callable[[], type[Schema]]] = {
    "track": track_language,
    "aircraft": lambda: AircraftEntry,
    "settings": lambda: SettingsEntry,
    "batch": lambda: BatchEntry,
    "log": lambda: LogEntry,
}
"""The languages by name, each with the model that reads its documents."""


def json_schema(language: str) -> JsonSchemaValue:
    """Return the JSON Schema of what a file of a language may hold.

    Args:
        language: one of `LANGUAGES`.

    Raises:
        KeyError: there is no such language.
    """
    model = LANGUAGES[language]()
    generated = model.model_json_schema(ref_template="#/definitions/{model}", schema_generator=_Generator)
    definitions = generated.pop("$defs", {})
    title = "Mapping of a log for airrace" if language == "log" else f"{language.capitalize()} of airrace"
    first = {"$schema": DIALECT, "title": title, "description": generated.get("description", "")}
    return cast(JsonSchemaValue, _lone_references({**first, **generated, **first, "definitions": definitions}))


def schema_text(language: str) -> str:
    """Return the JSON Schema of a language as the text of a file."""
    return json.dumps(json_schema(language), indent=2) + "\n"


class _Generator(GenerateJsonSchema):
    """The generator of pydantic, without what is not draft-07 and what the reader does not accept."""

    def nullable_schema(self, schema: core_schema.NullableSchema) -> JsonSchemaValue:
        """Leave null out: an absent key is None to the models, but `null` may not be written."""
        return self.generate_inner(schema["schema"])

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> JsonSchemaValue:
        """Keep plain defaults only: None and "" stand for an absent key, a mapping for defaults within."""
        described = super().default_schema(schema)
        default = described.get("default")
        if default == "" or not isinstance(default, (bool, int, float, str)):
            described.pop("default", None)
        return described

    def tagged_union_schema(self, schema: core_schema.TaggedUnionSchema) -> JsonSchemaValue:
        """Leave `discriminator` out, which belongs to OpenAPI.

        The constant `type` distinguishes the members.
        """
        described = super().tagged_union_schema(schema)
        described.pop("discriminator", None)
        return described

    def model_schema(self, schema: core_schema.ModelSchema) -> JsonSchemaValue:
        """Describe a mapping, or the bare text it may be shortened to."""
        described = super().model_schema(schema)
        model = schema["cls"]
        if not issubclass(model, Schema):
            return described
        described["title"] = model.what
        if issubclass(model, RulesEntry):
            described["properties"]["preset"]["enum"] = list(preset_names())
        if model.shorthand is None:
            return described
        text = {"title": model.what, **described["properties"][model.shorthand]}
        return {"title": model.what, "anyOf": [text, described]}

    def field_title_should_be_set(self, schema: Any) -> bool:  # Any: pydantic's union of all its schemas
        """Return that fields have no titles: a key is its own title."""
        return False

    def sort(self, value: JsonSchemaValue, parent_key: str | None = None) -> JsonSchemaValue:
        """Leave keys in the order in which the models declare them: editors offer them so."""
        return value


# Any: JSON of any shape.
def _lone_references(node: Any) -> Any:
    """Put references into an `allOf` of their own, for in draft-07 everything beside `$ref` is ignored."""
    if isinstance(node, list):
        return [_lone_references(item) for item in cast(list[Any], node)]
    if not isinstance(node, dict):
        return node
    mapping = {key: _lone_references(value) for key, value in cast(dict[str, Any], node).items()}
    if "$ref" in mapping and len(mapping) > 1:
        return {"allOf": [{"$ref": mapping.pop("$ref")}], **mapping}
    return mapping
