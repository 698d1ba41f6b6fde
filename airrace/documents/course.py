"""From a track file's `course` and `rules` to the course: every passing in the order flown, and the limits between."""

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

from airrace.documents.elements import build_elements
from airrace.documents.nodes import KeyPath, Reporter
from airrace.documents.schema import suggestion
from airrace.documents.track_schema import CourseEntry, OriginEntry, RulesEntry, TrackEntry
from airrace.documents.units import KNOT, interval, interval_deg, radians_or_none
from airrace.quantities import Interval
from airrace.track.course import Course, Direction, Origin, Passage, Rules
from airrace.track.gates import Element, Gate, Manoeuvre, Passing

PASSAGES_MAX = 1000


def build_course(entry: TrackEntry, reporter: Reporter) -> Course:
    """The course of a track file; it is only of use if nothing was reported."""
    rules = _rules(entry.rules, reporter)
    known = build_elements(entry.gates, entry.gate_defaults, reporter)
    for element in known.values():
        _check_airspace(element, rules.height, reporter)
    passages = _passages(entry, known, reporter)
    return Course(name=entry.name, passages=passages, rules=rules, origin=_origin(entry.origin))


def _origin(entry: OriginEntry) -> Origin:
    return Origin(
        latitude=radians_or_none(entry.latitude_deg),
        longitude=radians_or_none(entry.longitude_deg),
        elevation=entry.elevation_m,
    )


def _rules(entry: RulesEntry, reporter: Reporter) -> Rules:
    rules = Rules(
        n_z=Interval(entry.n_z_min, entry.n_z_max),
        alpha_A=interval_deg(entry.alpha_min_deg, entry.alpha_max_deg),
        C_L=interval(None, entry.C_L_max),
        p=math.inf if entry.roll_rate_max_deg_s is None else math.radians(entry.roll_rate_max_deg_s),
        beta_A=math.inf if entry.sideslip_max_deg is None else math.radians(entry.sideslip_max_deg),
        height=interval(entry.floor_m, entry.ceiling_m),
    )
    if rules.alpha_A.empty:
        reporter.value(("rules", "alpha_min_deg"), f"must not exceed `alpha_max_deg`, {entry.alpha_max_deg:g}")
    if rules.height.empty:
        reporter.value(("rules", "ceiling_m"), f"must be above the floor of {entry.floor_m:g} m")
    return rules


def _check_airspace(element: Element, airspace: Interval, reporter: Reporter) -> None:
    """An element must be reachable between floor and ceiling."""
    heights = element.height if isinstance(element, Manoeuvre) else _heights(element)
    if not airspace.empty and not heights.empty and heights.intersect(airspace).empty:
        reporter.value(
            ("gates", element.name, "height_m"),
            f"lies at {_range(heights)}, outside of the flown heights of {_range(airspace)} (rules: floor, ceiling)",
        )


def _heights(element: Element) -> Interval:
    if isinstance(element, Manoeuvre):
        return element.height
    return Interval.exactly(element.height) if element.passing is Passing.POINT else element.tolerances.height


def _range(heights: Interval) -> str:
    if heights.lower == heights.upper:
        return f"{heights.lower:g} m"
    return f"{heights.lower:g} to {heights.upper:g} m"


@dataclass(frozen=True)
class _Flown:
    """One passing as the file asks for it; `path` and `direction_path` are where it does."""

    path: KeyPath
    direction_path: KeyPath
    lap: int
    gate: str
    direction: str | None


def _flown(entry: CourseEntry) -> Iterator[_Flown]:
    """Start, laps, finish in the order flown."""
    yield _Flown(("course", "start"), ("course", "start_direction"), 0, entry.start, entry.start_direction)
    for lap in range(1, entry.laps + 1):
        for index, item in enumerate(entry.lap):
            path: KeyPath = ("course", "lap", index)
            yield _Flown(path, (*path, "direction"), lap, item.gate, item.direction)
    if entry.finish:
        path = ("course", "finish")
        yield _Flown(path, (*path, "direction"), entry.laps, entry.finish.gate, entry.finish.direction)


def _passages(entry: TrackEntry, known: dict[str, Element], reporter: Reporter) -> tuple[Passage, ...]:
    total = entry.course.laps * len(entry.course.lap)
    if total > PASSAGES_MAX:
        reporter.value(("course", "laps"), f"{total} passings are too many; at most {PASSAGES_MAX}")
        return ()
    passages: list[Passage] = []
    seen: Counter[str] = Counter()
    remarked: set[KeyPath] = set()  # a remark on the lap holds for all laps
    previous = ""
    for flown in _flown(entry.course):
        fault = _fault(flown, previous, known)
        if fault and flown.path not in remarked:
            remarked.add(flown.path)
            reporter.value(*fault)
        previous = flown.gate
        if flown.gate in known:
            passages.append(_passage(flown, known[flown.gate], entry.rules, seen))
    return tuple(passages)


def _fault(flown: _Flown, previous: str, known: dict[str, Element]) -> tuple[KeyPath, str] | None:
    if flown.gate not in known:
        return flown.path, f"unknown gate `{flown.gate}`{suggestion(flown.gate, known)}"
    element = known[flown.gate]
    if flown.lap == 0 and isinstance(element, Manoeuvre) and element.position is None:
        return (
            flown.path,
            f"a race must start somewhere: `{flown.gate}` needs north_m, east_m and height_m, or be a gate",
        )
    if flown.direction is not None and not isinstance(element, Gate):
        return flown.direction_path, f"only two-pylon gates have a direction; `{flown.gate}` is none, leave it out"
    if flown.gate == previous:
        return flown.path, f"`{flown.gate}` is passed twice in a row; another element must come between"
    return None


def _passage(flown: _Flown, element: Element, rules: RulesEntry, seen: Counter[str]) -> Passage:
    name = f"{flown.lap}:{flown.gate}"
    seen[name] += 1
    is_start = flown.lap == 0
    limit = rules.start_speed_max_kt
    return Passage(
        name=name if seen[name] == 1 else f"{name}#{seen[name]}",
        lap=max(flown.lap, 1),  # the start opens the first lap
        element=element,
        direction=Direction(flown.direction or "forward"),
        speed=Interval(upper=limit * KNOT) if is_start and limit is not None else Interval(),
    )
