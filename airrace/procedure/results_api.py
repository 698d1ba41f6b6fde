"""The reading of stored stages: all that can be asked of a finished stage without solving, measuring or compiling.

Histories at any time and between the nodes, and the quantities that follow from states and controls: angles,
coefficients, load factors, forces. Whatever shows, compares or writes runs imports this module and not `run.py`, so
that it never loads a solver.
"""

from collections.abc import Callable, Mapping

import casadi as ca
import numpy as np

from airrace.dynamics.flight_model import FlightModel
from airrace.dynamics.outer_loop import LoadFactors, load_factors
from airrace.environment.atmosphere import g0
from airrace.optimal_control.replay import sample
from airrace.planning.race import Race
from airrace.points import at_points
from airrace.procedure.fidelity import Histories, ensure_matches_model, fidelity_of, iterate_of, stage_model
from airrace.procedure.result import Stage, StageResult
from airrace.quantities import Quantity
from airrace.records import record
from airrace.trajectory import Array, Trajectory

__all__ = ["Continuous", "continuous", "derived_quantities", "ensure_matches_model", "sampler"]

FORCES = (
    Quantity("F_x", "N", text="force but the weight, along the velocity"),
    Quantity("F_y", "N", text="force but the weight, to the right in Kbar"),
    Quantity("F_z", "N", text="force but the weight, down in Kbar"),
)


@record
class _Group:
    """Quantities that one function of the named histories yields together."""

    quantities: tuple[Quantity, ...]
    of: Callable[[Histories], Histories]


def derived_quantities(race: Race, result: StageResult) -> Mapping[Quantity, Callable[[Histories], Array]]:
    """Functions of named histories of all states and controls, each of shape (n,) -> (n,)."""
    groups = _groups(race, stage_model(result.stage, race))
    own = {one: _entry(group.of, one.name) for group in groups for one in group.quantities}
    return {**fidelity_of(result.stage).columns, **own}


def derived_histories(race: Race, stage: Stage, model: FlightModel, histories: Histories) -> Mapping[Quantity, Array]:
    """Return the same quantities as values, each of shape (n,); every function is evaluated once.

    Args:
        race: course, aircraft and air.
        stage: that was flown.
        model: its equations.
        histories: of all states and controls, by name, each of shape (n,).
    """
    columns = {one: function(histories) for one, function in fidelity_of(stage).columns.items()}
    for group in _groups(race, model):
        values = group.of(histories)
        columns.update({one: values[one.name] for one in group.quantities})
    return columns


def _groups(race: Race, model: FlightModel) -> tuple[_Group, ...]:
    """Return what the model limits along the path, then load factors and forces."""
    system, numbers = model.system, model.parameter_values
    known = {one.name for one in (*system.states, *system.controls)}
    path = [one for one in system.path if one.name not in known]
    load = [one for one in LoadFactors.quantities() if one.name not in known | {other.name for other in path}]

    def rows(function: ca.Function, histories: Histories) -> Array:
        x = np.stack([histories[one.name] for one in system.states])
        u = np.stack([histories[one.name] for one in system.controls])
        return at_points(function, x, u, numbers)

    def along_path(histories: Histories) -> Histories:
        assert system.path_values is not None  # asked for its quantities alone
        values = rows(system.path_values, histories)
        return dict(zip((one.name for one in system.path), values, strict=True))

    def loads(histories: Histories) -> Histories:
        values = rows(load_factors(system), histories)
        n = LoadFactors[Array].split(values)
        weight = race.aircraft.airframe.m * g0
        return vars(n) | {"F_x": weight * n.n_x, "F_y": weight * n.n_y, "F_z": -weight * n.n_z}

    of_path = (_Group(tuple(path), along_path),) if path else ()
    return (*of_path, _Group((*load, *FORCES), loads))


def _entry(of: Callable[[Histories], Histories], name: str) -> Callable[[Histories], Array]:
    return lambda histories: of(histories)[name]


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
