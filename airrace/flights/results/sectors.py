"""Many recorded flights of one course, sector by sector: best, mean, spread, and the best race of what fits together.

A sector is a leg, from one passing to the next. The sum of the best sectors is no race that can be flown: a sector is
fast, too, because the one before it was left fast. So the best race passes from one flight to another only where both
make the passing alike and the second one with no more energy, see `JOINT`; of all such chains it is the fastest, by
dynamic programming from leg to leg.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from airrace.flights.results.comparison import ensure_comparable
from airrace.flights.results.flight import Flight, TimedCrossing, legs_of
from airrace.optimal_control.quantities import DEGREE, KNOT


@dataclass(frozen=True)
class Joint:
    """How alike two flights make a passing for one to go on as the other.

    Attributes:
        speed: largest difference, m/s.
        height, aside: likewise of the height and of the place over ground, m.
        heading, climb: likewise of the course over ground and of the climb angle, rad.
        energy: the largest energy height that the second flight may have more, m.
    """

    speed: float
    height: float
    aside: float
    heading: float
    climb: float
    energy: float

    def fits(self, crossing: TimedCrossing, other: TimedCrossing) -> bool:
        """Return whether a flight can go on as another one; False where a passing was not made, or is not known."""
        names = ("V_K", "height", "x", "y", "chi", "gamma", "h_E")
        apart = {name: other.value(name) - crossing.value(name) for name in names}
        turned = math.remainder(apart["chi"], 2.0 * math.pi) if math.isfinite(apart["chi"]) else math.nan
        return (
            abs(apart["V_K"]) <= self.speed
            and abs(apart["height"]) <= self.height
            and math.hypot(apart["x"], apart["y"]) <= self.aside
            and abs(turned) <= self.heading
            and abs(apart["gamma"]) <= self.climb
            and apart["h_E"] <= self.energy
        )


JOINT = Joint(speed=5.0 * KNOT, height=5.0, aside=5.0, heading=5.0 * DEGREE, climb=5.0 * DEGREE, energy=2.0)
"""The joints of the best race: what a pilot makes good within a second, and energy as receivers resolve it."""


@dataclass(frozen=True)
class Sector:
    """One leg in many flights.

    Attributes:
        name: of the passing that it ends in.
        lap: that it belongs to.
        times: by flight, s; NaN where a flight lacks it.
    """

    name: str
    lap: int
    times: tuple[float, ...]

    @property
    def complete(self) -> list[float]:
        """The times of the flights that have it, s."""
        return [time for time in self.times if math.isfinite(time)]

    @property
    def best(self) -> int:
        """The number of the fastest flight; 0 where none has it."""
        return int(np.nanargmin(self.times)) if self.complete else 0

    @property
    def best_time(self) -> float:
        """The least time, s; NaN where no flight has it."""
        return min(self.complete, default=math.nan)

    @property
    def mean(self) -> float:
        """The mean time, s; NaN where no flight has it."""
        return float(np.mean(self.complete)) if self.complete else math.nan

    @property
    def deviation(self) -> float:
        """The standard deviation from flight to flight, s; NaN for fewer than two."""
        return float(np.std(self.complete, ddof=1)) if len(self.complete) > 1 else math.nan

    @property
    def spread(self) -> float:
        """The difference of the slowest and the fastest, s; NaN where no flight has it."""
        return max(self.complete, default=math.nan) - self.best_time


@dataclass(frozen=True)
class SectorTimes:
    """Many flights of one course, sector by sector.

    Attributes:
        flights: at least two.
        sectors: in race order.
        choice: of the best race, the number of the flight of every sector; empty where no chain leads to the finish.
    """

    flights: tuple[Flight, ...]
    sectors: tuple[Sector, ...]
    choice: tuple[int, ...]

    @property
    def sum_of_best(self) -> float:
        """The sum of the best sectors, whether they fit together or not, s."""
        return sum(sector.best_time for sector in self.sectors)

    @property
    def best_race(self) -> float:
        """The time of the best race of sectors that fit together, s; NaN where there is none."""
        if not self.choice:
            return math.nan
        return sum(sector.times[number] for sector, number in zip(self.sectors, self.choice, strict=True))

    @property
    def fastest(self) -> Flight:
        """The flight with the least race time."""
        return min(self.flights, key=lambda flight: flight.race_time if math.isfinite(flight.race_time) else math.inf)

    @property
    def pieces(self) -> list[tuple[Flight, str]]:
        """The best race in pieces: a flight, and the passing up to which it is flown as that one."""
        pieces: list[tuple[Flight, str]] = []
        for number, group in itertools.groupby(zip(self.choice, self.sectors, strict=False), key=lambda pair: pair[0]):
            *_, (_, last) = group
            pieces.append((self.flights[number], last.name))
        return pieces


def sector_times(flights: Sequence[Flight], joint: Joint = JOINT) -> SectorTimes:
    """Return the sectors of at least two flights of the same passings.

    Raises:
        UsageError: the courses have other passings; names the first that differs.
    """
    for flight in flights[1:]:
        ensure_comparable((flights[0].label, flights[0].course), (flight.label, flight.course))
    legs = [legs_of(flight) for flight in flights]
    sectors: list[Sector] = []
    for same_leg in zip(*legs, strict=True):
        sectors.append(Sector(same_leg[0].name, same_leg[0].lap, tuple(leg.time for leg in same_leg)))
    return SectorTimes(tuple(flights), tuple(sectors), _fastest_chain(flights, sectors, joint))


def _fastest_chain(flights: Sequence[Flight], sectors: Sequence[Sector], joint: Joint) -> tuple[int, ...]:
    """Return the flight of every sector on the fastest chain; empty where none leads to the finish."""
    numbers = range(len(flights))
    arrival = [0.0] * len(flights)  # the least time up to the present passing as a flight makes it, s
    origins: list[list[int]] = []  # by passing and flight, the flight of the sector before
    for place, sector in enumerate(sectors):
        crossings = [flight.crossings[place] for flight in flights]
        starts: list[float] = []
        origin: list[int] = []
        for number in numbers:
            fitting = [other for other in numbers if other == number or joint.fits(crossings[other], crossings[number])]
            # Of equals the flight itself, so that it is left only where that saves time.
            ranked = sorted(fitting, key=lambda other, own=number: (arrival[other], other != own))
            origin.append(ranked[0])
            starts.append(arrival[ranked[0]])
        origins.append(origin)
        times = [time if math.isfinite(time) else math.inf for time in sector.times]
        arrival = [start + time for start, time in zip(starts, times, strict=True)]
    last = arrival.index(min(arrival))
    if not math.isfinite(arrival[last]):
        return ()
    choice = [last]
    for origin in reversed(origins[1:]):
        choice.append(origin[choice[-1]])
    return tuple(reversed(choice))
