"""The quantities that follow from the states and controls of a flight: angles, coefficients, load factors, forces."""

from collections.abc import Callable, Mapping

import casadi as ca
import numpy as np

from airrace.dynamics.flight_model import FlightModel
from airrace.dynamics.outer_loop_inverse import LoadFactors, load_factors
from airrace.environment.atmosphere import g0
from airrace.planning.race import Race
from airrace.points import at_points
from airrace.procedure.fidelities import fidelity_of
from airrace.procedure.fidelity import Histories
from airrace.procedure.models import stage_model
from airrace.procedure.result import Stage, StageResult
from airrace.quantities import Quantity
from airrace.records import record
from airrace.trajectory import Array

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
