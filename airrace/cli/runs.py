"""Commands that read a run: `show`, `verify` and `sensitivity`."""

from enum import StrEnum
from typing import Annotated

import typer

from airrace.cli.answer import answering
from airrace.cli.options import AsJson, NoVerify, RunFile, SigningKey, StageOfRun, TrustedKey, Verbose, stage_option


def show(
    run_file: RunFile,
    stage: Annotated[str | None, stage_option("Show this stage alone; by default all.")] = None,
    legs: Annotated[
        bool, typer.Option("--legs", help="Tell every leg of the stage, by default of the last one.")
    ] = False,
    certificate: Annotated[bool, typer.Option("--certificate", help="List every item of the certificates.")] = False,
    no_verify: NoVerify = False,
    trust: TrustedKey = None,
    as_json: AsJson = False,
    verbose: Verbose = False,
) -> None:
    """Show stages, times, legs and certificates."""
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.checkpoint import LogCheckpoint, read_stored
        from airrace.cli.run_tables import run_texts, stored_stages
        from airrace.runs.signing import ensure_signed

        stored, signature = read_stored(run_file)
        signature = None if isinstance(stored, LogCheckpoint) else signature
        signed_by = "" if trust is None else ensure_signed(run_file, signature, trust)
        if isinstance(stored, LogCheckpoint):
            from airrace.cli.flight_tables import log_texts
            from airrace.runs.flight_sources import source_of
            from airrace.runs.json_objects import log_object
            from airrace.runs.log_view import open_log

            log = open_log(stored)
            source_of(log, stage)
            log = log.confirmed(verify=not no_verify)
            answer.fields.update(log_object(log))
            if not as_json:
                answer.texts.extend(log_texts(log, legs=legs))
            answer.fail_if_refuted({log.recorded.label: log.confirmation})
            return
        shown = stored_stages(stored, run_file, stage, verify=not no_verify)
        answer.fields.update(shown.as_object(), signed_by=signed_by or None)
        if signed_by:
            answer.texts.append(f"signed by {signed_by}")
        if not as_json:
            answer.texts.extend(run_texts(shown, legs=legs, certificates=certificate))
        answer.fail_if_refuted({one.value: found for one, found in shown.confirmations.items()})


def verify(
    run_file: RunFile,
    other_versions: Annotated[
        bool,
        typer.Option(
            "--other-versions",
            help="Also verify a run that other versions of airrace and its libraries have made, and leave open which.",
        ),
    ] = False,
    trust: TrustedKey = None,
    sign: SigningKey = None,
    as_json: AsJson = False,
    verbose: Verbose = False,
) -> None:
    """Verify all that a run tells.

    Every stage is measured again from its histories and multipliers alone, and what is stored is compared with that. A
    run is verified if nothing differs, the stage that it ends with is certified, and all others hold in what they
    claim. Of an imported log passings, histories and violations are made once more of the log that is stored.
    """
    with answering({"track": None, "verified": False, "stages": []}, as_json=as_json, verbose=verbose) as answer:
        from airrace.checkpoint import LogCheckpoint, read_stored
        from airrace.cli.run_tables import items_table
        from airrace.cli.tables import render
        from airrace.errors import UsageError
        from airrace.procedure.result import UNVERIFIABLE
        from airrace.runs.command_result import ExitCode
        from airrace.runs.run import ensure_readable, run_of_checkpoint
        from airrace.runs.signing import ensure_signed, signer_of
        from airrace.runs.verification import confirm_log, verify_run
        from airrace.standard_streams import STANDARD

        if sign is not None and run_file == STANDARD:
            raise UsageError("what is piped in cannot be signed: name a file")
        signer = None if sign is None else signer_of(sign)
        checkpoint, signature = read_stored(run_file)
        if isinstance(checkpoint, LogCheckpoint):
            from airrace.runs.log_view import open_log

            if sign is not None or trust is not None:
                raise UsageError("a flight log is not signed: leave --sign and --trust out")
            log = open_log(checkpoint)
            found = confirm_log(log, versions=not other_versions)
            answer.fields.update(flown=True, track=log.inputs.race.course.name, verified=bool(found.verified))
            answer.fields["verification"] = found.words
            if not found.verified:
                answer.fail(ExitCode.NOT_CERTIFIED, f"{checkpoint.label}: {found.words}")
            answer.texts.append(f"{checkpoint.label}: {found.outcome}; its log is taken as it is")
            return
        signed_by = "" if trust is None else ensure_signed(run_file, signature, trust)
        run = ensure_readable(run_of_checkpoint(checkpoint, run_file))
        answer.fields["track"] = run.name
        stages = verify_run(run, versions=not other_versions)
        for stage in stages:
            if stage.objection:
                answer.fail(ExitCode.NOT_CERTIFIED, f"{stage.result.stage.value}: {stage.objection}")
        unverified = [] if trust is not None else list(UNVERIFIABLE) + ["versions"] * other_versions
        answer.fields.update(verified=not answer.error, stages=[stage.as_object() for stage in stages])
        answer.fields.update(unverified=unverified, signed_by=signed_by or None)
        for stage in stages:
            answer.texts.append(f"{stage.result.stage.value}: {stage.finding}")
            if stage.certificate is not None:
                answer.texts.append(render(items_table(stage.certificate)))
        if signed_by:
            answer.texts.append(f"signed by {signed_by}")
        elif unverified:
            answer.texts.append(f"unverified, for they cannot be measured again: {', '.join(unverified)}")
        if signer is not None and not answer.error:
            run.signing(signer).save(run_file)
            answer.texts.append(f"signed now by {signer.fingerprint}")


class GroupName(StrEnum):
    """A group of numbers whose sensitivities are wanted.

    The names are those of `airrace.sensitivity.ParameterGroup`, which is too heavy to import here.
    """

    TRACK = "track"
    AIRCRAFT = "aircraft"
    RULES = "rules"
    ENVIRONMENT = "environment"


def sensitivity(
    run_file: RunFile,
    stage: StageOfRun = None,
    by: Annotated[GroupName | None, typer.Option(help="Only the numbers of these.")] = None,
    as_json: AsJson = False,
    verbose: Verbose = False,
    as_csv: Annotated[bool, typer.Option("--csv", help="Print comma-separated values, free numbers included.")] = False,
) -> None:
    """Tell how the race time depends on every number.

    These are shadow prices in seconds per unit, from the multipliers of an optimum; nothing is solved again.
    """
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.cli.flight_tables import sensitivities_csv, sensitivities_text
        from airrace.cli.tables import terminal_columns
        from airrace.errors import UsageError
        from airrace.runs.run import open_run

        if as_json and as_csv:
            raise UsageError("--json and --csv exclude each other")
        run = open_run(run_file)
        view = run.stage(stage)
        answer.fields.update(track=run.name, stage=view.name, race_time_s=None, sensitivities={})
        found = list(view.sensitivities(None if by is None else by.value).values())
        answer.fields["race_time_s"] = view.race_time
        answer.fields["sensitivities"] = {one.key: one.as_object() for one in found}
        answer.texts.append(
            sensitivities_csv(found) if as_csv else sensitivities_text(view.result, found, terminal_columns())
        )
