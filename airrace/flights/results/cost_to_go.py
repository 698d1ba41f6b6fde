"""The loss of a flight by the cost to go: what every stretch of it cost, from the best that was left at its beginning.

    loss = (time taken) + V(end) - V(start),        V(finish) = 0

It adds up exactly: what the start cost, `V(start of the race) - V*`, and the losses of all legs are the difference of
the race times. It is never negative but for errors of log, aircraft and wind. A leg that was slow to win the next one
lost nothing. Within a leg, the fastest flight from its first state on takes it in `t'` and is left with `V'`:

    loss = (t - t') + (V(end) - V')        by the leg itself, which `time_loss` explains, and by the state at its end
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from airrace.errors import UsageError
from airrace.flights.results.comparison import Comparison, compare_flights
from airrace.flights.results.cues import Cue, cues_of, roll_rate_of
from airrace.flights.results.derivation import LONGEST_STEP, complete_histories
from airrace.flights.results.flight import Basis, Flight, History, Leg, Source, TimedCrossing, legs_of
from airrace.flights.results.time_loss import ITEMS_MAX, LOSS_MIN, PART_MIN, PART_SHARE, WORDS, Cause, loss_parts
from airrace.model.frames import QUATERNION
from airrace.procedure import stored_stages
from airrace.procedure.result import StageResult

if TYPE_CHECKING:  # what solves is not needed to show what was lost
    from airrace.procedure.cost_to_go import Continuation

LONGEST_GAP = 0.5
"""The longest time between two states whose cost to go is computed, s."""
SAME_MOMENT = 1e-3
"""The time between two moments that count as one, s."""
EXIT = "exit"
"""The loss by the state in which a leg ends."""
BANK, PATH = "bank", "path"
"""Names of deviations of the attitude: about the path, and of the path's direction, rad."""


@dataclass(frozen=True)
class Moment:
    """A moment of a flight whose cost to go is asked for: time, s on the flight's clock, and the leg it is on, from 0.

    `cue` names what begins there; empty for a passing or a point of the grid. `state` is the aircraft's, by name, SI.
    """

    time: float
    leg: int
    state: Mapping[str, float]
    is_passing: bool = False
    cue: str = ""


@dataclass(frozen=True)
class CostSample:
    """A moment with its cost to go, s, the standard deviation of that, and what had to give way, in words."""

    moment: Moment
    cost: float
    deviation: float
    text: str = ""

    @property
    def reachable(self) -> float:
        """The best race time that was left, s."""
        return self.moment.time + self.cost


@dataclass(frozen=True)
class CueLoss:
    """What was lost from the beginning of a cue to that of the next one of the leg, s."""

    name: str
    time: float
    amount: float


@dataclass(frozen=True, eq=False)
class LegLoss:
    """What a leg cost.

    Attributes:
        leg: of the flight.
        amount: s.
        deviation: standard deviation of it by those of the states, s.
        parts: what of it each cause costs, s, by `Cause` and `EXIT`; they add up to the amount.
        cues: what was lost from cue to cue, s; they add up to the amount.
        best: the flight as flown up to the leg and optimal from there.
        text: why the start of the leg had to give way; empty where it had not.
    """

    leg: Leg
    amount: float
    deviation: float
    parts: Mapping[str, float]
    cues: tuple[CueLoss, ...]
    best: Flight
    text: str = ""

    @property
    def words(self) -> str:
        """The loss in words."""
        least = max(PART_SHARE * self.amount, PART_MIN)
        ranked = sorted(self.parts, key=lambda part: -self.parts[part])
        clauses = [f"{self.parts[part]:.2f} s by {_words(part)}" for part in ranked if self.parts[part] >= least]
        worst = max(self.cues, key=lambda cue: cue.amount, default=None)
        if worst is not None and worst.amount >= least and len(self.cues) > 1:
            clauses.append(f"{worst.amount:.2f} s of it from `{worst.name}` ({worst.time:.1f} s) on")
        text = f"{self.amount:.2f} s from {self.leg.before.name} to {self.leg.name}"
        text += f" (known to {self.deviation:.2f} s)" if self.deviation >= 0.005 else ""
        return "; ".join([f"{text}: {', '.join(clauses)}" if clauses else text, *([self.text] if self.text else [])])


def _words(part: str) -> str:
    return "the state at its end" if part == EXIT else WORDS[Cause(part)][0]


@dataclass(frozen=True, eq=False)
class CostToGoLoss:
    """What a flight lost against the best that was left at every moment.

    Attributes:
        flight: that is judged.
        against: label of the optimum by whose stage the costs to go are computed.
        race_time: of that optimum, s.
        samples: in order.
        legs: in race order.
    """

    flight: Flight
    against: str
    race_time: float
    samples: tuple[CostSample, ...]
    legs: tuple[LegLoss, ...]

    @property
    def total(self) -> float:
        """The loss from the start on, s."""
        return self.flight.race_time - self.samples[0].cost

    @property
    def start(self) -> float:
        """What the state at the start cost against that of the optimum, s; negative where that was not allowed one as
        good."""
        return self.samples[0].cost - self.race_time

    @property
    def costliest(self) -> tuple[LegLoss, ...]:
        """The losses that are reported, the greatest first."""
        ranked = sorted(self.legs, key=lambda loss: -loss.amount)[:ITEMS_MAX]
        return tuple(loss for loss in ranked if loss.amount >= LOSS_MIN)

    @property
    def title(self) -> str:
        """The sentence of the total."""
        return (
            f"{self.flight.label} lost {self.total:.3f} s from its start on, by the cost to go of {self.against}; "
            f"its start cost {self.start:+.3f} s"
        )


def moments_of(flight: Flight, names: Sequence[str]) -> list[Moment]:
    """Return the moments at which the cost to go is asked for: passings, beginnings of cues, and a grid between them.

    Args:
        flight: that makes all passings.
        names: of the states of the model that flies on.

    Raises:
        UsageError: the flight lacks a passing, or what a state is made of.
    """
    missing = [crossing.name for crossing in flight.crossings if not crossing.found]
    if missing:
        raise UsageError(f"{flight.label} does not pass {', '.join(missing)}: nothing is left of a race without it")
    if lacking := [name for name in ("x", "y", "z", "V_K", *QUATERNION) if name not in flight]:
        raise UsageError(f"{flight.label} has no history {lacking[0]}: its states are not known")
    cues = cues_of(flight)
    times: list[tuple[float, int, bool, str]] = []
    for number, leg in enumerate(legs_of(flight)):
        own = {cue.time: cue_name(cue) for cue in cues if cue.leg.number == leg.number}
        marks = sorted({leg.before.time, *own, leg.after.time})
        for begin, end in itertools.pairwise(marks):
            if end - begin < SAME_MOMENT and begin != leg.before.time:
                continue
            count = max(math.ceil((end - begin) / LONGEST_GAP), 1)
            for step, time in enumerate(np.linspace(begin, end, count + 1)[:-1].tolist()):
                times.append((time, number, time == leg.before.time, own.get(begin, "") if step == 0 else ""))
    histories = {name: flight[name] for name in names if name in flight}
    recorded = "phi" in flight and flight.basis("phi") is Basis.MEASURED  # else no rate of roll follows from the bank
    if "p_Kbar" in names and "p_Kbar" not in histories and recorded:
        histories["p_Kbar"] = roll_rate_of(flight.time, np.array([flight[name] for name in QUATERNION]))
    moments: list[Moment] = []
    for time, number, is_passing, cue in times:
        row = int(np.argmin(np.abs(flight.time - time)))  # a state between two of the flight would be none of it
        state = {name: float(values[row]) for name, values in histories.items() if math.isfinite(values[row])}
        moments.append(Moment(float(flight.time[row]), number, state, is_passing, cue))
    return moments


def cue_name(cue: Cue) -> str:
    """Return what is done with the bank in a cue."""
    return " ".join(filter(None, (cue.action, cue.side)))


def cost_deviation(continuation: "Continuation", state: Mapping[str, float], known: Mapping[str, float]) -> float:
    """Return the standard deviation of a cost to go by those of the state, s.

    Args:
        continuation: with the derivatives of the cost.
        state: from which it begins.
        known: deviations by the names of states, of `BANK` and of `PATH`; what is missing counts as exact.
    """
    prices = continuation.prices
    parts = [prices.get(name, 0.0) * deviation for name, deviation in known.items() if name not in (BANK, PATH)]
    q0, q1, q2, q3 = (state[name] for name in QUATERNION)
    columns = ((-q1, q0, q3, -q2), (-q2, -q3, q0, q1), (-q3, q2, -q1, q0))  # q o (0, e_i), for a turn about axis i
    for axis, name in zip(columns, (BANK, PATH, PATH), strict=True):
        slope = 0.5 * sum(prices.get(entry, 0.0) * value for entry, value in zip(QUATERNION, axis, strict=True))
        parts.append(slope * known.get(name, 0.0))
    return math.hypot(*parts)


def continued_flight(flight: Flight, time: float, continuation: "Continuation", optimum: StageResult) -> Flight:
    """Return a flight as flown up to a time and optimal from there on.

    Args:
        flight: that was flown.
        time: on its clock, s, at the state from which the continuation begins.
        continuation: up to the finish.
        optimum: of the stage that flies on.
    """
    read = stored_stages.continuous(flight.race, replace(optimum, trajectory=continuation.trajectory), LONGEST_STEP)
    stored = {quantity.name: History(quantity, values, Basis.SOLVED) for quantity, values in read.solved.items()}
    stored |= {quantity.name: History(quantity, values, Basis.DERIVED) for quantity, values in read.derived.items()}
    rest = complete_histories(flight.race, stored)
    before = flight.time < time - 1e-9
    histories = {
        name: replace(history, values=np.concatenate([history.values[before], rest[name].values]))
        for name, history in flight.histories.items()
        if name in rest
    }
    crossings = list(flight.crossings[: continuation.leg + 1])
    nodes = continuation.trajectory.first_node.tolist()[1:]
    for passage, node in zip(flight.course.passages[continuation.leg + 1 :], nodes, strict=True):
        passed = float(continuation.trajectory.time[node])
        row = int(before.sum()) + int(np.searchsorted(read.time, passed - 1e-9))
        values = {name: float(history.values[row]) for name, history in histories.items()}
        crossings.append(TimedCrossing(passage, time + passed, values))
    source = Source(f"best from {time:.1f} s", remark=f"{flight.label} up to {time:.2f} s, then the fastest flight")
    return Flight(
        flight.race, source, np.concatenate([flight.time[before], time + read.time]), histories, tuple(crossings)
    )


def losses_of(
    flight: Flight,
    moments: Sequence[Moment],
    continuations: "Sequence[Continuation]",
    deviations: Sequence[Mapping[str, float]],
    optimum: StageResult,
    against: str,
) -> CostToGoLoss:
    """Return what a flight lost, leg by leg and cue by cue.

    Args:
        flight: that made the moments.
        moments: of `moments_of`.
        continuations: the fastest flight from each of them.
        deviations: how well each state is known, see `cost_deviation`.
        optimum: of the stage that flies on.
        against: its label.
    """
    samples: list[CostSample] = []
    for moment, continuation, known in zip(moments, continuations, deviations, strict=True):
        deviation = cost_deviation(continuation, {**continuation_state(continuation), **moment.state}, known)
        samples.append(CostSample(moment, continuation.cost, deviation, continuation.text))
    finish = Moment(flight.crossings[-1].time, len(flight.crossings) - 1, {}, is_passing=True)
    samples.append(CostSample(finish, 0.0, 0.0))
    legs: list[LegLoss] = []
    firsts = [row for row, sample in enumerate(samples) if sample.moment.is_passing]
    for (first, end), leg in zip(itertools.pairwise(firsts), legs_of(flight), strict=True):
        best = continued_flight(flight, samples[first].moment.time, continuations[first], optimum)
        amount = samples[end].reachable - samples[first].reachable
        comparison = compare_flights(best, flight)
        legs.append(
            LegLoss(
                leg,
                amount,
                math.hypot(samples[first].deviation, samples[end].deviation),
                _parts(amount, comparison, leg),
                _cue_losses(samples[first : end + 1]),
                best,
                samples[first].text,
            )
        )
    return CostToGoLoss(flight, against, optimum.trajectory.race_time, tuple(samples), tuple(legs))


def continuation_state(continuation: "Continuation") -> dict[str, float]:
    """Return the state in which a continuation begins."""
    trajectory = continuation.trajectory
    return {quantity.name: float(trajectory[quantity.name][0]) for quantity in trajectory.states}


def _parts(amount: float, comparison: Comparison, leg: Leg) -> dict[str, float]:
    """Return the parts of a leg's loss: those of the leg beside the best one, and the state at its end."""
    own = comparison.legs[leg.number - 1]
    parts: dict[str, float] = {}
    if "chi" in comparison.reference and "chi" in comparison.flight:
        parts = {cause.value: part for cause, part in loss_parts(comparison, own).items()}
    parts[EXIT] = amount - sum(parts.values())
    return parts


def _cue_losses(samples: Sequence[CostSample]) -> tuple[CueLoss, ...]:
    """Return what was lost from the passing to the first cue, and from each cue to the next, s."""
    begins = [0, *(row for row, sample in enumerate(samples) if sample.moment.cue), len(samples) - 1]
    losses: list[CueLoss] = []
    for first, end in itertools.pairwise(begins):
        if end > first:
            moment = samples[first].moment
            amount = samples[end].reachable - samples[first].reachable
            losses.append(CueLoss(moment.cue or "the passing", moment.time, amount))
    return tuple(losses)
