"""The legs of a course before it is flown: from place to place, straight and by the tightest level turns."""

import itertools
import math
from collections.abc import Iterator

import numpy as np

from airrace.environment.atmosphere import g0
from airrace.planning.plan import plan
from airrace.planning.planning_model import AIR_DENSITY, PlanningModel, top_speed
from airrace.planning.race import Race
from airrace.records import record
from airrace.track.course import Passage

PLANNED_MAX = 400
"""The largest number of passages of a course whose turns are looked at; planning takes about a millisecond each."""
SAMPLES = 65
"""The number of points at which a turn is measured."""
LEAST_LOAD_FACTOR = 1.01
"""The least load factor of the tightest turns, g; with less an aircraft flies straight on, and there is no turn."""


@record
class Turn:
    """The tightest level way between two passages: first and last heading, and how much it turns in all, rad."""

    heading: float
    end_heading: float
    turning: float


@record
class Leg:
    """The stretch from one place to the next.

    Attributes:
        before, after: the passages at its ends.
        start, end: north, east and height of their centres, m; the height is NaN where it is free.
        turn: the tightest level turn from one to the other; None if none is planned.
    """

    before: Passage
    after: Passage
    start: tuple[float, float, float]
    end: tuple[float, float, float]
    turn: Turn | None

    @property
    def length(self) -> float:
        """The length of the straight line over ground, m."""
        return math.hypot(self.end[0] - self.start[0], self.end[1] - self.start[1])

    @property
    def bearing(self) -> float:
        """The bearing of the straight line, rad."""
        return math.atan2(self.end[1] - self.start[1], self.end[0] - self.start[0])


def tightest(race: Race) -> PlanningModel:
    """Return the top speed of level flight, and all the load factor that race, aircraft and lift allow there.

    An aircraft that cannot fly level turns at the speed at which it is planned.
    """
    aircraft, rules = race.aircraft, race.course.rules
    V = min(top_speed(aircraft) or race.pace.V, aircraft.envelope.V.upper)
    lift = 0.5 * AIR_DENSITY * V**2 * aircraft.airframe.S * min(aircraft.lift.C_L_max, rules.C_L.upper)
    n = min(aircraft.envelope.n_z.upper, rules.n_z.upper, lift / (aircraft.airframe.m * g0))
    return PlanningModel(V, max(n, LEAST_LOAD_FACTOR), 0.5 * min(aircraft.point_mass.p, rules.p))


def legs(race: Race) -> list[Leg]:
    """Return all legs whose ends both have a place, in the order flown."""
    passages = race.course.passages
    turns: list[Turn | None] = [None] * (len(passages) - 1)
    if len(passages) <= PLANNED_MAX:
        turns = list(_turns(race))
    found: list[Leg] = []
    for (before, after), turn in zip(itertools.pairwise(passages), turns, strict=True):
        start, end = place(before), place(after)
        if start is not None and end is not None:
            found.append(Leg(before, after, start, end, turn))
    return found


def place(passage: Passage) -> tuple[float, float, float] | None:
    """Return north, east and height (NaN where free) of an element, m; None if it may be anywhere."""
    where, height = passage.element.place, passage.element.nominal_height
    return None if where is None else (*where, math.nan if height is None else height)


def _turns(race: Race) -> Iterator[Turn | None]:
    """Yield the shortest ways at the tightest pace, all headings chosen together; None for a change of attitude."""
    planned = plan(race.course, tightest(race))
    for leg in planned.legs:
        if leg.path is None:
            yield None
            continue
        _, _, heading = leg.path.points(np.linspace(0.0, leg.path.length, SAMPLES))
        yield Turn(float(heading[0]), float(heading[-1]), float(np.abs(np.diff(heading)).sum()))
