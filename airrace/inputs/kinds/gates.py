"""Gates and pylons in the track language: level gates, knife-edge gates, quads, single pylons."""

import dataclasses
import math
from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from annotated_types import Gt, Le
from pydantic import Field

from airrace.inputs.features import Feature, Step
from airrace.inputs.kinds.defaults import GateDefaultsEntry, GatePassingEntry, PassingEntry, Reach
from airrace.inputs.kinds.entry import KindEntry, chosen
from airrace.inputs.kinds.passing import (
    GATE_CLEARANCE_M,
    HEIGHT_M,
    PYLON_CLEARANCE_M,
    REACH_M,
    WIDTH_M,
    check_passing,
    passing_of,
    rounded,
    silent_passing,
    tolerances_of,
)
from airrace.inputs.nodes import KeyPath
from airrace.inputs.place_schema import Azimuth, PlacedEntry, PlaceEntry
from airrace.inputs.places import GEODETIC, METRIC, NOWHERE, Places
from airrace.records import record
from airrace.track.course import Direction
from airrace.track.gates import KNIFE_EDGE_LEFT, KNIFE_EDGE_RIGHT, LEVEL, Gate, Passing, Pylon
from airrace.track.polygons import Point

KnifeEdgeName = Literal["right", "left", "either"]
BankName = Literal["level", "right", "left", "either"]
QUAD_CROSSING_MAX_DEG = 40
"""The largest crossing angle at a quad, degrees.

From 45 on one straight flight through the middle would count as both passings of a quad.
"""


class TwoPylonEntry(GatePassingEntry, PlacedEntry, KindEntry):
    """The keys of everything that is flown between two pylons.

    It stands where it says, or where its two pylons do: the centre between them, their distance, and the direction
    across, with the first of them to the left.
    """

    pylons: Annotated[list[PlaceEntry], Field(min_length=2, max_length=2)] | None = Field(
        default=None,
        description="its two pylons, the left one first as flown forward, instead of position, `heading_deg` and "
        "`width_m`",
    )

    def silent_numbers(self, feature: Feature) -> Mapping[str, float | None]:
        gate = feature.steps[0].element
        if not isinstance(gate, Gate):
            return {}
        width = {} if self.pylons is not None else {"width_m": gate.width}
        return silent_passing(gate) | width | {"bank_tolerance_deg": rounded(gate.tolerances.bank)}


class LevelGateEntry(TwoPylonEntry):
    what: ClassVar[str] = "a level gate"
    type: Literal["level"] = Field(description="two pylons, flown between with the wings level")
    heading_deg: Azimuth | None = Field(default=None, description="its axis when flown forward")

    def feature(self, name: str, defaults: GateDefaultsEntry, places: Places) -> Feature:
        return Feature(name, (Step(_gate(name, self, self.heading_deg, defaults, places)),))


class KnifeEdgeGateEntry(TwoPylonEntry):
    what: ClassVar[str] = "a knife-edge gate"
    type: Literal["knife-edge"] = Field(description="two pylons, flown between with a right angle of bank")
    heading_deg: Azimuth | None = Field(default=None, description="its axis when flown forward")
    bank: KnifeEdgeName = Field(default="either", description="the wing that points down")

    def feature(self, name: str, defaults: GateDefaultsEntry, places: Places) -> Feature:
        return Feature(name, (Step(_banked(_gate(name, self, self.heading_deg, defaults, places), self.bank)),))


class QuadEntry(TwoPylonEntry):
    """Two pairs of pylons about one centre; one mention in the course is both passings, one after the other."""

    what: ClassVar[str] = "a quad"
    type: Literal["quad"] = Field(description="two crossed gates, passed twice from perpendicular directions")
    heading_deg: Azimuth | None = Field(
        default=None, description="the direction of the first passing when flown forward"
    )
    then: KnifeEdgeName = Field(
        description="the second passing's direction: a quarter turn to this side of the first one's"
    )
    bank: BankName = Field(
        default="level", description="at the first passing: wings level, or the wing that points down"
    )
    second_bank: BankName = Field(default="level", description="the same at the second passing")
    crossing_max_deg: Annotated[float, Gt(0), Le(QUAD_CROSSING_MAX_DEG)] | None = Field(
        default=None,
        description="largest horizontal angle between the path and the axis of either passing; without it that of "
        f"gate_defaults, but {QUAD_CROSSING_MAX_DEG} at most",
    )

    def feature(self, name: str, defaults: GateDefaultsEntry, places: Places) -> Feature:
        """Return two crossed gates.

        The second one's heading is counted from the first one's, so that both turn when the quad is flown in reverse.
        """
        first = _gate(name, self, self.heading_deg, defaults, places)
        crossing = min(first.tolerances.crossing, math.radians(QUAD_CROSSING_MAX_DEG))
        first = dataclasses.replace(first, tolerances=dataclasses.replace(first.tolerances, crossing=crossing))
        turn_deg = -90.0 if self.then == "left" else 90.0
        axis_deg = math.degrees(first.heading) if self.heading_deg is None else self.heading_deg
        second = dataclasses.replace(first, heading=math.radians(axis_deg + turn_deg))
        either = self.then == "either"
        return Feature(
            name,
            (
                Step(dataclasses.replace(_banked(first, self.bank), name=f"{name}/1")),
                Step(
                    dataclasses.replace(_banked(second, self.second_bank), name=f"{name}/2"),
                    direction=Direction.PLANNED if either else None,
                ),
            ),
            free_directions=either,
        )


@record
class _Stand:
    """The place of a gate: its centre, its axis (rad) and its width (m)."""

    centre: Point
    heading: float
    width: float


def _stand(
    name: str, entry: TwoPylonEntry, heading_deg: float | None, defaults: GateDefaultsEntry, places: Places
) -> _Stand:
    """Return where a gate stands, by its own numbers or by its pylons; `NOWHERE` if that was refused."""
    path: KeyPath = ("gates", name)
    width = chosen(entry.width_m, defaults.width_m, WIDTH_M)
    if entry.pylons is not None:
        return _between(entry, heading_deg, path, places)
    centre = places.point(entry, path)
    if heading_deg is None:
        message = f"missing; {entry.what} needs `heading_deg`: its axis when flown forward; or its two `pylons`"
        places.reporter.key((*path, "heading_deg"), message)
        return _Stand(NOWHERE, 0.0, width)
    return _Stand(centre, math.radians(heading_deg), width)


def _between(entry: TwoPylonEntry, heading_deg: float | None, path: KeyPath, places: Places) -> _Stand:
    """Return where a gate stands whose two pylons are known, the left one first."""
    assert entry.pylons is not None  # asked for by the caller
    given = {"heading_deg": heading_deg, "width_m": entry.width_m}
    given |= {key: getattr(entry, key) for key in (*METRIC, *GEODETIC)}
    for key, value in given.items():
        if value is not None:
            places.reporter.key((*path, key), "the gate's place is given twice; keep it, or `pylons`")
    left, right = (places.point(one, (*path, "pylons", index)) for index, one in enumerate(entry.pylons))
    north, east = right.north - left.north, right.east - left.east
    width = math.hypot(north, east)
    if width == 0.0:
        places.reporter.value((*path, "pylons"), "both pylons stand in the same place")
    centre = Point(0.5 * (left.north + right.north), 0.5 * (left.east + right.east))
    return _Stand(centre, math.atan2(east, north) - 0.5 * math.pi, width)


def _gate(
    name: str, entry: TwoPylonEntry, heading_deg: float | None, defaults: GateDefaultsEntry, places: Places
) -> Gate:
    """Return a gate of two pylons that is flown with the wings level."""
    reporter, stand = places.reporter, _stand(name, entry, heading_deg, defaults, places)
    clearance = chosen(entry.clearance_m, defaults.clearance_m, GATE_CLEARANCE_M)
    gate = Gate(
        name=name,
        north=stand.centre.north,
        east=stand.centre.east,
        height=chosen(entry.height_m, defaults.height_m, HEIGHT_M),
        heading=stand.heading,
        width=stand.width,
        passing=passing_of(entry, defaults),
        tolerances=tolerances_of(entry, defaults, clearance=clearance),
    )
    check_passing(gate, reporter)
    if gate.passing is Passing.WINDOW and gate.width <= 2.0 * clearance:
        reporter.value(
            ("gates", name, "width_m" if entry.pylons is None else "pylons"),
            f"a width of {gate.width:g} m leaves nothing between two clearances of {clearance:g} m",
        )
    return gate


def _banked(gate: Gate, name: str) -> Gate:
    """Return the gate flown at a bank that is named after the wing that points down."""
    bank = {"level": LEVEL, "left": KNIFE_EDGE_LEFT}.get(name, KNIFE_EDGE_RIGHT)
    return dataclasses.replace(gate, bank=bank, either_bank=name == "either")


class PylonEntry(PassingEntry, PlacedEntry, KindEntry):
    what: ClassVar[str] = "a pylon"
    type: Literal["pylon"] = Field(description="a single pylon, passed on one side")
    pass_side_deg: Azimuth = Field(description="the azimuth from the pylon to the side on which it is passed")
    reach_m: Reach | None = Field(default=None, description="farthest distance at which the passing counts")

    def feature(self, name: str, defaults: GateDefaultsEntry, places: Places) -> Feature:
        reporter, place = places.reporter, places.point(self, ("gates", name))
        pylon = Pylon(
            name=name,
            north=place.north,
            east=place.east,
            height=chosen(self.height_m, defaults.height_m, HEIGHT_M),
            side=math.radians(self.pass_side_deg),
            reach=chosen(self.reach_m, defaults.reach_m, REACH_M),
            passing=passing_of(self, defaults),
            tolerances=tolerances_of(
                self, defaults, clearance=PYLON_CLEARANCE_M if self.clearance_m is None else self.clearance_m
            ),
        )
        check_passing(pylon, reporter)
        if pylon.reach <= pylon.tolerances.clearance:
            reporter.value(
                ("gates", name, "reach_m"),
                f"a reach of {pylon.reach:g} m lies within the clearance of {pylon.tolerances.clearance:g} m",
            )
        return Feature(name, (Step(pylon),))

    def silent_numbers(self, feature: Feature) -> Mapping[str, float | None]:
        pylon = feature.steps[0].element
        return silent_passing(pylon) | {"reach_m": pylon.reach} if isinstance(pylon, Pylon) else {}
