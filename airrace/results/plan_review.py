"""Remarks on the line as which a race is planned: where it comes too near to people, lines, borders and pylons.

They are about the very line that pictures of the course show. No picture leads through the zone of a crowd, across a
safety line or out of the airspace without a remark.
"""

from collections.abc import Iterator

import numpy as np

from airrace.planning.clearances import crowd_overflown, ground_distance
from airrace.planning.legs import PLANNED_MAX
from airrace.planning.lint import Kind, Remark
from airrace.results.clearance import Clearance, Distance, least, least_of_all, pylons, surroundings
from airrace.results.flight import Flight
from airrace.results.legs import Leg, legs_of
from airrace.results.near_misses import near_misses
from airrace.results.planned import is_planned

NEARLY = 0.5
"""The distance that rounding to metres would not show, m."""
ZONE = "zone"
"""The kind of the distance over ground from people whose rule counts the height as well."""


def remarks_on_line(planned: Flight) -> list[Remark]:
    """Return all remarks, leg by leg; a leg that is flown several times is remarked on once.

    Args:
        planned: of `planned_flight`.
    """
    known = (*surroundings(planned), *_zones(planned))
    told: dict[object, Remark] = {}
    for leg in legs_of(planned):
        found = {(one.kind, one.name): one for one in least(planned, leg, known)}
        for (kind, name), nearest in found.items():
            words = _words(planned, leg, nearest, found.get(("crowd", name)))
            if words:
                line = "the planned line" if is_planned(planned, leg.rows) else "the straight line"
                text = f"{line} from `{leg.before.name}` to `{leg.after.name}` {words}"
                told.setdefault((*_ends(leg), kind, name), Remark(leg.name, _KINDS[kind], text))
    return [*told.values(), *_on_pylons(planned)]


def plan_clearances(planned: Flight) -> tuple[Clearance, ...]:
    """Return the least distances of a planned flight from its nearest pylon and from everything else in the course.

    The nearest pylon is that with the least margin; courses that are too long to be planned are told without it.
    """
    near = () if len(planned.crossings) > PLANNED_MAX else least_of_all(planned, pylons(planned))
    return (*sorted(near, key=lambda one: one.margin)[:1], *least_of_all(planned, surroundings(planned)))


def _zones(planned: Flight) -> Iterator[Distance]:
    places = np.stack([planned["x"], planned["y"]], axis=1)
    for crowd in planned.course.crowd:
        if crowd.slant:
            yield Distance(ZONE, crowd.name, crowd.distance, ground_distance(places, crowd))


def _ends(leg: Leg) -> tuple[object, ...]:
    """Return what tells a leg from others that are flown in the same way."""
    ends = [(one.passage.element.name, one.passage.direction) for one in (leg.before, leg.after)]
    return *ends, leg.after.passage.safety_lines


def _words(planned: Flight, leg: Leg, nearest: Clearance, crowd: Clearance | None) -> str:
    """Return what is wrong with a least distance on a leg, in words; nothing where it is kept.

    Args:
        planned, leg: the leg of the planned flight.
        nearest: the distance.
        crowd: that from the crowd of this name, as its rule measures it; None if there is no such crowd.
    """
    name, away, required = nearest.name, nearest.distance, nearest.required
    match nearest.kind:
        case "crowd" if nearest.margin < 0.0 and _overflies(planned, leg, name):
            return f"leads over `{name}`; {required:.0f} m are to be kept"
        case "crowd" if nearest.margin < -NEARLY:
            return f"comes within {away:.0f} m of `{name}`; {required:.0f} m are to be kept"
        case "zone" if nearest.margin < -NEARLY and crowd is not None and crowd.margin >= 0.0:
            return f"leads through the zone of `{name}`; only its height keeps it {required:.0f} m away"
        case "safety line" if away < -NEARLY:
            return f"crosses the safety line `{name}` by {-away:.0f} m; the race has to be flown otherwise there"
        case "safety line" if nearest.margin < -NEARLY:
            return f"comes within {away:.0f} m of the safety line `{name}`; {required:.0f} m are to be kept"
        case "airspace" if nearest.margin < -NEARLY:
            return f"leaves the airspace by {-away:.0f} m; the race has to be flown otherwise there"
        case _:
            return ""


def _overflies(planned: Flight, leg: Leg, name: str) -> bool:
    (crowd,) = (one for one in planned.course.crowd if one.name == name)
    return crowd_overflown(np.stack([planned["x"][leg.rows], planned["y"][leg.rows]], axis=1), crowd)


def _on_pylons(planned: Flight) -> Iterator[Remark]:
    """Yield remarks on pylons that stand in the way of legs which do not pass their gate."""
    if len(planned.crossings) > PLANNED_MAX:
        return
    told: set[tuple[str, ...]] = set()
    places = {one.passage.element.name: one.passage.element.place for one in planned.crossings}
    for one in near_misses(planned):
        ends = tuple(end.passage.element.name for end in (one.before, one.after))
        name = one.clearance.name
        if places[name] in (places[end] for end in ends) or (*ends, name) in told:  # of a quad the other gate as well
            continue
        told.add((*ends, name))
        text = (
            f"the planned line from `{one.before.name}` to `{one.after.name}` leads the wing past a pylon of `{name}` "
            f"at {one.clearance.distance:.1f} m; nothing in the course keeps it away from there"
        )
        yield Remark(one.after.name, Kind.PYLON, text)


_KINDS = {
    "crowd": Kind.CROWD,
    ZONE: Kind.CROWD,
    "safety line": Kind.SAFETY_LINE,
    "airspace": Kind.AIRSPACE,
}
"""The kinds of remarks by those of distances."""
