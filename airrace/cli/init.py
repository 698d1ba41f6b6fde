"""The command `airrace init`: a course to begin with."""

from pathlib import Path
from typing import Annotated

import typer

from airrace.cli import completion
from airrace.cli.answer import answering


def init(
    name: Annotated[Path, typer.Argument(metavar="NAME", readable=False, help="Name of the new course.")],
    like: Annotated[
        Path | None,
        typer.Option(
            metavar="TRACK",
            readable=False,
            autocompletion=completion.tracks,
            help="Copy this course, a file or a name that comes along.",
        ),
    ] = None,
    from_: Annotated[
        Path | None,
        typer.Option(
            "--from",
            metavar="FILE",
            readable=False,
            help="Sketch the course from placemarks: KML, GPX or GeoJSON, in the order flown.",
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")] = False,
) -> None:
    """Write a course to begin with.

    NAME.yaml flies as it stands, and its comments say what every part of it is. track.schema.json, which is written
    beside it, lets editors complete its keys and mark mistakes.
    """
    with answering(as_json=False) as answer:
        from airrace.runs.init import init as written

        path = written(name, like=like, from_=from_, force=force)
        if from_ is not None:
            answer.texts.append(f"{path} is written; look at it with `airrace check {path}`, for placemarks say little")
            return
        answer.texts.append(f"{path} is written; fly it with `airrace optimize {path} --until point-mass`")
