"""From the manoeuvres of a track file to what is flown at a free position: attitudes, high turns, vertical rolls."""

import math

from airrace.documents.element_schema import HighTurnEntry, ManoeuvreEntry, VerticalRollEntry
from airrace.documents.figures import Figure, Step
from airrace.documents.nodes import KeyPath, Reporter
from airrace.documents.places import Places
from airrace.documents.units import interval, interval_deg, radians_or_none
from airrace.quantities import Interval
from airrace.track.gates import INVERTED, Manoeuvre
from airrace.track.limits import Roll, Turning

VERTICAL_DEG = 89.0
"""Steeper than this a path has no course and no bank angle to speak of."""
STEEP_DEG = 45.0
"""Less steep than this a line is none for a vertical roll."""


def build_manoeuvre(name: str, entry: ManoeuvreEntry, places: Places) -> Figure:
    """An attitude at a position that is free within bounds."""
    reporter, path = places.reporter, ("gates", name)
    north, east = _over_ground(entry, path, places)
    manoeuvre = Manoeuvre(
        name=name,
        bank=INVERTED if entry.inverted else radians_or_none(entry.bank_deg),
        climb=radians_or_none(entry.climb_deg),
        heading=radians_or_none(entry.heading_deg),
        north=north,
        east=east,
        height=_range("height", entry.height_m, interval(entry.height_min_m, entry.height_max_m), path, reporter),
    )
    if entry.inverted is False:
        reporter.value((*path, "inverted"), "can only be true; for upright flight give `bank_deg: 0`")
    if entry.inverted and entry.bank_deg is not None:
        reporter.value((*path, "bank_deg"), "not together with `inverted`, which says a bank of 180 degrees")
    if not entry.model_fields_set - {"type"}:
        reporter.key(path, "a manoeuvre needs at least one condition: climb_deg, bank_deg, inverted, heading_deg, ...")
    if entry.climb_deg is not None and abs(entry.climb_deg) > VERTICAL_DEG:
        for key in ("bank_deg", "inverted", "heading_deg"):
            if reporter.find((*path, key)) is not None:
                reporter.value((*path, key), "has no meaning on a vertical line; leave it out")
    return Figure(name, (Step(manoeuvre),))


def build_high_turn(name: str, entry: HighTurnEntry, reporter: Reporter) -> Figure:
    """A height to be reached between two gates."""
    height = _range("height", None, interval(entry.height_min_m, entry.height_max_m), ("gates", name), reporter)
    return Figure(name, (Step(Manoeuvre(name=name, height=height, kind="high-turn")),))


def build_vertical_roll(name: str, entry: VerticalRollEntry, reporter: Reporter) -> Figure:
    """Two passages on a steep line: where the roll begins, and where it ends."""
    downward = entry.climb_deg < 0.0
    begin = Manoeuvre(
        name=f"{name}/begin",
        climb=math.radians(entry.climb_deg),
        climb_tolerance=math.radians(entry.climb_tolerance_deg),
        kind="vertical-roll",
    )
    end = Manoeuvre(
        name=name,
        climb=begin.climb,
        climb_tolerance=begin.climb_tolerance,
        height=interval(entry.height_min_m, None),
        kind="vertical-roll",
    )
    roll = Roll(
        angle=math.radians(entry.roll_deg),
        climb=interval_deg(
            max(entry.climb_deg - entry.climb_tolerance_deg, -90.0),
            min(entry.climb_deg + entry.climb_tolerance_deg, 90.0),
        ),
        # On the way down no height is gained.
        gain=-math.inf if downward else entry.height_gain_m or 0.0,
        turning=Turning(entry.turning),
    )
    if abs(entry.climb_deg) < STEEP_DEG:
        reporter.value(
            ("gates", name, "climb_deg"),
            f"is not steep enough for a vertical roll: {STEEP_DEG:g} to 90 upward, -90 to -{STEEP_DEG:g} downward, "
            f"not {entry.climb_deg:g}",
        )
    if downward and entry.height_gain_m is not None:
        reporter.value(("gates", name, "height_gain_m"), "a roll downward gains no height; leave it out")
    return Figure(name, (Step(begin), Step(end, roll=roll)))


def _over_ground(entry: ManoeuvreEntry, path: KeyPath, places: Places) -> tuple[Interval, Interval]:
    """Ranges of north and east."""
    point = places.geodetic(entry, path)
    north, east = (entry.north_m, entry.east_m) if point is None else (point.north, point.east)
    ranges = (interval(entry.north_min_m, entry.north_max_m), interval(entry.east_min_m, entry.east_max_m))
    if point is not None and any(one.bounded for one in ranges):
        places.reporter.value(
            (*path, "latitude_deg"), "is exact; not together with bounds of north or east, such as `north_min_m`"
        )
        ranges = (Interval(), Interval())
    return (
        _range("north", north, ranges[0], path, places.reporter),
        _range("east", east, ranges[1], path, places.reporter),
    )


def _range(axis: str, exact: float | None, bounds: Interval, path: KeyPath, reporter: Reporter) -> Interval:
    if exact is not None:
        if bounds.bounded:
            reporter.value((*path, f"{axis}_m"), f"is exact; not together with `{axis}_min_m` or `{axis}_max_m`")
        return Interval.exactly(exact)
    if bounds.empty:
        reporter.value(
            (*path, f"{axis}_min_m"), f"must not exceed `{axis}_max_m`, {bounds.upper:g}, but is {bounds.lower:g}"
        )
    return bounds
