"""The intensities of turbulence by name, which the command line reads without what simulates them."""

from enum import StrEnum

from airrace.quantities import KNOT


class Gusts(StrEnum):
    """An intensity of turbulence."""

    NONE = "none"
    LIGHT = "light"
    MODERATE = "moderate"
    SEVERE = "severe"

    @property
    def wind_at_20_ft(self) -> float:
        """The wind at 20 ft that belongs to it by MIL-F-8785C: 15, 30 and 45 kt; m/s."""
        return KNOT * {"none": 0.0, "light": 15.0, "moderate": 30.0, "severe": 45.0}[self.value]
