"""The flight as which a race is planned, before anything is optimised: what `check` draws, measures and warns of.

A level leg follows its path in the plan from which an optimisation starts, at the pace of the plan and banked as the
curvature demands. Of a leg on which the attitude changes, as on the way to a manoeuvre, the plan knows no way through
space: the flight is a straight line over ground from the last known place to the next one, and its height and attitude
are NaN. All legs of a course that is too long to be planned are such lines.
"""

import itertools
import math

import numpy as np

from airrace.dynamics.outer_loop import ATTITUDE
from airrace.dynamics.point_mass import PointMassState
from airrace.planning.legs import PLANNED_MAX, place
from airrace.planning.race import Race
from airrace.procedure.guess import SHORTEST_LEG, guess, leg_seconds
from airrace.quantities import Quantity
from airrace.results.flight import BODY_ATTITUDE, GLOSSARY, Basis, Crossing, Flight, History, Source
from airrace.trajectory import Array

LONGEST_STEP = 0.02
"""The longest time between two samples, s: two metres of way."""
COARSE_STEP = 0.2
"""The longest time between two samples of a course too long to be planned, s: twenty metres of a straight line."""
PLANNED = "planned, not optimised"
"""The remark of the source of a planned flight."""

_NAMES = ("x", "y", "height", *BODY_ATTITUDE)


def planned_flight(race: Race) -> Flight:
    """Return the plan of a race as a flight with `x`, `y`, `height` and the attitude of the body.

    Args:
        race: course, aircraft and air.
    """
    if len(race.course.passages) <= PLANNED_MAX:
        seconds, legs = _planned(race)
    else:
        seconds, legs = _straight(race)
    columns = _joined(legs)
    nodes = list(itertools.accumulate((leg.shape[1] - 1 for leg in legs), initial=0))
    starts = list(itertools.accumulate(seconds, initial=0.0))
    time = np.interp(np.arange(columns.shape[1], dtype=np.float64), nodes, starts)
    for row in (0, 1):
        _bridge(time, columns[row])
    histories = {
        name: History(GLOSSARY.get(name, Quantity(name, "m")), values, Basis.DERIVED)
        for name, values in zip(_NAMES, columns, strict=True)
    }
    crossings = tuple(
        Crossing(passage, float(time[node]), {name: float(one.values[node]) for name, one in histories.items()})
        for passage, node in zip(race.course.passages, nodes, strict=True)
    )
    return Flight(race, Source("plan", remark=PLANNED), time, histories, crossings)


def is_planned(flight: Flight, rows: np.ndarray) -> bool:
    """Return whether a planned flight knows its way through space at all of some times, rather than a straight line."""
    return bool(np.isfinite(flight["height"][rows]).all())


def _planned(race: Race) -> tuple[list[float], list[Array]]:
    """Return the duration of every leg, s, and its histories `_NAMES` at even times, shape (7, k + 1)."""
    plan = race.plan
    seconds = leg_seconds(plan)
    mesh = [(1.0 / count,) * count for count in _counts(seconds, LONGEST_STEP)]
    names = [one.name for one in PointMassState.quantities()]
    state = dict(zip(names, guess(plan, mesh).state, strict=False))  # a counter of rolls may follow
    rows = np.stack([state["x"], state["y"], -state["z"], *(state[name] for name in ATTITUDE)])
    nodes = np.concatenate([[0], np.cumsum([len(fractions) for fractions in mesh])])
    legs = [rows[:, first : last + 1].copy() for first, last in itertools.pairwise(nodes.tolist())]
    for leg, part, here, there in zip(legs, plan.legs, plan.waypoints, plan.waypoints[1:], strict=False):
        if part.path is None:
            leg[:] = math.nan
            for column, waypoint in ((0, here), (-1, there)):
                if waypoint.position is not None:
                    leg[:2, column] = waypoint.position[:2]
    return seconds, legs


def _straight(race: Race) -> tuple[list[float], list[Array]]:
    """Return what `_planned` does for a course of which only the places of its elements are known."""
    places = [(math.nan, math.nan) if (at := place(one)) is None else at[:2] for one in race.course.passages]
    ways = [math.dist(*ends) for ends in itertools.pairwise(places)]
    seconds = [max(way / race.pace.V, SHORTEST_LEG) if math.isfinite(way) else SHORTEST_LEG for way in ways]
    legs: list[Array] = []
    for count, (start, end) in zip(_counts(seconds, COARSE_STEP), itertools.pairwise(places), strict=True):
        leg = np.full((len(_NAMES), count + 1), math.nan)
        leg[:2, 0], leg[:2, -1] = start, end
        legs.append(leg)
    return seconds, legs


def _counts(seconds: list[float], step: float) -> list[int]:
    return [max(math.ceil(one / step), 2) for one in seconds]


def _joined(legs: list[Array]) -> Array:
    """Return the legs one after the other; at a common node what is known on either side."""
    for before, after in itertools.pairwise(legs):
        after[:, 0] = np.where(np.isnan(after[:, 0]), before[:, -1], after[:, 0])
    return np.hstack([*(leg[:, :-1] for leg in legs), legs[-1][:, -1:]])


def _bridge(time: Array, values: Array) -> None:
    """Fill gaps between known values in place, evenly over time; NaN before the first and after the last one stay."""
    known = np.isfinite(values)
    if known.any():
        values[~known] = np.interp(time[~known], time[known], values[known], left=math.nan, right=math.nan)
