"""Gates and pylons in the track language: level gates, knife-edge gates, quads, single pylons."""

import dataclasses
import math
from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from annotated_types import Gt, Le
from pydantic import Field

from airrace.files.inputs.kinds.kind import (
    CompositeElement,
    ElementPart,
    GateDefaultsEntry,
    GatePassingEntry,
    KindEntry,
    PassingEntry,
    Reach,
    passing_numbers,
    register,
)
from airrace.files.inputs.nodes import KeyPath, Reporter
from airrace.files.inputs.places import GEODETIC, METRIC, NOWHERE, Azimuth, PlacedEntry, PlaceEntry, Places
from airrace.files.inputs.schema import optional
from airrace.model.track.course import Direction
from airrace.model.track.gates import KNIFE_EDGE_LEFT, KNIFE_EDGE_RIGHT, LEVEL, Gate, Passing, Pylon, Tolerances
from airrace.model.track.polygons import Point
from airrace.optimal_control.quantities import Interval

QUAD_CROSSING_MAX_DEG = 40
"""The largest crossing angle at a quad, degrees.

From 45 on one straight flight through the middle would count as both passings of a quad.
"""

KnifeEdgeName = Literal["right", "left", "either"]
BankName = Literal["level", "right", "left", "either"]
BANKS = {"level": LEVEL, "left": KNIFE_EDGE_LEFT, "right": KNIFE_EDGE_RIGHT, "either": KNIFE_EDGE_RIGHT}
"""The bank by the name of the wing that points down, rad."""


class TwoPylonEntry(GatePassingEntry, PlacedEntry, KindEntry):
    """The keys of everything that is passed between two pylons.

    It stands where it says, or where its two pylons do: the centre between them, their distance, and the direction
    across, with the first of them to the left.
    """

    pylons: Annotated[list[PlaceEntry], Field(min_length=2, max_length=2)] | None = optional(
        "its two pylons, the left one first in forward direction, instead of position, `heading_deg` and `width_m`"
    )
    heading_deg: Azimuth | None = optional("its axis in forward direction")

    def numbers(self, defaults: GateDefaultsEntry) -> Mapping[str, float]:
        numbers = passing_numbers(self, defaults)
        if self.pylons is not None:
            del numbers["width_m"]
        return numbers

    def gate(self, name: str, defaults: GateDefaultsEntry, places: Places, bank: BankName) -> Gate:
        """Return the gate; what leaves nothing of it is reported."""
        path, numbers = ("gates", name), self.numbers(defaults)
        if self.pylons is None:
            centre, width = places.point(self, path), numbers["width_m"]
            heading = math.radians(self.heading_deg or 0.0)
            if self.heading_deg is None:
                centre = NOWHERE
                message = (
                    f"missing; {self.what} needs `heading_deg`: its axis in forward direction; or its two `pylons`"
                )
                places.reporter.key((*path, "heading_deg"), message)
        else:
            centre, heading, width = self._between(self.pylons, path, places)
        gate = Gate(
            name=name,
            north=centre.north,
            east=centre.east,
            height=numbers["height_m"],
            heading=heading,
            width=width,
            bank=BANKS[bank],
            either_bank=bank == "either",
            passing=Passing(self.passing or defaults.passing),
            tolerances=_tolerances(numbers),
            pylon_height=numbers["pylon_height_m"],
        )
        _check_passing(gate, places.reporter)
        clearance = numbers["clearance_m"]
        if gate.passing is Passing.WINDOW and width <= 2.0 * clearance:
            places.reporter.value(
                (*path, "width_m" if self.pylons is None else "pylons"),
                f"a width of {width:g} m leaves nothing between two clearances of {clearance:g} m",
            )
        return gate

    def _between(self, pylons: list[PlaceEntry], path: KeyPath, places: Places) -> tuple[Point, float, float]:
        """Return the centre, the axis (rad) and the width (m) of a gate whose two pylons are known."""
        for key in ("heading_deg", "width_m", *METRIC, *GEODETIC):
            if getattr(self, key) is not None:
                places.reporter.key((*path, key), "the gate's place is given twice; keep it, or `pylons`")
        left, right = (places.point(pylon, (*path, "pylons", index)) for index, pylon in enumerate(pylons))
        north, east = right.north - left.north, right.east - left.east
        width = math.hypot(north, east)
        if width == 0.0:
            places.reporter.value((*path, "pylons"), "both pylons stand in the same place")
        centre = Point(0.5 * (left.north + right.north), 0.5 * (left.east + right.east))
        return centre, math.atan2(east, north) - 0.5 * math.pi, width


@register
class LevelGateEntry(TwoPylonEntry):
    what: ClassVar[str] = "a level gate"
    type: Literal["level"] = Field(description="two pylons, passed between with the wings level")

    def build(self, name: str, defaults: GateDefaultsEntry, places: Places) -> CompositeElement:
        return CompositeElement(name, (ElementPart(self.gate(name, defaults, places, "level")),))


@register
class KnifeEdgeGateEntry(TwoPylonEntry):
    what: ClassVar[str] = "a knife-edge gate"
    type: Literal["knife-edge"] = Field(description="two pylons, passed between with a right angle of bank")
    bank: KnifeEdgeName = Field(default="either", description="the wing that points down")

    def build(self, name: str, defaults: GateDefaultsEntry, places: Places) -> CompositeElement:
        return CompositeElement(name, (ElementPart(self.gate(name, defaults, places, self.bank)),))


@register
class QuadEntry(TwoPylonEntry):
    """Four pylons at the corners of a square; one mention in the course is both passings, one after the other."""

    what: ClassVar[str] = "a quad"
    type: Literal["quad"] = Field(
        description="four pylons at the corners of a square, passed twice from perpendicular directions"
    )
    heading_deg: Azimuth | None = optional("the direction of the first passing in forward direction")
    then: KnifeEdgeName = Field(
        description="the second passing's direction: a quarter turn to this side of the first one's"
    )
    bank: BankName = Field(
        default="level", description="at the first passing: wings level, or the wing that points down"
    )
    second_bank: BankName = Field(default="level", description="the same at the second passing")
    crossing_max_deg: Annotated[float, Gt(0), Le(QUAD_CROSSING_MAX_DEG)] | None = optional(
        "largest horizontal angle between the path and the axis of either passing; without it that of "
        f"gate_defaults, but {QUAD_CROSSING_MAX_DEG} at most"
    )

    def numbers(self, defaults: GateDefaultsEntry) -> Mapping[str, float]:
        numbers = super().numbers(defaults)
        return {**numbers, "crossing_max_deg": min(numbers["crossing_max_deg"], QUAD_CROSSING_MAX_DEG)}

    def build(self, name: str, defaults: GateDefaultsEntry, places: Places) -> CompositeElement:
        """Return two crossed gates, as wide as the square.

        Pylons that are given are the pair between which the first passing enters it. The second one's heading is
        counted from the first one's, so that both turn when the quad is passed in reverse.
        """
        first = dataclasses.replace(self.gate(name, defaults, places, self.bank), square=True)
        if self.pylons is not None:
            centre = first.beside(0.5 * first.width, first.heading)
            first = dataclasses.replace(first, north=centre.north, east=centre.east)
        axis_deg = math.degrees(first.heading) if self.heading_deg is None else self.heading_deg
        second = dataclasses.replace(
            first,
            name=f"{name}/2",
            heading=math.radians(axis_deg + (-90.0 if self.then == "left" else 90.0)),
            bank=BANKS[self.second_bank],
            either_bank=self.second_bank == "either",
        )
        either = self.then == "either"
        parts = (
            ElementPart(dataclasses.replace(first, name=f"{name}/1")),
            ElementPart(second, direction=Direction.PLANNED if either else None),
        )
        return CompositeElement(name, parts, free_directions=either)


@register
class PylonEntry(PassingEntry, PlacedEntry, KindEntry):
    what: ClassVar[str] = "a pylon"
    type: Literal["pylon"] = Field(description="a single pylon, passed on one side")
    pass_side_deg: Azimuth = Field(description="the azimuth from the pylon to the side on which it is passed")
    reach_m: Reach | None = optional("farthest distance at which the passing counts")

    def numbers(self, defaults: GateDefaultsEntry) -> Mapping[str, float]:
        clearance = 3.5 if self.clearance_m is None else self.clearance_m
        return {**passing_numbers(self, defaults), "clearance_m": clearance}

    def build(self, name: str, defaults: GateDefaultsEntry, places: Places) -> CompositeElement:
        reporter, place, numbers = places.reporter, places.point(self, ("gates", name)), self.numbers(defaults)
        pylon = Pylon(
            name=name,
            north=place.north,
            east=place.east,
            height=numbers["height_m"],
            side=math.radians(self.pass_side_deg),
            reach=numbers["reach_m"],
            passing=Passing(self.passing or defaults.passing),
            tolerances=_tolerances(numbers),
            pylon_height=numbers["pylon_height_m"],
        )
        _check_passing(pylon, reporter)
        if pylon.reach <= pylon.tolerances.clearance:
            reporter.value(
                ("gates", name, "reach_m"),
                f"a reach of {pylon.reach:g} m lies within the clearance of {pylon.tolerances.clearance:g} m",
            )
        return CompositeElement(name, (ElementPart(pylon),))


def _tolerances(numbers: Mapping[str, float]) -> Tolerances:
    """Return what a passing allows; the bank at a single pylon is free."""
    return Tolerances(
        clearance=numbers["clearance_m"],
        height=Interval(numbers["height_min_m"], numbers["height_max_m"]),
        bank=math.radians(numbers.get("bank_tolerance_deg", 180.0)),
        climb=Interval(math.radians(numbers["climb_min_deg"]), math.radians(numbers["climb_max_deg"])),
        crossing=math.radians(numbers["crossing_max_deg"]),
    )


def _check_passing(element: Gate | Pylon, reporter: Reporter) -> None:
    """Report heights and climb angles that leave nothing."""
    band, climb = element.tolerances.height, element.tolerances.climb
    if element.passing is Passing.WINDOW and band.empty:
        reporter.value(
            ("gates", element.name, "height_min_m"),
            f"the height band is empty: from {band.lower:g} m up to {band.upper:g} m",
        )
    elif element.passing is Passing.WINDOW and not band.lower <= element.height <= band.upper:
        reporter.value(
            ("gates", element.name, "height_m"),
            f"must lie within the window's heights, {band.lower:g} to {band.upper:g} m, not {element.height:g}",
        )
    if climb.empty:
        reporter.value(
            ("gates", element.name, "climb_min_deg"),
            f"must not exceed the largest climb angle: {math.degrees(climb.lower):g} to {math.degrees(climb.upper):g}",
        )
