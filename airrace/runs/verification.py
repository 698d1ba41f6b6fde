"""The verification of a run or an imported log: all that its file tells, measured again or held against measurements.

Timings, solver attempts, messages and the log of the search cannot be measured again: they are only checked for
consistency. A flight log is taken as it is, since it cannot be recorded again; its passings, histories and violations
are made of it once more.
"""

import contextlib
import itertools
import math
import re
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from datetime import datetime
from typing import TYPE_CHECKING

import numpy as np

from airrace.errors import CheckpointError, InputError, NotCertified, SolverCrash
from airrace.flights.logs.recording import Recording
from airrace.flights.logs.violations import Violation
from airrace.flights.results import Verification
from airrace.optimal_control.certificate import RACE_TIME_CHANGE, Certificate, Curvature, Item, SecondOrder
from airrace.optimal_control.quantities import Quantity
from airrace.optimal_control.trajectory import Array
from airrace.procedure import procedure
from airrace.procedure.choice import is_same_flight
from airrace.procedure.fidelity import fidelity_of
from airrace.procedure.result import HARDLY_SLOWER, GateSplit, Note, NoteKind, SearchReport, StageResult, Status
from airrace.procedure.schedule import stages_of_run
from airrace.procedure.settings import Settings
from airrace.procedure.stage import STAGES, Stage
from airrace.runs.json_objects import certificate_object
from airrace.runs.log_view import LogView
from airrace.runs.run_state import RunState
from airrace.runs.stored_inputs import current_versions, library_versions

if TYPE_CHECKING:
    from airrace.flights.logs.log_flight import LogFlight


ROUNDING = 1e-6
"""The largest difference between two evaluations of one formula, as a fraction of the value, or of 1 where that is
less. Meshes are stored as times, so the fractions of their phases come back rounded; measured: 3e-8.
"""
INTEGRATION = 1e-3
"""The largest difference between two measurements of one flight, as a fraction of the value. An integrator may
choose another step on another computer; on one computer the largest difference was 3e-8.
"""
NEGLIGIBLE = 1e-6
"""The share of an item's limit below which a value is nothing but rounding."""
SOLUTION = 0.02
"""The share of its limit for the race time on a coarser mesh, which is solved for anew."""
COUNTING = 1e-2
"""The largest difference between two numbers of active limits, as a fraction of these, and one of two curvatures, as
a fraction of the one that counts as zero.
"""
BORDERLINE = 0.2
"""The distance from a curvature at which kinds differ, as a fraction of it, within which nothing is decided."""
CLAUSES_MAX = 4
"""The number of discrepancies that a sentence tells one by one."""
SUM_ROUNDING = 1e-9
"""The largest difference between two sums of the same numbers, as a fraction."""


def discrepancies(stored: StageResult, again: StageResult) -> list[str]:
    """Return a clause for everything that is stored otherwise than it was measured; nothing where all agrees.

    Args:
        stored: the stage as it was read.
        again: what follows from its histories and multipliers, see `airrace.procedure.recomputation`.
    """
    clauses = [*_flight(stored, again), *_splits(stored.splits, again.splits), *_numbers(stored, again)]
    if stored.certificate is not None and again.certificate is not None:
        clauses += _certificate(stored.certificate, again.certificate)
    elif stored.certificate is not again.certificate:
        clauses.append("it has no certificate" if stored.certificate is None else "a guess has a certificate")
    pairs = zip(stored.alternatives, again.alternatives, strict=True)
    for number, (alternative, measured) in enumerate(pairs, start=1):
        clauses += [f"alternative {number}: {clause}" for clause in discrepancies(alternative, measured)]
    return clauses


def in_one_sentence(clauses: Sequence[str]) -> str:
    """Return clauses as one; of many only the first are listed."""
    first, more = "; ".join(clauses[:CLAUSES_MAX]), len(clauses) - CLAUSES_MAX
    return f"{first}; and {more} more" if more > 0 else first


def _flight(stored: StageResult, again: StageResult) -> Iterator[str]:
    trajectory, measured = stored.trajectory, again.trajectory
    yield from _declarations("state", trajectory.states, measured.states)
    yield from _declarations("control", trajectory.controls, measured.controls)
    for name, course_name in zip(trajectory.phases, measured.phases, strict=True):
        if name != course_name:
            yield f"a leg is called {name!r}, and the course calls it {course_name!r}"
    yield from _series("time", trajectory.time, measured.time, ROUNDING * 1e-3 * measured.race_time)


def _declarations(kind: str, stored: Sequence[Quantity], model: Sequence[Quantity]) -> Iterator[str]:
    names = [field.name for field in fields(Quantity)]
    for quantity, declaration in zip(stored, model, strict=True):
        differing = [name for name in names if getattr(quantity, name) != getattr(declaration, name)]
        if differing:
            yield f"the {kind} {quantity.name} is declared with another {', '.join(differing)}"


def _splits(stored: Sequence[GateSplit], again: Sequence[GateSplit]) -> Iterator[str]:
    if len(stored) != len(again):
        yield f"{len(stored)} gate splits are stored of {len(again)}"
        return
    names = [field.name for field in fields(GateSplit) if field.name != "name"]
    for split, measured in zip(stored, again, strict=True):
        if split.name != measured.name:
            yield f"a gate split is called {split.name!r} instead of {measured.name!r}"
        for name in names:
            value, expected = getattr(split, name), getattr(measured, name)
            difference = value - expected
            if name in ("bank", "heading") and math.isfinite(difference):
                difference = math.remainder(difference, 2.0 * math.pi)
            if not abs(difference) <= ROUNDING * max(1.0, abs(expected)):
                yield _two(f"gate split {measured.name}, {name}", value, expected)


def _numbers(stored: StageResult, again: StageResult) -> Iterator[str]:
    cost, measured = stored.provenance.regularisation, again.provenance.regularisation
    if not abs(cost - measured) <= ROUNDING:
        yield _two("regularisation", cost, measured)
    multipliers = again.bound_multipliers
    largest = float(np.abs(multipliers).max(initial=1.0))
    yield from _series("simple bounds, multiplier", stored.bound_multipliers, multipliers, ROUNDING * largest)
    for name in ("defect", "drift"):
        values = getattr(again.mesh, name)
        largest = float(np.abs(values).max(initial=0.0))
        yield from _series(f"mesh, {name}", getattr(stored.mesh, name), values, INTEGRATION * largest)


def _series(what: str, stored: Array, again: Array, tolerance: float) -> Iterator[str]:
    """Yield a clause where two series of numbers are further apart than a tolerance at any place."""
    if stored.shape != again.shape:
        yield f"{what}: {stored.size} numbers are stored of {again.size}"
        return
    difference = np.abs(stored - again)
    if stored.size and not (difference <= tolerance).all():
        worst = int(np.nan_to_num(difference, nan=np.inf).argmax())
        yield _two(f"{what} {worst + 1}", float(stored[worst]), float(again[worst]))


def _certificate(stored: Certificate, again: Certificate) -> Iterator[str]:
    names, measured = [item.name for item in stored.items], [item.name for item in again.items]
    if names != measured:
        others = sorted(set(names) ^ set(measured))
        yield f"the stored certificate has other items{': ' if others else ', in another order'}{', '.join(others)}"
        return
    for stored_item, item in zip(stored.items, again.items, strict=True):
        yield from _item(stored_item, item)
    if stored.second_order is not None and again.second_order is not None:
        yield from _second_order(stored.second_order, again.second_order)
    elif stored.second_order is not again.second_order:
        yield "the curvature is stored, and could not be measured" if stored.second_order else "no curvature is stored"


def _item(stored: Item, again: Item) -> Iterator[str]:
    share = SOLUTION if again.name == RACE_TIME_CHANGE else NEGLIGIBLE
    negligible = share * (again.limit if math.isfinite(again.limit) else 1.0)
    if not abs(stored.value - again.value) <= negligible + INTEGRATION * abs(again.value):
        yield _two(f"certificate, {again.name}", stored.value, again.value)
    if not math.isclose(stored.limit, again.limit, rel_tol=ROUNDING):
        yield _two(f"certificate, limit of {again.name}", stored.limit, again.limit)
    elsewhere = stored.where != again.where and (again.value > negligible or again.limit == 0.0)
    if stored.unit != again.unit or elsewhere:
        words, measured = (f"{item.unit} {item.where}".strip() or "nothing" for item in (stored, again))
        yield f"certificate, unit and place of {again.name}: {words} is stored, {measured} was measured"


def _second_order(stored: SecondOrder, again: SecondOrder) -> Iterator[str]:
    """Yield what differs.

    Rounding decides between kinds, and between directions, where the least curvature is near to that of another kind,
    and of some limits whether multiplier or slack is larger.
    """
    zero = again.threshold
    near = again.curvature is Curvature.POSITIVE and _is_near(stored.least, zero)
    for edge in (zero, again.saddle):
        near = near or (_is_near(again.least, edge) and not abs(stored.least) > (1.0 + BORDERLINE) * edge)
    words, measured = ((judged.curvature.value, judged.where) for judged in (stored, again))
    saddle = Curvature.INDEFINITE in (stored.curvature, again.curvature)
    if words != measured and (saddle or not near):
        yield f"curvature: {' '.join(words).strip()} is stored, {' '.join(measured).strip()} was measured"
    if not math.isclose(stored.threshold, zero, rel_tol=ROUNDING):
        yield _two("curvature that counts as zero", stored.threshold, zero)
    same = abs(stored.least - again.least) <= COUNTING * zero + INTEGRATION * abs(again.least)
    if not (near or same or (math.isnan(stored.least) and math.isnan(again.least))):
        yield _two("least curvature", stored.least, again.least)
    for name in ("active", "weakly_active"):
        number, expected = getattr(stored, name), getattr(again, name)
        if not abs(number - expected) <= COUNTING * max(again.active, 1.0 / COUNTING):
            yield _two(f"number of limits, {name}", number, expected)


def _is_near(curvature: float, edge: float) -> bool:
    return abs(abs(curvature) - edge) < BORDERLINE * edge


def _two(name: str, stored: float, measured: float) -> str:
    return f"{name}: {stored:.6g} is stored, {measured:.6g} was measured"


def missing_stages(settings: Settings, results: Sequence[StageResult]) -> str:
    """Return a clause that names the stages below the last one that are not stored; empty where none is missing.

    A run that was started from another one has none below its first.
    """
    if not results:
        return ""
    stored, first = [result.stage for result in results], results[0]
    expected = stages_of_run(settings, results[-1].stage)
    if first.provenance.source_run:
        expected = expected[expected.index(first.stage) :] if first.stage in expected else expected
    missing = ", ".join(stage.value for stage in expected if stage not in stored)
    return f"what it was started from is missing: {missing}" if missing else ""


def other_versions(stored: Mapping[str, str], running: Mapping[str, str]) -> str:
    """Return a clause on versions that cannot be confirmed, since others are running; empty where all agree."""
    differ = [
        f"{name} {stored.get(name, 'unknown')} (here {running.get(name, 'unknown')})"
        for name in dict.fromkeys((*running, *stored))
        if stored.get(name) != running.get(name)
    ]
    return f"it is said to be made with {', '.join(differ)}" if differ else ""


def inconsistencies(result: StageResult) -> Iterator[str]:
    """Yield a clause for every record of the making of a stage that contradicts another one, or that airrace never
    writes.
    """
    yield from _start(result)
    yield from _message(result)
    yield from _seconds(result)
    yield from _routes(result.search)
    fastest = result.trajectory.race_time - HARDLY_SLOWER  # else it is the simpler flight that was chosen
    for alternative in result.alternatives:
        if not alternative.holds or alternative.trajectory.race_time < fastest:
            yield f"an alternative does not hold, or is faster by more than {1e3 * HARDLY_SLOWER:.0f} ms"
    for first, second in itertools.combinations((result, *result.alternatives), 2):
        if is_same_flight(first.trajectory, second.trajectory):
            yield "an alternative is the flight itself, or another alternative"


def _start(result: StageResult) -> Iterator[str]:
    provenance, stage = result.provenance, result.stage
    led = fidelity_of(stage).inner_controller is not None
    below = {Stage.POINT_MASS.value, STAGES[STAGES.index(stage) - 1].value} if led else {""}
    names = [name.value for name in STAGES]
    source = provenance.source_stage
    above = source not in names or names.index(source) > names.index(stage.value)
    if above if provenance.source_run else source not in below:
        yield f"no {stage.value} is started from {provenance.source!r}"
    numbers = (provenance.tracking_error, provenance.tracking_error_time, provenance.terminal_miss)
    if not all(math.isfinite(number) and number >= 0.0 for number in numbers) or (not led and any(numbers)):
        yield "the tracking error of the start is not possible"


_COUNTS = r"(?:no|\d+) circles?, (?:no|\d+) push(?:es)?, (?:no|\d+) rolls? through inverted flight"
_SIMPLER = re.compile(
    rf"a route that saves (\d+\.\d) ms was left for a simpler one: {_COUNTS}, instead of {_COUNTS}", re.ASCII
)


def _is_written(note: Note, result: StageResult) -> bool:
    """Return whether airrace could have written a note; what a start or a solver said is free text."""
    match note.kind:
        case NoteKind.PLANNED_PHASES:
            begin, colon, phases = note.text.partition(": ")
            return (
                begin == "left as planned" and bool(colon) and set(phases.split(", ")) <= set(result.trajectory.phases)
            )
        case NoteKind.SIMPLER_ROUTE:
            form = _SIMPLER.fullmatch(note.text)
            return form is not None and float(form[1]) <= 1e3 * HARDLY_SLOWER
        case NoteKind.MESH_CHECK:
            return note.text.startswith("its race time could not be confirmed on a second mesh: ")
        case NoteKind.START:
            return ": " in note.text


def _message(result: StageResult) -> Iterator[str]:
    guess = fidelity_of(result.stage).is_guess
    if result.is_flight and result.suggested_changes:
        yield "a stage with a flight has no conflicts of limits"
    possible = {
        NoteKind.START: True,
        NoteKind.PLANNED_PHASES: guess,
        NoteKind.SIMPLER_ROUTE: result.is_flight and not guess,
        NoteKind.MESH_CHECK: result.holds and not result.certified,
    }
    strange = [note.text for note in result.notes if not (possible[note.kind] and _is_written(note, result))]
    if result.message and (result.holds or guess):
        strange.append(result.message)
    for text in strange:
        yield f"airrace says nothing like {text!r} of such a stage"


def _seconds(result: StageResult) -> Iterator[str]:
    timings, attempts = result.timings, result.attempts
    spent = sum(attempt.seconds for attempt in attempts)
    numbers = (timings.solve, timings.derivatives, timings.wall, *(attempt.seconds for attempt in attempts))
    if not all(math.isfinite(number) and number >= 0.0 for number in numbers):
        yield "its timings are not possible"
    elif abs(timings.solve - spent) > SUM_ROUNDING * max(1.0, spent):
        yield f"solving took {timings.solve:.6g} s, and its attempts {spent:.6g} s"
    if any(attempt.iterations < 0 for attempt in attempts) or not attempts:
        yield "its attempts are not possible"


def _routes(search: SearchReport) -> Iterator[str]:
    counts = (search.converged_to_best, search.converged_elsewhere, search.failed, search.seconds)
    if not all(math.isfinite(count) and count >= 0 for count in counts):
        yield "the record of the search is not possible"
    if not search.routes:
        return
    best = search.routes[0].race_time
    differences = [route.race_time - route.difference - best for route in search.routes]
    if not all(abs(difference) <= SUM_ROUNDING * max(1.0, best) for difference in differences):
        yield "the routes that were tried differ from the best by other times than are stored"
    later = [route.difference for route in search.routes[1:]]
    if any(after < before for before, after in itertools.pairwise(later)):
        yield "the routes that were tried are out of order"


ONE_MESH = "solved on one mesh, its race time not confirmed on a second one"
ROUGH = "solved on one mesh, as closely as the next stage needs"
GUESS = "a guess, of which nothing but its gate splits can be verified"


@dataclass(frozen=True)
class StageVerification:
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
    def outcome(self) -> Verification:
        """The outcome for the stage: what speaks against it, or what was verified."""
        if self.objection:
            return Verification(False, self.objection)
        return Verification(True, "" if self.result.certified else _claim(self.result))

    @property
    def finding(self) -> str:
        """The outcome in words."""
        return self.objection or self.outcome.words

    def as_object(self) -> dict[str, object]:
        stored, again = self.result.certificate, self.certificate
        return {
            "stage": self.result.stage.value,
            "status": self.result.status.value,
            "verified": not self.objection,
            "objection": self.objection,
            "certificate": None if again is None else certificate_object(again),
            "stored": None if stored is None else certificate_object(stored),
        }


def verify_run(run: RunState, *, versions: bool = True) -> tuple[StageVerification, ...]:
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
        unsolved = [result for result in results if result.outcome is not Status.SOLVED]
        ended = [f"; {result.stage.value} ended {result.outcome.value}" for result in unsolved]
        raise NotCertified(f"there is no certificate in this run{''.join(ended)}")
    of_run = [missing_stages(run.inputs.settings, results)]
    if versions and (other := other_versions(run.checkpoint.versions, current_versions())):
        of_run.append(f"{other}, which cannot be confirmed")
    verifications: list[StageVerification] = []
    for result, again in procedure.recompute(run.inputs.race, run.inputs.settings, results):
        objection = run.stale.get(result.stage, "") or _objection(result, again)
        if result is results[-1]:  # which answers for the whole run
            if not objection and not result.certified:
                objection = f"the run ends with it, and it is only {_claim(result)}"
            objection = in_one_sentence([clause for clause in (objection, *of_run) if clause])
        verifications.append(StageVerification(result, again if result.is_flight else None, objection))
    return tuple(verifications)


def with_verifications(run: RunState, shown: Container[Stage], *, verify: bool) -> RunState:
    """Return a run with the verifications of the stages that are shown; a refuted one is not certified.

    A stage that claims nothing, no longer stands, or is of other versions, is not measured.

    Args:
        run: as it was read.
        shown: these stages; the last of them answers for those that are missing below it.
        verify: whether they are measured at all; else they are called not verified.
    """
    results = [result for result in run.results if result.stage in shown]
    other = other_versions(run.checkpoint.versions, current_versions()) if verify else ""
    if other or not verify:
        return replace(run, verifications={result.stage: Verification(None, other) for result in results})
    stale, settings = run.stale, run.inputs.settings
    outcomes: dict[Stage, Verification] = {}
    rest: list[StageResult] = []
    for result in results:
        if reason := _no_claim(result, stale):
            outcomes[result.stage] = Verification(None, reason)
        else:
            rest.append(result)
    while rest:
        try:
            for result, again in procedure.recompute(run.inputs.race, settings, rest):
                below = itertools.takewhile(lambda stage, last=result: stage.stage is not last.stage, run.results)
                missing = missing_stages(settings, [*below, result]) if result is results[-1] else ""
                objection = "; ".join(filter(None, (_objection(result, again), missing)))
                outcomes[result.stage] = StageVerification(result, again, objection).outcome
                rest = rest[1:]
        except CheckpointError as error:
            outcomes[rest.pop(0).stage] = Verification(False, str(error))
        except SolverCrash as error:
            outcomes[rest.pop(0).stage] = Verification(None, str(error))
    return replace(run, verifications=outcomes)


def _no_claim(result: StageResult, stale: Mapping[Stage, str]) -> str:
    """Return why there is nothing to be verified of a stage, a clause; empty where there is."""
    if result.stage in stale:
        return f"it no longer stands: {stale[result.stage]}"
    claims = result.status in (Status.CERTIFIED, Status.SOLVED, Status.GUESS)
    return "" if claims else f"it is {result.status.value}"


def _claim(result: StageResult) -> str:
    """Return what a stage is that is not certified and not said to be so, a clause."""
    return ROUGH if result.is_rough else ONE_MESH if result.holds else GUESS


def _objection(result: StageResult, again: StageResult) -> str:
    """Return why a stage is not verified, in one sentence; empty if it is."""
    if not result.is_flight or result.outcome is not Status.SOLVED:
        return f"it ended {result.outcome.value}"
    return in_one_sentence([*_failures(result, again), *discrepancies(result, again), *inconsistencies(result)])


def _failures(result: StageResult, again: StageResult) -> Iterator[str]:
    """Yield a clause where a certificate that was measured again, or that of an alternative, does not hold."""
    for measured in (again, *again.alternatives):
        if measured.certificate is not None and not measured.certificate.holds:
            items = measured.certificate.failed
            failed = ", ".join(
                f"{item.name} {item.value:.3g} > {item.limit:.3g} {item.unit}".rstrip() for item in items
            )
            yield f"{'it' if measured is again else 'an alternative'} does not hold: {failed or 'nothing was measured'}"
    if result.certificate is not None and not result.certificate.holds:
        yield "it was stored as not certified"


def with_verification(view: LogView, *, verify: bool) -> LogView:
    """Return a log with its verification; it is called not verified unless it is to be verified."""
    if not verify:
        return replace(view, verification=Verification(None))
    if not other_versions(view.recorded.versions, library_versions()):
        with contextlib.suppress(CheckpointError, InputError):  # which are the outcome of its verification
            view = replace(view, remade=flight_again(view))  # once: logs are judged together by it, too
    return replace(view, verification=verify_log(view))


def verify_log(view: LogView, *, versions: bool = True) -> Verification:
    """Make the flight of the stored log once more, and hold what is stored against it.

    Args:
        view: as it was read.
        versions: whether a flight that other versions have made is left alone.
    """
    if versions and (other := other_versions(view.recorded.versions, library_versions())):
        return Verification(None, other)
    try:
        clauses = list(_log_discrepancies(view, flight_again(view)))
    except (CheckpointError, InputError) as error:
        clauses = [str(error)]
    return Verification(False, in_one_sentence(clauses)) if clauses else Verification(True)


def flight_again(view: LogView) -> "LogFlight":
    """Return the flight that follows from the stored log.

    Raises:
        CheckpointError: the stored log lacks positions.
        InputError: no flight follows from it.
    """
    if view.remade is not None:
        return view.remade
    from airrace.flights.logs.log_flight import flight_of_part  # takes what smooths, which runs do not need

    log = view.recorded.log
    if missing := [name for name in ("x", "y", "height") if name not in log.columns]:
        raise CheckpointError(f"the stored log has no column {missing[0]!r}")
    begins = datetime.fromisoformat(log.begins) if log.begins else None
    receiver = log.receiver
    part = Recording(
        log.path,
        log.format,
        log.time,
        log.columns,
        log.lines,
        begins,
        barometric=receiver.barometric,
        accuracy=None if math.isnan(receiver.accuracy) else receiver.accuracy,
    )
    noise = None if math.isnan(receiver.noise) else receiver.noise
    inputs = view.inputs
    return flight_of_part(part, inputs.race, label=view.recorded.label, penalties=inputs.penalties, noise=noise)


def _log_discrepancies(view: LogView, again: "LogFlight") -> Iterator[str]:
    """Yield a clause for everything that is stored otherwise than it follows from the log."""
    stored, flight = view.recorded, again.flight
    for passing, crossing in zip(stored.passings, flight.crossings, strict=False):
        if not _same(passing.time, crossing.time):
            times = f"after {passing.time:.3f} s by the file, after {crossing.time:.3f} s by its log"
            yield f"{passing.passing} is passed {times}"
    if [passing.passing for passing in stored.passings] != [crossing.name for crossing in flight.crossings]:
        yield "its passings are not those of its course"
    if not _same(stored.log.offset, again.offset) or not _same(stored.time, flight.time):
        yield "its clock is not that of its log"
    histories = {history.quantity.name: history for history in stored.histories}
    if set(histories) != set(flight.histories):
        yield "it has other histories than follow from its log"
    for name in histories.keys() & flight.histories.keys():
        history, made = histories[name], flight.histories[name]
        same_kind = history.basis == made.basis.value and history.quantity == made.quantity
        if not same_kind or not _same(history.values, made.values):
            yield f"{name} does not follow from its log"
    if len(stored.violations) != len(again.violations):
        yield f"{len(stored.violations)} violations are stored, {len(again.violations)} follow from its log"
    for violation, judged in zip(stored.violations, again.violations, strict=False):
        same_rule = (violation.passing, violation.rule) == (judged.passing, judged.rule)
        if not same_rule or not _same(_violation_numbers(violation), _violation_numbers(judged)):
            yield f"the violation {violation.rule} at {violation.passing or 'no passing'} does not follow from its log"


def _violation_numbers(violation: Violation) -> Array:
    return np.array([violation.time, violation.value, violation.limit, violation.deviation, violation.penalty])


def _same(stored: Array | float, again: Array | float) -> bool:
    values, expected = np.asarray(stored), np.asarray(again)
    if values.shape != expected.shape:
        return False
    return np.allclose(values, expected, rtol=ROUNDING, atol=ROUNDING, equal_nan=True)
