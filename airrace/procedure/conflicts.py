"""The conflicts of a race for which no flight was found: what has to give way, by how much, and what else would do.

All levers give way together first, each by as many usual steps. That solution tells which of them are to blame, and
about how far each would have to give way alone: the steps of all together, divided by its share of the blame. Those for
which that is possible are then relaxed one by one. Where none helps alone, there are several conflicts: the levers of
other gates are set free, until the first conflict is resolved, and the next is looked for in the race without it.
Every suggestion is flown on the whole race before it is told.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from airrace.errors import InputError
from airrace.optimal_control.problem import Iterate
from airrace.planning.race import Race
from airrace.procedure.levers import Lever, levers
from airrace.procedure.relaxation import Relaxed, Relaxer
from airrace.procedure.result import Remedy, StageResult

CONFLICTS_MAX = 4
"""The largest number of conflicts that are looked for."""
ALONE_MAX = 8
"""The largest number of levers that are relaxed alone for one conflict."""
TOLD_MAX = 4
"""The largest number of suggestions that are told of one conflict."""
TRIALS_MAX = 6
"""The largest number of levers that are tried in flight for one conflict."""
LEAST_SHARE = 1e-3
"""The least share of the blame (1) with which a lever is considered."""
OPTIMISM = 1.0
"""The factor by which a lever may have to give way farther than is possible, by the estimate, and still be relaxed.

The estimate is the tangent at the solution for all levers, mostly less than it takes in the end: on the half Cuban
eight with a ceiling of 100 m it was 7.3 steps for the ceiling, which took 7.9, and 10.1 for the largest lift
coefficient, which took 13.
"""
MARGINS = ((1.03, 0.05), (1.1, 0.15), (1.3, 0.5))
"""The factors on the least relaxation, and the usual steps on top, with which a suggestion is tried in turn.

The least relaxation is that of a coarse mesh, on which the solver stops within a hundredth of a step.
"""
FREED = 5.0
"""The steps by which the levers of other gates are set free besides those of all levers together."""


@dataclass(frozen=True)
class Option:
    """A lever that resolves a conflict alone, with the relaxed flight and the number of steps that it takes."""

    lever: Lever
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


Fly = Callable[[Race, Relaxed], StageResult | None]
"""A trial: flies a whole race, from its plan or near a relaxed flight; None unless the flight is certified."""


@dataclass
class Search:
    """A search for the conflicts of a race.

    Attributes:
        relaxer: relaxes it.
        race: the race.
        fly: tries suggestions in flight.
        found: a certified flight of the race as it is, if the search came across one.
    """

    relaxer: Relaxer
    race: Race
    fly: Fly
    found: StageResult | None = None

    def remedies(self, starts: Sequence[Iterate]) -> tuple[Remedy, ...]:
        """Return what would resolve the conflicts; nothing where none is found, or a flight (`found`).

        Args:
            starts: flights to begin with, the best first.
        """
        conflicts = list(self._conflicts(starts))
        if self.found is not None:
            return ()
        remedies: list[Remedy] = []
        for number, conflict in enumerate(conflicts, start=1):
            others = [one.options[0] for one in conflicts if one is not conflict and one.options]
            remedies += self._flown(number, conflict, others)
        return tuple(remedies)

    # What is in conflict.

    def _conflicts(self, starts: Sequence[Iterate]) -> Iterator[Conflict]:
        race = self.race
        for _ in range(CONFLICTS_MAX):
            known = levers(race)
            together = self._together(race, known, starts)
            if together is None or self._needs_nothing(race, together):
                return
            options, last = self._options(race, known, together), True
            if self.found is None and not options:
                options, last = self._options(_freed(race, known, together), known, together), False
            if self.found is not None:
                return
            yield Conflict(together.where, options)
            if last or not options:
                return
            race = options[0].lever.changed(race, options[0].value(MARGINS[1]))
            starts = [options[0].relaxed.flight, *starts]

    def _together(self, race: Race, known: Sequence[Lever], starts: Sequence[Iterate]) -> Relaxed | None:
        for start in starts:
            if (relaxed := self.relaxer.together(race, known, start)) is not None:
                return relaxed
        return None

    def _options(self, race: Race, known: Sequence[Lever], together: Relaxed) -> list[Option]:
        """Return the levers that resolve the conflict alone, the least change first."""
        blamed = [(self.relaxer.blame(race, lever, together), lever) for lever in known]
        estimates = [(together.steps / blame, lever) for blame, lever in blamed if blame > LEAST_SHARE]
        possible = sorted(
            ((steps, lever) for steps, lever in estimates if steps <= OPTIMISM * lever.steps_max),
            key=lambda one: (one[1].of_aircraft, one[0], one[1].key),
        )
        options: list[Option] = []
        for _, lever in possible[:ALONE_MAX]:
            relaxed = self.relaxer.alone(race, lever, together)
            if relaxed is None:
                continue
            if self._needs_nothing(race, relaxed):
                break
            options.append(Option(lever, relaxed))
        return sorted(options, key=lambda one: (not one.settable, one.lever.of_aircraft, one.cost, one.lever.key))

    def _needs_nothing(self, race: Race, relaxed: Relaxed) -> bool:
        """Tell whether a race needs no relaxation after all; the race as it is given is then flown."""
        if relaxed.needed:
            return False
        if race is self.race and self.found is None:
            self.found = self.fly(race, relaxed)
        return race is not self.race or self.found is not None

    # What is told.

    def _flown(self, number: int, conflict: Conflict, others: Sequence[Option]) -> Iterator[Remedy]:
        """Yield the options that were flown, with the first options of the other conflicts."""
        told = 0
        for option in conflict.options[:TRIALS_MAX]:
            if told == TOLD_MAX:
                return
            remedy = self._trial(number, conflict.where, option, others)
            if remedy is not None:
                told += 1
                yield remedy
        if not told:
            yield Remedy(number, conflict.where, "", "", "", 0.0, 0.0, 0.0)  # which says that there is none

    def _trial(self, number: int, where: str, option: Option, others: Sequence[Option]) -> Remedy | None:
        lever, before = option.lever, None
        for margin in MARGINS:
            value = option.value(margin)
            if value == before:
                continue
            before, race = value, lever.changed(self.race, value)
            for other in others:
                race = other.lever.changed(race, other.value(margin))
            try:
                result = self.fly(race, option.relaxed)
            except InputError:
                continue  # the inputs do not allow this value
            if result is not None:
                key = lever.key if lever.settable(value) else ""
                return Remedy(
                    number, where, key, lever.told, lever.unit, lever.value, value, result.trajectory.race_time
                )
        return None


def _freed(race: Race, known: Sequence[Lever], together: Relaxed) -> Race:
    """Return the race with the levers of all gates set free that are not to blame for the first conflict."""
    blamed = {name.partition(":")[2].partition("#")[0] for where in together.places for name in where.split(" -> ")}
    for lever in known:
        if lever.at and not any(name == lever.at or name.startswith(f"{lever.at}/") for name in blamed):
            race = lever.changed(race, lever.at_steps(min(together.steps + FREED, lever.steps_max)))
    return race
