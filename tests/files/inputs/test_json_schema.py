"""The languages as JSON Schema: what editors are told agrees with what the reader accepts."""

import copy
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft7Validator

from airrace.files.inputs.json_schema import LANGUAGES, json_schema
from airrace.files.inputs.rules import preset_names
from airrace.files.inputs.yaml_reader import read_yaml

ROOT = Path(__file__).parents[3]
SCHEMAS = {language: json_schema(language) for language in LANGUAGES}
SHIPPED = [("track", path) for path in sorted((ROOT / "tracks").glob("*.yaml"))] + [
    ("aircraft", path) for path in sorted((ROOT / "configs").glob("*.yaml"))
]
FOREIGN = {"$defs", "prefixItems", "discriminator", "nullable", "unevaluatedProperties", "dependentRequired"}

COURSE: dict[str, Any] = {
    "schema": "airrace/track/1",
    "name": "All of it",
    "rules": {"preset": "rbar-2016", "n_z_max": 11},
    "gates": {
        "level": {"type": "level", "north_m": 0, "east_m": 0.5, "heading_deg": 70},
        "pylon": {"type": "pylon", "latitude_deg": 45.0, "longitude_deg": 13.6, "pass_side_deg": 110},
        "quad": {"type": "quad", "north_m": 280, "east_m": 480, "heading_deg": 270, "then": "left"},
        "top": {"type": "high-turn", "height_min_m": 152.4},
        "roll": {"type": "vertical-roll", "roll_deg": 315},
    },
    "safety_lines": {
        "beach": {"from": {"north_m": 0, "east_m": 0}, "to": {"north_m": 1, "east_m": 0}, "keep": "left"},
    },
    "crowd": {"tower": {"point": {"north_m": 900, "east_m": 0}, "distance_m": 100}},
    "airspace": [{"north_m": 0, "east_m": 0}, {"north_m": 9, "east_m": 0}, {"north_m": 9, "east_m": 9}],
    "course": {
        "start": "level",
        "lap": ["pylon", {"gate": "level", "direction": "reverse", "safety_lines": ["beach"]}, "quad", "top", "roll"],
    },
}
SETTINGS: dict[str, Any] = {"schema": "airrace/settings/1", "guess": "plan", "mesh": {"interval_s": 0.1}}
AIRCRAFT: dict[str, Any] = {
    **dict(read_yaml("", (ROOT / "configs" / "edge540.yaml").read_text(encoding="utf-8")).plain())
}
BATCH: dict[str, Any] = {
    "schema": "airrace/batch/1",
    "courses": ["tracks/*.yaml"],
    "set": {"rules.n_z_max": 9},
    "sweep": {"environment.wind.speed_kt": [0, 5.5], "environment.wind.from_deg": "0:360:45"},
}
LOG: dict[str, Any] = {
    "schema": "airrace/log/1",
    "columns": {"time": "t", "altitude": "alt [ft]"},
    "time_zone": "+02:00",
    "delimiter": "tab",
    "decimal": "comma",
    "position_noise_m": 1.5,
    "position_accuracy_m": 2.0,
}
DOCUMENTS = {"track": COURSE, "aircraft": AIRCRAFT, "settings": SETTINGS, "batch": BATCH, "log": LOG}


def nodes(node: object, path: str = "#") -> Iterator[tuple[str, Any]]:
    """Every mapping of a schema with its path; not what is data in it (defaults, constants)."""
    if isinstance(node, dict):
        yield path, node
        for key, value in node.items():
            if key not in ("default", "const", "enum"):
                yield from nodes(value, f"{path}/{key}")
    elif isinstance(node, list):
        for number, value in enumerate(node):
            yield from nodes(value, f"{path}/{number}")


def errors(language: str, document: object) -> list[str]:
    return [error.message for error in Draft7Validator(SCHEMAS[language]).iter_errors(document)]


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_schema_is_one_of_draft_07_that_describes_every_key_and_takes_no_other(language: str) -> None:
    schema = SCHEMAS[language]
    Draft7Validator.check_schema(schema)
    assert schema["$schema"] == "http://json-schema.org/draft-07/schema#"
    assert next(iter(schema)) == "$schema"
    assert json.loads(json.dumps(schema, allow_nan=False)) == schema
    for path, node in nodes(schema):
        assert not FOREIGN & set(node), path
        assert "$ref" not in node or len(node) == 1, path
        assert node.get("type") != "null", path
        assert node.get("items") is None or isinstance(node["items"], dict), path
    references = {node["$ref"] for _, node in nodes(schema) if "$ref" in node}
    assert references == {f"#/definitions/{name}" for name in schema["definitions"]}
    objects = [(path, node) for path, node in nodes(schema) if isinstance(node.get("properties"), dict)]
    properties = [(f"{path}/{key}", one) for path, node in objects for key, one in node["properties"].items()]
    assert len(properties) >= {"batch": 8, "log": 7}.get(language, 16)
    assert [path for path, one in properties if not one.get("description", "").strip()] == []
    assert [path for path, node in objects if node.get("additionalProperties") is not False] == []


def test_every_kind_of_element_is_told_apart_by_a_constant() -> None:
    members = SCHEMAS["track"]["properties"]["gates"]["additionalProperties"]["oneOf"]
    definitions = SCHEMAS["track"]["definitions"]
    kinds = [definitions[member["$ref"].removeprefix("#/definitions/")] for member in members]
    constants = [kind["properties"]["type"]["const"] for kind in kinds]
    assert {"level", "knife-edge", "quad", "pylon", "manoeuvre", "high-turn", "vertical-roll"} == set(constants)
    assert all("type" in kind["required"] for kind in kinds)


def test_presets_are_offered_by_name() -> None:
    text, mapping = SCHEMAS["track"]["definitions"]["RulesEntry"]["anyOf"]
    assert text["enum"] == mapping["properties"]["preset"]["enum"] == list(preset_names())


@pytest.mark.parametrize(("language", "path"), SHIPPED, ids=[path.stem for _, path in SHIPPED])
def test_what_is_shipped_is_valid(language: str, path: Path) -> None:
    document = read_yaml(path.name, path.read_text(encoding="utf-8")).plain()
    assert errors(language, document) == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_document_with_everything_in_it_is_valid_and_needs_its_required_keys(language: str) -> None:
    assert errors(language, DOCUMENTS[language]) == []
    for key in SCHEMAS[language]["required"]:
        document = {name: value for name, value in DOCUMENTS[language].items() if name != key}
        assert any(f"'{key}' is a required property" in message for message in errors(language, document))


def test_a_preset_may_stand_for_the_rules() -> None:
    assert errors("track", {**COURSE, "rules": "rbar-2016"}) == []
    assert errors("track", {**COURSE, "rules": "rbar-1916"}) != []


BROKEN: list[tuple[str, tuple[str | int, ...], object]] = [
    ("track", ("schema",), "airrace/track/3"),
    ("track", ("name",), ""),
    ("track", ("nmae",), "x"),
    ("track", ("origin",), None),
    ("track", ("rules", "n_z_max"), 26),
    ("track", ("rules", "n_z_max"), "ten"),
    ("track", ("rules", "n_z_max"), None),
    ("track", ("gates", "level", "heading"), 3),
    ("track", ("gates", "level", "heading_deg"), 361),
    ("track", ("gates", "level", "type"), "levle"),
    ("track", ("gates", "level", "width_m"), 0),
    ("track", ("gates", "quad", "then"), "up"),
    ("track", ("gates", "roll", "roll_deg"), 30),
    ("track", ("gates", "top"), "high"),
    ("track", ("safety_lines", "beach", "keep"), "north"),
    ("track", ("crowd", "tower", "distance_m"), 0),
    ("track", ("airspace", 0), "here"),
    ("track", ("course", "lap", 0), 7),
    ("track", ("course", "lap", 1, "direction"), "back"),
    ("track", ("course", "lap"), []),
    ("track", ("course", "laps"), 1.5),
    ("aircraft", ("airframe", "mass_kg"), 0),
    ("aircraft", ("roll", "C_lp"), 0.1),
    ("aircraft", ("engine",), {}),
    ("settings", ("guess",), "luck"),
    ("settings", ("solver",), {"iterations_max": 0}),
    ("settings", ("mesh", "interval_s"), True),
    ("batch", ("courses",), []),
    ("batch", ("set", "rules.n_z_max"), [9]),
    ("batch", ("sweep", "environment.wind.from_deg"), 45),
]


@pytest.mark.parametrize(("language", "path", "value"), BROKEN, ids=lambda one: str(one)[:60])
def test_what_the_reader_refuses_the_schema_refuses(language: str, path: tuple[str | int, ...], value: object) -> None:
    document = copy.deepcopy(DOCUMENTS[language])
    within: Any = document
    for key in path[:-1]:
        within = within[key]
    within[path[-1]] = value
    assert errors(language, document) != []
