"""Places in the documents: metres north and east of the origin, or latitude and longitude."""

from typing import Annotated, ClassVar

from annotated_types import Ge, Le
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
