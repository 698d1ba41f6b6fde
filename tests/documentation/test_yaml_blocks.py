"""The YAML of the pages is valid: whole files as the command reads them, parts of files against their schema."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml
from pages import ROOT, Block, blocks

from airrace.inputs import Document, load_inputs
from airrace.inputs.batch import read_batch
from airrace.inputs.json_schema import LANGUAGES, json_schema
from airrace.inputs.log_layout import read_layout

BLOCKS = blocks("yaml")
WORKFLOW = "# .github/workflows/"
WHOLE = [block for block in BLOCKS if block.text.startswith("schema: ")]
WITH = "with: "
"""Begins the comment above a part of a file that needs an extension, with the path of the extension behind it."""

EXTENDED = [block for block in BLOCKS if block.comment.startswith(WITH)]
PARTS = [block for block in BLOCKS if not block.text.startswith(("schema: ", WORKFLOW)) and block not in EXTENDED]
TRACK = ROOT / "tracks" / "half_cuban_eight.yaml"
AIRCRAFT = ROOT / "configs" / "edge540.yaml"


def read(block: Block, folder: Path) -> None:
    """Read a whole file as the command does; it raises if anything is wrong."""
    language = block.text.split("\n", 1)[0].split("/")[1]
    path = folder / f"{language}.yaml"
    path.write_text(block.text, encoding="utf-8")
    match language:
        case "track":
            load_inputs(path, aircraft=AIRCRAFT)
        case "aircraft":
            load_inputs(TRACK, aircraft=path)
        case "settings":
            load_inputs(TRACK, aircraft=AIRCRAFT, settings=path)
        case "batch":
            _, reporter = read_batch(Document("batch.yaml", block.text))
            assert reporter.findings == []
        case "log":
            layout, _ = read_layout(path)
            assert layout.columns
        case _:
            raise AssertionError(f"{block}: {language} is no language")


@pytest.mark.parametrize("block", WHOLE, ids=str)
def test_every_whole_file_in_the_pages_is_valid(block: Block, tmp_path: Path) -> None:
    read(block, tmp_path)


def test_the_pages_show_files_of_three_languages() -> None:
    assert {block.text.split("/")[1] for block in WHOLE} >= {"track", "settings", "batch"}


@pytest.mark.parametrize("block", PARTS, ids=str)
def test_every_part_of_a_file_in_the_pages_is_valid(block: Block) -> None:
    part: dict[str, Any] = yaml.safe_load(block.text)  # Any: YAML of any shape
    fitting = [json_schema(one) for one in LANGUAGES if part.keys() <= json_schema(one)["properties"].keys()]
    assert len(fitting) == 1, f"{block}: the keys {', '.join(part)} belong to {len(fitting)} languages"
    (schema,) = fitting
    jsonschema.validate(part, {**schema, "required": []})


@pytest.mark.parametrize("block", EXTENDED, ids=str)
def test_every_part_that_needs_an_extension_is_valid_with_it_alone(block: Block) -> None:
    extension = ROOT / block.comment.removeprefix(WITH)
    program = "import json; from airrace.inputs.json_schema import json_schema; print(json.dumps(json_schema('track')))"
    environment = {**os.environ, "AIRRACE_EXTENSIONS": str(extension)}
    told = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    part = yaml.safe_load(block.text)
    jsonschema.validate(part, {**json.loads(told.stdout), "required": []})
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(part, {**json_schema("track"), "required": []})


def test_a_part_with_a_wrong_value_would_be_found() -> None:
    (block,) = (one for one in PARTS if "omega_z_rad_s" in one.text)
    wrong = Block(block.page, block.line, block.language, block.text.replace("0.7", "-0.7"))
    with pytest.raises(jsonschema.ValidationError):
        test_every_part_of_a_file_in_the_pages_is_valid(wrong)
