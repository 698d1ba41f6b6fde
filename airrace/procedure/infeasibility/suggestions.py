"""The suggestions where a race has no flight: parameters that resolve a conflict alone, flown on the whole race first.

Rules and gates come first, for those are a race director's; then the aircraft, whose numbers may be as much to blame.
A suggestion that was certified in its trial is told before one that only flew.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence

from airrace.errors import InputError
from airrace.planning.race import Race
from airrace.procedure.infeasibility.elastic_solver import ElasticSolver, Relaxed
from airrace.procedure.infeasibility.relaxable import RelaxableParameter
from airrace.procedure.result import StageResult, SuggestedChange
from airrace.records import record


@record
class KindBudget:
    """The largest numbers of parameters of one kind that are considered for one conflict.

    Attributes:
        of_aircraft: the kind: whether they are the aircraft's, or those of rules and gates.
        alone_max: parameters that are relaxed alone.
        suggested_max: suggestions.
    """

    of_aircraft: bool
    alone_max: int
    suggested_max: int


OF_RULES = KindBudget(of_aircraft=False, alone_max=5, suggested_max=3)
OF_AIRCRAFT = KindBudget(of_aircraft=True, alone_max=3, suggested_max=2)
BUDGETS = (OF_RULES, OF_AIRCRAFT)
"""In the order in which they are tried and suggested."""
EFFORT_MAX = 4.0
"""The effort of the trials of a conflict (see `Flown`) after which none is repeated with a larger margin.

Without a certified flight the first one is repeated all the same.
"""
MARGINS = ((1.1, 0.2), (1.4, 0.5), (2.0, 2.0))
"""The factors on the least relaxation, and the usual steps on top, with which a suggestion is tried in turn.

The least relaxation is that of a coarse mesh, and a flight at the edge of what is possible needs very fine ones: with
ceilings of 182, 184, 187 and 190 m the half Cuban eight was certified on 4301, 1603, 1440 and 276 intervals; 179 m are
the least. Where a roll from one gate to the next takes 28 deg/s at least, 33 and 41 deg/s were not certified in 28 s,
65 deg/s in 2 s.
"""


@record
class Option:
    """A relaxable parameter that resolves a conflict alone, with the relaxed flight, and what relaxed it."""

    relaxable: RelaxableParameter
    relaxer: ElasticSolver
    relaxed: Relaxed

    @property
    def cost(self) -> float:
        """The change in usual steps."""
        return abs(self.relaxable.usual_steps(self.relaxable.at_steps(self.relaxed.steps)))

    @property
    def settable(self) -> bool:
        """Whether the inputs allow the value that it takes."""
        return self.relaxable.settable(self.value(MARGINS[0]))

    def value(self, margin: tuple[float, float]) -> float:
        """Return the value that is tried with a margin: see `MARGINS`."""
        factor, extra = margin
        return self.relaxable.rounded(self.relaxable.at_steps(factor * self.relaxed.steps + extra))

    def applied(self, race: Race) -> Race:
        """Return a race in which it resolves its conflict, with a margin to spare."""
        return self.relaxable.changed(race, self.value(MARGINS[1]))


@record
class Flown:
    """A trial of a race.

    Attributes:
        race_time: of its flight, s; None if it found none.
        certified: whether that is certified.
        effort: how much of what a trial may take (1) it took.
        result: the flight with all that is known of it; None where its meshes led to no end.
    """

    race_time: float | None
    certified: bool
    effort: float
    result: StageResult | None = None


NOTHING = Flown(None, certified=False, effort=0.0)
"""A trial that found no flight, without any effort."""
Fly = Callable[[Race, ElasticSolver, Relaxed], Flown]
"""A trial: flies a whole race, from its plan or near a relaxed flight."""


@record
class Tried:
    """An option that was tried with some value."""

    option: Option
    value: float
    flown: Flown

    def suggested_change(self, number: int, where: str) -> SuggestedChange:
        """Return it as a suggested change of a conflict with a number and a place."""
        relaxable, value, time = self.option.relaxable, self.value, self.flown.race_time
        assert time is not None  # else it is no suggested change
        key = relaxable.key if relaxable.settable(value) else ""
        return SuggestedChange(number, where, key, relaxable.told, relaxable.unit, relaxable.value, value, time)


@record
class Trials:
    """Trials of the options of one conflict.

    Attributes:
        race: without a flight.
        fly: what flies it.
        others: the first options of the other conflicts, which are resolved meanwhile.
    """

    race: Race
    fly: Fly
    others: Sequence[Option] = ()

    def flown(self, options: Sequence[Option]) -> list[Tried]:
        """Return the options that flew, those that were certified first.

        All are tried with the least margin before any is tried with larger ones. Where none is certified, the largest
        that flew is told, for it is the likeliest to be certified in the end.
        """
        found: list[Tried] = []
        tried = [one for budget in BUDGETS for one in self._with_least_margin(options, budget)]
        effort = sum(one.flown.effort for one in tried)
        certified = any(one.flown.certified for one in tried)
        for one in tried:
            last = one
            for margin in MARGINS[1:]:
                if last.flown.certified or (effort > EFFORT_MAX and (certified or one is not tried[0])):
                    break
                milder = self._trial(one.option, margin)
                effort += milder.flown.effort
                last = last if milder.flown.race_time is None else milder
            certified = certified or last.flown.certified
            if last.flown.race_time is not None:
                found.append(last)
        return sorted(found, key=lambda one: not one.flown.certified)

    def _with_least_margin(self, options: Iterable[Option], budget: KindBudget) -> Iterator[Tried]:
        """Yield the options of one kind as they were tried, until enough of them flew."""
        flown = 0
        for option in options:
            if option.relaxable.of_aircraft is budget.of_aircraft and flown < budget.suggested_max:
                tried = self._trial(option, MARGINS[0])
                flown += tried.flown.race_time is not None
                yield tried

    def _trial(self, option: Option, margin: tuple[float, float]) -> Tried:
        value = option.value(margin)
        race = option.relaxable.changed(self.race, value)
        for other in self.others:
            race = other.applied(race)
        try:
            return Tried(option, value, self.fly(race, option.relaxer, option.relaxed))
        except InputError:  # the inputs do not allow this value
            return Tried(option, value, NOTHING)
