"""The problem language: what is to be optimised, and nothing about how.

A problem is a `System` in phases. Each phase has a mesh, limits along its path, a range for its duration and
conditions at its end; the first also has conditions at its start. States are continuous from phase to phase, unless a
phase ends in a jump: a rocket that drops a stage.

A page of Python states a textbook problem (see tests/validation). A free constant (a parameter to be found) is a state
whose rate is zero; a periodic condition ties a state to such a constant through an `Observation`.
"""

import bisect
import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from airrace.optimal_control.quantities import Interval, Quantity, Vector
from airrace.optimal_control.runge_kutta import DORMAND_PRINCE_5, RungeKutta
from airrace.optimal_control.system import Observation, System
from airrace.optimal_control.trajectory import Array

WHOLE = 1e-6
"""The largest deviation from 1 of the sum of a phase's fractions (1).

The fractions that `1 / n` repeated n times, halving and merging leave of thousands of intervals miss it by less than
1e-12; a mesh that was mistyped misses it by a whole interval.
"""


@dataclass(frozen=True)
class Boundary:
    """A set of conditions at one instant, the start of the first phase or the end of a phase.

    Attributes:
        name: for messages, e.g. the gate's name.
        bounds: ranges by name: of states, or of the observation's quantities.
        observation: what is observed besides the states; None if only states are bounded.
        values: the observation's parameters (n_b,).
    """

    name: str = ""
    bounds: Mapping[str, Interval] = field(default_factory=dict[str, Interval])
    observation: Observation | None = None
    values: tuple[float, ...] = ()


@dataclass(frozen=True)
class PathConstraint:
    """A set of conditions on an observation along a phase: at every node of it, both ends included, or at one.

    Attributes:
        name: for messages, e.g. of a safety line.
        bounds: ranges by name of the observation's quantities.
        observation: what is observed.
        values: the observation's parameters (n_b,).
        exact: the same quantities of the same parameters, where the observation is but a smooth stand-in for them;
            certificates measure these.
        at: the share of the phase's duration (0 to 1) at whose nearest node alone it is asked for; None for all nodes.
    """

    name: str
    bounds: Mapping[str, Interval]
    observation: Observation
    values: tuple[float, ...]
    exact: Observation | None = None
    at: float | None = None

    def same_conditions(self, constraint: "PathConstraint") -> bool:
        """Return whether another one along its whole phase is the same."""
        if self.observation is not constraint.observation or self.exact is not constraint.exact:
            return False
        if self.at is not None or constraint.at is not None:
            return False
        return self.values == constraint.values and dict(self.bounds) == dict(constraint.bounds)


@dataclass(frozen=True)
class Phase:
    """A stretch of a flight, with its mesh, duration and conditions.

    Attributes:
        name: for messages.
        fractions: lengths of the mesh intervals as fractions of the phase's duration; they add up to 1.
        duration: allowed duration, s; the lower end must not be negative.
        end: conditions at the end of the phase.
        bounds: ranges of states, controls or path quantities within this phase; they narrow the system's own.
        path_constraints: what else holds along it.
        jump: what is added to states, by name and in their units, between the end of this phase and the start of
            the next: `{"m": -6840.0}` for a stage of 6840 kg that is dropped. Conditions at the end of this phase are
            asked of the states before it, those of the next phase of the states after it; path quantities are asked at
            the start of the next phase, not at the end of this one. The last phase has none.
    """

    name: str
    fractions: tuple[float, ...]
    duration: Interval
    end: Boundary = field(default_factory=Boundary)
    bounds: Mapping[str, Interval] = field(default_factory=dict[str, Interval])
    path_constraints: tuple[PathConstraint, ...] = ()
    jump: Mapping[str, float] = field(default_factory=dict[str, float])

    def nearest_node(self, share: float) -> int:
        """Return the number within the phase of the node nearest to a share of its duration; of two the first."""
        apart = np.abs(np.concatenate([[0.0], np.cumsum(self.fractions)]) - share)
        return int(np.argmax(apart <= apart.min() + WHOLE))

    def without_path_constraints_at(self, node: int) -> Self:
        """Return the phase without what is asked for at one node of it alone: where its state is known."""
        remaining = [c for c in self.path_constraints if c.at is None or self.nearest_node(c.at) != node]
        return replace(self, path_constraints=tuple(remaining))

    def part(self, intervals: slice) -> Self:
        """Return some successive intervals as a phase of their own, with what is asked for at one node of them."""
        fractions = np.array(self.fractions)
        before, whole = float(fractions[: intervals.start or 0].sum()), float(fractions[intervals].sum())
        constraints: list[PathConstraint] = []
        for constraint in self.path_constraints:
            if constraint.at is None:
                constraints.append(constraint)
                continue
            at = (constraint.at - before) / whole
            if -WHOLE <= at <= 1.0 + WHOLE:
                constraints.append(replace(constraint, at=min(max(at, 0.0), 1.0)))
        return replace(
            self, fractions=tuple((fractions[intervals] / whole).tolist()), path_constraints=tuple(constraints)
        )


@dataclass(frozen=True)
class StartCost:
    """The cost `sum_i weights_i c_i(x(0))` of the state at the start.

    Attributes:
        weights: by name of the observation's quantities, per unit of these.
        observation: what is observed of the first state, c; any smooth function of it.
        values: the observation's parameters (n_b,).
    """

    weights: Mapping[str, float]
    observation: Observation
    values: tuple[float, ...]


@dataclass(frozen=True)
class Objective:
    """The minimised functional: the time, costs of the states at both ends, and a cost of squared states and controls.

        time * t_f + sum_i terminal_i c_i(x(t_f)) + integral of sum_j regularisation_j (v_j / scale_j)^2 dt + start

    The c_i are states, or what an observation sees of the final state, which may be any smooth function of it. The v_j
    are controls or states; of states the sum counts those where each interval begins, which suits small weights. Any
    other cost that is integrated along the flight is a state of its own, whose rate is the integrand.

    Attributes:
        time: weight of the final time t_f, per s.
        terminal: weights by name: of states, or of the observation's quantities, per unit of these.
        regularisation: weights of states and controls by name, per s.
        observation: what is observed of the final state; None if only states are weighed.
        values: the observation's parameters (n_b,).
        start: the cost of the first state; None without one.
    """

    time: float = 1.0
    terminal: Mapping[str, float] = field(default_factory=dict[str, float])
    regularisation: Mapping[str, float] = field(default_factory=dict[str, float])
    observation: Observation | None = None
    values: tuple[float, ...] = ()
    start: StartCost | None = None

    @property
    def all_values(self) -> tuple[float, ...]:
        """The parameters of what is observed at the end, then of what is observed at the start."""
        return self.values if self.start is None else (*self.values, *self.start.values)


@dataclass(frozen=True)
class Problem:
    """An optimal control problem of one or several phases.

    Attributes:
        system: what is controlled.
        parameters: values of the system's parameters (n_p,).
        start: conditions at the start of the first phase.
        phases: in their order.
        objective: what is minimised.
        scheme: integrates an interval.
        time_scale: typical duration of a phase, s.
    """

    system: System
    parameters: tuple[float, ...]
    start: Boundary
    phases: tuple[Phase, ...]
    objective: Objective = field(default_factory=Objective)
    scheme: RungeKutta = DORMAND_PRINCE_5
    time_scale: float = 1.0

    @property
    def intervals(self) -> int:
        """The number of intervals of all phases together."""
        return sum(len(phase.fractions) for phase in self.phases)

    @property
    def mesh(self) -> list[tuple[float, ...]]:
        """The fractions of every phase."""
        return [phase.fractions for phase in self.phases]

    @property
    def first_node(self) -> list[int]:
        """The node at which each phase begins and, last, the final node."""
        nodes = [0]
        for phase in self.phases:
            nodes.append(nodes[-1] + len(phase.fractions))
        return nodes

    @property
    def jumps(self) -> Array:
        """The changes of every state at the end of every phase; shape (n_x, n)."""
        names = [quantity.name for quantity in self.system.states]
        jumps = np.zeros((len(names), len(self.phases)))
        for column, phase in enumerate(self.phases):
            jumps[:, column] = [phase.jump.get(name, 0.0) for name in names]
        return jumps

    def states_before_jump(self, state: Array) -> Array:
        """Return the states in which the intervals end, before any jump; shape (n_x, N).

        Args:
            state: at the nodes, as an `Iterate` has them: after the jump, where a phase ends in one; (n_x, N + 1).
        """
        if not any(phase.jump for phase in self.phases):
            return state[:, 1:]
        before = state[:, 1:].copy()
        before[:, np.array(self.first_node[1:]) - 1] -= self.jumps
        return before

    def phase_of(self, interval: int) -> Phase:
        """Return the phase that an interval belongs to."""
        return self.phases[bisect.bisect_right(self.first_node, interval) - 1]

    @property
    def boundaries(self) -> list[Boundary]:
        """The start, and the ends of all phases."""
        return [self.start, *(phase.end for phase in self.phases)]

    @property
    def observations(self) -> list[Observation]:
        """All observations, each once."""
        constraints = [constraint for phase in self.phases for constraint in phase.path_constraints]
        observers = (*self.boundaries, *constraints, self.objective)
        observations = [observer.observation for observer in observers if observer.observation is not None]
        if self.objective.start is not None:
            observations.append(self.objective.start.observation)
        return list({id(observation): observation for observation in observations}.values())


@dataclass(frozen=True, eq=False)
class Iterate:
    """The values of all unknowns of a problem: a guess, or a solution.

    Attributes:
        durations: of the phases, s; shape (n,).
        state: at the nodes, in SI; where a phase ends in a jump, the state after it, in which the next interval begins
            (`Problem.states_before_jump` has those before it). Shape (n_x, N + 1).
        control: held on the intervals; shape (n_u, N).
    """

    durations: Array
    state: Array
    control: Array


def uniform(intervals: int) -> tuple[float, ...]:
    """Make the fractions of a mesh of so many equal intervals."""
    return (1.0 / intervals,) * intervals


def corners(*states: Vector[float]) -> Array:
    """Put the states at the start and at the end of each phase side by side for `interpolate`; shape (n_x, n + 1)."""
    return np.array([state.join() for state in states], dtype=float).T


def interpolate(problem: Problem, durations: ArrayLike, state: ArrayLike, control: ArrayLike) -> Iterate:
    """Make a guess that runs straight from state to state.

    Args:
        problem: whose mesh the guess is on.
        durations: of the phases, s; shape (n,).
        state: at the start and at the end of each phase, there before any jump; shape (n_x, n + 1).
        control: held throughout; shape (n_u,).
    """
    at_corners, jumps = np.asarray(state, dtype=float), problem.jumps
    begin = at_corners[:, :1]
    columns = [begin]
    for index, phase in enumerate(problem.phases):
        share, end = np.cumsum(phase.fractions), at_corners[:, index + 1 : index + 2]
        columns.append(begin * (1 - share) + end * share)
        if phase.jump:
            begin = end + jumps[:, index : index + 1]
            columns[-1][:, -1:] = begin
        else:
            begin = end
    controls = np.repeat(np.asarray(control, dtype=float)[:, None], problem.intervals, axis=1)
    return Iterate(np.asarray(durations, dtype=float), np.hstack(columns), controls)


def require_valid(problem: Problem) -> None:
    """Refuse an inconsistent problem.

    Raises:
        ValueError: a name is misspelt or means two things, numbers are missing or too many, the fractions of a phase
            are no shares of it, a duration may be negative, a weight or a jump is no number, or a jump leads nowhere.
    """
    if not problem.phases:
        raise ValueError("the problem has no phases")
    if type(problem.scheme) is not RungeKutta:
        raise ValueError(f"the scheme is {problem.scheme!r}; give DORMAND_PRINCE_5, VERNER_7 or RK4")
    system = problem.system
    counts = Counter(quantity.name for quantity in (*system.states, *system.controls, *system.path))
    if twice := [name for name, count in counts.items() if count > 1]:
        raise ValueError(f"system {system.name!r} declares twice: {', '.join(sorted(twice))}")
    _require_count(f"system {system.name!r}", system.parameters, problem.parameters)
    _check_objective(system, problem.objective)
    for phase in problem.phases:
        _check_phase(system, phase)
    if problem.phases[-1].jump:
        raise ValueError(f"no phase follows the jump at the end of phase {problem.phases[-1].name!r}")
    _check_conditions("boundary", problem.start, system.states)


def _check_objective(system: System, objective: Objective) -> None:
    observed = objective.observation.quantities if objective.observation is not None else ()
    _require_known("the objective weighs unknown states", objective.terminal, (*system.states, *observed))
    if ambiguous := {quantity.name for quantity in system.states} & {quantity.name for quantity in observed}:
        raise ValueError(f"the objective may mean a state or what is observed: {', '.join(sorted(ambiguous))}")
    parameters = objective.observation.parameters if objective.observation is not None else ()
    _require_count("the objective", parameters, objective.values)
    weights = {"time": objective.time, **objective.terminal, **objective.regularisation}
    if (start := objective.start) is not None:
        _require_known("the cost of the start weighs unknown quantities", start.weights, start.observation.quantities)
        _require_count("the cost of the start", start.observation.parameters, start.values)
        weights |= {f"{name} at the start": weight for name, weight in start.weights.items()}
    regularisable = (*system.states, *system.controls)
    _require_known("the objective regularises unknown states or controls", objective.regularisation, regularisable)
    for name, weight in weights.items():
        if not math.isfinite(weight):
            raise ValueError(f"the objective weighs {name} by {weight}")
    for name, weight in objective.regularisation.items():
        if weight < 0.0:
            raise ValueError(f"the objective regularises {name} by {weight}, which must not be negative")


def _check_phase(system: System, phase: Phase) -> None:
    if type(phase.duration) is not Interval:
        raise ValueError(
            f"the duration of phase {phase.name!r} is {phase.duration!r}; give its range in s as Interval(0.01, 5.0)"
        )
    if not hasattr(phase.fractions, "__len__"):
        raise ValueError(
            f"the mesh of phase {phase.name!r} is {phase.fractions!r}; give fractions, as uniform(20) does"
        )
    # Comparisons with NaN are false, so conditions are stated so that NaN fails.
    if not all(fraction > 0.0 for fraction in phase.fractions) or not abs(sum(phase.fractions) - 1.0) <= WHOLE:
        raise ValueError(f"the fractions of phase {phase.name!r} are not positive, or do not add up to 1")
    if not phase.duration.lower >= 0.0:
        raise ValueError(f"phase {phase.name!r} may not last {phase.duration.lower} s")
    along = (*system.states, *system.controls, *system.path)
    _require_known(f"phase {phase.name!r} bounds unknown quantities", phase.bounds, along)
    _require_known(f"the jump at the end of phase {phase.name!r} changes unknown states", phase.jump, system.states)
    for name, change in phase.jump.items():
        if not math.isfinite(change):
            raise ValueError(f"the jump at the end of phase {phase.name!r} changes {name} by {change}")
    for constraint in phase.path_constraints:
        _check_conditions("path constraint", constraint, ())
        if constraint.at is not None and not 0.0 <= constraint.at <= 1.0:
            raise ValueError(
                f"path constraint {constraint.name!r} is placed at {constraint.at} of the duration of a phase"
            )
    _check_conditions("boundary", phase.end, system.states)


def _check_conditions(kind: str, place: Boundary | PathConstraint, states: tuple[Quantity, ...]) -> None:
    observed, parameters = (), ()
    if place.observation is not None:
        observed, parameters = place.observation.quantities, place.observation.parameters
    _require_known(f"{kind} {place.name!r} bounds unknown quantities", place.bounds, (*states, *observed))
    _require_count(f"{kind} {place.name!r}", parameters, place.values)


def _require_known(complaint: str, names: Mapping[str, Any], declared: Iterable[Quantity]) -> None:  # Any: values
    """Refuse undeclared names."""
    if unknown := names.keys() - {quantity.name for quantity in declared}:
        raise ValueError(f"{complaint}: {', '.join(sorted(unknown))}")


def _require_count(whose: str, declared: tuple[Quantity, ...], values: tuple[float, ...]) -> None:
    if len(values) != len(declared):
        raise ValueError(f"{whose} declares {len(declared)} parameters, and {len(values)} values are given")
