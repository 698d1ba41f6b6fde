"""A course as rows for tables, JSON and a page."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from airrace.frames import angle_between
from airrace.planning.lint import Remark
from airrace.quantities import Interval
from airrace.race import Race
from airrace.track.course import Passage
from airrace.track.polygons import Point
from airrace.views.map_model import MapModel
from airrace.views.plain_text import escape_html
from airrace.views.plan_svg import plan_svg
from airrace.views.tables import Column, Table


@dataclass(frozen=True)
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


def rows(race: Race) -> list[CourseRow]:
    """Return one row per passage, in race order."""
    passages = race.course.passages
    lines: list[tuple[float, float] | None] = [None]  # length and direction of the straight line to each passage
    for a, b in pairwise(passage.element.place for passage in passages):
        if a is None or b is None:
            lines.append(None)
        else:
            lines.append((math.dist(a, b), math.atan2(b[1] - a[1], b[0] - a[0])))
    found: list[CourseRow] = []
    for passage, before, after in zip(passages, lines, [*lines[1:], None], strict=True):
        element = passage.element
        north, east = element.place or (None, None)
        course = element.course(passage.direction)
        found.append(
            CourseRow(
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
        )
    return found


def course_object(race: Race, remarks: Iterable[Remark]) -> dict[str, object]:
    """Return what `check --json` prints of the course."""
    course, rules = race.course, race.course.rules
    return {
        "name": course.name,
        "aircraft": race.aircraft.name,
        "passages": [_passage(row) for row in rows(race)],
        "limits": {
            "load_factor_g": _bounds(rules.n_z_allowed.intersect(race.aircraft.envelope.n_z)),
            "speed_m_s": _bounds(race.aircraft.envelope.V),
            "start_speed_m_s": _bounds(course.passages[0].speed),
            "start_speed": rules.start_speed.value,
            "height_m": _bounds(rules.height),
            "roll_rate_deg_s": _degrees(min(rules.p, race.aircraft.point_mass.p)),
            "sideslip_deg": _degrees(rules.beta_A),
            "lift_coefficient": _bounds(rules.C_L),
            "angle_of_attack_deg": _bounds(rules.alpha_A, math.degrees(1.0)),
        },
        "pilot": {
            "load_factor_min_g": _finite(rules.pilot.n_z_min),
            "low_load_factor_min_g": _finite(rules.pilot.n_z_low),
            "low_height_m": rules.pilot.low_height,
            "end_load_factor_min_g": _finite(rules.pilot.n_z_ends),
            "gate_onset_max_g_s": _finite(rules.pilot.onset),
            "gate_roll_rate_max_deg_s": _degrees(rules.pilot.roll_rate),
            "gate_sideslip_max_deg": _degrees(rules.pilot.sideslip),
            "gate_n_y_max": _finite(rules.pilot.n_y),
            "settled_start": rules.pilot.settled_start,
            "settled_finish": rules.pilot.settled_finish,
            "steady_start": rules.pilot.steady_start,
            "steady_finish": rules.pilot.steady_finish,
            "turn_tolerance_g": rules.pilot.turn_tolerance,
        },
        "safety_lines": [
            {
                "name": line.name,
                "from": _place(line.start),
                "to": _place(line.end),
                "keep": "right" if line.keep_right else "left",
                "margin_m": line.margin,
            }
            for line in course.safety_lines
        ],
        "crowd": [
            {
                "name": crowd.name,
                "shape": crowd.shape.value,
                "corners": [_place(corner) for corner in crowd.corners],
                "distance_m": crowd.distance,
                "height_m": crowd.height,
                "measured": "slant" if crowd.slant else "over-ground",
            }
            for crowd in course.crowd
        ],
        "obstacles": [
            {
                "name": one.name,
                "places": [_place(place) for place in one.places],
                "radius_m": one.radius,
                "height_m": one.height,
                "clearance_m": one.clearance,
            }
            for one in course.obstacles
        ],
        "airspace": [_place(corner) for corner in course.airspace],
        "warnings": [
            {"passage": remark.passage or None, "kind": remark.kind.value, "text": remark.text} for remark in remarks
        ],
    }


def _passage(row: CourseRow) -> dict[str, object]:
    roll = row.passage.roll
    return {
        "passage": row.passage.name,
        "type": row.kind,
        "lap": row.passage.lap,
        "north_m": row.north,
        "east_m": row.east,
        "height_m": row.height,
        "heading_deg": _degrees(row.heading),
        "climb_deg": _degrees(row.climb),
        "bank_deg": _degrees(row.bank),
        "leg_m": row.leg,
        "turn_deg": _degrees(row.turn),
        "safety_lines": [line.name for line in row.passage.safety_lines],
        "roll": roll
        and {
            "angle_deg": _degrees(roll.angle),
            "climb_deg": _bounds(roll.climb, math.degrees(1.0)),
            "gain_m": roll.gain,
            "turning": roll.turning.value,
        },
    }


def _degrees(angle: float | None) -> float | None:
    """Return an angle in degrees, without the last bits of the conversion."""
    return None if angle is None or not math.isfinite(angle) else round(math.degrees(angle), 9)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _bounds(interval: Interval, unit: float = 1.0) -> list[float | None]:
    return [round(bound * unit, 9) if math.isfinite(bound) else None for bound in (interval.lower, interval.upper)]


def _place(place: Point) -> dict[str, object]:
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
    entries = "".join(f"<li>{escape_html(text)}</li>" for text in warnings)
    return f"<div>{table.html()}{plan_svg(map_)}{f'<ul>{entries}</ul>' if entries else ''}</div>"
