"""The numbers of an aircraft that enter the equations: of the point mass, and those of an aircraft that rotates.

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
    tau_T: T = quantity("s", text="time constant of the throttle")


@vector
class InnerLoopParameters(AircraftParameters[T]):
    """The numbers that the models with an inner loop need; derivatives are per radian."""

    b: T = quantity("m", scale=10.0, text="span, the reference length of rolling and yawing moments")
    cbar: T = quantity("m", text="mean chord, the reference length of the pitching moment")
    I_x: T = quantity("kg m2", scale=1000.0, text="moment of inertia about x_B")
    I_y: T = quantity("kg m2", scale=1000.0, text="moment of inertia about y_B")
    I_z: T = quantity("kg m2", scale=1000.0, text="moment of inertia about z_B")
    I_xz: T = quantity("kg m2", scale=1000.0, text="product of inertia")
    C_L0: T = quantity("1", text="lift at zero angle of attack")
    C_Lalpha: T = quantity("1/rad", text="slope of the lift curve")
    C_Lq: T = quantity("1/rad", text="lift due to the pitch rate")
    C_Leta: T = quantity("1/rad", text="lift due to the elevator")
    C_L_max: T = quantity("1", text="upper end of the lift curve")
    C_L_min: T = quantity("1", text="lower end of the lift curve")
    C_Ybeta: T = quantity("1/rad", text="side force due to sideslip")
    C_Yp: T = quantity("1/rad", text="side force due to the roll rate")
    C_Yr: T = quantity("1/rad", text="side force due to the yaw rate")
    C_Yxi: T = quantity("1/rad", text="side force due to the ailerons")
    C_Yzeta: T = quantity("1/rad", text="side force due to the rudder")
    C_lbeta: T = quantity("1/rad", text="rolling moment due to sideslip")
    C_lp: T = quantity("1/rad", text="rolling moment due to the roll rate")
    C_lr: T = quantity("1/rad", text="rolling moment due to the yaw rate, without lift")
    C_lr_per_C_L: T = quantity("1/rad", text="what lift adds to it, per lift coefficient")
    C_lxi: T = quantity("1/rad", text="rolling moment due to the ailerons")
    C_lzeta: T = quantity("1/rad", text="rolling moment due to the rudder")
    C_m0: T = quantity("1", text="pitching moment at zero angle of attack")
    C_malpha: T = quantity("1/rad", text="pitching moment due to the angle of attack")
    C_mq: T = quantity("1/rad", scale=10.0, text="pitching moment due to the pitch rate")
    C_malphadot: T = quantity("1/rad", scale=10.0, text="pitching moment due to the rate of the angle of attack")
    C_meta: T = quantity("1/rad", text="pitching moment due to the elevator")
    C_nbeta: T = quantity("1/rad", text="yawing moment due to sideslip")
    C_np: T = quantity("1/rad", text="yawing moment due to the roll rate, without lift")
    C_np_per_C_L: T = quantity("1/rad", text="what lift adds to it, per lift coefficient")
    C_nr: T = quantity("1/rad", text="yawing moment due to the yaw rate")
    C_nxi: T = quantity("1/rad", text="yawing moment due to the ailerons")
    C_nzeta: T = quantity("1/rad", text="yawing moment due to the rudder")
    h_P: T = quantity("kg m2/s", scale=1000.0, text="angular momentum of the propeller along x_B")
    Q_P: T = quantity("N m", scale=1000.0, text="torque of the propeller at full power at sea level, about -x_B")


def inner_loop_parameters(aircraft: Aircraft) -> InnerLoopParameters[float]:
    """Return the numbers of one aircraft, with `C_Y_trim = C_Ybeta - C_Yzeta C_nbeta / C_nzeta`."""
    side, yaw, drag = aircraft.side_force, aircraft.yaw, aircraft.drag
    propulsion, propeller = aircraft.propulsion, aircraft.propeller
    P = propulsion.eta_p * propulsion.P_max
    return InnerLoopParameters(
        **vars(aircraft.airframe),
        **vars(aircraft.lift),
        **vars(side),
        **vars(aircraft.roll),
        **vars(aircraft.pitch),
        **vars(yaw),
        C_D0=drag.C_D0,
        k=drag.k,
        C_L_minD=drag.C_L_minD,
        C_Dbeta2=drag.C_Dbeta2,
        C_Y_trim=side.C_Ybeta - side.C_Yzeta * yaw.C_nbeta / yaw.C_nzeta,
        P=P,
        V_s=P / propulsion.T_static,
        tau_T=propulsion.tau_T,
        h_P=propeller.inertia * propeller.Omega if propeller else 0.0,
        Q_P=propulsion.P_max / propeller.Omega if propeller else 0.0,
    )


def aircraft_parameters(aircraft: Aircraft) -> AircraftParameters[float]:
    """Return those numbers of one aircraft that the point mass needs."""
    numbers = inner_loop_parameters(aircraft)
    return AircraftParameters(**{name: getattr(numbers, name) for name in AircraftParameters.names()})
