"""Elastic problems: the least relaxation of all parameters of a race at once, or of one, and which of them help.

A race is stated along one plan and on one mesh, with its numbers and with milder ones; the problem between the two is
solved for the least relaxation (`airrace.optimal_control.elastic`). The multipliers of its limits are the savings of
a usual step of each parameter, to first order.
"""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from airrace.model.parameters import Parameter
from airrace.optimal_control.elastic import (
    AT_LEAST,
    AT_MOST,
    PATH,
    Moves,
    Owner,
    augment,
    boundaries_of,
    difference,
    elastic,
    project,
)
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.optimality import costates
from airrace.optimal_control.problem import Boundary, Iterate, Objective, PathConstraint, Problem
from airrace.optimal_control.replay import interval_durations
from airrace.optimal_control.solvers.interface import SolverOptions
from airrace.optimal_control.solvers.solver import ProgramSolution
from airrace.optimal_control.trajectory import Array
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_problem import PerturbedProblem, StageProblem
from airrace.race import Race

OPTIONS = SolverOptions(tolerance=1e-4, iterations_max=300, barrier=0.05, curvature=False)
"""A guess that keeps everything but the gaps needs no line search at first, with which two crowds took 300 iterations
instead of 52 and were not distinguished."""


WEIGHT = 100.0
"""The weight of a usual step of every parameter."""
ORIGINAL_WEIGHT = 1e-2
"""The factor on the weights of race time and controls. A step then costs 10,000 s, so that no limit is relaxed for the
sake of time: with 1, Rovinj with 1.2 g was relaxed to 1.4 g, which saves 40 s."""
SINGLE_ITERATIONS_MAX = 175
"""The iterations in which one limit alone must help. Those that helped on eight courses spoilt by one limit each took
17 to 161; those that did not took 116 to 300 to fail."""
STEPS_MAX = 60.0
"""The most usual steps by which all parameters give way at once."""
NEEDED = 5e-3
"""The number of usual steps from which a relaxation counts; the barrier leaves less than a thousandth."""
MULTIPLIER_MIN = 1e-7
"""The multiplier, per scale, below which a limit is not active."""


@dataclasses.dataclass(frozen=True, eq=False)
class Relaxed:
    """A flight with limits that have given way.

    Attributes:
        solver: that relaxed them.
        flight: on the mesh that was solved on.
        steps: how far they gave way, in steps from the numbers as they are to the milder ones.
        multipliers: of limits, by owner and name.
        along: those of path quantities node by node, by name; each of shape (N + 1,).
        costates: derivatives of the relaxation with respect to each state, shape (n_x, N).
        places: the attribution of each phase or boundary, by its name. The start is none of them: where only a faster
            one would do, what is infeasible comes later.
    """

    solver: "ElasticSolver"
    flight: Iterate
    steps: float
    multipliers: Mapping[tuple[Owner, str], float]
    along: Mapping[str, Array]
    costates: Array
    places: Mapping[str, float]

    @property
    def is_needed(self) -> bool:
        """Whether limits had to give way at all."""
        return self.steps > NEEDED

    @property
    def where(self) -> str:
        """The phase or boundary with the largest attribution; empty without any."""
        return max(self.places, key=lambda name: self.places[name], default="")


class ElasticSolver:
    """A solver of elastic problems of one race, along one plan, on one mesh."""

    def __init__(self, race: Race, stage_problem: StageProblem, mesh: Sequence[tuple[float, ...]]) -> None:
        self.mesh = mesh
        self._perturbed = PerturbedProblem(race, stage_problem, mesh)

    def formulation(self, race: Race) -> StageProblem:
        """Return the problem of a race that differs in numbers, along the same plan."""
        return self._perturbed.formulation(race)

    def solve_all(
        self,
        session: SolverSession,
        race: Race,
        parameters: Sequence[Parameter[Race]],
        start: Iterate,
        start_steps: float = 1.0,
    ) -> Relaxed | None:
        """Return the least relaxation of all parameters at once, each by as many steps; None if none is found.

        Args:
            session: solves.
            race: with its limits as they are.
            parameters: that give way.
            start: a flight.
            start_steps: the steps by which they give way there.
        """
        milder = race
        for parameter in parameters:
            milder = parameter.set(milder, parameter.milder)
        start, most = augment(start, start_steps), OPTIONS.iterations_max
        return self._solve(session, race, milder, start, "every limit giving way", most, STEPS_MAX)

    def solve_single(
        self, session: SolverSession, race: Race, parameter: Parameter[Race], near: Relaxed, estimate: float
    ) -> Relaxed | None:
        """Return the least relaxation of one parameter; None if that alone does not help, or is not found.

        Args:
            session: solves.
            race: with its limits as they are.
            parameter: that gives way.
            near: the race with all parameters relaxed.
            estimate: the steps that are expected.
        """
        start = augment(near.flight, min(max(estimate, 1.0), 0.9 * parameter.steps_max))
        milder, purpose = parameter.set(race, parameter.milder), f"{parameter.key} giving way"
        most = SINGLE_ITERATIONS_MAX
        return self._solve(session, race, milder, start, purpose, most, parameter.steps_max)

    def attribution(self, race: Race, parameter: Parameter[Race], at: Relaxed) -> float:
        """Return the first-order saving of a usual step of a parameter, in steps of all parameters together."""
        nominal = self._perturbed.problem(race)
        change = difference(nominal, self._perturbed.problem(parameter.set(race, parameter.milder)))
        return _saving(change, nominal, at) / WEIGHT

    def _solve(
        self,
        session: SolverSession,
        race: Race,
        milder: Race,
        start: Iterate,
        purpose: str,
        iterations_max: int,
        steps_max: float,
    ) -> Relaxed | None:
        nominal, relaxed = self._perturbed.problem(race), self._perturbed.problem(milder)
        objectives = _with_small_objective(nominal), _with_small_objective(relaxed)
        problem = elastic(*objectives, weight=WEIGHT, furthest=steps_max)
        session.progress.activity(purpose, 0, 0)
        iterations_max = min(iterations_max, session.settings.solver.iterations_max)
        options = dataclasses.replace(OPTIONS, iterations_max=iterations_max)
        solution = session.attempt(problem, start, purpose, session.settings.solver.primary, options)
        if solution is None or not solution.success:
            return None
        return self._relaxed(problem, solution, nominal, relaxed)

    def _relaxed(self, problem: Problem, solution: ProgramSolution, nominal: Problem, milder: Problem) -> Relaxed:
        """Return the relaxed flight with the multipliers of its limits and the attribution of each place."""
        layout, lam = Layout(problem), solution.multipliers.constraints
        owners = {id(observer.bounds): owner for owner, observer in _observers(problem)}
        amounts = _amounts(problem)
        multipliers: dict[tuple[Owner, str], float] = {}
        along: dict[str, Array] = {}
        places: dict[str, float] = {}
        for row, place in zip(layout.flat_rows, layout.row_index.tolist(), strict=True):
            multiplier = float(lam[place]) / row.quantity.scale
            if abs(multiplier) < MULTIPLIER_MIN:
                continue
            owner = PATH if row.source < 0 else owners[id(layout.output_samples[row.source].bounds)]
            name = row.quantity.name
            multipliers[owner, name] = multipliers.get((owner, name), 0.0) + multiplier
            if owner == PATH:
                along.setdefault(name, np.zeros(layout.intervals + 1))[row.node] += multiplier
            phase = problem.phases[int(layout.phase_of_interval[max(row.node - 1, 0)])]
            at = layout.output_samples[row.source].name if owner[0] == "boundary" else phase.name
            places[at] = places.get(at, 0.0) + abs(multiplier * amounts.get((owner, name), 0.0))
        flight, steps = project(solution.iterate)
        relaxation = Relaxed(self, flight, steps, multipliers, along, costates(layout, lam)[:-1], {})
        for name, cost in _costs_at_nodes(difference(nominal, milder), nominal, relaxation):
            places[name] = places.get(name, 0.0) + abs(cost)
        places.pop(nominal.start.name, None)
        return dataclasses.replace(relaxation, places={name: share for name, share in places.items() if share > 0.0})


def _with_small_objective(problem: Problem) -> Problem:
    """Return a problem in which race time hardly counts beside the relaxation."""
    weight, own = ORIGINAL_WEIGHT, problem.objective
    regularisation = {name: weight * scale for name, scale in own.regularisation.items()}
    return dataclasses.replace(problem, objective=Objective(time=weight * own.time, regularisation=regularisation))


def _observers(problem: Problem) -> Iterator[tuple[Owner, Boundary | PathConstraint]]:
    """Yield all boundaries and path constraints with their keys as owners of limits."""
    yield from boundaries_of(problem)
    for index, phase in enumerate(problem.phases):
        for number, constraint in enumerate(phase.path_constraints):
            yield ("path constraint", index, number), constraint


def _amounts(problem: Problem) -> dict[tuple[Owner, str], float]:
    """Return by how much each limit of an elastic problem gives way in a step, by owner and name."""
    parts = [(PATH, problem.system.parameters, problem.parameters)]
    parts += [
        (owner, observer.observation.parameters, observer.values)
        for owner, observer in _observers(problem)
        if observer.observation is not None
    ]
    return {
        (owner, quantity.name.removeprefix("d_")): value
        for owner, declared, values in parts
        for quantity, value in zip(declared, values, strict=True)
        if quantity.name.endswith((AT_MOST, AT_LEAST))
    }


def _saving(change: Moves, nominal: Problem, at: Relaxed) -> float:
    """Return the first-order saving of a change of numbers: in limits, outputs of boundaries and equations."""
    saving = 0.0
    for owner, shifts in change.ranges.items():
        for name, shift in shifts.items():
            saving += at.multipliers.get((owner, f"{name}{AT_MOST}"), 0.0) * shift.upper
            saving += at.multipliers.get((owner, f"{name}{AT_LEAST}"), 0.0) * shift.lower
    for _, cost in _costs_at_nodes(change, nominal, at):
        saving -= cost
    if change.parameters.any():
        saving -= _cost_in_equations(change.parameters, nominal, at)
    return max(saving, 0.0)


def _costs_at_nodes(change: Moves, nominal: Problem, at: Relaxed) -> Iterator[tuple[str, float]]:
    """Yield the cost of a change of parameters in the outputs at single nodes, with the name of the passage or leg."""
    for owner, observer in _observers(nominal):
        step, observation = change.values.get(owner), observer.observation
        if step is None or observation is None:
            continue
        node, name = nominal.first_node[owner[1]], observer.name
        if isinstance(observer, PathConstraint):
            if observer.at is None:
                continue
            phase = nominal.phases[owner[1]]
            node, name = node + phase.nearest_node(observer.at), phase.name
        state, b = at.flight.state[:, node], np.asarray(observer.values)
        values = np.asarray(observation.values(state, b + step) - observation.values(state, b)).ravel().tolist()
        costs = (
            at.multipliers.get((owner, f"{quantity.name}{end}"), 0.0) * value
            for quantity, value in zip(observation.quantities, values, strict=True)
            for end in ("", AT_MOST, AT_LEAST)
        )
        yield name, sum(costs)


def _cost_in_equations(change: Array, nominal: Problem, at: Relaxed) -> float:
    """Return the increase of the relaxation, to first order, with other parameters in the equations of flight."""
    system, intervals = nominal.system, nominal.intervals
    before = np.repeat(np.asarray(nominal.parameters)[:, None], intervals, axis=1)
    after = before + change[:, None]
    state, control = at.flight.state[:, 1:], at.flight.control
    rates = system.rates.map(intervals)
    slopes = np.asarray(rates(state, control, after) - rates(state, control, before))
    increase = float(np.sum(at.costates * slopes * interval_durations(nominal, at.flight.durations)))
    if system.path_values is not None:
        path = system.path_values.map(intervals)
        values = np.asarray(path(state, control, after) - path(state, control, before))
        zeros = np.zeros(intervals + 1)
        for quantity, row in zip(system.path, values, strict=True):
            for end in (AT_MOST, AT_LEAST):
                increase += float(at.along.get(f"{quantity.name}{end}", zeros)[1:] @ row)
    return increase
