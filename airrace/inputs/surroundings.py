"""The builders of the air of the day and of a course's surroundings, with the check whether these leave room."""

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise

from airrace.environment.air import Air, Profile, StaticWind, Thermal
from airrace.inputs.features import Feature
from airrace.inputs.nodes import KeyPath, Reporter
from airrace.inputs.place_schema import CrowdEntry, PlaceEntry, SafetyLineEntry
from airrace.inputs.places import NOWHERE, Places
from airrace.inputs.track_schema import EnvironmentEntry, ThermalEntry, WindEntry
from airrace.inputs.units import KNOT
from airrace.quantities import Interval
from airrace.records import record
from airrace.track import polygons
from airrace.track.limits import Crowd, CrowdShape, SafetyLine
from airrace.track.polygons import Point

SAME_PLACE_M = 0.01
"""The distance below which two corners are one, m."""
ROUNDING_M = 1e-6
"""The excess over a distance that is put down to rounding and not reported, m."""
SHAPES = {"point": CrowdShape.POINT, "line": CrowdShape.LINE, "polygon": CrowdShape.AREA}


def build_safety_lines(entries: dict[str, SafetyLineEntry], places: Places) -> dict[str, SafetyLine]:
    """Return all safety lines by name."""
    return {name: _safety_line(name, entry, places) for name, entry in entries.items()}


def _safety_line(name: str, entry: SafetyLineEntry, places: Places) -> SafetyLine:
    path: KeyPath = ("safety_lines", name)
    line = SafetyLine(
        name=name,
        start=places.point(entry.from_, (*path, "from")),
        end=places.point(entry.to, (*path, "to")),
        keep_right=entry.keep == "right",
        margin=entry.margin_m,
    )
    if _same(line.start, line.end):
        places.reporter.value((*path, "to"), "is the same place as `from`; a line needs two different points")
    return line


def room_beside(line: SafetyLine, place: Point) -> float:
    """Return the distance of a place from a line on the allowed side, m; negative on the other."""
    to_right = polygons.to_right(line.start, line.end, place)
    return to_right if line.keep_right else -to_right


def build_crowd(entries: dict[str, CrowdEntry], distance: float | None, places: Places) -> tuple[Crowd, ...]:
    """Return all crowds; `distance` (m) holds for those that do not say their own."""
    return tuple(_crowd(name, entry, distance, places) for name, entry in entries.items())


def _crowd(name: str, entry: CrowdEntry, distance: float | None, places: Places) -> Crowd:
    path: KeyPath = ("crowd", name)
    given = [key for key in SHAPES if getattr(entry, key) is not None]
    if not given:
        places.reporter.key(path, "a crowd needs one of `point`, `line` and `polygon`")
    if len(given) > 1:
        places.reporter.key((*path, given[1]), f"not together with `{given[0]}`; a crowd has one shape")
    key = given[0] if given else "point"
    if entry.distance_m is None and distance is None:
        places.reporter.key(
            (*path, "distance_m"), "missing; say it here, or for every crowd as `crowd_distance_m` of the rules"
        )
    return Crowd(
        name=name,
        shape=SHAPES[key],
        corners=_corners(key, entry, (*path, key), places),
        distance=entry.distance_m or distance or 0.0,
        height=entry.height_m,
        slant=entry.measured == "slant",
    )


def _corners(key: str, entry: CrowdEntry, path: KeyPath, places: Places) -> tuple[Point, ...]:
    if entry.point is not None and key == "point":
        return (places.point(entry.point, path),)
    if entry.line is not None and key == "line":
        corners = _points(entry.line, path, places)
        if len(entry.line) < 2:
            places.reporter.value(path, "a line needs at least two corners; a single place is a `point`")
        return corners or (NOWHERE,)
    if entry.polygon is not None and key == "polygon":
        return _polygon(entry.polygon, path, places)
    return (NOWHERE,)


def build_airspace(entries: Sequence[PlaceEntry] | None, places: Places) -> tuple[Point, ...]:
    """Return the corners of the convex area of the race; empty if there is none, or none to rely on."""
    if entries is None:
        return ()
    known = len(places.reporter.findings)
    corners = _polygon(entries, ("airspace",), places)
    if len(places.reporter.findings) > known:
        return ()  # the corners form no area that could be checked
    dent = polygons.dent(corners)
    if dent is not None:
        places.reporter.value(
            ("airspace", dent),
            "the airspace is dented inwards at this corner and must be convex; leave the corner out and keep the "
            "notch free with an area of `crowd`",
        )
        return ()
    return corners


def _polygon(entries: Sequence[PlaceEntry], path: KeyPath, places: Places) -> tuple[Point, ...]:
    """Return the corners of a simple polygon; report one that is none."""
    known = len(places.reporter.findings)
    corners = _points(entries, path, places)
    if len(entries) < 3:
        places.reporter.value(path, f"an area needs at least three corners, not {len(entries)}")
        return corners
    if _same(corners[0], corners[-1]):
        places.reporter.value(
            (*path, len(corners) - 1), "is the first corner again; leave it out, an area closes by itself"
        )
    if len(places.reporter.findings) > known:
        return corners
    farthest = max(corners, key=lambda one: _between(one, corners[0]))
    if all(abs(polygons.to_right(corners[0], farthest, one)) < SAME_PLACE_M for one in corners):
        places.reporter.value(path, "all corners lie on one line; an area needs three that do not")
        return corners
    for index, corner in enumerate(corners):
        if _turns_back(corners[index - 1], corner, corners[(index + 1) % len(corners)]):
            places.reporter.value((*path, index), "the border turns back on itself at this corner; leave it out")
            return corners
    crossing = polygons.crossing_edges(corners)
    if crossing is not None:
        one, other = (f"from corner {index} to corner {(index + 1) % len(corners)}" for index in crossing)
        places.reporter.value(
            path, f"the border crosses itself: {one} and {other} (counted from 0); give the corners in order"
        )
    return corners


def _points(entries: Sequence[PlaceEntry], path: KeyPath, places: Places) -> tuple[Point, ...]:
    """Return the corners; report neighbours at the same place."""
    corners = tuple(places.point(entry, (*path, index)) for index, entry in enumerate(entries))
    for index, (before, here) in enumerate(pairwise(corners), start=1):
        if _same(before, here):
            places.reporter.value((*path, index), "is the same place as the corner before; leave one of them out")
    return corners


def _same(a: Point, b: Point) -> bool:
    return _between(a, b) < SAME_PLACE_M


def _between(a: Point, b: Point) -> float:
    return math.hypot(a.north - b.north, a.east - b.east)


def _turns_back(before: Point, corner: Point, after: Point) -> bool:
    """Return whether one of the two edges at a corner lies on the other."""
    nearest = min(
        polygons.distance(after, (before, corner), closed=False),
        polygons.distance(before, (corner, after), closed=False),
    )
    return nearest < SAME_PLACE_M


@record
class _Box:
    """The extent of some corners, which tells at once that most gates are far from most people."""

    north: Interval
    east: Interval

    @classmethod
    def around(cls, corners: Sequence[Point]) -> "_Box":
        north, east = [corner.north for corner in corners], [corner.east for corner in corners]
        return cls(Interval(min(north), max(north)), Interval(min(east), max(east)))

    def lies_beyond(self, place: Point, distance: float) -> bool:
        """Return whether the place is surely farther away than `distance` (m)."""
        return (
            max(self.north.lower - place.north, place.north - self.north.upper) > distance
            or max(self.east.lower - place.east, place.east - self.east.upper) > distance
        )


def check_room(
    features: Iterable[Feature], crowds: Sequence[Crowd], airspace: tuple[Point, ...], reporter: Reporter
) -> None:
    """Report every element that stands outside of the airspace or closer to people than is allowed."""
    boxes = [_Box.around(crowd.corners) for crowd in crowds]
    for feature in features:
        if feature.position is None:
            continue
        place, height = feature.position
        away = polygons.distance(place, airspace, closed=True) if airspace else 0.0
        if away > ROUNDING_M:
            reporter.key(feature.path, f"stands {away:.4g} m outside of the `airspace`")
        for crowd, box in zip(crowds, boxes, strict=True):
            away = math.inf if box.lies_beyond(place, crowd.distance) else _distance(place, height, crowd)
            if away < crowd.distance - ROUNDING_M:
                how = "in space" if crowd.slant else "over ground"
                reporter.key(
                    feature.path,
                    f"is {away:.4g} m from the crowd `{crowd.name}`, measured {how}; at least {crowd.distance:g} m",
                )


def _distance(place: Point, height: float, crowd: Crowd) -> float:
    over_ground = polygons.distance(place, crowd.corners, closed=crowd.shape is CrowdShape.AREA)
    return math.hypot(over_ground, height - crowd.height) if crowd.slant else over_ground


WIND: KeyPath = ("environment", "wind")
HECTOPASCAL = 100.0


def build_air(entry: EnvironmentEntry, places: Places) -> Air:
    """Return the air above a track."""
    return Air(
        temperature_offset=entry.temperature_offset_K,
        pressure_offset=entry.pressure_offset_hPa * HECTOPASCAL,
        elevation=places.origin.elevation_m,
        wind=_wind(entry.wind, places.reporter) if entry.wind else None,
        thermals=tuple(_thermal(thermal, index, places) for index, thermal in enumerate(entry.thermals)),
    )


def _wind(entry: WindEntry, reporter: Reporter) -> StaticWind:
    if entry.speed_kt is None and entry.speed_m_s is None:
        reporter.key(WIND, "missing; a wind needs `speed_kt` or `speed_m_s`")
    if entry.speed_kt is not None and entry.speed_m_s is not None:
        reporter.key((*WIND, "speed_m_s"), "the speed is given twice; keep one of `speed_kt` and `speed_m_s`")
    # A key that the profile does not use would have no effect, silently.
    for key, value, profile in (("exponent", entry.exponent, "power"), ("roughness_m", entry.roughness_m, "log")):
        if value is not None and entry.profile != profile:
            reporter.key((*WIND, key), f"belongs to `profile: {profile}`; the profile is {entry.profile}")
    silent = StaticWind(origin=0.0, speed=0.0)
    wind = StaticWind(
        origin=math.radians(entry.from_deg),
        speed=entry.speed_m_s if entry.speed_m_s is not None else (entry.speed_kt or 0.0) * KNOT,
        profile=Profile(entry.profile),
        reference_height=_given(entry.reference_height_m, silent.reference_height),
        exponent=_given(entry.exponent, silent.exponent),
        roughness=_given(entry.roughness_m, silent.roughness),
    )
    if wind.profile is Profile.LOG and wind.reference_height <= wind.roughness:
        reporter.value(
            (*WIND, "reference_height_m"), f"must be above the roughness of {wind.roughness:g} m in a log profile"
        )
    return wind


def _given(value: float | None, silent: float) -> float:
    return silent if value is None else value


def _thermal(entry: ThermalEntry, index: int, places: Places) -> Thermal:
    place = places.point(entry, ("environment", "thermals", index))
    return Thermal(north=place.north, east=place.east, w_star=entry.w_star_m_s, mixing_height=entry.mixing_height_m)
