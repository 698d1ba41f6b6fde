"""The histories of a stored stage between its nodes: every state, control and derived quantity, as close as wanted."""

from collections.abc import Mapping

import numpy as np

from airrace.planning.race import Race
from airrace.points import at_points
from airrace.procedure.derived import derived_histories
from airrace.procedure.models import stage_model
from airrace.procedure.result import StageResult
from airrace.quantities import Quantity
from airrace.records import record
from airrace.trajectory import Array, Trajectory


@record
class Continuous:
    """Histories over a time axis that holds all nodes of the mesh.

    Attributes:
        time: s, rising, shape (n,).
        solved: states and controls, each of shape (n,); controls are those of the interval that begins at or before
            the time.
        derived: path quantities, load factors and forces, likewise.
    """

    time: Array
    solved: Mapping[Quantity, Array]
    derived: Mapping[Quantity, Array]


def continuous(race: Race, result: StageResult, longest_step: float) -> Continuous:
    """Read a stage off at its nodes and in between.

    Between two nodes a state is the cubic that has its values and its rates at both of them. The controls are held
    meanwhile, so the error falls with the fourth power of the interval: on the meshes of the shipped courses it is
    below a millimetre.

    Args:
        race: course, aircraft and air.
        result: the stage.
        longest_step: between two times, s.
    """
    flown, model = result.trajectory, stage_model(result.stage, race)
    time, interval = _times(flown, longest_step)
    system = model.system

    def rates(state: Array) -> Array:
        return at_points(system.rates, state, flown.control, model.parameter_values)

    states = _cubic(flown, rates(flown.state[:, :-1]), rates(flown.state[:, 1:]), time, interval)
    solved = dict(zip(flown.states, states, strict=True))
    solved |= dict(zip(flown.controls, flown.control[:, interval], strict=True))
    histories = {quantity.name: values for quantity, values in solved.items()}
    declared = {one.name: one for one in (*system.states, *system.controls)}
    bounded = {declared.get(quantity.name, quantity): values for quantity, values in solved.items()}
    return Continuous(time, bounded, derived_histories(race, result.stage, model, histories))


def _times(flown: Trajectory, longest_step: float) -> tuple[Array, np.ndarray]:
    """Nodes, and evenly between them as many times as the step asks for; and the interval that each belongs to."""
    steps = np.diff(flown.time)
    parts = np.maximum(np.ceil(steps / longest_step - 1e-9), 1.0).astype(np.int64)
    interval = np.repeat(np.arange(len(steps)), parts)
    number = np.arange(len(interval)) - np.repeat(np.cumsum(parts) - parts, parts)
    time = flown.time[interval] + number / parts[interval] * steps[interval]
    return np.append(time, flown.time[-1]), np.append(interval, len(steps) - 1)


def _cubic(flown: Trajectory, first: Array, last: Array, time: Array, interval: np.ndarray) -> Array:
    """Hermite's cubics through the nodes; exact at the nodes themselves."""
    h = np.diff(flown.time)[interval]
    s = (time - flown.time[interval]) / h
    before, after = flown.state[:, interval], flown.state[:, interval + 1]
    values = (
        (1.0 + 2.0 * s) * (1.0 - s) ** 2 * before
        + s**2 * (3.0 - 2.0 * s) * after
        + h * s * (1.0 - s) ** 2 * first[:, interval]
        - h * s**2 * (1.0 - s) * last[:, interval]
    )
    values[:, s == 0.0] = before[:, s == 0.0]
    values[:, -1] = flown.state[:, -1]
    return values
