"""A course before it is flown, as a piece of HTML for notebooks."""

import math
from collections.abc import Sequence

from airrace.planning.race import Race
from airrace.views.course_rows import rows
from airrace.views.map_model import MapModel
from airrace.views.plain_text import escaped
from airrace.views.plan_svg import plan_svg
from airrace.views.tables import html_table

HEADS = ("passage", "type", "north m", "east m", "height m", "heading deg")
ROWS_MAX = 60
"""The largest number of passages in the table; of more, only the first are listed."""


def course_page(race: Race, seen: MapModel, warnings: Sequence[str]) -> str:
    """Return the passages, the course from above as planned, and what a race director would ask about it, as HTML."""
    cells = [
        (row.passage.name, row.kind, _cell(row.north), _cell(row.east), _cell(row.height), _degrees(row.heading))
        for row in rows(race)
    ]
    title = f"{race.course.name}, flown by {race.aircraft.name}"
    listed = "".join(f"<li>{escaped(text)}</li>" for text in warnings)
    remarks = f"<ul>{listed}</ul>" if listed else ""
    return f"<div>{html_table(title, HEADS, cells[:ROWS_MAX])}{plan_svg(seen)}{remarks}</div>"


def _cell(value: float | None) -> str:
    return "free" if value is None else f"{value:.1f}"


def _degrees(angle: float | None) -> str:
    return "free" if angle is None else f"{math.degrees(angle):.0f}"
