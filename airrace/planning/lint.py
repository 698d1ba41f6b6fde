"""A review of a course before it is flown, as a race director would make it.

It yields remarks, not errors: the course stays valid. What the planned line comes too near to is remarked on by
`airrace.results.plan_review`.
"""

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from enum import Enum

import numpy as np

from airrace.aircraft.aircraft import Aircraft
from airrace.dynamics import handling
from airrace.environment.atmosphere import g0
from airrace.frames import angle_between
from airrace.planning.legs import LEAST_LOAD_FACTOR, Leg, legs, place, tightest
from airrace.planning.plan import ONE_PLACE
from airrace.planning.planning_model import AIR_DENSITY, top_speed
from airrace.planning.race import Race
from airrace.quantities import KNOT, Interval
from airrace.records import record
from airrace.track.course import Course, Direction, Passage

FEWEST = 4
"""The smallest number of headings that tell whether positions fit them."""
BETTER = 0.25
"""The gain by which headings must fit better with north and east exchanged, as a mean cosine. Those of the shipped
courses fit worse by 0.31 at least."""
CLEAR = 20.0
"""The distance from a pylon at which the straight line between its neighbours passes on the side asked for, m. On the
shipped courses it is 17 m at most, and most lines pass on the other side."""


def exchanged_axes(passages: Sequence[Passage]) -> bool:
    """Return whether the gates' headings fit the course much better with north and east exchanged."""
    as_given: list[float] = []
    exchanged: list[float] = []
    for before, after in itertools.pairwise(passages):
        start, end = place(before), place(after)
        if start is None or end is None or math.dist(start[:2], end[:2]) < 1.0:
            continue
        north, east = end[0] - start[0], end[1] - start[1]
        for passage in (before, after):
            heading = passage.element.course(passage.direction) if passage.element.directed else None
            if heading is not None:
                as_given.append(math.cos(angle_between(heading, math.atan2(east, north))))
                exchanged.append(math.cos(angle_between(heading, math.atan2(north, east))))
    if len(as_given) < FEWEST:
        return False
    return (sum(exchanged) - sum(as_given)) / len(as_given) > BETTER


def idle_pylons(passages: Sequence[Passage]) -> Iterator[tuple[Passage, Passage, Passage, float]]:
    """Yield the elements to be passed on one side that nobody has to fly round, pylons for one, once each.

    Yields:
        The passages before, at and after such an element, and by how much the straight line between its neighbours
        passes it on the side that is asked for, m.
    """
    seen: set[str] = set()
    for before, passage, after in zip(passages, passages[1:], passages[2:], strict=False):
        element, start, end = passage.element, place(before), place(after)
        side, at = element.passing_side, element.place
        if side is None or at is None or start is None or end is None or element.name in seen:
            continue
        seen.add(element.name)
        north, east = end[0] - start[0], end[1] - start[1]
        length = math.hypot(north, east)
        if length < 1.0:
            continue
        along = ((at[0] - start[0]) * north + (at[1] - start[1]) * east) / length**2
        aside = (start[0] + along * north - at[0], start[1] + along * east - at[1])
        margin = aside[0] * math.cos(side) + aside[1] * math.sin(side)
        if 0.0 < along < 1.0 and margin > CLEAR:
            yield before, passage, after, margin


NEAR = 0.1
"""The time of flight at the least speed below which two elements may be meant as one, s."""
SAME_DIRECTION = math.radians(30.0)
"""The largest angle between the axes of two elements that may be meant as one, rad; those of a quad stand across."""
LEAST_BAND = 5.0
"""The least room between floor and ceiling that needs no remark, m: the legal heights of a gate span 10 m."""
SHARE_OF_SPEED = 0.5
"""The part of its kinetic energy that an aircraft can give for height (1): what is left has to carry it."""


def one_behind_the_other(leg: Leg, aircraft: Aircraft) -> Iterator[str]:
    """Yield a remark on two elements so close together that one of them may be meant."""
    if _feature(leg.before.element.name) == _feature(leg.after.element.name) or _stand_across(leg):
        return  # passed twice on purpose, as a quad is
    if leg.length < ONE_PLACE:
        yield (
            f"`{leg.after.name}` stands in the same place as `{leg.before.name}`: only a circle or a loop leads from "
            "the one to the other; are they one gate?"
        )
    elif leg.length < NEAR * aircraft.envelope.V.lower:
        yield (
            f"`{leg.after.name}` stands {leg.length:.3g} m from `{leg.before.name}`: that is flown in "
            f"{leg.length / aircraft.envelope.V.lower:.2g} s at the slowest; are they one gate?"
        )


def _feature(name: str) -> str:
    """Return the name of the whole of which an element may be a part: `q` of `q/1`."""
    return name.partition("/")[0]


def _stand_across(leg: Leg) -> bool:
    """Return whether the two elements are passed in different directions."""
    before, after = leg.before.element.axis, leg.after.element.axis
    return before is not None and after is not None and abs(math.sin(after - before)) > math.sin(SAME_DIRECTION)


def narrow_heights(allowed: Interval) -> Iterator[str]:
    """Yield a remark on floor and ceiling between which there is hardly any room."""
    room = allowed.upper - allowed.lower
    if room < LEAST_BAND:
        yield (
            f"there are {room:.3g} m between the floor at {allowed.lower:g} m and the ceiling at {allowed.upper:g} m; "
            "hardly anyone keeps a height so closely"
        )


def climb_beyond_energy(leg: Leg, aircraft: Aircraft) -> Iterator[str]:
    """Yield a remark on a height that neither the engine gains on the way nor the speed is worth."""
    up = leg.after.element.heights.lower - leg.before.element.heights.upper
    V = top_speed(aircraft)
    if not V or not math.isfinite(up):
        return
    engine, speed = climb_rate(aircraft) * leg.length / V, V**2 / (2.0 * g0)
    if up > engine + SHARE_OF_SPEED * speed:
        yield (
            f"from `{leg.before.name}` to `{leg.after.name}` {up:.0f} m are to be climbed: on the way {aircraft.name} "
            f"gains {engine:.0f} m by its engine, and all of its speed is worth {speed:.0f} m"
        )


def climb_rate(aircraft: Aircraft) -> float:
    """Return the best rate of climb at full power, m/s (ISA, sea level); 0 for an aircraft that cannot fly level."""
    propulsion, drag, m, S = aircraft.propulsion, aircraft.drag, aircraft.airframe.m, aircraft.airframe.S
    V = np.linspace(max(aircraft.envelope.V.lower, 1.0), aircraft.envelope.V.upper, 50)
    pressure = 0.5 * AIR_DENSITY * V**2
    C_D = drag.C_D0 + drag.k * (m * g0 / (pressure * S) - drag.C_L_minD) ** 2
    spare = propulsion.eta_p * propulsion.P_max - pressure * S * C_D * V
    return max(0.0, float(spare.max()) / (m * g0))


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
