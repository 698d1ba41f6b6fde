"""The command `airrace schema`: the languages of the input files as JSON Schema."""

from enum import Enum
from typing import Annotated

import typer

from airrace.cli.answer import answering
from airrace.cli.options import Verbose


class Language(Enum):
    """A language of input files."""

    TRACK = "track"
    AIRCRAFT = "aircraft"
    SETTINGS = "settings"
    BATCH = "batch"
    LOG = "log"


def schema(
    language: Annotated[
        Language, typer.Argument(metavar="LANGUAGE", help="One of: track, aircraft, settings, batch, log.")
    ],
    verbose: Verbose = False,
) -> None:
    """Print the JSON Schema of an input file.

    It is draft-07, for editors that complete keys and mark mistakes while you type.
    """
    with answering(as_json=False, verbose=verbose) as answer:
        from airrace.inputs.json_schema import schema_text

        answer.texts.append(schema_text(language.value))
