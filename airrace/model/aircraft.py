"""Aircraft: frozen numbers with units, and those that enter the equations of point masses and of rotating bodies.

Symbols follow the flight model; SI and radians. Limits are not among the parameters of the equations, for they are
bounds of states, controls and path quantities.
"""

import functools
from dataclasses import dataclass
from types import new_class
from typing import Any, ClassVar, TypeVar, cast

from airrace.model.splines import Table
from airrace.optimal_control.quantities import Interval, T, Vector, quantity, vector


@dataclass(frozen=True)
class Airframe:
    """The mass and size of an aircraft: `m` kg; `S` m2; `b`, `cbar` m; moments of inertia kg m2."""

    m: float
    S: float
    b: float
    cbar: float
    I_x: float
    I_y: float
    I_z: float
    I_xz: float


@dataclass(frozen=True)
class Lift:
    """The coefficients of lift, rounded off at `C_L_max` and `C_L_min`.

    `C_L = C_L0 + C_Lalpha alpha_A + C_Lq q* + C_Leta eta`
    """

    C_L0: float
    C_Lalpha: float
    C_Lq: float
    C_Leta: float
    C_L_max: float
    C_L_min: float


@dataclass(frozen=True)
class Drag:
    """The coefficients of drag; their fit ends at the sideslip `beta_A_max` (rad).

    `C_D = C_D0 + k (C_L - C_L_minD)^2 + C_Dbeta2 beta_A^2`
    """

    C_D0: float
    k: float
    C_L_minD: float
    C_Dbeta2: float
    beta_A_max: float


@dataclass(frozen=True)
class SideForce:
    """The derivatives of `C_Y`."""

    C_Ybeta: float
    C_Yp: float
    C_Yr: float
    C_Yxi: float
    C_Yzeta: float


@dataclass(frozen=True)
class RollMoment:
    """The derivatives of `C_l`; `C_lr_per_C_L` adds to `C_lr` in proportion to the lift coefficient."""

    C_lbeta: float
    C_lp: float
    C_lr: float
    C_lr_per_C_L: float
    C_lxi: float
    C_lzeta: float


@dataclass(frozen=True)
class PitchMoment:
    """The coefficient `C_m0` and the derivatives of `C_m`."""

    C_m0: float
    C_malpha: float
    C_mq: float
    C_malphadot: float
    C_meta: float


@dataclass(frozen=True)
class YawMoment:
    """The derivatives of `C_n`; `C_np_per_C_L` adds to `C_np` in proportion to the lift coefficient."""

    C_nbeta: float
    C_np: float
    C_np_per_C_L: float
    C_nr: float
    C_nxi: float
    C_nzeta: float


@dataclass(frozen=True)
class Propulsion:
    """The numbers of the thrust: `P_max` W, `T_static` N, lag `tau_T` s, efficiency `eta_p`.

    `T = delta_T eta_p P_max sigma_P / sqrt(V_A^2 + V_s^2)`, `V_s = eta_p P_max / T_static`
    """

    P_max: float
    eta_p: float
    T_static: float
    tau_T: float


@dataclass(frozen=True)
class Propeller:
    """A propeller whose torque and angular momentum act on the aircraft.

    Attributes:
        inertia: moment of inertia about its shaft, kg m2.
        Omega: rate of turn, rad/s; positive if it turns clockwise as seen by the pilot.
    """

    inertia: float
    Omega: float


@dataclass(frozen=True)
class Mode:
    """A second-order motion: natural frequency `omega` (rad/s) and damping ratio `D`."""

    omega: float
    D: float


@dataclass(frozen=True)
class LinearLoops:
    """The dynamics of the linear inner loops, where they are known better than from the aircraft's derivatives.

    Attributes:
        V: speed at which they hold in level flight at sea level, m/s; at other speeds they follow the derivatives.
        short_period, dutch_roll: the modes of the load factors n_z and n_y; None for the derivatives' own.
        tau_p: time constant of the roll rate, s; None likewise.
    """

    V: float
    short_period: Mode | None = None
    dutch_roll: Mode | None = None
    tau_p: float | None = None


@dataclass(frozen=True)
class Surfaces:
    """The travels of the control surfaces (rad) and the fastest rate at which a stick moves them (rad/s)."""

    eta: Interval
    xi: Interval
    zeta: Interval
    rate: float


@dataclass(frozen=True)
class PointMassLimits:
    """The limits of the point mass's controls, which stand in for the missing rotational dynamics.

    `n_z_dot`, `n_y_dot` 1/s; `p` rad/s; `p_dot` rad/s2; `n_y` g.
    """

    n_z_dot: float
    n_y_dot: float
    n_y: float
    p: float
    p_dot: float


@dataclass(frozen=True)
class Envelope:
    """The structural and speed limits: `V` is the allowed kinematic speed (m/s), `n_z` the load factor (g)."""

    V: Interval
    n_z: Interval


@dataclass(frozen=True)
class AerodynamicTables:
    """Tables that take the place of formulas; None where the formula holds.

    Attributes:
        lift: `C_L` over alpha_A (rad) with neutral controls and without rotation, of six degrees of freedom; the
            linear models keep `C_L0` and `C_Lalpha`.
        drag: `C_D` without sideslip over `C_L` and the Reynolds number of the mean chord.
        thrust: N, at full throttle over V_A (m/s) and density (kg/m3).
        chord: of the Reynolds number, m.
    """

    lift: Table | None
    drag: Table | None
    thrust: Table | None
    chord: float


@dataclass(frozen=True)
class Aircraft:
    """An aircraft, complete for a race.

    `propeller` is None if it has no effect but thrust, `linear` if the linear inner loops follow from the derivatives,
    `tables` if all formulas hold.
    """

    name: str
    airframe: Airframe
    lift: Lift
    drag: Drag
    side_force: SideForce
    roll: RollMoment
    pitch: PitchMoment
    yaw: YawMoment
    propulsion: Propulsion
    surfaces: Surfaces
    point_mass: PointMassLimits
    envelope: Envelope
    propeller: Propeller | None = None
    linear: LinearLoops | None = None
    tables: AerodynamicTables | None = None


@vector
class AircraftParameters(Vector[T]):
    """The mass, size, drag, side force and propulsion of an aircraft.

    `tables` belongs to the class: equations are made for the numbers of a class, and depend on its tables.
    """

    tables: ClassVar[AerodynamicTables | None] = None

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


Parameters = TypeVar("Parameters", bound=AircraftParameters[Any])


@functools.lru_cache(maxsize=32)
def with_tables(kind: type[Parameters], tables: AerodynamicTables | None) -> type[Parameters]:
    """Return the class of the numbers of an aircraft with tables, one for each set of tables."""
    if tables is None:
        return kind
    return cast("type[Parameters]", new_class(kind.__name__, (kind,), {}, lambda body: body.update(tables=tables)))


def inner_loop_parameters(aircraft: Aircraft) -> InnerLoopParameters[float]:
    """Return the numbers of one aircraft, with `C_Y_trim = C_Ybeta - C_Yzeta C_nbeta / C_nzeta`."""
    side, yaw, drag = aircraft.side_force, aircraft.yaw, aircraft.drag
    propulsion, propeller = aircraft.propulsion, aircraft.propeller
    P = propulsion.eta_p * propulsion.P_max
    kind = with_tables(InnerLoopParameters[float], aircraft.tables)
    return kind(
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
    kind = with_tables(AircraftParameters[float], aircraft.tables)
    return kind(**{name: getattr(numbers, name) for name in AircraftParameters.names()})
