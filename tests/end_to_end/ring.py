"""A kind of gate in one file: a ring, passed through in any attitude.

The aircraft may lie in the ring however it likes, so its whole half span counts everywhere around it: that span beyond
the distance of its centre from the ring's axis must not come nearer to the ring than the clearance.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

from annotated_types import Ge, Gt, Le
from pydantic import Field

from airrace.files.inputs.kinds.kind import CompositeElement, ElementPart, GateDefaultsEntry, KindEntry, register
from airrace.files.inputs.places import Azimuth, Height, PlacedEntry, Places
from airrace.model.elementary import sqrt
from airrace.model.parameters import Parameter, attribute_parameter
from airrace.model.track.element import CrossingCandidate, Direction, Drawing, Frame, GateOutput, PlacedElement, Symbols
from airrace.model.track.gates import NOT_POSITIVE, ZERO, offsets
from airrace.optimal_control.quantities import Interval, Quantity

CROSSING = math.radians(45.0)
"""The largest horizontal angle between path and axis, rad."""
ROUNDED = 0.01
"""The length that keeps the distance from the axis smooth on the axis itself, m."""


def _farthest(crossing: Symbols, place: Symbols) -> Sequence[Any]:
    right, up = crossing["right"], crossing["height"] - place["centre_height"]
    return [sqrt(right * right + up * up + ROUNDED**2) + place["half_span"]]


OUTPUT = GateOutput(
    name="ring",
    quantities=(Quantity("farthest", "m", scale=100.0, text="how far a wing tip may be from the ring's axis"),),
    parameters=(Quantity("centre_height", "m", scale=100.0, text="height of the ring's centre"),),
    values=_farthest,
)


@dataclass(frozen=True)
class Ring(PlacedElement):
    """A ring about a centre, its axis level; `diameter` is that of its opening, m."""

    name: str
    north: float
    east: float
    height: float
    heading: float
    diameter: float
    clearance: float

    directed = True

    @property
    def type_name(self) -> str:
        return "ring"

    @property
    def axis(self) -> float:
        return self.heading

    def crossings(self, direction: Direction, reference: float, *, rolling: bool) -> list[CrossingCandidate]:
        ways = {Direction.FORWARD: (0.0,), Direction.REVERSE: (math.pi,), Direction.PLANNED: (0.0, math.pi)}
        return [
            CrossingCandidate(self.position, self.heading + turned + float(offset), 0.0, None, self.heading + turned)
            for turned in ways[direction]
            for offset in offsets(4, CROSSING)
        ]

    def conditions(self, axis: float) -> dict[str, Interval]:
        return {
            "along": ZERO,
            "course_excess_right": NOT_POSITIVE,
            "course_excess_left": NOT_POSITIVE,
            "farthest": Interval(upper=self.diameter / 2 - self.clearance),
        }

    def frame(self, axis: float, bank: float, span: float) -> Frame:
        return Frame(self.north, self.east, axis=axis, crossing_tan=math.tan(CROSSING), half_span=span / 2)

    @property
    def output(self) -> GateOutput:
        return OUTPUT

    @property
    def output_values(self) -> tuple[float, ...]:
        return (self.height,)

    def parameters(self) -> Sequence[Parameter[Any]]:
        return [attribute_parameter(self, "diameter_m", "diameter", label="diameter", relaxing_step=1.0, limit=100.0)]

    def drawing(self) -> Drawing:
        half, right = self.diameter / 2, self.heading + math.pi / 2
        ends = self.beside(-half, right), self.beside(half, right)
        return Drawing(legend="ring, and the courses through it", across=ends, window=ends)

    def remarks(self, name: str) -> Iterator[tuple[str, str]]:
        if self.height < self.diameter / 2:
            yield "ring", f"the ring of `{name}` would stand in the ground: its radius is larger than its height"

    def misfit(self, span: float, aircraft: str) -> tuple[str, str] | None:
        room = self.diameter - 2.0 * self.clearance
        if room > span:
            return None
        return "diameter_m", f"leaves {room:g} m between its clearances; the wing of {aircraft} spans {span:g} m"


@register
class RingEntry(PlacedEntry, KindEntry):
    what: ClassVar[str] = "a ring"
    type: Literal["ring"] = Field(description="a ring, passed through in any attitude")
    heading_deg: Azimuth = Field(description="its axis in forward direction")
    height_m: Height = Field(description="the height of its centre above the origin")
    diameter_m: Annotated[float, Gt(0), Le(100)] = Field(default=16.0, description="the diameter of its opening")
    clearance_m: Annotated[float, Ge(0), Le(20)] = Field(default=0.5, description="least distance of a wing tip")

    def build(self, name: str, defaults: GateDefaultsEntry, places: Places) -> CompositeElement:
        place = places.point(self, ("gates", name))
        heading = math.radians(self.heading_deg)
        ring = Ring(name, place.north, place.east, self.height_m, heading, self.diameter_m, self.clearance_m)
        return CompositeElement(name, (ElementPart(ring),))
