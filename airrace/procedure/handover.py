"""From the optimum of one fidelity to a start for the next.

Where the equations change, the higher fidelity's model is flown along the lower one's optimum by error feedback. Where
that strays too far, the model is put at every instant into the state in which it does what the optimum does. Where
only the controls change, from commands to the deflections they made, the recorded ones are flown.
"""

import dataclasses

import numpy as np

from airrace.control.inner_loops import inner_controller_for
from airrace.control.reference import Reference, from_optimum
from airrace.control.settling import settle
from airrace.control.simulation import follow
from airrace.optimal_control.problem import Iterate
from airrace.procedure.flight import Flight, history, mesh_of
from airrace.procedure.joint import HANDOVER_BARRIER, Start
from airrace.procedure.models import RATE
from airrace.procedure.result import Facts, StageResult
from airrace.trajectory import Array, Trajectory

FARTHEST = 25.0
"""m: a flight that strays further from what it follows is a worse start than a model at rest in it."""
LONGEST_INTERVAL = 0.1
"""s, of the mesh a stage with rotational dynamics begins with: the roll mode's time constant is 0.08 s."""


def followed(flight: Flight, source: Flight, optimum: StageResult) -> Start:
    """A stage's model flown along the optimum of another stage; where it strays too far, at rest in that optimum.

    Args:
        flight: of the stage to be started.
        source: of the stage whose optimum is followed.
        optimum: its result.
    """
    flown = optimum.trajectory
    reference = _reference(source, optimum)
    nodes, first_node = finer(flown)
    simulated = follow(flight.model, inner_controller_for(flight.stage.value), reference, nodes=nodes)
    facts = Facts(
        source=source.stage.value,
        strayed=simulated.strayed,
        strayed_at=simulated.strayed_at,
        missed=simulated.end_distance,
    )
    if not simulated.finished or simulated.strayed > FARTHEST:
        return dataclasses.replace(settled(flight, source, optimum), facts=facts)
    guess = Iterate(simulated.durations, simulated.state, simulated.control)
    return Start(flight.problem(_mesh(simulated.time, first_node)), guess, HANDOVER_BARRIER, facts)


def settled(flight: Flight, source: Flight, optimum: StageResult) -> Start:
    """A stage's model at rest, node by node, in what the optimum of another stage does there."""
    flown = optimum.trajectory
    nodes, first_node = finer(flown)
    inverse = inner_controller_for(flight.stage.value)
    state, control = settle(flight.model, inverse, _reference(source, optimum), nodes=nodes)
    guess = Iterate(flown.durations, state, control)
    return Start(flight.problem(_mesh(nodes, first_node)), guess, HANDOVER_BARRIER, Facts(source=source.stage.value))


def _reference(source: Flight, optimum: StageResult) -> Reference:
    return from_optimum(source.model, source.problem(mesh_of(optimum.trajectory)), optimum.trajectory)


def _mesh(time: Array, first_node: list[int]) -> list[tuple[float, ...]]:
    """The fractions of every phase's intervals."""
    steps = np.split(np.diff(time), first_node[1:-1])
    return [tuple((one / one.sum()).tolist()) for one in steps]


def finer(flown: Trajectory) -> tuple[Array, list[int]]:
    """Times of the nodes with long intervals divided, and the node at which each phase begins and, last, the end."""
    steps = np.diff(flown.time)
    parts: list[int] = np.maximum(1, np.ceil(steps / LONGEST_INTERVAL - 1e-9)).astype(int).tolist()
    times: list[float] = flown.time.tolist()
    nodes = [a + (b - a) * part / n for a, b, n in zip(times, times[1:], parts, strict=False) for part in range(n)]
    first_node = np.concatenate([[0], np.cumsum(parts)])[flown.first_node]
    return np.array([*nodes, times[-1]]), first_node.tolist()


def recorded(flight: Flight, source: Flight, optimum: StageResult) -> Start:
    """The very flight of a stage, told in the states and controls of another one that flies the same equations."""
    flown = optimum.trajectory
    steps = np.diff(flown.time)
    states = {one.name: history(source, flown, one.name) for one in flight.model.system.states}
    held = {one.name: row for one, row in zip(flown.controls, flown.control, strict=True)}

    def control(name: str, lower: float, upper: float) -> Array:
        values = held[name] if name in held else np.diff(states[name.removesuffix(RATE)]) / steps
        return np.clip(values, lower, upper)

    guess = Iterate(
        flown.durations,
        np.vstack(list(states.values())),
        np.vstack([control(one.name, one.lower, one.upper) for one in flight.model.system.controls]),
    )
    return Start(flight.problem(mesh_of(flown)), guess, HANDOVER_BARRIER, Facts(source=source.stage.value))
