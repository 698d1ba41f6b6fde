"""The command `airrace verify`: it measures again what a checkpoint claims."""

from typing import Annotated

import typer

from airrace.cli.answer import answering
from airrace.cli.options import AsJson, RunFile, SigningKey, TrustedKey, Verbose


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
    claim.
    """
    with answering({"track": None, "verified": False, "stages": []}, as_json=as_json, verbose=verbose) as answer:
        from airrace.checkpoint import read_sealed
        from airrace.cli.tables import certificate_table, rendered
        from airrace.errors import UsageError
        from airrace.procedure.result import UNVERIFIABLE
        from airrace.runs.command_result import ExitCode
        from airrace.runs.run import readable, stored_run
        from airrace.runs.signing import ensure_signed, signer_of
        from airrace.runs.verification import verified
        from airrace.standard_streams import STANDARD

        if sign is not None and run_file == STANDARD:
            raise UsageError("what is piped in cannot be signed: name a file")
        signer = None if sign is None else signer_of(sign)
        checkpoint, signature = read_sealed(run_file)
        signed_by = "" if trust is None else ensure_signed(run_file, signature, trust)
        run = readable(stored_run(checkpoint, run_file))
        answer.fields["track"] = run.name
        stages = verified(run, versions=not other_versions)
        for stage in stages:
            if stage.objection:
                answer.fail(ExitCode.NOT_CERTIFIED, f"{stage.result.stage.value}: {stage.objection}")
        hearsay = [] if trust is not None else list(UNVERIFIABLE) + ["versions"] * other_versions
        answer.fields.update(verified=not answer.error, stages=[stage.as_object() for stage in stages])
        answer.fields.update(unverified=hearsay, signed_by=signed_by or None)
        for stage in stages:
            answer.texts.append(f"{stage.result.stage.value}: {stage.finding}")
            if stage.certificate is not None:
                answer.texts.append(rendered(certificate_table(stage.certificate)))
        if signed_by:
            answer.texts.append(f"signed by {signed_by}")
        elif hearsay:
            answer.texts.append(f"unverified, for they cannot be measured again: {', '.join(hearsay)}")
        if signer is not None and not answer.error:
            run.signing(signer).save(run_file)
            answer.texts.append(f"signed now by {signer.fingerprint}")
