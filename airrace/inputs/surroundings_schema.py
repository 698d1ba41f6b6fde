"""The surroundings of a race in the track language: safety lines and people on the ground."""

from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Gt, Le
from pydantic import Field

from airrace.inputs.place_schema import PlaceEntry
from airrace.inputs.schema import Schema

CORNERS_MAX = 50
"""The largest number of corners of a crowd's place, or of the airspace."""
Corners = Annotated[list[PlaceEntry], Field(max_length=CORNERS_MAX)]
Distance = Annotated[float, Gt(0), Le(5000)]


class SafetyLineEntry(Schema):
    what: ClassVar[str] = "a safety line"
    from_: PlaceEntry = Field(alias="from", description="a point of the line")
    to: PlaceEntry = Field(description="another point of it; the line has no ends and runs from `from` to here")
    keep: Literal["left", "right"] = Field(description="the side of the line, seen along it, on which the flight stays")
    margin_m: Annotated[float, Ge(0), Le(1000)] = Field(default=0.0, description="distance to be kept from the line")


class CrowdEntry(Schema):
    """A group of people on the ground, given by exactly one of `point`, `line` and `polygon`."""

    what: ClassVar[str] = "a crowd"
    point: PlaceEntry | None = Field(default=None, description="where people are: a single place")
    line: Corners | None = Field(default=None, description="where people are: along a line from corner to corner")
    polygon: Corners | None = Field(
        default=None, description="where people are: within an area; its corners in order, the first not repeated"
    )
    distance_m: Distance | None = Field(
        default=None, description="least distance to be kept; without it that of `rules.crowd_distance_m`"
    )
    height_m: Annotated[float, Ge(-500), Le(5000)] = Field(
        default=0.0, description="height of the people above the origin"
    )
    measured: Literal["slant", "over-ground"] = Field(
        default="slant", description="whether the distance is measured in space or over ground alone"
    )
