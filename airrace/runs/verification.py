"""The comparison of stored certificates with certificates measured again."""

from dataclasses import dataclass

from airrace.errors import NotCertified
from airrace.optimal_control.certificate import Certificate
from airrace.procedure import run as procedure
from airrace.procedure.result import Outcome, StageResult
from airrace.runs.run import Run
from airrace.runs.run_object import certificate_object

ONE_MESH = "solved on one mesh, without a proof of its race time on a second one"


@dataclass(frozen=True)
class Verification:
    """A stage as stored, its certificate measured again, and what speaks against it (empty if nothing).

    A stage without an objection holds in all that it claims; `result.certified` tells whether that is everything.
    """

    result: StageResult
    again: Certificate
    objection: str

    @property
    def verified(self) -> bool:
        """Whether nothing speaks against the stage."""
        return not self.objection

    @property
    def finding(self) -> str:
        """The outcome for the stage: what speaks against it, or what was verified."""
        if self.objection:
            return self.objection
        return "verified" if self.result.certified else f"verified as {ONE_MESH}"

    def as_object(self) -> dict[str, object]:
        stored = self.result.certificate
        return {
            "stage": self.result.stage.value,
            "state": self.result.state.value,
            "verified": not self.objection,
            "objection": self.objection,
            "certificate": certificate_object(self.again),
            "stored": None if stored is None else certificate_object(stored),
        }


def verified(run: Run) -> tuple[Verification, ...]:
    """Measure every stage that carries a certificate.

    Returns:
        One verification each, in order; with an objection where the stage is stale or does not hold. What a stage
        claims is measured, and the one that the run ends with has to claim all of it.

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
        verifications.append(Verification(result, again, objection or _unfinished(run, result)))
    return tuple(verifications)


def _unfinished(run: Run, result: StageResult) -> str:
    """Return a clause that says that a run ends with a stage which is not certified; empty if it does not."""
    ends = result is run.results[-1] and not result.certified
    return f"the run ends with it, and it is only {ONE_MESH}" if ends else ""


def objection_to(result: StageResult, stored: Certificate, again: Certificate) -> str:
    """Return a clause that says why a stage is not verified; empty if it is."""
    if result.outcome is not Outcome.SOLVED:
        return f"it ended {result.outcome.value}"
    if not again.holds:
        failed = ", ".join(
            f"{item.name} {item.value:.3g} > {item.limit:.3g} {item.unit}".rstrip() for item in again.failed
        )
        return f"it does not hold: {failed or 'nothing was measured'}"
    unmeasured = {item.name for item in stored.items} ^ {item.name for item in again.items}
    if unmeasured:
        return f"the stored certificate has other items: {', '.join(sorted(unmeasured))}"
    if not stored.holds:
        return "it was stored as not certified"
    return ""
