"""Aircraft: frozen numbers with units, without equations. Symbols follow the flight model; SI and radians."""

from airrace.quantities import Interval
from airrace.records import record


@record
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


@record
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


@record
class Drag:
    """The coefficients of drag; their fit ends at the sideslip `beta_A_max` (rad).

    `C_D = C_D0 + k (C_L - C_L_minD)^2 + C_Dbeta2 beta_A^2`
    """

    C_D0: float
    k: float
    C_L_minD: float
    C_Dbeta2: float
    beta_A_max: float


@record
class SideForce:
    """The derivatives of `C_Y`."""

    C_Ybeta: float
    C_Yp: float
    C_Yr: float
    C_Yxi: float
    C_Yzeta: float


@record
class RollMoment:
    """The derivatives of `C_l`; `C_lr_per_C_L` adds to `C_lr` in proportion to the lift coefficient."""

    C_lbeta: float
    C_lp: float
    C_lr: float
    C_lr_per_C_L: float
    C_lxi: float
    C_lzeta: float


@record
class PitchMoment:
    """The coefficient `C_m0` and the derivatives of `C_m`."""

    C_m0: float
    C_malpha: float
    C_mq: float
    C_malphadot: float
    C_meta: float


@record
class YawMoment:
    """The derivatives of `C_n`; `C_np_per_C_L` adds to `C_np` in proportion to the lift coefficient."""

    C_nbeta: float
    C_np: float
    C_np_per_C_L: float
    C_nr: float
    C_nxi: float
    C_nzeta: float


@record
class Propulsion:
    """The numbers of the thrust: `P_max` W, `T_static` N, lag `tau_T` s, efficiency `eta_p`.

    `T = delta_T eta_p P_max sigma_P / sqrt(V_A^2 + V_s^2)`, `V_s = eta_p P_max / T_static`
    """

    P_max: float
    eta_p: float
    T_static: float
    tau_T: float


@record
class Propeller:
    """A propeller whose torque and angular momentum act on the aircraft.

    Attributes:
        inertia: moment of inertia about its shaft, kg m2.
        Omega: rate of turn, rad/s; positive if it turns clockwise as seen by the pilot.
    """

    inertia: float
    Omega: float


@record
class Mode:
    """A second-order motion: natural frequency `omega` (rad/s) and damping ratio `D`."""

    omega: float
    D: float


@record
class LinearLoops:
    """The dynamics of the linear inner loops, where they are known better than the aircraft's derivatives tell.

    Attributes:
        V: speed at which they hold in level flight at sea level, m/s; at other speeds they follow the derivatives.
        short_period, dutch_roll: the modes of the load factors n_z and n_y; None for the derivatives' own.
        tau_p: time constant of the roll rate, s; None likewise.
    """

    V: float
    short_period: Mode | None = None
    dutch_roll: Mode | None = None
    tau_p: float | None = None


@record
class Surfaces:
    """The travels of the control surfaces (rad) and the fastest rate at which a stick moves them (rad/s)."""

    eta: Interval
    xi: Interval
    zeta: Interval
    rate: float


@record
class PointMassLimits:
    """The limits of the point mass's controls, which stand in for the missing rotational dynamics.

    `n_z_dot`, `n_y_dot` 1/s; `p` rad/s; `p_dot` rad/s2; `n_y` g.
    """

    n_z_dot: float
    n_y_dot: float
    n_y: float
    p: float
    p_dot: float


@record
class Envelope:
    """The structural and speed limits: `V` is the allowed kinematic speed (m/s), `n_z` the load factor (g)."""

    V: Interval
    n_z: Interval


@record
class Aircraft:
    """An aircraft, complete for a race.

    `propeller` is None if it has no effect but thrust, `linear` if the linear inner loops follow from the derivatives.
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
