"""The comparison of stored certificates with certificates measured again."""

from dataclasses import dataclass

from airrace.errors import NotCertified
from airrace.optimal_control.certificate import Certificate
from airrace.procedure import run as procedure
from airrace.procedure.result import Outcome, StageResult
from airrace.runs.run import Run
from airrace.runs.run_object import certificate_object


@dataclass(frozen=True)
class Verification:
    """A stage as stored, its certificate measured again, and what speaks against it (empty if nothing)."""

    result: StageResult
    again: Certificate
    objection: str

    @property
    def verified(self) -> bool:
        """Whether nothing speaks against the stage."""
        return not self.objection

    def as_object(self) -> dict[str, object]:
        stored = self.result.certificate
        return {
            "stage": self.result.stage.value,
            "verified": not self.objection,
            "objection": self.objection,
            "certificate": certificate_object(self.again),
            "stored": None if stored is None else certificate_object(stored),
        }


def verified(run: Run) -> tuple[Verification, ...]:
    """Measure every stage that carries a certificate.

    Returns:
        One verification each, in order; with an objection where the stage is stale or does not hold.

    Raises:
        NotCertified: there is no certificate in this run.
        CheckpointError: the stored multipliers do not belong to a flight of this race.
        SolverCrash: the solver process died.
    """
    stale = run.stale
    claimed = [result for result in run.results if result.certificate is not None]
    if not claimed:
        unsolved = [one for one in run.results if one.outcome is not Outcome.SOLVED]
        ended = [f"; {result.stage.value} ended {result.outcome.value}" for result in unsolved]
        raise NotCertified(f"there is no certificate in this run{''.join(ended)}")
    verifications: list[Verification] = []
    for result, again in procedure.recertified(run.inputs.race, run.inputs.settings, claimed):
        assert result.certificate is not None  # so `claimed` was chosen
        objection = stale.get(result.stage, "") or objection_to(result, result.certificate, again)
        verifications.append(Verification(result, again, objection))
    return tuple(verifications)


def objection_to(result: StageResult, stored: Certificate, again: Certificate) -> str:
    """Return a clause that says why a stage is not verified; empty if it is."""
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
