"""The conflicts of a race for which no flight was found: what has to give way, by how much, and what else would do.

All parameters give way together first, each by as many usual steps. That solution tells which of them are to blame, and
about how far each would have to give way alone: the steps of all together, divided by its share of the blame. Those for
which that is possible are relaxed one by one. Where none helps alone, there are several conflicts: the parameters of
other places are set free, until the first conflict is resolved, and the next is looked for in the race without it.
Every suggestion is flown on the whole race before it is told.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from airrace.planning.race import Race
from airrace.procedure.infeasibility.elastic_solver import ElasticSolver, Relaxed
from airrace.procedure.infeasibility.parameters import relaxables
from airrace.procedure.infeasibility.relaxable import RelaxableParameter
from airrace.procedure.infeasibility.relaxed_routes import Relaxation, relaxation
from airrace.procedure.infeasibility.suggestions import BUDGETS, Fly, Option, Trials
from airrace.procedure.result import StageResult, SuggestedChange
from airrace.records import record

CONFLICTS_MAX = 4
"""The largest number of conflicts that are looked for."""
MAX_PLAN_PENALTY = 12.0
"""The factor on the least estimate of parameters of a kind (usual steps) above which a parameter is not relaxed alone.

Those that helped on courses spoilt by one limit each were estimated at up to 6 times the least of them.
"""
LEAST_SHARE = 1e-3
"""The least share of the blame (1) with which a relaxable parameter is considered."""
OPTIMISM = 1.0
"""The factor by which a parameter may have to give way farther than is possible, by the estimate, and still be relaxed.

The estimate is the tangent at the solution for all parameters, mostly less than it takes in the end: on the half Cuban
eight with a ceiling of 100 m it was 7.3 steps for the ceiling, which took 7.9, and 10.1 for the largest lift
coefficient, which took 13.
"""
FREED = 5.0
"""The steps by which the parameters of other places are set free besides those of all parameters together."""
SHARES = (0.2, 1.0)
"""The shares of the largest blame (1) from which on local parameters belong to the first conflict, tried in turn.

Where two conflicts ask for about as much, both have blame, and only the relaxable parameter with most of it is kept.
"""


@record
class Conflict:
    """A place at which limits contradict each other, and what would resolve that, the least change first."""

    where: str
    options: Sequence[Option]


@dataclass
class Search:
    """A search for the conflicts of a race.

    Attributes:
        begun: the race with all limits relaxed, on every route on which that was found; the least of them counts.
        race: the race.
        fly: tries suggestions in flight.
        found: a certified flight of the race as it is, if the search came across one.
    """

    begun: Sequence[Relaxation]
    race: Race
    fly: Fly
    found: StageResult | None = None

    def suggested_changes(self) -> tuple[SuggestedChange, ...]:
        """Return what would resolve the conflicts; nothing where none is found, or a flight (`found`)."""
        conflicts = list(self._conflicts())
        if self.found is not None:
            return ()
        suggested_changes: list[SuggestedChange] = []
        for number, conflict in enumerate(conflicts, start=1):
            others = [one.options[0] for one in conflicts if one is not conflict and one.options]
            flown = Trials(self.race, self.fly, others).flown(conflict.options)
            nothing = SuggestedChange(number, conflict.where, "", "", "", 0.0, 0.0, 0.0)
            suggested_changes += [one.suggested_change(number, conflict.where) for one in flown] or [nothing]
        return tuple(suggested_changes)

    # What is in conflict.

    def _conflicts(self) -> Iterator[Conflict]:
        race, begun = self.race, min(self.begun, key=lambda one: one.relaxed.steps, default=None)
        for _ in range(CONFLICTS_MAX):
            if begun is None:
                return
            known, relaxer, together = relaxables(race), begun.relaxer, begun.relaxed
            if self._needs_nothing(race, relaxer, together):
                return
            options, last = self._options(race, known, relaxer, together), True
            for share in SHARES:
                if self.found is None and not options:
                    freed = _freed(race, known, relaxer, together, share)
                    options, last = self._options(freed, known, relaxer, together), False
            if self.found is not None:
                return
            yield Conflict(together.where, options)
            if last or not options:
                return
            race = options[0].applied(race)
            begun = relaxation(race, relaxer, together.flight)

    def _options(
        self, race: Race, known: Sequence[RelaxableParameter], relaxer: ElasticSolver, together: Relaxed
    ) -> list[Option]:
        """Return the relaxable parameters that resolve the conflict alone, the least change first."""
        attribution = [(relaxer.blame(race, relaxable, together), relaxable) for relaxable in known]
        estimates = [(together.steps / blame, relaxable) for blame, relaxable in attribution if blame > LEAST_SHARE]
        possible = sorted(
            ((steps, relaxable) for steps, relaxable in estimates if steps <= OPTIMISM * relaxable.steps_max),
            key=lambda one: (one[0], one[1].key),
        )
        options: list[Option] = []
        for budget in BUDGETS:
            of_a_kind = [one for one in possible if one[1].of_aircraft is budget.of_aircraft][: budget.alone_max]
            cheap = [one for one in of_a_kind if one[0] <= MAX_PLAN_PENALTY * of_a_kind[0][0]]
            options += itertools.islice(self._helping(race, cheap, relaxer, together), budget.suggested_max)
            if self.found is not None:
                break
        return sorted(
            options, key=lambda one: (not one.settable, one.relaxable.of_aircraft, one.cost, one.relaxable.key)
        )

    def _helping(
        self, race: Race, known: Sequence[tuple[float, RelaxableParameter]], relaxer: ElasticSolver, together: Relaxed
    ) -> Iterator[Option]:
        """Yield those parameters, with their estimates, that help alone until one shows that no limit has to."""
        for estimate, relaxable in known:
            relaxed = relaxer.alone(race, relaxable, together, estimate)
            if relaxed is None:
                continue
            if self._needs_nothing(race, relaxer, relaxed):
                return
            yield Option(relaxable, relaxer, relaxed)

    def _needs_nothing(self, race: Race, relaxer: ElasticSolver, relaxed: Relaxed) -> bool:
        """Tell whether a race needs no relaxation after all; the race as it is given is then flown."""
        if relaxed.needed:
            return False
        if race is self.race and self.found is None:
            self.found = self.fly(race, relaxer, relaxed).result
        return race is not self.race or self.found is not None


def _freed(
    race: Race, known: Sequence[RelaxableParameter], relaxer: ElasticSolver, together: Relaxed, share: float
) -> Race:
    """Return the race with the relaxable parameters of other places set free.

    Args:
        race: the race.
        known: its relaxable parameters.
        relaxer: what relaxed it.
        together: the race with all relaxable parameters relaxed.
        share: of the largest blame; local relaxable parameters with as much of it stay as they are.
    """
    local = [(relaxer.blame(race, relaxable, together), relaxable) for relaxable in known if relaxable.local]
    most = max((blame for blame, _ in local), default=0.0)
    for blame, relaxable in local:
        if blame < share * most:
            race = relaxable.changed(race, relaxable.at_steps(min(together.steps + FREED, 0.95 * relaxable.steps_max)))
    return race
