"""The aircraft language `airrace/aircraft/1`: which keys an aircraft file knows, and in which ranges.

Derivatives carry their symbol and no unit: they are per radian, rates are made dimensionless with `b/(2 V_A)` and
`cbar/(2 V_A)`. Ranges only bound what could belong to an aeroplane; what makes one fly is checked in `aircraft.py`.
"""

from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Gt, Le, Lt
from pydantic import Field

from airrace.inputs.schema import Schema

AIRCRAFT_SCHEMA = "airrace/aircraft/1"

Derivative = Annotated[float, Ge(-100), Le(100)]
Damping = Annotated[float, Ge(-100), Lt(0)]
Effectiveness = Annotated[float, Ge(-10), Lt(0)]
"""The effectiveness of a control about its own axis: a positive deflection makes a negative moment (LN 9300)."""
Inertia = Annotated[float, Gt(0), Le(1e6)]
Travel = Annotated[float, Gt(0), Le(60)]


class AirframeEntry(Schema):
    what: ClassVar[str] = "an airframe"
    mass_kg: Annotated[float, Gt(0), Le(1e5)] = Field(description="with pilot and fuel")
    wing_area_m2: Annotated[float, Le(1000)] = Field(description="the reference area")
    wing_span_m: Annotated[float, Gt(0), Le(100)] = Field(description="the reference span b")
    mean_chord_m: Annotated[float, Gt(0), Le(20)] = Field(description="the reference chord cbar")
    I_x_kg_m2: Inertia = Field(description="moment of inertia in roll")
    I_y_kg_m2: Inertia = Field(description="moment of inertia in pitch")
    I_z_kg_m2: Inertia = Field(description="moment of inertia in yaw")
    I_xz_kg_m2: Annotated[float, Ge(-1e6), Le(1e6)] = Field(
        default=0.0, description="product of inertia of roll and yaw"
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
    sideslip_max_deg: Annotated[float, Gt(0), Le(45)] = Field(description="where this drag model ends")


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
    power_max_kW: Annotated[float, Gt(0), Le(10_000)] = Field(description="of the engine at sea level")
    propeller_efficiency: Annotated[float, Gt(0), Lt(1)] = Field(description="eta_p")
    static_thrust_N: Annotated[float, Gt(0), Le(1e6)] = Field(description="at rest; a fit parameter")
    lever_lag_s: Annotated[float, Gt(0), Le(10)] = Field(description="tau_T, from lever to thrust")


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
    omega_z_rad_s: Annotated[float, Gt(0), Le(100)] | None = Field(
        default=None, description="natural frequency of the short period, of n_z; with damping_z"
    )
    damping_z: Annotated[float, Gt(0), Le(10)] | None = Field(
        default=None, description="damping ratio of the short period"
    )
    omega_y_rad_s: Annotated[float, Gt(0), Le(100)] | None = Field(
        default=None, description="natural frequency of the Dutch roll, of n_y; with damping_y"
    )
    damping_y: Annotated[float, Gt(0), Le(10)] | None = Field(
        default=None, description="damping ratio of the Dutch roll"
    )
    tau_p_s: Annotated[float, Gt(0), Le(10)] | None = Field(default=None, description="lag of the roll rate")


class SurfacesEntry(Schema):
    """The travels of the control surfaces, alike to both sides."""

    what: ClassVar[str] = "the group of control surfaces"
    elevator_travel_deg: Travel = Field(description="largest deflection to either side")
    aileron_travel_deg: Travel = Field(description="largest deflection to either side")
    rudder_travel_deg: Travel = Field(description="largest deflection to either side")
    deflection_rate_max_deg_s: Annotated[float, Gt(0), Le(2000)] = Field(description="as fast as the stick moves")


class PointMassEntry(Schema):
    what: ClassVar[str] = "the point mass"
    n_z_rate_max_per_s: Annotated[float, Gt(0), Le(1000)] = Field(description="of the load factor n_z")
    n_y_rate_max_per_s: Annotated[float, Gt(0), Le(1000)] = Field(description="of the lateral load factor n_y")
    n_y_max: Annotated[float, Gt(0), Le(10)] = Field(description="largest lateral load factor")
    roll_rate_max_deg_s: Annotated[float, Gt(0), Le(1000)] = Field(description="of p_Kbar")
    roll_acceleration_max_rad_s2: Annotated[float, Gt(0), Le(1000)] = Field(description="of p_Kbar")


class EnvelopeEntry(Schema):
    what: ClassVar[str] = "the envelope"
    speed_min_m_s: Annotated[float, Gt(0), Le(300)] = Field(description="least kinematic speed")
    speed_max_m_s: Annotated[float, Gt(0), Le(300)] = Field(description="largest kinematic speed")
    n_z_min: Annotated[float, Ge(-25), Lt(1)] = Field(description="least load factor")
    n_z_max: Annotated[float, Gt(1), Le(25)] = Field(description="largest load factor")


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
    propeller: PropellerEntry | None = Field(default=None, description="what the propeller does besides pulling")
    linear: LinearEntry | None = Field(
        default=None, description="constants of the linear models that replace those of the derivatives"
    )
