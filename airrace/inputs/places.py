"""The positions of a document, in metres north and east of its origin.

Latitude and longitude are WGS 84. A place is taken at the elevation of the origin and seen in the origin's local
north-east-down frame; its height in that frame (the earth's curvature) is ignored, for the track's frame is flat.
"""

import math

import numpy as np

from airrace.inputs.nodes import KeyPath, Reporter
from airrace.inputs.place_schema import OriginEntry, PlacedEntry
from airrace.records import record
from airrace.track.course import Origin
from airrace.track.geodetic import metres
from airrace.track.polygons import Point

REACH_M = 50_000.0
"""The farthest that a place may lie from the origin, m; the frame is flat."""
NOWHERE = Point(math.nan, math.nan)
"""The point that stands for a position that was refused.

No comparison with it holds, so nothing else is reported about it.
"""
METRIC = ("north_m", "east_m")
GEODETIC = ("latitude_deg", "longitude_deg")


@record
class Places:
    """The positions of one document; what is wrong with them goes to the reporter."""

    origin: OriginEntry
    reporter: Reporter

    def check_origin(self) -> None:
        """Report an origin that has only one of its coordinates."""
        given = (self.origin.latitude_deg, self.origin.longitude_deg)
        if given.count(None) == 1:
            self._missing(("origin",), GEODETIC, given)

    def point(self, entry: PlacedEntry, path: KeyPath) -> Point:
        """Return the position of an element; `NOWHERE` if it was refused."""
        metric = (entry.north_m, entry.east_m)
        if entry.latitude_deg is not None or entry.longitude_deg is not None:
            return self.geodetic(entry, path) or NOWHERE
        if entry.north_m is not None and entry.east_m is not None:
            return Point(entry.north_m, entry.east_m)
        if metric == (None, None):
            self.reporter.key(
                (*path, METRIC[0]),
                "missing; a position is `north_m` and `east_m`, or `latitude_deg` and `longitude_deg`",
            )
        else:
            self._missing(path, METRIC, metric)
        return NOWHERE

    def geodetic(self, entry: PlacedEntry, path: KeyPath) -> Point | None:
        """Return the position given by latitude and longitude; None if there is none, or it was refused."""
        given = (entry.latitude_deg, entry.longitude_deg)
        if given == (None, None):
            return None
        first = GEODETIC[0] if given[0] is not None else GEODETIC[1]
        if entry.north_m is not None or entry.east_m is not None:
            self._given_twice(path, first, METRIC[0] if entry.north_m is not None else METRIC[1])
            return None
        if given[0] is None or given[1] is None:
            self._missing(path, GEODETIC, given)
            return None
        if self.origin.latitude_deg is None or self.origin.longitude_deg is None:
            self.reporter.key(
                (*path, first), "needs the `latitude_deg` and `longitude_deg` of the track's `origin`; or use north_m"
            )
            return None
        return self._seen_from_origin(given[0], given[1], path)

    def _seen_from_origin(self, latitude: float, longitude: float, path: KeyPath) -> Point | None:
        o = self.origin
        assert o.latitude_deg is not None  # asked for above
        assert o.longitude_deg is not None
        origin = Origin(math.radians(o.latitude_deg), math.radians(o.longitude_deg), o.elevation_m)
        north, east, down = (float(one) for one in metres(np.radians(latitude), np.radians(longitude), origin))
        away = math.hypot(north, east, down)
        if away > REACH_M:
            self.reporter.value(
                (*path, GEODETIC[0]),
                f"lies {away / 1000.0:.4g} km from the origin; at most {REACH_M / 1000.0:g} km, for the frame is flat",
            )
            return None
        return Point(north, east)

    def _given_twice(self, path: KeyPath, geodetic: str, metric: str) -> None:
        """Report a position that is given in both ways, by the way that was added on the command line if one was."""
        if self.reporter.is_set((*path, metric)):
            told = "the file gives this position by latitude and longitude; set `latitude_deg` and `longitude_deg`"
            self.reporter.key((*path, metric), told)
        elif self.reporter.is_set((*path, geodetic)):
            self.reporter.key(
                (*path, geodetic), "the file gives this position by north and east; set `north_m` and `east_m`"
            )
        else:
            told = "the position is given twice; keep north and east, or latitude and longitude"
            self.reporter.key((*path, geodetic), told)

    def _missing(self, path: KeyPath, keys: tuple[str, str], given: tuple[float | None, float | None]) -> None:
        absent, present = keys if given[0] is None else keys[::-1]
        self.reporter.key((*path, absent), f"missing; `{present}` needs `{absent}` beside it")
