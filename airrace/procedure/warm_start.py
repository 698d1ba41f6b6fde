"""The handover from the optimum of one fidelity to a start for the next.

Where the equations change, the higher fidelity's model is flown along the lower one's optimum by error feedback. Where
that strays too far, the model is put at every instant into the state in which it does what the optimum does. Where
only the controls change, from commands to the deflections they made, the recorded ones are flown.
"""

import dataclasses
import itertools
import math

import numpy as np

from airrace.control.reference import Reference, from_optimum
from airrace.control.simulation import TrackingSimulator, follow
from airrace.control.trim import settle
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.multiplier_transfer import transfer_multipliers
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.solvers.interface import Multipliers
from airrace.procedure.result import StageProvenance, StageResult
from airrace.procedure.stage_problem import StageProblem, fractions_of, history, mesh_of
from airrace.procedure.start import InitialBarrier, Start
from airrace.quantities import Quantity
from airrace.trajectory import Array

FEWEST = 4
"""The smallest number of intervals of a phase."""


def followed(flight: StageProblem, pilot: TrackingSimulator, source: StageProblem, optimum: StageResult) -> Start:
    """Return a start: a stage's model flown along the optimum of another stage.

    Where it strays too far, the start is the model at rest in that optimum.

    Args:
        flight: of the stage to be started.
        pilot: flies its model.
        source: of the stage whose optimum is followed.
        optimum: its result.
    """
    reference = _reference(source, optimum)
    nodes, first_node = first_nodes(optimum, flight.longest_interval)
    simulated = follow(pilot, reference, nodes=nodes)
    provenance = StageProvenance(
        source_stage=source.stage.value,
        tracking_error=simulated.tracking_error,
        tracking_error_time=simulated.tracking_error_time,
        terminal_miss=simulated.end_distance,
    )
    if not simulated.finished or simulated.tracking_error > flight.fidelity.warm_start.max_tracking_error:
        return dataclasses.replace(settled(flight, source, optimum), provenance=provenance)
    guess = Iterate(simulated.durations, simulated.state, simulated.control)
    problem = flight.problem(fractions_of(simulated.time, first_node))
    known = known_multipliers(source, optimum, problem)
    return Start(flight, problem, guess, InitialBarrier.OTHER_STAGE, provenance, known)


def settled(flight: StageProblem, source: StageProblem, optimum: StageResult) -> Start:
    """Return a start: a stage's model at rest, node by node, in what the optimum of another stage does there."""
    flown = optimum.trajectory
    nodes, first_node = first_nodes(optimum, flight.longest_interval)
    state, control = settle(flight.model, flight.fidelity.controller(), _reference(source, optimum), nodes=nodes)
    guess = Iterate(flown.durations, state, control)
    problem = flight.problem(fractions_of(nodes, first_node))
    provenance = StageProvenance(source_stage=source.stage.value)
    return Start(
        flight, problem, guess, InitialBarrier.OTHER_STAGE, provenance, known_multipliers(source, optimum, problem)
    )


def known_multipliers(source: StageProblem, optimum: StageResult, problem: Problem) -> Multipliers:
    """Return the multipliers of an optimum for another stage's problem: those of the limits that both have."""
    known = Multipliers(optimum.constraint_multipliers, optimum.bound_multipliers)
    return transfer_multipliers(known, Layout(source.problem(mesh_of(optimum.trajectory))), Layout(problem))


def _reference(source: StageProblem, optimum: StageResult) -> Reference:
    return from_optimum(source.model, source.problem(mesh_of(optimum.trajectory)), optimum.trajectory)


def first_nodes(optimum: StageResult, longest: float) -> tuple[Array, list[int]]:
    """Return the times of the nodes that the next stage begins with, s, and the first node of each phase.

    The last of the latter is the end. Nodes are as dense as in the mesh from which the optimum's was divided, and no
    further apart than `longest`, s.
    """
    flown = optimum.trajectory
    times = flown.time[optimum.coarser_nodes]
    needed = np.concatenate([[0.0], np.cumsum(np.maximum(1.0, np.diff(times) / longest))])
    nodes: list[Array] = []
    for begin, end in itertools.pairwise(flown.time[flown.first_node]):
        first, last = np.interp([begin, end], times, needed)
        count = max(FEWEST, math.ceil(last - first - 1e-9))
        nodes.append(np.interp(np.linspace(first, last, count + 1)[:-1], needed, times))
    first_node = np.cumsum([0, *map(len, nodes)])
    return np.concatenate([*nodes, times[-1:]]), first_node.tolist()


def recorded(flight: StageProblem, source: StageProblem, optimum: StageResult) -> Start:
    """Return a start: the flight of a stage, in the states and controls of another one with the same equations."""
    flown = optimum.trajectory
    nodes, first_node = first_nodes(optimum, flight.longest_interval)
    steps = np.diff(nodes)
    held = {one.name: row for one, row in zip(flown.controls, flown.control, strict=True)}
    states = {
        one.name: np.interp(nodes, flown.time, history(source, flown, one.name)) for one in flight.model.system.states
    }

    def control(one: Quantity) -> Array:
        if one.name not in held:
            return np.clip(np.diff(states[one.rate_of]) / steps, one.lower, one.upper)
        added = np.concatenate([[0.0], np.cumsum(held[one.name] * np.diff(flown.time))])
        return np.clip(np.diff(np.interp(nodes, flown.time, added)) / steps, one.lower, one.upper)

    guess = Iterate(
        flown.durations,
        np.vstack(list(states.values())),
        np.vstack([control(one) for one in flight.model.system.controls]),
    )
    problem = flight.problem(fractions_of(nodes, first_node))
    provenance = StageProvenance(source_stage=source.stage.value)
    return Start(
        flight, problem, guess, InitialBarrier.OTHER_STAGE, provenance, known_multipliers(source, optimum, problem)
    )
