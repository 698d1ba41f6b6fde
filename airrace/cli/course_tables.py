"""Tables of a course before its race."""

import itertools
import math
import sys
from collections.abc import Iterator, Sequence

import numpy as np

from airrace.cli.printed_result import paragraph
from airrace.flights.results import Flight
from airrace.flights.results.clearances import Clearance
from airrace.flights.results.flight import passings_around
from airrace.model.track.course import CrowdShape, PilotLimits, StartSpeed
from airrace.model.track.polygons import area, edges
from airrace.optimal_control.quantities import KNOT, Interval, plain_number
from airrace.pages.views.course_page import passages_table
from airrace.pages.views.tables import Column, Table
from airrace.procedure.planning.lint import Remark
from airrace.race import Race

ROWS_MAX = 200
"""The largest number of passages in the table; of more, only the first and the last are printed."""
LAST_ROWS = 20
"""The number of passages at the end of a table that is cut."""
REMARKS_MAX = 30
"""The largest number of remarks that are printed."""


def course_tables(race: Race) -> list[Table]:
    """Return the tables of a course: passages, conditions on single legs, limits along the flight, and surroundings."""
    words = (
        ("on the leg to", ("passage", "safety lines", "roll"), _leg_conditions(race)),
        ("limits along the flight", ("limit", "range"), _limits(race)),
        ("kept away from", ("name", "what", "where", "distance"), _surroundings(race)),
    )
    tables = [Table(title, [Column(head, wraps=True) for head in heads], list(cells)) for title, heads, cells in words]
    return [table for table in (passages_table(race, ROWS_MAX, LAST_ROWS), *tables) if table.rows]


def remarks_text(remarks: Sequence[Remark]) -> str:
    """Return the remarks, one line each where no terminal is too narrow for it; of many, the first ones."""
    lines = [paragraph(remark.text, begin="warning: ", page=sys.maxsize) for remark in remarks[:REMARKS_MAX]]
    if len(remarks) > REMARKS_MAX:
        lines.append(paragraph(f"and {len(remarks) - REMARKS_MAX} more warnings; --json has all of them"))
    return "\n".join(lines)


def _leg_conditions(race: Race) -> Iterator[list[str]]:
    """Yield the conditions on legs that lead to single passages; those that hold on several legs once."""
    found: dict[tuple[str, str], list[str]] = {}
    for passage in race.course.passages:
        lines, roll, text = ", ".join(line.name for line in passage.safety_lines), passage.roll, "-"
        if roll is not None:
            climb = " to ".join(f"{math.degrees(bound):.0f}" for bound in (roll.climb.lower, roll.climb.upper))
            gain = f", +{roll.gain:g} m" if roll.gain else ""
            text = f"{math.degrees(roll.angle):.0f} deg {roll.turning.value}, at {climb} deg{gain}"
        if lines or roll is not None:
            found.setdefault((lines or "-", text), []).append(passage.name)
    for conditions, names in found.items():
        many = len(names) > 3
        yield [f"{names[0]}, {names[1]} and {len(names) - 2} more" if many else ", ".join(names), *conditions]


def _limits(race: Race) -> Iterator[list[str]]:
    rules, envelope = race.course.rules, race.aircraft.envelope
    start = race.course.passages[0].speed
    yield ["load factor", _range(rules.n_z_allowed.intersect(envelope.n_z), "g")]
    yield ["speed", _speeds(envelope.V)]
    kind = {StartSpeed.GROUND: "over ground"}.get(rules.start_speed, rules.start_speed.value.replace("_", " "))
    yield ["speed at the start", f"{_speeds(start)}, {kind}" if start.constrained else "free"]
    yield ["height", _range(rules.height, "m")]
    yield ["roll rate", f"up to {math.degrees(min(rules.p, race.aircraft.point_mass.p)):.0f} deg/s"]
    if math.isfinite(rules.beta_A):
        yield ["sideslip", f"up to {math.degrees(rules.beta_A):.3g} deg"]
    if rules.C_L.constrained:
        yield ["lift coefficient", _range(rules.C_L, "").rstrip()]
    if rules.alpha_A.constrained:
        degrees = Interval(math.degrees(rules.alpha_A.lower), math.degrees(rules.alpha_A.upper))
        yield ["angle of attack", _range(degrees, "deg")]
    yield from _pilot(rules.pilot)


def _pilot(pilot: PilotLimits) -> Iterator[list[str]]:
    """Yield the limits of a pilot."""
    if math.isfinite(pilot.n_z_low):
        yield ["load factor near the ground", f"at least {pilot.n_z_low:g} g up to {pilot.low_height:g} m"]
    if math.isfinite(pilot.n_z_ends):
        yield ["load factor at start and finish", f"at least {pilot.n_z_ends:g} g"]
    if math.isfinite(pilot.onset):
        yield ["onset at gates", f"up to {pilot.onset:g} g/s"]
    if math.isfinite(pilot.roll_rate):
        yield ["roll rate at gates", f"up to {math.degrees(pilot.roll_rate):.3g} deg/s"]
    if math.isfinite(pilot.sideslip):
        yield ["sideslip at gates", f"up to {math.degrees(pilot.sideslip):.3g} deg"]
    if math.isfinite(pilot.n_y):
        yield ["lateral load factor at gates", f"up to {pilot.n_y:g} g"]
    if settled := _ends(pilot.settled_start, pilot.settled_finish):
        yield ["settled", settled]
    if steady := _ends(pilot.steady_start, pilot.steady_finish):
        yield ["steady turn", f"{steady}, within {pilot.turn_tolerance:g} g"]


def _ends(start: bool, finish: bool) -> str:
    """Return at which ends of the race something holds; empty where at none."""
    ends = [name for name, holds in (("at the start", start), ("at the finish", finish)) if holds]
    return " and ".join(ends)


def _surroundings(race: Race) -> Iterator[list[str]]:
    for crowd in race.course.crowd:
        places = [(corner.north, corner.east) for corner in crowd.corners]
        if crowd.shape is CrowdShape.AREA:
            shape = f"within {plain_number(abs(area(crowd.corners)) / 1e4)} ha about"
        elif crowd.shape is CrowdShape.LINE:
            shape = f"along {sum(itertools.starmap(math.dist, itertools.pairwise(places))):.0f} m about"
        else:
            shape = "at"
        north, east = np.mean(places, axis=0)
        distance = f"{crowd.distance:g} m {'slant' if crowd.slant else 'over ground'}"
        yield [crowd.name, "crowd", f"{shape} ({north:.0f}, {east:.0f})", distance]
    for obstacle in race.course.obstacles:
        places = [(place.north, place.east) for place in obstacle.places]
        north, east = np.mean(places, axis=0)
        radius = obstacle.radius + 0.5 * float(np.hypot(*np.ptp(places, axis=0)))
        size = f"{obstacle.height:g} m high" + (f", within {radius:.0f} m" if radius else "")
        where = f"{size} about ({north:.0f}, {east:.0f})"
        yield [obstacle.name, "obstacle", where, f"{obstacle.clearance:g} m from the wing"]
    for line in race.course.safety_lines:
        start, end = (f"({end_point.north:.0f}, {end_point.east:.0f})" for end_point in (line.start, line.end))
        where = f"{'right' if line.keep_right else 'left'} of {start} to {end}"
        yield [line.name, "safety line", where, f"{line.margin:g} m"]
    corners = race.course.airspace
    if corners:
        around = sum(math.hypot(a.north - b.north, a.east - b.east) for a, b in edges(corners, closed=True))
        inside, border = plain_number(abs(area(corners)) / 1e6), plain_number(around / 1e3)
        size = f"{len(corners)} corners, {inside} km2, {border} km around"
        yield ["airspace", "its border", size, "0 m"]


def _speeds(interval: Interval) -> str:
    knots = Interval(*(round(bound / KNOT, 1) for bound in (interval.lower, interval.upper)))
    return f"{_range(knots, 'kt')} ({_range(interval, 'm/s')})"


def _range(interval: Interval, unit: str) -> str:
    lower, upper = interval.lower, interval.upper
    if not interval.constrained:
        return "free"
    if not math.isfinite(lower):
        return f"up to {plain_number(upper, 4)} {unit}"
    if not math.isfinite(upper):
        return f"at least {plain_number(lower, 4)} {unit}"
    return f"{plain_number(lower, 4)} to {plain_number(upper, 4)} {unit}"


_PLANNED = (
    Column("from", wraps=True),
    Column("distance", "m", ".1f"),
    Column("required", "m", ".1f", rank=4),
    Column("north", "m", "z.0f", rank=2),
    Column("east", "m", "z.0f", rank=3),
    Column("height", "m", "z.0f", rank=1),
    Column("between", wraps=True),
)


def planned_table(flight: Flight, clearances: Sequence[Clearance]) -> Table:
    """Return a table of the least distances of a planned flight."""
    cells: list[tuple[str | float, ...]] = []
    for clearance in clearances:
        before, after = passings_around(flight, clearance.time)
        thing = f"wing to {clearance.text}" if clearance.kind in ("pylon", "obstacle") else clearance.text
        place = (clearance.north, clearance.east, clearance.height)
        cells.append((thing, clearance.distance, clearance.required, *place, f"{before.name} and {after.name}"))
    return Table(f"least distances of the line that is {flight.source.remark}", _PLANNED, cells)
