"""A review of a course before it is flown, as a race director would make it.

It yields remarks, not errors: the course stays valid. What the planned line comes too near to is remarked on by
`airrace.results.plan_review`.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from enum import Enum

from airrace.dynamics import handling
from airrace.frames import angle_between
from airrace.planning.extremes import climb_beyond_energy, narrow_heights, one_behind_the_other
from airrace.planning.legs import LEAST_LOAD_FACTOR, Leg, legs, place, tightest
from airrace.planning.planning_model import top_speed
from airrace.planning.race import Race
from airrace.planning.swapped_inputs import exchanged_axes, idle_pylons
from airrace.quantities import KNOT, Interval
from airrace.records import record
from airrace.track.course import Course, Direction, Passage

WIND_MAX = 30.0 * KNOT  # race rules 2014-2019: no race in more wind
LOOP = math.pi  # a way that turns by this much more than straight lines do goes round a loop
SAME_PLACE = 1.0  # m: passings of one spot, as of a quad, are meant to be flown round a loop
ASIDE = math.radians(90.0)  # a gate that points further away from both of its neighbours is flown the wrong way
BACK = math.radians(135.0)  # likewise a start or finish, which has but one


class Kind(Enum):
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
    AIRSPACE = "airspace"
    ELEMENT = "element"

    @classmethod
    def of(cls, subject: str) -> "Kind":
        """Return the kind of a remark that an element makes about itself."""
        return cls(subject) if any(subject == one.value for one in cls) else cls.ELEMENT


@record
class Remark:
    """A remark of one sentence about a course.

    Attributes:
        passage: the name of the passage concerned, or of the one to which the leg concerned leads; empty where it is
            the race as a whole.
        text: the sentence, without a full stop.
    """

    passage: str
    kind: Kind
    text: str


def review(race: Race) -> list[Remark]:
    """Return all remarks: on the race as a whole, on the elements, on the legs.

    There is one for every place, however often it is flown.
    """
    aircraft = [Remark("", Kind.AIRCRAFT, text) for text in (*handling.remarks(race.aircraft), *_too_weak(race))]
    found = [*aircraft, *_on_race(race), *_on_elements(race), *_on_legs(race)]
    return in_order(found, race.course)


def in_order(remarks: Iterable[Remark], course: Course) -> list[Remark]:
    """Return remarks in the order of the race, first those on the race as a whole."""
    order = {passage.name: number for number, passage in enumerate(course.passages)}
    return sorted(remarks, key=lambda remark: order.get(remark.passage, -1))


def _too_weak(race: Race) -> Iterator[str]:
    if not top_speed(race.aircraft):
        yield f"{race.aircraft.name} cannot fly level: its power balances the drag of carrying its weight at no speed"


def _on_race(race: Race) -> Iterator[Remark]:
    wind = race.air.wind
    if wind is not None and wind.speed > WIND_MAX + 1e-9:
        yield Remark("", Kind.WIND, f"the wind blows at {wind.speed / KNOT:.0f} kt; races are flown in 30 kt at most")
    allowed, able = race.course.rules.n_z, race.aircraft.envelope.n_z
    for limit, own, beyond in ((allowed.upper, able.upper, 1.0), (allowed.lower, able.lower, -1.0)):
        if beyond * (limit - own) > 1e-9 and math.isfinite(limit):
            text = f"the race allows {limit:g} g, but {race.aircraft.name} no more than {own:g} g"
            yield Remark("", Kind.LOAD_FACTOR, text)
    yield from _on_start(race)


def _on_start(race: Race) -> Iterator[Remark]:
    start = race.course.passages[0]
    fastest, limit = top_speed(race.aircraft), start.speed.upper
    if limit > fastest > 0.0:
        reached = f"{race.aircraft.name} reaches {fastest / KNOT:.0f} kt in level flight"
        if math.isfinite(limit):
            text = f"the start speed limit of {limit / KNOT:.0f} kt at `{start.name}` limits nothing: {reached}"
            yield Remark(start.name, Kind.START_SPEED, text)
        elif start.element.stands:  # a course that begins in the air has no start with a speed limit
            text = f"no speed limit holds at the start `{start.name}` (`rules.start_speed_max_kt`): {reached}"
            yield Remark(start.name, Kind.START_SPEED, text)


def _on_elements(race: Race) -> Iterator[Remark]:
    seen: set[str] = set()
    for passage in race.course.passages:
        if passage.element.name not in seen:
            seen.add(passage.element.name)
            for subject, text in passage.element.remarks(passage.name):
                yield Remark(passage.name, Kind.of(subject), text)
            yield from _on_ceiling(passage, race.course.rules.height)
    for text in narrow_heights(race.course.rules.height):
        yield Remark("", Kind.CEILING, text)
    yield from _on_axes(race.course)
    yield from _on_slips(race.course)


def _on_slips(course: Course) -> Iterator[Remark]:
    """Yield remarks on positions and sides that were probably meant otherwise."""
    if exchanged_axes(course.passages):
        text = (
            "the headings of the gates fit far better with north and east exchanged; are latitudes and longitudes, or "
            "north and east, mixed up?"
        )
        yield Remark("", Kind.AXIS, text)
    for before, passage, after, margin in idle_pylons(course.passages):
        text = (
            f"nothing has to be flown round `{passage.name}`: the straight line from `{before.name}` to `{after.name}` "
            f"passes it {margin:.0f} m away on the side that is asked for; is its `pass_side_deg` reversed?"
        )
        yield Remark(passage.name, Kind.AXIS, text)


def _on_ceiling(passage: Passage, allowed: Interval) -> Iterator[Remark]:
    element = passage.element
    if element.heights.lower > allowed.upper:
        text = f"`{passage.name}` asks for {element.heights.lower:.0f} m; the ceiling is at {allowed.upper:.0f} m"
        yield Remark(passage.name, Kind.CEILING, text)
    elif element.heights.upper < allowed.lower:
        text = f"`{passage.name}` allows {element.heights.upper:.0f} m at most; the floor is at {allowed.lower:.0f} m"
        yield Remark(passage.name, Kind.CEILING, text)
    elif passage.roll is not None and allowed.lower + passage.roll.gain > allowed.upper:
        room = f"there are {allowed.upper - allowed.lower:.0f} m between floor and ceiling"
        text = f"the roll at `{passage.name}` gains {passage.roll.gain:.0f} m; {room}"
        yield Remark(passage.name, Kind.CEILING, text)


def _on_axes(course: Course) -> Iterator[Remark]:
    """Yield remarks on gates flown against the way the course comes and goes."""
    seen: set[tuple[str, Direction]] = set()
    around = zip([None, *course.passages], course.passages, [*course.passages[1:], None], strict=False)
    for before, passage, after in around:
        key = (passage.element.name, passage.direction)
        heading = passage.element.course(passage.direction)
        if not passage.element.directed or heading is None or key in seen:
            continue
        ways = [_bearing(a, b) for a, b in ((before, passage), (passage, after)) if a is not None and b is not None]
        limit = ASIDE if len(ways) == 2 else BACK
        against = [abs(angle_between(heading, way)) > limit + 1e-9 for way in ways if way is not None]
        if len(against) == len(ways) and all(against):
            seen.add(key)
            text = (
                f"`{passage.name}` is flown at {_compass(heading)} deg, more than {math.degrees(limit):.0f} deg away "
                "from where its neighbours lie; is its heading or its direction reversed?"
            )
            yield Remark(passage.name, Kind.AXIS, text)


def _bearing(a: Passage, b: Passage) -> float | None:
    """Return the bearing from place to place, rad; None if one is free or both are the same."""
    start, end = place(a), place(b)
    if start is None or end is None or math.dist(start[:2], end[:2]) < SAME_PLACE:
        return None
    return math.atan2(end[1] - start[1], end[0] - start[0])


def _on_legs(race: Race) -> Iterator[Remark]:
    flown = _different(legs(race))
    pace = tightest(race)
    for leg in flown:
        yield from _on_climb(leg)
        for text in climb_beyond_energy(leg, race.aircraft):
            yield Remark(leg.after.name, Kind.CLIMB, text)
        for text in one_behind_the_other(leg, race.aircraft):
            yield Remark(leg.after.name, Kind.CLOSE, text)
        if pace.n > LEAST_LOAD_FACTOR:
            yield from _on_turn(leg, pace.radius, f"at {pace.V:.0f} m/s and {pace.n:.3g} g")


def _different(flown: Sequence[Leg]) -> list[Leg]:
    """Return the legs without those flown before in the same way."""
    first: dict[object, Leg] = {}
    for leg in flown:
        ends = [(one.element.name, one.direction) for one in (leg.before, leg.after)]
        first.setdefault((*ends, leg.after.safety_lines), leg)
    return list(first.values())


def _on_climb(leg: Leg) -> Iterator[Remark]:
    """Yield a remark on heights that the climb allowed at the gates does not reach."""
    heights: list[Interval] = []
    climbs = Interval()
    for passage in (leg.before, leg.after):
        if passage.element.climbs is None:
            return
        heights.append(passage.element.heights)
        climbs = climbs.intersect(passage.element.climbs)
    up, down = heights[1].lower - heights[0].upper, heights[0].lower - heights[1].upper
    steepness = math.atan2(max(up, down), leg.length)
    allowed = climbs.upper if up > down else -climbs.lower
    if steepness > max(allowed, 0.0) + 1e-9:
        word = "climb" if up > down else "descent"
        text = (
            f"from `{leg.before.name}` to `{leg.after.name}` a {word} of {math.degrees(steepness):.0f} deg is needed; "
            f"{math.degrees(allowed):.0f} deg are allowed at these gates"
        )
        yield Remark(leg.after.name, Kind.CLIMB, text)


def _on_turn(leg: Leg, radius: float, pace: str) -> Iterator[Remark]:
    """Yield a remark on a turn for which there is no room."""
    if leg.turn is None or leg.length < SAME_PLACE:
        return
    bearing, turn = leg.bearing, leg.turn
    needed = abs(angle_between(bearing, turn.heading)) + abs(angle_between(turn.end_heading, bearing))
    change = abs(angle_between(turn.end_heading, turn.heading))
    chord = 2.0 * radius * math.sin(change / 2.0)
    ends = f"`{leg.after.name}` stands {leg.length:.0f} m from `{leg.before.name}`"
    if turn.turning - needed > LOOP:
        text = (
            f"{ends}, too near for the turn between them: {pace} it has a radius of {radius:.0f} m, "
            f"and the shortest level way goes round by {math.degrees(turn.turning):.0f} deg"
        )
        yield Remark(leg.after.name, Kind.TURN, text)
    elif leg.length < radius and chord > leg.length:
        text = (
            f"{ends}, nearer than a turn radius ({radius:.0f} m {pace}); "
            f"the turn of {math.degrees(change):.0f} deg between them needs {chord:.0f} m"
        )
        yield Remark(leg.after.name, Kind.CLOSE, text)


def _compass(angle: float) -> str:
    return f"{math.degrees(angle) % 360.0:.0f}"
