"""The conditions of a settled inner loop at one instant: all its states are at rest.

At that instant the aircraft flies as in a steady flight with the load factor and the roll rate that it has: no side
force (the ball of the slip indicator stands in the middle), and the rates of the states that a model calls `at_rest`
are zero. These are as many conditions as leave load factor and roll rate free:

    point mass               n_y = 0
    transfer functions       n_y = 0,   (n_z, n_z_dot, n_y, n_y_dot, p_Kbar)' = 0
    the others               n_y = 0,   (alpha_K, beta_K, p, q, r)' = 0

Commands are then equal to what they command, and deflections balance the moments. The power lever is not part of it.
"""

import dataclasses

import casadi as ca

from airrace.dynamics.flight_model import FlightModel
from airrace.environment.atmosphere import g0
from airrace.frames import Scalar
from airrace.quantities import Quantity
from airrace.system import Observation, column, named_symbols

SIDE_ACCELERATION = Quantity("side_acceleration", "m/s2", text="side force on the aircraft over its mass")


def settled_observation(model: FlightModel) -> Observation:
    """Return the observation of the quantities that are zero in a settled flight of a model.

    The numbers of the model are its parameters. Rates are those with all controls at zero, which drive none of the
    states at rest directly.
    """
    system = model.system
    x, p = named_symbols(system.states), named_symbols(system.parameters)
    nothing = column([0.0] * len(system.controls))
    arguments = column(x.values()), column(p.values())
    rates = system.rates(arguments[0], nothing, arguments[1])
    by_name = dict(zip(x, rates.elements(), strict=True))
    declared = {one.name: one for one in system.states}
    values = [g0 * _side_load_factor(model, x, p), *(by_name[name] for name in model.at_rest)]
    return Observation(
        name="settled",
        quantities=(SIDE_ACCELERATION, *(_rate(declared[name]) for name in model.at_rest)),
        parameters=system.parameters,
        values=ca.Function("settled", [*arguments], [column(values)], {"cse": True}),
    )


def _side_load_factor(model: FlightModel, x: dict[str, Scalar], p: dict[str, Scalar]) -> Scalar:
    """Return `n_y` (g): a state of models without angles, a path quantity of the others."""
    system = model.system
    if "n_y" in x:
        return x["n_y"]
    assert system.path_values is not None  # it has load factors among its path quantities
    nothing = column([0.0] * len(system.controls))
    values = system.path_values(column(x.values()), nothing, column(p.values()))
    return values.elements()[[one.name for one in system.path].index("n_y")]


def _rate(state: Quantity) -> Quantity:
    """Return the declaration of a state's rate.

    Its scale is at most 1, for the solver's tolerance is in units of the scale.
    """
    before, per, seconds = state.unit.partition("/s")
    return dataclasses.replace(
        Quantity(f"{state.name}_rate", f"{before}/s{int(seconds or 1) + 1 if per else ''}"),
        scale=min(1.0, state.scale),
        text=f"rate of change of {state.name}, zero in a settled flight",
        rate_of=state.name,
    )
