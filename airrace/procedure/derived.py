"""The quantities that follow from the states and controls of a flight: angles, coefficients, load factors, forces."""

from collections.abc import Callable, Mapping

import numpy as np

from airrace.dynamics.outer_loop_inverse import LoadFactors, load_factors
from airrace.environment.atmosphere import g0
from airrace.planning.race import Race
from airrace.procedure.fidelities import fidelity_of
from airrace.procedure.fidelity import Histories
from airrace.procedure.flight import stage_model
from airrace.procedure.result import StageResult
from airrace.quantities import Quantity
from airrace.trajectory import Array

FORCES = (
    Quantity("F_x", "N", text="force but the weight, along the velocity"),
    Quantity("F_y", "N", text="force but the weight, to the right in Kbar"),
    Quantity("F_z", "N", text="force but the weight, down in Kbar"),
)


def derived_quantities(race: Race, result: StageResult) -> Mapping[Quantity, Callable[[Histories], Array]]:
    """Return the derived quantities of a stage with the functions that compute them.

    Each is a function of the named histories of all states and controls, of shape (n,) -> (n,).
    """
    model = stage_model(result.stage, race)
    system, numbers = model.system, model.parameter_values
    known = {one.name for one in (*system.states, *system.controls)}
    path = [one for one in system.path if one.name not in known]
    load = [one for one in LoadFactors.quantities() if one.name not in known | {other.name for other in path}]

    def rows(function: Callable[..., object], histories: Histories) -> Array:
        x = np.stack([histories[one.name] for one in system.states])
        u = np.stack([histories[one.name] for one in system.controls])
        return np.asarray(function(x, u, np.repeat(numbers[:, None], x.shape[1], axis=1)))

    def along_path(histories: Histories) -> Histories:
        assert system.path_values is not None  # asked for its quantities alone
        values = rows(system.path_values.map(len(histories["V_K"])), histories)
        return dict(zip((one.name for one in system.path), values, strict=True))

    def loads(histories: Histories) -> Histories:
        values = rows(load_factors(system).map(len(histories["V_K"])), histories)
        n = LoadFactors[Array].split(values)
        weight = race.aircraft.airframe.m * g0
        return vars(n) | {"F_x": weight * n.n_x, "F_y": weight * n.n_y, "F_z": -weight * n.n_z}

    return {
        **fidelity_of(result.stage).columns,
        **{one: _entry(along_path, one.name) for one in path},
        **{one: _entry(loads, one.name) for one in (*load, *FORCES)},
    }


def _entry(of: Callable[[Histories], Histories], name: str) -> Callable[[Histories], Array]:
    return lambda histories: of(histories)[name]
