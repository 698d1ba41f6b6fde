"""From the optimum of one fidelity to a start for the next.

Where the equations change, the higher fidelity's model is flown along the lower one's optimum by error feedback. Where
only the controls change, from commands to the deflections they made, the recorded ones are flown.
"""

import numpy as np

from airrace.control.inner_loops import inner_controller_for
from airrace.control.reference import from_optimum
from airrace.control.settling import settle
from airrace.control.simulation import follow
from airrace.optimal_control.problem import Iterate
from airrace.procedure.flight import Flight, history, mesh_of
from airrace.procedure.joint import COLD_BARRIER, WARM_BARRIER, Start
from airrace.procedure.models import RATE
from airrace.procedure.result import Facts, StageResult
from airrace.trajectory import Array, Trajectory

LONGEST_INTERVAL = 0.1
"""s, of the mesh a stage with rotational dynamics begins with: the roll mode's time constant is 0.08 s."""


def followed(flight: Flight, source: Flight, optimum: StageResult) -> Start | None:
    """A stage's model flown along the optimum of another stage; None if it departs.

    Args:
        flight: of the stage to be started.
        source: of the stage whose optimum is followed.
        optimum: its result.
    """
    flown = optimum.trajectory
    reference = from_optimum(source.model, source.problem(mesh_of(flown)), flown)
    nodes, first_node = finer(flown)
    simulated = follow(flight.model, inner_controller_for(flight.stage.value), reference, nodes=nodes)
    if not simulated.finished:
        return None
    steps = np.split(np.diff(simulated.time), first_node[1:-1])
    mesh = [tuple((one / one.sum()).tolist()) for one in steps]
    guess = Iterate(simulated.durations, simulated.state, simulated.control)
    facts = Facts(
        source=source.stage.value,
        strayed=simulated.strayed,
        strayed_at=simulated.strayed_at,
        missed=simulated.end_distance,
    )
    return Start(flight.problem(mesh), guess, WARM_BARRIER, facts)


def settled(flight: Flight, source: Flight, optimum: StageResult) -> Start:
    """A stage's model at rest, node by node, in what the optimum of another stage does: where nothing else leads on."""
    flown = optimum.trajectory
    reference = from_optimum(source.model, source.problem(mesh_of(flown)), flown)
    nodes, first_node = finer(flown)
    state, control = settle(flight.model, inner_controller_for(flight.stage.value), reference, nodes=nodes)
    mesh = [tuple((one / one.sum()).tolist()) for one in np.split(np.diff(nodes), first_node[1:-1])]
    guess = Iterate(flown.durations, state, control)
    return Start(flight.problem(mesh), guess, COLD_BARRIER, Facts(source=source.stage.value))


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
    return Start(flight.problem(mesh_of(flown)), guess, WARM_BARRIER, Facts(source=source.stage.value))
