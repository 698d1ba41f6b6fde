"""A course as rows for tables, JSON and a page."""

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise

from airrace.frames import angle_between
from airrace.planning.lint import Remark
from airrace.planning.race import Race
from airrace.quantities import Interval
from airrace.records import record
from airrace.track.course import Crowd, Passage, Roll, SafetyLine
from airrace.track.polygons import Point
from airrace.views.map_model import MapModel
from airrace.views.plain_text import escaped
from airrace.views.plan_svg import plan_svg
from airrace.views.tables import Column, Table


@record
class CourseRow:
    """A passage in a table; SI and radians, None for what the element leaves free.

    `leg` is the straight distance from the passage before, `turn` the change of direction between the straight lines
    before and after (positive to the right).
    """

    passage: Passage
    kind: str
    north: float | None
    east: float | None
    height: float | None
    heading: float | None
    climb: float | None
    bank: float | None
    leg: float | None
    turn: float | None

    def as_object(self) -> dict[str, object]:
        return {
            "passage": self.passage.name,
            "type": self.kind,
            "lap": self.passage.lap,
            "north_m": self.north,
            "east_m": self.east,
            "height_m": self.height,
            "heading_deg": _rounded_degrees(self.heading),
            "climb_deg": _rounded_degrees(self.climb),
            "bank_deg": _rounded_degrees(self.bank),
            "leg_m": self.leg,
            "turn_deg": _rounded_degrees(self.turn),
            "safety_lines": [line.name for line in self.passage.safety_lines],
            "roll": None if self.passage.roll is None else _roll_object(self.passage.roll),
        }


def course_object(race: Race, remarks: Iterable[Remark]) -> dict[str, object]:
    """Return what `check --json` prints of the course."""
    course, rules = race.course, race.course.rules
    return {
        "name": course.name,
        "aircraft": race.aircraft.name,
        "passages": [row.as_object() for row in rows(race)],
        "limits": {
            "load_factor_g": _bounds(rules.n_z.intersect(race.aircraft.envelope.n_z)),
            "speed_m_s": _bounds(race.aircraft.envelope.V),
            "start_speed_m_s": _bounds(course.passages[0].speed),
            "height_m": _bounds(rules.height),
            "roll_rate_deg_s": _rounded_degrees(min(rules.p, race.aircraft.point_mass.p)),
            "sideslip_deg": _rounded_degrees(rules.beta_A),
            "lift_coefficient": _bounds(rules.C_L),
            "angle_of_attack_deg": _bounds(rules.alpha_A, math.degrees(1.0)),
        },
        "safety_lines": [_line_object(line) for line in course.safety_lines],
        "crowd": [_crowd_object(crowd) for crowd in course.crowd],
        "airspace": [_place_object(corner) for corner in course.airspace],
        "warnings": [
            {"passage": remark.passage or None, "kind": remark.kind.value, "text": remark.text} for remark in remarks
        ],
    }


def rows(race: Race) -> list[CourseRow]:
    """Return one row per passage, in the order flown."""
    passages = race.course.passages
    places = [passage.element.place for passage in passages]
    legs = [_straight(a, b) for a, b in pairwise(places)]
    before = [None, *legs]
    after = [*legs, None]
    return [
        _row(passage, before=inbound, after=outbound)
        for passage, inbound, outbound in zip(passages, before, after, strict=True)
    ]


def _row(passage: Passage, *, before: tuple[float, float] | None, after: tuple[float, float] | None) -> CourseRow:
    element = passage.element
    north, east = element.place or (None, None)
    course = element.course(passage.direction)
    return CourseRow(
        passage=passage,
        kind=element.type_name,
        north=north,
        east=east,
        height=element.nominal_height,
        heading=None if course is None else course % (2.0 * math.pi),
        climb=element.prescribed_climb,
        bank=None if element.two_edged else element.prescribed_bank,
        leg=None if before is None else before[0],
        turn=None if before is None or after is None else angle_between(after[1], before[1]),
    )


def _straight(a: tuple[float, float] | None, b: tuple[float, float] | None) -> tuple[float, float] | None:
    """Return the length (m) and the direction (rad) of the line from a to b; None if a place is free."""
    if a is None or b is None:
        return None
    north, east = b[0] - a[0], b[1] - a[1]
    return math.hypot(north, east), math.atan2(east, north)


def _degrees(angle: float | None) -> float | None:
    return None if angle is None or not math.isfinite(angle) else math.degrees(angle)


def _rounded_degrees(angle: float | None) -> float | None:
    """Return an angle in degrees, without the last bits of the conversion."""
    degrees = _degrees(angle)
    return None if degrees is None else round(degrees, 9)


def _bounds(interval: Interval, unit: float = 1.0) -> list[float | None]:
    return [round(bound * unit, 9) if math.isfinite(bound) else None for bound in (interval.lower, interval.upper)]


def _roll_object(roll: Roll) -> dict[str, object]:
    return {
        "angle_deg": _rounded_degrees(roll.angle),
        "climb_deg": _bounds(roll.climb, math.degrees(1.0)),
        "gain_m": roll.gain,
        "turning": roll.turning.value,
    }


def _line_object(line: SafetyLine) -> dict[str, object]:
    return {
        "name": line.name,
        "from": _place_object(line.start),
        "to": _place_object(line.end),
        "keep": "right" if line.keep_right else "left",
        "margin_m": line.margin,
    }


def _crowd_object(crowd: Crowd) -> dict[str, object]:
    return {
        "name": crowd.name,
        "shape": crowd.shape.value,
        "corners": [_place_object(corner) for corner in crowd.corners],
        "distance_m": crowd.distance,
        "height_m": crowd.height,
        "measured": "slant" if crowd.slant else "over-ground",
    }


def _place_object(place: Point) -> dict[str, object]:
    return {"north_m": place.north, "east_m": place.east}


COLUMNS = (
    Column("passage"),
    Column("type"),
    Column("north", "m", ".1f", missing="free"),
    Column("east", "m", ".1f", missing="free"),
    Column("height", "m", ".1f", missing="free"),
    Column("heading", "deg", ".0f", missing="free"),
)
ROWS_MAX = 60
"""The largest number of passages in the table; of more, only the first are listed."""


def course_page(map_: MapModel, warnings: Sequence[str]) -> str:
    """Return the passages, the course from above as planned, and what a race director would ask about it, as HTML."""
    race = map_.race
    cells = [
        (row.passage.name, row.kind, row.north, row.east, row.height, _degrees(row.heading))
        for row in rows(race)[:ROWS_MAX]
    ]
    table = Table(f"{race.course.name}, flown by {race.aircraft.name}", COLUMNS, cells)
    listed = "".join(f"<li>{escaped(text)}</li>" for text in warnings)
    return f"<div>{table.html()}{plan_svg(map_)}{f'<ul>{listed}</ul>' if listed else ''}</div>"
