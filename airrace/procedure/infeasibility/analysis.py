"""The explanation of a race for which no flight was found: its conflicts of limits, in the user's units.

It is asked for once all starts of a stage have failed, with all solvers. A race that turns out to have a flight after
all is flown.
"""

import dataclasses
import itertools
from collections.abc import Sequence

from airrace.optimal_control.problem import Problem
from airrace.planning.race import Race
from airrace.procedure.budget import FEWEST_INTERVALS, Budget
from airrace.procedure.guess import first_mesh, guess
from airrace.procedure.infeasibility.conflicts import Search
from airrace.procedure.infeasibility.diagnosis import diagnose
from airrace.procedure.infeasibility.elastic_solver import ElasticSolver, Relaxed
from airrace.procedure.infeasibility.relaxed_routes import Relaxations
from airrace.procedure.infeasibility.suggestions import NOTHING, Flown
from airrace.procedure.models import iterate_of
from airrace.procedure.result import Outcome, StageResult, SuggestedChange
from airrace.procedure.settings import SearchEffort
from airrace.procedure.solve_and_refine import solve_certified
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage import Stage
from airrace.procedure.stage_problem import Flight, mesh_of, stage_flight
from airrace.procedure.start import InitialBarrier, Start
from airrace.records import record

ITERATIONS_MAX = 150
"""The number of iterations of a trial's solve.

The flights of trials that were certified took 4 to 105 on each mesh.
"""
PER_TRIAL = 300
"""The work of a trial per interval of its first mesh: so many iterations on that mesh.

Certifying whatever flies took minutes on courses in a narrow corridor: 1646 intervals on the fourth mesh.
"""
NO_FLIGHT = "no flight was found: "
"""The words with which the explanation begins."""
OTHER_WAYS = "other routes were not tried (--search quick tries them)"


def diagnose_infeasibility(
    result: StageResult,
    race: Race,
    flight: Flight,
    session: SolverSession,
    relaxed: Relaxations | None = None,
) -> StageResult:
    """Return a stage without a flight with what stands in the way; or the flight, if there is one after all.

    Args:
        result: of the stage, without a flight.
        race: what was to be flown.
        flight: the race as it was planned, in the equations of the stage.
        bench: what it is solved with.
        relaxed: the race with all limits relaxed, where that was asked for before.
    """
    if result.is_flight or result.outcome is Outcome.TIMEOUT:
        return result
    session = dataclasses.replace(session, budget=session.budget.for_an_explanation())
    trial = _Trial(session, race, flight.stage)
    begun = [one for one in relaxed or Relaxations(race, flight, session) if one is not None]
    search = Search(begun, race, trial.fly)
    suggested_changes = search.suggested_changes()
    if search.found is not None:
        return dataclasses.replace(search.found, search=result.search)
    if not any(one.text for one in suggested_changes):
        return _on_record(_diagnosed(result, suggested_changes, flight, session), session)
    message = NO_FLIGHT + told(suggested_changes)
    if session.settings.search is SearchEffort.OFF:
        message = f"{message}; {OTHER_WAYS}"
    contradictory = dataclasses.replace(
        result, outcome=Outcome.INFEASIBLE, message=message, suggested_changes=suggested_changes
    )
    return _on_record(contradictory, session)


def _diagnosed(
    result: StageResult, suggested_changes: Sequence[SuggestedChange], flight: Flight, session: SolverSession
) -> StageResult:
    """Return a result with the limit without which the legs around the conflict can be flown, if there is one."""
    problem, stuck = flight.problem(mesh_of(result.trajectory)), iterate_of(result.trajectory)
    conflict = diagnose(session, problem, stuck, stuck, "")
    if conflict is None:
        return result
    message = NO_FLIGHT + "; ".join(text for text in (told(suggested_changes), conflict) if text)
    return dataclasses.replace(
        result, outcome=Outcome.INFEASIBLE, message=message, suggested_changes=tuple(suggested_changes)
    )


def _on_record(result: StageResult, session: SolverSession) -> StageResult:
    """Return a result with the record of all that was solved for its stage."""
    return dataclasses.replace(result, attempts=tuple(session.attempts), timings=session.timings())


def _impatient(session: SolverSession, problem: Problem) -> SolverSession:
    """Return a solver session that gives a flight up which takes much work."""
    settings = session.settings
    solver = settings.solver
    sooner = dataclasses.replace(solver, iterations_max=min(solver.iterations_max, ITERATIONS_MAX))
    budget = Budget(PER_TRIAL * float(max(problem.intervals, FEWEST_INTERVALS)), failed_only=False)
    return dataclasses.replace(session, settings=dataclasses.replace(settings, solver=sooner), budget=budget)


@record
class _Trial:
    """Trials of races with other numbers: near a relaxed flight, else from their own plans."""

    session: SolverSession
    race: Race
    stage: Stage

    def fly(self, race: Race, relaxer: ElasticSolver, near: Relaxed) -> Flown:
        """Return a trial of a race; the flight of the race as it is given is certified, or there is none.

        Raises:
            InputError: aircraft and rules leave no allowed value of some quantity.
        """
        along = relaxer.flight(race)
        relaxed = Start(along, along.problem(relaxer.mesh), near.flight, InitialBarrier.PIECES)
        if race is self.race:  # whose plan has led nowhere
            found = solve_certified(self.session, relaxed, self.session.settings.solver.primary)
            certified = found if isinstance(found, StageResult) and found.certified else None
            return dataclasses.replace(NOTHING, certified=certified is not None, result=certified)
        first = self._flown(relaxed)
        if first.race_time is not None:
            return first
        flight = stage_flight(self.stage, race, self.session.settings)
        mesh = first_mesh(flight.plan, self.session.settings.mesh)
        planned = self._flown(Start(flight, flight.problem(mesh), guess(flight.plan, mesh), InitialBarrier.COLD))
        return dataclasses.replace(planned, effort=first.effort + planned.effort)

    def _flown(self, start: Start) -> Flown:
        session = _impatient(self.session, start.problem)
        found = solve_certified(session, start, session.settings.solver.primary)
        effort = session.budget.spent / session.budget.work
        if isinstance(found, StageResult):
            return Flown(found.trajectory.race_time, certified=found.certified, effort=effort, result=found)
        race_time = None if found.coarser is None else found.coarser.race_time
        return Flown(race_time, certified=False, effort=effort)


def told(suggested_changes: Sequence[SuggestedChange]) -> str:
    """Return what stands in the way and what would resolve it, as a sentence without a full stop."""
    conflicts = [list(group) for _, group in itertools.groupby(suggested_changes, key=lambda one: one.conflict)]
    return "; and ".join(_conflict(group) for group in conflicts)


def _conflict(suggested_changes: Sequence[SuggestedChange]) -> str:
    first, *others = suggested_changes
    flown = "flown" if " -> " in first.where else "passed"
    if not first.text:
        return f"the limits contradict each other at {first.where}, and no single number was found that resolves it"
    begin = f"{first.where} cannot be {flown} with {first.text} of {_amount(first.given, first.unit)}: "
    ways = [f"it takes {_amount(first.needed, first.unit)}{_setting(first)}"]
    ways += [
        f"{one.text} of {_amount(one.needed, one.unit)} instead of {_amount(one.given, one.unit)}{_setting(one)}"
        for one in others
    ]
    return begin + ", or ".join(ways)


def _amount(value: float, unit: str) -> str:
    return f"{value:g} {unit}".rstrip()


def _setting(suggested_change: SuggestedChange) -> str:
    return f" ({suggested_change.key}={suggested_change.needed:g})" if suggested_change.key else ""
