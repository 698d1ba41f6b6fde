"""The command `airrace show`: what a checkpoint or a flown log holds."""

from typing import TYPE_CHECKING, Annotated

import typer

from airrace.cli import completion
from airrace.cli.answer import answering
from airrace.cli.options import AsJson, RunFile, TrustedKey, Verbose

if TYPE_CHECKING:
    from airrace.checkpoint import Recorded
    from airrace.runs.command_result import Answer


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
    verbose: Verbose = False,
) -> None:
    """Show stages, times, legs and certificates."""
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.checkpoint import Recorded, read_sealed, read_stored
        from airrace.cli.show_texts import shown_texts
        from airrace.cli.stored_stages import shown_object, shown_of
        from airrace.runs.signing import ensure_signed

        stored = read_stored(run_file)
        signature = None if isinstance(stored, Recorded) or trust is None else read_sealed(run_file)[1]
        signed_by = "" if trust is None else ensure_signed(run_file, signature, trust)
        if isinstance(stored, Recorded):
            _show_flown(answer, stored, stage, legs=legs, as_json=as_json)
            return
        shown = shown_of(stored, run_file, stage)
        answer.fields.update(shown_object(shown))
        answer.fields["signed_by"] = signed_by or None
        if signed_by:
            answer.texts.append(f"signed by {signed_by}")
        if not as_json:
            answer.texts.extend(shown_texts(shown, legs=legs, certificates=certificate))


def _show_flown(answer: "Answer", stored: "Recorded", stage: str | None, *, legs: bool, as_json: bool) -> None:
    from airrace.cli.flown_tables import flown_texts
    from airrace.runs.flight_sources import source_of
    from airrace.runs.json_objects import flown_object
    from airrace.runs.log_view import opened_log

    flown = opened_log(stored)
    source_of(flown, stage)
    answer.fields.update(flown_object(flown))
    if not as_json:
        answer.texts.extend(flown_texts(flown, legs=legs))
