"""The keys that gates and pylons have in common, and `gate_defaults`, which gives values to absent keys."""

from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Gt, Le
from pydantic import Field

from airrace.inputs.place_schema import ClimbAngle, Height
from airrace.inputs.schema import Schema

Reach = Annotated[float, Gt(0), Le(5000)]


class PassingEntry(Schema):
    """The keys that gates and pylons have in common; an absent one takes the value of `gate_defaults`."""

    height_m: Height | None = Field(
        default=None, description="nominal height of the passing above the origin; exact where `passing` is `point`"
    )
    passing: Literal["point", "window"] | None = Field(
        default=None, description="`point`: passed exactly here; `window`: anywhere within the tolerances"
    )
    clearance_m: Annotated[float, Ge(0), Le(50)] | None = Field(
        default=None, description="least distance of the wing tips from a pylon"
    )
    height_min_m: Height | None = Field(default=None, description="least legal height of a `window` passing")
    height_max_m: Height | None = Field(default=None, description="largest legal height of a `window` passing")
    climb_min_deg: ClimbAngle | None = Field(
        default=None, description="least climb angle at the passing, negative in descent"
    )
    climb_max_deg: ClimbAngle | None = Field(default=None, description="largest climb angle at the passing")
    crossing_max_deg: Annotated[float, Gt(0), Le(85)] | None = Field(
        default=None, description="largest horizontal angle between the path and the axis"
    )


class GatePassingEntry(PassingEntry):
    """The keys that all two-pylon gates have in common."""

    width_m: Annotated[float, Gt(0), Le(500)] | None = Field(
        default=None, description="distance between the two pylons"
    )
    bank_tolerance_deg: Annotated[float, Gt(0), Le(90)] | None = Field(
        default=None, description="largest deviation from the prescribed bank in a `window` passing"
    )


class GateDefaultsEntry(GatePassingEntry):
    """The values of keys that gates and pylons leave out.

    `clearance_m` is meant for two-pylon gates alone: at a single pylon it has its own default.
    """

    what: ClassVar[str] = "gate_defaults"
    reach_m: Reach | None = Field(
        default=None, description="farthest distance from a single pylon at which its passing counts"
    )
