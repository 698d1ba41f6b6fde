"""The verification of a run: all that its file tells, measured again or held against what was measured."""

from collections.abc import Iterator, Sequence

from airrace.errors import NotCertified
from airrace.optimal_control.certificate import Certificate
from airrace.procedure import run as procedure
from airrace.procedure.result import Outcome, StageResult
from airrace.records import record
from airrace.runs.discrepancies import discrepancies, in_one_sentence
from airrace.runs.provenance_checks import contradictions, missing_stages, other_versions
from airrace.runs.run import Run
from airrace.runs.run_object import certificate_object
from airrace.runs.stored_inputs import made_with

ONE_MESH = "solved on one mesh, its race time not confirmed on a second one"
GUESS = "a guess, of which nothing but its gate splits can be verified"


@record
class Verification:
    """A stage as stored, as it was measured again, and what speaks against it (empty if nothing).

    A stage without an objection holds in all that it claims; `result.certified` tells whether that is everything.

    Attributes:
        result: as stored.
        again: what follows from its histories and multipliers; None where it found no flight.
        objection: one clause or several.
    """

    result: StageResult
    again: StageResult | None
    objection: str

    @property
    def verified(self) -> bool:
        """Whether nothing speaks against the stage."""
        return not self.objection

    @property
    def certificate(self) -> Certificate | None:
        """The certificate as it was measured; None for a guess, and where no flight was found."""
        return None if self.again is None else self.again.certificate

    @property
    def finding(self) -> str:
        """The outcome for the stage: what speaks against it, or what was verified."""
        if self.objection:
            return self.objection
        if self.certificate is None:
            return f"verified as {GUESS}"
        return "verified" if self.result.certified else f"verified as {ONE_MESH}"

    def as_object(self) -> dict[str, object]:
        stored, again = self.result.certificate, self.certificate
        return {
            "stage": self.result.stage.value,
            "state": self.result.state.value,
            "verified": not self.objection,
            "objection": self.objection,
            "certificate": None if again is None else certificate_object(again),
            "stored": None if stored is None else certificate_object(stored),
        }


def verified(run: Run, *, versions: bool = True) -> tuple[Verification, ...]:
    """Measure every stage again, and hold what is stored against that.

    Args:
        run: as it was read.
        versions: whether the versions that the file names have to be those that verify it, without which they cannot
            be confirmed.

    Returns:
        One verification each, in order; with an objection where the stage is stale, does not hold or is stored
        otherwise than it was measured. What a stage claims is measured, and the one that the run ends with has to
        claim all of it.

    Raises:
        NotCertified: there is no certificate in this run.
        CheckpointError: the stored histories or multipliers do not belong to a flight of this race.
        SolverCrash: the solver process died.
    """
    results = run.results
    if all(result.certificate is None for result in results):
        unsolved = [one for one in results if one.outcome is not Outcome.SOLVED]
        ended = [f"; {result.stage.value} ended {result.outcome.value}" for result in unsolved]
        raise NotCertified(f"there is no certificate in this run{''.join(ended)}")
    general = list(_of_the_run(run, versions=versions))
    measured = procedure.remeasured(run.inputs.race, run.inputs.settings, results)
    return tuple(_verification(run, result, again, general) for result, again in measured)


def _of_the_run(run: Run, *, versions: bool) -> Iterator[str]:
    """Yield what speaks against the whole of a run, which its last stage has to answer for."""
    if missing := missing_stages(run.inputs.settings, run.results):
        yield missing
    if versions and (other := other_versions(run.checkpoint.versions, made_with())):
        yield f"{other}, which cannot be confirmed"


def _verification(run: Run, result: StageResult, again: StageResult, general: Sequence[str]) -> Verification:
    measured = again if result.is_flight else None
    objection = run.stale.get(result.stage, "") or in_one_sentence(_objections(result, measured))
    if result is run.results[-1]:
        objection = in_one_sentence([one for one in (objection or _unfinished(result), *general) if one])
    return Verification(result, measured, objection)


def _unfinished(result: StageResult) -> str:
    """Return a clause that says that a run ends with a stage which is not certified; empty if it is."""
    if result.certified:
        return ""
    return f"the run ends with it, and it is only {ONE_MESH if result.holds else GUESS}"


def _objections(result: StageResult, again: StageResult | None) -> list[str]:
    """Return clauses that say why a stage is not verified; nothing if it is."""
    if again is None or result.outcome is not Outcome.SOLVED:
        return [f"it ended {result.outcome.value}"]
    return [*_failures(result, again), *discrepancies(result, again), *contradictions(result)]


def _failures(result: StageResult, again: StageResult) -> Iterator[str]:
    """Yield a clause where a certificate that was measured again, or that of an alternative, does not hold."""
    for one in (again, *again.alternatives):
        if one.certificate is not None and not one.certificate.holds:
            items = one.certificate.failed
            failed = ", ".join(
                f"{item.name} {item.value:.3g} > {item.limit:.3g} {item.unit}".rstrip() for item in items
            )
            yield f"{'it' if one is again else 'an alternative'} does not hold: {failed or 'nothing was measured'}"
    if result.certificate is not None and not result.certificate.holds:
        yield "it was stored as not certified"
