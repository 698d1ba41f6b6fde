"""A flight: named histories over one time axis, and when and how the passings of its course were made."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from airrace.aircraft.aircraft import Aircraft
from airrace.environment.air import Air
from airrace.planning.race import Race
from airrace.procedure.result import State
from airrace.quantities import Interval
from airrace.records import record
from airrace.results.glossary import BODY_ATTITUDE, PATH_ATTITUDE
from airrace.results.history import Basis, Histories, History
from airrace.track.course import Course, Passage
from airrace.trajectory import Array

ANGLES = frozenset({"chi", "mu", "psi", "phi", "longitude"})
"""Histories that jump by a full turn."""


@record
class Crossing:
    """One passing of the course, as it was flown.

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


@record
class Source:
    """The source of a flight: what it is called, and where it comes from.

    Attributes:
        label: what people call it, e.g. `rovinj.h5:six-dof`; unique among flights that are shown together.
        stage: the stage of a run, e.g. `six-dof`; empty for a recorded flight.
        state: the trust that an optimum deserves, such as `certified` or `solved`; None for what is no optimum.
        version: of airrace, where it has computed the flight; empty else.
        remark: a sentence for whoever looks at it; often empty.
    """

    label: str
    stage: str = ""
    state: State | None = None
    version: str = ""
    remark: str = ""

    @property
    def certified(self) -> bool | None:
        """Whether it is a certified optimum; None where that is no question."""
        return None if self.state is None else self.state is State.CERTIFIED

    @property
    def verdict(self) -> str:
        """The state in words for people; empty for what is no optimum."""
        if self.state is None:
            return ""
        return "solved on one mesh" if self.state is State.SOLVED else self.state.value

    @property
    def doubtful(self) -> bool:
        """Whether something that was measured of an optimum does not hold, or nothing was measured."""
        return self.state not in (None, State.CERTIFIED, State.SOLVED)


@dataclass(frozen=True, eq=False)
class Flight:
    """A flight of one race, whatever its source.

    Which histories it has depends on the source: a point mass has no surfaces, a recording may know positions alone.
    Ask with `name in flight`, `flight[name]`, or take `flight.values(name)`, which is NaN throughout for a history
    that is not there. Names are those of the flight model and of `airrace.results.glossary`.

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
    crossings: tuple[Crossing, ...]

    @property
    def course(self) -> Course:
        """The course that is flown."""
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
    def race_time(self) -> float:
        """The time from the first passing to the last, s; NaN where one of them is missing."""
        return self.crossings[-1].time - self.crossings[0].time if self.crossings else math.nan

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

    def labelled(self, label: str) -> "Flight":
        """Return the same flight under another name."""
        return replace(self, source=replace(self.source, label=label))

    def at(self, times: Sequence[float] | Array) -> "Flight":
        """Return the same flight over other times.

        Histories are interpolated linearly, angles along the shorter way; the times of an optimum are so close that
        positions are true to a few millimetres. Before the first and after the last time the ends are kept.

        Args:
            times: s after the start, rising, shape (m,).
        """
        wanted = np.asarray(times, np.float64)
        values = {name: _interpolated(name, self.time, one.values, wanted) for name, one in self.histories.items()}
        for names in (PATH_ATTITUDE, BODY_ATTITUDE):
            if self.has(*names):
                values.update(_turned(names, self.time, [self[name] for name in names], wanted))
        histories = {name: History(one.quantity, values[name], one.basis) for name, one in self.histories.items()}
        return replace(self, time=wanted, histories=histories)

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


def _interpolated(name: str, time: Array, values: Array, wanted: Array) -> Array:
    if name not in ANGLES:
        return np.interp(wanted, time, values)
    turned = np.interp(wanted, time, np.unwrap(values))
    return np.remainder(turned + np.pi, 2.0 * np.pi) - np.pi


def _turned(names: Sequence[str], time: Array, rows: Sequence[Array], wanted: Array) -> dict[str, Array]:
    """Return the quaternions at the wanted times, interpolated along the shorter way and of unit length."""
    q = np.asarray(rows, np.float64)
    flips = np.sum(q[:, 1:] * q[:, :-1], axis=0) < 0.0
    q = q * np.concatenate(([1.0], np.cumprod(np.where(flips, -1.0, 1.0))))
    between = np.asarray([np.interp(wanted, time, row) for row in list(q)], np.float64)
    return dict(zip(names, between / np.linalg.norm(between, axis=0), strict=True))
