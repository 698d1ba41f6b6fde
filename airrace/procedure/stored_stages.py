"""The reading of stored stages: all that can be asked of a finished stage without solving, measuring or compiling.

Histories at any time and between the nodes, and the quantities that follow from states and controls: angles,
coefficients, load factors, forces. Whatever shows, compares or writes runs imports this module and not `procedure.py`,
so that it never loads a solver.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from airrace.model.dynamics.flight_model import FlightModel
from airrace.model.dynamics.outer_loop import LoadFactors, load_factors
from airrace.model.environment import g0
from airrace.optimal_control.quantities import Quantity
from airrace.optimal_control.replay import sample
from airrace.optimal_control.system import at_points
from airrace.optimal_control.trajectory import Array
from airrace.procedure.fidelity import Histories, ensure_matches_model, fidelity_of, iterate_of, stage_model
from airrace.procedure.result import StageResult
from airrace.race import Race

__all__ = ["Continuous", "continuous", "derived_quantities", "ensure_matches_model", "sampler"]

FORCES = (
    Quantity("F_x", "N", text="force but the weight, along the velocity"),
    Quantity("F_y", "N", text="force but the weight, to the right in Kbar"),
    Quantity("F_z", "N", text="force but the weight, down in Kbar"),
)


def derived_quantities(race: Race, result: StageResult) -> Mapping[Quantity, Callable[[Histories], Array]]:
    """Functions of named histories of all states and controls, each of shape (n,) -> (n,)."""

    def entry(of: Callable[[Histories], Histories], name: str) -> Callable[[Histories], Array]:
        return lambda histories: of(histories)[name]

    groups = _groups(race, stage_model(result.stage, race))
    own = {quantity: entry(values, quantity.name) for quantities, values in groups for quantity in quantities}
    return {**fidelity_of(result.stage).columns, **own}


def _groups(race: Race, model: FlightModel) -> Iterator[tuple[Sequence[Quantity], Callable[[Histories], Histories]]]:
    """Yield the path quantities, then load factors and forces, each group with its function."""
    system, numbers = model.system, model.parameter_values
    solved = {quantity.name for quantity in (*system.states, *system.controls)}
    path = [quantity for quantity in system.path if quantity.name not in solved]
    path_names = {quantity.name for quantity in path}
    load = [quantity for quantity in LoadFactors.quantities() if quantity.name not in solved | path_names]

    def rows(function: ca.Function, histories: Histories) -> Array:
        x = np.stack([histories[quantity.name] for quantity in system.states])
        u = np.stack([histories[quantity.name] for quantity in system.controls])
        return at_points(function, x, u, numbers)

    def along_path(histories: Histories) -> Histories:
        assert system.path_values is not None  # asked for its quantities alone
        return dict(zip((quantity.name for quantity in system.path), rows(system.path_values, histories), strict=True))

    def loads(histories: Histories) -> Histories:
        n = LoadFactors[Array].split(rows(load_factors(system), histories))
        weight = race.aircraft.airframe.m * g0
        return vars(n) | {"F_x": weight * n.n_x, "F_y": weight * n.n_y, "F_z": -weight * n.n_z}

    if path:
        yield path, along_path
    yield (*load, *FORCES), loads


@dataclass(frozen=True, eq=False)
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
    trajectory, model = result.trajectory, stage_model(result.stage, race)
    system, steps = model.system, np.diff(trajectory.time)
    parts = np.maximum(np.ceil(steps / longest_step - 1e-9), 1.0).astype(np.int64)
    interval = np.repeat(np.arange(len(steps)), parts)  # that each time belongs to
    number = np.arange(len(interval)) - np.repeat(np.cumsum(parts) - parts, parts)
    time = np.append(trajectory.time[interval] + number / parts[interval] * steps[interval], trajectory.time[-1])
    interval = np.append(interval, len(steps) - 1)
    first, last = (
        at_points(system.rates, state, trajectory.control, model.parameter_values)
        for state in (trajectory.state[:, :-1], trajectory.state[:, 1:])
    )
    h = steps[interval]
    s = (time - trajectory.time[interval]) / h
    before = trajectory.state[:, interval]
    states = (
        (1.0 + 2.0 * s) * (1.0 - s) ** 2 * before
        + s**2 * (3.0 - 2.0 * s) * trajectory.state[:, interval + 1]
        + h * s * (1.0 - s) ** 2 * first[:, interval]
        - h * s**2 * (1.0 - s) * last[:, interval]
    )
    states[:, s == 0.0] = before[:, s == 0.0]  # exact at the nodes
    states[:, -1] = trajectory.state[:, -1]
    solved = dict(
        zip((*trajectory.states, *trajectory.controls), [*states, *trajectory.control[:, interval]], strict=True)
    )
    histories = {quantity.name: values for quantity, values in solved.items()}
    declared = {quantity.name: quantity for quantity in (*system.states, *system.controls)}
    bounded = {declared.get(quantity.name, quantity): values for quantity, values in solved.items()}
    derived = {quantity: function(histories) for quantity, function in fidelity_of(result.stage).columns.items()}
    for quantities, function in _groups(race, model):
        values = function(histories)
        derived |= {quantity: values[quantity.name] for quantity in quantities}
    return Continuous(time, bounded, derived)


def sampler(race: Race, result: StageResult) -> Callable[[Array], Mapping[str, Array]]:
    """Return the function that gives the states at any times: from times in s, shape (n,), to histories by name.

    They are integrated from the node before.
    """
    model, iterate = stage_model(result.stage, race), iterate_of(result.trajectory)
    names = [quantity.name for quantity in model.system.states]
    time = result.trajectory.time

    def at(times: Array) -> Mapping[str, Array]:
        values = sample(model.system, model.parameter_values, iterate, time=time, times=times)
        return dict(zip(names, np.asarray(values), strict=True))

    return at
