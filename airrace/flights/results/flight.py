"""A flight from any source: named histories on one time axis, the passings of its course, its legs and laps.

Flights of every source use these names. Angles are in radians; headings count clockwise from north.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from airrace.flights.results.attitude import interpolate_attitude
from airrace.flights.results.stamp import ReserveState, Stamp, stamp_of
from airrace.model.aircraft import Aircraft
from airrace.model.environment import Air
from airrace.model.frames import QUATERNION
from airrace.model.track.course import Course, Passage
from airrace.optimal_control.quantities import Interval, Quantity
from airrace.optimal_control.trajectory import Array
from airrace.procedure.result import StageResult, Status
from airrace.procedure.settings import Settings
from airrace.race import Race

GLOSSARY = {
    quantity.name: quantity
    for quantity in (
        Quantity("z", "m", text="below the track's origin"),
        Quantity("height", "m", text="height above the track's origin"),
        Quantity("altitude", "m", text="height above mean sea level"),
        Quantity("latitude", "rad", text="geodetic latitude, WGS 84"),
        Quantity("longitude", "rad", text="geodetic longitude, WGS 84"),
        Quantity("V_K", "m/s", text="kinematic speed: along the flight path, relative to the ground"),
        Quantity("V_A", "m/s", text="true airspeed"),
        Quantity("V_I", "m/s", text="indicated airspeed of an instrument without errors (calibrated airspeed)"),
        Quantity("V_G", "m/s", text="speed over ground, its horizontal part"),
        Quantity("chi", "rad", text="course over ground"),
        Quantity("gamma", "rad", text="climb angle"),
        Quantity("mu", "rad", text="kinematic bank angle, right wing down"),
        Quantity("alpha_A", "rad", text="angle of attack"),
        Quantity("psi", "rad", text="heading of the body"),
        Quantity("theta", "rad", text="pitch angle of the body"),
        Quantity("phi", "rad", text="roll angle of the body"),
        Quantity("b0", "1", text="attitude of the body in the north-east-down frame, scalar part"),
        Quantity("b1", "1", text="attitude of the body, north part"),
        Quantity("b2", "1", text="attitude of the body, east part"),
        Quantity("b3", "1", text="attitude of the body, down part"),
        Quantity("h_E", "m", text="energy height, height + V_K^2 / (2 g0)"),
    )
}
"""Declarations of the derived histories, by name."""
BODY_ATTITUDE = ("b0", "b1", "b2", "b3")
"""The quaternion of the body, scalar first."""


class Basis(Enum):
    """The origin of the values of a history.

    `SOLVED`: states and controls of an optimum. `MEASURED`: a recording. `DERIVED`: computed from the others.
    """

    SOLVED = "solved"
    MEASURED = "measured"
    DERIVED = "derived"


@dataclass(frozen=True, eq=False)
class History:
    """One quantity over time.

    Attributes:
        quantity: its name, unit (SI and radians), meaning, and the bounds that applied to it.
        values: at the times of the flight it belongs to, shape (n,); NaN where nothing is known.
        basis: where the values come from.
    """

    quantity: Quantity
    values: Array
    basis: Basis


Histories = Mapping[str, History]
"""Histories by the names of their quantities, all over one time axis."""


ANGLES = frozenset({"chi", "mu", "psi", "phi", "longitude"})
"""Histories that jump by a full turn."""


@dataclass(frozen=True)
class TimedCrossing:
    """One passing of the course in a flight.

    Attributes:
        passage: what was passed; its name is unique over the race, its `lap` counts from 1.
        time: s after the start; NaN where the flight did not pass it.
        values: every history at that instant, by name, in SI units and radians.
    """

    passage: Passage
    time: float
    values: Mapping[str, float]

    @property
    def name(self) -> str:
        """The name of the passage, e.g. `2:g4`."""
        return self.passage.name

    @property
    def lap(self) -> int:
        """The lap that the passing belongs to."""
        return self.passage.lap

    @property
    def found(self) -> bool:
        """Whether the flight made this passing at all."""
        return math.isfinite(self.time)

    def value(self, name: str) -> float:
        """Return a history at the passing; NaN where the flight has no such history."""
        return self.values.get(name, math.nan)


@dataclass(frozen=True)
class Verification:
    """The outcome of measuring a stored flight again.

    Attributes:
        verified: whether all that is stored of it agrees with what was measured; None where nothing was measured.
        reason: why not, a clause, or as what it is verified where that is not all; empty where there is nothing to add.
    """

    verified: bool | None
    reason: str = ""

    @property
    def outcome(self) -> str:
        """The outcome in two words."""
        return "not verified" if self.verified is None else "verified" if self.verified else "verification failed"

    @property
    def words(self) -> str:
        """The outcome with its reason."""
        return f"{self.outcome}{' as ' if self.verified else ': '}{self.reason}" if self.reason else self.outcome

    @property
    def remark(self) -> str:
        """The words, beside an error that states what was refuted."""
        return self.outcome if self.refutation else self.words

    @property
    def refutation(self) -> str:
        """The words of a verification that failed; empty for any other."""
        return self.words if self.verified is False else ""


@dataclass(frozen=True, eq=False)
class StoredOptimum:
    """An optimum with what its problem is stated from."""

    race: Race
    settings: Settings
    result: StageResult


@dataclass(frozen=True)
class Entrant:
    """Who flies, as an audience is told.

    Attributes:
        name: of the pilot or the team; empty for the label of the flight.
        nation: its code of two or three letters, e.g. `SUI`; empty where it is not told.
        number: of the race, at most four letters or digits; likewise.
        colour: of the flight in scene and graphics, `#rrggbb`; likewise.
    """

    name: str = ""
    nation: str = ""
    number: str = ""
    colour: str = ""


NOBODY = Entrant()
"""The entrant of a flight of which nobody has told who flies."""


@dataclass(frozen=True)
class Penalty:
    """A penalty as it is called during a race.

    Attributes:
        passing: the name of the passage; empty for the flight as a whole.
        rule: that is broken, as of `airrace.flights.logs.violations.Violation`.
        time: s after the start of the flight.
        seconds: that are added; infinity where the race is over, NaN where the rules name none.
    """

    passing: str
    rule: str
    time: float
    seconds: float


@dataclass(frozen=True)
class Source:
    """The source of a flight: what it is called, and where it comes from.

    Attributes:
        label: what people call it, e.g. `rovinj.h5:six-dof`; unique among flights that are shown together.
        stage: the stage of a run, e.g. `six-dof`; empty for a recorded flight.
        status: the trust that an optimum deserves, such as `certified` or `solved`; None for what is no optimum.
        version: of airrace, where it has computed the flight; empty else.
        remark: a sentence for the reader; often empty.
        verification: the outcome of measuring it again; None where that was no question.
        failed: the items of its certificate that fail, or what else speaks against it.
        pilot: whose limits the pilot of an optimum keeps to; empty for what is no optimum.
        reserve: what was asked of an optimum in disturbances; None for nothing.
        begins: when the flight's clock starts; None where it is unknown, as of an optimum.
        penalties: of what is certain in a recorded flight, in words; empty for what is no recorded one.
        displaced: sentences on the gates that by several recorded flights stand elsewhere, where these are judged.
        optimum: of which the multipliers are known; else None.
        entrant: who flies.
        called_penalties: for what a recorded flight certainly breaks, in the order of time.
    """

    label: str
    stage: str = ""
    status: Status | None = None
    version: str = ""
    remark: str = ""
    verification: Verification | None = None
    failed: tuple[str, ...] = ()
    pilot: str = ""
    reserve: ReserveState | None = None
    begins: datetime | None = None
    penalties: str = ""
    displaced: tuple[str, ...] = ()
    optimum: StoredOptimum | None = field(default=None, compare=False, repr=False)
    entrant: Entrant = NOBODY
    called_penalties: tuple[Penalty, ...] = ()

    @property
    def certified(self) -> bool | None:
        """Whether it is a certified optimum; None where that is no question."""
        return None if self.status is None else self.status is Status.CERTIFIED

    @property
    def verdict(self) -> str:
        """The status in words for people; empty for what is no optimum."""
        if self.status is None:
            return ""
        return "solved on one mesh" if self.status is Status.SOLVED else self.status.value

    @property
    def state(self) -> str:
        """The verdict, and whether it was verified where that was a question; empty for what is no optimum."""
        outcome = "" if self.verification is None else self.verification.outcome
        return ", ".join(text for text in (self.verdict, outcome) if text)

    @property
    def doubtful(self) -> bool:
        """Whether something that was measured of an optimum does not hold, or nothing was measured."""
        return self.status not in (None, Status.CERTIFIED, Status.SOLVED)

    def stamp(self, race: Race) -> Stamp:
        """Return the stamp of the flight, which is one of this race."""
        return stamp_of(
            race,
            stage=self.stage,
            status=self.status,
            failed=self.failed,
            pilot=self.pilot,
            reserve=self.reserve,
        )


@dataclass(frozen=True, eq=False)
class Flight:
    """A flight of one race, from any source.

    Which histories it has depends on the source: a point mass has no surfaces, a recording may know positions alone.
    Ask with `name in flight`, `flight[name]`, or take `flight.values(name)`, which is NaN throughout for a history
    that is not there. Names are those of the flight model and of `airrace.flights.results.flight`.

    Attributes:
        race: course, aircraft and air.
        source: where it comes from.
        time: s after the start, rising, shape (n,). The crossings of an optimum are among the times.
        histories: by name, each over `time`.
        crossings: one per passage of the course, in order.
    """

    race: Race
    source: Source
    time: Array
    histories: Histories
    crossings: tuple[TimedCrossing, ...]

    @property
    def course(self) -> Course:
        """The course of the race."""
        return self.race.course

    @property
    def aircraft(self) -> Aircraft:
        """The aircraft that flies."""
        return self.race.aircraft

    @property
    def air(self) -> Air:
        """The air of the day."""
        return self.race.air

    @property
    def label(self) -> str:
        """The name that people call the flight by."""
        return self.source.label

    @property
    def stamp(self) -> Stamp:
        """What the flight is: stage, certificate, aircraft, air, pilot's limits and reserve."""
        return self.source.stamp(self.race)

    @property
    def race_time(self) -> float:
        """The time from the first passing to the last, s; NaN where one of them is missing."""
        return self.crossings[-1].time - self.crossings[0].time if self.crossings else math.nan

    def __repr__(self) -> str:
        time = f"{self.race_time:.3f} s" if math.isfinite(self.race_time) else "not finished"
        return f"<Flight {self.label}: {time}, {len(self.time)} times, {len(self.histories)} histories>"

    def __contains__(self, name: object) -> bool:
        return name in self.histories

    def __getitem__(self, name: str) -> Array:
        """Return the values of a history, shape (n,).

        Raises:
            KeyError: the flight has no such history.
        """
        return self.histories[name].values

    def values(self, name: str) -> Array:
        """Return the values of a history, shape (n,); NaN throughout where the flight has none of this name."""
        return self.histories[name].values if name in self.histories else np.full(len(self.time), np.nan)

    def has(self, *names: str) -> bool:
        """Return whether the flight has all of these histories."""
        return all(name in self.histories for name in names)

    def limit(self, name: str) -> Interval:
        """Return the bounds that applied to a history; unbounded where there were none."""
        if name not in self.histories:
            return Interval()
        quantity = self.histories[name].quantity
        return Interval(quantity.lower, quantity.upper)

    def basis(self, name: str) -> Basis:
        """Return whether a history is solved, measured or derived.

        Raises:
            KeyError: the flight has no such history.
        """
        return self.histories[name].basis

    def at(self, times: Sequence[float] | Array) -> "Flight":
        """Return the same flight over other times.

        Histories are interpolated linearly, angles along the shorter way; the times of an optimum are so close that
        positions are true to a few millimetres. Before the first and after the last time the ends hold.

        Args:
            times: s after the start, rising, shape (m,).
        """
        time, values = np.asarray(times, np.float64), dict[str, Array]()
        for name, history in self.histories.items():
            turning = name in ANGLES
            between = np.interp(time, self.time, np.unwrap(history.values) if turning else history.values)
            values[name] = np.remainder(between + np.pi, 2.0 * np.pi) - np.pi if turning else between
        for names in (QUATERNION, BODY_ATTITUDE):
            if self.has(*names):
                q = interpolate_attitude(self.time, np.array([self[name] for name in names]), time)
                values.update(zip(names, q, strict=True))
        histories = {name: replace(history, values=values[name]) for name, history in self.histories.items()}
        return replace(self, time=time, histories=histories)

    def at_rate(self, rate_hz: float) -> "Flight":
        """Return the same flight at a fixed rate from its first time on, and at its very last time.

        Args:
            rate_hz: samples per second, positive.
        """
        return self.at(self.times_at_rate(rate_hz))

    def times_at_rate(self, rate_hz: float) -> Array:
        """Return the times of the flight at a fixed rate, s; see `at_rate`."""
        first, last = float(self.time[0]), float(self.time[-1])
        steps = int(np.ceil((last - first) * rate_hz - 1e-6))
        return np.append(first + np.arange(steps) / rate_hz, last)


@dataclass(frozen=True, eq=False)
class Leg:
    """The part of a flight from one passing to the next.

    Attributes:
        number: counts from 1; leg `i` ends in passing `i`.
        before, after: the passings at its ends.
        rows: indices into the flight's time axis of the times from end to end, both included, shape (m,); empty where
            one of the passings is missing.
    """

    number: int
    before: TimedCrossing
    after: TimedCrossing
    rows: NDArray[np.int64]

    @property
    def name(self) -> str:
        """The name of the passing that it ends in."""
        return self.after.name

    @property
    def lap(self) -> int:
        """The lap that it belongs to."""
        return self.after.lap

    @property
    def time(self) -> float:
        """The time that the leg takes, s; NaN where one of the passings is missing."""
        return self.after.time - self.before.time

    @property
    def is_complete(self) -> bool:
        """Whether both passings were made."""
        return math.isfinite(self.time)


@dataclass(frozen=True)
class Lap:
    """One lap: from the last passing before it to its own last one.

    Attributes:
        number: counts from 1.
        legs: of it, in order.
    """

    number: int
    legs: tuple[Leg, ...]

    @property
    def time(self) -> float:
        """The time that the lap takes, s; NaN where its first or its last passing is missing."""
        return self.legs[-1].after.time - self.legs[0].before.time


def legs_of(flight: Flight) -> tuple[Leg, ...]:
    """Return all legs in order, also incomplete ones."""
    pairs = itertools.pairwise(flight.crossings)
    return tuple(_leg(flight, number, *pair) for number, pair in enumerate(pairs, start=1))


def laps_of(flight: Flight) -> tuple[Lap, ...]:
    """Return all laps in order; a single one where the course has no laps."""
    grouped = itertools.groupby(legs_of(flight), key=lambda leg: leg.lap)
    return tuple(Lap(number, tuple(legs)) for number, legs in grouped)


def passings_around(flight: Flight, time: float) -> tuple[TimedCrossing, TimedCrossing]:
    """Return the passings between which a time (s) lies, of a flight that has made them all."""
    last = int(np.searchsorted([crossing.time for crossing in flight.crossings], time, "right")) - 1
    last = min(max(last, 0), len(flight.crossings) - 2)
    return flight.crossings[last], flight.crossings[last + 1]


def way(flight: Flight, leg: Leg) -> Array:
    """Return the distance from the start of a leg, at its rows, m, shape (m,)."""
    places = np.stack([flight[name][leg.rows] for name in ("x", "y", "z")])
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=1), axis=0))])


def _leg(flight: Flight, number: int, before: TimedCrossing, after: TimedCrossing) -> Leg:
    if not before.found or not after.found:
        return Leg(number, before, after, np.zeros(0, np.int64))
    first, end = np.searchsorted(flight.time, before.time), np.searchsorted(flight.time, after.time, "right")
    return Leg(number, before, after, np.arange(first, end))
