"""The inverse of the transfer functions: commands that make their lags respond like faster ones.

With the lags `n'' = w^2 (n_cmd - n) - 2 D w n'` and `p' = (p_cmd - p) / tau`, what is wanted is

    n'_des = n_dot_ref + w (n_ref - n)      n''_des = 3 w (n'_des - n')      p'_des = p_dot_ref + K_p (p_ref - p)

and the commands follow by inverting the lags exactly. The bandwidth is the lag's own, for a faster answer takes
commands that move faster than a pilot's hand: a slow aircraft would be shaken.
"""

from airrace.control.inner_controller import (
    InnerController,
    Named,
    Plant,
    jacobian,
    quantity_named,
    rate_quantity,
    within_bounds,
)
from airrace.control.outer_loop import clip
from airrace.dynamics.flight_model import FlightModel
from airrace.environment.elementary import maximum, minimum, sqrt
from airrace.frames import Scalar

K_P = 12.0
"""The gain of the roll rate, 1/s."""
HEADROOM = 1.1
"""The factor on the limits of lift and sideslip within which commands stay (1).

It is above 1 because a reference at its limits leaves nothing to correct with.
"""


def invert_transfer_functions(model: FlightModel) -> InnerController:
    """Return the controller of a model with the states `n_z, n_z_dot, n_y, n_y_dot, p_Kbar` and commands of these."""
    plant = Plant(model)
    x, command = plant.x, plant.commands
    n_z = _allowed(plant, "n_z", command.n_z, "C_L")
    n_y = _allowed(plant, "n_y", command.n_y, "beta_A")
    p = within_bounds(plant.system, "p_Kbar", command.p)
    wanted: Named = {
        "n_z_cmd": _command_for(plant, "n_z_dot", _answer(plant, "n_z", "n_z_cmd", n_z, command.n_z_dot), "n_z_cmd"),
        "n_y_cmd": _command_for(plant, "n_y_dot", _answer(plant, "n_y", "n_y_cmd", n_y, 0.0), "n_y_cmd"),
        "p_cmd": _command_for(plant, "p_Kbar", command.p_dot + K_P * (p - x["p_Kbar"]), "p_cmd"),
    }
    settled: Named = {
        "n_z": n_z,
        "n_z_dot": command.n_z_dot,
        "n_y": n_y,
        "n_y_dot": 0.0,
        "p_Kbar": p,
        "n_z_cmd": _command_for(plant, "n_z_dot", 0.0, "n_z_cmd"),
        "n_y_cmd": _command_for(plant, "n_y_dot", 0.0, "n_y_cmd"),
        "p_cmd": _command_for(plant, "p_Kbar", command.p_dot, "p_cmd"),
    }
    return plant.controller(wanted, settled)


def _allowed(plant: Plant, name: str, value: Scalar, by: str) -> Scalar:
    """Return a load factor within its own bounds and those of the path quantity `by`, which is proportional to it."""
    largest = quantity_named(plant.system.path, by).upper
    smallest = quantity_named(plant.system.path, by).lower
    slope = jacobian(plant.path[by], plant.x[name])
    one, other = HEADROOM * largest / slope, HEADROOM * smallest / slope  # whichever way the slope goes
    return within_bounds(plant.system, name, clip(value, minimum(one, other), maximum(one, other)))


def _answer(plant: Plant, name: str, by: str, wanted: Scalar, wanted_dot: Scalar) -> Scalar:
    """Return `n''_des` (g/s2) of the load factor `name`, which is commanded by the state `by`."""
    rate = rate_quantity(plant.system.states, name).name
    w = sqrt(jacobian(plant.rates[rate], plant.x[by]))
    return 3.0 * w * (wanted_dot + w * (wanted - plant.x[name]) - plant.x[rate])


def _command_for(plant: Plant, name: str, rate: Scalar, by: str) -> Scalar:
    """Return the value of the state `by` at which the state `name` changes at `rate`.

    The rate of change is affine in that state.
    """
    now = plant.rates[name]
    return plant.x[by] + (rate - now) / jacobian(now, plant.x[by])
