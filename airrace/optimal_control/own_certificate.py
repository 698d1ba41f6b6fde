"""The certificate of an optimum of any problem: what it has to keep, and how that is measured.

The items are those of a race, in measures that need no unit: excesses between nodes as shares of the quantities'
scales, and the Hamiltonian's drift and the change between meshes as shares of the objective.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from airrace.optimal_control.certificate import (
    HAMILTONIAN_DRIFT,
    OBJECTIVE_CHANGE,
    Certificate,
    Item,
)
from airrace.optimal_control.constraint_check import Tolerance, check_constraints
from airrace.optimal_control.evidence import Evidence, negative_curvature
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.optimality import errors_in_objective, hamiltonian
from airrace.optimal_control.problem import Problem
from airrace.optimal_control.quantities import Quantity
from airrace.optimal_control.replay import interval_durations, replay
from airrace.optimal_control.solvers.interface import Multipliers
from airrace.optimal_control.solvers.solver import ProgramSolution
from airrace.optimal_control.trajectory import Array


@dataclass(frozen=True)
class Accuracy:
    """The largest values that a certified optimum may show.

    Attributes:
        kkt_error: errors of the conditions of optimality, scaled.
        replay: the end of an interval integrated again minus the next node, scaled.
        constraint: what a limited quantity may exceed its limit by, at boundaries and between nodes, as a share of its
            scale.
        hamiltonian: how far the Hamiltonian may be from what it should be, as a share of the objective per duration.
        change: what the objective may change by when all intervals are halved, as a share of the objective.
        objective_scale: typical size of the objective, which takes its place where that is smaller.
    """

    kkt_error: float = 1e-6
    replay: float = 1e-6
    constraint: float = 1e-4
    hamiltonian: float = 0.02
    change: float = 1e-4
    objective_scale: float = 1e-3

    def size_of(self, value: float) -> float:
        """Return the size of an objective of this value, in its unit."""
        return max(abs(value), self.objective_scale)

    def change_of(self, value: float) -> float:
        """Return what an objective of this value may change by when all intervals are halved, in its unit."""
        return self.change * self.size_of(value)


def expected_hamiltonian(problem: Problem, multipliers: Multipliers) -> Array:
    """Compute the value that the Hamiltonian of an optimum has throughout each phase, in the objective's unit per s.

    It is minus what a second more of the phase's duration costs directly: the weight of time, and the multiplier of the
    duration where its range holds it.

    Returns:
        Shape (n phases,).
    """
    layout = Layout(problem)
    holding = multipliers.bounds[layout.phase_durations] / layout.scale[layout.phase_durations]
    return -(problem.objective.time + holding)


def examine_own(problem: Problem, solution: ProgramSolution, accuracy: Accuracy) -> Evidence:
    """Measure an optimum; its drift is a share of the objective per duration."""
    iterate, multipliers = solution.iterate, solution.multipliers
    again = replay(problem, iterate)
    measured = check_constraints(
        problem, iterate, again, tolerances=tolerances(problem, accuracy), defect_limit=accuracy.replay
    )
    expected = np.repeat(expected_hamiltonian(problem, multipliers), [len(phase.fractions) for phase in problem.phases])
    rate = accuracy.size_of(solution.objective) / float(iterate.durations.sum())
    drift = np.abs(hamiltonian(problem, iterate, multipliers.constraints) - expected) / rate
    return Evidence(again, measured, drift, errors_in_objective(problem, again.defect, multipliers.constraints))


def tolerances(problem: Problem, accuracy: Accuracy) -> tuple[Tolerance, ...]:
    """Return the excesses that are allowed, by unit: a share of the least scale among the limited quantities in it."""
    scales: dict[str, float] = {}
    for quantity in _quantities(problem):
        scales[quantity.unit] = min(quantity.scale, scales.get(quantity.unit, np.inf))
    return tuple(
        Tolerance(unit, (unit,), accuracy.constraint * scale, accuracy.constraint * scale)
        for unit, scale in scales.items()
    )


def _quantities(problem: Problem) -> Iterator[Quantity]:
    """Yield all quantities of a problem that may be limited along the path or at boundaries."""
    yield from (*problem.system.states, *problem.system.path)
    for observation in problem.observations:
        yield from observation.quantities


def certify_own(
    problem: Problem,
    solution: ProgramSolution,
    evidence: Evidence,
    accuracy: Accuracy,
    *,
    coarser: float | None = None,
) -> Certificate:
    """Return the certificate of an optimum.

    Args:
        evidence: see `examine_own`.
        coarser: the objective of the optimum on a mesh of at most half the intervals everywhere; None where there is
            none, which leaves the item out.
    """
    worst = int(evidence.drift.argmax())
    time = float(interval_durations(problem, solution.iterate.durations)[:worst].sum())
    items = [
        Item("kkt_error", solution.kkt.largest, accuracy.kkt_error, "scaled"),
        negative_curvature(solution.second_order, "1"),
        *evidence.check.items,
        Item(
            HAMILTONIAN_DRIFT,
            float(evidence.drift.max()),
            accuracy.hamiltonian,
            "1",
            f"{problem.phase_of(worst).name}, {time:.3g} s",
        ),
    ]
    if coarser is not None:
        change = abs(solution.objective - coarser) / accuracy.size_of(solution.objective)
        items.append(Item(OBJECTIVE_CHANGE, change, accuracy.change, "1", "against a mesh of half the intervals"))
    return Certificate(f"{solution.solver}: {solution.status}", tuple(items), solution.second_order)
