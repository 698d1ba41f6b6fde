"""The inputs of an aircraft that rotates: control surfaces, or commands to a controller, and the rates of either."""

from airrace.aircraft.aircraft import Aircraft
from airrace.dynamics.limits import symmetric
from airrace.quantities import Interval, T, Vector, quantity, vector


@vector
class Deflected(Vector[T]):
    """The deflections of the control surfaces."""

    eta: T = quantity("rad", scale=0.2, text="elevator, positive nose down")
    xi: T = quantity("rad", scale=0.2, text="ailerons, positive left wing down")
    zeta: T = quantity("rad", scale=0.2, text="rudder, positive nose left")


@vector
class Commanded(Vector[T]):
    """The commands to a controller."""

    n_z_cmd: T = quantity("1", scale=5.0, text="commanded load factor")
    n_y_cmd: T = quantity("1", text="commanded lateral load factor")
    p_cmd: T = quantity("rad/s", scale=3.0, text="commanded roll rate")


@vector
class SurfaceControl(Vector[T]):
    """The rates of the deflections, and the commanded lever; (12) of the paper with rates instead of deflections."""

    eta_dot: T = quantity("rad/s", text="rate of the elevator", rate_of="eta")
    xi_dot: T = quantity("rad/s", text="rate of the ailerons", rate_of="xi")
    zeta_dot: T = quantity("rad/s", text="rate of the rudder", rate_of="zeta")
    delta_T_cmd: T = quantity("1", lower=0.0, upper=1.0, text="commanded power lever")


@vector
class CommandControl(Vector[T]):
    """The rates of the commands, and the commanded lever."""

    n_z_cmd_dot: T = quantity("1/s", scale=20.0, text="rate of the commanded load factor", rate_of="n_z_cmd")
    n_y_cmd_dot: T = quantity("1/s", scale=5.0, text="rate of the commanded lateral load factor", rate_of="n_y_cmd")
    p_cmd_dot: T = quantity("rad/s2", scale=20.0, text="rate of the commanded roll rate", rate_of="p_cmd")
    delta_T_cmd: T = quantity("1", lower=0.0, upper=1.0, text="commanded power lever")


BRISK_COMMANDS = {"n_y_cmd_dot": 0.4}
"""The control rates, by name, that count as brisk where their cost is weighed: `n_y_cmd_dot` in g/s.

At 0.4 g/s a controller moves the rudder at half of the rudder's greatest rate. The bound of the commanded rate is no
measure, for commands may jump. With half of the bound as the measure the optimum wags the rudder wherever the angle of
attack is at its limit, because side force in step with the bank turns the path at no cost.
"""


def deflection_bounds(aircraft: Aircraft) -> dict[str, Interval]:
    """Return the travel of the control surfaces by name, rad."""
    return {"eta": aircraft.surfaces.eta, "xi": aircraft.surfaces.xi, "zeta": aircraft.surfaces.zeta}


def deflection_rate_bounds(aircraft: Aircraft) -> dict[str, Interval]:
    """Return the allowed rates of the control surfaces by name, rad/s."""
    return dict.fromkeys(("eta_dot", "xi_dot", "zeta_dot"), symmetric(aircraft.surfaces.rate))


def command_rate_bounds(aircraft: Aircraft) -> dict[str, Interval]:
    """Return the rates at which a pilot moves the stick, by name: g/s and rad/s2."""
    pilot = aircraft.point_mass
    return {
        "n_z_cmd_dot": symmetric(pilot.n_z_dot),
        "n_y_cmd_dot": symmetric(pilot.n_y_dot),
        "p_cmd_dot": symmetric(pilot.p_dot),
    }


def command_bounds(aircraft: Aircraft) -> dict[str, Interval]:
    """Return the ranges of the commands by name: g and rad/s.

    They reach to what the aircraft is built for, even where the rules limit the resulting load factor or roll rate to
    less.
    """
    pilot = aircraft.point_mass
    return {"n_z_cmd": aircraft.envelope.n_z, "n_y_cmd": symmetric(pilot.n_y), "p_cmd": symmetric(pilot.p)}
