"""The diagnosis of a race for which no flight was found: its conflicts, and changes that resolve them.

It is asked for once all starts of a stage have failed, with all solvers. Every suggestion is flown on the whole race
before it is told; a race that turns out to have a flight after all is flown.
"""

import dataclasses
import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence

from airrace.errors import InputError
from airrace.planning.race import Race
from airrace.procedure.fidelity import iterate_of
from airrace.procedure.guess import first_mesh, guess
from airrace.procedure.infeasibility.conflicts import KINDS, MARGINS, ConflictSearch, RelaxedRoutes, Repair, RepairKind
from airrace.procedure.infeasibility.elastic import ElasticSolver, Relaxed
from airrace.procedure.infeasibility.local_infeasibility import diagnose_window
from airrace.procedure.result import StageResult, Status, SuggestedChange
from airrace.procedure.settings import SearchEffort
from airrace.procedure.solve_and_refine import solve_certified
from airrace.procedure.solver_session import FEWEST_INTERVALS, Budget, SolverSession
from airrace.procedure.stage import Stage
from airrace.procedure.stage_problem import StageProblem, formulate, mesh_of
from airrace.procedure.start import InitialBarrier, Start
from airrace.records import record

TRIAL_ITERATIONS_MAX = 150
"""The iterations of a trial's solve; the flights of trials that were certified took 4 to 105 on each mesh."""
TRIAL_WORK = 300
"""The work of a trial: so many iterations on its first mesh.

Certifying whatever flies took minutes on courses in a narrow corridor: 1646 intervals on the fourth mesh.
"""
WORK_MAX = 4.0
"""The work of a conflict's trials, in that of one trial, after which none is repeated with a larger margin.

Without a certified flight the first one is repeated all the same.
"""
NO_FLIGHT = "no flight was found: "
ROUTES_HINT = "other routes were not tried (--search quick tries them)"


def diagnose_infeasibility(
    result: StageResult, race: Race, flight: StageProblem, session: SolverSession, routes: RelaxedRoutes | None = None
) -> StageResult:
    """Return a stage without a flight with what stands in the way; or the flight, if there is one after all.

    Args:
        result: of the stage, without a flight.
        race: what was to be flown.
        flight: the race as it was planned, in the equations of the stage.
        session: solves.
        routes: the race with all limits relaxed, where that was asked for before.
    """
    if result.is_flight or result.outcome is Status.TIMEOUT:
        return result
    session = dataclasses.replace(session, budget=session.budget.for_an_explanation())
    trials = _Trials(session, race, flight.stage)
    search = ConflictSearch(race, trials.certify)
    conflicts = list(search.conflicts(routes or RelaxedRoutes(race, flight, session)))
    if search.flight is not None:
        return dataclasses.replace(search.flight, search=result.search)
    changes: list[SuggestedChange] = []
    for number, conflict in enumerate(conflicts, start=1):
        others = [one.repairs[0] for one in conflicts if one is not conflict and one.repairs]
        flown = Validation(race, trials.fly, others).validate(conflict.repairs)
        nothing = SuggestedChange(number, conflict.where, "", "", "", 0.0, 0.0, 0.0)
        changes += [one.suggested_change(number, conflict.where) for one in flown] or [nothing]
    message = describe_conflicts(changes)
    if not any(one.text for one in changes):
        problem, end = flight.problem(mesh_of(result.trajectory)), iterate_of(result.trajectory)
        limit = diagnose_window(session, problem, end, end, "")
        if limit is None:
            return _with_record(result, session)
        message = "; ".join(text for text in (message, limit) if text)
    elif session.settings.search is SearchEffort.OFF:
        message = f"{message}; {ROUTES_HINT}"
    diagnosed = dataclasses.replace(
        result, outcome=Status.INFEASIBLE, message=NO_FLIGHT + message, suggested_changes=tuple(changes)
    )
    return _with_record(diagnosed, session)


def _with_record(result: StageResult, session: SolverSession) -> StageResult:
    return dataclasses.replace(result, attempts=tuple(session.attempts), timings=session.timings())


def describe_conflicts(changes: Sequence[SuggestedChange]) -> str:
    """Return what stands in the way and what would resolve it, as a sentence without a full stop."""
    conflicts = [list(group) for _, group in itertools.groupby(changes, key=lambda one: one.conflict)]
    return "; and ".join(_describe_conflict(*group) for group in conflicts)


def _describe_conflict(first: SuggestedChange, *others: SuggestedChange) -> str:
    if not first.text:
        return f"the limits contradict each other at {first.where}, and no single number was found that resolves it"

    def amount(value: float, change: SuggestedChange) -> str:
        return f"{value:g} {change.unit}".rstrip()

    def needed(change: SuggestedChange) -> str:
        return f" ({change.key}={change.needed:g})" if change.key else ""

    verb = "flown" if " -> " in first.where else "passed"
    repairs = [f"it takes {amount(first.needed, first)}{needed(first)}"]
    repairs += [
        f"{one.text} of {amount(one.needed, one)} instead of {amount(one.given, one)}{needed(one)}" for one in others
    ]
    begin = f"{first.where} cannot be {verb} with {first.text} of {amount(first.given, first)}: "
    return begin + ", or ".join(repairs)


@record
class TrialFlight:
    """The flight of a race with a repair.

    Attributes:
        race_time: s; None if none was found.
        certified: whether it is certified.
        work: how much of what a trial may take (1) it took.
    """

    race_time: float | None
    certified: bool
    work: float


@record
class _Trials:
    """Trials of races with other numbers: near a relaxed flight, else from their own plans."""

    session: SolverSession
    race: Race
    stage: Stage

    def certify(self, solver: ElasticSolver, near: Relaxed) -> StageResult | None:
        """Return a certified flight of the race as it is; None if none is found near a relaxed one."""
        start = self._start(self.race, solver, near)
        found = solve_certified(self.session, start, self.session.settings.solver.primary)
        return found if isinstance(found, StageResult) and found.certified else None

    def fly(self, race: Race, solver: ElasticSolver, near: Relaxed) -> TrialFlight:
        """Return the flight of a race.

        Raises:
            InputError: aircraft and rules leave no allowed value of some quantity.
        """
        first = self._fly(self._start(race, solver, near))
        if first.race_time is not None:
            return first
        flight = formulate(self.stage, race, self.session.settings)
        mesh = first_mesh(flight.plan, self.session.settings.mesh)
        planned = self._fly(Start(flight, flight.problem(mesh), guess(flight.plan, mesh), InitialBarrier.COLD))
        return dataclasses.replace(planned, work=first.work + planned.work)

    @staticmethod
    def _start(race: Race, solver: ElasticSolver, near: Relaxed) -> Start:
        flight = solver.flight(race)
        return Start(flight, flight.problem(solver.mesh), near.flight, InitialBarrier.PIECES)

    def _fly(self, start: Start) -> TrialFlight:
        settings = self.session.settings
        limit = min(settings.solver.iterations_max, TRIAL_ITERATIONS_MAX)
        settings = dataclasses.replace(settings, solver=dataclasses.replace(settings.solver, iterations_max=limit))
        budget = Budget(TRIAL_WORK * float(max(start.problem.intervals, FEWEST_INTERVALS)), failed_only=False)
        session = dataclasses.replace(self.session, settings=settings, budget=budget)
        found = solve_certified(session, start, settings.solver.primary)
        work = budget.spent / budget.work
        if isinstance(found, StageResult):
            return TrialFlight(found.trajectory.race_time, certified=found.certified, work=work)
        race_time = None if found.coarser is None else found.coarser.race_time
        return TrialFlight(race_time, certified=False, work=work)


@record
class RepairTrial:
    """A repair that was tried with some value."""

    repair: Repair
    value: float
    flight: TrialFlight

    def suggested_change(self, number: int, where: str) -> SuggestedChange:
        """Return it as a suggested change of a conflict with a number and a place."""
        parameter, value, time = self.repair.parameter, self.value, self.flight.race_time
        assert time is not None  # else it is no suggested change
        key = parameter.key if value >= parameter.bounds.lower else ""
        label = f"{parameter.label} at {parameter.at}" if parameter.at else parameter.label
        unit = "" if parameter.unit == "1" else parameter.unit
        return SuggestedChange(number, where, key, label, unit, parameter.value, value, time)


@record
class Validation:
    """The validation of the repairs of one conflict in flight.

    Attributes:
        race: without a flight.
        fly: flies a whole race, from its plan or near a relaxed flight.
        others: the first repairs of the other conflicts, which are made meanwhile.
    """

    race: Race
    fly: Callable[[Race, ElasticSolver, Relaxed], TrialFlight]
    others: Sequence[Repair] = ()

    def validate(self, repairs: Sequence[Repair]) -> list[RepairTrial]:
        """Return the repairs that flew, those that were certified first.

        All are tried with the least margin before any is tried with larger ones. Where none is certified, the largest
        value that flew is told, for it is the likeliest to be certified in the end.
        """
        found: list[RepairTrial] = []
        trials = [one for kind in KINDS for one in self._with_least_margin(repairs, kind)]
        work = sum(one.flight.work for one in trials)
        certified = any(one.flight.certified for one in trials)
        for one in trials:
            last = one
            for margin in MARGINS[1:]:
                if last.flight.certified or (work > WORK_MAX and (certified or one is not trials[0])):
                    break
                milder = self._trial(one.repair, margin)
                work += milder.flight.work
                last = last if milder.flight.race_time is None else milder
            certified = certified or last.flight.certified
            if last.flight.race_time is not None:
                found.append(last)
        return sorted(found, key=lambda one: not one.flight.certified)

    def _with_least_margin(self, repairs: Iterable[Repair], kind: RepairKind) -> Iterator[RepairTrial]:
        """Yield the trials of one kind until enough of them flew."""
        flown = 0
        for repair in repairs:
            if kind.includes(repair.parameter) and flown < kind.suggested_max:
                trial = self._trial(repair, MARGINS[0])
                flown += trial.flight.race_time is not None
                yield trial

    def _trial(self, repair: Repair, margin: tuple[float, float]) -> RepairTrial:
        value = repair.value(margin)
        race = repair.parameter.set(self.race, value)
        for other in self.others:
            race = other.apply(race)
        try:
            return RepairTrial(repair, value, self.fly(race, repair.solver, repair.relaxed))
        except InputError:  # the inputs do not allow this value
            return RepairTrial(repair, value, TrialFlight(None, certified=False, work=0.0))
