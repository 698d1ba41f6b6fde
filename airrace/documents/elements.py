"""From the `gates` of a track file to the elements of a course: defaults filled in, turned to SI, checked for sense."""

import math
import re
from typing import TypeVar

from airrace.documents.nodes import KeyPath, Reporter
from airrace.documents.track_schema import (
    ElementEntry,
    GateDefaultsEntry,
    GatePassingEntry,
    KnifeEdgeGateEntry,
    LevelGateEntry,
    ManoeuvreEntry,
    PassingEntry,
    PylonEntry,
)
from airrace.documents.units import interval, interval_deg, radians_or_none
from airrace.quantities import Interval
from airrace.track.gates import (
    INVERTED,
    KNIFE_EDGE_LEFT,
    KNIFE_EDGE_RIGHT,
    LEVEL,
    Element,
    Gate,
    Manoeuvre,
    Passing,
    Pylon,
    Tolerances,
)

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
VERTICAL_DEG = 89.0
"""Steeper than this a path has no course and no bank angle to speak of."""

Value = TypeVar("Value")


def build_elements(
    entries: dict[str, ElementEntry], defaults: GateDefaultsEntry, reporter: Reporter
) -> dict[str, Element]:
    """All elements by name; what makes no sense is reported."""
    built: dict[str, Element] = {}
    for name, entry in entries.items():
        path: KeyPath = ("gates", name)
        if not NAME.fullmatch(name):
            reporter.key(path, "a gate's name begins with a letter and goes on with letters, digits, `_` and `-`")
        match entry:
            case LevelGateEntry():
                built[name] = _gate(name, entry, defaults, reporter)
            case KnifeEdgeGateEntry():
                built[name] = _gate(name, entry, defaults, reporter)
            case PylonEntry():
                built[name] = _pylon(name, entry, defaults, reporter)
            case ManoeuvreEntry():
                built[name] = _manoeuvre(name, entry, reporter)
    return built


def _chosen(own: Value | None, default: Value | None, silent: Value) -> Value:
    """The element's own value, else that of `gate_defaults`, else the language's."""
    if own is not None:
        return own
    return silent if default is None else default


def _gate(
    name: str, entry: LevelGateEntry | KnifeEdgeGateEntry, defaults: GateDefaultsEntry, reporter: Reporter
) -> Gate:
    passing = _passing(entry, defaults)
    clearance = _chosen(entry.clearance_m, defaults.clearance_m, GATE_CLEARANCE_M)
    tolerances = _tolerances(entry, defaults, clearance=clearance)
    gate = Gate(
        name=name,
        north=entry.north_m,
        east=entry.east_m,
        height=_chosen(entry.height_m, defaults.height_m, HEIGHT_M),
        heading=math.radians(entry.heading_deg),
        width=_chosen(entry.width_m, defaults.width_m, WIDTH_M),
        passing=passing,
        tolerances=tolerances,
        bank=_bank(entry),
        either_bank=isinstance(entry, KnifeEdgeGateEntry) and entry.bank == "either",
    )
    _check_height(gate, reporter)
    _check_climb(gate, reporter)
    if passing is Passing.WINDOW and gate.width <= 2.0 * tolerances.clearance:
        reporter.value(
            ("gates", name, "width_m"),
            f"a width of {gate.width:g} m leaves nothing between two clearances of {tolerances.clearance:g} m",
        )
    return gate


def _bank(entry: LevelGateEntry | KnifeEdgeGateEntry) -> float:
    if isinstance(entry, LevelGateEntry):
        return LEVEL
    return KNIFE_EDGE_LEFT if entry.bank == "left" else KNIFE_EDGE_RIGHT


def _pylon(name: str, entry: PylonEntry, defaults: GateDefaultsEntry, reporter: Reporter) -> Pylon:
    pylon = Pylon(
        name=name,
        north=entry.north_m,
        east=entry.east_m,
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


def _manoeuvre(name: str, entry: ManoeuvreEntry, reporter: Reporter) -> Manoeuvre:
    path: KeyPath = ("gates", name)

    def position(axis: str, exact: float | None, lower: float | None, upper: float | None) -> Interval:
        return _position(axis, exact, interval(lower, upper), path=path, reporter=reporter)

    manoeuvre = Manoeuvre(
        name=name,
        bank=INVERTED if entry.inverted else radians_or_none(entry.bank_deg),
        climb=radians_or_none(entry.climb_deg),
        heading=radians_or_none(entry.heading_deg),
        north=position("north", entry.north_m, entry.north_min_m, entry.north_max_m),
        east=position("east", entry.east_m, entry.east_min_m, entry.east_max_m),
        height=position("height", entry.height_m, entry.height_min_m, entry.height_max_m),
    )
    if entry.inverted is False:
        reporter.value((*path, "inverted"), "can only be true; for upright flight give `bank_deg: 0`")
    if entry.inverted and entry.bank_deg is not None:
        reporter.value((*path, "bank_deg"), "not together with `inverted`, which says a bank of 180 degrees")
    if manoeuvre == Manoeuvre(name=name):
        reporter.key(path, "a manoeuvre needs at least one condition: climb_deg, bank_deg, inverted, heading_deg, ...")
    if entry.climb_deg is not None and abs(entry.climb_deg) > VERTICAL_DEG:
        for key in ("bank_deg", "inverted", "heading_deg"):
            if reporter.find((*path, key)) is not None:
                reporter.value((*path, key), "has no meaning on a vertical line; leave it out")
    return manoeuvre


def _position(axis: str, exact: float | None, bounds: Interval, *, path: KeyPath, reporter: Reporter) -> Interval:
    if exact is not None:
        if bounds.bounded:
            reporter.value((*path, f"{axis}_m"), f"is exact; not together with `{axis}_min_m` or `{axis}_max_m`")
        return Interval.exactly(exact)
    if bounds.empty:
        reporter.value(
            (*path, f"{axis}_min_m"), f"must not exceed `{axis}_max_m`, {bounds.upper:g}, but is {bounds.lower:g}"
        )
    return bounds
