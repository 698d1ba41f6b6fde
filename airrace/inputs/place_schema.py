"""Places, safety lines and people on the ground in the documents, in metres from the origin or WGS 84."""

from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Gt, Le
from pydantic import Field

from airrace.inputs.schema import Schema

Coordinate = Annotated[float, Ge(-50_000), Le(50_000)]  # the frame is flat
Height = Annotated[float, Ge(0), Le(5000)]
Azimuth = Annotated[float, Ge(-180), Le(360)]
ClimbAngle = Annotated[float, Ge(-90), Le(90)]
Latitude = Annotated[float, Ge(-90), Le(90)]
Longitude = Annotated[float, Ge(-180), Le(180)]


class PlacedEntry(Schema):
    """The position of an element: exactly one pair, metres from the origin or WGS 84."""

    north_m: Coordinate | None = Field(default=None, description="its position, north of the origin; with `east_m`")
    east_m: Coordinate | None = Field(default=None, description="its position, east of the origin; with `north_m`")
    latitude_deg: Latitude | None = Field(
        default=None, description="its WGS 84 latitude, with `longitude_deg` instead of north and east"
    )
    longitude_deg: Longitude | None = Field(
        default=None, description="its WGS 84 longitude, with `latitude_deg` instead of north and east"
    )


class PlaceEntry(PlacedEntry):
    what: ClassVar[str] = "a place"
    form: ClassVar[str] = "a place, {north_m: N, east_m: E} or {latitude_deg: LAT, longitude_deg: LON}"


class OriginEntry(Schema):
    what: ClassVar[str] = "the origin"
    latitude_deg: Latitude | None = Field(default=None, description="WGS 84 latitude of north = east = 0")
    longitude_deg: Longitude | None = Field(default=None, description="WGS 84 longitude of north = east = 0")
    elevation_m: Annotated[float, Ge(-450), Le(5000)] = Field(
        default=0.0, description="height of the origin above mean sea level; all other heights are above the origin"
    )


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
