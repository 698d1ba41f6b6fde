"""The command `airrace show`: what a checkpoint holds."""

from typing import Annotated

import typer

from airrace.cli import completion
from airrace.cli.answer import answering
from airrace.cli.options import AsJson, RunFile, TrustedKey


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
    trust: TrustedKey = None,
    as_json: AsJson = False,
) -> None:
    """Show stages, times, legs and certificates."""
    with answering(as_json=as_json) as answer:
        from airrace.checkpoint import read_sealed
        from airrace.cli.show_texts import shown_texts
        from airrace.runs.shown import shown_object, shown_of
        from airrace.runs.signing import ensure_signed

        checkpoint, signature = read_sealed(run_file)
        signed_by = "" if trust is None else ensure_signed(run_file, signature, trust)
        shown = shown_of(checkpoint, run_file, stage)
        answer.fields.update(shown_object(shown))
        answer.fields["signed_by"] = signed_by or None
        if signed_by:
            answer.texts.append(f"signed by {signed_by}")
        if not as_json:
            answer.texts.extend(shown_texts(shown, legs=legs, certificates=certificate))
