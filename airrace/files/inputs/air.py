"""The air of the day in a track file: deviations from the standard atmosphere, wind, thermals; and roses of winds."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Gt, Le
from pydantic import Field

from airrace.errors import UsageError
from airrace.files.inputs.nodes import THERMALS_MAX, KeyPath, Reporter, dotted
from airrace.files.inputs.places import Azimuth, PlacedEntry, Places
from airrace.files.inputs.schema import Schema, optional
from airrace.model.environment import Air, Profile, StaticWind, Thermal
from airrace.optimal_control.quantities import KNOT

WIND_PATH: KeyPath = ("environment", "wind")
WIND = dotted(WIND_PATH)
SPEED, OTHER_SPEED, ORIGIN = f"{WIND}.speed_kt", f"{WIND}.speed_m_s", f"{WIND}.from_deg"


class WindEntry(Schema):
    """A static wind, with exactly one of `speed_kt` and `speed_m_s`."""

    what: ClassVar[str] = "a wind"
    from_deg: Azimuth = Field(description="the direction it blows from")
    speed_kt: Annotated[float, Ge(0), Le(100)] | None = optional(
        "its speed at the reference height; or give `speed_m_s`"
    )
    speed_m_s: Annotated[float, Ge(0), Le(51)] | None = optional(
        "its speed at the reference height; or give `speed_kt`"
    )
    profile: Literal["constant", "power", "log"] = Field(default="constant", description="how it changes with height")
    reference_height_m: Annotated[float, Gt(0), Le(1000)] | None = optional(
        "the height above the ground at which it was measured"
    )
    exponent: Annotated[float, Ge(0), Le(1)] | None = optional("of the power law, with `profile: power`")
    roughness_m: Annotated[float, Gt(0), Le(5)] | None = optional("roughness length of the ground, with `profile: log`")

    def numbers(self) -> Mapping[str, float]:
        """Return the numbers that hold where the file gives none, by their keys."""
        defaults = StaticWind(origin=0.0, speed=0.0)
        numbers = {"reference_height_m": defaults.reference_height}
        if self.profile == Profile.POWER.value:
            numbers["exponent"] = defaults.exponent
        if self.profile == Profile.LOG.value:
            numbers["roughness_m"] = defaults.roughness
        return numbers

    def build(self, reporter: Reporter) -> StaticWind:
        """Return the wind; valid only if nothing was reported."""
        if self.speed_kt is None and self.speed_m_s is None:
            reporter.key(WIND_PATH, "missing; a wind needs `speed_kt` or `speed_m_s`")
        if self.speed_kt is not None and self.speed_m_s is not None:
            reporter.key((*WIND_PATH, "speed_m_s"), "the speed is given twice; keep one of `speed_kt` and `speed_m_s`")
        # A key that the profile does not use would have no effect, silently.
        for key, value, profile in (("exponent", self.exponent, "power"), ("roughness_m", self.roughness_m, "log")):
            if value is not None and self.profile != profile:
                reporter.key((*WIND_PATH, key), f"belongs to `profile: {profile}`; the profile is {self.profile}")
        shape = {"reference_height": self.reference_height_m, "exponent": self.exponent, "roughness": self.roughness_m}
        wind = StaticWind(
            origin=math.radians(self.from_deg),
            speed=self.speed_m_s if self.speed_m_s is not None else (self.speed_kt or 0.0) * KNOT,
            profile=Profile(self.profile),
            **{name: value for name, value in shape.items() if value is not None},
        )
        if wind.profile is Profile.LOG and wind.reference_height <= wind.roughness:
            message = f"must be above the roughness of {wind.roughness:g} m in a log profile"
            reporter.value((*WIND_PATH, "reference_height_m"), message)
        return wind


class ThermalEntry(PlacedEntry):
    what: ClassVar[str] = "a thermal"
    w_star_m_s: Annotated[float, Gt(0), Le(10)] = Field(description="the convective velocity scale")
    mixing_height_m: Annotated[float, Ge(100), Le(5000)] = Field(description="the depth of the mixing layer")


class EnvironmentEntry(Schema):
    what: ClassVar[str] = "the environment"
    temperature_offset_K: Annotated[float, Ge(-60), Le(60)] = Field(
        default=0.0, description="how much warmer the day is than the standard atmosphere"
    )
    pressure_offset_hPa: Annotated[float, Ge(-100), Le(100)] = Field(
        default=0.0, description="how much the pressure at sea level is above that of the standard atmosphere"
    )
    wind: WindEntry | None = optional("the wind of the day; without it the air is still")
    thermals: Annotated[list[ThermalEntry], Field(max_length=THERMALS_MAX)] = Field(
        default_factory=list[ThermalEntry], description="columns of rising air"
    )

    def build(self, places: Places) -> Air:
        """Return the air above a track; valid only if nothing was reported."""
        thermals: list[Thermal] = []
        for index, entry in enumerate(self.thermals):
            place = places.point(entry, ("environment", "thermals", index))
            thermals.append(Thermal(place.north, place.east, entry.w_star_m_s, entry.mixing_height_m))
        return Air(
            temperature_offset=self.temperature_offset_K,
            pressure_offset=self.pressure_offset_hPa * 100.0,
            elevation=places.origin.elevation,
            wind=self.wind.build(places.reporter) if self.wind else None,
            thermals=tuple(thermals),
        )


@dataclass(frozen=True)
class Wind:
    """A wind of a rose: speed, kt, and direction it blows from, deg."""

    speed_kt: float
    from_deg: float

    @property
    def text(self) -> str:
        """The wind in words, e.g. `10 kt from 090`."""
        return f"{self.speed_kt:g} kt from {self.from_deg:03.0f}" if self.speed_kt else "calm"


def winds_named(text: str) -> list[Wind]:
    """Return the winds of a rose, e.g. of `0,5,10kt@8`: these speeds from eight directions; a calm is one wind.

    Raises:
        UsageError: it is no rose.
    """
    match = re.fullmatch(r"(\d+(?:\.\d+)?(?:,\d+(?:\.\d+)?)*)kt(?:@(\d+))?", text)
    count = int(match[2] or 8) if match else 0
    if not match or not 1 <= count <= 72:
        raise UsageError(
            f"{text!r} is no rose of winds; one is 0,5,10kt@8: speeds, and from how many directions (1 to 72)"
        )
    winds: list[Wind] = []
    for speed in map(float, match[1].split(",")):
        winds += [Wind(speed, 360.0 * number / count) for number in range(count if speed else 1)]
    return winds


def overrides_of(wind: Wind) -> tuple[tuple[str, str], ...]:
    """Return the keys and values that give a course this wind, whichever key its file uses for the speed."""
    if not wind.speed_kt:
        return ((WIND, "null"),)
    return (OTHER_SPEED, "null"), (SPEED, f"{wind.speed_kt:g}"), (ORIGIN, f"{wind.from_deg:g}")
