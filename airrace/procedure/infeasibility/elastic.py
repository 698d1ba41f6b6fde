"""Elastic problems: the least relaxation of all parameters of a race at once, or of one, and which of them help.

A race is stated along one plan and on one mesh, with its numbers and with milder ones; the problem between the two is
solved for the least relaxation (`airrace.optimal_control.elastic`). The multipliers of its limits tell what a usual
step of each parameter would spare.
"""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

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
from airrace.optimal_control.problem import Boundary, Iterate, Objective, Problem
from airrace.optimal_control.replay import interval_durations
from airrace.optimal_control.solvers.interface import SolverOptions
from airrace.optimal_control.solvers.solver import Solution
from airrace.parameters import Parameter
from airrace.planning.race import Race
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_problem import PerturbedProblem, StageProblem
from airrace.records import record
from airrace.trajectory import Array

OPTIONS = SolverOptions(tolerance=1e-4, iterations_max=300, barrier=0.1)


@record
class ElasticSettings:
    """The settings of elastic problems.

    Attributes:
        weight: of a usual step of every parameter.
        original_weight: factor on the weights of race time and controls. A step is then worth 10,000 s, so that no
            limit is relaxed for the sake of time: with 1, Rovinj with 1.2 g was relaxed to 1.4 g, which spares 40 s.
        single_iterations_max: iterations in which one limit alone must help. Those that helped on eight courses spoilt
            by one limit each took 17 to 161; those that did not took 116 to 300 to fail.
        steps_max: the most usual steps by which all parameters give way at once.
        needed: usual steps from which a relaxation counts; the barrier leaves less than a thousandth.
        multiplier_min: per scale, below which a limit is not active.
    """

    weight: float = 100.0
    original_weight: float = 1e-2
    single_iterations_max: int = 175
    steps_max: float = 60.0
    needed: float = 5e-3
    multiplier_min: float = 1e-7


ELASTIC = ElasticSettings()


@record
class Relaxed:
    """A flight with limits that have given way.

    Attributes:
        flight: on the mesh that was solved on.
        steps: how far they gave way, in steps from the numbers as they are to the milder ones.
        multipliers: of limits, by owner and name.
        along: those of path quantities node by node, by name; each of shape (N + 1,).
        costates: what the relaxation would be more with one unit more of each state, shape (n_x, N).
        places: the attribution of each phase or boundary, by its name. The start is none of them: where only a faster
            one would do, what cannot be flown comes later.
    """

    flight: Iterate
    steps: float
    multipliers: Mapping[tuple[Owner, str], float]
    along: Mapping[str, Array]
    costates: Array
    places: Mapping[str, float]

    @property
    def needed(self) -> bool:
        """Whether limits had to give way at all."""
        return self.steps > ELASTIC.needed

    @property
    def where(self) -> str:
        """The phase or boundary with the largest attribution; empty without any."""
        return max(self.places, key=lambda name: self.places[name], default="")


class ElasticSolver:
    """A solver of elastic problems of one race, along one plan, on one mesh."""

    def __init__(
        self, session: SolverSession, race: Race, flight: StageProblem, mesh: Sequence[tuple[float, ...]]
    ) -> None:
        self._session = session
        self.mesh = mesh
        self._perturbed = PerturbedProblem(race, flight, mesh)

    def flight(self, race: Race) -> StageProblem:
        """Return the flight of a race that differs in numbers, along the same plan."""
        return self._perturbed.formulation(race)

    def solve_all(self, race: Race, parameters: Sequence[Parameter[Race]], start: Iterate) -> Relaxed | None:
        """Return the least relaxation of all parameters at once, each by as many steps; None if none is found."""
        mild = race
        for parameter in parameters:
            mild = parameter.set(mild, parameter.milder)
        limits = OPTIONS.iterations_max, 1.0, ELASTIC.steps_max
        return self._least(race, mild, start, "every limit giving way", *limits)

    def solve_single(self, race: Race, parameter: Parameter[Race], near: Relaxed, estimate: float) -> Relaxed | None:
        """Return the least relaxation of one parameter; None if that alone does not help, or is not found.

        Args:
            race: with its limits as they are.
            parameter: that gives way.
            near: the race with all parameters relaxed.
            estimate: the steps that are expected.
        """
        mild, begin = parameter.set(race, parameter.milder), min(max(estimate, 1.0), 0.9 * parameter.steps_max)
        limits = ELASTIC.single_iterations_max, begin, parameter.steps_max
        return self._least(race, mild, near.flight, f"{parameter.key} giving way", *limits)

    def attribution(self, race: Race, parameter: Parameter[Race], at: Relaxed) -> float:
        """Return what a usual step of a parameter would spare, in steps of all parameters together."""
        nominal = self._perturbed.problem(race)
        change = difference(nominal, self._perturbed.problem(parameter.set(race, parameter.milder)))
        return _spared(change, nominal, at) / ELASTIC.weight

    def _problem(self, race: Race) -> Problem:
        """Return the problem of a race in which race time hardly counts beside the relaxation."""
        problem, weight = self._perturbed.problem(race), ELASTIC.original_weight
        regularisation = {name: weight * own for name, own in problem.objective.regularisation.items()}
        objective = Objective(time=weight * problem.objective.time, regularisation=regularisation)
        return dataclasses.replace(problem, objective=objective)

    def _least(
        self, nominal: Race, mild: Race, start: Iterate, purpose: str, most: int, begin: float, furthest: float
    ) -> Relaxed | None:
        problem = elastic(self._problem(nominal), self._problem(mild), weight=ELASTIC.weight, furthest=furthest)
        session = self._session
        session.progress.activity(f"no flight found; {purpose}", 0, 0)
        most = min(most, session.settings.solver.iterations_max)
        options = dataclasses.replace(OPTIONS, iterations_max=most)
        solution = session.attempt(problem, augment(start, begin), purpose, session.settings.solver.primary, options)
        if solution is None or not solution.success:
            return None
        return _with_places(
            _relaxed(problem, solution), self._perturbed.problem(nominal), self._perturbed.problem(mild)
        )


def _relaxed(problem: Problem, solution: Solution) -> Relaxed:
    """Return the relaxed flight with the multipliers of its limits and the attribution of each place."""
    layout, lam = Layout(problem), solution.multipliers.constraints
    owners: dict[int, Owner] = {id(one.bounds): owner for owner, one in boundaries_of(problem)}
    for index, phase in enumerate(problem.phases):
        owners |= {id(watch.bounds): ("watch", index, number) for number, watch in enumerate(phase.watches)}
    amounts = _amounts(problem)
    multipliers: dict[tuple[Owner, str], float] = {}
    along: dict[str, Array] = {}
    places: dict[str, float] = {}
    for row, place in zip(layout.flat_rows, layout.row_index.tolist(), strict=True):
        multiplier = float(lam[place]) / row.quantity.scale
        if abs(multiplier) < ELASTIC.multiplier_min:
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
    return Relaxed(flight, steps, multipliers, along, costates(layout, lam)[:-1], places)


def _amounts(problem: Problem) -> dict[tuple[Owner, str], float]:
    """Return by how much each limit of an elastic problem gives way in a step, by owner and name."""
    named = [(PATH, problem.system.parameters, problem.parameters)]
    named += [
        (owner, one.observation.parameters, one.values)
        for owner, one in boundaries_of(problem)
        if one.observation is not None
    ]
    named += [
        (("watch", index, number), watch.observation.parameters, watch.values)
        for index, phase in enumerate(problem.phases)
        for number, watch in enumerate(phase.watches)
    ]
    return {
        (owner, one.name.removeprefix("d_")): value
        for owner, declared, values in named
        for one, value in zip(declared, values, strict=True)
        if one.name.endswith((AT_MOST, AT_LEAST))
    }


def _with_places(at: Relaxed, nominal: Problem, mild: Problem) -> Relaxed:
    """Return a relaxation whose places include what changes in the parameters of boundaries."""
    places = dict(at.places)
    for boundary, spared in _spared_at_boundaries(difference(nominal, mild), nominal, at):
        places[boundary.name] = places.get(boundary.name, 0.0) + abs(spared)
    places.pop(nominal.start.name, None)
    return dataclasses.replace(at, places={name: share for name, share in places.items() if share > 0.0})


def _spared(change: Moves, nominal: Problem, at: Relaxed) -> float:
    """Return what a change of numbers would spare: of limits, of what boundaries observe, and in the equations."""
    spared = 0.0
    for owner, shifts in change.ranges.items():
        for name, shift in shifts.items():
            spared += at.multipliers.get((owner, f"{name}{AT_MOST}"), 0.0) * shift.upper
            spared += at.multipliers.get((owner, f"{name}{AT_LEAST}"), 0.0) * shift.lower
    for _, value in _spared_at_boundaries(change, nominal, at):
        spared -= value
    if change.parameters.any():
        spared -= _in_equations(change.parameters, nominal, at)
    return max(spared, 0.0)


def _spared_at_boundaries(change: Moves, nominal: Problem, at: Relaxed) -> Iterator[tuple[Boundary, float]]:
    """Yield the multipliers' sum over what a change of each boundary's parameters does to what it observes."""
    for owner, boundary in boundaries_of(nominal):
        step, observation = change.values.get(owner), boundary.observation
        if step is None or observation is None:
            continue
        state, b = at.flight.state[:, nominal.first_node[owner[1]]], np.asarray(boundary.values)
        values = np.asarray(observation.values(state, b + step) - observation.values(state, b)).ravel()
        yield (
            boundary,
            sum(
                at.multipliers.get((owner, f"{one.name}{end}"), 0.0) * float(value)
                for one, value in zip(observation.quantities, values, strict=True)
                for end in ("", AT_MOST, AT_LEAST)
            ),
        )


def _in_equations(change: Array, nominal: Problem, at: Relaxed) -> float:
    """Return what the relaxation would be more, to first order, with other parameters in the equations of flight."""
    system, intervals = nominal.system, nominal.intervals
    before = np.repeat(np.asarray(nominal.parameters)[:, None], intervals, axis=1)
    after = before + change[:, None]
    state, control = at.flight.state[:, 1:], at.flight.control
    rates = system.rates.map(intervals)
    slopes = np.asarray(rates(state, control, after) - rates(state, control, before))
    more = float(np.sum(at.costates * slopes * interval_durations(nominal, at.flight.durations)))
    if system.path_values is not None:
        path = system.path_values.map(intervals)
        values = np.asarray(path(state, control, after) - path(state, control, before))
        nothing = np.zeros(intervals + 1)
        for quantity, row in zip(system.path, values, strict=True):
            for end in (AT_MOST, AT_LEAST):
                more += float(at.along.get(f"{quantity.name}{end}", nothing)[1:] @ row)
    return more
