"""Tables of a course before it is flown."""

import itertools
import math
from collections.abc import Iterator, Sequence

import numpy as np

from airrace.planning.lint import Remark
from airrace.planning.race import Race
from airrace.quantities import KNOT, Interval
from airrace.results import Flight
from airrace.results.clearances import Clearance
from airrace.results.legs import passings_around
from airrace.track.course import CrowdShape, Roll
from airrace.track.polygons import Point, area, edges
from airrace.views.course_page import CourseRow, rows
from airrace.views.tables import Column, Table

ROWS_MAX = 200
"""The largest number of passages in the table; of more, only the first and the last are printed."""
LAST_ROWS = 20
"""The number of passages at the end of a table that is cut."""
REMARKS_MAX = 30
"""The largest number of remarks that are printed."""


def course_tables(race: Race) -> list[Table]:
    """Return the tables of a course: passages, conditions on single legs, limits along the flight, and surroundings."""
    tables = [_passages_table(race), _legs_table(race), _limits_table(race), _surroundings_table(race)]
    return [table for table in tables if table.rows]


def remarks_text(remarks: Sequence[Remark]) -> str:
    """Return the remarks in one line each; of many, the first ones."""
    lines = [f"warning: {remark.text}" for remark in remarks[:REMARKS_MAX]]
    if len(remarks) > REMARKS_MAX:
        lines.append(f"and {len(remarks) - REMARKS_MAX} more warnings; --json has all of them")
    return "\n".join(lines)


_PASSAGES = (
    Column("passage"),
    Column("type"),
    Column("north", "m", "z.0f", missing="free"),
    Column("east", "m", "z.0f", missing="free"),
    Column("height", "m", "z.1f", missing="free"),
    Column("course", "deg", "z.0f", missing="free"),
    Column("climb", "deg", "z.0f", missing="free"),
    Column("bank", "deg", "z.0f", missing="free"),
    Column("leg", "m", "z.0f"),
    Column("turn", "deg", "z.0f"),
)


def _passages_table(race: Race) -> Table:
    title = f"{race.course.name}, flown by {race.aircraft.name}"
    cells = [
        (
            row.passage.name,
            row.kind,
            row.north,
            row.east,
            _height(row),
            *(_degrees(angle) for angle in (row.heading, row.climb, row.bank)),
            row.leg,
            _degrees(row.turn),
        )
        for row in rows(race)
    ]
    if len(cells) > ROWS_MAX:
        title += f" ({len(cells)} passages; --json has all of them)"
        blank = (f"... {len(cells) - ROWS_MAX} more", *[""] * (len(_PASSAGES) - 1))
        cells = [*cells[: ROWS_MAX - LAST_ROWS], blank, *cells[-LAST_ROWS:]]
    return Table(title, _PASSAGES, cells)


def _height(row: CourseRow) -> str | float | None:
    """Return the height of a passage as a text; for a free manoeuvre the bounds of its height."""
    heights = row.passage.element.heights
    if row.height is None and heights.bounded:
        lower, upper = heights.lower, heights.upper
        if not math.isfinite(lower):
            return f"< {upper:.0f}"
        return f"> {lower:.0f}" if not math.isfinite(upper) else f"{lower:.0f}-{upper:.0f}"
    return row.height


def _legs_table(race: Race) -> Table:
    """Return a table of the conditions on legs that lead to single passages.

    Conditions that hold on several legs are listed once.
    """
    found: dict[tuple[str, str], list[str]] = {}
    for passage in race.course.passages:
        lines = ", ".join(line.name for line in passage.safety_lines)
        if lines or passage.roll is not None:
            found.setdefault((lines or "-", _roll(passage.roll)), []).append(passage.name)
    cells = [[_listed(names), *conditions] for conditions, names in found.items()]
    return _words_table("on the leg to", ("passage", "safety lines", "roll"), cells)


def _limits_table(race: Race) -> Table:
    rules, envelope = race.course.rules, race.aircraft.envelope
    start = race.course.passages[0].speed
    limits = [
        ["load factor", _range(rules.n_z.intersect(envelope.n_z), "g")],
        ["speed", _speeds(envelope.V)],
        ["speed at the start", _speeds(start) if start.bounded else "free"],
        ["height", _range(rules.height, "m")],
        ["roll rate", f"up to {math.degrees(min(rules.p, race.aircraft.point_mass.p)):.0f} deg/s"],
    ]
    if math.isfinite(rules.beta_A):
        limits.append(["sideslip", f"up to {math.degrees(rules.beta_A):.3g} deg"])
    if rules.C_L.bounded:
        limits.append(["lift coefficient", _range(rules.C_L, "").rstrip()])
    if rules.alpha_A.bounded:
        degrees = Interval(*(math.degrees(bound) for bound in (rules.alpha_A.lower, rules.alpha_A.upper)))
        limits.append(["angle of attack", _range(degrees, "deg")])
    return _words_table("limits along the flight", ("limit", "range"), limits)


def _surroundings_table(race: Race) -> Table:
    return _words_table("kept away from", ("name", "what", "where", "distance"), list(_surroundings(race)))


def _surroundings(race: Race) -> Iterator[list[str]]:
    shapes = {CrowdShape.POINT: "at", CrowdShape.LINE: "along", CrowdShape.AREA: "within"}
    for crowd in race.course.crowd:
        corners = crowd.corners
        if crowd.shape is CrowdShape.AREA:
            size = f"{abs(area(corners)) / 1e4:.3g} ha about"
        elif crowd.shape is CrowdShape.LINE:
            size = f"{sum(math.dist(*ends) for ends in itertools.pairwise(map(_pair, corners))):.0f} m about"
        else:
            size = ""
        middle = np.mean([_pair(corner) for corner in corners], axis=0)
        where = f"{shapes[crowd.shape]} {size} {_place(*middle)}".replace("  ", " ")
        yield [crowd.name, "crowd", where, f"{crowd.distance:g} m {'slant' if crowd.slant else 'over ground'}"]
    for line in race.course.safety_lines:
        side = "right" if line.keep_right else "left"
        where = f"{side} of {_place(*_pair(line.start))} to {_place(*_pair(line.end))}"
        yield [line.name, "safety line", where, f"{line.margin:g} m"]
    corners = race.course.airspace
    if corners:
        around = sum(math.dist(_pair(a), _pair(b)) for a, b in edges(corners, closed=True))
        size = f"{len(corners)} corners, {abs(area(corners)) / 1e6:.3g} km2, {around / 1e3:.3g} km around"
        yield ["airspace", "its border", size, "0 m"]


def _pair(place: Point) -> tuple[float, float]:
    return place.north, place.east


def _place(north: float, east: float) -> str:
    return f"({north:.0f}, {east:.0f})"


def _roll(roll: Roll | None) -> str:
    if roll is None:
        return "-"
    climb = " to ".join(f"{math.degrees(bound):.0f}" for bound in (roll.climb.lower, roll.climb.upper))
    gain = f", +{roll.gain:g} m" if roll.gain else ""
    return f"{math.degrees(roll.angle):.0f} deg {roll.turning.value}, at {climb} deg{gain}"


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) if len(names) <= 3 else f"{names[0]}, {names[1]} and {len(names) - 2} more"


def _speeds(interval: Interval) -> str:
    knots = Interval(*(round(bound / KNOT, 1) for bound in (interval.lower, interval.upper)))
    return f"{_range(interval, 'm/s')} ({_range(knots, 'kt')})"


def _degrees(angle: float | None) -> float | None:
    return None if angle is None else math.degrees(angle)


def _range(interval: Interval, unit: str) -> str:
    lower, upper = interval.lower, interval.upper
    if not interval.bounded:
        return "free"
    if not math.isfinite(lower):
        return f"up to {upper:.4g} {unit}"
    if not math.isfinite(upper):
        return f"at least {lower:.4g} {unit}"
    return f"{lower:.4g} to {upper:.4g} {unit}"


_PLANNED = (
    Column("from"),
    Column("distance", "m", ".1f"),
    Column("required", "m", ".1f"),
    Column("north", "m", "z.0f"),
    Column("east", "m", "z.0f"),
    Column("height", "m", "z.0f"),
    Column("between", wraps=True),
)


def planned_table(planned: Flight, clearances: Sequence[Clearance]) -> Table:
    """Return a table of the least distances of a planned flight."""
    cells: list[tuple[str | float, ...]] = []
    for one in clearances:
        before, after = passings_around(planned, one.time)
        thing = f"wing to {one.text}" if one.kind == "pylon" else one.text
        place = (one.north, one.east, one.height)
        cells.append((thing, one.distance, one.required, *place, f"{before.name} and {after.name}"))
    return Table(f"least distances of the line that is {planned.source.remark}", _PLANNED, cells)


def _words_table(title: str, heads: Sequence[str], cells: Sequence[Sequence[str]]) -> Table:
    return Table(title, [Column(head) for head in heads], cells)
