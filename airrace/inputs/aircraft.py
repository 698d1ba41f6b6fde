"""The builder of the aircraft of an aircraft file, and the check whether it could fly."""

import math

from airrace.aircraft.aircraft import (
    Aircraft,
    Airframe,
    Drag,
    Envelope,
    Lift,
    LinearLoops,
    Mode,
    PitchMoment,
    PointMassLimits,
    Propeller,
    Propulsion,
    RollMoment,
    SideForce,
    Surfaces,
    YawMoment,
)
from airrace.dynamics.handling import faults
from airrace.inputs.aircraft_schema import (
    AircraftEntry,
    AirframeEntry,
    LinearEntry,
    PointMassEntry,
    PropellerEntry,
    SurfacesEntry,
)
from airrace.inputs.nodes import Reporter
from airrace.quantities import Interval

g0 = 9.80665
"""The standard acceleration of gravity, m/s2."""
rho_0 = 1.225
"""The density at sea level in the standard atmosphere, kg/m3: close enough to tell a wing from a brick."""


def build_aircraft(entry: AircraftEntry, reporter: Reporter) -> Aircraft:
    """Return the aircraft of a file; it is only of use if nothing was reported."""
    lift, drag, envelope = entry.lift, entry.drag, entry.envelope
    side, roll, pitch, yaw = entry.side_force, entry.roll, entry.pitch, entry.yaw
    built = Aircraft(
        name=entry.name,
        airframe=_airframe(entry.airframe),
        lift=Lift(lift.C_L0, lift.C_Lalpha, lift.C_Lq, lift.C_Leta, C_L_max=lift.C_L_max, C_L_min=lift.C_L_min),
        drag=Drag(drag.C_D0, drag.k, drag.C_L_minD, drag.C_Dbeta2, beta_A_max=math.radians(drag.sideslip_max_deg)),
        side_force=SideForce(beta=side.C_Ybeta, p=side.C_Yp, r=side.C_Yr, xi=side.C_Yxi, zeta=side.C_Yzeta),
        roll=RollMoment(
            beta=roll.C_lbeta,
            p=roll.C_lp,
            r=roll.C_lr,
            r_per_C_L=roll.C_lr_per_C_L,
            xi=roll.C_lxi,
            zeta=roll.C_lzeta,
        ),
        pitch=PitchMoment(
            zero=pitch.C_m0, alpha=pitch.C_malpha, q=pitch.C_mq, alphadot=pitch.C_malphadot, eta=pitch.C_meta
        ),
        yaw=YawMoment(
            beta=yaw.C_nbeta, p=yaw.C_np, p_per_C_L=yaw.C_np_per_C_L, r=yaw.C_nr, xi=yaw.C_nxi, zeta=yaw.C_nzeta
        ),
        propulsion=Propulsion(
            P_max=entry.propulsion.power_max_kW * 1000.0,
            eta_p=entry.propulsion.propeller_efficiency,
            T_static=entry.propulsion.static_thrust_N,
            tau_T=entry.propulsion.lever_lag_s,
        ),
        surfaces=_surfaces(entry.surfaces),
        point_mass=_point_mass(entry.point_mass),
        envelope=Envelope(
            V=Interval(envelope.speed_min_m_s, envelope.speed_max_m_s),
            n_z=Interval(envelope.n_z_min, envelope.n_z_max),
        ),
        propeller=_propeller(entry.propeller) if entry.propeller and entry.propeller.effects else None,
        linear=_linear(entry.linear, reporter) if entry.linear else None,
    )
    found = len(reporter.findings)
    _check_inertia(built.airframe, reporter)
    _check_lift(built, reporter)
    if len(reporter.findings) == found:
        for group, key, message in faults(built):
            reporter.value((group, key), message)
    return built


def _airframe(entry: AirframeEntry) -> Airframe:
    return Airframe(
        m=entry.mass_kg,
        S=entry.wing_area_m2,
        b=entry.wing_span_m,
        cbar=entry.mean_chord_m,
        I_x=entry.I_x_kg_m2,
        I_y=entry.I_y_kg_m2,
        I_z=entry.I_z_kg_m2,
        I_xz=entry.I_xz_kg_m2,
    )


def _surfaces(entry: SurfacesEntry) -> Surfaces:
    def travel(degrees: float) -> Interval:
        return Interval(-math.radians(degrees), math.radians(degrees))

    return Surfaces(
        eta=travel(entry.elevator_travel_deg),
        xi=travel(entry.aileron_travel_deg),
        zeta=travel(entry.rudder_travel_deg),
        rate=math.radians(entry.deflection_rate_max_deg_s),
    )


def _point_mass(entry: PointMassEntry) -> PointMassLimits:
    return PointMassLimits(
        n_z_dot=entry.n_z_rate_max_per_s,
        n_y_dot=entry.n_y_rate_max_per_s,
        n_y=entry.n_y_max,
        p=math.radians(entry.roll_rate_max_deg_s),
        p_dot=entry.roll_acceleration_max_rad_s2,
    )


def _propeller(entry: PropellerEntry) -> Propeller:
    sign = 1.0 if entry.turns == "right" else -1.0
    return Propeller(entry.inertia_kg_m2, sign * entry.rpm * 2.0 * math.pi / 60.0)


def _linear(entry: LinearEntry, reporter: Reporter) -> LinearLoops:
    def mode(axis: str, omega: float | None, D: float | None) -> Mode | None:
        if omega is None and D is None:
            return None
        if omega is None or D is None:
            missing = f"omega_{axis}_rad_s" if omega is None else f"damping_{axis}"
            given = f"damping_{axis}" if omega is None else f"omega_{axis}_rad_s"
            reporter.key(("linear", given), f"tells nothing without {missing}; give both or neither")
            return None
        return Mode(omega, D)

    return LinearLoops(
        V=entry.speed_m_s,
        short_period=mode("z", entry.omega_z_rad_s, entry.damping_z),
        dutch_roll=mode("y", entry.omega_y_rad_s, entry.damping_y),
        tau_p=entry.tau_p_s,
    )


def _check_inertia(airframe: Airframe, reporter: Reporter) -> None:
    """Report moments of inertia that no rigid body has.

    They must obey the triangle inequality, their tensor must be positive definite, and no mass is farther from the
    axis than a wing tip.
    """
    I_x, I_y, I_z = airframe.I_x, airframe.I_y, airframe.I_z
    for key, moment, others in (("I_x", I_x, I_y + I_z), ("I_y", I_y, I_x + I_z), ("I_z", I_z, I_x + I_y)):
        if moment > others:
            reporter.value(
                ("airframe", f"{key}_kg_m2"),
                f"no body has such a moment of inertia: {moment:g} is more than the other two together, {others:g}",
            )
    arm = 0.5 * airframe.b
    if arm > 0.0 and airframe.m * arm * arm < I_x:
        least = I_x / arm / arm
        reporter.value(
            ("airframe", "mass_kg"),
            f"is too little: nothing within a wing span of {airframe.b:g} m has I_x_kg_m2 = {I_x:g} and weighs less "
            f"than {least:.3g} kg",
        )
    if airframe.I_xz**2 >= I_x * I_z:
        reporter.value(("airframe", "I_xz_kg_m2"), f"must be smaller than sqrt(I_x I_z) = {math.sqrt(I_x * I_z):g}")


def _check_lift(built: Aircraft, reporter: Reporter) -> None:
    """Report what keeps an aircraft from flying.

    Its wing must have an area, gain lift with the angle of attack, and be able to carry the weight.
    """
    lift, airframe, V = built.lift, built.airframe, built.envelope.V
    faults = (
        ("airframe", "wing_area_m2", airframe.S <= 0.0, "an aircraft without a wing has no lift; must be above 0"),
        ("lift", "C_Lalpha", lift.C_Lalpha <= 0.0, "lift must grow with the angle of attack; must be above 0 per rad"),
        ("lift", "C_L_max", lift.C_L_max <= 0.0, "the wing stalls before it lifts; must be above 0"),
        ("lift", "C_L_min", lift.C_L_min >= 0.0, "the wing must be able to push down, too; must be below 0"),
        ("envelope", "speed_max_m_s", V.upper <= V.lower, f"must be above speed_min_m_s, {V.lower:g}"),
    )
    found = False
    for group, key, holds, message in faults:
        if holds:
            found = True
            reporter.value((group, key), message)
    if found:
        return
    if not lift.C_L_min < lift.C_L0 < lift.C_L_max:
        reporter.value(("lift", "C_L0"), f"must lie between C_L_min and C_L_max, {lift.C_L_min:g} and {lift.C_L_max:g}")
    shortfall = weight_not_carried(built, lift.C_L_max)
    if shortfall:
        reporter.value(("lift", "C_L_max"), shortfall)


def weight_not_carried(built: Aircraft, C_L_max: float) -> str:
    """Return why the aircraft cannot hold 1 g at sea level at any speed of its envelope; empty if it can."""
    airframe, V_max = built.airframe, built.envelope.V.upper
    weight = airframe.m * g0
    lift = 0.5 * rho_0 * V_max**2 * airframe.S * C_L_max
    if lift >= weight:
        return ""
    return (
        f"the wing cannot carry the aircraft: at {V_max:g} m/s, the envelope's top speed, C_L_max = {C_L_max:g} lifts "
        f"{lift:.0f} N at sea level, the weight is {weight:.0f} N"
    )
