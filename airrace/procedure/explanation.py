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
from airrace.procedure.conflicts import Search
from airrace.procedure.diagnosis import diagnose
from airrace.procedure.flight import Flight, mesh_of, stage_flight
from airrace.procedure.guess import first_mesh, guess
from airrace.procedure.joint import COLD_BARRIER, PIECED_BARRIER, Start, refined
from airrace.procedure.models import iterate_of
from airrace.procedure.relaxation import Relaxed, Relaxer
from airrace.procedure.relaxed_ways import Relaxations
from airrace.procedure.result import Outcome, Remedy, StageResult
from airrace.procedure.settings import SearchEffort
from airrace.procedure.solving import Workbench
from airrace.procedure.stage import Stage
from airrace.procedure.suggestions import NOTHING, Flown
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
OTHER_WAYS = "other ways round were not tried (--search quick tries them)"


def explained(
    result: StageResult,
    race: Race,
    flight: Flight,
    bench: Workbench,
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
    bench = dataclasses.replace(bench, budget=bench.budget.for_an_explanation())
    trial = _Trial(bench, race, flight.stage)
    begun = [one for one in relaxed or Relaxations(race, flight, bench) if one is not None]
    search = Search(begun, race, trial.fly)
    remedies = search.remedies()
    if search.found is not None:
        return dataclasses.replace(search.found, search=result.search)
    if not any(one.text for one in remedies):
        return _on_record(_diagnosed(result, remedies, flight, bench), bench)
    message = NO_FLIGHT + told(remedies)
    if bench.settings.search is SearchEffort.OFF:
        message = f"{message}; {OTHER_WAYS}"
    contradictory = dataclasses.replace(result, outcome=Outcome.INFEASIBLE, message=message, remedies=remedies)
    return _on_record(contradictory, bench)


def _diagnosed(result: StageResult, remedies: Sequence[Remedy], flight: Flight, bench: Workbench) -> StageResult:
    """Return a result with the limit without which the legs around the conflict can be flown, if there is one."""
    problem, stuck = flight.problem(mesh_of(result.trajectory)), iterate_of(result.trajectory)
    conflict = diagnose(bench, problem, stuck, stuck, "")
    if conflict is None:
        return result
    message = NO_FLIGHT + "; ".join(text for text in (told(remedies), conflict) if text)
    return dataclasses.replace(result, outcome=Outcome.INFEASIBLE, message=message, remedies=tuple(remedies))


def _on_record(result: StageResult, bench: Workbench) -> StageResult:
    """Return a result with the record of all that was solved for its stage."""
    return dataclasses.replace(result, attempts=tuple(bench.attempts), timings=bench.timings())


def _impatient(bench: Workbench, problem: Problem) -> Workbench:
    """Return a workbench that gives a flight up which takes much work."""
    settings = bench.settings
    solver = settings.solver
    sooner = dataclasses.replace(solver, iterations_max=min(solver.iterations_max, ITERATIONS_MAX))
    budget = Budget(PER_TRIAL * float(max(problem.intervals, FEWEST_INTERVALS)), in_vain=False)
    return dataclasses.replace(bench, settings=dataclasses.replace(settings, solver=sooner), budget=budget)


@record
class _Trial:
    """Trials of races with other numbers: near a relaxed flight, else from their own plans."""

    bench: Workbench
    race: Race
    stage: Stage

    def fly(self, race: Race, relaxer: Relaxer, near: Relaxed) -> Flown:
        """Return a trial of a race; the flight of the race as it is given is certified, or there is none.

        Raises:
            InputError: aircraft and rules leave no allowed value of some quantity.
        """
        along = relaxer.flight(race)
        relaxed = Start(along, along.problem(relaxer.mesh), near.flight, PIECED_BARRIER)
        if race is self.race:  # whose plan has led nowhere
            found = refined(self.bench, relaxed, self.bench.settings.solver.primary)
            certified = found if isinstance(found, StageResult) and found.certified else None
            return dataclasses.replace(NOTHING, certified=certified is not None, result=certified)
        first = self._flown(relaxed)
        if first.race_time is not None:
            return first
        flight = stage_flight(self.stage, race, self.bench.settings)
        mesh = first_mesh(flight.plan, self.bench.settings.mesh)
        planned = self._flown(Start(flight, flight.problem(mesh), guess(flight.plan, mesh), COLD_BARRIER))
        return dataclasses.replace(planned, effort=first.effort + planned.effort)

    def _flown(self, start: Start) -> Flown:
        bench = _impatient(self.bench, start.problem)
        found = refined(bench, start, bench.settings.solver.primary)
        effort = bench.budget.spent / bench.budget.work
        if isinstance(found, StageResult):
            return Flown(found.trajectory.race_time, certified=found.certified, effort=effort, result=found)
        race_time = None if found.coarser is None else found.coarser.race_time
        return Flown(race_time, certified=False, effort=effort)


def told(remedies: Sequence[Remedy]) -> str:
    """Return what stands in the way and what would resolve it, as a sentence without a full stop."""
    conflicts = [list(group) for _, group in itertools.groupby(remedies, key=lambda one: one.conflict)]
    return "; and ".join(_conflict(group) for group in conflicts)


def _conflict(remedies: Sequence[Remedy]) -> str:
    first, *others = remedies
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


def _setting(remedy: Remedy) -> str:
    return f" ({remedy.key}={remedy.needed:g})" if remedy.key else ""
