"""Starts of the joint problem; warm starts among them, from the optimum of one fidelity to a start for the next.

Where the equations change, the higher fidelity's model follows the lower one's optimum by error feedback. Where
that strays too far, the model is trimmed in the optimum, node by node. Where only the controls change, from commands to
the deflections they made, the trajectory stays as it is.
"""

import dataclasses
import itertools
import math
from collections.abc import Sequence
from enum import Enum

import numpy as np

from airrace.optimal_control.layout import Layout
from airrace.optimal_control.mesh_refinement import transfer_multipliers
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.quantities import Quantity
from airrace.optimal_control.solvers.interface import Multipliers
from airrace.optimal_control.trajectory import Array
from airrace.procedure.control.path_following import Reference, from_optimum
from airrace.procedure.control.simulation import TrackingSimulator, follow, trim_along
from airrace.procedure.guess import first_mesh, guess
from airrace.procedure.result import NO_PROVENANCE, StageProvenance, StageResult
from airrace.procedure.settings import MeshSettings
from airrace.procedure.stage_problem import StageProblem, fractions_of, history, mesh_of


class InitialBarrier(Enum):
    """The first value of the barrier parameter, by the quality of the start.

    When those of another stage and of a coarser mesh fell from 1e-2 to 1e-4 and from 1e-3 to 1e-6, all stages together
    took a third fewer iterations.
    """

    COLD = 0.1
    """A guess that may be far off."""
    PIECES = 1e-2
    """Assembled pieces, or the solution of a neighbouring problem. Windows on Rovinj and Air Race X took the steps
    about as many iterations with 0.1."""
    COARSE = 1e-3
    """A coarse solution on another mesh, or the optimum of another stage with its multipliers: of 59 such optima on 10
    courses predictor-corrector steps took 778 iterations, 785 with 1e-2, 912 with 1e-4."""
    OTHER_PROBLEM = 1e-4
    """The optimum of another stage without multipliers, or of the same one under other numbers. A larger value leads
    astray and back, in twice the iterations."""
    OTHER_MESH = 1e-5
    """An optimum on another mesh with its multipliers, under numbers that may differ a little. On Rovinj changed by
    half a g or 5 kt it takes 31 to 43 iterations on both meshes, and with 1e-4 39 to 50. With 1e-6 it took 28 instead
    of 31 in one case, and 47 instead of 43 in another."""
    COARSER_MESH = 1e-6
    """An optimum on a coarser mesh."""

    @property
    def near_optimum(self) -> bool:
        """Whether it is an optimum of the same stage."""
        return self in (InitialBarrier.OTHER_MESH, InitialBarrier.COARSER_MESH)


@dataclasses.dataclass(frozen=True)
class Start:
    """A flight to start from: on the mesh of its problem, with the first value of the barrier parameter.

    `stage_problem` is planned as the start goes round; `provenance` says where it comes from; `multipliers` are those
    of the limits, or None; `iterations_max` is that of the first solve, None for that of the settings; an optimum
    slower than `race_time_max` (s) is not refined.
    """

    stage_problem: StageProblem
    problem: Problem
    guess: Iterate
    barrier: InitialBarrier
    provenance: StageProvenance = NO_PROVENANCE
    multipliers: Multipliers | None = None
    iterations_max: int | None = None
    race_time_max: float = math.inf

    def has_guess_of(self, other: "Start") -> bool:
        """Return whether another start has the same guess on the same mesh, as where both are trimmed."""
        own, theirs = self.guess, other.guess
        pairs = (own.durations, theirs.durations), (own.state, theirs.state), (own.control, theirs.control)
        return self.problem.mesh == other.problem.mesh and all(np.array_equal(*pair) for pair in pairs)


def planned_start(stage_problem: StageProblem, mesh: MeshSettings) -> Start:
    """Return a start straight from the plan of a flight, on its first mesh."""
    fractions = first_mesh(stage_problem.plan, mesh)
    return Start(
        stage_problem, stage_problem.problem(fractions), guess(stage_problem.plan, fractions), InitialBarrier.COLD
    )


FEWEST = 4
"""The smallest number of intervals of a phase."""


def track(
    stage_problem: StageProblem, simulator: TrackingSimulator, source: StageProblem, optimum: StageResult
) -> Start:
    """Return a start: a stage's model that follows the optimum of another stage, or trimmed where that strays too far.

    Args:
        stage_problem: of the stage to be started.
        simulator: flies its model.
        source: of the stage whose optimum is followed.
        optimum: its result.
    """
    nodes, first_node = first_nodes(optimum, stage_problem.longest_interval)
    simulated = follow(simulator, _reference(source, optimum), nodes=nodes)
    provenance = StageProvenance(
        source_stage=source.stage.value,
        tracking_error=simulated.tracking_error,
        tracking_error_time=simulated.tracking_error_time,
        terminal_miss=simulated.end_distance,
    )
    if not simulated.finished or simulated.tracking_error > stage_problem.fidelity.warm_start.max_tracking_error:
        return dataclasses.replace(trimmed_start(stage_problem, source, optimum), provenance=provenance)
    guess = Iterate(simulated.durations, simulated.state, simulated.control)
    start = _start(stage_problem, source, optimum, guess, fractions_of(simulated.time, first_node))
    return dataclasses.replace(start, provenance=provenance)


def trimmed_start(stage_problem: StageProblem, source: StageProblem, optimum: StageResult) -> Start:
    """Return a start: a stage's model trimmed, node by node, at the motion of the optimum of another stage."""
    nodes, first_node = first_nodes(optimum, stage_problem.longest_interval)
    state, control = trim_along(
        stage_problem.model, stage_problem.fidelity.controller(), _reference(source, optimum), nodes=nodes
    )
    guess = Iterate(optimum.trajectory.durations, state, control)
    return _start(stage_problem, source, optimum, guess, fractions_of(nodes, first_node))


def map_controls(stage_problem: StageProblem, source: StageProblem, optimum: StageResult) -> Start:
    """Return a start: the flight of a stage, in the states and controls of another one with the same equations."""
    trajectory, system = optimum.trajectory, stage_problem.model.system
    nodes, first_node = first_nodes(optimum, stage_problem.longest_interval)
    controls = {quantity.name: row for quantity, row in zip(trajectory.controls, trajectory.control, strict=True)}
    states = {
        quantity.name: np.interp(nodes, trajectory.time, history(source, trajectory, quantity.name))
        for quantity in system.states
    }

    def control(quantity: Quantity) -> Array:
        integral = states.get(quantity.rate_of)
        if quantity.name in controls:  # the mean over each new interval
            cumulative = np.concatenate([[0.0], np.cumsum(controls[quantity.name] * np.diff(trajectory.time))])
            integral = np.interp(nodes, trajectory.time, cumulative)
        assert integral is not None  # a control that the source lacks is the rate of a state
        return np.clip(np.diff(integral) / np.diff(nodes), quantity.lower, quantity.upper)

    guess = Iterate(
        trajectory.durations, np.vstack(list(states.values())), np.vstack([control(u) for u in system.controls])
    )
    return _start(stage_problem, source, optimum, guess, fractions_of(nodes, first_node))


def first_nodes(optimum: StageResult, longest: float) -> tuple[Array, list[int]]:
    """Return the times of the nodes that the next stage begins with, s, and the first node of each phase.

    The last of the latter is the end. Nodes are as dense as in the mesh from which the optimum's was divided, and no
    further apart than `longest`, s.
    """
    trajectory = optimum.trajectory
    times = trajectory.time[optimum.coarser_nodes]
    needed = np.concatenate([[0.0], np.cumsum(np.maximum(1.0, np.diff(times) / longest))])
    nodes: list[Array] = []
    for begin, end in itertools.pairwise(trajectory.time[trajectory.first_node]):
        first, last = np.interp([begin, end], times, needed)
        count = max(FEWEST, math.ceil(last - first - 1e-9))
        nodes.append(np.interp(np.linspace(first, last, count + 1)[:-1], needed, times))
    first_node = np.cumsum([0, *map(len, nodes)])
    return np.concatenate([*nodes, times[-1:]]), first_node.tolist()


def _reference(source: StageProblem, optimum: StageResult) -> Reference:
    return from_optimum(source.model, source.problem(mesh_of(optimum.trajectory)), optimum.trajectory)


def _start(
    stage_problem: StageProblem,
    source: StageProblem,
    optimum: StageResult,
    guess: Iterate,
    mesh: Sequence[tuple[float, ...]],
) -> Start:
    """Return a start with the optimum's multipliers of the limits that both stages have."""
    problem, source_problem = stage_problem.problem(mesh), source.problem(mesh_of(optimum.trajectory))
    multipliers = Multipliers(optimum.constraint_multipliers, optimum.bound_multipliers)
    multipliers = transfer_multipliers(multipliers, Layout(source_problem), Layout(problem))
    provenance = StageProvenance(source_stage=source.stage.value)
    return Start(stage_problem, problem, guess, InitialBarrier.COARSE, provenance, multipliers)
