"""`airrace show`: what a checkpoint holds."""

from typing import Annotated

import typer

from airrace.cli import completion
from airrace.cli.answer import answering
from airrace.cli.options import AsJson, RunFile


def show(
    run_file: RunFile,
    stage: Annotated[
        str | None,
        typer.Option(metavar="STAGE", autocompletion=completion.stages, help="Show this stage alone; by default all."),
    ] = None,
    legs: Annotated[
        bool, typer.Option("--legs", help="Tell every leg of the stage, by default of the last one.")
    ] = False,
    certificate: Annotated[bool, typer.Option("--certificate", help="List every item of the certificates.")] = False,
    as_json: AsJson = False,
) -> None:
    """Show stages, times, legs and certificates."""
    with answering(as_json=as_json) as answer:
        from airrace.checkpoint import read_checkpoint
        from airrace.cli.show_texts import shown_texts
        from airrace.runs.shown import shown_object, shown_of

        shown = shown_of(read_checkpoint(run_file), run_file, stage)
        answer.fields.update(shown_object(shown))
        if not as_json:
            answer.texts.extend(shown_texts(shown, legs=legs, certificates=certificate))
