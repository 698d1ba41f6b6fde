"""Manoeuvres in the track language, at a free position: attitudes, high turns, vertical rolls."""

import dataclasses
import math
from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Le
from pydantic import Field

from airrace.files.inputs.kinds.gates import KnifeEdgeName
from airrace.files.inputs.kinds.kind import CompositeElement, ElementPart, GateDefaultsEntry, KindEntry, register
from airrace.files.inputs.nodes import KeyPath, Reporter
from airrace.files.inputs.places import Azimuth, ClimbAngle, Coordinate, Height, PlacedEntry, Places, radians_or_none
from airrace.files.inputs.schema import optional
from airrace.model.track.course import Roll, Turning
from airrace.model.track.gates import INVERTED, Manoeuvre
from airrace.optimal_control.quantities import Interval

STEEP_DEG = 45.0
"""The least climb angle, degrees, of a line for a vertical roll."""


@register
class ManoeuvreEntry(PlacedEntry, KindEntry):
    """An attitude at a position that is free within bounds; at least one condition."""

    what: ClassVar[str] = "a manoeuvre"
    type: Literal["manoeuvre"] = Field(description="an attitude, at a position that is free within bounds")
    climb_deg: ClimbAngle | None = optional("climb angle; 90 is straight up")
    bank_deg: Annotated[float, Ge(-180), Le(180)] | None = optional("bank angle, positive with the right wing down")
    inverted: bool | None = optional("`true`: upside down, a bank of 180 degrees")
    heading_deg: Azimuth | None = optional("course over ground")
    north_min_m: Coordinate | None = optional("southern end of the range it may lie in")
    north_max_m: Coordinate | None = optional("northern end of the range it may lie in")
    east_min_m: Coordinate | None = optional("western end of the range it may lie in")
    east_max_m: Coordinate | None = optional("eastern end of the range it may lie in")
    height_m: Height | None = optional("exact height above the origin")
    height_min_m: Height | None = optional("least height above the origin")
    height_max_m: Height | None = optional("largest height above the origin")

    def build(self, name: str, defaults: GateDefaultsEntry, places: Places) -> CompositeElement:
        """Return an attitude at a position that is free within bounds."""
        reporter, path = places.reporter, ("gates", name)
        north, east = _over_ground(self, path, places)
        heights = Interval.between(self.height_min_m, self.height_max_m)
        manoeuvre = Manoeuvre(
            name=name,
            bank=INVERTED if self.inverted else radians_or_none(self.bank_deg),
            climb=radians_or_none(self.climb_deg),
            heading=radians_or_none(self.heading_deg),
            north=north,
            east=east,
            height=_range("height", self.height_m, heights, path, reporter),
        )
        if self.inverted is False:
            reporter.value((*path, "inverted"), "can only be true; for upright flight give `bank_deg: 0`")
        if self.inverted and self.bank_deg is not None:
            reporter.value((*path, "bank_deg"), "not together with `inverted`, which says a bank of 180 degrees")
        if not self.model_fields_set - {"type"}:
            reporter.key(
                path, "a manoeuvre needs at least one condition: climb_deg, bank_deg, inverted, heading_deg, ..."
            )
        # A steeper path has no course and no bank to speak of.
        if self.climb_deg is not None and abs(self.climb_deg) > 89.0:
            for key in ("bank_deg", "inverted", "heading_deg"):
                if reporter.find((*path, key)) is not None:
                    reporter.value((*path, key), "has no meaning on a vertical line; leave it out")
        return CompositeElement(name, (ElementPart(manoeuvre),))


@register
class HighTurnEntry(KindEntry):
    what: ClassVar[str] = "a high turn"
    type: Literal["high-turn"] = Field(description="a height to be reached between two gates")
    height_min_m: Height = Field(description="the height above the origin that must be reached")
    height_max_m: Height | None = optional("largest height at its top")

    def build(self, name: str, defaults: GateDefaultsEntry, places: Places) -> CompositeElement:
        """Return a height to be reached between two gates."""
        bounds = Interval.between(self.height_min_m, self.height_max_m)
        height = _range("height", None, bounds, ("gates", name), places.reporter)
        return CompositeElement(name, (ElementPart(Manoeuvre(name=name, height=height, kind="high-turn")),))


@register
class VerticalRollEntry(KindEntry):
    """A roll on a steep line; one mention of it is two passages: the roll's begin and its end."""

    what: ClassVar[str] = "a vertical roll"
    type: Literal["vertical-roll"] = Field(description="a roll on a steep line")
    roll_deg: Annotated[float, Ge(45), Le(1080)] = Field(description="least angle of the roll")
    climb_deg: ClimbAngle = Field(default=90.0, description="climb angle of the line; negative for a roll downward")
    climb_tolerance_deg: Annotated[float, Ge(0.5), Le(30)] = Field(
        default=10.0, description="largest deviation from that climb angle while rolling"
    )
    turning: KnifeEdgeName = Field(default="either", description="which way it rolls, as the pilot sees it")
    height_min_m: Height | None = optional("height above the origin that must be reached at the end of the roll")
    height_gain_m: Annotated[float, Ge(0), Le(2000)] | None = optional("least height gained while rolling")

    def build(self, name: str, defaults: GateDefaultsEntry, places: Places) -> CompositeElement:
        """Return two passages on a steep line: where the roll begins, and where it ends."""
        reporter = places.reporter
        downward = self.climb_deg < 0.0
        begin = Manoeuvre(
            name=f"{name}/begin",
            climb=math.radians(self.climb_deg),
            climb_tolerance=math.radians(self.climb_tolerance_deg),
            kind="vertical-roll",
        )
        end = dataclasses.replace(begin, name=name, height=Interval.between(self.height_min_m, None))
        climb_deg, tolerance_deg = self.climb_deg, self.climb_tolerance_deg
        roll = Roll(
            angle=math.radians(self.roll_deg),
            climb=Interval.degrees(max(climb_deg - tolerance_deg, -90.0), min(climb_deg + tolerance_deg, 90.0)),
            # On the way down no height is gained.
            gain=-math.inf if downward else self.height_gain_m or 0.0,
            turning=Turning(self.turning),
        )
        if abs(self.climb_deg) < STEEP_DEG:
            reporter.value(
                ("gates", name, "climb_deg"),
                f"is not steep enough for a vertical roll: {STEEP_DEG:g} to 90 upward, -90 to -{STEEP_DEG:g} downward, "
                f"not {self.climb_deg:g}",
            )
        if downward and self.height_gain_m is not None:
            reporter.value(("gates", name, "height_gain_m"), "a roll downward gains no height; leave it out")
        return CompositeElement(name, (ElementPart(begin), ElementPart(end, roll=roll)))


def _over_ground(entry: ManoeuvreEntry, path: KeyPath, places: Places) -> tuple[Interval, Interval]:
    """Return the ranges of north and east, m."""
    point = places.geodetic(entry, path)
    exact = (entry.north_m, entry.east_m) if point is None else (point.north, point.east)
    north = Interval.between(entry.north_min_m, entry.north_max_m)
    east = Interval.between(entry.east_min_m, entry.east_max_m)
    if point is not None and (north.constrained or east.constrained):
        message = "is exact; not together with bounds of north or east, such as `north_min_m`"
        places.reporter.value((*path, "latitude_deg"), message)
        north = east = Interval()
    return (
        _range("north", exact[0], north, path, places.reporter),
        _range("east", exact[1], east, path, places.reporter),
    )


def _range(axis: str, exact: float | None, bounds: Interval, path: KeyPath, reporter: Reporter) -> Interval:
    if exact is not None:
        if bounds.constrained:
            reporter.value((*path, f"{axis}_m"), f"is exact; not together with `{axis}_min_m` or `{axis}_max_m`")
        return Interval.exactly(exact)
    if bounds.empty:
        reporter.value(
            (*path, f"{axis}_min_m"), f"must not exceed `{axis}_max_m`, {bounds.upper:g}, but is {bounds.lower:g}"
        )
    return bounds
