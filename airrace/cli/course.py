"""A course as people and scripts see it before anyone flies it: passages, legs, turns and limits."""

import math
from dataclasses import dataclass
from itertools import pairwise

from rich.table import Table

from airrace.cli.tables import plain_table
from airrace.documents.units import KNOT
from airrace.frames import angle_between
from airrace.procedure.race import Race
from airrace.quantities import Interval
from airrace.track.course import Direction, Passage
from airrace.track.gates import Gate, Manoeuvre, Pylon


@dataclass(frozen=True)
class Row:
    """One passage; SI and radians, None where the element leaves it free.

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
        }


def course_object(race: Race) -> dict[str, object]:
    """What `check --json` prints of the course."""
    rules = race.course.rules
    return {
        "name": race.course.name,
        "aircraft": race.aircraft.name,
        "passages": [row.as_object() for row in rows(race)],
        "limits": {
            "load_factor_g": _bounds(rules.n_z.intersect(race.aircraft.envelope.n_z)),
            "speed_m_s": _bounds(race.aircraft.envelope.V),
            "height_m": _bounds(rules.height),
            "roll_rate_deg_s": _rounded_degrees(min(rules.p, race.aircraft.point_mass.p)),
        },
    }


def course_tables(race: Race) -> list[Table]:
    """The same for people."""
    numbers = ("north\nm", "east\nm", "height\nm", "heading\ndeg", "climb\ndeg", "bank\ndeg", "leg\nm", "turn\ndeg")
    cells = [
        [
            row.passage.name,
            row.kind,
            *(_cell(value, "free", digits=1) for value in (row.north, row.east, row.height)),
            *(_cell(_degrees(angle), "free") for angle in (row.heading, row.climb, row.bank)),
            *(_cell(value, "-") for value in (row.leg, _degrees(row.turn))),
        ]
        for row in rows(race)
    ]
    rules, envelope = race.course.rules, race.aircraft.envelope
    speeds = Interval(*(round(bound / KNOT, 1) for bound in (envelope.V.lower, envelope.V.upper)))
    limits = [
        ["load factor", _range(rules.n_z.intersect(envelope.n_z), "g")],
        ["speed", f"{_range(envelope.V, 'm/s')} ({_range(speeds, 'kt')})"],
        ["height", _range(rules.height, "m")],
        ["roll rate", f"up to {math.degrees(min(rules.p, race.aircraft.point_mass.p)):.0f} deg/s"],
    ]
    return [
        plain_table(f"{race.course.name}, flown by {race.aircraft.name}", ("passage", "type"), numbers, cells),
        plain_table("limits along the flight", ("limit", "range"), (), limits),
    ]


def rows(race: Race) -> list[Row]:
    """One row per passage, in the order flown."""
    passages = race.course.passages
    places = [_place(passage) for passage in passages]
    legs = [_straight(a, b) for a, b in pairwise(places)]
    before = [None, *legs]
    after = [*legs, None]
    return [
        _row(passage, before=inbound, after=outbound)
        for passage, inbound, outbound in zip(passages, before, after, strict=True)
    ]


def _row(passage: Passage, *, before: tuple[float, float] | None, after: tuple[float, float] | None) -> Row:
    kind, bank = _kind(passage)
    place = _place(passage)
    north, east = place if place is not None else (None, None)
    return Row(
        passage=passage,
        kind=kind,
        north=north,
        east=east,
        height=_height(passage),
        heading=_heading(passage),
        climb=passage.element.climb if isinstance(passage.element, Manoeuvre) else None,
        bank=bank,
        leg=None if before is None else before[0],
        turn=None if before is None or after is None else angle_between(after[1], before[1]),
    )


def _kind(passage: Passage) -> tuple[str, float | None]:
    """The type as a track file names it, and the bank it prescribes, rad."""
    match passage.element:
        case Gate(bank=bank, either_bank=either):
            level = math.isclose(bank, 0.0, abs_tol=1e-9)
            return ("level" if level else "knife-edge"), None if either else bank
        case Pylon():
            return "pylon", None
        case Manoeuvre(bank=bank):
            return "manoeuvre", bank


def _place(passage: Passage) -> tuple[float, float] | None:
    """North and east, m; None where they are free."""
    match passage.element:
        case Manoeuvre(north=north, east=east):
            fixed = north.lower == north.upper and east.lower == east.upper
            return (north.lower, east.lower) if fixed else None
        case Gate(north=north, east=east) | Pylon(north=north, east=east):
            return north, east


def _height(passage: Passage) -> float | None:
    match passage.element:
        case Manoeuvre(height=height):
            return height.lower if height.lower == height.upper else None
        case Gate(height=height) | Pylon(height=height):
            return height


def _heading(passage: Passage) -> float | None:
    """The course through the element, rad, in [0, 2 pi); None where it is free or still to be planned."""
    match passage.element:
        case Gate(heading=heading) if passage.direction is not Direction.PLANNED:
            return (heading + (math.pi if passage.direction is Direction.REVERSE else 0.0)) % (2.0 * math.pi)
        case Manoeuvre(heading=heading) if heading is not None:
            return heading % (2.0 * math.pi)
        case _:
            return None


def _straight(a: tuple[float, float] | None, b: tuple[float, float] | None) -> tuple[float, float] | None:
    """Length (m) and direction (rad) of the line from a to b."""
    if a is None or b is None:
        return None
    north, east = b[0] - a[0], b[1] - a[1]
    return math.hypot(north, east), math.atan2(east, north)


def _degrees(angle: float | None) -> float | None:
    return None if angle is None or not math.isfinite(angle) else math.degrees(angle)


def _rounded_degrees(angle: float | None) -> float | None:
    """Degrees without the conversion's last bits."""
    degrees = _degrees(angle)
    return None if degrees is None else round(degrees, 9)


def _bounds(interval: Interval) -> list[float | None]:
    return [bound if math.isfinite(bound) else None for bound in (interval.lower, interval.upper)]


def _cell(value: float | None, otherwise: str, digits: int = 0) -> str:
    return otherwise if value is None else f"{value:z.{digits}f}"


def _range(interval: Interval, unit: str) -> str:
    lower, upper = interval.lower, interval.upper
    if not interval.bounded:
        return "free"
    if not math.isfinite(lower):
        return f"up to {upper:g} {unit}"
    if not math.isfinite(upper):
        return f"at least {lower:g} {unit}"
    return f"{lower:.4g} to {upper:.4g} {unit}"
