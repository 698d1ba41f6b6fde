"""A flight with a reserve: margins so large that a race in disturbances breaks no limit with the probability asked for.

Margins follow from the linear covariance of the closed loop along the flight, which the margins change; so the race is
solved again with them until they converge. Closed-loop flights measure their effect. Where that is too little or far
too much, the allocated risk is scaled by the ratio of allowed to observed breaches. The covariance knows the load
factor of one instant, where a pull has many of them and a rule may ask for some time of it; so its risk has a weight,
the ratio of observed to predicted pulls that count beside that of all other breaches.
"""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from airrace.errors import CheckpointError, InputError, UsageError
from airrace.files.checkpoint import ReserveAttempt
from airrace.files.inputs.objects import is_of_objects
from airrace.files.inputs.rules import FoundEntry, ReserveEntry
from airrace.flights.safety.disturbances import Disturbances
from airrace.flights.safety.monte_carlo import LOAD, OVER_G, Count, SafetyResult, closed_loop_of
from airrace.flights.safety.pilot import PilotModel
from airrace.flights.safety.reserve import STALL, Limit, allocate, lift_margin, limits_of
from airrace.flights.sensitivity.lagrangian import sensitivities
from airrace.pages.views.count_view import duration_text
from airrace.pages.views.tables import Column, Table
from airrace.procedure.planning.parameters import course_limits
from airrace.procedure.stage import Stage
from airrace.runs.execution_plan import Changes
from airrace.runs.reserve_attempts import ATTEMPTS_MAX, asked_text
from airrace.runs.run_state import RunState
from airrace.runs.safety_case import SafetyCase, scatter_of

FlyAgain = Callable[[RunState, Sequence[str]], RunState]
"""Flies a run again with some values set, as `key=value`."""
Keep = Callable[[ReserveAttempt, RunState | None], None]
"""Stores a finished attempt with its run, None where no flight has such margins."""
Show = Callable[[str, int, int], None]
"""Shows a line, and how much of how much is done."""

ALLOCATION_ITERATIONS_MAX = 3
"""Maximum number of margin allocations for one risk."""
RACE_TIME_CONVERGENCE = 2e-3
"""Change of the race time below which the margins have converged, s."""
CONFIDENCE_TOLERANCE = 0.01
"""How far the lower end of the confidence interval may lie below the probability."""
EXCESS_MARGIN_SHARE = 0.4
"""Margins are too large where fewer than this share of the allowed breaches occurs."""
TARGET_SHARE = 0.8
"""Target share of the allowed breaches."""
NONLINEARITY_FACTOR = 2.0
"""Ratio of observed to predicted breaches above which the stall is taken for the cause."""
LIFT_STEP = 0.5
"""Share of the full margin of the lift coefficient that is added then."""
RISK_CHANGE_MAX = 8.0
"""Largest factor of one change of the risk, and of the weight of the load factor."""
FLIGHTS = 1000
"""Closed-loop flights."""
REQUEST = ("probability", "load_factor", "found")
"""Keys of a reserve that are no options of closed-loop flights."""


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
        request: what was asked for.
        optimum: race time without margins, s.
        margins: of the flight, the costliest first.
        predicted: probability of no breach, at least, by the linear covariance.
        case: closed-loop flights along it.
        reached: whether that is what was asked for.
        binding: the limits that hinder more, where it is not.
    """

    run: RunState
    request: ReserveEntry
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
        texts = self.request.model_copy(update={"found": found}).texts()
        return replace(self, run=self.run.with_inputs(Changes(overrides=texts).inputs(self.run)))

    @property
    def measured(self) -> Count:
        """The flights that break nothing that is judged."""
        broken = judged(self.request, self.case.result)
        return Count.with_interval(broken.of - broken.flights, broken.of)

    @property
    def message(self) -> str:
        """A sentence where the probability was not reached; else empty."""
        if self.reached:
            return ""
        why = f"; {', '.join(self.binding)} hinder more" if self.binding else ""
        return (
            f"a reserve of {self.request.probability:g} was not reached: the most is {self.measured.share:.3f} "
            f"({self.measured.lower:.3f} to {self.measured.upper:.3f}){why}"
        )

    def table(self) -> Table:
        """Return the margins with their costs."""
        measured, time, result = self.measured, self.run.race_time, self.case.result
        nothing = "nothing" if self.request.load_factor else "nothing but perhaps the load factor"
        rows = [[margin.key, margin.margin, margin.unit, margin.cost, 100.0 * margin.risk] for margin in self.margins]
        notes = [
            f"of {measured.of} closed-loop flights {measured.flights} break {nothing}: "
            f"{measured.share:.3f} ({measured.lower:.3f} to {measured.upper:.3f}); asked {self.request.probability:g}, "
            f"predicted at least {self.predicted:.3f}",
            f"over-g: {result.load_rule.text}; in {result.counts[OVER_G].flights} flights, {result.pulls} pulls in all",
            f"cost: by the sensitivities at both ends; {sum(margin.cost for margin in self.margins):.3f} s in all",
        ]
        title = f"reserve {self.request.probability:g}: {time:.3f} s, {time - self.optimum:+.3f} s to the optimum"
        return Table(title, COLUMNS, rows, [*notes, *([self.message] if self.message else [])])

    def as_object(self) -> dict[str, object]:
        """Return plain values for scripts."""
        return {
            "probability": self.request.probability,
            "load_factor": self.request.load_factor,
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
        InputError: they are not valid.
    """
    if is_of_objects(run.inputs.track):
        raise UsageError("margins have keys in files alone: this course was built in Python")
    request = Changes(overrides=["margins=null", "rules.reserve=null", *texts]).inputs(run).reserve
    assert request is not None  # its texts say so
    return request


def fly_reserve(
    run: RunState,
    request: ReserveEntry,
    fly_again: FlyAgain,
    *,
    threads: int | None = None,
    keep: Keep = lambda attempt, flown: None,
    tell: Callable[[str], None] = lambda text: None,
    show: Show = lambda text, done, total: None,
) -> ReserveCase:
    """Fly a race again with the smallest margins that keep a reserve.

    Attempts that the run holds for this reserve are not made again.

    Args:
        run: certified up to six-dof.
        request: the probability and the disturbances.
        fly_again: flies a run with other margins.
        threads: None for one per processor.
        keep: keeps every attempt that is finished.
        tell: receives a line about every attempt.
        show: receives how far the flights of an attempt are, again and again; an error that it raises ends the search.

    Raises:
        UsageError: the run is not certified up to six-dof, or the pilot cannot hold it.
        InputError: its course was built in Python.
        CheckpointError: the flights of an attempt that the run holds break more or less than it says.
    """
    if not run.certified or run.stages[-1].result.stage is not Stage.SIX_DOF:
        raise UsageError(f"a reserve takes a certified optimum of six-dof: {run.message or 'resume goes on to it'}")
    if run.inputs.margins:
        run = fly_again(run, UNSEARCHED)
    return _Search(run, request, fly_again, threads, keep, tell, show).run()


UNSEARCHED = ("rules.reserve=null", "margins=null")
"""Overrides that remove a reserve from a race."""


@dataclass(frozen=True)
class _Measured:
    """An attempt that has found a flight.

    Attributes:
        number: of the attempt, from 0, by which its disturbances are drawn.
        run: the flight with its margins.
        broken: the flights that break what is judged.
        outside, over_g: those that break a limit other than the load factor, and those with a pull that counts.
        reached: whether `broken` are as few as was asked for.
        case: the flights; None where they were flown before this search went on.
    """

    number: int
    run: RunState
    broken: Count
    outside: Count
    over_g: Count
    reached: bool
    case: SafetyCase | None


class _Search:
    """The iteration for one reserve."""

    def __init__(
        self,
        run: RunState,
        request: ReserveEntry,
        fly_again: FlyAgain,
        threads: int | None,
        keep: Keep,
        tell: Callable[[str], None],
        show: Show,
    ) -> None:
        self.optimum, self.request, self.fly_again, self.keep, self.tell = run, request, fly_again, keep, tell
        self.show = show
        self.asked = asked_text(request)
        self.options: dict[str, Any] = {**request.model_dump(exclude=set(REQUEST)), "threads": threads}
        self.scatter = scatter_of(Disturbances.of_reserve(request))
        self.pilot = PilotModel(delay=request.delay_s)
        self.prices = _prices(run)
        self.allowed = 1.0 - request.probability
        self.risk, self.load_weight = self.allowed, 1.0
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
        sufficient = [flight for flight in self.found if flight.reached]
        if sufficient:
            best = min(sufficient, key=lambda flight: flight.run.race_time)
        else:
            best = min(self.found, key=lambda flight: flight.broken.flights)
        return self._case_of(best).stored()

    def _take_up(self) -> tuple[bool, int]:
        """Restore the attempts that the run holds; return whether none is left, and the number of the next."""
        attempts = self.optimum.checkpoint.standing_attempts(self.asked)
        for number, stored_attempt in enumerate(attempts):
            attempt, flight = stored_attempt.attempt, self.optimum.attempt_run(stored_attempt)
            if flight is not None:
                flights = (attempt.broken, attempt.outside, attempt.over_g)
                broken, outside, over_g = (Count.with_interval(count, attempt.flights) for count in flights)
                self._note(number, flight, broken, outside, over_g, None)
            self.risk, self.load_weight, self.lift = attempt.risk, attempt.load_weight, attempt.lift
            self.tell(f"{self._name(number)}: kept, not made again")
        return bool(attempts) and attempts[-1].attempt.done, len(attempts)

    def _attempt(self, number: int) -> bool:
        """Make an attempt and store it; return whether it is the last."""
        enough, latest_run, limits = self._with_margins(self.found[-1].run if self.found else self.optimum)
        if latest_run is None:  # no flight with such margins
            self.risk = min(self.risk * RISK_CHANGE_MAX, 0.5)
            self.lift = max(self.lift - LIFT_STEP, 0.0)
            self.keep(self._record(None, done=False), None)
            self.tell(f"{self._name(number)}: no flight with such margins")
            return False
        if self.found and latest_run.inputs.margins == self.found[-1].run.inputs.margins:
            return True
        latest = self._measure(latest_run, number)
        done = self._is_done(latest, limits, enough=enough)
        self.keep(self._record(latest, done=done), latest_run)
        within = latest.broken.of - latest.broken.flights
        self.tell(f"{self._name(number)}: {latest_run.race_time:.3f} s, {within} of {latest.broken.of} flights keep it")
        return done

    def _name(self, number: int) -> str:
        return f"reserve {self.request.probability:g}, attempt {number + 1} of {ATTEMPTS_MAX}"

    def _record(self, closed_loop: _Measured | None, *, done: bool) -> ReserveAttempt:
        counts = (0, 0, 0, 0)
        if closed_loop is not None:
            broken = closed_loop.broken
            counts = broken.of, broken.flights, closed_loop.outside.flights, closed_loop.over_g.flights
        return ReserveAttempt(self.asked, *counts, self.risk, self.load_weight, self.lift, done)

    def _with_margins(self, latest: RunState) -> tuple[bool, RunState | None, list[Limit]]:
        """Fly with the margins that the risks need, until they stay.

        Returns:
            Whether such margins suffice, the flight, and its limits; None where there is no flight.
        """
        enough, limits = True, self._limits(latest)
        for _ in range(ALLOCATION_ITERATIONS_MAX):
            weights = {LOAD: self.load_weight}
            allocation = allocate(self._judged_limits(limits), _prices(latest), self.risk, weights)
            margins, enough = dict(allocation.margins), allocation.reaches
            lift = lift_margin(limits, self.pilot, self.lift)
            margins |= {"rules.C_L_max": lift} if lift else {}
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

    def _judged_limits(self, limits: Sequence[Limit]) -> list[Limit]:
        excluded = {STALL} if self.request.load_factor else {STALL, LOAD}
        return [limit for limit in limits if limit.kind not in excluded]

    def _measure(self, latest: RunState, number: int) -> _Measured:
        """Fly an optimum in closed loop, every attempt in disturbances of its own, and note the outcome."""
        case = self._fly(latest, number)
        result = case.result
        return self._note(number, latest, judged(self.request, result), result.outside, result.counts[OVER_G], case)

    def _fly(self, latest: RunState, number: int) -> SafetyCase:
        started = time.monotonic()

        def watch(done: int, total: int, broken: int) -> None:
            text = f"{self._name(number)}: flights {done} of {total}"
            if done:
                left = (time.monotonic() - started) * (total / done - 1.0)
                share = f", {100.0 * (1.0 - broken / done):.1f} % break no rule" if self.request.load_factor else ""
                text += f"{share}, {duration_text(left)} left"
            self.show(text, done, total)

        return latest.stages[-1].safety(flights=FLIGHTS, seed=number, watch=watch, **self.options)

    def _note(
        self, number: int, run: RunState, broken: Count, outside: Count, over_g: Count, case: SafetyCase | None
    ) -> _Measured:
        self.found.append(_Measured(number, run, broken, outside, over_g, _is_rare(broken, self.allowed), case))
        return self.found[-1]

    def _case_of(self, best: _Measured) -> ReserveCase:
        """Return the best attempt in full.

        Raises:
            CheckpointError: the flights of a stored attempt break more or fewer limits than it says.
        """
        case = best.case or self._fly(best.run, best.number)
        broken = judged(self.request, case.result)
        if (broken, case.result.outside, case.result.counts[OVER_G]) != (best.broken, best.outside, best.over_g):
            raise CheckpointError(
                f"{self._name(best.number)} is not what was stored: {broken.flights} flights break a "
                f"limit where it says {best.broken.flights}; `airrace resume --from six-dof` makes all attempts again"
            )
        limits, after = self._limits(best.run), _prices(best.run)
        units = {limit.key: limit.unit for limit in course_limits(best.run.inputs.race)}
        pairs = self._risks_of(limits)
        margins = [
            KeptMargin(
                key,
                margin,
                units[key],
                0.5 * margin * (self.prices.get(key, 0.0) + after.get(key, 0.0)),
                sum(float(limit.risk_now) for limit in limits if limit.key == key),
            )
            for key, margin in best.run.inputs.margins.items()
            if margin > 0.0
        ]
        return ReserveCase(
            run=best.run,
            request=self.request,
            optimum=self.optimum.race_time,
            margins=tuple(sorted(margins, key=lambda margin: -margin.cost)),
            predicted=_predicted(pairs),
            case=case,
            reached=best.reached,
            binding=() if best.reached else tuple(_limit_texts(pairs)),
        )

    def _risks_of(self, limits: Sequence[Limit]) -> list[tuple[float, Limit]]:
        """Return the risks that remain of the limits that are judged, that of the load factor by its weight."""
        weights = {LOAD: self.load_weight}
        return [
            (min(weights.get(limit.kind, 1.0) * float(limit.risk_now), 1.0), limit)
            for limit in self._judged_limits(limits)
        ]

    def _is_done(self, latest: _Measured, limits: Sequence[Limit], *, enough: bool) -> bool:
        """Return whether as many flights break limits as intended; else keep off the stall, or scale the risks.

        Args:
            latest: the flights.
            limits: of the optimum that they track.
            enough: whether margins sufficed for the risks.
        """
        if latest.reached and not any(latest.run.inputs.margins.values()):
            return True
        pairs = self._risks_of(limits)
        predicted = sum(risk for risk, limit in pairs if limit.kind != LOAD)
        nonlinear = latest.outside.lower > NONLINEARITY_FACTOR * min(predicted, 1.0)
        if not latest.reached and nonlinear and lift_margin(limits, self.pilot, self.lift + LIFT_STEP):
            self.lift += LIFT_STEP
            return False
        broken, flights_max = latest.broken, _allowance(latest.broken, self.allowed)
        if latest.reached and broken.flights >= EXCESS_MARGIN_SHARE * flights_max:
            return True
        self._weigh_loads(latest, pairs)
        factor = TARGET_SHARE * max(flights_max, 0.5) / max(broken.flights, 0.5)
        self.risk *= min(max(factor, 1.0 / RISK_CHANGE_MAX), RISK_CHANGE_MAX)
        return not enough  # margins cannot be enlarged any further

    def _weigh_loads(self, latest: _Measured, pairs: Sequence[tuple[float, Limit]]) -> None:
        """Correct the weight of the load factor by what was observed beside what was predicted, each with half a
        flight more, so that none of few is no certainty."""
        if not self.request.load_factor:
            return
        of = latest.broken.of
        loads = sum(risk for risk, limit in pairs if limit.kind == LOAD)
        rest = sum(risk for risk, limit in pairs if limit.kind != LOAD)
        ratio = (latest.over_g.flights + 0.5) / (loads * of + 0.5) * (rest * of + 0.5) / (latest.outside.flights + 0.5)
        self.load_weight *= min(max(ratio, 1.0 / RISK_CHANGE_MAX), RISK_CHANGE_MAX)


def judged(request: ReserveEntry, result: SafetyResult) -> Count:
    """Return the flights that break what a reserve is to keep."""
    return result.broken if request.load_factor else result.outside


def _predicted(pairs: Sequence[tuple[float, Limit]]) -> float:
    """Return the probability of no breach, at least, by the linear covariance."""
    return max(1.0 - sum(risk for risk, _ in pairs), 0.0)


def _limit_texts(pairs: Sequence[tuple[float, Limit]]) -> list[str]:
    """Return the limits with the highest risks, in words."""
    probable = [(risk, limit) for risk, limit in pairs if risk > 1e-3]
    probable.sort(key=lambda pair: -pair[0])
    return list(dict.fromkeys(f"{limit.kind} at {limit.place}" for _, limit in probable[:3]))


def _is_rare(count: Count, risk: float) -> bool:
    """Return whether the confidence interval of the breaches ends little above the allowed risk."""
    return count.upper <= risk + CONFIDENCE_TOLERANCE


def _allowance(count: Count, risk: float) -> int:
    """Return how many of the flights may break a limit; 0 where they are too few to tell."""
    most = math.floor(risk * count.of + 1e-9)
    return next((number for number in range(most, 0, -1) if _is_rare(Count.with_interval(number, count.of), risk)), 0)


def _prices(run: RunState) -> dict[str, float]:
    """Return the shadow prices of the limits, s per unit, by key."""
    inputs = run.inputs
    limits = {limit.key: limit for limit in course_limits(inputs.race) if math.isfinite(limit.value)}
    shadow_prices: dict[str, float] = {}
    for sensitivity in sensitivities(limits.values(), inputs.race, inputs.settings, run.stages[-1].result):
        price = sensitivity.upward if limits[sensitivity.key].relaxing_step < 0.0 else -sensitivity.downward
        shadow_prices[sensitivity.key] = max(price, 0.0) if math.isfinite(price) else 0.0
    return shadow_prices
