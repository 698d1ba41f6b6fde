"""The price of lateness: the time that a race loses by an act of the pilot that begins too late or too early.

A late pilot leaves stick and rudder where they are for a while at the time at which something should be done: the rates
of all controls that have one are zero, the throttle stays commanded. An early one begins that much before it with what
the optimum does from then on. The cost to go from the state in which either leaves the aircraft is that of the best
that is left, all gates and limits kept. A gate that comes meanwhile is still ahead: the pilot sees the mistake there.
"""

from collections.abc import Iterable, Iterator
from contextlib import closing
from dataclasses import dataclass

import numpy as np

from airrace.errors import NotCertified
from airrace.flights.sensitivity import LatenessPrice
from airrace.model.frames import QUATERNION
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.runge_kutta import RK4
from airrace.optimal_control.solvers.service import SolverService
from airrace.optimal_control.system import at_points
from airrace.optimal_control.trajectory import Array, Indices
from airrace.procedure.cost_to_go import RELAXED_MIN, CostToGo
from airrace.procedure.fidelity import iterate_of
from airrace.procedure.result import Silent, StageResult
from airrace.procedure.settings import Settings
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_problem import PerturbedProblem
from airrace.race import Race

DELAY = 0.1
"""The usual lateness, s: pilots of races time their acts by a tenth of a second."""
STEP = 0.01
"""The longest step of the flight of a pilot who is late, s."""
LOAD, LIFT = "n_z", "C_L"
"""The names of the load factor and of the lift coefficient that is proportional to it."""
STALL_MARGIN = 1.0 - 1e-6
"""The share of the largest lift coefficient that is left to a late pilot: a solver needs some room."""
SAME_TIME = 1e-6
"""The time before a passing within which the leg behind it goes on, s: what rounding leaves."""
BEFORE_GATE = 0.02
"""The time before a gate at which the pilot sees a mistake at the latest, s: a wing is 2 m before it then."""


def lateness_prices(
    times: Iterable[float], race: Race, settings: Settings, result: StageResult, delay: float = DELAY
) -> Iterator[LatenessPrice]:
    """Yield the price of lateness at every one of some times (s after the start); each is solved twice.

    Args:
        times: at which something is done, within the race.
        race: the race of the stage.
        settings: with which it was solved.
        result: the stage.
        delay: s, positive.

    Raises:
        NotCertified: the stage is no optimum, certified or solved.
    """
    if not result.holds:
        raise NotCertified(f"{result.stage.value}: only a certified or solved stage has prices of lateness")
    perturbed = PerturbedProblem.of_result(race, settings, result)
    rest, trajectory = CostToGo(perturbed.stage_problem, result), result.trajectory
    pilot = _Pilot(perturbed.problem(race), iterate_of(trajectory), trajectory.time, trajectory.first_node)
    with (
        SolverService(stall_seconds=settings.solver.stall_seconds) as service,
        closing(SolverSession(service, settings, Silent())) as session,
    ):

        def time_lost(state: Array, time: float, leg: int) -> float | None:
            named = dict(zip((quantity.name for quantity in rest.states), state.tolist(), strict=True))
            best = rest.solve(session, named, leg)
            if not best.solved or best.relaxed > RELAXED_MIN:
                return None
            return time + best.cost - trajectory.race_time

        for time in times:
            late = time_lost(*pilot.late(time, delay))
            early = time_lost(*pilot.early(time, delay)) if time >= delay else None
            yield LatenessPrice(delay, late, early)


@dataclass(frozen=True, eq=False)
class _Pilot:
    """A pilot who flies an optimum, but is late or early.

    Attributes:
        problem, iterate: the problem on the stored mesh, and its solution.
        time: of the nodes, s, shape (N + 1,).
        first_node: the node at which each leg begins and, last, the final node.
    """

    problem: Problem
    iterate: Iterate
    time: Array
    first_node: Indices

    def late(self, time: float, delay: float) -> tuple[Array, float, int]:
        """Return the state (n_x,) after nothing was moved for a while from a time on, its time (s) and its leg."""
        leg = self._leg(time)
        seconds = self._seconds_within(leg, time, delay)
        control = self.iterate.control[:, self._interval(time)].copy()
        control[[bool(quantity.rate_of) for quantity in self.problem.system.controls]] = 0.0
        state = self._advance(self._state_at(time), control, seconds)
        return self._unstalled(state, control), time + seconds, leg

    def early(self, time: float, delay: float) -> tuple[Array, float, int]:
        """Return the state (n_x,) of who did from `time - delay` on what comes after a time, its time (s) and leg."""
        begin, leg = time - delay, self._leg(time - delay)
        seconds, state = self._seconds_within(leg, begin, delay), self._state_at(begin)
        for interval in range(self._interval(time), self._interval(time + seconds) + 1):
            first, last = max(time, self.time[interval]), min(time + seconds, self.time[interval + 1])
            if last > first:
                state = self._advance(state, self.iterate.control[:, interval], float(last - first))
        return state, begin + seconds, leg

    def _leg(self, time: float) -> int:
        """Return the number of the leg that goes on at a time."""
        passings = self.time[self.first_node]
        return int(np.clip(np.searchsorted(passings, time + SAME_TIME, "right") - 1, 0, len(passings) - 2))

    def _seconds_within(self, leg: int, time: float, seconds: float) -> float:
        """Return how much of a while lies before the end of a leg, s."""
        end = float(self.time[self.first_node[leg + 1]]) - BEFORE_GATE
        return min(seconds, max(end - time, 0.0))

    def _interval(self, time: float) -> int:
        return int(np.clip(np.searchsorted(self.time, time, "right") - 1, 0, len(self.time) - 2))

    def _state_at(self, time: float) -> Array:
        interval = self._interval(time)
        state, control = self.iterate.state[:, interval], self.iterate.control[:, interval]
        return self._advance(state, control, float(time - self.time[interval]))

    def _advance(self, state: Array, control: Array, seconds: float) -> Array:
        """Return the state, shape (n_x,), after some time with a constant control, its attitude of unit length."""
        system, parameters = self.problem.system, np.asarray(self.problem.parameters)

        def rates(x: Array, u: Array, _: None) -> Array:
            return at_points(system.rates, x[:, None], u[:, None], parameters)[:, 0]

        steps = max(int(np.ceil(seconds / STEP)), 1)
        for _ in range(steps):
            state = RK4.advance(rates, state, control, None, seconds / steps)
        names = [quantity.name for quantity in system.states]
        attitude = [names.index(name) for name in QUATERNION]
        state = state.copy()
        state[attitude] /= np.linalg.norm(state[attitude])
        return state

    def _unstalled(self, state: Array, control: Array) -> Array:
        """Return a state, shape (n_x,), with the load factor that its speed allows: a model whose state that is could
        hold it beyond the largest lift coefficient."""
        system = self.problem.system
        states, path = ([quantity.name for quantity in declared] for declared in (system.states, system.path))
        if LOAD not in states or LIFT not in path or system.path_values is None:
            return state
        values = at_points(system.path_values, state[:, None], control[:, None], np.asarray(self.problem.parameters))
        C_L, most = float(values[path.index(LIFT), 0]), system.path[path.index(LIFT)].upper
        state[states.index(LOAD)] *= min(1.0, STALL_MARGIN * most / C_L) if C_L > 0.0 else 1.0
        return state
