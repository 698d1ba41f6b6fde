"""The command `airrace init`: a course to begin with."""

from pathlib import Path
from typing import Annotated

import typer

from airrace.cli import completion
from airrace.cli.answer import answer_written, answering, ensure_room
from airrace.cli.options import AsJson, Force, Quiet, Verbose


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
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Write a course to begin with.

    NAME.yaml flies as it stands, and its comments say what every part of it is. track.schema.json, which is written
    beside it, lets editors complete its keys and mark mistakes. - is stdout.
    """
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.runs.courses import init as written

        ensure_room(name, as_json=as_json)
        path = written(name, like=like, from_=from_, force=force)
        remark = f"; fly it with `airrace optimize {path} --until point-mass`"
        if from_ is not None:
            remark = f"; look at it with `airrace check {path}`, for placemarks say little"
        answer_written(answer, [path], quiet=quiet, remark=remark)
