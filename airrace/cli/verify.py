"""The command `airrace verify`: it measures again what a checkpoint claims."""

from airrace.cli.answer import answering
from airrace.cli.options import AsJson, RunFile


def verify(run_file: RunFile, as_json: AsJson = False) -> None:
    """Certify a run again.

    Every certificate is computed from the file alone and compared with the stored one. A run is verified if the stage
    that it ends with is certified, and all others hold in what they claim.
    """
    with answering({"track": None, "verified": False, "stages": []}, as_json=as_json) as answer:
        from airrace.cli.tables import certificate_table, rendered
        from airrace.runs.exit_codes import ExitCode
        from airrace.runs.stored import opened_run
        from airrace.runs.verification import verified

        run = opened_run(run_file)
        answer.fields["track"] = run.name
        stages = verified(run)
        for stage in stages:
            if stage.objection:
                answer.fail(ExitCode.NOT_CERTIFIED, f"{stage.result.stage.value}: {stage.objection}")
        answer.fields.update(verified=not answer.error, stages=[stage.as_object() for stage in stages])
        for stage in stages:
            answer.texts.append(f"{stage.result.stage.value}: {stage.finding}")
            answer.texts.append(rendered(certificate_table(stage.again)))
