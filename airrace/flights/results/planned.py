"""The flight as which a race is planned, before anything is optimised: what `check` draws, measures and warns of.

A level leg follows its path in the plan from which an optimisation starts, at the pace of the plan and banked as the
curvature demands. Of a leg on which the attitude changes, as on the way to a manoeuvre, the plan knows no way through
space: the flight is a straight line over ground from the last known place to the next one, and its height and attitude
are NaN. All legs of a course that is too long to be planned are such lines.

The remarks are about the very line that pictures of the course show. No picture leads through the zone of a crowd,
across a safety line or out of the airspace without a remark.
"""

import itertools
import math
from collections.abc import Iterator

import numpy as np

from airrace.flights.results.clearances import (
    Clearance,
    Distance,
    least,
    least_of_all,
    near_misses,
    nearest_pylon,
    pylons,
    surroundings,
)
from airrace.flights.results.flight import GLOSSARY, Basis, Flight, History, Leg, Source, TimedCrossing, legs_of
from airrace.model.dynamics.point_mass import PointMassState
from airrace.model.frames import QUATERNION
from airrace.model.track.course import ClearanceRule
from airrace.optimal_control.trajectory import Array
from airrace.procedure.guess import FIRST_MESH, guess, leg_seconds
from airrace.procedure.planning.clearance import crowd_overflown, ground_distance
from airrace.procedure.planning.lint import Remark, RemarkKind
from airrace.procedure.planning.plan import plan_race
from airrace.procedure.planning.planning_model import cruise
from airrace.procedure.planning.route_decisions import PLANNED_MAX, place
from airrace.race import Race

LONGEST_STEP = 0.02
"""The longest time between two samples, s: two metres of way."""
PLANNED = "planned, not optimised"
"""The remark of the source of a planned flight."""
ROUNDING = 0.5
"""The distance that rounding to metres would not show, m."""
ZONE = "zone"
"""The kind of the distance over ground from people whose rule counts the height as well."""

_NAMES = ("x", "y", "height", *QUATERNION)
_DECLARATIONS = {**{quantity.name: quantity for quantity in PointMassState.quantities()}, **GLOSSARY}
_KINDS = {
    "crowd": RemarkKind.CROWD,
    ZONE: RemarkKind.CROWD,
    "safety line": RemarkKind.SAFETY_LINE,
    "airspace": RemarkKind.AIRSPACE,
}


def planned_flight(race: Race) -> Flight:
    """Return the plan of a race as a flight with `x`, `y`, `height` and the attitude of its path.

    Args:
        race: course, aircraft and air.
    """
    seconds, legs = _planned_legs(race) if len(race.course.passages) <= PLANNED_MAX else _straight_legs(race)
    for before, after in itertools.pairwise(legs):  # at a common node what is known on either side
        after[:, 0] = np.where(np.isnan(after[:, 0]), before[:, -1], after[:, 0])
    columns = np.hstack([*(leg[:, :-1] for leg in legs), legs[-1][:, -1:]])
    nodes = list(itertools.accumulate((leg.shape[1] - 1 for leg in legs), initial=0))
    starts = list(itertools.accumulate(seconds, initial=0.0))
    time = np.interp(np.arange(columns.shape[1], dtype=np.float64), nodes, starts)
    for values in columns[:2]:  # gaps between known places are bridged; NaN before the first and after the last stay
        finite = np.isfinite(values)
        if finite.any():
            values[~finite] = np.interp(time[~finite], time[finite], values[finite], left=math.nan, right=math.nan)
    histories = {
        name: History(_DECLARATIONS[name], values, Basis.DERIVED) for name, values in zip(_NAMES, columns, strict=True)
    }
    crossings: list[TimedCrossing] = []
    for passage, node in zip(race.course.passages, nodes, strict=True):
        values = {name: float(history.values[node]) for name, history in histories.items()}
        crossings.append(TimedCrossing(passage, float(time[node]), values))
    return Flight(race, Source("plan", remark=PLANNED), time, histories, tuple(crossings))


def is_planned(flight: Flight, rows: np.ndarray) -> bool:
    """Return whether a planned flight knows its way through space at all of some times, rather than a straight line."""
    return bool(np.isfinite(flight["height"][rows]).all())


def _planned_legs(race: Race) -> tuple[list[float], list[Array]]:
    """Return the duration of every leg, s, and its histories `_NAMES` at even times, shape (7, k + 1)."""
    plan = plan_race(race)
    seconds = leg_seconds(plan)
    mesh = [(1.0 / count,) * count for count in _counts(seconds, LONGEST_STEP)]
    state = dict(zip(PointMassState.names(), guess(plan, mesh).state, strict=False))  # a counter of rolls may follow
    rows = np.stack([state["x"], state["y"], -state["z"], *(state[name] for name in QUATERNION)])
    nodes = itertools.accumulate(map(len, mesh), initial=0)
    legs = [rows[:, first : last + 1].copy() for first, last in itertools.pairwise(nodes)]
    for leg, part, *ends in zip(legs, plan.legs, plan.waypoints, plan.waypoints[1:], strict=False):
        if part.path is None:
            leg[:] = math.nan
            for column, waypoint in zip((0, -1), ends, strict=True):
                if waypoint.position is not None:
                    leg[:2, column] = waypoint.position[:2]
    return seconds, legs


def _straight_legs(race: Race) -> tuple[list[float], list[Array]]:
    """Return what `_planned_legs` does for a course of which only the places of its elements are known."""
    places = [(math.nan, math.nan) if (at := place(passage)) is None else at[:2] for passage in race.course.passages]
    ways = [math.dist(*ends) for ends in itertools.pairwise(places)]
    V = cruise(race.aircraft, race.course.rules).V
    # of an unknown way, NaN, the maximum is its first argument
    seconds = [max(FIRST_MESH.shortest_leg, way / V) for way in ways]
    legs: list[Array] = []
    # In 0.2 s an aircraft flies twenty metres of a straight line.
    for count, (start, end) in zip(_counts(seconds, 0.2), itertools.pairwise(places), strict=True):
        leg = np.full((len(_NAMES), count + 1), math.nan)
        leg[:2, 0], leg[:2, -1] = start, end
        legs.append(leg)
    return seconds, legs


def _counts(seconds: list[float], step: float) -> list[int]:
    return [max(math.ceil(duration / step), 2) for duration in seconds]


# What the line comes near to.


def plan_clearances(planned: Flight) -> tuple[Clearance, ...]:
    """Return the least distances of a planned flight from its nearest pylon and from everything else in the course.

    The nearest pylon is that with the least margin; there is none, and no obstacle, for courses that are too long to be
    planned.
    """
    near_pylons = () if len(planned.crossings) > PLANNED_MAX else pylons(planned)
    return nearest_pylon(least_of_all(planned, (*near_pylons, *surroundings(planned))))


def remarks_on_line(planned: Flight) -> list[Remark]:
    """Return all remarks, leg by leg; a leg that occurs several times is remarked on once.

    Args:
        planned: of `planned_flight`.
    """
    places = np.stack([planned["x"], planned["y"]], axis=1)
    zones = [
        Distance(ZONE, crowd.name, crowd.distance, ground_distance(places, crowd))
        for crowd in planned.course.crowd
        if crowd.slant
    ]
    measured = (*surroundings(planned), *zones)
    remarks: dict[object, Remark] = {}
    for leg in legs_of(planned):
        ends = [(crossing.passage.element.name, crossing.passage.direction) for crossing in (leg.before, leg.after)]
        nearest_by_name = {(clearance.kind, clearance.name): clearance for clearance in least(planned, leg, measured)}
        for (kind, name), nearest in nearest_by_name.items():
            words = _describe(planned, leg, nearest, nearest_by_name.get(("crowd", name)))
            if words:
                line = "the planned line" if is_planned(planned, leg.rows) else "the straight line"
                text = f"{line} from `{leg.before.name}` to `{leg.after.name}` {words}"
                key = (*ends, leg.after.passage.safety_lines, kind, name)
                remarks.setdefault(key, Remark(leg.name, _KINDS[kind], text))
    return [*remarks.values(), *_pylon_remarks(planned)]


def _describe(planned: Flight, leg: Leg, nearest: Clearance, crowd: Clearance | None) -> str:
    """Return what is wrong with a least distance on a leg, in words; nothing where it holds.

    Args:
        planned, leg: the leg of the planned flight.
        nearest: the distance.
        crowd: that from the crowd of this name, as its rule measures it; None if there is no such crowd.
    """
    name, away, required = nearest.name, nearest.distance, nearest.required
    is_near = nearest.margin < -ROUNDING
    match nearest.kind:
        case "crowd" if nearest.margin < 0.0 and _overflies(planned, leg, name):
            return f"leads over `{name}`; {required:.0f} m are required"
        case "crowd" if is_near:
            return f"comes within {away:.0f} m of `{name}`; {required:.0f} m are required"
        case "zone" if is_near and crowd is not None and crowd.margin >= 0.0:
            return f"leads through the zone of `{name}`; only its height keeps it {required:.0f} m away"
        case "safety line" if away < -ROUNDING:
            return f"crosses the safety line `{name}` by {-away:.0f} m; the race needs another route there"
        case "safety line" if is_near:
            return f"comes within {away:.0f} m of the safety line `{name}`; {required:.0f} m are required"
        case "airspace" if is_near:
            return f"leaves the airspace by {-away:.0f} m; the race needs another route there"
        case _:
            return ""


def _overflies(planned: Flight, leg: Leg, name: str) -> bool:
    (crowd,) = (people for people in planned.course.crowd if people.name == name)
    return crowd_overflown(np.stack([planned["x"][leg.rows], planned["y"][leg.rows]], axis=1), crowd)


def _pylon_remarks(planned: Flight) -> Iterator[Remark]:
    """Yield remarks on pylons that stand in the way of legs which do not pass their gate."""
    if len(planned.crossings) > PLANNED_MAX:
        return
    seen: set[tuple[str, ...]] = set()
    always = planned.course.rules.clearance is ClearanceRule.FLIGHT
    places = {crossing.passage.element.name: crossing.passage.element.place for crossing in planned.crossings}
    for near_miss in near_misses(planned):
        clearance, before, after = near_miss.clearance, near_miss.before, near_miss.after
        name, ends = clearance.name, (before.passage.element.name, after.passage.element.name)
        if clearance.kind == "obstacle":
            text = f"the planned line from `{before.name}` to `{after.name}` leads the wing "
            text += f"{clearance.distance:.1f} m past" if clearance.distance > 0.0 else "through"
            yield Remark(
                after.name,
                RemarkKind.OBSTACLE,
                f"{text} the obstacle `{name}`; {clearance.required:.0f} m are required",
            )
            continue
        if places[name] in (places[end] for end in ends) or (*ends, name) in seen:  # of a quad the other gate as well
            continue
        seen.add((*ends, name))
        rule = f"{clearance.required:g} m are required" if always else "no rule keeps it away from there"
        text = (
            f"the planned line from `{before.name}` to `{after.name}` leads the wing past a pylon of `{name}` "
            f"at {clearance.distance:.1f} m; {rule}"
        )
        yield Remark(after.name, RemarkKind.PYLON, text)
