"""The stamp of a flight: what it is, beside everything shown, printed or exported of it."""

import math
from dataclasses import dataclass

from airrace.model.environment import Air, StaticWind, atmosphere_parameters, density, temperature
from airrace.optimal_control.quantities import KNOT
from airrace.procedure.result import Status
from airrace.race import Race

FREEZING = 273.15
"""The temperature of 0 degrees Celsius, K."""


@dataclass(frozen=True)
class ReserveState:
    """What was asked of a flight in disturbances, and how far the search for it has come.

    Attributes:
        asked: the probability that a flight breaks no limit.
        measured: the share of closed-loop flights that break none; None while no search has ended.
        flights: their number; 0 while no search has ended.
        reached: whether that is the probability asked.
        source: the run whose margins these are, where flights along this very flight were not measured; else empty.
        attempts: the number of attempts that the search has finished; 0 where it has ended.
        attempts_max: the largest number of attempts.
    """

    asked: float
    measured: float | None = None
    flights: int = 0
    reached: bool = False
    source: str = ""
    attempts: int = 0
    attempts_max: int = 0

    @property
    def text(self) -> str:
        """The state as a clause."""
        if self.measured is None:
            count = f"; {self.attempts} of {self.attempts_max} attempts made" if self.attempts else ""
            return f"{self.asked:g} asked, not reached yet: this is the line without{count}"
        measured = f"{self.measured:.3g} of {self.flights:,} measured"
        if self.source:
            return f"{self.asked:g} asked, margins of {self.source}: {measured} there, not of this flight"
        return f"{measured}, {self.asked:g} asked" if self.reached else f"{self.asked:g} asked, not reached: {measured}"


@dataclass(frozen=True)
class Stamp:
    """What a flight is.

    Attributes:
        stage: of the run, e.g. `six-dof`; empty for a recorded flight.
        status: the trust that an optimum deserves; None for what is no optimum.
        failed: the items of its certificate that fail, or what else speaks against it.
        aircraft: its name.
        air: wind, temperature and density, in words.
        pilot: whose limits the pilot keeps to, e.g. `race`; empty for what is no optimum.
        reserve: what was asked of it in disturbances; None for nothing.
        by_hand: whether the course has margins that no search for a reserve has found.
    """

    stage: str
    status: Status | None
    failed: tuple[str, ...]
    aircraft: str
    air: str
    pilot: str
    reserve: ReserveState | None = None
    by_hand: bool = False

    @property
    def certified(self) -> bool | None:
        """Whether it is a certified optimum; None where that is no question."""
        return None if self.status is None else self.status is Status.CERTIFIED

    @property
    def verdict(self) -> str:
        """Whether it is certified, and if not, why: a clause; empty for what is no optimum."""
        match self.status:
            case None:
                return ""
            case Status.CERTIFIED:
                return "certified"
            case Status.NOT_CERTIFIED:
                return f"not certified: {', '.join(self.failed)}" if self.failed else "not certified"
            case Status.SOLVED:
                return "not certified: solved on one mesh"
            case _:
                return f"not certified: {self.status.value}"

    @property
    def reserve_text(self) -> str:
        """The reserve as a clause; empty for what is no optimum."""
        if self.status is None:
            return ""
        if self.reserve is not None:
            return self.reserve.text
        return "none asked, margins of the inputs" if self.by_hand else "none"

    def entries(self) -> dict[str, str]:
        """Return names and values, each a plain text in one line; what is no question of this flight is left out."""
        values = {
            "stage": self.stage or "as flown",
            "certificate": self.verdict,
            "aircraft": self.aircraft,
            "air": self.air,
            "pilot's limits": self.pilot,
            "reserve": self.reserve_text,
        }
        return {name: value for name, value in values.items() if value}

    def properties(self) -> dict[str, str]:
        """Return the entries that formats of flights have no field of their own for, by names that are identifiers."""
        return {
            "certificate": self.verdict,
            "air": self.air,
            "pilot": self.pilot,
            "reserve": self.reserve_text,
        }

    @property
    def circumstances(self) -> str:
        """Aircraft, air, pilot's limits and reserve in one line, beside a verdict on the stage."""
        named = ("pilot's limits", "reserve")
        values = {name: value for name, value in self.entries().items() if name not in ("stage", "certificate")}
        return "; ".join(f"{name}: {value}" if name in named else value for name, value in values.items())

    @property
    def text(self) -> str:
        """All of it in one line."""
        entries = self.entries()
        head = ", ".join(entries[name] for name in ("stage", "certificate") if name in entries)
        return f"{head}; {self.circumstances}"


def stamp_of(
    race: Race,
    *,
    stage: str = "",
    status: Status | None = None,
    failed: tuple[str, ...] = (),
    pilot: str = "",
    reserve: ReserveState | None = None,
) -> Stamp:
    """Return the stamp of a flight of a race; the arguments are those of `Stamp`."""
    by_hand = race.rules_course is not None and reserve is None  # a reserve finds its own margins, and takes no others
    return Stamp(stage, status, failed, race.aircraft.name, air_text(race.air), pilot, reserve, by_hand=by_hand)


def air_text(air: Air) -> str:
    """Return the air of the day in words: the wind, and temperature and density at the height of the origin."""
    numbers = atmosphere_parameters(air)
    degrees, mass = float(temperature(0.0, numbers)) - FREEZING, float(density(0.0, numbers))
    count = len(air.thermals)
    thermals = f", {count} thermal{'' if count == 1 else 's'}" if count else ""
    return f"{wind_text(air.wind)}, {degrees:.0f} C, {mass:.3f} kg/m3{thermals}"


def wind_text(wind: StaticWind | None) -> str:
    """Return a wind in words."""
    if wind is None or wind.speed == 0.0:
        return "still air"
    return f"wind {wind.speed / KNOT:.0f} kt from {math.degrees(wind.origin) % 360.0:.0f} degrees"
