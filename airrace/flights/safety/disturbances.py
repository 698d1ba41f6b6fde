"""What disturbs a flight in closed loop, and by how much by default."""

from dataclasses import dataclass, fields
from enum import StrEnum
from typing import TypedDict

from airrace.optimal_control.quantities import KNOT

WIND_ERROR_KT = 2.5
"""The standard deviation of either horizontal component of the wind, kt."""
MASS_ERROR_PERCENT = 2.0
"""That of the mass."""
POWER_ERROR_PERCENT = 2.0
"""That of the power."""
DENSITY_ERROR_PERCENT = 1.0
"""That of the air's density."""
ROLL_TIMING = 0.02
"""That of the time by which rolls begin late or early, s; a judgement."""
PILOT_DELAY = 0.1
"""The time from what the pilot sees to the stick that moves, s; see `airrace.flights.safety.pilot`."""
WIND_SPEED_ERROR_KT, WIND_DIRECTION_ERROR_DEG = 3.0, 15.0
"""The errors of a wind as pilots are told it that 95 % of winds are within. They lie between those that ICAO's Annex 3
wants a measurement (1 kt or 10 %, 10 degrees) and a forecast (5 kt, 20 degrees) to keep."""


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


@dataclass(frozen=True)
class Disturbances:
    """All that disturbs a flight, by the names and in the units of options and of `rules.reserve`.

    The defaults are those of a run without a reserve.
    """

    gusts: str = Gusts.LIGHT.value
    wind_error_kt: float = WIND_ERROR_KT
    mass_error_percent: float = MASS_ERROR_PERCENT
    power_error_percent: float = POWER_ERROR_PERCENT
    density_error_percent: float = DENSITY_ERROR_PERCENT
    roll_timing_s: float = ROLL_TIMING
    delay_s: float = PILOT_DELAY

    @classmethod
    def of_reserve(cls, reserve: object) -> "Disturbances":
        """Return those that a reserve is asked for in, which has them by the same names."""
        return cls(**{key.name: getattr(reserve, key.name) for key in fields(cls)})


class ChosenDisturbances(TypedDict, total=False):
    """Disturbances that people choose, see `Disturbances`; what is left out or None stays as it is by default.

    `gusts` is `none`, `light`, `moderate` or `severe`; errors are standard deviations: of the wind to the north and to
    the east, of mass, power and the air's density, and of the time by which rolls are late or early. `delay_s` is that
    of the pilot.
    """

    gusts: str | None
    wind_error_kt: float | None
    mass_error_percent: float | None
    power_error_percent: float | None
    density_error_percent: float | None
    roll_timing_s: float | None
    delay_s: float | None


@dataclass(frozen=True)
class Scatter:
    """The standard deviations of what is not as it was when the race was optimised, and the gusts.

    Attributes:
        gusts: the turbulence.
        wind: of either horizontal component of the wind, m/s: an error of its speed as well as of its direction.
        mass, power, density: shares.
        timing: of the time by which the ailerons come late, or early, on a leg, s.
    """

    gusts: Gusts = Gusts.LIGHT
    wind: float = WIND_ERROR_KT * KNOT
    mass: float = 0.01 * MASS_ERROR_PERCENT
    power: float = 0.01 * POWER_ERROR_PERCENT
    density: float = 0.01 * DENSITY_ERROR_PERCENT
    timing: float = ROLL_TIMING

    @property
    def constant(self) -> tuple[float, ...]:
        """The standard deviations of a `Disturbance` that lasts for the flight, six of them."""
        return (self.wind, self.wind, 0.0, self.mass, self.power, self.density)


UNDISTURBED = Scatter(Gusts.NONE, 0.0, 0.0, 0.0, 0.0, timing=0.0)
