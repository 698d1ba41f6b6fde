"""Places of the documents: how a file gives them, and where they lie in metres north and east of its origin.

Latitude and longitude are WGS 84. A place is taken at the elevation of the origin and seen in the origin's local
north-east-down frame; its height in that frame (the earth's curvature) is ignored, for the track's frame is flat.
"""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge, Le
from pydantic import Field

from airrace.files.inputs.nodes import KeyPath, Reporter
from airrace.files.inputs.schema import Schema, optional
from airrace.model.track.course import Origin, metres
from airrace.model.track.polygons import Point

REACH_M = 50_000.0
"""The farthest that a place may lie from the origin, m; the frame is flat."""
NOWHERE = Point(math.nan, math.nan)
"""The point that stands for a position that was refused.

No comparison with it holds, so nothing else is reported about it.
"""
METRIC = ("north_m", "east_m")
GEODETIC = ("latitude_deg", "longitude_deg")

Coordinate = Annotated[float, Ge(-50_000), Le(50_000)]  # the frame is flat
Height = Annotated[float, Ge(0), Le(5000)]
Azimuth = Annotated[float, Ge(-180), Le(360)]
ClimbAngle = Annotated[float, Ge(-90), Le(90)]
Latitude = Annotated[float, Ge(-90), Le(90)]
Longitude = Annotated[float, Ge(-180), Le(180)]


class PlacedEntry(Schema):
    """The position of an element: exactly one pair, metres from the origin or WGS 84."""

    north_m: Coordinate | None = optional("its position, north of the origin; with `east_m`")
    east_m: Coordinate | None = optional("its position, east of the origin; with `north_m`")
    latitude_deg: Latitude | None = optional("its WGS 84 latitude, with `longitude_deg` instead of north and east")
    longitude_deg: Longitude | None = optional("its WGS 84 longitude, with `latitude_deg` instead of north and east")


class PlaceEntry(PlacedEntry):
    what: ClassVar[str] = "a place"
    form: ClassVar[str] = "a place, {north_m: N, east_m: E} or {latitude_deg: LAT, longitude_deg: LON}"


class OriginEntry(Schema):
    what: ClassVar[str] = "the origin"
    latitude_deg: Latitude | None = optional("WGS 84 latitude of north = east = 0")
    longitude_deg: Longitude | None = optional("WGS 84 longitude of north = east = 0")
    elevation_m: Annotated[float, Ge(-450), Le(5000)] = Field(
        default=0.0, description="height of the origin above mean sea level; all other heights are above the origin"
    )


def radians_or_none(degrees: float | None) -> float | None:
    return None if degrees is None else math.radians(degrees)


@dataclass(frozen=True)
class Places:
    """The positions of one document, by its origin; what is wrong with them goes to the reporter."""

    entry: OriginEntry
    reporter: Reporter

    @property
    def origin(self) -> Origin:
        entry = self.entry
        return Origin(radians_or_none(entry.latitude_deg), radians_or_none(entry.longitude_deg), entry.elevation_m)

    def check_origin(self) -> None:
        """Report an origin that has only one of its coordinates."""
        coordinates = (self.entry.latitude_deg, self.entry.longitude_deg)
        if coordinates.count(None) == 1:
            self._report_missing(("origin",), GEODETIC, coordinates)

    def point(self, entry: PlacedEntry, path: KeyPath) -> Point:
        """Return the position of an element; `NOWHERE` if it was refused."""
        metric = (entry.north_m, entry.east_m)
        if entry.latitude_deg is not None or entry.longitude_deg is not None:
            return self.geodetic(entry, path) or NOWHERE
        if entry.north_m is not None and entry.east_m is not None:
            return Point(entry.north_m, entry.east_m)
        if metric == (None, None):
            message = "missing; a position is `north_m` and `east_m`, or `latitude_deg` and `longitude_deg`"
            self.reporter.key((*path, METRIC[0]), message)
        else:
            self._report_missing(path, METRIC, metric)
        return NOWHERE

    def geodetic(self, entry: PlacedEntry, path: KeyPath) -> Point | None:
        """Return the position given by latitude and longitude; None if there is none, or it was refused."""
        latitude, longitude = entry.latitude_deg, entry.longitude_deg
        if latitude is None and longitude is None:
            return None
        first = GEODETIC[0] if latitude is not None else GEODETIC[1]
        if entry.north_m is not None or entry.east_m is not None:
            self._report_twice(path, first, METRIC[0] if entry.north_m is not None else METRIC[1])
        elif latitude is None or longitude is None:
            self._report_missing(path, GEODETIC, (latitude, longitude))
        elif self.origin.latitude is None or self.origin.longitude is None:
            message = "needs the `latitude_deg` and `longitude_deg` of the track's `origin`; or use north_m"
            self.reporter.key((*path, first), message)
        else:
            north, east, down = map(float, metres(np.radians(latitude), np.radians(longitude), self.origin))
            distance = math.hypot(north, east, down)
            if distance <= REACH_M:
                return Point(north, east)
            limit = f"at most {REACH_M / 1000.0:g} km, for the frame is flat"
            self.reporter.value((*path, GEODETIC[0]), f"lies {distance / 1000.0:.4g} km from the origin; {limit}")
        return None

    def _report_twice(self, path: KeyPath, geodetic: str, metric: str) -> None:
        """Report a position that is given in both ways, at the one that was set on the command line if any was."""
        key, message = geodetic, "the position is given twice; keep north and east, or latitude and longitude"
        if self.reporter.is_set((*path, metric)):
            key = metric
            message = "the file gives this position by latitude and longitude; set `latitude_deg` and `longitude_deg`"
        elif self.reporter.is_set((*path, geodetic)):
            message = "the file gives this position by north and east; set `north_m` and `east_m`"
        self.reporter.key((*path, key), message)

    def _report_missing(self, path: KeyPath, keys: tuple[str, str], values: tuple[float | None, float | None]) -> None:
        absent, present = keys if values[0] is None else keys[::-1]
        self.reporter.key((*path, absent), f"missing; `{present}` needs `{absent}` beside it")
