"""The conflicts of a race for which no flight was found, and the parameters that resolve each of them.

All parameters are relaxed together first, each by as many usual steps. The multipliers of that solution attribute the
relaxation to parameters, and the steps of all together divided by its share estimate how far each would have to give
way alone. Those for which that is possible are relaxed one by one. Where none helps alone, there are several conflicts:
the parameters of other places are freed until the first conflict is resolved, and the next is looked for in the race
without it.
"""

import dataclasses
import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from airrace.model.parameters import Parameter
from airrace.model.track.course import PilotLimits
from airrace.optimal_control.problem import Iterate
from airrace.procedure.guess import first_mesh, guess
from airrace.procedure.infeasibility.budget import conflict_budget, searching_conflicts
from airrace.procedure.infeasibility.elastic import ElasticSolver, Relaxed
from airrace.procedure.planning.parameters import relaxable_parameters
from airrace.procedure.planning.plan import plan_race
from airrace.procedure.result import StageResult
from airrace.procedure.settings import MeshSettings
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_problem import Mesh, StageProblem, with_passages, without_pilot_limits
from airrace.race import Race

CONFLICTS_MAX = 4
"""The largest number of conflicts."""
MILDER_STEPS = 4.0
"""The usual steps by which all parameters give way in the race whose plan is a second route. Where an angle of crossing
is too small, the plan loops; with a larger one it goes straight."""
PLAIN_STEPS = 0.1
"""The relaxation from which on a route is infeasible beyond doubt, in steps."""
ESTIMATE_RATIO_MAX = 12.0
"""Factor on the least estimate of a kind above which a parameter is not relaxed alone. Those that helped on courses
spoilt by one limit each were estimated at up to 6 times the least of them."""
SHARE_MIN = 1e-3
"""Attribution from which a parameter is considered."""
ESTIMATE_SLACK = 1.0
"""Factor by which an estimate may exceed what is possible. It is a tangent, mostly less than it takes in the end: on
the half Cuban eight with a ceiling of 100 m 7.3 steps for the ceiling, which took 7.9, and 10.1 for the largest lift
coefficient, which took 13."""
FREEING_STEPS = 5.0
"""The usual steps by which the parameters of other places are freed besides those of all together."""
LOCAL_SHARES = (0.2, 1.0)
"""Shares of the largest attribution from which local parameters belong to the first conflict, tried in turn: two
conflicts that ask for about as much both have attribution."""
MARGINS = ((1.1, 0.2), (1.4, 0.5), (2.0, 2.0))
"""Factors on the least relaxation, and the usual steps on top, with which a repair is tried in turn. The least
relaxation is that of a coarse mesh, and a flight at the edge of what is possible needs very fine ones: with ceilings of
182, 184, 187 and 190 m the half Cuban eight was certified on 4301, 1603, 1440 and 276 intervals; 179 m are the least.
Where a roll from one gate to the next takes 28 deg/s at least, 33 and 41 deg/s were not certified in 28 s, 65 deg/s in
2 s."""


@dataclasses.dataclass(frozen=True)
class RepairKind:
    """The parameters of rules and gates, or those of the aircraft, and how many are considered for a conflict.

    Attributes:
        of_aircraft: whether they are the aircraft's, which no race director can change.
        single_max: parameters that are relaxed alone.
        suggested_max: suggestions.
    """

    of_aircraft: bool
    single_max: int
    suggested_max: int

    def includes(self, parameter: Parameter[Race]) -> bool:
        """Return whether a parameter is of this kind."""
        return parameter.key.startswith("aircraft.") is self.of_aircraft


RULES_AND_GATES = RepairKind(of_aircraft=False, single_max=5, suggested_max=3)
AIRCRAFT = RepairKind(of_aircraft=True, single_max=3, suggested_max=2)
KINDS = (RULES_AND_GATES, AIRCRAFT)
"""In the order in which they are tried and suggested: a director's first; the aircraft may be at fault as much."""


@dataclasses.dataclass(frozen=True)
class Repair:
    """A parameter that resolves a conflict alone, with the relaxed flight."""

    parameter: Parameter[Race]
    relaxed: Relaxed

    @property
    def rank(self) -> tuple[bool, bool, float, str]:
        """The order of repairs: those that the inputs allow, rules and gates, then by usual steps."""
        parameter = self.parameter
        steps = abs((parameter.at_steps(self.relaxed.steps) - parameter.value) / parameter.relaxing_step)
        not_allowed = self.value(0) < parameter.bounds.lower
        return not_allowed, AIRCRAFT.includes(parameter), steps, parameter.key

    def value(self, margin: int) -> float:
        """Return the value that is tried with the margin of that number."""
        factor, extra = MARGINS[margin]
        return self.parameter.round_milder(self.parameter.at_steps(factor * self.relaxed.steps + extra))

    def apply(self, race: Race) -> Race:
        """Return a race in which the conflict is resolved, with a margin to spare."""
        return self.parameter.set(race, self.value(1))


class RelaxedRace:
    """A race relaxed along its plan, then along the plan of a milder race.

    Each is solved on demand, within the budget of the search for conflicts. A
    race with limits of a pilot is relaxed without them first, and from there with them: from its guess, the half Cuban
    eight with a ceiling of 100 m and a floor of 10 or 30 m was not relaxed.

    Attributes:
        budget: of the search for conflicts.
        without_pilot: the race relaxed without the limits of a pilot, as far as solved; empty without such limits.
    """

    def __init__(self, race: Race, stage_problem: StageProblem, settings: MeshSettings) -> None:
        self.budget = conflict_budget(stage_problem.plan, settings)
        self._race, self._parameters = race, relaxable_parameters(race)
        self.without_pilot: list[Relaxed | None] = []
        self._solved: list[Relaxed | None] = []
        self._remaining = self._starts(stage_problem, settings)

    def solve(self, session: SolverSession) -> Iterator[Relaxed | None]:
        """Yield the race relaxed along one plan after the other; None where that fails.

        Args:
            session: solves what has not been solved before.
        """
        yield from tuple(self._solved)
        for flight, mesh, start in self._remaining:
            with searching_conflicts(session, self.budget) as searching:
                steps = 1.0
                if self._race.course.rules.pilot != PilotLimits():
                    free = self._without_pilot(searching, flight, mesh, start)
                    if free is not None:
                        start, steps = free.flight, max(steps, free.steps)
                solver = ElasticSolver(self._race, flight, mesh)
                relaxed = solver.solve_all(searching, self._race, self._parameters, start, steps)
            self._solved.append(relaxed)
            yield relaxed

    def _without_pilot(
        self, session: SolverSession, stage_problem: StageProblem, mesh: Mesh, start: Iterate
    ) -> Relaxed | None:
        stage_problem = without_pilot_limits(stage_problem, self._race)
        race = dataclasses.replace(self._race, course=stage_problem.course)
        free = ElasticSolver(race, stage_problem, mesh).solve_all(session, race, relaxable_parameters(race), start)
        self.without_pilot.append(free)
        return free

    def _starts(
        self, stage_problem: StageProblem, settings: MeshSettings
    ) -> Iterator[tuple[StageProblem, Mesh, Iterate]]:
        milder = self._race
        for parameter in self._parameters:
            milder = parameter.set(milder, parameter.at_steps(min(MILDER_STEPS, 0.9 * parameter.steps_max)))
        before: Iterate | None = None
        for plan in (stage_problem.plan, with_passages(plan_race(milder), self._race.course)):
            mesh = first_mesh(plan, settings)
            start = guess(plan, mesh)
            if before is None or not np.array_equal(before.state, start.state):
                yield dataclasses.replace(stage_problem, plan=plan), mesh, start
            before = start


def conflict_location(routes: Iterable[Relaxed | None]) -> str:
    """Return the location of a conflict that is certain on every route; empty if there is none."""
    where = ""
    for route in routes:
        if route is None or route.steps < PLAIN_STEPS:
            return ""
        where = where or route.where
    return where


@dataclasses.dataclass(frozen=True)
class Conflict:
    """A place at which limits contradict each other, and its repairs, the least change first."""

    where: str
    repairs: Sequence[Repair]


@dataclass
class ConflictSearch:
    """The search for the conflicts of a race.

    Attributes:
        session: solves.
        race: the race.
        certify: returns a certified flight of the race as it is near a relaxed one that needs no relaxation, or None.
        flight: what `certify` found, which ends the search.
    """

    session: SolverSession
    race: Race
    certify: Callable[[Relaxed], StageResult | None]
    flight: StageResult | None = None

    def conflicts(self, routes: Iterable[Relaxed | None]) -> Iterator[Conflict]:
        """Yield the conflicts on the route with the least relaxation."""
        relaxations = [relaxation for relaxation in routes if relaxation is not None]
        race, relaxed = self.race, min(relaxations, key=lambda relaxation: relaxation.steps, default=None)
        for _ in range(CONFLICTS_MAX):
            if relaxed is None or self._needs_nothing(race, relaxed):
                return
            parameters = relaxable_parameters(race)
            repairs, is_last = self._repairs(race, parameters, relaxed), True
            for share in LOCAL_SHARES:
                if self.flight is None and not repairs:
                    freed = _free_other_places(race, parameters, relaxed, share)
                    repairs, is_last = self._repairs(freed, parameters, relaxed), False
            if self.flight is not None:
                return
            yield Conflict(relaxed.where, repairs)
            if is_last or not repairs:
                return
            race = repairs[0].apply(race)
            relaxed = relaxed.solver.solve_all(self.session, race, relaxable_parameters(race), relaxed.flight)

    def _repairs(self, race: Race, parameters: Sequence[Parameter[Race]], relaxed: Relaxed) -> list[Repair]:
        """Return the parameters that resolve the conflict alone, the least change first."""
        possible: list[tuple[float, Parameter[Race]]] = []
        for parameter in parameters:
            share = relaxed.solver.attribution(race, parameter, relaxed)
            if share > SHARE_MIN and relaxed.steps / share <= ESTIMATE_SLACK * parameter.steps_max:
                possible.append((relaxed.steps / share, parameter))
        possible.sort(key=lambda estimate: (estimate[0], estimate[1].key))
        repairs: list[Repair] = []
        for kind in KINDS:
            own = [estimate for estimate in possible if kind.includes(estimate[1])][: kind.single_max]
            likely = [estimate for estimate in own if estimate[0] <= ESTIMATE_RATIO_MAX * own[0][0]]
            repairs += itertools.islice(self._relax_singly(race, likely, relaxed), kind.suggested_max)
            if self.flight is not None:
                break
        return sorted(repairs, key=lambda repair: repair.rank)

    def _relax_singly(
        self, race: Race, estimates: Sequence[tuple[float, Parameter[Race]]], near: Relaxed
    ) -> Iterator[Repair]:
        """Yield the parameters that help alone, until one shows that no limit has to give way."""
        for estimate, parameter in estimates:
            relaxed = near.solver.solve_single(self.session, race, parameter, near, estimate)
            if relaxed is not None:
                if self._needs_nothing(race, relaxed):
                    return
                yield Repair(parameter, relaxed)

    def _needs_nothing(self, race: Race, relaxed: Relaxed) -> bool:
        """Return whether a race needs no relaxation after all; the original race is then solved."""
        if relaxed.is_needed:
            return False
        if race is self.race and self.flight is None:
            self.flight = self.certify(relaxed)
        return race is not self.race or self.flight is not None


def _free_other_places(race: Race, parameters: Sequence[Parameter[Race]], relaxed: Relaxed, share_min: float) -> Race:
    """Return the race without the local limits whose attribution is less than a share of the largest."""
    local = [
        (relaxed.solver.attribution(race, parameter, relaxed), parameter) for parameter in parameters if parameter.local
    ]
    most = max((share for share, _ in local), default=0.0)
    for share, parameter in local:
        if share < share_min * most:
            steps = min(relaxed.steps + FREEING_STEPS, 0.95 * parameter.steps_max)
            race = parameter.set(race, parameter.at_steps(steps))
    return race
