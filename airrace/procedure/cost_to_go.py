"""The cost to go: the least time from any state of an aircraft on any leg to the finish, and the flight that takes it.

    V(x, t) = least time from the state x on,       loss over a stretch = (time taken) + V(end) - V(start) >= 0

The rest of the race is the joint problem from there: what is left of the leg, and the legs behind it, with the
multipliers that the optimum has for them. Along the optimum itself it is solved already, so a state beside it takes a
few iterations. From a state that no flight leads on from, or hardly one, the start gives way, see
`airrace.optimal_control.soft_start`. Guidance may end at a gate ahead, near the optimum's state there, and count what
follows by the costates: `V = V* + costates . (x - x*)`.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from airrace.model.dynamics.flight_model import RollCounter
from airrace.model.frames import QUATERNION, rotation
from airrace.optimal_control.elastic import AT_LEAST, AT_MOST, augment, project
from airrace.optimal_control.layout import Layout, narrow_range
from airrace.optimal_control.optimality import costates
from airrace.optimal_control.problem import Boundary, Iterate, Phase, Problem
from airrace.optimal_control.quantities import Interval, Quantity
from airrace.optimal_control.soft_start import soften_start
from airrace.optimal_control.solvers.interface import Multipliers, SolverOptions
from airrace.optimal_control.solvers.service import SolverService
from airrace.optimal_control.solvers.solver import ProgramSolution
from airrace.optimal_control.system import System
from airrace.optimal_control.trajectory import Array, Indices, Trajectory
from airrace.procedure.fidelity import iterate_of
from airrace.procedure.result import StageResult
from airrace.procedure.settings import Settings
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_problem import StageProblem, formulate, mesh_of, trajectory_of
from airrace.procedure.warm_start import InitialBarrier
from airrace.race import Race

ITERATIONS_MAX = 40
"""The iterations of a solve; states beside an optimum take 5 to 20."""
TOLERANCE = 1e-6
"""The tolerance of a solve (1). The barrier then leaves 2e-6 of the time to go: 0.1 ms of a minute."""
PRICE = 1.0
"""The price of a deviation of the start, s: a state that would be worth more than a second per deviation is not
believed to the digit."""
DEVIATIONS = {"m": 1.0, "m/s": 0.5}
"""Deviations of states that are taken for well known, by their unit (SI); of others `DEVIATION_SHARE` of the scale."""
DEVIATION_SHARE = 0.02
"""Of a scale: one degree of an attitude."""
SNAP = 0.02
"""The share of an interval in which nothing is decided (1): a rest that would begin with less of one begins behind."""
VELOCITY_SECONDS = 0.5
"""The time by which velocities count as places where the place of a state along a flight is looked for, s: so that a
loop is not left where it crosses itself."""
JOINING_SPEED = 10.0
"""The difference of speeds within which guidance joins the optimum again, m/s; its costate holds nearby."""
UNKNOWN_FACTOR = 100.0
"""The factor on the usual deviation of a state that was not measured (1): a roll rate may be any."""
RELAXED_MIN = 0.02
"""The deviations from which on a start has given way (1); the barrier leaves less."""
SPEED = "V_K"
CHANGED = 0.5
"""The share of the box by which a state has changed noticeably (1)."""
STALL_SECONDS = 20.0
"""The longest wait for an iteration, s; setting a whole six-dof race up counts into the first."""
PREPARED_INTERVALS = 3000
"""The intervals that a solver process keeps ready: every state makes a problem of its own."""
PLACE_NAMES = ("x", "y", "z", SPEED, *QUATERNION)
"""The states that every model has, by which the place of one is found."""


def new_service(threads: int) -> SolverService:
    """Return a solver process for the rests of a race."""
    return SolverService(threads=threads, stall_seconds=STALL_SECONDS, prepared_intervals=PREPARED_INTERVALS)


def usual_deviations(states: Sequence[Quantity]) -> dict[str, float]:
    """Return the deviations of states that are taken for well known, by name, in their units."""
    return {state.name: DEVIATIONS.get(state.unit, DEVIATION_SHARE * state.scale) for state in states}


@dataclass(frozen=True, eq=False)
class Continuation:
    """The fastest flight from a state on.

    Attributes:
        trajectory: from there to its end; its clock starts at the state.
        cost: the cost to go, s: what the flight takes, what follows its end, and what the start gained by giving way,
            at the optimum's prices.
        relaxed: the deviations by which the start had to give way (1); 0 but for rounding where it had not.
        changes: of the states for which it did, by name, in their units.
        binding: the limit that asks most of the flight; for people.
        prices: the derivatives of the cost by each state, s per unit; where the start gave way those of the optimum.
        leg: on which the state is.
        time: the time on the clock of the optimum at which that is nearest, s.
        solved: whether it is an optimum; else a flight, and so an upper bound of the cost.
        iterations: of its solves.
        seconds: that they took.
    """

    trajectory: Trajectory
    cost: float
    relaxed: float
    changes: Mapping[str, float]
    binding: str
    prices: Mapping[str, float]
    leg: int
    time: float
    solved: bool
    iterations: int
    seconds: float

    @property
    def text(self) -> str:
        """What had to give way, in words; empty where nothing had to."""
        if not self.solved:
            return "no better flight was found from this state than back to the optimum's line"
        words = self._change_words()
        if not words:
            return ""
        if self.relaxed < RELAXED_MIN:
            return f"taken within the aircraft's limits: {', '.join(words)}"
        reason = f" ({self.binding})" if self.binding else ""
        return f"no flight leads on from this state, or hardly one{reason}; the nearest differs: {', '.join(words)}"

    def _change_words(self) -> list[str]:
        """Return what has changed, in words: place and attitude as a whole, everything else by its name."""
        changes = self.changes
        place = math.hypot(*(changes.get(name, 0.0) for name in ("x", "y", "z")))
        turned = math.degrees(2.0 * math.hypot(*(changes.get(name, 0.0) for name in QUATERNION)))
        words = [f"{place:.2g} m away"] if place else []
        words += [f"turned by {turned:.2g} deg"] if turned else []
        for quantity in self.trajectory.states:
            if quantity.name in changes and quantity.name not in ("x", "y", "z", *QUATERNION):
                unit = "" if quantity.unit == "1" else f" {quantity.unit}"
                words.append(f"{quantity.name} {changes[quantity.name]:+.2g}{unit}")
        return words


@dataclass(frozen=True, eq=False)
class _MeasuredStart:
    """A state from which a flight is to begin: as measured and within its limits, shape (n_x,), and its deviations."""

    names: Sequence[str]
    measured: Array
    state: Array
    sigma: Mapping[str, float]

    @property
    def named(self) -> dict[str, float]:
        """The state by name."""
        return dict(zip(self.names, self.state.tolist(), strict=True))

    def aligned(self, near: Array) -> "_MeasuredStart":
        """Return it with a unit quaternion on the side of another state's."""
        rows = [self.names.index(name) for name in QUATERNION]
        measured, state = self.measured.copy(), self.state.copy()
        q = state[rows]
        measured[rows] = state[rows] = q / math.copysign(max(float(np.linalg.norm(q)), 1e-9), float(q @ near[rows]))
        return replace(self, measured=measured, state=state)

    def apart(self, guess: Iterate) -> float:
        """Return the deviations by which a guess begins elsewhere."""
        spread = np.array([self.sigma[name] for name in self.names])
        return float((np.abs(self.state - guess.state[:, 0]) / spread).max())

    def changes(self, begins: Array, relaxed: float) -> dict[str, float]:
        """Return how a flight that begins in a state has noticeably changed what was measured."""
        begins = begins if relaxed > RELAXED_MIN else self.state
        changes: dict[str, float] = {}
        for name, change in zip(self.names, (begins - self.measured).tolist(), strict=True):
            if abs(change) > max(CHANGED * relaxed, RELAXED_MIN) * self.sigma[name]:
                changes[name] = change
        return changes


class _Attempts:
    """The solves for one state: with the state itself in the guess, then from the optimum's, which is a flight."""

    def __init__(self, session: SolverSession, problem: Problem, start: _MeasuredStart) -> None:
        self._session, self._problem, self._start = session, problem, start
        self.iterations, self.seconds = 0, 0.0

    def solve(self, guess: Iterate, multipliers: Multipliers) -> ProgramSolution | None:
        """Return the optimum; None if none is found.

        Args:
            guess: the optimum's flight.
            multipliers: of the limits there.
        """
        near = replace(guess, state=guess.state.copy())
        near.state[:, 0] = self._start.state
        solution = self._attempt(augment(near, 0.0), multipliers, InitialBarrier.OTHER_MESH)
        if solution is not None and solution.success:
            return solution
        solution = self._attempt(augment(guess, self._start.apart(guess)), multipliers, InitialBarrier.PIECES)
        return solution if solution is not None and solution.success else None

    def _attempt(self, guess: Iterate, multipliers: Multipliers, barrier: InitialBarrier) -> ProgramSolution | None:
        options = SolverOptions(TOLERANCE, ITERATIONS_MAX, barrier.value, curvature=False)
        session, purpose = self._session, "the cost to go"
        primary = session.solvers[0]
        solution = session.attempt(self._problem, guess, purpose, primary, options, multipliers, beyond_budget=True)
        if solution is not None:  # the solver came back in time
            self.iterations, self.seconds = self.iterations + solution.iterations, self.seconds + solution.seconds
        return solution


class CostToGo:
    """The rest of a race from any state, by an optimum of one of its stages.

    Args:
        flight: the problem of the stage.
        optimum: its solution.
    """

    def __init__(self, flight: StageProblem, optimum: StageResult) -> None:
        self.flight, self.optimum = flight, optimum.trajectory
        self.problem = flight.problem(mesh_of(optimum.trajectory))
        self.states = self.problem.system.states
        self._iterate, self._layout = iterate_of(optimum.trajectory), Layout(self.problem)
        self._multipliers = Multipliers(optimum.constraint_multipliers, optimum.bound_multipliers)
        self._costates = costates(self._layout, optimum.constraint_multipliers)
        self._names = [state.name for state in self.states]
        self._quaternion = [self._names.index(name) for name in QUATERNION]

    @classmethod
    def of_result(cls, race: Race, settings: Settings, result: StageResult) -> "CostToGo":
        """Return what solves the rest of a race by the optimum of a stage of it."""
        return cls(formulate(result.stage, race, settings, result.trajectory, result.pylon_conditions), result)

    def time_of(self, state: Mapping[str, float], leg: int) -> float:
        """Return the time on the optimum's clock at which it is nearest to a state on a leg, s."""
        optimum = self.optimum
        first, end = optimum.first_node[leg : leg + 2].tolist()
        track = _place_and_velocity({name: optimum[name][first : end + 1] for name in PLACE_NAMES})
        point = _place_and_velocity({name: np.array([state[name]]) for name in PLACE_NAMES})
        steps = np.diff(track, axis=1)
        share = np.clip(np.sum((point - track[:, :-1]) * steps, axis=0) / np.sum(steps**2, axis=0), 0.0, 1.0)
        nearest = int(np.argmin(np.linalg.norm(point - track[:, :-1] - share * steps, axis=0)))
        times = optimum.time[first + nearest : first + nearest + 2]
        return float(times[0] + share[nearest] * (times[1] - times[0]))

    def state_at(self, time: float) -> dict[str, float]:
        """Return the optimum's state at a time of its clock, straight between the nodes."""
        optimum = self.optimum
        return {name: float(np.interp(time, optimum.time, optimum[name])) for name in self._names}

    def solve(
        self,
        session: SolverSession,
        state: Mapping[str, float],
        leg: int,
        *,
        deviations: Mapping[str, float] | None = None,
        gates: int | None = None,
        price: float = PRICE,
    ) -> Continuation:
        """Return the fastest flight from a state on; there is always one.

        Args:
            session: solves, by the primary solver alone.
            state: by name (SI), at least `PLACE_NAMES`; those that are missing are the optimum's at its place, and may
                be far away.
            leg: on which the state is, from 0.
            deviations: how well the states are known, by name; None for `usual_deviations`.
            gates: the flight ends at the so many-th gate ahead, in the optimum's state but for its speed; None for
                the finish, where it ends as well if no flight joins the optimum that soon.
            price: of a deviation, s.

        Raises:
            SolverCrash: the solver process died.
        """
        time = self.time_of(state, leg)
        start = self._start(state, leg, time, deviations)
        last = len(self.problem.phases) if gates is None else min(leg + gates, len(self.problem.phases))
        rest, guess, node = self._rest(leg, time, last)
        behind = 0.0
        if last < len(self.problem.phases):
            rest, behind = self._joining(rest, last)
        start = start.aligned(guess.state[:, 0])
        free, durations = _free_first(replace(rest, start=self._norm), guess.durations)
        soft = soften_start(free, start.named, start.sigma, weight=price)
        layout, attempts = Layout(soft), _Attempts(session, soft, start)
        multipliers = self._multipliers_of(layout, node, price)
        solution = attempts.solve(replace(guess, durations=durations), multipliers)
        if solution is None and last < len(self.problem.phases):  # it cannot join the optimum that soon
            return self.solve(session, state, leg, deviations=deviations, price=price)
        iterate, relaxed = (guess, start.apart(guess)) if solution is None else project(solution.iterate)
        if len(iterate.durations) > len(rest.phases):  # its first interval is a phase
            first, second, *others = iterate.durations.tolist()
            iterate = replace(iterate, durations=np.array([first + second, *others]))
            rest = _with_first_share(rest, first / (first + second))
        # The prices of a start that gives way are those of giving way: what it gains is counted at the optimum's.
        slopes, binding = self._costates[:, max(node - 1, 0)], ""
        prices = dict(zip(self._names, slopes.tolist(), strict=True))
        gained = float(slopes @ (start.state - iterate.state[:, 0]))
        if solution is not None:
            binding = _binding(layout, solution.multipliers)
            prices = prices if relaxed > RELAXED_MIN else self._prices(layout, solution.multipliers)
        following = sum(weight * iterate.state[self._names.index(name), -1] for name, weight in _costs(rest).items())
        return Continuation(
            trajectory=trajectory_of(rest, iterate),
            cost=float(iterate.durations.sum()) + behind + float(following) + gained,
            relaxed=relaxed,
            changes=start.changes(iterate.state[:, 0], relaxed),
            binding=binding,
            prices=prices,
            leg=leg,
            time=time,
            solved=solution is not None,
            iterations=attempts.iterations,
            seconds=attempts.seconds,
        )

    @property
    def _norm(self) -> Boundary:
        """The start of every rest, besides its state: a unit quaternion."""
        crossing = self.flight.observation
        values = self.problem.start.values[: len(crossing.parameters)]
        return Boundary("now", {"attitude_norm": Interval.exactly(1.0)}, crossing, values)

    def _start(
        self, state: Mapping[str, float], leg: int, time: float, deviations: Mapping[str, float] | None
    ) -> "_MeasuredStart":
        """Return a state as a start: completed by the optimum's, of which nothing is beyond its own limits.

        What an aircraft would do that is beyond the limits of a state is not known.
        """
        known = self.state_at(time)
        sigma = {**usual_deviations(self.states), **(deviations or {})}
        measured: list[float] = []
        limited: list[float] = []
        for quantity in self.states:
            name = quantity.name
            if name not in state:
                sigma[name] *= UNKNOWN_FACTOR
            limits = narrow_range(quantity, self.problem.phases[leg].bounds)
            measured.append(state.get(name, known[name]))
            limited.append(min(max(measured[-1], limits.lower), limits.upper))
        own = {name: sigma[name] for name in self._names}
        return _MeasuredStart(self._names, np.array(measured), np.array(limited), own)

    def _prices(self, layout: Layout, multipliers: Multipliers) -> dict[str, float]:
        """Return the derivatives of the cost by the states in which the rest begins."""
        prices = dict.fromkeys(self._names, 0.0)
        for index, quantity in _start_rows(layout):
            prices[_state_and_end(quantity)[0]] -= float(multipliers.constraints[index]) / quantity.scale
        return prices

    def _rest(self, leg: int, time: float, last: int) -> tuple[Problem, Iterate, int]:
        """Return the problem from a time of the optimum up to a leg, the optimum's flight there, and its first node."""
        optimum = self.optimum
        first, end = optimum.first_node[leg : leg + 2].tolist()
        node = int(np.clip(np.searchsorted(optimum.time, time, side="right") - 1, first, end - 1))
        share = float((time - optimum.time[node]) / (optimum.time[node + 1] - optimum.time[node]))
        if share > 1.0 - SNAP and node < end - 1:
            node, share = node + 1, 0.0
        share = 0.0 if share < SNAP else min(share, 1.0 - SNAP)
        part, left = _cut(self.problem.phases[leg], node - first, share)
        finish = int(optimum.first_node[last])
        state = self._iterate.state[:, node : finish + 1].copy()
        state[:, 0] += share * (state[:, 1] - state[:, 0])
        durations = self._iterate.durations[leg:last].copy()
        durations[0] *= left
        problem = replace(self.problem, phases=(part, *self.problem.phases[leg + 1 : last]))
        return problem, Iterate(durations, state, self._iterate.control[:, node:finish]), node

    def _joining(self, rest: Problem, last: int) -> tuple[Problem, float]:
        """Return a problem that ends in the optimum's state at a gate but for its speed, and what follows, s.

        The largest entry of the quaternion follows from the others, and what counts rolls begins anew.
        """
        node = int(self.optimum.first_node[last])
        state, speed = self._iterate.state[:, node], self._names.index(SPEED)
        slope, largest = float(self._costates[speed, node - 1]), int(np.argmax(np.abs(state[self._quaternion])))
        bounds: dict[str, Interval] = {}
        for row, (name, value) in enumerate(zip(self._names, state.tolist(), strict=True)):
            if row == speed:
                bounds[name] = Interval(value - JOINING_SPEED, value + JOINING_SPEED)
            elif row == self._quaternion[largest]:
                bounds[name] = Interval(lower=0.0) if value > 0.0 else Interval(upper=0.0)
            elif name not in RollCounter.names():  # these begin anew where they matter
                bounds[name] = Interval.exactly(value)
        end = rest.phases[-1].without_path_constraints_at(len(rest.phases[-1].fractions))
        phases = (*rest.phases[:-1], replace(end, end=Boundary("", bounds)))
        behind = self.optimum.race_time - float(self.optimum.time[node]) - slope * float(state[speed])
        return replace(rest, phases=phases, objective=replace(rest.objective, terminal={SPEED: slope})), behind

    def _multipliers_of(self, target: Layout, node: int, price: float) -> Multipliers:
        """Return the multipliers that the optimum has from a node on, in the places of a problem of the rest."""
        source, known, count = self._layout, self._multipliers, self._layout.n_x
        constraints, bounds = np.zeros(target.constraints), np.zeros(target.unknowns)
        stop = node + target.intervals
        constraints[target.gap_index[:, :count]] = known.constraints[source.gap_index[node:stop, :count]]
        constraints[target.gap_index[:, count]] = -price  # the costate of the size
        constraints[target.gap_index[:, -1]] = known.constraints[source.gap_index[node:stop, -1]]
        # At its last node the rest may lack what the leg behind asks for, and at its first one all is otherwise.
        for first, end in ((0, target.intervals - 1), (target.intervals - 1, target.intervals)):
            own = _rows_between(target, first, end)
            whole = _rows_between(source, node + first, node + end)
            if len(own) == len(whole):
                constraints[own] = known.constraints[whole]
        for index, quantity in _start_rows(target):
            name, end = _state_and_end(quantity)
            slope = self._costates[self._names.index(name), max(node - 1, 0)]
            if (slope < 0.0) == (end == AT_MOST):
                constraints[index] = -slope * quantity.scale
        bounds[target.state_index[1:, :count]] = known.bounds[source.state_index[node + 1 : stop + 1]]
        final = self._costates[:, stop - 1] * source.scale[source.state_index[stop]]
        if stop < source.intervals:
            bounds[target.state_index[-1, :count]] = final
        bounds[target.control_index] = known.bounds[source.control_index[node:stop]]
        return Multipliers(constraints, bounds)


def _cut(phase: Phase, node: int, share: float) -> tuple[Phase, float]:
    """Return what is left of a phase from a share of the interval behind a node on, and which part of it that is."""
    part = phase.part(slice(node, None)).without_path_constraints_at(0)
    fractions = np.array(phase.fractions[node:])
    before = share * fractions[0] / fractions.sum()
    fractions[0] *= 1.0 - share
    left = float(fractions.sum())
    constraints = [
        constraint
        if constraint.at is None
        else replace(constraint, at=max(constraint.at - before, 0.0) / (1.0 - before))
        for constraint in part.path_constraints
    ]
    duration = Interval(0.0, phase.duration.upper)
    rest = replace(
        part, fractions=tuple((fractions / left).tolist()), path_constraints=tuple(constraints), duration=duration
    )
    return rest, left


def _free_first(problem: Problem, durations: Array) -> tuple[Problem, Array]:
    """Return a problem whose first moment knows no limits along the path, and its durations, s.

    What an aircraft does at this moment is a fact; from the next node on it can be changed. The first interval becomes
    a phase of its own, which takes as long as the optimum's; where a leg has no other, it ends at the gate as before.
    """
    system, first, behind = problem.system, problem.phases[0], problem.phases[1:]
    boundless = tuple(replace(quantity, lower=-math.inf, upper=math.inf) for quantity in system.path)
    if len(first.fractions) > 1:
        share = first.fractions[0]
        seconds, behind = float(share * durations[0]), (first.part(slice(1, None)), *behind)
        durations = np.array([seconds, durations[0] - seconds, *durations[1:]])
        first = Phase(first.name, (1.0,), Interval.exactly(seconds), bounds=first.bounds)
    else:
        first = replace(first, path_constraints=())
    phases = [replace(first, bounds=_of_states(first, system))]
    for phase in behind:
        limits = {quantity.name: narrow_range(quantity, phase.bounds) for quantity in system.path}
        phases.append(replace(phase, bounds={**phase.bounds, **limits}))
    return replace(problem, system=replace(system, path=boundless), phases=tuple(phases)), durations


def _of_states(phase: Phase, system: System) -> dict[str, Interval]:
    """Return the bounds of a phase but for those along the path."""
    names = {quantity.name for quantity in system.path}
    return {name: at for name, at in phase.bounds.items() if name not in names}


def _with_first_share(problem: Problem, share: float) -> Problem:
    """Return a problem whose first interval takes another share of its leg."""
    first = problem.phases[0]
    others = np.array(first.fractions[1:]) * (1.0 - share) / sum(first.fractions[1:])
    return replace(problem, phases=(replace(first, fractions=(share, *others.tolist())), *problem.phases[1:]))


def _costs(problem: Problem) -> Mapping[str, float]:
    """Return what follows the end of a problem by its final state, s per unit; the finish has rewards that are none."""
    costs = problem.objective.terminal
    return costs if SPEED in costs else {}


def _rows_between(layout: Layout, first: int, end: int) -> Indices:
    """Return the places of the limits at the nodes behind one and up to another."""
    return layout.row_index[(layout.rows.node > first) & (layout.rows.node <= end)]


def _start_rows(layout: Layout) -> list[tuple[int, Quantity]]:
    """Return the places of the limits on the states in which the rest begins, and what they limit."""
    rows = [
        (int(layout.row_index[row]), layout.rows.row(int(row)).quantity)
        for row in np.flatnonzero(layout.rows.node == 0)
    ]
    return [(index, quantity) for index, quantity in rows if quantity.name.endswith((AT_MOST, AT_LEAST))]


def _state_and_end(quantity: Quantity) -> tuple[str, str]:
    end = AT_MOST if quantity.name.endswith(AT_MOST) else AT_LEAST
    return quantity.name.removesuffix(end), end


def _binding(layout: Layout, multipliers: Multipliers) -> str:
    """Return the limit behind the start with the largest multiplier, for people; empty without any."""
    places = layout.row_index[layout.rows.node > 0]
    if not len(places):
        return ""
    return layout.describe(int(places[np.argmax(np.abs(multipliers.constraints[places]))]))


def _place_and_velocity(histories: Mapping[str, Array]) -> Array:
    """Return place and scaled velocity, shape (6, n), in which a state is near another one."""
    R = rotation([histories[name] for name in QUATERNION])
    velocity = np.stack([VELOCITY_SECONDS * histories["V_K"] * row[0] for row in R])
    return np.vstack([histories["x"], histories["y"], histories["z"], velocity])
