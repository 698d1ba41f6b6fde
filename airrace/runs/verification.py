"""Comparing stored certificates with certificates measured again."""

from dataclasses import dataclass

from airrace.checkpoint import inputs_hash, stale_stages
from airrace.optimal_control.certificate import Certificate
from airrace.procedure import run as procedure
from airrace.procedure.result import Outcome, StageResult
from airrace.runs.answer import Answer
from airrace.runs.exit_codes import ExitCode
from airrace.runs.run import Run
from airrace.runs.run_object import certificate_object


@dataclass(frozen=True)
class Verification:
    """One stage: as stored, its certificate measured again, and what speaks against it (empty if nothing)."""

    result: StageResult
    again: Certificate
    objection: str

    def as_object(self) -> dict[str, object]:
        stored = self.result.certificate
        return {
            "stage": self.result.stage.value,
            "verified": not self.objection,
            "objection": self.objection,
            "certificate": certificate_object(self.again),
            "stored": None if stored is None else certificate_object(stored),
        }


def verified_stages(answer: Answer, run: Run) -> list[Verification]:
    """Measure every stage that carries a certificate; fail the answer if one is stale or does not hold."""
    stale = dict(stale_stages(run.checkpoint, inputs_hash(run.checkpoint.inputs.resolved)))
    verifications: list[Verification] = []
    claimed = [stored.result for stored in run.checkpoint.stages if stored.result.certificate is not None]
    for result, again in procedure.recertified(run.inputs.race, run.inputs.settings, claimed):
        assert result.certificate is not None  # claimed
        objection = stale.get(result.stage, "") or objection_to(result, result.certificate, again)
        verifications.append(Verification(result, again, objection))
        if objection:
            answer.fail(ExitCode.NOT_CERTIFIED, f"{result.stage.value}: {objection}")
    if not verifications:
        ended = [
            f"; {stored.result.stage.value} ended {stored.result.outcome.value}"
            for stored in run.checkpoint.stages
            if stored.result.outcome is not Outcome.SOLVED
        ]
        answer.fail(ExitCode.NOT_CERTIFIED, f"there is no certificate in this run{''.join(ended)}")
    return verifications


def objection_to(result: StageResult, stored: Certificate, again: Certificate) -> str:
    """A clause that says why a stage is not verified; empty if it is."""
    if result.outcome is not Outcome.SOLVED:
        return f"it ended {result.outcome.value}"
    if not again.certified:
        failed = ", ".join(
            f"{item.name} {item.value:.3g} > {item.limit:.3g} {item.unit}".rstrip() for item in again.failed
        )
        return f"it does not hold: {failed or 'nothing was measured'}"
    unmeasured = {item.name for item in stored.items} ^ {item.name for item in again.items}
    if unmeasured:
        return f"the stored certificate has other items: {', '.join(sorted(unmeasured))}"
    if not stored.certified:
        return "it was stored as not certified"
    return ""
