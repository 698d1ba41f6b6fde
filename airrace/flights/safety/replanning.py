"""Lines that are replanned while they are flown: the fastest rest of the race from where each aircraft is.

A line begins in the aircraft's state. As long as the pilot's delay lasts, the stick does what is decided already, so it
goes on as the undisturbed aircraft does by that; from where it is then the rest of the race is solved by
`airrace.procedure.cost_to_go`, as guidance, to a gate ahead. The pilot is trained for every line anew. What the
disturbances will be is as unknown as to the optimum, and the time that solving takes is not counted.

Where no flight leads on, or none is found, the pilot keeps the line before for one more interval, then follows the
optimum.
"""

import functools
import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airrace.errors import OutOfTime, UsageError
from airrace.flights.safety.nominal import TABLE_STEP, NominalFlight, instants
from airrace.flights.safety.pilot import PilotModel, linearise, train
from airrace.flights.safety.plant import CONTROLS, DISTURBANCES, STATE, STATES, DisturbedPlant, advance
from airrace.optimal_control.replay import sample
from airrace.optimal_control.trajectory import Array
from airrace.procedure.cost_to_go import CostToGo
from airrace.procedure.fidelity import iterate_of
from airrace.procedure.solver_session import SolverSession

GATES = 3
"""The gates to which a line leads at least; more where they come sooner than its end."""
FORESIGHT = 1.5
"""The time that a line goes on behind where it is needed, s: what the pilot's feedback reckons with."""
PAST = 0.2
"""The time for which a line is known before it begins, s: what late ailerons do at first is of the line before."""
RELAXED_MAX = 0.5
"""The deviations by which a line may begin elsewhere than the aircraft is (1): half a metre, half a degree.

Near the stall gusts leave states from which no flight leads on. The nearest ones may be metres away and turned by tens
of degrees: no place for a pilot to go to.
"""
JOBS = 4
"""The parts into which the flights of a batch are divided, to be solved side by side."""


@dataclass(frozen=True, eq=False)
class Replanning:
    """How lines are replanned.

    Attributes:
        rest: solves what is left of the race.
        session: solves, side by side.
        interval: between two lines of a flight, s.
        until: the time of the monotonic clock, s, after which no line is planned any more.
    """

    rest: CostToGo
    session: SolverSession
    interval: float
    until: float = math.inf


def ensure_replanned(interval: float, race_time: float, delay: float) -> None:
    """Find out whether a race is long enough for a new line: the first comes after an interval, and none in the last.

    Args:
        interval: between two lines of a flight, s.
        race_time: of the optimum, s.
        delay: of the pilot, s.

    Raises:
        UsageError: it is too short.
    """
    most = 0.5 * (race_time - delay)
    if interval >= most:
        raise UsageError(
            f"a new line every {interval:g} s is none in a race of {race_time:.1f} s: the first comes after that time, "
            f"and none in the last {interval + delay:g} s; it must be less than every {most:.1f} s"
        )


class ReplannedLines:
    """What the pilots of a batch follow, a line for each; at first the optimum.

    Attributes:
        line: from `PAST` before where each was planned on, long enough for three intervals.
        feedback: of the pilots along it, see `PilotGains`, shape (n, N, 5, 16 + 4 d).
        clock: of these lines, s; shape (n,).
    """

    def __init__(
        self,
        replanning: Replanning,
        plant: DisturbedPlant,
        nominal: NominalFlight,
        pilot: PilotModel,
        feedback: Array,
        count: int,
    ) -> None:
        self._replanning, self._plant, self._pilot = replanning, plant, pilot
        self._nominal, self._nominal_feedback = nominal, feedback
        self._parts = round(pilot.sample / TABLE_STEP)
        self._every = max(1, round(replanning.interval / pilot.sample))
        self._past = round(PAST / pilot.sample)
        self._samples = self._past + 3 * self._every + pilot.waiting + round(FORESIGHT / pilot.sample)
        rows = self._samples * self._parts + 1
        state, moved = np.empty((count, rows, STATES)), np.empty((count, rows, CONTROLS))
        self.line = NominalFlight(state, moved, nominal.passing_times)
        self.feedback = np.empty((count, self._samples, *feedback.shape[1:]))
        self.clock, self._planned = np.zeros(count), np.empty(count, np.int64)
        for flight in range(count):
            self._follow_optimum(flight, 0.0)

    def replan(self, k: int, x: Array, clock: Array, stick: Array, racing: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Plan new lines if it is time to; return which flights follow another line than before.

        Args:
            k: the sample.
            x: the states, shape (17, n).
            clock: of the optimum, s; shape (n,).
            stick: that is decided already, shape (d, 4, n).
            racing: which flights need a line.

        Raises:
            OutOfTime: the time of the replanning is over.
        """
        finish = float(self._nominal.passing_times[-1])
        due = racing & (clock < finish - self._replanning.interval - self._pilot.delay) & (k % self._every == 0)
        if not k or not due.any():
            return np.zeros_like(due)
        if time.monotonic() > self._replanning.until:
            raise OutOfTime("the time was over before these flights were at their end")
        flights = np.flatnonzero(due)
        past = self._recent()
        state, moved = self._delayed(x[:, flights], stick[:, :, flights])
        ahead = clock[flights] + self._pilot.delay
        jobs = [
            functools.partial(self._plan_some, state[:, :, part], moved[:, :, part], ahead[part])
            for part in (slice(first, None, JOBS) for first in range(min(JOBS, len(flights))))
        ]
        parts = self._replanning.session.side_by_side(jobs)
        for place, flight in enumerate(flights.tolist()):
            planned = parts[place % JOBS][place // JOBS]
            if planned is None:  # the line before lasts for one more interval
                on_optimum = bool(self._planned[flight] < 0)
                due[flight] = not on_optimum and k > self._planned[flight] + self._every
                if due[flight] or on_optimum:
                    self._follow_optimum(flight, float(clock[flight]))
            else:
                line, feedback = planned
                state_since = np.concatenate([past[0][flight], line.state])
                moved_since = np.concatenate([past[1][flight], line.moved])
                self._store(flight, state_since, moved_since, feedback, row=0, sample=-self._past)
                self.clock[flight], self._planned[flight] = self._past * self._pilot.sample, k
        return due

    def _delayed(self, x: Array, stick: Array) -> tuple[Array, Array]:
        """Return states and integrals of the stick while that is decided already, at the steps of a table.

        Shapes (m + 1, 17, n) and (m + 1, 4, n); undisturbed.
        """
        inputs = np.zeros((CONTROLS + DISTURBANCES, x.shape[1]))
        rates, states, moved = self._plant.rates_of(inputs), [x], [np.zeros((CONTROLS, x.shape[1]))]
        for decided in stick:
            inputs[:CONTROLS] = decided
            for _ in range(self._parts):
                states.append(advance(rates, states[-1], TABLE_STEP))
                moved.append(moved[-1] + TABLE_STEP * decided)
        return np.stack(states), np.stack(moved)

    def _plan_some(
        self, states: Array, moved: Array, ahead: Array, session: SolverSession
    ) -> list[tuple[NominalFlight, Array] | None]:
        """Return lines and feedback of some flights, None for those that find none.

        Args:
            states, moved: what is decided already, see `_delayed`.
            ahead: the clock of the optimum at its end, s; shape (n,).
            session: solves.
        """
        return [
            self._plan(states[:, :, flight], moved[:, :, flight], float(ahead[flight]), session)
            for flight in range(len(ahead))
        ]

    def _plan(
        self, states: Array, moved: Array, ahead: float, session: SolverSession
    ) -> tuple[NominalFlight, Array] | None:
        if not np.isfinite(states).all():
            return None
        rest, passing_times = self._replanning.rest, self._nominal.passing_times
        leg = int(np.searchsorted(passing_times, ahead, side="right")) - 1
        seconds = (self._samples - self._past - self._pilot.waiting) * self._pilot.sample
        gates = max(GATES, int(np.searchsorted(passing_times, ahead + seconds, side="right")) - leg)
        begin = dict(zip(STATE, states[-1].tolist(), strict=True))
        planned = rest.solve(session, begin, leg, gates=gates)
        if planned.relaxed > RELAXED_MAX:
            return None
        trajectory, model = planned.trajectory, rest.flight.model
        iterate = iterate_of(trajectory)

        def states_at(times: Array) -> dict[str, Array]:
            rows = sample(model.system, model.parameter_values, iterate, time=trajectory.time, times=times)
            return dict(zip((quantity.name for quantity in model.system.states), rows, strict=True))

        behind = NominalFlight.along(trajectory, states_at, self._plant, seconds)
        state = np.concatenate([states[:-1], behind.state])
        line = NominalFlight(state, np.concatenate([moved[:-1], moved[-1] + behind.moved]), passing_times)
        if not np.isfinite(line.state).all():
            return None
        feedback = train(self._pilot, linearise(self._plant, line, self._pilot.sample)).feedback
        return (line, feedback) if np.isfinite(feedback).all() else None

    def _follow_optimum(self, flight: int, clock: float) -> None:
        """Let a flight follow the optimum from a clock on, s."""
        begin, nominal = int(clock / self._pilot.sample) - self._past, self._nominal
        row = begin * self._parts
        self._store(flight, nominal.state, nominal.moved, self._nominal_feedback, row=row, sample=begin)
        self.clock[flight], self._planned[flight] = clock - begin * self._pilot.sample, -1

    def _store(self, flight: int, state: Array, moved: Array, feedback: Array, *, row: int, sample: int) -> None:
        """Store tables of a flight from a row, and feedback from a sample on; beyond either end its entry stays."""
        tables = ((self.line.state, state, row), (self.line.moved, moved, row), (self.feedback, feedback, sample))
        for own, table, first in tables:
            own[flight] = table[np.clip(np.arange(first, first + own.shape[1]), 0, len(table) - 1)]

    def _recent(self) -> tuple[Array, Array]:
        """Return the lines of the last moments, shape (n, m, 17), and integrals of the stick up to now, (n, m, 4)."""
        steps = instants(TABLE_STEP, self._past * self._parts) - self._past * self._pilot.sample
        now = self.line.moved_to(self.clock)
        state = [self.line.at(self.clock + step).T for step in steps.tolist()]
        moved = [(self.line.moved_to(self.clock + step) - now).T for step in steps.tolist()]
        return np.stack(state, axis=1), np.stack(moved, axis=1)

    def sticks_ahead(self) -> Array:
        """Return the sticks of the lines for what is decided already, shape (d, 4, n)."""
        steps = instants(self._pilot.sample, self._pilot.waiting)
        return np.stack([self.line.stick(self.clock + step, self._pilot.sample) for step in steps.tolist()])
