"""Roses of winds: their winds by speed and direction, and what makes one of them the wind of a course."""

import re
from dataclasses import dataclass

from airrace.errors import UsageError

WIND = "environment.wind"
SPEED, OTHER_SPEED, ORIGIN = f"{WIND}.speed_kt", f"{WIND}.speed_m_s", f"{WIND}.from_deg"


@dataclass(frozen=True)
class Wind:
    """A wind of a rose: speed, kt, and where it blows from, deg."""

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
    found = re.fullmatch(r"(\d+(?:\.\d+)?(?:,\d+(?:\.\d+)?)*)kt(?:@(\d+))?", text)
    count = int(found[2] or 8) if found else 0
    if not found or not 1 <= count <= 72:
        raise UsageError(
            f"{text!r} is no rose of winds; one is 0,5,10kt@8: speeds, and from how many directions (1 to 72)"
        )
    speeds = [float(one) for one in found[1].split(",")]
    return [Wind(speed, 360.0 * one / count) for speed in speeds for one in range(count if speed else 1)]


def overrides_of(wind: Wind) -> tuple[tuple[str, str], ...]:
    """Return keys and values that make it the wind of a course, whichever speed that has; the profile stays."""
    if not wind.speed_kt:
        return ((WIND, "null"),)
    return (OTHER_SPEED, "null"), (SPEED, f"{wind.speed_kt:g}"), (ORIGIN, f"{wind.from_deg:g}")
