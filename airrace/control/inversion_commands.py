"""The inverse of a model that carries its own inversion controller: what is left is its lag.

With the gains of that controller and `N = dn_z/dalpha`, the load factor answers to its command like

    (1 + [K_q + g0 N / V_K] / (K_q K_alpha) s + ...) n_z = n_z_cmd

and the roll rate like a lag of `1 / K_p`. A command that leads by these times, and by that of its own follower, is
answered without delay.
"""

from airrace.control.inner_controller import (
    FOLLOWER,
    LEAST_LIFT_SLOPE,
    LEAST_SIDE_SLOPE,
    InnerController,
    Named,
    Plant,
    jacobian,
    limited,
)
from airrace.dynamics.flight_model import FlightModel
from airrace.dynamics.state_space_inverse import GAINS
from airrace.environment.atmosphere import g0
from airrace.environment.elementary import maximum, minimum


def invert_commands(model: FlightModel) -> InnerController:
    """The controller of the linear model with its inversion, whose commands are states."""
    plant = Plant(model)
    x, command, load = plant.x, plant.commands, plant.load
    n_z, n_y = limited(plant.system, "n_z", command.n_z), limited(plant.system, "n_y", command.n_y)
    p = limited(plant.system, "p_s", command.p)
    lift_slope = maximum(jacobian(load.n_z, x["alpha_K"]), LEAST_LIFT_SLOPE)
    side_slope = minimum(jacobian(load.n_y, x["beta_K"]), -LEAST_SIDE_SLOPE)
    lag = (GAINS.q + g0 * lift_slope / x["V_K"]) / (GAINS.q * GAINS.alpha) + 1.0 / FOLLOWER
    wanted: Named = {
        "n_z_cmd": n_z + lag * command.n_z_dot,
        "n_y_cmd": n_y,
        "p_cmd": p + (1.0 / GAINS.p + 1.0 / FOLLOWER) * command.p_dot,
    }
    settled: Named = {
        "alpha_K": x["alpha_K"] + (n_z - load.n_z) / lift_slope,
        "beta_K": x["beta_K"] + (n_y - load.n_y) / side_slope,
        "p_s": p,
        "q_K": x["q_K"] - plant.rates["alpha_K"],
        "r_s": x["r_s"] + plant.rates["beta_K"],
        "n_z_cmd": n_z,
        "n_y_cmd": n_y,
        "p_cmd": p,
    }
    return plant.controller(wanted, settled)
