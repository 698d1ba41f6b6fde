"""Races whose limits give way: the least relaxation of all parameters at once, or of one, and which of them help.

The race is stated along one plan and on one mesh, for numbers as they are and for milder ones, and the problem between
the two is solved for the least relaxation, see `airrace.optimal_control.elastic`. At that solution the multipliers of
the limits are the blame: what a usual step of each relaxable parameter would spare of the relaxation.
"""

import dataclasses
from collections.abc import Mapping, Sequence

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
from airrace.planning.race import Race
from airrace.procedure.infeasibility.relaxable import RelaxableParameter
from airrace.procedure.perturbed import PerturbedProblem
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_problem import Flight
from airrace.records import record
from airrace.trajectory import Array

WEIGHT = 100.0
"""The weight of a usual step of every relaxable parameter that gives way."""
ORIGINAL_OBJECTIVE_WEIGHT = 1e-2
"""The factor on the weights of race time and controls beside it (1).

A step is then worth 10,000 s, so no limit is relaxed for the sake of time: with a factor of 1 Rovinj with 1.2 g was
relaxed to 1.4 g, which spares 40 s of 174 s, though 1.2 g is enough.
"""
OPTIONS = SolverOptions(tolerance=1e-4, iterations_max=300, barrier=0.1)
"""The options of such a solve; a hundredth of a step is more than anybody asks for."""
ALONE_ITERATIONS_MAX = 175
"""The number of iterations in which one limit alone must be seen to help.

Those that helped on eight courses spoilt by one limit each took 17 to 161; those that did not took 116 to 300 to fail.
"""
FURTHEST = 60.0
"""The largest number of usual steps by which all relaxable parameters give way at once."""
NONE_NEEDED = 5e-3
"""The relaxation below which none is needed (usual steps); the barrier leaves less than a thousandth."""
NO_BLAME = 1e-7
"""The multiplier (per scale) below which a limit is not to blame."""


@record
class Relaxed:
    """A flight with limits that have given way.

    Attributes:
        flight: on the mesh that was solved on.
        steps: how far they gave way, in steps from the numbers as they are to the milder ones.
        pulls: the multipliers of limits, by owner and name.
        along: those of path quantities node by node, by name; each of shape (N + 1,).
        costates: what the relaxation would be more with one unit more of each state, shape (n_x, N).
        places: how much each phase or boundary is to blame, by its name.
    """

    flight: Iterate
    steps: float
    pulls: Mapping[tuple[Owner, str], float]
    along: Mapping[str, Array]
    costates: Array
    places: Mapping[str, float]

    @property
    def needed(self) -> bool:
        """Whether limits had to give way at all."""
        return self.steps > NONE_NEEDED

    @property
    def where(self) -> str:
        """The phase or boundary that is most to blame; empty where nothing is.

        The start is none of them: where only a faster one would do, what cannot be flown comes later.
        """
        return max(self.places, key=lambda name: self.places[name], default="")


class ElasticSolver:
    """A solver of elastic problems of one race, along one plan, on one mesh."""

    def __init__(self, session: SolverSession, race: Race, flight: Flight, mesh: Sequence[tuple[float, ...]]) -> None:
        self._session = session
        self.mesh = mesh
        self._varied = PerturbedProblem(race, flight, mesh)

    def flight(self, race: Race) -> Flight:
        """Return the flight of a race that differs in numbers, along the same plan."""
        return self._varied.varied(race)

    def problem(self, race: Race) -> Problem:
        """Return the problem of a race in which only the relaxation counts, and hardly its race time."""
        problem = self._varied.problem(race)
        was = problem.objective
        hurried = {name: ORIGINAL_OBJECTIVE_WEIGHT * weight for name, weight in was.regularisation.items()}
        return dataclasses.replace(
            problem, objective=Objective(time=ORIGINAL_OBJECTIVE_WEIGHT * was.time, regularisation=hurried)
        )

    def together(self, race: Race, relaxables: Sequence[RelaxableParameter], start: Iterate) -> Relaxed | None:
        """Return the least relaxation of all parameters at once, each by as many steps; None if it is not found."""
        mild = race
        for relaxable in relaxables:
            mild = relaxable.changed(mild, relaxable.milder)
        purpose = "every limit giving way"
        return self._least(race, mild, start, purpose, OPTIONS.iterations_max, begin=1.0, furthest=FURTHEST)

    def alone(self, race: Race, relaxable: RelaxableParameter, near: Relaxed, estimate: float) -> Relaxed | None:
        """Return the least relaxation of one relaxable parameter; None if that alone does not help, or it is not found.

        Args:
            race: with its limits as they are.
            relaxable parameter: that gives way.
            near: the race with all relaxable parameters relaxed.
            estimate: the steps by which the relaxable parameter is expected to give way.
        """
        return self._least(
            race,
            relaxable.changed(race, relaxable.milder),
            near.flight,
            f"{relaxable.key} giving way",
            ALONE_ITERATIONS_MAX,
            begin=min(max(estimate, 1.0), 0.9 * relaxable.steps_max),
            furthest=relaxable.steps_max,
        )

    def blame(self, race: Race, relaxable: RelaxableParameter, at: Relaxed) -> float:
        """Return what a usual step of a parameter would spare, in steps of all parameters together."""
        strict, mild = self._varied.problem(race), self._varied.problem(relaxable.changed(race, relaxable.milder))
        return _spared(difference(strict, mild), strict, at) / WEIGHT

    def _least(
        self, strict: Race, mild: Race, start: Iterate, purpose: str, most: int, *, begin: float, furthest: float
    ) -> Relaxed | None:
        problem = elastic(self.problem(strict), self.problem(mild), weight=WEIGHT, furthest=furthest)
        self._session.progress.activity(f"no flight found; {purpose}", 0, 0)
        most = min(most, self._session.settings.solver.iterations_max)
        options = dataclasses.replace(OPTIONS, iterations_max=most)
        solution = self._session.attempt(
            problem, augment(start, begin), purpose, self._session.settings.solver.primary, options
        )
        if solution is None or not solution.success:
            return None
        return _with_places(_relaxed(problem, solution), self._varied.problem(strict), self._varied.problem(mild))


def _relaxed(problem: Problem, solution: Solution) -> Relaxed:
    """Return the relaxed flight with the multipliers of its limits by owner and name, and how far each place asks."""
    layout, lam = Layout(problem), solution.multipliers.constraints
    owners: dict[int, Owner] = {id(one.bounds): owner for owner, one in boundaries_of(problem)}
    for index, phase in enumerate(problem.phases):
        owners |= {id(watch.bounds): ("watch", index, number) for number, watch in enumerate(phase.watches)}
    amounts = _amounts(problem)
    pulls: dict[tuple[Owner, str], float] = {}
    along: dict[str, Array] = {}
    places: dict[str, float] = {}
    for row, place in zip(layout.flat_rows, layout.row_index.tolist(), strict=True):
        pull = float(lam[place]) / row.quantity.scale
        if abs(pull) < NO_BLAME:
            continue
        owner = PATH if row.source < 0 else owners[id(layout.output_samples[row.source].bounds)]
        name = row.quantity.name
        pulls[owner, name] = pulls.get((owner, name), 0.0) + pull
        if owner == PATH:
            along.setdefault(name, np.zeros(layout.intervals + 1))[row.node] += pull
        phase = problem.phases[int(layout.phase_of_interval[max(row.node - 1, 0)])]
        at = layout.output_samples[row.source].name if owner[0] == "boundary" else phase.name
        places[at] = places.get(at, 0.0) + abs(pull * amounts.get((owner, name), 0.0))
    flight, steps = project(solution.iterate)
    return Relaxed(flight, steps, pulls, along, costates(layout, lam)[:-1], places)


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


def _with_places(at: Relaxed, strict: Problem, mild: Problem) -> Relaxed:
    """Return a relaxation with the blame of what boundaries observe and of what the equations do there as well."""
    moved, places, nodes = difference(strict, mild), dict(at.places), strict.first_node
    for owner, boundary in boundaries_of(strict):
        change = moved.values.get(owner)
        if change is not None:
            blame = abs(_observed(boundary, at.flight.state[:, nodes[owner[1]]], change, at, owner))
            places[boundary.name] = places.get(boundary.name, 0.0) + blame
    places.pop(strict.start.name, None)
    return dataclasses.replace(at, places={name: blame for name, blame in places.items() if blame > 0.0})


def _spared(moved: Moves, strict: Problem, at: Relaxed) -> float:
    """Return what a change of numbers would spare: of limits, of what boundaries observe, and in the equations."""
    spared = 0.0
    for owner, shifts in moved.ranges.items():
        for name, shift in shifts.items():
            spared += at.pulls.get((owner, f"{name}{AT_MOST}"), 0.0) * shift.upper
            spared += at.pulls.get((owner, f"{name}{AT_LEAST}"), 0.0) * shift.lower
    nodes = strict.first_node
    for owner, boundary in boundaries_of(strict):
        change = moved.values.get(owner)
        if change is not None:
            spared -= _observed(boundary, at.flight.state[:, nodes[owner[1]]], change, at, owner)
    if moved.parameters.any():
        spared -= _flown_otherwise(moved.parameters, strict, at)
    return max(spared, 0.0)


def _observed(boundary: Boundary, state: Array, change: Array, at: Relaxed, owner: Owner) -> float:
    """Return the multipliers' sum over what a change of a boundary's parameters does to what it observes."""
    seen = boundary.observation
    assert seen is not None  # it has parameters
    b = np.asarray(boundary.values)
    values = np.asarray(seen.values(state, b + change) - seen.values(state, b)).ravel()
    return sum(
        at.pulls.get((owner, f"{one.name}{end}"), 0.0) * float(value)
        for one, value in zip(seen.quantities, values, strict=True)
        for end in ("", AT_MOST, AT_LEAST)
    )


def _flown_otherwise(change: Array, strict: Problem, at: Relaxed) -> float:
    """Return what the relaxation would be more, to first order, with other parameters in the equations of flight."""
    system, intervals = strict.system, strict.intervals
    before = np.repeat(np.asarray(strict.parameters)[:, None], intervals, axis=1)
    after = before + change[:, None]
    state, control = at.flight.state[:, 1:], at.flight.control
    rates = system.rates.map(intervals)
    slopes = np.asarray(rates(state, control, after) - rates(state, control, before))
    more = float(np.sum(at.costates * slopes * interval_durations(strict, at.flight.durations)))
    if system.path_values is not None:
        path = system.path_values.map(intervals)
        values = np.asarray(path(state, control, after) - path(state, control, before))
        nothing = np.zeros(intervals + 1)
        for quantity, row in zip(system.path, values, strict=True):
            for end in (AT_MOST, AT_LEAST):
                more += float(at.along.get(f"{quantity.name}{end}", nothing)[1:] @ row)
    return more
