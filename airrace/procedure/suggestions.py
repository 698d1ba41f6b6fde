"""What is suggested where a race has no flight: levers that resolve a conflict alone, flown on the whole race first.

Rules and gates come first, for those are a race director's; then the aircraft, whose numbers may be as much to blame.
A suggestion that was certified in its trial is told before one that only flew.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

from airrace.errors import InputError
from airrace.planning.race import Race
from airrace.procedure.lever import Lever
from airrace.procedure.relaxation import Relaxed, Relaxer
from airrace.procedure.result import Remedy, StageResult

TOLD_MAX = {False: 3, True: 2}
"""The largest number of suggestions that are told of one conflict: those of rules and gates, those of the aircraft."""
WORK_MAX = {False: 8e4, True: 4e4}
"""The work of trials (iterations times intervals) after which no further suggestion of the same kind is tried.

A flight of Abu Dhabi 2016 that is certified takes 4e4, and 1.5 s.
"""
MARGINS = ((1.1, 0.2), (1.4, 0.5))
"""The factors on the least relaxation, and the usual steps on top, with which a suggestion is tried in turn.

The least relaxation is that of a coarse mesh, and a flight at the edge of what is possible needs very fine ones: with
ceilings of 182, 184, 187 and 190 m the half Cuban eight was certified on 4301, 1603, 1440 and 276 intervals; 179 m are
the least.
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

    def applied(self, race: Race) -> Race:
        """Return a race in which it resolves its conflict, with the largest margin."""
        return self.lever.changed(race, self.value(MARGINS[-1]))


@dataclass(frozen=True)
class Flown:
    """A trial of a race.

    Attributes:
        race_time: of its flight, s; None if it found none.
        certified: whether that is certified.
        work: what it took: iterations times intervals.
        result: the flight with all that is known of it; None where its meshes led to no end.
    """

    race_time: float | None
    certified: bool
    work: float
    result: StageResult | None = None


Fly = Callable[[Race, Relaxer, Relaxed], Flown]
"""A trial: flies a whole race, from its plan or near a relaxed flight."""


@dataclass(frozen=True)
class Trials:
    """Trials of the options of one conflict.

    Attributes:
        race: without a flight.
        fly: what flies it.
        number: that of the conflict.
        where: its place.
        others: the first options of the other conflicts, which are resolved meanwhile.
    """

    race: Race
    fly: Fly
    number: int
    where: str
    others: Sequence[Option] = ()

    def remedies(self, options: Iterable[Option]) -> list[Remedy]:
        """Return the options that flew, those that were certified first; one without words where none did."""
        tried = [one for of_aircraft in TOLD_MAX for one in self._tried(options, of_aircraft=of_aircraft)]
        nothing = Remedy(self.number, self.where, "", "", "", 0.0, 0.0, 0.0)
        return [remedy for remedy, _ in sorted(tried, key=lambda one: not one[1])] or [nothing]

    def _tried(self, options: Iterable[Option], *, of_aircraft: bool) -> Iterator[tuple[Remedy, bool]]:
        """Yield the options of one kind that flew, and whether they were certified."""
        told, spent = 0, 0.0
        for option in options:
            if option.lever.of_aircraft is not of_aircraft:
                continue
            if told == TOLD_MAX[of_aircraft] or spent > WORK_MAX[of_aircraft]:
                return
            value, flown, work = self._trial(option)
            spent += work
            if flown is not None and flown.race_time is not None:
                told += 1
                yield self._remedy(option.lever, value, flown.race_time), flown.certified

    def _trial(self, option: Option) -> tuple[float, Flown | None, float]:
        """Return the least value of an option with which a flight was certified, its flight, and the work of that.

        Where none was certified, it is the mildest value that flew, which is the likeliest to be certified in the end.
        """
        lever, spent, best = option.lever, 0.0, None
        value = lever.value
        for tried in dict.fromkeys(option.value(margin) for margin in MARGINS):
            race = lever.changed(self.race, tried)
            for other in self.others:
                race = other.applied(race)
            try:
                flown = self.fly(race, option.relaxer, option.relaxed)
            except InputError:
                continue  # the inputs do not allow this value
            spent += flown.work
            if flown.race_time is not None:
                value, best = tried, flown
            if flown.certified:
                break
        return value, best, spent

    def _remedy(self, lever: Lever, value: float, race_time: float) -> Remedy:
        key = lever.key if lever.settable(value) else ""
        return Remedy(self.number, self.where, key, lever.told, lever.unit, lever.value, value, race_time)
