"""The numbers of an aircraft that enter the point mass's equations.

Limits are not among them, for they are bounds of states, controls and path quantities.
"""

from airrace.aircraft.aircraft import Aircraft
from airrace.quantities import T, Vector, quantity, vector


@vector
class AircraftParameters(Vector[T]):
    """The mass, size, drag, side force and propulsion of an aircraft."""

    m: T = quantity("kg", scale=1000.0, text="mass")
    S: T = quantity("m2", scale=10.0, text="wing area")
    C_D0: T = quantity("1", text="drag coefficient at C_L_minD")
    k: T = quantity("1", text="induced drag factor")
    C_L_minD: T = quantity("1", text="lift coefficient of least drag")
    C_Dbeta2: T = quantity("1/rad2", text="drag due to sideslip squared")
    C_Y_trim: T = quantity("1/rad", text="side force due to sideslip, yawing moment trimmed by the rudder")
    P: T = quantity("W", scale=1e5, text="propulsive power at sea level, eta_p P_max")
    V_s: T = quantity("m/s", scale=50.0, text="speed that bounds the thrust at rest, eta_p P_max / T_static")
    tau_T: T = quantity("s", text="time constant of the power lever")


def aircraft_parameters(aircraft: Aircraft) -> AircraftParameters[float]:
    """Return the numbers of one aircraft, with `C_Y_trim = C_Ybeta - C_Yzeta C_nbeta / C_nzeta`."""
    side, yaw, propulsion = aircraft.side_force, aircraft.yaw, aircraft.propulsion
    P = propulsion.eta_p * propulsion.P_max
    return AircraftParameters(
        m=aircraft.airframe.m,
        S=aircraft.airframe.S,
        C_D0=aircraft.drag.C_D0,
        k=aircraft.drag.k,
        C_L_minD=aircraft.drag.C_L_minD,
        C_Dbeta2=aircraft.drag.C_Dbeta2,
        C_Y_trim=side.beta - side.zeta * yaw.beta / yaw.zeta,
        P=P,
        V_s=P / propulsion.T_static,
        tau_T=propulsion.tau_T,
    )
