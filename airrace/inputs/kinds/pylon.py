"""Single pylons in the track language."""

import math
from collections.abc import Mapping
from typing import ClassVar, Literal

from pydantic import Field

from airrace.inputs.features import Feature, Step
from airrace.inputs.kinds.defaults import GateDefaultsEntry, PassingEntry, Reach
from airrace.inputs.kinds.entry import KindEntry, chosen
from airrace.inputs.kinds.passing import (
    HEIGHT_M,
    PYLON_CLEARANCE_M,
    REACH_M,
    check_passing,
    passing_of,
    silent_passing,
    tolerances_of,
)
from airrace.inputs.place_schema import Azimuth, PlacedEntry
from airrace.inputs.places import Places
from airrace.track.gates import Pylon


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
