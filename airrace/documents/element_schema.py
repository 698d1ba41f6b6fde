"""The elements of the track language: what can stand on a course or be flown in between, key by key.

A further kind of element is one more class in `ElementEntry`; what its keys mean for the race is said in
`elements.py` and `manoeuvres.py`.
"""

from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Gt, Le
from pydantic import Field

from airrace.documents.place_schema import Azimuth, ClimbAngle, Coordinate, Height, PlacedEntry
from airrace.documents.schema import Schema

KnifeEdgeName = Literal["right", "left", "either"]
BankName = Literal["level", "right", "left", "either"]
QUAD_CROSSING_MAX_DEG = 40
"""From 45 on one straight flight through the middle would count as both passings of a quad."""
Reach = Annotated[float, Gt(0), Le(5000)]


class PassingEntry(Schema):
    """What gates and pylons have in common; an absent key takes the value of `gate_defaults`."""

    height_m: Height | None = Field(
        default=None, description="nominal height of the passing above the origin; exact where `passing` is `point`"
    )
    passing: Literal["point", "window"] | None = Field(
        default=None, description="`point`: passed exactly here; `window`: anywhere within the tolerances"
    )
    clearance_m: Annotated[float, Ge(0), Le(50)] | None = Field(
        default=None, description="least distance of the wing tips from a pylon"
    )
    height_min_m: Height | None = Field(default=None, description="least legal height of a `window` passing")
    height_max_m: Height | None = Field(default=None, description="largest legal height of a `window` passing")
    climb_min_deg: ClimbAngle | None = Field(
        default=None, description="least climb angle at the passing, negative in descent"
    )
    climb_max_deg: ClimbAngle | None = Field(default=None, description="largest climb angle at the passing")
    crossing_max_deg: Annotated[float, Gt(0), Le(85)] | None = Field(
        default=None, description="largest horizontal angle between the path and the axis"
    )


class GatePassingEntry(PassingEntry):
    """What all two-pylon gates have in common."""

    width_m: Annotated[float, Gt(0), Le(500)] | None = Field(
        default=None, description="distance between the two pylons"
    )
    bank_tolerance_deg: Annotated[float, Gt(0), Le(90)] | None = Field(
        default=None, description="largest deviation from the prescribed bank in a `window` passing"
    )


class GateDefaultsEntry(GatePassingEntry):
    """`clearance_m` is meant for two-pylon gates alone: at a single pylon it has its own default."""

    what: ClassVar[str] = "gate_defaults"
    reach_m: Reach | None = Field(
        default=None, description="farthest distance from a single pylon at which its passing counts"
    )


class LevelGateEntry(GatePassingEntry, PlacedEntry):
    what: ClassVar[str] = "a level gate"
    type: Literal["level"] = Field(description="two pylons, flown between with the wings level")
    heading_deg: Azimuth = Field(description="its axis when flown forward")


class KnifeEdgeGateEntry(GatePassingEntry, PlacedEntry):
    what: ClassVar[str] = "a knife-edge gate"
    type: Literal["knife-edge"] = Field(description="two pylons, flown between with a right angle of bank")
    heading_deg: Azimuth = Field(description="its axis when flown forward")
    bank: KnifeEdgeName = Field(default="either", description="the wing that points down")


class QuadEntry(GatePassingEntry, PlacedEntry):
    """Two pairs of pylons about one centre; one mention in the course is both passings, one after the other."""

    what: ClassVar[str] = "a quad"
    type: Literal["quad"] = Field(description="two crossed gates, passed twice from perpendicular directions")
    heading_deg: Azimuth = Field(description="the direction of the first passing when flown forward")
    then: KnifeEdgeName = Field(
        description="the second passing's direction: a quarter turn to this side of the first one's"
    )
    bank: BankName = Field(
        default="level", description="at the first passing: wings level, or the wing that points down"
    )
    second_bank: BankName = Field(default="level", description="the same at the second passing")
    crossing_max_deg: Annotated[float, Gt(0), Le(QUAD_CROSSING_MAX_DEG)] | None = Field(
        default=None,
        description="largest horizontal angle between the path and the axis of either passing; without it that of "
        f"gate_defaults, but {QUAD_CROSSING_MAX_DEG} at most",
    )


class PylonEntry(PassingEntry, PlacedEntry):
    what: ClassVar[str] = "a pylon"
    type: Literal["pylon"] = Field(description="a single pylon, passed on one side")
    pass_side_deg: Azimuth = Field(description="the azimuth from the pylon to the side on which it is passed")
    reach_m: Reach | None = Field(default=None, description="farthest distance at which the passing counts")


class ManoeuvreEntry(PlacedEntry):
    """An attitude at a position that is free within bounds; at least one condition."""

    what: ClassVar[str] = "a manoeuvre"
    type: Literal["manoeuvre"] = Field(description="an attitude, at a position that is free within bounds")
    climb_deg: ClimbAngle | None = Field(default=None, description="climb angle; 90 is straight up")
    bank_deg: Annotated[float, Ge(-180), Le(180)] | None = Field(
        default=None, description="bank angle, positive with the right wing down"
    )
    inverted: bool | None = Field(default=None, description="`true`: upside down, a bank of 180 degrees")
    heading_deg: Azimuth | None = Field(default=None, description="course over ground")
    north_min_m: Coordinate | None = Field(default=None, description="southern end of the range it may lie in")
    north_max_m: Coordinate | None = Field(default=None, description="northern end of the range it may lie in")
    east_min_m: Coordinate | None = Field(default=None, description="western end of the range it may lie in")
    east_max_m: Coordinate | None = Field(default=None, description="eastern end of the range it may lie in")
    height_m: Height | None = Field(default=None, description="exact height above the origin")
    height_min_m: Height | None = Field(default=None, description="least height above the origin")
    height_max_m: Height | None = Field(default=None, description="largest height above the origin")


class HighTurnEntry(Schema):
    what: ClassVar[str] = "a high turn"
    type: Literal["high-turn"] = Field(description="a height to be reached between two gates")
    height_min_m: Height = Field(description="the height above the origin that must be reached")
    height_max_m: Height | None = Field(default=None, description="largest height at its top")


class VerticalRollEntry(Schema):
    """One mention is two passages: the roll's begin and its end."""

    what: ClassVar[str] = "a vertical roll"
    type: Literal["vertical-roll"] = Field(description="a roll flown on a steep line")
    roll_deg: Annotated[float, Ge(45), Le(1080)] = Field(description="least angle of the roll")
    climb_deg: ClimbAngle = Field(default=90.0, description="climb angle of the line; negative for a roll downward")
    climb_tolerance_deg: Annotated[float, Ge(0.5), Le(30)] = Field(
        default=10.0, description="largest deviation from that climb angle while rolling"
    )
    turning: KnifeEdgeName = Field(default="either", description="which way it rolls, as the pilot sees it")
    height_min_m: Height | None = Field(
        default=None, description="height above the origin that must be reached at the end of the roll"
    )
    height_gain_m: Annotated[float, Ge(0), Le(2000)] | None = Field(
        default=None, description="least height gained while rolling"
    )


ElementEntry = Annotated[
    LevelGateEntry | KnifeEdgeGateEntry | QuadEntry | PylonEntry | ManoeuvreEntry | HighTurnEntry | VerticalRollEntry,
    Field(discriminator="type"),
]
