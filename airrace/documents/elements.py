"""From the `gates` of a track file to the elements of a course: defaults filled in, turned to SI, checked for sense."""

import dataclasses
import math
import re
from typing import TypeVar

from airrace.documents.element_schema import (
    QUAD_CROSSING_MAX_DEG,
    ElementEntry,
    GateDefaultsEntry,
    GatePassingEntry,
    HighTurnEntry,
    KnifeEdgeGateEntry,
    LevelGateEntry,
    ManoeuvreEntry,
    PassingEntry,
    PylonEntry,
    QuadEntry,
    VerticalRollEntry,
)
from airrace.documents.figures import Figure, Step
from airrace.documents.manoeuvres import build_high_turn, build_manoeuvre, build_vertical_roll
from airrace.documents.nodes import Reporter
from airrace.documents.places import Places
from airrace.documents.units import interval_deg
from airrace.quantities import Interval
from airrace.track.course import Direction
from airrace.track.gates import KNIFE_EDGE_LEFT, KNIFE_EDGE_RIGHT, LEVEL, Gate, Passing, Pylon, Tolerances

# What a gate has if neither it nor `gate_defaults` says otherwise. Pylons are 25 m high, gates 10-14 m wide, the legal
# height is about 15-25 m, wings level within 10 degrees (race rules 2014-2019); the other numbers are choices.
HEIGHT_M = 20.0
HEIGHT_BAND_M = 5.0
WIDTH_M = 13.0
GATE_CLEARANCE_M = 0.5
PYLON_CLEARANCE_M = 3.5
BANK_TOLERANCE_DEG = 10.0
CLIMB_MAX_DEG = 45.0
CROSSING_MAX_DEG = 60.0
REACH_M = 100.0

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")
NAME_RULE = "begin with a letter and go on with letters, digits, `_` and `-`"
Value = TypeVar("Value")


def build_elements(entries: dict[str, ElementEntry], defaults: GateDefaultsEntry, places: Places) -> dict[str, Figure]:
    """All elements by name; what makes no sense is reported."""
    built: dict[str, Figure] = {}
    for name, entry in entries.items():
        if not NAME.fullmatch(name):
            places.reporter.key(("gates", name), "a gate's name must " + NAME_RULE)
        built[name] = _figure(name, entry, defaults, places)
    return built


def _figure(name: str, entry: ElementEntry, defaults: GateDefaultsEntry, places: Places) -> Figure:
    match entry:
        case LevelGateEntry():
            return Figure(name, (Step(_gate(name, entry, defaults, places)),))
        case KnifeEdgeGateEntry():
            return Figure(name, (Step(_banked(_gate(name, entry, defaults, places), entry.bank)),))
        case QuadEntry():
            return _quad(name, entry, defaults, places)
        case PylonEntry():
            return Figure(name, (Step(_pylon(name, entry, defaults, places)),))
        case ManoeuvreEntry():
            return build_manoeuvre(name, entry, places)
        case HighTurnEntry():
            return build_high_turn(name, entry, places.reporter)
        case VerticalRollEntry():
            return build_vertical_roll(name, entry, places.reporter)


def _chosen(own: Value | None, default: Value | None, silent: Value) -> Value:
    """The element's own value, else that of `gate_defaults`, else the language's."""
    if own is not None:
        return own
    return silent if default is None else default


def _gate(
    name: str, entry: LevelGateEntry | KnifeEdgeGateEntry | QuadEntry, defaults: GateDefaultsEntry, places: Places
) -> Gate:
    """Two pylons, wings level."""
    reporter, place = places.reporter, places.point(entry, ("gates", name))
    clearance = _chosen(entry.clearance_m, defaults.clearance_m, GATE_CLEARANCE_M)
    gate = Gate(
        name=name,
        north=place.north,
        east=place.east,
        height=_chosen(entry.height_m, defaults.height_m, HEIGHT_M),
        heading=math.radians(entry.heading_deg),
        width=_chosen(entry.width_m, defaults.width_m, WIDTH_M),
        passing=_passing(entry, defaults),
        tolerances=_tolerances(entry, defaults, clearance=clearance),
    )
    _check_height(gate, reporter)
    _check_climb(gate, reporter)
    if gate.passing is Passing.WINDOW and gate.width <= 2.0 * clearance:
        reporter.value(
            ("gates", name, "width_m"),
            f"a width of {gate.width:g} m leaves nothing between two clearances of {clearance:g} m",
        )
    return gate


def _banked(gate: Gate, name: str) -> Gate:
    """The gate flown at a bank that is named after the wing that points down."""
    bank = {"level": LEVEL, "left": KNIFE_EDGE_LEFT}.get(name, KNIFE_EDGE_RIGHT)
    return dataclasses.replace(gate, bank=bank, either_bank=name == "either")


def _quad(name: str, entry: QuadEntry, defaults: GateDefaultsEntry, places: Places) -> Figure:
    """Two crossed gates. The second one's heading is counted from the first one's: flown in reverse, both turn."""
    first = _gate(name, entry, defaults, places)
    crossing = min(first.tolerances.crossing, math.radians(QUAD_CROSSING_MAX_DEG))
    first = dataclasses.replace(first, tolerances=dataclasses.replace(first.tolerances, crossing=crossing))
    turn_deg = -90.0 if entry.then == "left" else 90.0
    second = dataclasses.replace(first, heading=math.radians(entry.heading_deg + turn_deg))
    either = entry.then == "either"
    return Figure(
        name,
        (
            Step(dataclasses.replace(_banked(first, entry.bank), name=f"{name}/1")),
            Step(
                dataclasses.replace(_banked(second, entry.second_bank), name=f"{name}/2"),
                direction=Direction.PLANNED if either else None,
            ),
        ),
        free_directions=either,
    )


def _pylon(name: str, entry: PylonEntry, defaults: GateDefaultsEntry, places: Places) -> Pylon:
    reporter, place = places.reporter, places.point(entry, ("gates", name))
    pylon = Pylon(
        name=name,
        north=place.north,
        east=place.east,
        height=_chosen(entry.height_m, defaults.height_m, HEIGHT_M),
        side=math.radians(entry.pass_side_deg),
        reach=_chosen(entry.reach_m, defaults.reach_m, REACH_M),
        passing=_passing(entry, defaults),
        tolerances=_tolerances(
            entry, defaults, clearance=PYLON_CLEARANCE_M if entry.clearance_m is None else entry.clearance_m
        ),
    )
    _check_height(pylon, reporter)
    _check_climb(pylon, reporter)
    if pylon.reach <= pylon.tolerances.clearance:
        reporter.value(
            ("gates", name, "reach_m"),
            f"a reach of {pylon.reach:g} m lies within the clearance of {pylon.tolerances.clearance:g} m",
        )
    return pylon


def _passing(entry: PassingEntry, defaults: GateDefaultsEntry) -> Passing:
    return Passing(_chosen(entry.passing, defaults.passing, "window"))


def _tolerances(entry: PassingEntry, defaults: GateDefaultsEntry, *, clearance: float) -> Tolerances:
    height = _chosen(entry.height_m, defaults.height_m, HEIGHT_M)
    climb = Interval(
        _chosen(entry.climb_min_deg, defaults.climb_min_deg, -CLIMB_MAX_DEG),
        _chosen(entry.climb_max_deg, defaults.climb_max_deg, CLIMB_MAX_DEG),
    )
    return Tolerances(
        clearance=clearance,
        height=Interval(
            _chosen(entry.height_min_m, defaults.height_min_m, max(0.0, height - HEIGHT_BAND_M)),
            _chosen(entry.height_max_m, defaults.height_max_m, height + HEIGHT_BAND_M),
        ),
        bank=_bank_tolerance(entry, defaults),
        climb=interval_deg(climb.lower, climb.upper),
        crossing=math.radians(_chosen(entry.crossing_max_deg, defaults.crossing_max_deg, CROSSING_MAX_DEG)),
    )


def _bank_tolerance(entry: PassingEntry, defaults: GateDefaultsEntry) -> float:
    if not isinstance(entry, GatePassingEntry):
        return math.pi  # the bank at a single pylon is free
    return math.radians(_chosen(entry.bank_tolerance_deg, defaults.bank_tolerance_deg, BANK_TOLERANCE_DEG))


def _check_height(element: Gate | Pylon, reporter: Reporter) -> None:
    band = element.tolerances.height
    if element.passing is Passing.POINT:
        return
    if band.empty:
        reporter.value(
            ("gates", element.name, "height_min_m"),
            f"the height band is empty: from {band.lower:g} m up to {band.upper:g} m",
        )
    elif not band.lower <= element.height <= band.upper:
        reporter.value(
            ("gates", element.name, "height_m"),
            f"must lie within the window's heights, {band.lower:g} to {band.upper:g} m, not {element.height:g}",
        )


def _check_climb(element: Gate | Pylon, reporter: Reporter) -> None:
    climb = element.tolerances.climb
    if climb.empty:
        reporter.value(
            ("gates", element.name, "climb_min_deg"),
            f"must not exceed the largest climb angle: {math.degrees(climb.lower):g} to {math.degrees(climb.upper):g}",
        )
