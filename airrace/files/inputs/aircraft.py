"""The aircraft language `airrace/aircraft/1`, its builder, and the check whether such an aircraft could fly.

Derivatives carry their symbol and no unit: they are per radian, rates are made dimensionless with `b/(2 V_A)` and
`cbar/(2 V_A)`. Ranges only bound what could belong to an aeroplane; what makes one fly is checked when it is built.
"""

import math
from itertools import pairwise
from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Gt, Le, Lt
from pydantic import Field

from airrace.files.inputs.nodes import Reporter
from airrace.files.inputs.schema import Schema, optional
from airrace.model.aircraft import (
    AerodynamicTables,
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
from airrace.model.dynamics.handling import faults
from airrace.model.environment import RHO_ISA, g0
from airrace.model.splines import Table
from airrace.optimal_control.quantities import Interval

Derivative = Annotated[float, Ge(-100), Le(100)]
Damping = Annotated[float, Ge(-100), Lt(0)]
Effectiveness = Annotated[float, Ge(-10), Lt(0)]
"""The effectiveness of a control about its own axis: a positive deflection makes a negative moment (LN 9300)."""
Inertia = Annotated[float, Gt(0), Le(1e6)]
Travel = Annotated[float, Gt(0), Le(60)]


class AirframeEntry(Schema):
    what: ClassVar[str] = "an airframe"
    m: Annotated[float, Gt(0), Le(1e5)] = Field(alias="mass_kg", description="with pilot and fuel")
    S: Annotated[float, Le(1000)] = Field(alias="wing_area_m2", description="the reference area")
    b: Annotated[float, Gt(0), Le(100)] = Field(alias="wing_span_m", description="the reference span b")
    cbar: Annotated[float, Gt(0), Le(20)] = Field(alias="mean_chord_m", description="the reference chord cbar")
    I_x: Inertia = Field(alias="I_x_kg_m2", description="moment of inertia in roll")
    I_y: Inertia = Field(alias="I_y_kg_m2", description="moment of inertia in pitch")
    I_z: Inertia = Field(alias="I_z_kg_m2", description="moment of inertia in yaw")
    I_xz: Annotated[float, Ge(-1e6), Le(1e6)] = Field(
        alias="I_xz_kg_m2", default=0.0, description="product of inertia of roll and yaw"
    )


class LiftEntry(Schema):
    what: ClassVar[str] = "the lift"
    C_L0: Annotated[float, Ge(-2), Le(2)] = Field(description="at zero angle of attack")
    C_Lalpha: Derivative = Field(description="lift curve slope per rad")
    C_Lq: Derivative = Field(description="due to the pitch rate")
    C_Leta: Derivative = Field(description="due to the elevator")
    C_L_max: Annotated[float, Le(5)] = Field(description="at the stall")
    C_L_min: Annotated[float, Ge(-5)] = Field(description="at the stall with negative lift")


class DragEntry(Schema):
    what: ClassVar[str] = "the drag"
    C_D0: Annotated[float, Gt(0), Le(1)] = Field(description="at the lift of least drag")
    k: Annotated[float, Gt(0), Le(1)] = Field(description="induced drag factor")
    C_L_minD: Annotated[float, Ge(-1), Le(1)] = Field(default=0.0, description="lift coefficient of least drag")
    C_Dbeta2: Annotated[float, Ge(0), Le(20)] = Field(description="due to the squared sideslip, per rad2")
    beta_A_max: Annotated[float, Gt(0), Le(45)] = Field(
        alias="sideslip_max_deg", description="where this drag model ends"
    )


class SideForceEntry(Schema):
    what: ClassVar[str] = "the side force"
    C_Ybeta: Damping = Field(description="due to sideslip")
    C_Yp: Derivative = Field(description="due to the roll rate")
    C_Yr: Derivative = Field(description="due to the yaw rate")
    C_Yxi: Derivative = Field(description="due to the ailerons")
    C_Yzeta: Derivative = Field(description="due to the rudder")


class RollEntry(Schema):
    what: ClassVar[str] = "the rolling moment"
    C_lbeta: Derivative = Field(description="due to sideslip")
    C_lp: Damping = Field(description="roll damping")
    C_lr: Derivative = Field(description="due to the yaw rate")
    C_lr_per_C_L: Derivative = Field(default=0.0, description="added to C_lr in proportion to the lift coefficient")
    C_lxi: Effectiveness = Field(description="due to the ailerons")
    C_lzeta: Derivative = Field(description="due to the rudder")


class PitchEntry(Schema):
    what: ClassVar[str] = "the pitching moment"
    C_m0: Annotated[float, Ge(-1), Le(1)] = Field(description="at zero angle of attack")
    C_malpha: Derivative = Field(description="due to the angle of attack")
    C_mq: Damping = Field(description="pitch damping")
    C_malphadot: Annotated[float, Ge(-100), Le(0)] = Field(description="due to the change of the angle of attack")
    C_meta: Effectiveness = Field(description="due to the elevator")


class YawEntry(Schema):
    what: ClassVar[str] = "the yawing moment"
    C_nbeta: Derivative = Field(description="due to sideslip")
    C_np: Derivative = Field(description="due to the roll rate")
    C_np_per_C_L: Derivative = Field(default=0.0, description="added to C_np in proportion to the lift coefficient")
    C_nr: Damping = Field(description="yaw damping")
    C_nxi: Derivative = Field(description="due to the ailerons")
    C_nzeta: Effectiveness = Field(description="due to the rudder")


class PropulsionEntry(Schema):
    what: ClassVar[str] = "the propulsion"
    P_max: Annotated[float, Gt(0), Le(10_000)] = Field(alias="power_max_kW", description="of the engine at sea level")
    eta_p: Annotated[float, Gt(0), Lt(1)] = Field(alias="propeller_efficiency", description="eta_p")
    T_static: Annotated[float, Gt(0), Le(1e6)] = Field(alias="static_thrust_N", description="at rest; a fit parameter")
    tau_T: Annotated[float, Gt(0), Le(10)] = Field(alias="lever_lag_s", description="tau_T, from throttle to thrust")


class PropellerEntry(Schema):
    """The numbers of a propeller; they act on the aircraft only where `effects` asks for it."""

    what: ClassVar[str] = "the propeller"
    inertia_kg_m2: Annotated[float, Gt(0), Le(1e4)] = Field(description="moment of inertia about its shaft")
    rpm: Annotated[float, Gt(0), Le(20_000)] = Field(description="how fast it turns")
    turns: Literal["right", "left"] = Field(
        default="right", description="which way, as the pilot sees it: right is clockwise"
    )
    effects: bool = Field(
        default=False, description="whether its torque and its gyroscopic moment act on the six-dof model"
    )


class LinearEntry(Schema):
    """The constants of the linear models, where better ones are known than the derivatives give."""

    what: ClassVar[str] = "the group of linear loops"
    speed_m_s: Annotated[float, Gt(0), Le(300)] = Field(
        description="where the constants hold, in level flight at sea level; elsewhere they follow the derivatives"
    )
    omega_z_rad_s: Annotated[float, Gt(0), Le(100)] | None = optional(
        "natural frequency of the short period, of n_z; with damping_z"
    )
    damping_z: Annotated[float, Gt(0), Le(10)] | None = optional("damping ratio of the short period")
    omega_y_rad_s: Annotated[float, Gt(0), Le(100)] | None = optional(
        "natural frequency of the Dutch roll, of n_y; with damping_y"
    )
    damping_y: Annotated[float, Gt(0), Le(10)] | None = optional("damping ratio of the Dutch roll")
    tau_p_s: Annotated[float, Gt(0), Le(10)] | None = optional("lag of the roll rate")


class SurfacesEntry(Schema):
    """The travels of the control surfaces, alike to both sides."""

    what: ClassVar[str] = "the group of control surfaces"
    elevator_travel_deg: Travel = Field(description="largest deflection to either side")
    aileron_travel_deg: Travel = Field(description="largest deflection to either side")
    rudder_travel_deg: Travel = Field(description="largest deflection to either side")
    deflection_rate_max_deg_s: Annotated[float, Gt(0), Le(2000)] = Field(description="as fast as the stick moves")


class PointMassEntry(Schema):
    what: ClassVar[str] = "the point mass"
    n_z_dot: Annotated[float, Gt(0), Le(1000)] = Field(alias="n_z_rate_max_per_s", description="of the load factor n_z")
    n_y_dot: Annotated[float, Gt(0), Le(1000)] = Field(
        alias="n_y_rate_max_per_s", description="of the lateral load factor n_y"
    )
    n_y: Annotated[float, Gt(0), Le(10)] = Field(alias="n_y_max", description="largest lateral load factor")
    p: Annotated[float, Gt(0), Le(1000)] = Field(alias="roll_rate_max_deg_s", description="of p_Kbar")
    p_dot: Annotated[float, Gt(0), Le(1000)] = Field(alias="roll_acceleration_max_rad_s2", description="of p_Kbar")


class EnvelopeEntry(Schema):
    what: ClassVar[str] = "the envelope"
    speed_min_m_s: Annotated[float, Gt(0), Le(300)] = Field(description="least kinematic speed")
    speed_max_m_s: Annotated[float, Gt(0), Le(300)] = Field(description="largest kinematic speed")
    n_z_min: Annotated[float, Ge(-25), Lt(1)] = Field(description="least load factor")
    n_z_max: Annotated[float, Gt(1), Le(25)] = Field(description="largest load factor")


class PublishedEntry(Schema):
    """Figures of the flight manual, with which those of the aircraft are compared; no flight depends on them."""

    what: ClassVar[str] = "the group of published figures"
    source: str = Field(default="", description="where they are published")
    manual_mass: Annotated[float, Gt(0), Le(1e5)] | None = optional("at which they hold, if not the own", "mass_kg")
    manual_power: Annotated[float, Gt(0), Le(10_000)] | None = optional(
        "at which they hold, if not the own", "power_kW"
    )
    stall: Annotated[float, Gt(0), Le(300)] | None = optional("in level flight, without flaps", "stall_m_s")
    speed_max: Annotated[float, Gt(0), Le(300)] | None = optional("of level flight at sea level", "speed_max_m_s")
    climb: Annotated[float, Gt(0), Le(100)] | None = optional("best rate of climb at sea level", "climb_m_s")
    roll_rate: Annotated[float, Gt(0), Le(1000)] | None = optional("of full ailerons", "roll_rate_deg_s")
    roll_speed: Annotated[float, Gt(0), Le(300)] | None = optional(
        "of that roll rate; V_A by default", "roll_speed_m_s"
    )
    turn: Annotated[float, Gt(1), Le(25)] | None = optional("of the tightest level turn that is held", "n_z_turn")


Row = Annotated[list[float], Field(min_length=1, max_length=30)]
Knots = Annotated[list[float], Field(min_length=1, max_length=30)]


class LiftTableEntry(Schema):
    what: ClassVar[str] = "a table of lift"
    alpha_deg: Knots = Field(description="angles of attack, increasing")
    C_L: Row = Field(description="lift coefficient at each of them")


class DragTableEntry(Schema):
    what: ClassVar[str] = "a table of drag"
    C_L: Knots = Field(description="lift coefficients, increasing")
    Re: Knots = Field(description="Reynolds numbers of the mean chord, increasing")
    C_D: Annotated[list[Row], Field(max_length=30)] = Field(
        description="drag coefficient without sideslip: a row for each C_L, a column for each Re"
    )


class ThrustTableEntry(Schema):
    what: ClassVar[str] = "a table of thrust"
    speed_m_s: Knots = Field(description="airspeeds, increasing")
    density_kg_m3: Knots = Field(description="densities of the air, increasing")
    thrust_N: Annotated[list[Row], Field(max_length=30)] = Field(
        description="thrust at full throttle: a row for each airspeed, a column for each density"
    )


class TablesEntry(Schema):
    what: ClassVar[str] = "tables of the aircraft"
    lift: LiftTableEntry | None = optional("lift, in place of C_L0, C_Lalpha and the stall, in six-dof alone")
    drag: DragTableEntry | None = optional("drag, in place of C_D0, k and C_L_minD")
    thrust: ThrustTableEntry | None = optional("thrust, in place of power, efficiency and static thrust")


class AircraftEntry(Schema):
    """A whole aircraft file."""

    what: ClassVar[str] = "an aircraft"
    schema_: Literal["airrace/aircraft/1"] = Field(
        alias="schema", description="the language of this file and its version"
    )
    name: Annotated[str, Field(min_length=1)] = Field(description="what the aircraft is called")
    source: str = Field(default="", description="where the numbers come from")
    notes: str = Field(default="", description="whatever else a reader should know")
    airframe: AirframeEntry = Field(description="mass, size, moments of inertia")
    lift: LiftEntry = Field(description="the lift coefficient")
    drag: DragEntry = Field(description="the drag coefficient")
    side_force: SideForceEntry = Field(description="the side-force coefficient")
    roll: RollEntry = Field(description="the rolling-moment coefficient")
    pitch: PitchEntry = Field(description="the pitching-moment coefficient")
    yaw: YawEntry = Field(description="the yawing-moment coefficient")
    propulsion: PropulsionEntry = Field(description="engine and propeller")
    surfaces: SurfacesEntry = Field(description="travels of the control surfaces")
    point_mass: PointMassEntry = Field(description="rates that stand in for the rotational dynamics")
    envelope: EnvelopeEntry = Field(description="limits of speed and load factor")
    propeller: PropellerEntry | None = optional("what the propeller does besides pulling")
    linear: LinearEntry | None = optional("constants of the linear models that replace those of the derivatives")
    tables: TablesEntry | None = optional("tables that take the place of formulas, read as smooth splines")
    published: PublishedEntry | None = optional("figures of the flight manual, to compare with")


def build_aircraft(entry: AircraftEntry, reporter: Reporter) -> Aircraft:
    """Return the aircraft of a file; valid only if nothing was reported."""
    surfaces, envelope = entry.surfaces, entry.envelope
    propeller: Propeller | None = None
    if entry.propeller and entry.propeller.effects:
        sign = 1.0 if entry.propeller.turns == "right" else -1.0
        propeller = Propeller(entry.propeller.inertia_kg_m2, sign * entry.propeller.rpm * 2.0 * math.pi / 60.0)
    aircraft = Aircraft(
        name=entry.name,
        airframe=Airframe(**entry.airframe.arguments()),
        lift=Lift(**entry.lift.arguments()),
        drag=Drag(**entry.drag.arguments()),
        side_force=SideForce(**entry.side_force.arguments()),
        roll=RollMoment(**entry.roll.arguments()),
        pitch=PitchMoment(**entry.pitch.arguments()),
        yaw=YawMoment(**entry.yaw.arguments()),
        propulsion=Propulsion(**entry.propulsion.arguments()),
        surfaces=Surfaces(
            eta=Interval.degrees(-surfaces.elevator_travel_deg, surfaces.elevator_travel_deg),
            xi=Interval.degrees(-surfaces.aileron_travel_deg, surfaces.aileron_travel_deg),
            zeta=Interval.degrees(-surfaces.rudder_travel_deg, surfaces.rudder_travel_deg),
            rate=math.radians(surfaces.deflection_rate_max_deg_s),
        ),
        point_mass=PointMassLimits(**entry.point_mass.arguments()),
        envelope=Envelope(
            V=Interval(envelope.speed_min_m_s, envelope.speed_max_m_s),
            n_z=Interval(envelope.n_z_min, envelope.n_z_max),
        ),
        propeller=propeller,
        linear=_linear(entry.linear, reporter) if entry.linear else None,
        tables=_tables(entry.tables, entry.airframe.cbar, reporter) if entry.tables else None,
    )
    before = len(reporter.findings)
    _check_inertia(aircraft.airframe, reporter)
    _check_lift(aircraft, reporter)
    if len(reporter.findings) == before:
        for group, key, message in faults(aircraft):
            reporter.value((group, key), message)
    return aircraft


def _tables(entry: TablesEntry, chord: float, reporter: Reporter) -> AerodynamicTables:
    lift, drag, thrust = entry.lift, entry.drag, entry.thrust

    def table(name: str, knots: dict[str, list[float]], key: str, values: list[list[float]]) -> Table | None:
        before = len(reporter.findings)
        for variable, numbers in knots.items():
            if any(later <= earlier for earlier, later in pairwise(numbers)):
                reporter.value(("tables", name, variable), "must increase from each number to the next")
        counts = [len(numbers) for numbers in knots.values()]
        if len(values) != counts[0]:
            first = next(iter(knots))
            reporter.value(
                ("tables", name, key), f"must have {counts[0]} values or rows, as {first} has; has {len(values)}"
            )
        for row in values:
            if len(counts) > 1 and len(row) != counts[1]:
                second = list(knots)[1]
                message = f"must have {counts[1]} numbers in every row, as {second} has; has {len(row)} in one"
                reporter.value(("tables", name, key), message)
        if len(reporter.findings) > before:
            return None
        return Table(tuple(tuple(numbers) for numbers in knots.values()), tuple(tuple(row) for row in values))

    return AerodynamicTables(
        lift=lift
        and table("lift", {"alpha_deg": [math.radians(a) for a in lift.alpha_deg]}, "C_L", [[c] for c in lift.C_L]),
        drag=drag and table("drag", {"C_L": drag.C_L, "Re": drag.Re}, "C_D", drag.C_D),
        thrust=thrust
        and table(
            "thrust",
            {"speed_m_s": thrust.speed_m_s, "density_kg_m3": thrust.density_kg_m3},
            "thrust_N",
            thrust.thrust_N,
        ),
        chord=chord,
    )


def _linear(entry: LinearEntry, reporter: Reporter) -> LinearLoops:
    def mode(axis: str, omega: float | None, D: float | None) -> Mode | None:
        if omega is None and D is None:
            return None
        if omega is not None and D is not None:
            return Mode(omega, D)
        present, missing = f"damping_{axis}", f"omega_{axis}_rad_s"
        if D is None:
            present, missing = missing, present
        reporter.key(("linear", present), f"has no meaning without {missing}; set both or neither")
        return None

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
    for key, moment, sum_of_two in (("I_x", I_x, I_y + I_z), ("I_y", I_y, I_x + I_z), ("I_z", I_z, I_x + I_y)):
        if moment > sum_of_two:
            reporter.value(
                ("airframe", f"{key}_kg_m2"),
                f"no body has such a moment of inertia: {moment:g} is more than the other two together, {sum_of_two:g}",
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


def _check_lift(aircraft: Aircraft, reporter: Reporter) -> None:
    """Report a wing without area, without lift that grows with the angle of attack, or too small for the weight."""
    lift, airframe, V = aircraft.lift, aircraft.airframe, aircraft.envelope.V
    conditions = (
        ("airframe", "wing_area_m2", airframe.S <= 0.0, "an aircraft without a wing has no lift; must be above 0"),
        ("lift", "C_Lalpha", lift.C_Lalpha <= 0.0, "lift must grow with the angle of attack; must be above 0 per rad"),
        ("lift", "C_L_max", lift.C_L_max <= 0.0, "the wing stalls before it lifts; must be above 0"),
        ("lift", "C_L_min", lift.C_L_min >= 0.0, "the wing must be able to push down, too; must be below 0"),
        ("envelope", "speed_max_m_s", V.upper <= V.lower, f"must be above speed_min_m_s, {V.lower:g}"),
    )
    before = len(reporter.findings)
    for group, key, is_wrong, message in conditions:
        if is_wrong:
            reporter.value((group, key), message)
    if len(reporter.findings) > before:
        return
    if not lift.C_L_min < lift.C_L0 < lift.C_L_max:
        reporter.value(("lift", "C_L0"), f"must lie between C_L_min and C_L_max, {lift.C_L_min:g} and {lift.C_L_max:g}")
    shortfall = weight_not_carried(aircraft, lift.C_L_max)
    if shortfall:
        reporter.value(("lift", "C_L_max"), shortfall)


def weight_not_carried(aircraft: Aircraft, C_L_max: float) -> str:
    """Return why the aircraft cannot hold 1 g at sea level at any speed of its envelope; empty if it can."""
    airframe, V_max = aircraft.airframe, aircraft.envelope.V.upper
    weight = airframe.m * g0
    lift = 0.5 * RHO_ISA * V_max**2 * airframe.S * C_L_max
    if lift >= weight:
        return ""
    return (
        f"the wing cannot carry the aircraft: at {V_max:g} m/s, the envelope's top speed, C_L = {C_L_max:.3g} lifts "
        f"{lift:.0f} N at sea level, the weight is {weight:.0f} N"
    )
