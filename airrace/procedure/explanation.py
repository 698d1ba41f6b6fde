"""The explanation of a race for which no flight was found: its conflicts of limits, in the user's units.

It is asked for once all starts of a stage have failed, with all solvers. A race that turns out to have a flight after
all is flown.
"""

import dataclasses
import itertools
from collections.abc import Sequence

from airrace.optimal_control.problem import Iterate
from airrace.planning.race import Race
from airrace.procedure.conflicts import Search
from airrace.procedure.flight import Flight, stage_flight
from airrace.procedure.guess import first_mesh, guess
from airrace.procedure.joint import COLD_BARRIER, PIECED_BARRIER, Start, refined
from airrace.procedure.models import iterate_of
from airrace.procedure.relaxation import Relaxed, Relaxer
from airrace.procedure.result import Outcome, Remedy, StageResult
from airrace.procedure.settings import Explore
from airrace.procedure.solving import Workbench
from airrace.trajectory import Trajectory

MESHES_MAX = 4
"""The largest number of meshes after the first on which a suggestion is tried.

Flights that need more are at the edge of what is possible: the half Cuban eight took 2842 intervals there.
"""
NO_FLIGHT = "no flight was found: "
"""The words with which the explanation begins."""
OTHER_WAYS = "other ways round were not tried (--explore quick tries them)"


def explained(result: StageResult, race: Race, flight: Flight, bench: Workbench) -> StageResult:
    """Return a stage without a flight with what stands in the way; or the flight, if there is one after all.

    Args:
        result: of the stage, without a flight.
        race: what was to be flown.
        flight: the race as it was planned, in the equations of the stage.
        bench: what it is solved with.
    """
    if result.is_flight or result.outcome is Outcome.TIMEOUT:
        return result
    mesh = first_mesh(flight.plan, bench.settings.mesh)
    trial = _Trial(_impatient(bench), race, flight, mesh)
    search = Search(Relaxer(bench, race, flight, mesh), race, trial.fly)
    remedies = search.remedies(_starts(flight, mesh, result.trajectory))
    if search.found is not None:
        return search.found
    if not remedies:
        return result
    message = NO_FLIGHT + told(remedies)
    if bench.settings.explore is Explore.OFF:
        message = f"{message}; {OTHER_WAYS}"
    return dataclasses.replace(result, outcome=Outcome.INFEASIBLE, message=message, remedies=remedies)


def _impatient(bench: Workbench) -> Workbench:
    """Return a workbench with which a flight is given up that needs many meshes."""
    settings = bench.settings
    fewer = dataclasses.replace(settings.mesh, refinements_max=min(settings.mesh.refinements_max, MESHES_MAX))
    return dataclasses.replace(bench, settings=dataclasses.replace(settings, mesh=fewer))


def _starts(flight: Flight, mesh: Sequence[tuple[float, ...]], stuck: Trajectory) -> list[Iterate]:
    """Return the flights to begin with: the plan, and where the solver gave up if that is on the same mesh."""
    planned = guess(flight.plan, mesh)
    given_up = iterate_of(stuck)
    return [planned, given_up] if given_up.state.shape == planned.state.shape else [planned]


@dataclasses.dataclass(frozen=True)
class _Trial:
    """Trials of races with other numbers: from their own plans, as they would be flown, else near a relaxed flight."""

    bench: Workbench
    race: Race
    flight: Flight
    mesh: Sequence[tuple[float, ...]]

    def fly(self, race: Race, near: Relaxed) -> StageResult | None:
        """Return the certified flight of a race; None if none was found.

        Raises:
            InputError: aircraft and rules leave no allowed value of some quantity.
        """
        settings = self.bench.settings
        flight = stage_flight(self.flight.stage, race, settings)
        mesh = first_mesh(flight.plan, settings.mesh)
        if race is not self.race:  # whose plan has led nowhere
            found = self._certified(Start(flight, flight.problem(mesh), guess(flight.plan, mesh), COLD_BARRIER))
            if found is not None:
                return found
        return self._certified(Start(flight, flight.problem(self.mesh), near.flight, PIECED_BARRIER))

    def _certified(self, start: Start) -> StageResult | None:
        found = refined(self.bench, start, self.bench.settings.solver.primary)
        return found if isinstance(found, StageResult) and found.certified else None


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
