"""The relaxable parameters of gates, pylons and manoeuvres: what their passing tolerates."""

import dataclasses
import math
from collections.abc import Callable, Iterator

from airrace.planning.race import Race
from airrace.procedure.infeasibility.relaxable import RelaxableParameter
from airrace.quantities import Interval
from airrace.track.course import Course, Passage
from airrace.track.element import Element
from airrace.track.gates import Gate, Manoeuvre, Passing, Pylon, Tolerances

STEEPEST, MOST_CROSSING, MOST_BANK = 85.0, 85.0, 89.0
"""The largest angles to which a climb, a crossing and a tolerance of bank are relaxed, deg."""
MOST_AT_QUADS = 40.0
"""The largest angle of crossing that the track language allows at a quad, deg."""
HIGHEST = 5000.0
"""The largest height that the track language knows, m."""


def base_name(element: Element) -> str:
    """Return the key of the entry of `gates` that an element belongs to: `q` of `q/1`."""
    return element.name.partition("/")[0]


def gate_parameters(course: Course) -> Iterator[RelaxableParameter]:
    """Yield the relaxable parameters of all entries of `gates`, in the order in which they are first passed."""
    seen: dict[str, Element] = {}
    for passage in course.passages:
        seen.setdefault(base_name(passage.element), passage.element)
    for name, element in seen.items():
        match element:
            case Gate() | Pylon():
                yield from _tolerances(name, element)
            case Manoeuvre():
                yield from _manoeuvre(name, element)
            case _:
                continue


Setting = Callable[[Tolerances, float], Tolerances]
"""A function that sets one number of what is tolerated, in the user's unit."""


def _tolerances(name: str, element: Gate | Pylon) -> Iterator[RelaxableParameter]:
    """Yield the relaxable parameters of what a passing by the rules tolerates."""
    allowed = element.tolerances
    lowest = min(allowed.height.lower, 0.0)
    most_crossing = MOST_AT_QUADS if "/" in element.name else MOST_CROSSING

    def relaxable(
        key: str, text: str, unit: str, value: float, step: float, digit: float, furthest: float, setting: Setting
    ) -> RelaxableParameter:
        def changed(race: Race, value: float) -> Race:
            return _tolerating(race, name, lambda was: setting(was, value))

        return RelaxableParameter(f"gates.{name}.{key}", text, name, unit, value, step, digit, furthest, changed)

    def angle(key: str, text: str, at: float, step: float, furthest: float, setting: Setting) -> RelaxableParameter:
        return relaxable(key, text, "deg", round(math.degrees(at), 9), step, 1.0, furthest, setting)

    crossing = angle("crossing_max_deg", "crossing angle", allowed.crossing, 10.0, most_crossing, _crossing)
    upward = angle("climb_max_deg", "climb angle", allowed.climb.upper, 10.0, STEEPEST, _steepest)
    downward = angle("climb_min_deg", "climb angle", allowed.climb.lower, -10.0, -STEEPEST, _least_steep)
    yield dataclasses.replace(crossing, curve=_tangent, inverse=_of_tangent)
    yield dataclasses.replace(upward, curve=_sine, inverse=_of_sine)
    yield dataclasses.replace(downward, curve=_sine, inverse=_of_sine)
    if element.passing is not Passing.WINDOW:
        return
    berth = -max(0.5, 0.1 * allowed.clearance)
    yield relaxable("height_max_m", "height", "m", allowed.height.upper, 5.0, 1.0, HIGHEST, _highest)
    yield relaxable("height_min_m", "height", "m", allowed.height.lower, -5.0, 1.0, lowest, _lowest)
    yield relaxable("clearance_m", "clearance", "m", allowed.clearance, berth, 0.1, 0.0, _clearance)
    if isinstance(element, Gate):
        bank = angle("bank_tolerance_deg", "bank tolerance", allowed.bank, 5.0, MOST_BANK, _bank)
        yield dataclasses.replace(bank, curve=_tangent, inverse=_of_tangent)
        yield RelaxableParameter(
            f"gates.{name}.width_m", "width", name, "m", element.width, 1.0, 0.1, 100.0, _wide(name)
        )
    else:
        yield RelaxableParameter(
            f"gates.{name}.reach_m", "reach", name, "m", element.reach, 10.0, 1.0, 1000.0, _reaching(name)
        )


def _crossing(was: Tolerances, value: float) -> Tolerances:
    return dataclasses.replace(was, crossing=math.radians(value))


def _steepest(was: Tolerances, value: float) -> Tolerances:
    return dataclasses.replace(was, climb=dataclasses.replace(was.climb, upper=math.radians(value)))


def _least_steep(was: Tolerances, value: float) -> Tolerances:
    return dataclasses.replace(was, climb=dataclasses.replace(was.climb, lower=math.radians(value)))


def _highest(was: Tolerances, value: float) -> Tolerances:
    return dataclasses.replace(was, height=dataclasses.replace(was.height, upper=value))


def _lowest(was: Tolerances, value: float) -> Tolerances:
    return dataclasses.replace(was, height=dataclasses.replace(was.height, lower=value))


def _clearance(was: Tolerances, value: float) -> Tolerances:
    return dataclasses.replace(was, clearance=value)


def _bank(was: Tolerances, value: float) -> Tolerances:
    return dataclasses.replace(was, bank=math.radians(value))


def _tangent(value: float) -> float:
    return math.tan(math.radians(value))


def _of_tangent(value: float) -> float:
    return math.degrees(math.atan(value))


def _sine(value: float) -> float:
    return math.sin(math.radians(value))


def _of_sine(value: float) -> float:
    return math.degrees(math.asin(max(-1.0, min(1.0, value))))


def _manoeuvre(name: str, element: Manoeuvre) -> Iterator[RelaxableParameter]:
    """Yield the relaxable parameters of a manoeuvre that may lie within a range of heights."""
    height = element.height
    if height.lower == height.upper:
        return
    lowest = min(height.lower, 0.0)
    key, top = f"gates.{name}.height_min_m", f"gates.{name}.height_max_m"
    if math.isfinite(height.lower):
        yield RelaxableParameter(
            key, "height", name, "m", height.lower, -10.0, 1.0, lowest, _heights(name, upper=False)
        )
    if math.isfinite(height.upper):
        yield RelaxableParameter(top, "height", name, "m", height.upper, 10.0, 1.0, HIGHEST, _heights(name, upper=True))


# Races with other elements.


def _tolerating(race: Race, name: str, change: Callable[[Tolerances], Tolerances]) -> Race:
    def changed(one: Element) -> Element:
        if isinstance(one, Gate | Pylon):
            return dataclasses.replace(one, tolerances=change(one.tolerances))
        return one

    return _with_elements(race, name, changed)


def _wide(name: str) -> Callable[[Race, float], Race]:
    def changed(race: Race, value: float) -> Race:
        return _with_elements(
            race, name, lambda one: dataclasses.replace(one, width=value) if isinstance(one, Gate) else one
        )

    return changed


def _reaching(name: str) -> Callable[[Race, float], Race]:
    def changed(race: Race, value: float) -> Race:
        return _with_elements(
            race, name, lambda one: dataclasses.replace(one, reach=value) if isinstance(one, Pylon) else one
        )

    return changed


def _heights(name: str, *, upper: bool) -> Callable[[Race, float], Race]:
    def changed(race: Race, value: float) -> Race:
        def at(one: Element) -> Element:
            if not isinstance(one, Manoeuvre) or not one.height.bounded:
                return one
            band = Interval(one.height.lower, value) if upper else Interval(value, one.height.upper)
            return dataclasses.replace(one, height=band)

        return _with_elements(race, name, at)

    return changed


def _with_elements(race: Race, name: str, change: Callable[[Element], Element]) -> Race:
    """Return the race with all elements changed that belong to one entry of `gates`."""

    def changed(passage: Passage) -> Passage:
        if base_name(passage.element) != name:
            return passage
        return dataclasses.replace(passage, element=change(passage.element))

    passages = tuple(changed(one) for one in race.course.passages)
    return dataclasses.replace(race, course=dataclasses.replace(race.course, passages=passages))
