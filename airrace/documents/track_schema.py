"""The track language `airrace/track/1`: which keys a course file knows, and in which ranges.

Every key carries its unit. What a key means for the race is said in `elements.py`, `course.py` and `weather.py`.
A further kind of element is one more class in `ElementEntry`, a further part of a course one more field of
`TrackEntry`.
"""

from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Gt, Le, Lt
from pydantic import Field, model_validator

from airrace.documents.schema import Schema

TRACK_SCHEMA = "airrace/track/1"

Coordinate = Annotated[float, Ge(-50_000), Le(50_000)]  # the frame is flat
Height = Annotated[float, Ge(0), Le(5000)]
Azimuth = Annotated[float, Ge(-180), Le(360)]
ClimbAngle = Annotated[float, Ge(-90), Le(90)]
DirectionName = Literal["forward", "reverse", "planned"]


class OriginEntry(Schema):
    what: ClassVar[str] = "the origin"
    latitude_deg: Annotated[float, Ge(-90), Le(90)] | None = None
    longitude_deg: Annotated[float, Ge(-180), Le(180)] | None = None
    elevation_m: Annotated[float, Ge(-450), Le(5000)] = 0.0


class WindEntry(Schema):
    """Static wind; exactly one of `speed_kt` and `speed_m_s`."""

    what: ClassVar[str] = "a wind"
    from_deg: Azimuth = Field(description="the direction it blows from")
    speed_kt: Annotated[float, Ge(0), Le(100)] | None = None
    speed_m_s: Annotated[float, Ge(0), Le(51)] | None = None
    profile: Literal["constant", "power", "log"] = "constant"
    reference_height_m: Annotated[float, Gt(0), Le(1000)] | None = None
    exponent: Annotated[float, Ge(0), Le(1)] | None = None
    roughness_m: Annotated[float, Gt(0), Le(5)] | None = None


class ThermalEntry(Schema):
    what: ClassVar[str] = "a thermal"
    north_m: Coordinate = Field(description="its centre, north of the origin")
    east_m: Coordinate = Field(description="its centre, east of the origin")
    w_star_m_s: Annotated[float, Gt(0), Le(10)] = Field(description="the convective velocity scale")
    mixing_height_m: Annotated[float, Ge(100), Le(5000)] = Field(description="the depth of the mixing layer")


class EnvironmentEntry(Schema):
    what: ClassVar[str] = "the environment"
    temperature_offset_K: Annotated[float, Ge(-60), Le(60)] = 0.0
    pressure_offset_hPa: Annotated[float, Ge(-100), Le(100)] = 0.0
    wind: WindEntry | None = None
    thermals: list[ThermalEntry] = Field(default_factory=list[ThermalEntry])


class RulesEntry(Schema):
    what: ClassVar[str] = "a rule book"
    n_z_max: Annotated[float, Gt(1), Le(25)] = Field(description="the largest load factor")
    n_z_min: Annotated[float, Ge(-25), Lt(1)] = -2.0
    C_L_max: Annotated[float, Gt(0), Le(5)] | None = None
    alpha_max_deg: Annotated[float, Gt(0), Le(90)] | None = None
    alpha_min_deg: Annotated[float, Ge(-90), Lt(90)] | None = None
    roll_rate_max_deg_s: Annotated[float, Ge(10), Le(1000)] | None = None
    sideslip_max_deg: Annotated[float, Gt(0), Le(45)] | None = None
    floor_m: Height = 10.0
    ceiling_m: Annotated[float, Gt(0), Le(5000)] | None = None
    start_speed_max_kt: Annotated[float, Ge(50), Le(500)] | None = None


class PassingEntry(Schema):
    """What gates and pylons have in common; an absent key takes the value of `gate_defaults`."""

    height_m: Height | None = None
    passing: Literal["point", "window"] | None = None
    clearance_m: Annotated[float, Ge(0), Le(50)] | None = None
    height_min_m: Height | None = None
    height_max_m: Height | None = None
    climb_min_deg: ClimbAngle | None = None
    climb_max_deg: ClimbAngle | None = None
    crossing_max_deg: Annotated[float, Gt(0), Le(85)] | None = None


class GatePassingEntry(PassingEntry):
    """What all two-pylon gates have in common."""

    width_m: Annotated[float, Gt(0), Le(500)] | None = None
    bank_tolerance_deg: Annotated[float, Gt(0), Le(90)] | None = None


Reach = Annotated[float, Gt(0), Le(5000)]


class GateDefaultsEntry(GatePassingEntry):
    """`clearance_m` is meant for two-pylon gates alone: at a single pylon it has its own default."""

    what: ClassVar[str] = "gate_defaults"
    reach_m: Reach | None = None


class LevelGateEntry(GatePassingEntry):
    what: ClassVar[str] = "a level gate"
    type: Literal["level"]
    north_m: Coordinate = Field(description="its centre, north of the origin")
    east_m: Coordinate = Field(description="its centre, east of the origin")
    heading_deg: Azimuth = Field(description="its axis when flown forward")


class KnifeEdgeGateEntry(GatePassingEntry):
    what: ClassVar[str] = "a knife-edge gate"
    type: Literal["knife-edge"]
    north_m: Coordinate = Field(description="its centre, north of the origin")
    east_m: Coordinate = Field(description="its centre, east of the origin")
    heading_deg: Azimuth = Field(description="its axis when flown forward")
    bank: Literal["right", "left", "either"] = "either"


class PylonEntry(PassingEntry):
    what: ClassVar[str] = "a pylon"
    type: Literal["pylon"]
    north_m: Coordinate = Field(description="its position, north of the origin")
    east_m: Coordinate = Field(description="its position, east of the origin")
    pass_side_deg: Azimuth = Field(description="the azimuth from the pylon to the side on which it is passed")
    reach_m: Reach | None = None


class ManoeuvreEntry(Schema):
    """An attitude at a position that is free within bounds; at least one condition."""

    what: ClassVar[str] = "a manoeuvre"
    type: Literal["manoeuvre"]
    climb_deg: ClimbAngle | None = None
    bank_deg: Annotated[float, Ge(-180), Le(180)] | None = None
    inverted: bool | None = None
    heading_deg: Azimuth | None = None
    north_m: Coordinate | None = None
    north_min_m: Coordinate | None = None
    north_max_m: Coordinate | None = None
    east_m: Coordinate | None = None
    east_min_m: Coordinate | None = None
    east_max_m: Coordinate | None = None
    height_m: Height | None = None
    height_min_m: Height | None = None
    height_max_m: Height | None = None


ElementEntry = Annotated[LevelGateEntry | KnifeEdgeGateEntry | PylonEntry | ManoeuvreEntry, Field(discriminator="type")]


class FlownEntry(Schema):
    """One passing: the name of an element, or `{gate: g4, direction: reverse}`."""

    what: ClassVar[str] = "a passing"
    form: ClassVar[str] = "the name of a gate or {gate: NAME, direction: reverse}"
    gate: str = Field(description="the name of an element of `gates`")
    direction: DirectionName | None = None

    @model_validator(mode="before")
    @classmethod
    def _from_name(cls, value: object) -> object:
        return {"gate": value} if isinstance(value, str) else value


class CourseEntry(Schema):
    what: ClassVar[str] = "a course"
    start: str = Field(description="the element that starts the clock")
    start_direction: DirectionName | None = None
    lap: Annotated[list[FlownEntry], Field(min_length=1)] = Field(description="the elements in the order flown")
    laps: Annotated[int, Ge(1), Le(100)] = 1
    finish: FlownEntry | None = None


class TrackEntry(Schema):
    """A whole course file."""

    what: ClassVar[str] = "a track"
    schema_: Literal["airrace/track/1"] = Field(alias="schema")
    name: Annotated[str, Field(min_length=1)] = Field(description="what the race is called")
    source: str = ""
    notes: str = ""
    aircraft: str | None = None
    origin: OriginEntry = OriginEntry()
    environment: EnvironmentEntry = EnvironmentEntry()
    rules: RulesEntry = Field(description="the limits of the race")
    gate_defaults: GateDefaultsEntry = GateDefaultsEntry()
    gates: dict[str, ElementEntry] = Field(description="what stands on the course, by name")
    course: CourseEntry = Field(description="the order in which it is flown")
