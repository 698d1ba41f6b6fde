"""`airrace schema` prints what the languages are, and nothing else."""

import json

import pytest
from typer.testing import CliRunner

from airrace.cli.courses import Language
from airrace.cli.main import app
from airrace.inputs.json_schema import LANGUAGES, json_schema


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_language_is_printed_as_one_object(language: str) -> None:
    ran = CliRunner().invoke(app, ["schema", language])
    assert (ran.exit_code, ran.stderr) == (0, "")
    assert json.loads(ran.stdout) == json_schema(language)


def test_the_command_knows_every_language() -> None:
    assert [language.value for language in Language] == list(LANGUAGES)


def test_another_language_is_refused_with_the_known_ones() -> None:
    ran = CliRunner().invoke(app, ["schema", "wind"])
    assert ran.exit_code == 2
    assert all(language in ran.stderr for language in LANGUAGES)
