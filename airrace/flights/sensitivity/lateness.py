"""The price of lateness: the time that a race loses by an act of the pilot that begins too late or too early.

A late pilot leaves stick and rudder where they are for a while at the time at which something should be done: the rates
of all controls that have one are zero, the throttle stays commanded. An early one begins that much before it with what
the optimum does from then on. From the state in which either leaves the aircraft the rest of the race is solved again,
all gates and limits kept, so a price is what the mistake costs a pilot who then does the best that is left.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from airrace.errors import NotCertified
from airrace.flights.sensitivity import LatenessPrice
from airrace.model.frames import QUATERNION
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.runge_kutta import RK4
from airrace.optimal_control.solve import solve
from airrace.optimal_control.solvers.interface import SolverOptions
from airrace.optimal_control.system import at_points
from airrace.optimal_control.trajectory import Array
from airrace.procedure.fidelity import iterate_of
from airrace.procedure.guess import concatenate, phase_piece
from airrace.procedure.homotopy import fixed_state
from airrace.procedure.result import StageResult
from airrace.procedure.settings import Settings
from airrace.procedure.stage_problem import PerturbedProblem, StageProblem
from airrace.procedure.warm_start import InitialBarrier
from airrace.race import Race

DELAY = 0.1
"""The usual lateness, s: pilots of races time their acts by a tenth of a second."""
ITERATIONS_MAX = 60
"""The number of iterations after which no flight is expected: of 60 prices on Rovinj those found took at most 24."""
STEP = 0.01
"""The longest step of the flight of a pilot who is late, s."""
TOLERANCE = 1e-6
"""That of a solve: a price is told in hundredths of a second."""
LOAD, LIFT = "n_z", "C_L"
"""The names of the load factor and of the lift coefficient that is proportional to it."""
STALL_MARGIN = 1.0 - 1e-6
"""The share of the largest lift coefficient that is left to a late pilot: a solver needs some room."""
SHORTEST = 1e-3
"""The shortest rest of a leg, s."""


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
    remainder = _Remainder.of(race, settings, result)
    for time in times:
        late = remainder.time_lost(remainder.late(time, delay), time + delay)
        early = remainder.time_lost(remainder.early(time, delay), time) if time >= delay else None
        yield LatenessPrice(delay, late, early)


@dataclass(frozen=True, eq=False)
class _Remainder:
    """An optimum, and what is left of its race at any time.

    Attributes:
        flight, problem, iterate: its problem on the stored mesh, and its solution.
        time: of the nodes, s, shape (N + 1,).
    """

    flight: StageProblem
    problem: Problem
    iterate: Iterate
    time: Array

    @classmethod
    def of(cls, race: Race, settings: Settings, result: StageResult) -> "_Remainder":
        perturbed = PerturbedProblem.of_result(race, settings, result)
        return cls(perturbed.flight, perturbed.problem(race), iterate_of(result.trajectory), result.trajectory.time)

    def late(self, time: float, delay: float) -> Array:
        """Return the state, shape (n_x,), in which a pilot is who moves nothing for a while from a time on."""
        control = self.iterate.control[:, self._interval(time)].copy()
        control[[bool(quantity.rate_of) for quantity in self.problem.system.controls]] = 0.0
        return self._unstalled(self._advance(self._state_at(time), control, delay), control)

    def early(self, time: float, delay: float) -> Array:
        """Return the state, shape (n_x,), in which a pilot is at a time who began then with what comes after it."""
        state = self._state_at(time - delay)
        for interval in range(self._interval(time), self._interval(time + delay) + 1):
            begin, end = max(time, self.time[interval]), min(time + delay, self.time[interval + 1])
            if end > begin:
                state = self._advance(state, self.iterate.control[:, interval], float(end - begin))
        return state

    def time_lost(self, state: Array, time: float) -> float | None:
        """Return how much later than the optimum the race ends from a state (n_x,) at a time (s) on, s; None where no
        flight is found."""
        problem, guess = self._rest(state, time)
        options = SolverOptions(TOLERANCE, ITERATIONS_MAX, InitialBarrier.OTHER_PROBLEM.value, curvature=False)
        solution = solve(problem, guess, options=options)
        if not solution.success:
            return None
        return float(time + solution.iterate.durations.sum() - self.time[-1])

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

    def _rest(self, state: Array, time: float) -> tuple[Problem, Iterate]:
        """Return the problem from a state (n_x,) to the finish, and the optimum from the node nearest to a time (s) on
        as a guess of it."""
        first = self.problem.first_node
        node = int(np.argmin(np.abs(self.time[:-1] - time)))
        index = int(np.searchsorted(first, node, "right")) - 1
        head = node - first[index]
        phases = list(self.problem.phases[index:])
        pieces = [phase_piece(self.iterate, self.problem, number) for number in range(index, len(self.problem.phases))]
        guess = concatenate(pieces)
        durations, states = guess.durations.copy(), guess.state[:, head:].copy()
        durations[0] *= sum(phases[0].fractions[head:])
        states[:, 0] = state
        part = phases[0].part(slice(head, None)).without_path_constraints_at(0)
        phases[0] = replace(part, duration=Interval(SHORTEST, part.duration.upper))
        problem = replace(self.problem, start=fixed_state(self.flight, state), phases=tuple(phases))
        return problem, Iterate(durations, states, guess.control[:, head:])
