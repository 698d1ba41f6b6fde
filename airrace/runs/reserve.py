"""A flight with a reserve: margins so large that a race in disturbances breaks no limit with the probability asked for.

Margins follow from the linear covariance of the closed loop along the flight, which the margins change; so the race is
solved again with them until they stay. Closed-loop flights measure their effect. Where that is too little, or
much more than was asked for, the risk that is allocated is scaled by what was wanted over what was found.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from airrace.errors import CheckpointError, InputError, UsageError
from airrace.files.checkpoint import ReserveAttempt
from airrace.files.inputs.objects import is_of_objects
from airrace.files.inputs.rules import FoundEntry, ReserveEntry
from airrace.flights.safety.monte_carlo import LOAD, Count, closed_loop_of
from airrace.flights.safety.pilot import PilotModel
from airrace.flights.safety.reserve import STALL, Allocation, Limit, allocate, lift_margin, limits_of
from airrace.flights.sensitivity.lagrangian import sensitivities
from airrace.pages.views.tables import Column, Table
from airrace.procedure.planning.parameters import course_limits
from airrace.procedure.stage import Stage
from airrace.runs.plan import Changes
from airrace.runs.reserve_attempts import ATTEMPTS_MAX, asked_text
from airrace.runs.run import RunState
from airrace.runs.safety_case import SafetyCase, scatter_of

FlyAgain = Callable[[RunState, Sequence[str]], RunState]
"""Flies a run again with some values set, as `key=value`."""
Keep = Callable[[ReserveAttempt, RunState | None], None]
"""Keeps a finished attempt with the run that it has flown, None where there is no flight with such margins."""


ALLOCATION_ITERATIONS_MAX = 3
"""How often margins are computed again for one risk at most."""
RACE_TIME_CONVERGENCE = 2e-3
"""The change of the race time by other margins below which they stay, s."""
CONFIDENCE_TOLERANCE = 0.01
"""By how much the lower end of the interval of confidence may lie below the probability."""
EXCESS_MARGIN_SHARE = 0.4
"""The share of the breaches that are allowed below which margins are too large."""
TARGET_SHARE = 0.8
"""The share of them that is aimed at."""
NONLINEARITY_FACTOR = 2.0
"""How many times as many flights as predicted may break a limit before the stall is taken for the cause."""
LIFT_STEP = 0.5
"""The share of the full margin of the lift coefficient that is added then."""
RISK_CHANGE_MAX = 8.0
"""By how much the risk is scaled at most."""
FLIGHTS = 1000
"""Closed-loop flights."""
REQUEST = ("probability", "load_factor", "found")
"""The keys of a reserve that are no options of closed-loop flights."""


@dataclass(frozen=True)
class KeptMargin:
    """A margin of a flight.

    Attributes:
        key: of the limit.
        margin: in its unit.
        unit: of the limit.
        cost: of race time, by the sensitivities with and without margins, s.
        risk: that one of the limits behind the key is broken, by the covariance.
    """

    key: str
    margin: float
    unit: str
    cost: float
    risk: float


COLUMNS = (
    Column("limit", key="key"),
    Column("margin", form=".3g", key="margin"),
    Column("unit", key="unit"),
    Column("cost", "s", ".3f", key="cost_s"),
    Column("risk left", "%", ".3f", key="risk_percent"),
)


@dataclass(frozen=True, repr=False)
class ReserveCase:
    """A flight with a reserve, and its effect.

    Attributes:
        run: the flight with its margins.
        wanted: what was asked for.
        optimum: race time without margins, s.
        margins: of the flight, the costliest first.
        predicted: probability of no breach but of the load factor, at least, by the linear covariance.
        case: closed-loop flights along it.
        reached: whether that is what was asked for.
        binding: the limits that hinder more, where it is not.
    """

    run: RunState
    wanted: ReserveEntry
    optimum: float
    margins: tuple[KeptMargin, ...]
    predicted: float
    case: SafetyCase
    reached: bool
    binding: tuple[str, ...] = ()

    def stored(self) -> "ReserveCase":
        """Return this with a run that says what was asked for and found."""
        measured = self.measured
        found = FoundEntry(
            measured=round(measured.share, 4), lower=round(measured.lower, 4), flights=measured.of, reached=self.reached
        )
        texts = self.wanted.model_copy(update={"found": found}).texts()
        return replace(self, run=self.run.with_inputs(Changes(overrides=texts).inputs(self.run)))

    @property
    def measured(self) -> Count:
        """The flights that break nothing but perhaps the load factor."""
        outside = self.case.result.outside
        return Count.with_interval(outside.of - outside.flights, outside.of)

    @property
    def message(self) -> str:
        """A sentence where the probability was not reached; else empty."""
        if self.reached:
            return ""
        why = f"; {', '.join(self.binding)} hinder more" if self.binding else ""
        return (
            f"a reserve of {self.wanted.probability:g} was not reached: the most is {self.measured.share:.3f} "
            f"({self.measured.lower:.3f} to {self.measured.upper:.3f}){why}"
        )

    def table(self) -> Table:
        """Return the margins with their costs."""
        measured, time, loads = self.measured, self.run.race_time, self.case.result.counts[LOAD]
        rows = [[one.key, one.margin, one.unit, one.cost, 100.0 * one.risk] for one in self.margins]
        notes = [
            f"of {measured.of} closed-loop flights {measured.flights} break nothing but perhaps the load factor: "
            f"{measured.share:.3f} ({measured.lower:.3f} to {measured.upper:.3f}); asked {self.wanted.probability:g}, "
            f"predicted at least {self.predicted:.3f}; {loads.flights} exceed the load factor",
            f"cost: by the sensitivities at both ends; {sum(one.cost for one in self.margins):.3f} s in all",
        ]
        title = f"reserve {self.wanted.probability:g}: {time:.3f} s, {time - self.optimum:+.3f} s to the optimum"
        return Table(title, COLUMNS, rows, [*notes, *([self.message] if self.message else [])])

    def as_object(self) -> dict[str, object]:
        """Return plain values for scripts."""
        return {
            "probability": self.wanted.probability,
            "reached": self.reached,
            "predicted": self.predicted,
            "measured": self.measured.share,
            "measured_lower": self.measured.lower,
            "measured_upper": self.measured.upper,
            "race_time_s": self.run.race_time,
            "optimum_s": self.optimum,
            "cost_s": self.run.race_time - self.optimum,
            "margins": self.table().objects(),
            "binding": list(self.binding),
            "safety": self.case.as_object(),
        }

    def __repr__(self) -> str:
        table = self.table()
        return f"{table.title}\n{table.text()}"

    def _repr_html_(self) -> str:
        return self.table().html()


def reserve_named(run: RunState, texts: Sequence[str]) -> ReserveEntry:
    """Return the reserve of a run whose rules had these values, `key=value`.

    Raises:
        InputError: they make no sense.
    """
    if is_of_objects(run.inputs.track):
        raise UsageError("margins have keys in files alone: this course was built in Python")
    wanted = Changes(overrides=["margins=null", "rules.reserve=null", *texts]).inputs(run).reserve
    assert wanted is not None  # its texts say so
    return wanted


def fly_reserve(
    run: RunState,
    wanted: ReserveEntry,
    fly_again: FlyAgain,
    *,
    threads: int | None = None,
    keep: Keep = lambda attempt, flown: None,
    tell: Callable[[str], None] = lambda text: None,
) -> ReserveCase:
    """Fly a race again with the smallest margins that keep a reserve.

    Attempts that the run holds for this reserve are not made again.

    Args:
        run: certified up to six-dof.
        wanted: the probability and the disturbances.
        fly_again: flies a run with other margins.
        threads: None for one per processor.
        keep: keeps every attempt that is finished.
        tell: receives a line about every attempt.

    Raises:
        UsageError: the run is not certified up to six-dof, or the pilot cannot hold it.
        InputError: its course was built in Python.
        CheckpointError: the flights of an attempt that the run holds break more or less than it says.
    """
    if not run.certified or run.stages[-1].result.stage is not Stage.SIX_DOF:
        raise UsageError(f"a reserve takes a certified optimum of six-dof: {run.message or 'resume goes on to it'}")
    if run.inputs.margins:
        run = fly_again(run, UNSEARCHED)
    return _Search(run, wanted, fly_again, threads, keep, tell).run()


UNSEARCHED = ("rules.reserve=null", "margins=null")
"""What makes a race one without a reserve."""


@dataclass(frozen=True)
class _Measured:
    """An attempt that has found a flight.

    Attributes:
        number: of the attempt, from 0, by which its disturbances are drawn.
        run: the flight with its margins.
        outside, over_load: the flights that break a limit other than the load factor, and that exceed the load factor.
        reached: whether these are as few as was asked for.
        case: the flights; None where they were flown before this search went on.
    """

    number: int
    run: RunState
    outside: Count
    over_load: Count
    reached: bool
    case: SafetyCase | None


class _Search:
    """The iteration for one reserve."""

    def __init__(
        self,
        run: RunState,
        wanted: ReserveEntry,
        fly_again: FlyAgain,
        threads: int | None,
        keep: Keep,
        tell: Callable[[str], None],
    ) -> None:
        self.optimum, self.wanted, self.fly_again, self.keep, self.tell = run, wanted, fly_again, keep, tell
        self.asked = asked_text(wanted)
        self.options: dict[str, Any] = {**wanted.model_dump(exclude=set(REQUEST)), "threads": threads}
        errors = (wanted.mass_error_percent, wanted.power_error_percent, wanted.density_error_percent)
        self.scatter = scatter_of(wanted.gusts, (wanted.wind_error_kt, *errors, wanted.roll_timing_s))
        self.pilot = PilotModel(delay=wanted.delay_s)
        self.prices = _prices(run)
        self.risks = {"": 1.0 - wanted.probability}  # of all but the load factor, and of that
        if wanted.load_factor:
            self.risks[LOAD] = 1.0 - wanted.load_factor
        self.lift = 0.0  # the share of the full margin of the lift coefficient
        self.found: list[_Measured] = []

    def run(self) -> ReserveCase:
        done, first = self._take_up()
        attempt = first
        while not done and attempt < ATTEMPTS_MAX:
            self.tell(f"{self._name(attempt)}: begins")
            done = self._attempt(attempt)
            attempt += 1
        if not self.found:
            self._measure(self.optimum, 0)
        reached = [one for one in self.found if one.reached]
        if reached:
            best = min(reached, key=lambda one: one.run.race_time)
        else:
            best = max(self.found, key=lambda one: one.outside.of - one.outside.flights)
        return self._case_of(best).stored()

    def _take_up(self) -> tuple[bool, int]:
        """Take up the attempts that the run holds; return whether none is left, and the number of the next."""
        kept = self.optimum.checkpoint.standing_attempts(self.asked)
        for number, stored in enumerate(kept):
            one, flown = stored.attempt, self.optimum.attempt_run(stored)
            if flown is not None:
                outside, over_load = (Count.with_interval(few, one.flights) for few in (one.outside, one.over_load))
                self._note(number, flown, outside, over_load, None)
            self.risks = dict(zip(self.risks, (one.risk, one.load_risk), strict=False))
            self.lift = one.lift
            self.tell(f"{self._name(number)}: kept, not made again")
        return bool(kept) and kept[-1].attempt.done, len(kept)

    def _attempt(self, number: int) -> bool:
        """Make an attempt and keep it; return whether none follows."""
        enough, solved, limits = self._with_margins(self.found[-1].run if self.found else self.optimum)
        if solved is None:  # no flight with such margins
            self.risks = {kind: min(risk * RISK_CHANGE_MAX, 0.5) for kind, risk in self.risks.items()}
            self.lift = max(self.lift - LIFT_STEP, 0.0)
            self.keep(self._record(None, done=False), None)
            self.tell(f"{self._name(number)}: no flight with such margins")
            return False
        if self.found and solved.inputs.margins == self.found[-1].run.inputs.margins:
            return True
        latest = self._measure(solved, number)
        done = self._is_done(latest, limits, enough=enough)
        self.keep(self._record(latest, done=done), solved)
        within = latest.outside.of - latest.outside.flights
        self.tell(f"{self._name(number)}: {solved.race_time:.3f} s, {within} of {latest.outside.of} flights keep it")
        return done

    def _name(self, number: int) -> str:
        return f"reserve {self.wanted.probability:g}, attempt {number + 1} of {ATTEMPTS_MAX}"

    def _record(self, measured: _Measured | None, *, done: bool) -> ReserveAttempt:
        counts = (0, 0, 0)
        if measured is not None:
            counts = measured.outside.of, measured.outside.flights, measured.over_load.flights
        return ReserveAttempt(self.asked, *counts, self.risks[""], self.risks.get(LOAD, 0.0), self.lift, done)

    def _with_margins(self, latest: RunState) -> tuple[bool, RunState | None, list[Limit]]:
        """Fly with the margins that the risks need, until they stay.

        Returns:
            Whether such margins suffice, the flight, and its limits; None where there is no flight.
        """
        enough, limits = True, self._limits(latest)
        for _ in range(ALLOCATION_ITERATIONS_MAX):
            allocations = self._allocate(limits, _prices(latest))
            margins = {key: value for one in allocations for key, value in one.margins.items()}
            lift = lift_margin(limits, self.pilot, self.lift)
            margins |= {"rules.C_L_max": lift} if lift else {}
            enough = all(one.reaches for one in allocations)
            values = [f"margins.{key}={value:.4g}" for key, value in sorted(margins.items())]
            if not values and not latest.inputs.margins:
                break
            try:
                after = self.fly_again(latest, [*UNSEARCHED, *values])
                limits = self._limits(after) if after.certified else []
            except (InputError, UsageError):  # no room between limits; a flight that no pilot can hold
                return enough, None, []
            if not after.certified:
                return enough, None, []
            change, latest = abs(after.race_time - latest.race_time), after
            if change < RACE_TIME_CONVERGENCE:
                break
        return enough, latest, limits

    def _limits(self, latest: RunState) -> list[Limit]:
        race, result = latest.inputs.race.by_rules, latest.stages[-1].result
        return limits_of(race, result, closed_loop_of(race, result, self.pilot), self.scatter, latest.inputs.margins)

    def _allocate(self, limits: Sequence[Limit], prices: Mapping[str, float]) -> list[Allocation]:
        judged = [one for one in limits if one.kind != STALL]
        return [
            allocate([one for one in judged if (one.kind == LOAD) is (kind == LOAD)], prices, risk)
            for kind, risk in self.risks.items()
        ]

    def _measure(self, latest: RunState, number: int) -> _Measured:
        """Fly a line in closed loop, each attempt in other disturbances, and note its effect."""
        case = self._fly(latest, number)
        return self._note(number, latest, case.result.outside, case.result.counts[LOAD], case)

    def _fly(self, latest: RunState, number: int) -> SafetyCase:
        return latest.stages[-1].safety(flights=FLIGHTS, seed=number, **self.options)

    def _note(self, number: int, run: RunState, outside: Count, over_load: Count, case: SafetyCase | None) -> _Measured:
        reached = all(_is_rare(count, risk) for count, risk in self._counts(outside, over_load))
        self.found.append(_Measured(number, run, outside, over_load, reached, case))
        return self.found[-1]

    def _case_of(self, best: _Measured) -> ReserveCase:
        """Return what was found in full.

        Raises:
            CheckpointError: the flights of an attempt that was kept break more or less than it says.
        """
        case = best.case or self._fly(best.run, best.number)
        if (case.result.outside, case.result.counts[LOAD]) != (best.outside, best.over_load):
            raise CheckpointError(
                f"{self._name(best.number)} is not what was stored: {case.result.outside.flights} flights break a "
                f"limit where it says {best.outside.flights}; `airrace resume --from six-dof` makes all attempts again"
            )
        limits, after = self._limits(best.run), _prices(best.run)
        units = {one.key: one.unit for one in course_limits(best.run.inputs.race)}
        pairs = self._risks_of(limits)
        margins = [
            KeptMargin(
                key,
                margin,
                units[key],
                0.5 * margin * (self.prices.get(key, 0.0) + after.get(key, 0.0)),
                sum(float(one.risk_now) for one in limits if one.key == key),
            )
            for key, margin in best.run.inputs.margins.items()
            if margin > 0.0
        ]
        return ReserveCase(
            run=best.run,
            wanted=self.wanted,
            optimum=self.optimum.race_time,
            margins=tuple(sorted(margins, key=lambda one: -one.cost)),
            predicted=_predicted(pairs),
            case=case,
            reached=best.reached,
            binding=() if best.reached else tuple(_limit_texts(pairs)),
        )

    def _risks_of(self, limits: Sequence[Limit]) -> list[tuple[float, Limit]]:
        """Return the risks that remain of the limits that are judged."""
        ignored = {STALL} if LOAD in self.risks else {STALL, LOAD}
        return [(float(one.risk_now), one) for one in limits if one.kind not in ignored]

    def _counts(self, outside: Count, over_load: Count) -> Iterator[tuple[Count, float]]:
        yield outside, 1.0 - self.wanted.probability
        if self.wanted.load_factor:
            yield over_load, 1.0 - self.wanted.load_factor

    def _is_done(self, latest: _Measured, limits: Sequence[Limit], *, enough: bool) -> bool:
        """Tell whether flights break neither too much nor too little; else keep off the stall, or scale the risks.

        Args:
            latest: the flights.
            limits: of what they follow.
            enough: whether margins sufficed for the risks.
        """
        if latest.reached and not any(latest.run.inputs.margins.values()):
            return True
        scattered = latest.outside.lower > NONLINEARITY_FACTOR * (1.0 - _predicted(self._risks_of(limits)))
        if not latest.reached and scattered and lift_margin(limits, self.pilot, self.lift + LIFT_STEP):
            self.lift += LIFT_STEP
            return False
        done = True
        counts = list(self._counts(latest.outside, latest.over_load))
        for kind, (count, risk) in zip(self.risks, counts, strict=True):
            allowed = _allowance(count, risk)
            if _is_rare(count, risk) and count.flights >= EXCESS_MARGIN_SHARE * allowed:
                continue
            done = not enough  # smaller margins are no answer, and larger ones there are not
            factor = TARGET_SHARE * max(allowed, 0.5) / max(count.flights, 0.5)
            self.risks[kind] *= min(max(factor, 1.0 / RISK_CHANGE_MAX), RISK_CHANGE_MAX)
        return done


def _predicted(pairs: Sequence[tuple[float, Limit]]) -> float:
    """Return the probability of no breach but of the load factor, at least, by the linear covariance."""
    return max(1.0 - sum(risk for risk, one in pairs if one.kind != LOAD), 0.0)


def _limit_texts(pairs: Sequence[tuple[float, Limit]]) -> list[str]:
    """Return the limits that are broken most probably, in words."""
    first = sorted((one for one in pairs if one[0] > 1e-3), key=lambda one: -one[0])
    return list(dict.fromkeys(f"{one.kind} at {one.place}" for _, one in first[:3]))


def _is_rare(count: Count, risk: float) -> bool:
    """Tell whether the interval of confidence of the flights that break a limit ends little above what is allowed."""
    return count.upper <= risk + CONFIDENCE_TOLERANCE


def _allowance(count: Count, risk: float) -> int:
    """Return how many of the flights may break a limit; 0 where they are too few to tell."""
    most = math.floor(risk * count.of + 1e-9)
    return next((one for one in range(most, 0, -1) if _is_rare(Count.with_interval(one, count.of), risk)), 0)


def _prices(run: RunState) -> dict[str, float]:
    """Return what margins cost, s per unit, by key."""
    inputs = run.inputs
    limits = {one.key: one for one in course_limits(inputs.race) if math.isfinite(one.value)}
    found: dict[str, float] = {}
    for one in sensitivities(limits.values(), inputs.race, inputs.settings, run.stages[-1].result):
        price = one.upward if limits[one.key].relaxing_step < 0.0 else -one.downward
        found[one.key] = max(price, 0.0) if math.isfinite(price) else 0.0
    return found
