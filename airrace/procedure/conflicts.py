"""The conflicts of a race for which no flight was found: what has to give way, by how much, and what else would do.

All levers give way together first, each by as many usual steps. That solution tells which of them are to blame, and
about how far each would have to give way alone: the steps of all together, divided by its share of the blame. Those for
which that is possible are then relaxed one by one. Where none helps alone, there are several conflicts: the levers of
other places are set free, until the first conflict is resolved, and the next is looked for in the race without it.
Every suggestion is flown on the whole race before it is told.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from airrace.errors import InputError
from airrace.optimal_control.problem import Iterate
from airrace.planning.race import Race
from airrace.procedure.lever import Lever
from airrace.procedure.levers import levers
from airrace.procedure.relaxation import Relaxed, Relaxer
from airrace.procedure.result import Remedy, StageResult

CONFLICTS_MAX = 4
"""The largest number of conflicts that are looked for."""
ALONE_MAX = 8
"""The largest number of levers that are relaxed alone for one conflict."""
TOLD_MAX = 4
"""The largest number of suggestions that are told of one conflict."""
WORK_MAX = 2e5
"""The work of trials for one conflict (iterations times intervals) after which no further suggestion is tried.

A flight of Abu Dhabi 2016 that is certified takes 4e4, and 1.5 s.
"""
LEAST_SHARE = 1e-3
"""The least share of the blame (1) with which a lever is considered."""
OPTIMISM = 1.0
"""The factor by which a lever may have to give way farther than is possible, by the estimate, and still be relaxed.

The estimate is the tangent at the solution for all levers, mostly less than it takes in the end: on the half Cuban
eight with a ceiling of 100 m it was 7.3 steps for the ceiling, which took 7.9, and 10.1 for the largest lift
coefficient, which took 13.
"""
MARGINS = ((1.1, 0.2), (1.2, 0.3), (1.4, 0.5))
"""The factors on the least relaxation, and the usual steps on top, with which a suggestion is tried in turn.

The least relaxation is that of a coarse mesh, and a flight at the edge of what is possible needs very fine ones: with
ceilings of 182, 184, 187 and 190 m the half Cuban eight was certified on 4301, 1603, 1440 and 276 intervals; 179 m are
the least.
"""
FREED = 5.0
"""The steps by which the levers of other places are set free besides those of all levers together."""
SHARES = (0.2, 1.0)
"""The shares of the largest blame (1) from which on local levers belong to the first conflict, tried in turn.

Where two conflicts ask for about as much, both have blame, and only the lever with most of it is kept.
"""


@dataclass(frozen=True)
class Option:
    """A lever that resolves a conflict alone, with the relaxed flight, and what relaxed it."""

    lever: Lever
    relaxer: Relaxer
    relaxed: Relaxed

    @property
    def cost(self) -> float:
        """The change in usual steps."""
        return abs(self.lever.usual_steps(self.lever.at_steps(self.relaxed.steps)))

    @property
    def settable(self) -> bool:
        """Whether the inputs allow the value that it takes."""
        return self.lever.settable(self.value(MARGINS[0]))

    def value(self, margin: tuple[float, float]) -> float:
        """Return the value that is tried with a margin: see `MARGINS`."""
        factor, extra = margin
        return self.lever.rounded(self.lever.at_steps(factor * self.relaxed.steps + extra))


@dataclass(frozen=True)
class Conflict:
    """A place at which limits contradict each other, and what would resolve that, the least change first."""

    where: str
    options: Sequence[Option]


Fly = Callable[[Race, Relaxer, Relaxed], tuple[StageResult | None, float]]
"""A trial: flies a whole race, from its plan or near a relaxed flight.

It returns the flight, None if there is none, and the work: iterations times intervals.
"""


@dataclass
class Search:
    """A search for the conflicts of a race.

    Attributes:
        ways: what relaxes it along one way round, with a flight to begin with; the way that asks least counts.
        race: the race.
        fly: tries suggestions in flight.
        found: a certified flight of the race as it is, if the search came across one.
    """

    ways: Sequence[tuple[Relaxer, Iterate]]
    race: Race
    fly: Fly
    found: StageResult | None = None

    def remedies(self) -> tuple[Remedy, ...]:
        """Return what would resolve the conflicts; nothing where none is found, or a flight (`found`)."""
        conflicts = list(self._conflicts())
        if self.found is not None:
            return ()
        remedies: list[Remedy] = []
        for number, conflict in enumerate(conflicts, start=1):
            others = [one.options[0] for one in conflicts if one is not conflict and one.options]
            remedies += self._flown(number, conflict, others)
        return tuple(remedies)

    # What is in conflict.

    def _conflicts(self) -> Iterator[Conflict]:
        race = self.race
        for _ in range(CONFLICTS_MAX):
            known = levers(race)
            relaxed = [(relaxer, relaxer.together(race, known, start)) for relaxer, start in self.ways]
            solved = [(relaxer, at) for relaxer, at in relaxed if at is not None]
            if not solved:
                return
            relaxer, together = min(solved, key=_steps)
            self.ways = [(relaxer, together.flight)]
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
            race = options[0].lever.changed(race, options[0].value(MARGINS[1]))

    def _options(self, race: Race, known: Sequence[Lever], relaxer: Relaxer, together: Relaxed) -> list[Option]:
        """Return the levers that resolve the conflict alone, the least change first."""
        blamed = [(relaxer.blame(race, lever, together), lever) for lever in known]
        estimates = [(together.steps / blame, lever) for blame, lever in blamed if blame > LEAST_SHARE]
        possible = sorted(
            ((steps, lever) for steps, lever in estimates if steps <= OPTIMISM * lever.steps_max),
            key=lambda one: (one[1].of_aircraft, one[0], one[1].key),
        )
        options: list[Option] = []
        for _, lever in possible[:ALONE_MAX]:
            relaxed = relaxer.alone(race, lever, together)
            if relaxed is None:
                continue
            if self._needs_nothing(race, relaxer, relaxed):
                break
            options.append(Option(lever, relaxer, relaxed))
        return sorted(options, key=lambda one: (not one.settable, one.lever.of_aircraft, one.cost, one.lever.key))

    def _needs_nothing(self, race: Race, relaxer: Relaxer, relaxed: Relaxed) -> bool:
        """Tell whether a race needs no relaxation after all; the race as it is given is then flown."""
        if relaxed.needed:
            return False
        if race is self.race and self.found is None:
            self.found, _ = self.fly(race, relaxer, relaxed)
        return race is not self.race or self.found is not None

    # What is told.

    def _flown(self, number: int, conflict: Conflict, others: Sequence[Option]) -> Iterator[Remedy]:
        """Yield the options that were flown, with the first options of the other conflicts."""
        told, spent = 0, 0.0
        for option in conflict.options:
            if told == TOLD_MAX or spent > WORK_MAX:
                break
            remedy, work = self._trial(number, conflict.where, option, others)
            spent += work
            if remedy is not None:
                told += 1
                yield remedy
        if not told:
            yield Remedy(number, conflict.where, "", "", "", 0.0, 0.0, 0.0)  # which says that there is none

    def _trial(self, number: int, where: str, option: Option, others: Sequence[Option]) -> tuple[Remedy | None, float]:
        """Return the option as a remedy, None if it does not fly with any margin, and the work of finding out.

        The least margin counts with which the flight is certified on the meshes of a trial, else the least that flies.
        """
        lever, spent = option.lever, 0.0
        flown: dict[float, StageResult] = {}
        for value in dict.fromkeys(option.value(margin) for margin in MARGINS):
            race = lever.changed(self.race, value)
            for other in others:
                race = other.lever.changed(race, other.value(MARGINS[1]))
            try:
                result, work = self.fly(race, option.relaxer, option.relaxed)
            except InputError:
                continue  # the inputs do not allow this value
            spent += work
            if result is not None:
                flown[value] = result
                if result.certified:
                    break
        if not flown:
            return None, spent
        value = next((value for value, result in flown.items() if result.certified), next(iter(flown)))
        key = lever.key if lever.settable(value) else ""
        time = flown[value].trajectory.race_time
        return Remedy(number, where, key, lever.told, lever.unit, lever.value, value, time), spent


def _steps(solved: tuple[Relaxer, Relaxed]) -> float:
    return solved[1].steps


def _freed(race: Race, known: Sequence[Lever], relaxer: Relaxer, together: Relaxed, share: float) -> Race:
    """Return the race with the levers of other places set free.

    Args:
        race: the race.
        known: its levers.
        relaxer: what relaxed it.
        together: the race with all levers relaxed.
        share: of the largest blame; local levers with as much of it stay as they are.
    """
    local = [(relaxer.blame(race, lever, together), lever) for lever in known if lever.local]
    most = max((blame for blame, _ in local), default=0.0)
    for blame, lever in local:
        if blame < share * most:
            race = lever.changed(race, lever.at_steps(min(together.steps + FREED, 0.95 * lever.steps_max)))
    return race
