"""The diagnosis of a race for which no flight was found: its conflicts, and changes that resolve them.

It runs once all starts of a stage have failed with all solvers. Every suggestion is solved on the whole race before it
is reported; a race that turns out to be feasible is solved.
"""

import dataclasses
import itertools
import math
from collections.abc import Callable, Sequence

from airrace.errors import InputError
from airrace.optimal_control.mesh_refinement import resample
from airrace.optimal_control.problem import Iterate
from airrace.procedure.fidelity import iterate_of
from airrace.procedure.guess import first_mesh, guess
from airrace.procedure.infeasibility.budget import limited_session, searching_conflicts
from airrace.procedure.infeasibility.conflicts import (
    KINDS,
    MARGINS,
    ConflictSearch,
    RelaxedRace,
    Repair,
    conflict_location,
)
from airrace.procedure.infeasibility.elastic import Relaxed
from airrace.procedure.infeasibility.local_infeasibility import diagnose_window
from airrace.procedure.mesh_loop import solve_certified
from airrace.procedure.result import StageResult, Status, SuggestedChange
from airrace.procedure.settings import SearchEffort
from airrace.procedure.solver_session import INTERVALS_MIN, Budget, SolverSession
from airrace.procedure.stage import Stage
from airrace.procedure.stage_problem import Mesh, StageProblem, coarse_mesh, formulate, mesh_of
from airrace.procedure.warm_start import InitialBarrier, Start
from airrace.race import Race

TRIAL_ITERATIONS_MAX = 150
"""The iterations of a trial's solve; the flights of trials that were certified took 4 to 105 on each mesh."""
TRIAL_WORK = 300
"""The work of a trial: so many iterations on its first mesh. Certifying every flight took minutes on courses in a
narrow corridor: 1646 intervals on the fourth mesh."""
CONFLICT_WORK_MAX = 4.0
"""The work of a conflict's trials, in that of one trial, after which none is repeated with a larger margin. Without a
certified flight the first one is repeated all the same."""
TIGHTENING_WORK = 2.0
"""The work after which a suggested change is tightened no more, in that of one trial."""


def diagnose_infeasibility(
    result: StageResult,
    race: Race,
    stage_problem: StageProblem,
    session: SolverSession,
    routes: RelaxedRace | None = None,
) -> StageResult:
    """Return an infeasible stage with its diagnosis; or the flight, if there is one after all.

    Args:
        result: of the stage, without a flight.
        race: the infeasible one.
        stage_problem: the race as it was planned, in the equations of the stage.
        session: solves.
        routes: the race with all limits relaxed; None if that was not solved before.
    """
    if result.is_flight or result.outcome is Status.TIMEOUT:
        return result
    routes = routes or RelaxedRace(race, stage_problem, session.settings.mesh)
    with limited_session(session, session.budget.reserve_for_diagnosis()) as limited:
        diagnosis = _diagnose(result, race, stage_problem, limited, routes)
    record = tuple(session.attempts), session.timings()
    if isinstance(diagnosis, StageResult):
        return dataclasses.replace(diagnosis, attempts=record[0], timings=record[1])
    message, changes = diagnosis
    result = dataclasses.replace(result, attempts=record[0], timings=record[1])
    if not message:
        return result
    message = f"no flight was found: {message}"
    return dataclasses.replace(result, outcome=Status.INFEASIBLE, message=message, suggested_changes=changes)


def _diagnose(
    result: StageResult, race: Race, stage_problem: StageProblem, session: SolverSession, routes: RelaxedRace
) -> StageResult | tuple[str, tuple[SuggestedChange, ...]]:
    """Return the flight, if there is one after all; else the conflicts in words, and the changes that resolve them.

    The text is empty without a conflict.
    """
    with searching_conflicts(session, routes.budget) as searching:
        trials = Trials(searching, race, stage_problem.stage)
        search = ConflictSearch(searching, race, lambda near: certify(session, race, near))
        conflicts = list(search.conflicts(routes.solve(session)))
        if search.flight is not None:
            return dataclasses.replace(search.flight, search=result.search)
        changes: list[SuggestedChange] = []
        for number, conflict in enumerate(conflicts, start=1):
            other_repairs = [other.repairs[0] for other in conflicts if other is not conflict and other.repairs]
            valid = validate(race, trials.fly, conflict.repairs, other_repairs)
            valid[:1] = [tighten(race, trials.fly, trial, other_repairs) for trial in valid[:1]]
            unresolved = SuggestedChange(number, conflict.where, "", "", "", 0.0, 0.0, 0.0)
            changes += [trial.suggested_change(number, conflict.where) for trial in valid] or [unresolved]
    message = describe_conflicts(changes)
    is_resolved = any(change.text for change in changes)
    if not is_resolved:
        problem, end = stage_problem.problem(mesh_of(result.trajectory)), iterate_of(result.trajectory)
        limit = diagnose_window(session, problem, end, end, "")
        message = None if limit is None else "; ".join(text for text in (message, limit) if text)
    elif session.settings.search is SearchEffort.OFF:
        message = f"{message}; other routes were not tried (--search quick tries them)"
    of_pilot = any(change.key.startswith("rules.pilot.") for change in changes) or not is_resolved
    # Where other limits contradict each other without the pilot's as well, the pilot's are not to blame.
    if message is not None and of_pilot and routes.without_pilot and not conflict_location(routes.without_pilot):
        message = f"{message}; or without the pilot's limits (rules.pilot=none), which was not tried"
    if message is not None and routes.budget.exhausted:
        message = f"{message}; more was not tried, for the budget of this search is spent"
    return message or "", tuple(changes)


def describe_conflicts(changes: Sequence[SuggestedChange]) -> str:
    """Return the conflicts and the changes that resolve them as a sentence without a full stop."""
    conflicts = [list(group) for _, group in itertools.groupby(changes, key=lambda change: change.conflict)]
    return "; and ".join(_describe_conflict(*group) for group in conflicts)


def _describe_conflict(first: SuggestedChange, *alternatives: SuggestedChange) -> str:
    if not first.text:
        return f"the limits contradict each other at {first.where}, and no single number was found that resolves it"

    def amount(value: float, change: SuggestedChange) -> str:
        return f"{value:g} {change.unit}".rstrip()

    def how_to_set(change: SuggestedChange) -> str:
        return f" ({change.key}={change.needed:g})" if change.key else ""

    verb = "flown" if " -> " in first.where else "passed"
    needed, failed, key = amount(first.needed, first), amount(first.failed, first), how_to_set(first)
    flight = f"with {needed} there is a flight{'' if first.certified else ' that is not certified'}{key}"
    if math.isinf(first.failed):
        least = f"{flight}; less was not tried"
    elif first.failed_flies:
        least = f"{flight}; the one with {failed} was not certified{'' if first.certified else ' either'}"
    elif first.certified:
        least = f"it takes {needed}{key}, for with {failed} none was found"
    else:
        least = f"{flight}; with {failed} none was found"
    repairs: list[str] = []
    for change in alternatives:
        instead = f"instead of {amount(change.given, change)}{how_to_set(change)}"
        repairs.append(f"{change.text} of {amount(change.needed, change)} {instead}")
    conflict = f"{first.where} cannot be {verb} with {first.text} of {amount(first.given, first)}: "
    return conflict + "; or ".join([least, *repairs])


@dataclasses.dataclass(frozen=True)
class TrialFlight:
    """The flight of a race with a repair.

    Attributes:
        race_time: s; None without a flight.
        certified: whether it is certified.
        work: share of the work of one trial that was spent (1).
        guess: the flight on a mesh, as a warm start; None without one.
        was_tried: whether the solve ran to its end; else the lack of a flight says nothing.
    """

    race_time: float | None
    certified: bool
    work: float
    guess: tuple[Mesh, Iterate] | None = None
    was_tried: bool = True


NOT_TRIED = TrialFlight(None, certified=False, work=0.0, was_tried=False)


def certify(session: SolverSession, race: Race, near: Relaxed) -> StageResult | None:
    """Return a certified flight of an unchanged race near a relaxed one, or None."""
    result = solve_certified(session, _start_near(race, near), session.settings.solver.primary)
    return result if isinstance(result, StageResult) and result.certified else None


@dataclasses.dataclass(frozen=True)
class Trials:
    """Trials of races with other numbers, from a relaxed flight, else from their own plans, or from an earlier trial.

    Each has its own budget within that of the session.
    """

    session: SolverSession
    race: Race
    stage: Stage

    def fly(self, race: Race, near: Relaxed, before: TrialFlight) -> TrialFlight:
        """Return the flight of a race.

        Args:
            race: with other numbers.
            near: the relaxed flight.
            before: a flight with almost the same numbers, the warm start if it has one.

        Raises:
            InputError: aircraft and rules leave no allowed value of some quantity.
        """
        if before.guess is not None:
            return self._fly(_start_on(race, near, *before.guess))
        first = self._fly(_start_near(race, near))
        if first.race_time is not None or not first.was_tried:
            return first
        stage_problem = formulate(self.stage, race, self.session.settings)
        mesh = first_mesh(stage_problem.plan, self.session.settings.mesh)
        planned = self._fly(
            Start(stage_problem, stage_problem.problem(mesh), guess(stage_problem.plan, mesh), InitialBarrier.COLD)
        )
        return dataclasses.replace(planned, work=first.work + planned.work)

    def _fly(self, start: Start) -> TrialFlight:
        settings, whole = self.session.settings, self.session.budget
        limit = min(settings.solver.iterations_max, TRIAL_ITERATIONS_MAX)
        settings = dataclasses.replace(settings, solver=dataclasses.replace(settings.solver, iterations_max=limit))
        trial_work, remaining = (
            TRIAL_WORK * float(max(start.problem.intervals, INTERVALS_MIN)),
            whole.work - whole.spent,
        )
        if remaining <= 0.0:
            return NOT_TRIED
        budget = Budget(min(trial_work, remaining), failed_only=False)
        with limited_session(self.session, budget, settings) as session:
            outcome = solve_certified(session, start, settings.solver.primary)
        whole.spent += budget.spent
        work = budget.spent / trial_work
        if isinstance(outcome, StageResult):
            return TrialFlight(outcome.trajectory.race_time, outcome.certified, work, coarse_mesh(outcome))
        if outcome.coarser is None:
            return TrialFlight(
                None, certified=False, work=work, was_tried=remaining >= trial_work or not budget.exhausted
            )
        optimum = outcome.coarser
        return TrialFlight(optimum.value, certified=False, work=work, guess=(optimum.problem.mesh, optimum.iterate))


def _start_near(race: Race, near: Relaxed) -> Start:
    stage_problem = near.solver.formulation(race)
    return Start(stage_problem, stage_problem.problem(near.solver.mesh), near.flight, InitialBarrier.PIECES)


def _start_on(race: Race, near: Relaxed, mesh: Mesh, iterate: Iterate) -> Start:
    """Return a start from a flight of almost the same race, on a mesh as fine as that of the relaxed one."""
    stage_problem = near.solver.formulation(race)
    coarse, iterate = resample(mesh, iterate, [len(phase) for phase in near.solver.mesh])
    return Start(stage_problem, stage_problem.problem(coarse), iterate, InitialBarrier.PIECES)


@dataclasses.dataclass(frozen=True)
class RepairTrial:
    """A trial of a repair with some value.

    Attributes:
        repair: the repair.
        value: of its parameter.
        flight: the outcome.
        failed: the mildest value without a certified flight; infinite without one.
        failed_flies: whether that value gave a flight.
    """

    repair: Repair
    value: float
    flight: TrialFlight
    failed: float = math.inf
    failed_flies: bool = False

    def suggested_change(self, number: int, where: str) -> SuggestedChange:
        """Return the trial as a suggested change for a conflict with a number and a place."""
        parameter, value, time = self.repair.parameter, self.value, self.flight.race_time
        assert time is not None  # else it is no suggested change
        key = parameter.key if value >= parameter.bounds.lower else ""
        label = f"{parameter.label} at {parameter.at}" if parameter.at else parameter.label
        unit = "" if parameter.unit == "1" else parameter.unit
        return SuggestedChange(
            number,
            where,
            key,
            label,
            unit,
            parameter.value,
            value,
            time,
            self.failed,
            self.failed_flies,
            self.flight.certified,
        )

    def after_failing(self, before: "RepairTrial") -> "RepairTrial":
        """Return the trial with the failure of a stricter one before it; a trial that was not run has not failed."""
        if not before.flight.was_tried:
            return self
        flies = before.flight.race_time is not None
        return dataclasses.replace(self, failed=before.value, failed_flies=flies)


Fly = Callable[[Race, Relaxed, TrialFlight], TrialFlight]
"""(race, near, before) -> flight: flies a whole race, from its plan, near a relaxed flight, or on from one before."""


def validate(
    race: Race, fly: Fly, repairs: Sequence[Repair], other_repairs: Sequence[Repair] = ()
) -> list[RepairTrial]:
    """Return the trials of one conflict that gave a flight, the certified ones first.

    All are tried with the least margin before any is tried with larger ones. Where none is certified, the largest value
    with a flight is reported, as the likeliest to be certified.

    Args:
        race: without a flight.
        fly: flies a race with a repair.
        repairs: the least change first.
        other_repairs: the first repair of each other conflict, applied as well.
    """

    def attempt(repair: Repair, margin: int, before: TrialFlight = NOT_TRIED) -> RepairTrial:
        return _attempt(race, fly, repair, repair.value(margin), other_repairs, before)

    trials: list[RepairTrial] = []
    for kind in KINDS:
        flying = 0
        for repair in repairs:
            if kind.includes(repair.parameter) and flying < kind.suggested_max:
                trials.append(attempt(repair, 0))
                flying += trials[-1].flight.race_time is not None
    work = sum(trial.flight.work for trial in trials)
    certified = any(trial.flight.certified for trial in trials)
    flying_trials: list[RepairTrial] = []
    for trial in trials:
        last = latest = trial
        for margin in range(1, len(MARGINS)):
            if last.flight.certified or (work > CONFLICT_WORK_MAX and (certified or trial is not trials[0])):
                break
            milder = attempt(trial.repair, margin, last.flight).after_failing(latest)
            work += milder.flight.work
            last = last if milder.flight.race_time is None else milder
            latest = milder if milder.flight.was_tried else latest
        certified = certified or last.flight.certified
        if last.flight.race_time is not None:
            flying_trials.append(last)
    return sorted(flying_trials, key=lambda trial: not trial.flight.certified)


def tighten(race: Race, fly: Fly, trial: RepairTrial, other_repairs: Sequence[Repair] = ()) -> RepairTrial:
    """Return a repair with the least value that is certified when it is tightened step by step from a flight.

    The value is halved between one that is certified and one that is not, until no rounded value lies between them,
    the work of `TIGHTENING_WORK` trials is done, or one is not tried to the end. Each is flown on from the last one
    that was certified.

    Args:
        race: without a flight.
        fly: flies a race with a repair.
        trial: of the repair; returned unchanged if it is not certified.
        other_repairs: the first repair of each other conflict, applied as well.
    """
    if not trial.flight.certified:
        return trial
    parameter, relaxed, best, work = trial.repair.parameter, trial.repair.relaxed, trial, 0.0
    tried = math.isfinite(trial.failed)
    least = trial.failed if tried else parameter.round_stricter(parameter.at_steps(relaxed.steps))
    while work < TIGHTENING_WORK:
        value = parameter.round_milder(0.5 * (least + best.value))
        if value == best.value:
            if tried or least == parameter.value:
                break
            value = least
        stricter = _attempt(race, fly, trial.repair, value, other_repairs, best.flight)
        work += stricter.flight.work
        if not stricter.flight.was_tried:
            break
        if not stricter.flight.certified:
            least, tried, best = value, True, best.after_failing(stricter)
        else:
            best = dataclasses.replace(best, value=value, flight=stricter.flight)
            if value == least:  # the relaxation on a coarse mesh was too large
                least = parameter.round_stricter(0.5 * (least + parameter.value))
    return best


def _attempt(
    race: Race, fly: Fly, repair: Repair, value: float, other_repairs: Sequence[Repair], before: TrialFlight
) -> RepairTrial:
    """Return a repair tried with a value, after another trial and with other repairs made."""
    changed = repair.parameter.set(race, value)
    for other_repair in other_repairs:
        changed = other_repair.apply(changed)
    try:
        return RepairTrial(repair, value, fly(changed, repair.relaxed, before))
    except InputError:  # the inputs do not allow this value
        return RepairTrial(repair, value, NOT_TRIED)
