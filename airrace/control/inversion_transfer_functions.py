"""The inverse of the transfer functions: commands that make their lags answer like faster ones.

With the lags `n'' = w^2 (n_cmd - n) - 2 D w n'` and `p' = (p_cmd - p) / tau`, what is wanted is

    n'_des = n_dot_ref + K_n (n_ref - n)      n''_des = K_n_dot (n'_des - n')      p'_des = p_dot_ref + K_p (p_ref - p)

and the commands follow by inverting the lags exactly.
"""

from airrace.control.inner_controller import InnerController, Named, Plant, jacobian, limited
from airrace.dynamics.flight_model import FlightModel
from airrace.frames import Scalar

K_N_Z = 7.0
K_N_Y = 5.0
K_N_DOT = 20.0
K_P = 12.0


def invert_transfer_functions(model: FlightModel) -> InnerController:
    """The controller of a model with the states `n_z, n_z_dot, n_y, n_y_dot, p_Kbar` and commands of these."""
    plant = Plant(model)
    x, command = plant.x, plant.commands
    n_z = limited(plant.system, "n_z", command.n_z)
    n_y = limited(plant.system, "n_y", command.n_y)
    p = limited(plant.system, "p_Kbar", command.p)
    n_z_dot = command.n_z_dot + K_N_Z * (n_z - x["n_z"])
    wanted: Named = {
        "n_z_cmd": _command_for(plant, "n_z_dot", K_N_DOT * (n_z_dot - x["n_z_dot"]), "n_z_cmd"),
        "n_y_cmd": _command_for(plant, "n_y_dot", K_N_DOT * (K_N_Y * (n_y - x["n_y"]) - x["n_y_dot"]), "n_y_cmd"),
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


def _command_for(plant: Plant, name: str, rate: Scalar, by: str) -> Scalar:
    """The value of the state `by` at which the state `name` changes at `rate`; that rate is affine in it."""
    now = plant.rates[name]
    return plant.x[by] + (rate - now) / jacobian(now, plant.x[by])
