"""A review of a course before its race, as a race director would make it.

It yields remarks, not errors: the course stays valid. What the planned line comes too near to is remarked on by
`airrace.flights.results.planned`.
"""

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from airrace.model.aircraft import Aircraft
from airrace.model.dynamics import handling
from airrace.model.dynamics.flight_manual import top_speed
from airrace.model.environment import g0
from airrace.model.frames import angle_between
from airrace.model.track.course import Course, Direction, Passage, StartSpeed
from airrace.model.track.polygons import Point, inside
from airrace.optimal_control.quantities import KNOT
from airrace.procedure.planning.plan import ONE_PLACE, plan
from airrace.procedure.planning.planning_model import AIR_DENSITY, PlanningModel, cruise
from airrace.procedure.planning.route_decisions import PLANNED_MAX, place
from airrace.race import Race

WIND_MAX = 30.0 * KNOT
"""The most wind of a race by the rules of 2014 to 2019, m/s."""
TURN_LOAD_FACTOR_LEAST = 1.01
"""The least load factor of the tightest turns, g: with less an aircraft flies straight on, and there is no turn."""
TURN_SAMPLES = 65
"""The number of points at which a turn is measured."""
HEADINGS_MIN = 4
"""The number of headings that tell whether positions fit them."""
EXCHANGE_GAIN = 0.25
"""By how much headings must fit better with north and east exchanged, as a mean cosine; those of the shipped courses
fit worse by 0.31 at least."""
IDLE_PYLON_DISTANCE = 20.0
"""The distance from a pylon at which the straight line between its neighbours passes on the side asked for, m. On the
shipped courses it is 17 m at most, and most lines pass on the other side."""
SAME_ELEMENT_SECONDS = 0.1
"""The time of flight at the least speed below which two elements may be meant as one, s."""
SAME_ELEMENT_ANGLE = math.radians(30.0)
"""The largest angle between their axes then, rad; those of a quad stand across."""
HEIGHT_BAND = 5.0
"""The least room between floor and ceiling that needs no remark, m: the legal heights of a gate span 10 m."""
ENERGY_SHARE = 0.5
"""The part of its kinetic energy that an aircraft can give for height (1): what is left has to carry it."""
LOOP_TURN = math.pi
"""A way that turns by this much more than straight lines do goes round a loop, rad."""
SAME_PLACE = 1.0
"""Passings nearer than this, as of a quad, are meant to be joined by a loop, m."""
WRONG_WAY = math.radians(90.0)
"""A gate that points further away from both of its neighbours points the wrong way, rad."""
WRONG_WAY_END = math.radians(135.0)
"""Likewise a start or finish, which has but one neighbour, rad."""


class RemarkKind(Enum):
    """A subject of remarks."""

    AIRCRAFT = "aircraft"
    WIND = "wind"
    LOAD_FACTOR = "load-factor"
    START_SPEED = "start-speed"
    WIDTH = "width"
    AXIS = "axis"
    CEILING = "ceiling"
    CLIMB = "climb"
    CLOSE = "close"
    TURN = "turn"
    SAFETY_LINE = "safety-line"
    CROWD = "crowd"
    PYLON = "pylon"
    OBSTACLE = "obstacle"
    AIRSPACE = "airspace"
    ELEMENT = "element"
    LANGUAGE = "language"

    @classmethod
    def from_subject(cls, subject: str) -> "RemarkKind":
        """Return the kind of a remark that an element makes about itself."""
        return cls(subject) if any(subject == member.value for member in cls) else cls.ELEMENT


@dataclass(frozen=True)
class Remark:
    """A remark of one sentence about a course.

    Attributes:
        passage: the name of the passage concerned, or of the one to which the leg concerned leads; empty where it is
            the race as a whole.
        text: the sentence, without a full stop.
    """

    passage: str
    kind: RemarkKind
    text: str


def review(race: Race) -> list[Remark]:
    """Return all remarks: on the race as a whole, on the elements, on the legs.

    There is one for every place, however often it is passed.
    """
    course = race.course
    remarks = [*_race_remarks(race), *_start_remarks(race), *_element_remarks(course), *_axis_remarks(course)]
    return in_order([*remarks, *_mistakes(course), *_leg_remarks(race)], course)


def in_order(remarks: Iterable[Remark], course: Course) -> list[Remark]:
    """Return remarks in the order of the race, first those on the race as a whole."""
    order = {passage.name: number for number, passage in enumerate(course.passages)}
    return sorted(remarks, key=lambda remark: order.get(remark.passage, -1))


def forgotten_lines(course: Course) -> Iterator[Remark]:
    """Yield remarks on people without a safety line before them, and on lines that could hold on more legs."""
    for crowd in course.crowd:
        behind = any(all(line.room(corner) < 0.0 for corner in crowd.corners) for line in course.safety_lines)
        outside = course.airspace and not any(inside(corner, course.airspace) for corner in crowd.corners)
        if not (behind or outside):
            text = f"no safety line or border lies between the race and `{crowd.name}`; its distance alone counts"
            yield Remark("", RemarkKind.SAFETY_LINE, text)
    places = [Point(*at) for at in (passage.element.place for passage in course.passages) if at is not None]
    for line in course.safety_lines:
        without = [
            passage
            for passage in course.passages[1:]
            if all(safety_line.name != line.name for safety_line in passage.safety_lines)
        ]
        if without and all(line.room(point) >= line.margin for point in places):
            text = (
                f"the safety line `{line.name}` does not hold on {len(without)} of {len(course.passages) - 1} legs, "
                f"first on that to `{without[0].name}`, though all elements stand on its allowed side; without a "
                "passing that names it, it would hold on all"
            )
            yield Remark(without[0].name, RemarkKind.SAFETY_LINE, text)


# The race as a whole, its start and its elements.


def _race_remarks(race: Race) -> Iterator[Remark]:
    aircraft, wind, rules = race.aircraft, race.air.wind, race.course.rules
    for text in handling.remarks(aircraft):
        yield Remark("", RemarkKind.AIRCRAFT, text)
    if not top_speed(aircraft):
        text = f"{aircraft.name} cannot fly level: its power balances the drag of carrying its weight at no speed"
        yield Remark("", RemarkKind.AIRCRAFT, text)
    if wind is not None and wind.speed > WIND_MAX + 1e-9:
        text = f"the wind blows at {wind.speed / KNOT:.0f} kt; races are held in 30 kt at most"
        yield Remark("", RemarkKind.WIND, text)
    allowed, able = rules.n_z, aircraft.envelope.n_z
    for limit, own, beyond in ((allowed.upper, able.upper, 1.0), (allowed.lower, able.lower, -1.0)):
        if beyond * (limit - own) > 1e-9 and math.isfinite(limit):
            text = f"the race allows {limit:g} g, but {aircraft.name} no more than {own:g} g"
            yield Remark("", RemarkKind.LOAD_FACTOR, text)


def _start_remarks(race: Race) -> Iterator[Remark]:
    """Yield a remark on a start that may be passed faster than in level flight.

    The optimum begins at any speed that limit and envelope allow, whatever it would take to reach that before.
    """
    start, aircraft = race.course.passages[0], race.aircraft
    fastest, most, limit = top_speed(aircraft), aircraft.envelope.V.upper, start.speed.upper
    over_ground = race.course.rules.start_speed is StartSpeed.GROUND
    if limit < fastest + KNOT or not fastest > 0.0:
        return
    bound = f"the start speed limit of {limit / KNOT:.0f} kt at `{start.name}`"
    if math.isinf(limit):
        if not start.element.stands:  # a course that begins in the air has no start with a speed limit
            return
        text = f"no speed limit holds at the start `{start.name}` (`rules.start_speed_max_kt`): {aircraft.name} flies "
        text += f"{most / KNOT:.0f} kt at most, {fastest / KNOT:.0f} kt in level flight"
    elif over_ground and limit >= most:  # an airspeed may be more, by the wind
        text = f"{bound} limits nothing: {aircraft.name} flies {most / KNOT:.0f} kt at most"
    else:
        text = f"{bound} is more than {aircraft.name} reaches in level flight, {fastest / KNOT:.0f} kt"
    yield Remark(start.name, RemarkKind.START_SPEED, text)


def _element_remarks(course: Course) -> Iterator[Remark]:
    allowed = course.rules.height
    room = allowed.upper - allowed.lower
    for passage in {passage.element.name: passage for passage in reversed(course.passages)}.values():
        element, name, ceiling = passage.element, passage.name, ""
        for subject, text in element.remarks(name):
            yield Remark(name, RemarkKind.from_subject(subject), text)
        if element.heights.lower > allowed.upper:
            ceiling = f"`{name}` asks for {element.heights.lower:.0f} m; the ceiling is at {allowed.upper:.0f} m"
        elif element.heights.upper < allowed.lower:
            ceiling = f"`{name}` allows {element.heights.upper:.0f} m at most; the floor is at {allowed.lower:.0f} m"
        elif passage.roll is not None and allowed.lower + passage.roll.gain > allowed.upper:
            ceiling = f"the roll at `{name}` gains {passage.roll.gain:.0f} m; "
            ceiling += f"there are {room:.0f} m between floor and ceiling"
        if ceiling:
            yield Remark(name, RemarkKind.CEILING, ceiling)
    if room < HEIGHT_BAND:
        text = (
            f"there are {room:.3g} m between the floor at {allowed.lower:g} m and the ceiling at {allowed.upper:g} m; "
            "hardly anyone keeps a height so closely"
        )
        yield Remark("", RemarkKind.CEILING, text)


def _axis_remarks(course: Course) -> Iterator[Remark]:
    """Yield remarks on gates passed against the way the course comes and goes."""
    reported: set[tuple[str, Direction]] = set()
    around = zip([None, *course.passages], course.passages, [*course.passages[1:], None], strict=False)
    for before, passage, after in around:
        key = (passage.element.name, passage.direction)
        heading = passage.element.course(passage.direction)
        if not passage.element.directed or heading is None or key in reported:
            continue
        ways = [_bearing(a, b) for a, b in ((before, passage), (passage, after)) if a is not None and b is not None]
        limit = WRONG_WAY if len(ways) == 2 else WRONG_WAY_END
        against = [abs(angle_between(heading, way)) > limit + 1e-9 for way in ways if way is not None]
        if len(against) == len(ways) and all(against):
            reported.add(key)
            text = (
                f"`{passage.name}` is passed at {math.degrees(heading) % 360.0:.0f} deg, more than "
                f"{math.degrees(limit):.0f} deg away from where its neighbours lie; is its heading or its direction "
                "reversed?"
            )
            yield Remark(passage.name, RemarkKind.AXIS, text)


def _bearing(a: Passage, b: Passage) -> float | None:
    """Return the bearing from place to place, rad; None if one is free or both are the same."""
    start, end = place(a), place(b)
    if start is None or end is None or math.dist(start[:2], end[:2]) < SAME_PLACE:
        return None
    return math.atan2(end[1] - start[1], end[0] - start[0])


def _mistakes(course: Course) -> Iterator[Remark]:
    """Yield remarks on positions and sides that were probably meant otherwise."""
    if swapped_axes(course.passages):
        text = (
            "the headings of the gates fit far better with north and east exchanged; are latitudes and longitudes, or "
            "north and east, mixed up?"
        )
        yield Remark("", RemarkKind.AXIS, text)
    reported: set[str] = set()
    for before, passage, after in zip(course.passages, course.passages[1:], course.passages[2:], strict=False):
        element, start, end = passage.element, place(before), place(after)
        side, at = element.passing_side, element.place
        if side is None or at is None or start is None or end is None or element.name in reported:
            continue
        reported.add(element.name)
        north, east = end[0] - start[0], end[1] - start[1]
        length = math.hypot(north, east)
        if length < SAME_PLACE:
            continue
        along = ((at[0] - start[0]) * north + (at[1] - start[1]) * east) / length**2
        aside = (start[0] + along * north - at[0], start[1] + along * east - at[1])
        margin = aside[0] * math.cos(side) + aside[1] * math.sin(side)
        if 0.0 < along < 1.0 and margin > IDLE_PYLON_DISTANCE:
            text = (
                f"the straight line from `{before.name}` to `{after.name}` passes `{passage.name}` {margin:.0f} m away "
                "on the side that is asked for; is its `pass_side_deg` reversed?"
            )
            yield Remark(passage.name, RemarkKind.AXIS, text)


def swapped_axes(passages: Sequence[Passage]) -> bool:
    """Return whether the gates' headings fit the course much better with north and east exchanged."""
    gains: list[float] = []
    for before, after in itertools.pairwise(passages):
        way = _bearing(before, after)
        for passage in () if way is None else (before, after):
            heading = passage.element.course(passage.direction) if passage.element.directed else None
            if way is not None and heading is not None:
                gains.append(math.cos(angle_between(heading, 0.5 * math.pi - way)) - math.cos(heading - way))
    return len(gains) >= HEADINGS_MIN and sum(gains) / len(gains) > EXCHANGE_GAIN


# The legs.


@dataclass(frozen=True)
class ReviewedLeg:
    """The stretch from one place to the next, straight and by the tightest level turn.

    Attributes:
        before, after: the passages at its ends.
        length: of the straight line over ground, m.
        bearing: of the straight line, rad.
        turn: headings at the ends of the tightest level way, and how much it turns in all, rad; None if none is
            planned.
    """

    before: Passage
    after: Passage
    length: float
    bearing: float
    turn: tuple[float, float, float] | None


def tightest(race: Race) -> PlanningModel:
    """Return the top speed of level flight, and all the load factor that race, aircraft and lift allow there.

    An aircraft that cannot fly level turns at the speed at which it is planned.
    """
    aircraft, rules = race.aircraft, race.course.rules
    V = min(top_speed(aircraft) or cruise(aircraft, rules).V, aircraft.envelope.V.upper)
    lift = 0.5 * AIR_DENSITY * V**2 * aircraft.airframe.S * min(aircraft.lift.C_L_max, rules.C_L.upper)
    n = min(aircraft.envelope.n_z.upper, rules.n_z.upper, lift / (aircraft.airframe.m * g0))
    return PlanningModel(V, max(n, TURN_LOAD_FACTOR_LEAST), 0.5 * min(aircraft.point_mass.p, rules.p))


def legs(race: Race) -> list[ReviewedLeg]:
    """Return all legs whose ends both have a place, in race order; each with the shortest way at the tightest
    pace, all headings chosen together, unless the course is too long to be planned."""
    passages = race.course.passages
    turns: list[tuple[float, float, float] | None] = [None] * (len(passages) - 1)
    for index, leg in enumerate(plan(race.course, tightest(race)).legs if len(passages) <= PLANNED_MAX else ()):
        if leg.path is not None:
            _, _, heading = leg.path.points(np.linspace(0.0, leg.path.length, TURN_SAMPLES))
            turns[index] = float(heading[0]), float(heading[-1]), float(np.abs(np.diff(heading)).sum())
    legs: list[ReviewedLeg] = []
    for (before, after), turn in zip(itertools.pairwise(passages), turns, strict=True):
        start, end = place(before), place(after)
        if start is not None and end is not None:
            north, east = end[0] - start[0], end[1] - start[1]
            legs.append(ReviewedLeg(before, after, math.hypot(north, east), math.atan2(east, north), turn))
    return legs


def _leg_remarks(race: Race) -> Iterator[Remark]:
    """Yield remarks on the legs, of those that are alike on the first."""
    pace, rate = tightest(race), climb_rate(race.aircraft)
    different: dict[object, ReviewedLeg] = {}
    for leg in legs(race):
        ends = [(passage.element.name, passage.direction) for passage in (leg.before, leg.after)]
        different.setdefault((*ends, leg.after.safety_lines), leg)
    for leg in different.values():
        yield from _climb_remarks(leg, race.aircraft, rate)
        yield from _remarks_on_one_place(leg, race.aircraft)
        if pace.n > TURN_LOAD_FACTOR_LEAST:
            yield from _turn_remarks(leg, pace.radius, f"at {pace.V:.0f} m/s and {pace.n:.3g} g")


def _climb_remarks(leg: ReviewedLeg, aircraft: Aircraft, rate: float) -> Iterator[Remark]:
    """Yield remarks on heights that a straight line reaches by no climb which its gates allow, or that neither engine
    nor speed pay for.
    """
    before, after = leg.before.element, leg.after.element
    up, down = after.heights.lower - before.heights.upper, before.heights.lower - after.heights.upper
    from_to = f"from `{leg.before.name}` to `{leg.after.name}`"
    if before.climbs is not None and after.climbs is not None:
        climbs = before.climbs.intersect(after.climbs)
        steepness = math.atan2(max(up, down), leg.length)
        allowed = climbs.upper if up > down else -climbs.lower
        if steepness > max(allowed, 0.0) + 1e-9:
            text = (
                f"the straight line {from_to} {'climbs' if up > down else 'descends'} at {math.degrees(steepness):.0f} "
                f"deg; {math.degrees(allowed):.0f} deg are allowed at these gates"
            )
            yield Remark(leg.after.name, RemarkKind.CLIMB, text)
    V = top_speed(aircraft)
    if not V or not math.isfinite(up):
        return
    engine, speed = rate * leg.length / V, V**2 / (2.0 * g0)
    if up > engine + ENERGY_SHARE * speed:
        text = (
            f"{from_to} {up:.0f} m are to be climbed: on the straight line {aircraft.name} gains {engine:.0f} m by its "
            f"engine, and all of its speed yields {speed:.0f} m"
        )
        yield Remark(leg.after.name, RemarkKind.CLIMB, text)


def climb_rate(aircraft: Aircraft) -> float:
    """Return the best rate of climb at full power, m/s (ISA, sea level); 0 for an aircraft that cannot fly level."""
    propulsion, drag, m, S = aircraft.propulsion, aircraft.drag, aircraft.airframe.m, aircraft.airframe.S
    V = np.linspace(max(aircraft.envelope.V.lower, 1.0), aircraft.envelope.V.upper, 50)
    pressure = 0.5 * AIR_DENSITY * V**2
    C_D = drag.C_D0 + drag.k * (m * g0 / (pressure * S) - drag.C_L_minD) ** 2
    spare = propulsion.eta_p * propulsion.P_max - pressure * S * C_D * V
    return max(0.0, float(spare.max()) / (m * g0))


def _remarks_on_one_place(leg: ReviewedLeg, aircraft: Aircraft) -> Iterator[Remark]:
    """Yield a remark on two elements so close together that one of them may be meant."""
    before, after = leg.before.element, leg.after.element
    across = before.axis is not None and after.axis is not None and abs(math.sin(after.axis - before.axis))
    if before.base_name == after.base_name or across > math.sin(SAME_ELEMENT_ANGLE):
        return  # passed twice on purpose, as a quad is
    slowest = aircraft.envelope.V.lower
    if leg.length < ONE_PLACE:
        text = (
            f"`{leg.after.name}` stands in the same place as `{leg.before.name}`: only a circle or a loop leads from "
            "the one to the other; are they one gate?"
        )
        yield Remark(leg.after.name, RemarkKind.CLOSE, text)
    elif leg.length < SAME_ELEMENT_SECONDS * slowest:
        text = (
            f"`{leg.after.name}` stands {leg.length:.3g} m from `{leg.before.name}`: that takes "
            f"{leg.length / slowest:.2g} s at the slowest; are they one gate?"
        )
        yield Remark(leg.after.name, RemarkKind.CLOSE, text)


def _turn_remarks(leg: ReviewedLeg, radius: float, pace: str) -> Iterator[Remark]:
    """Yield a remark on a turn for which there is no room at a pace; slower, or through space, there may be."""
    if leg.turn is None or leg.length < SAME_PLACE:
        return
    heading, end_heading, turning = leg.turn
    needed = abs(angle_between(leg.bearing, heading)) + abs(angle_between(end_heading, leg.bearing))
    change = abs(angle_between(end_heading, heading))
    chord = 2.0 * radius * math.sin(change / 2.0)
    ends = f"`{leg.after.name}` stands {leg.length:.0f} m from `{leg.before.name}`"
    if turning - needed > LOOP_TURN:
        text = (
            f"{ends}, near for the turn between them: {pace} it has a radius of {radius:.0f} m, "
            f"and the shortest level way goes round by {math.degrees(turning):.0f} deg"
        )
        yield Remark(leg.after.name, RemarkKind.TURN, text)
    elif leg.length < radius and chord > leg.length:
        text = (
            f"{ends}, nearer than a turn radius ({radius:.0f} m {pace}); "
            f"at that pace the level turn of {math.degrees(change):.0f} deg between them takes {chord:.0f} m"
        )
        yield Remark(leg.after.name, RemarkKind.CLOSE, text)
