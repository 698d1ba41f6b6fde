"""A course as rows for tables, JSON and a page."""

import math
import sys
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise

from airrace.model.frames import angle_between
from airrace.model.track.course import Passage
from airrace.model.track.element import Element
from airrace.model.track.polygons import Point
from airrace.optimal_control.quantities import Interval
from airrace.pages.views.map_model import MapModel
from airrace.pages.views.plain_text import escape_html
from airrace.pages.views.plan_svg import plan_svg
from airrace.pages.views.tables import Cell, Column, Table, Value
from airrace.procedure.planning.lint import Remark
from airrace.race import Race

_PASSAGES = (
    Column("passage", key="passage"),
    Column("type", key="type", rank=7),
    Column(key="lap"),
    Column("north", "m", "z.0f", "north_m", missing="free", rank=5),
    Column("east", "m", "z.0f", "east_m", missing="free", rank=6),
    Column("height", "m", "z.1f", "height_m", missing="free"),
    Column("course", "deg", "z.0f", "heading_deg", missing="free"),
    Column("climb", "deg", "z.0f", "climb_deg", missing="free", rank=1),
    Column("bank", "deg", "z.0f", "bank_deg", missing="free", rank=2),
    Column("leg", "m", "z.0f", "leg_m", rank=4),
    Column("turn", "deg", "z.0f", "turn_deg", rank=3),
)


def passages_table(race: Race, rows_max: int = sys.maxsize, last_rows: int = 0) -> Table:
    """Return one row per passage, in race order; what the element leaves free is None.

    `leg` is the straight distance from the passage before, `turn` the change of direction between the straight lines
    before and after (positive to the right).

    Args:
        race: course and aircraft.
        rows_max: the largest number of rows; of more passages only the first and the last are listed.
        last_rows: how many of these are the last ones.
    """
    passages = race.course.passages
    lines: list[tuple[float, float] | None] = [None]  # length and direction of the straight line to each passage
    for a, b in pairwise(passage.element.place for passage in passages):
        if a is None or b is None:
            lines.append(None)
        else:
            lines.append((math.dist(a, b), math.atan2(b[1] - a[1], b[0] - a[0])))
    rows: list[tuple[Cell | Value, ...]] = []
    for passage, before, after in zip(passages, lines, [*lines[1:], None], strict=True):
        element = passage.element
        course = element.course(passage.direction)
        heading = None if course is None else course % (2.0 * math.pi)
        bank = None if element.two_edged else element.prescribed_bank
        leg = None if before is None else before[0]
        turn = None if before is None or after is None else angle_between(after[1], before[1])
        place = (*(element.place or (None, None)), _height(element))
        angles = (_degrees(heading), _degrees(element.prescribed_climb), _degrees(bank))
        rows.append((passage.name, element.type_name, passage.lap, *place, *angles, leg, _degrees(turn)))
    title = f"{race.course.name}, flown by {race.aircraft.name}"
    if len(rows) > rows_max:
        title += f" ({len(rows)} passages; --json has all of them)"
        blank = (f"... {len(rows) - rows_max} more", *[""] * (len(_PASSAGES) - 1))
        rows = [*rows[: rows_max - last_rows], blank, *rows[-last_rows:]]
    return Table(title, _PASSAGES, rows)


def _height(element: Element) -> Cell:
    """Return the height of an element; for people the bounds of that of a free manoeuvre."""
    height, bounds = element.nominal_height, element.heights
    if height is not None or not bounds.constrained:
        return Cell(height)
    if not math.isfinite(bounds.lower):
        return Cell(None, text=f"< {bounds.upper:.0f}")
    if not math.isfinite(bounds.upper):
        return Cell(None, text=f"> {bounds.lower:.0f}")
    return Cell(None, text=f"{bounds.lower:.0f}-{bounds.upper:.0f}")


def course_object(race: Race, remarks: Iterable[Remark]) -> dict[str, object]:
    """Return what `check --json` prints of the course."""
    course, rules = race.course, race.course.rules
    return {
        "name": course.name,
        "aircraft": race.aircraft.name,
        "passages": [
            {**row, **_conditions(passage)}
            for row, passage in zip(passages_table(race).objects(), course.passages, strict=True)
        ],
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
                "name": obstacle.name,
                "places": [_place(place) for place in obstacle.places],
                "radius_m": obstacle.radius,
                "height_m": obstacle.height,
                "clearance_m": obstacle.clearance,
            }
            for obstacle in course.obstacles
        ],
        "airspace": [_place(corner) for corner in course.airspace],
        "warnings": [
            {"passage": remark.passage or None, "kind": remark.kind.value, "text": remark.text} for remark in remarks
        ],
    }


def _conditions(passage: Passage) -> dict[str, object]:
    """Return the safety lines and the roll of a passage."""
    roll = passage.roll
    rolled = roll and {
        "angle_deg": _degrees(roll.angle),
        "climb_deg": _bounds(roll.climb, math.degrees(1.0)),
        "gain_m": roll.gain,
        "turning": roll.turning.value,
    }
    return {"safety_lines": [line.name for line in passage.safety_lines], "roll": rolled}


def _degrees(angle: float | None) -> float | None:
    """Return an angle in degrees, without the last bits of the conversion."""
    return None if angle is None or not math.isfinite(angle) else round(math.degrees(angle), 9)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _bounds(interval: Interval, unit: float = 1.0) -> list[float | None]:
    return [round(bound * unit, 9) if math.isfinite(bound) else None for bound in (interval.lower, interval.upper)]


def _place(place: Point) -> dict[str, object]:
    return {"north_m": place.north, "east_m": place.east}


ROWS_MAX = 60
"""The largest number of passages in the table; of more, only the first are listed."""


def course_page(map_: MapModel, warnings: Sequence[str]) -> str:
    """Return the passages, the course from above as planned, and what a race director would ask about it, as HTML."""
    table = passages_table(map_.race)
    table = replace(table, rows=table.rows[:ROWS_MAX])
    entries = "".join(f"<li>{escape_html(text)}</li>" for text in warnings)
    return f"<div>{table.html()}{plan_svg(map_)}{f'<ul>{entries}</ul>' if entries else ''}</div>"
