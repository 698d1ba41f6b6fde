"""A flight with a reserve: margins so large that a race in disturbances breaks no limit with the probability asked for.

Margins follow from the linear covariance of the closed loop along the flight, which the margins change; so the race is
solved again with them until they stay. Closed-loop flights measure their effect. Where that is too little, or
much more than was asked for, the risk that is allocated is scaled by what was wanted over what was found.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from airrace.errors import InputError, UsageError
from airrace.inputs.objects import is_of_objects
from airrace.inputs.rules import FoundEntry, ReserveEntry
from airrace.planning.parameters import course_limits
from airrace.procedure.stage import Stage
from airrace.records import record
from airrace.runs.plan import Changes
from airrace.runs.run import RunState
from airrace.runs.safety_case import SafetyCase, scatter_of
from airrace.safety.monte_carlo import LOAD, Count, closed_loop_of
from airrace.safety.pilot import PilotModel
from airrace.safety.reserve import STALL, Allocation, Limit, allocate, lift_margin, limits_of
from airrace.sensitivity.lagrangian import sensitivities_to
from airrace.views.tables import Column, Table

FlyAgain = Callable[[RunState, Sequence[str]], RunState]
"""Flies a run again with some values set, as `key=value`."""


@record
class ReserveIteration:
    """The settings of the iteration.

    Attributes:
        attempts: how often a line is measured at most.
        passes: how often margins are computed again for one risk at most.
        same: the change of the race time by other margins below which they stay, s.
        tolerance: by how much the lower end of the interval of confidence may lie below the probability.
        excess: the share of the breaches that are allowed below which margins are too large.
        aim: the share of them that is aimed at.
        linear: how many times as many flights as predicted may break a limit before the stall is taken for the cause.
        lift: the share of the full margin of the lift coefficient that is added then.
        change: by how much the risk is scaled at most.
        flights: closed-loop flights.
    """

    attempts: int = 4
    passes: int = 3
    same: float = 2e-3
    tolerance: float = 0.01
    excess: float = 0.4
    aim: float = 0.8
    linear: float = 2.0
    lift: float = 0.5
    change: float = 8.0
    flights: int = 1000


SETTINGS = ReserveIteration()
REQUEST = ("probability", "load_factor", "found")
"""The keys of a reserve that are no options of closed-loop flights."""


@record
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
        return Count.among(outside.of - outside.flights, outside.of)

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


def fly_reserve(run: RunState, wanted: ReserveEntry, fly_again: FlyAgain, *, threads: int | None = None) -> ReserveCase:
    """Fly a race again with the smallest margins that keep a reserve.

    Args:
        run: certified up to six-dof.
        wanted: the probability and the disturbances.
        fly_again: flies a run with other margins.
        threads: None for one per processor.

    Raises:
        UsageError: the run is not certified up to six-dof, or the pilot cannot hold it.
        InputError: its course was built in Python.
    """
    if not run.certified or run.stages[-1].result.stage is not Stage.SIX_DOF:
        raise UsageError(f"a reserve takes a certified optimum of six-dof: {run.message or 'resume goes on to it'}")
    if run.inputs.margins:
        run = fly_again(run, UNSEARCHED)
    return _Search(run, wanted, fly_again, threads).run()


UNSEARCHED = ("rules.reserve=null", "margins=null")
"""What makes a race one without a reserve."""


class _Search:
    """The iteration for one reserve."""

    def __init__(self, run: RunState, wanted: ReserveEntry, fly_again: FlyAgain, threads: int | None) -> None:
        self.optimum, self.wanted, self.fly_again = run, wanted, fly_again
        self.options: dict[str, Any] = {**wanted.model_dump(exclude=set(REQUEST)), "threads": threads}
        errors = (wanted.mass_error_percent, wanted.power_error_percent, wanted.density_error_percent)
        self.scatter = scatter_of(wanted.gusts, (wanted.wind_error_kt, *errors, wanted.roll_timing_s))
        self.pilot = PilotModel(delay=wanted.delay_s)
        self.prices = _prices(run)
        self.risks = {"": 1.0 - wanted.probability}  # of all but the load factor, and of that
        if wanted.load_factor:
            self.risks[LOAD] = 1.0 - wanted.load_factor
        self.lift = 0.0  # the share of the full margin of the lift coefficient
        self.found: list[ReserveCase] = []

    def run(self) -> ReserveCase:
        latest = self.optimum
        for attempt in range(SETTINGS.attempts):
            enough, solved, limits = self._with_margins(latest)
            if solved is None:  # no flight with such margins
                self.risks = {kind: min(risk * SETTINGS.change, 0.5) for kind, risk in self.risks.items()}
                self.lift = max(self.lift - SETTINGS.lift, 0.0)
                continue
            if self.found and solved.inputs.margins == self.found[-1].run.inputs.margins:
                break
            latest = solved
            if self._is_done(self._measure(latest, limits, attempt), limits, enough=enough):
                break
        if not self.found:
            self._measure(self.optimum, self._limits(self.optimum), 0)
        reached = [one for one in self.found if one.reached]
        if reached:
            best = min(reached, key=lambda one: one.run.race_time)
        else:
            best = max(self.found, key=lambda one: one.measured.share)
        return best.stored()

    def _with_margins(self, latest: RunState) -> tuple[bool, RunState | None, list[Limit]]:
        """Fly with the margins that the risks need, until they stay.

        Returns:
            Whether such margins suffice, the flight, and its limits; None where there is no flight.
        """
        enough, limits = True, self._limits(latest)
        for _ in range(SETTINGS.passes):
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
            if change < SETTINGS.same:
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

    def _measure(self, latest: RunState, limits: Sequence[Limit], attempt: int) -> SafetyCase:
        """Fly a line in closed loop, each attempt in other disturbances, and note its effect."""
        case = latest.stages[-1].safety(flights=SETTINGS.flights, seed=attempt, **self.options)
        after, units = _prices(latest), {one.key: one.unit for one in course_limits(latest.inputs.race)}
        risks = [float(one.risk_now) for one in limits]
        margins = [
            KeptMargin(
                key,
                margin,
                units[key],
                0.5 * margin * (self.prices.get(key, 0.0) + after.get(key, 0.0)),
                sum(risk for one, risk in zip(limits, risks, strict=True) if one.key == key),
            )
            for key, margin in latest.inputs.margins.items()
            if margin > 0.0
        ]
        ignored = {STALL} if LOAD in self.risks else {STALL, LOAD}
        pairs = [(risk, one) for risk, one in zip(risks, limits, strict=True) if one.kind not in ignored]
        reached = all(_is_rare(count, risk) for count, risk in self._counts(case))
        self.found.append(
            ReserveCase(
                run=latest,
                wanted=self.wanted,
                optimum=self.optimum.race_time,
                margins=tuple(sorted(margins, key=lambda one: -one.cost)),
                predicted=max(1.0 - sum(risk for risk, one in pairs if one.kind != LOAD), 0.0),
                case=case,
                reached=reached,
                binding=() if reached else tuple(_limit_texts(pairs)),
            )
        )
        return case

    def _counts(self, case: SafetyCase) -> Iterator[tuple[Count, float]]:
        yield case.result.outside, 1.0 - self.wanted.probability
        if self.wanted.load_factor:
            yield case.result.counts[LOAD], 1.0 - self.wanted.load_factor

    def _is_done(self, case: SafetyCase, limits: Sequence[Limit], *, enough: bool) -> bool:
        """Tell whether flights break neither too much nor too little; else keep off the stall, or scale the risks.

        Args:
            case: the flights.
            limits: of what they follow.
            enough: whether margins sufficed for the risks.
        """
        found, outside = self.found[-1], case.result.outside
        if found.reached and not found.margins:
            return True
        scattered = outside.lower > SETTINGS.linear * (1.0 - found.predicted)
        if not found.reached and scattered and lift_margin(limits, self.pilot, self.lift + SETTINGS.lift):
            self.lift += SETTINGS.lift
            return False
        done = True
        for kind, (count, risk) in zip(self.risks, list(self._counts(case)), strict=True):
            allowed = _allowance(count, risk)
            if _is_rare(count, risk) and count.flights >= SETTINGS.excess * allowed:
                continue
            done = not enough  # smaller margins are no answer, and larger ones there are not
            factor = SETTINGS.aim * max(allowed, 0.5) / max(count.flights, 0.5)
            self.risks[kind] *= min(max(factor, 1.0 / SETTINGS.change), SETTINGS.change)
        return done


def _limit_texts(pairs: Sequence[tuple[float, Limit]]) -> list[str]:
    """Return the limits that are broken most probably, in words."""
    first = sorted((one for one in pairs if one[0] > 1e-3), key=lambda one: -one[0])
    return list(dict.fromkeys(f"{one.kind} at {one.place}" for _, one in first[:3]))


def _is_rare(count: Count, risk: float) -> bool:
    """Tell whether the interval of confidence of the flights that break a limit ends little above what is allowed."""
    return count.upper <= risk + SETTINGS.tolerance


def _allowance(count: Count, risk: float) -> int:
    """Return how many of the flights may break a limit; 0 where they are too few to tell."""
    most = math.floor(risk * count.of + 1e-9)
    return next((one for one in range(most, 0, -1) if _is_rare(Count.among(one, count.of), risk)), 0)


def _prices(run: RunState) -> dict[str, float]:
    """Return what margins cost, s per unit, by key."""
    inputs = run.inputs
    limits = {one.key: one for one in course_limits(inputs.race) if math.isfinite(one.value)}
    found: dict[str, float] = {}
    for one in sensitivities_to(limits.values(), inputs.race, inputs.settings, run.stages[-1].result):
        price = one.upward if limits[one.key].relaxing_step < 0.0 else -one.downward
        found[one.key] = max(price, 0.0) if math.isfinite(price) else 0.0
    return found
