"""How well the passings of a recorded flight are known: standard deviations, from its samples themselves."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from airrace.dynamics.limits import flight_limits
from airrace.environment import g0
from airrace.logs.histories import HISTORIES, between_samples, samples_of
from airrace.logs.recording import EARTH_RADIUS, Recording, rounding
from airrace.logs.smoothing import SMOOTHING, Path
from airrace.logs.violations import StandardDeviations
from airrace.results import Flight
from airrace.results.flight import Basis
from airrace.trajectory import Array


@dataclass(frozen=True)
class ErrorModel:
    """By how much passings are less certain than the smoother's own equations say, which take its weights for known.

    Measured on optima, recorded at 1 to 50 Hz with 0 to 3 m of noise (`scripts/experiments/noisy_logs.py`).

    Their errors, divided by those deviations, had root mean squares of 0.5 to 2 and tails beyond that of a normal
    distribution: the greatest ones of a thousand were 8 (over ground), 8 (height), 13 (velocity) and 13 (acceleration).

    Attributes:
        across, up, velocity, acceleration: factors of their standard deviations, so that five of the products are
            beyond all errors that were measured.
        time: likewise of the position, for the time of a passing, so that 68 and 95 % lie within one and two of them.
        wings: of the angle by which the wings may lie otherwise across the path, for there is sideslip, rad.
        sideslip: rad, at most; it rolls a body that is pitched up, which a roll without heading does not tell.
        pull: acceleration that nobody knows of where samples are missing, m/s^2.
        vertical: of the accuracy of heights to that over ground; that of satellites is usually 1.5 to 2 (assumption).
        wander, jerk: of an error of the positions that wanders for 10 s to that of the velocity, 1/s, and of the
            acceleration, 1/s^2, behind the smoother; measured likewise (`--bias`), rounded up.
        truncated: of the deviation of rounding to that of numbers that may have been cut off: half a step beside it.
        onset, load_onset: s, in which an aircraft comes to its greatest rate of roll, and of the load factor.
        load_rate: the latter, 1/s.
        slant: the least cosine between path and axis that is counted.
        barometer: standard deviation of heights by the standard atmosphere, m: of 8 hPa.
    """

    across: float = 2.3
    up: float = 2.7
    velocity: float = 3.0
    acceleration: float = 4.0
    time: float = 1.5
    sideslip: float = math.radians(15.0)
    pull: float = 25.0
    vertical: float = 1.5
    wander: float = 0.7
    jerk: float = 2.0
    truncated: float = 2.0
    onset: float = 0.1
    load_onset: float = 0.2
    load_rate: float = 25.0
    wings: float = math.radians(0.1)
    slant: float = 0.1
    barometer: float = 70.0


ERRORS = ErrorModel()


def place_roundings(placed: Recording) -> Array:
    """Return the standard deviations of rounding of north, east and up, m, shape (3,)."""
    columns = placed.columns
    found = [rounding(columns[name]) for name in ("x", "y")]
    if "latitude" in columns:
        narrow = math.cos(float(np.nanmedian(columns["latitude"])))
        found = [EARTH_RADIUS * rounding(columns["latitude"]), EARTH_RADIUS * narrow * rounding(columns["longitude"])]
    return np.array([*found, rounding(columns["height"])])


def is_measured(flight: Flight, name: str) -> bool:
    """Return whether a history was recorded."""
    return name in flight and flight.basis(name) is Basis.MEASURED


def deviations_of(
    part: Recording,
    path: Path,
    least: Array,
    flight: Flight,
    offset: float,
    axes: Mapping[str, float],
    *,
    bias: float = 0.0,
    late: float = 0.0,
    tilt: float = 0.0,
) -> Callable[[float], StandardDeviations]:
    """Return how well the flight is known at a time of its clock, s.

    Args:
        part: of the recording, that was smoothed.
        path: smoothed from it.
        least: standard deviations of rounding of the positions, by axis, m, shape (3,).
        flight: with its histories.
        offset: of the flight's clock on that of the recording, s.
        axes: along which each element was passed, rad, by the names of the passages. Where the path is slanted to it,
            an error of the position makes a greater one of the time, and of the place on the line.
        bias: by which all heights may be off together, m.
        late, tilt: by which all recorded rolls may be late, s, and off together, rad.
    """
    limits = flight_limits(flight.aircraft, flight.course.rules)
    roll_rate, sideslip = limits.p_Kbar.upper, min(limits.beta_A.upper, ERRORS.sideslip)
    roll = _ErrorHistory(part, "phi", roll_rate, ERRORS.onset) if is_measured(flight, "phi") else None
    load = _ErrorHistory(part, "n_z", ERRORS.load_rate, ERRORS.load_onset) if is_measured(flight, "n_z") else None
    full = is_measured(flight, "theta") and is_measured(flight, "psi")
    accuracy = part.accuracy
    zero = math.hypot(bias, ERRORS.barometer if part.barometric else 0.0, ERRORS.vertical * accuracy)
    straight = {
        one.time: max(abs(math.cos(one.value("chi") - axes[one.name])), ERRORS.slant)
        for one in flight.crossings
        if one.found and one.name in axes
    }
    half_span = 0.5 * flight.aircraft.airframe.b
    places = part.time[np.isfinite(part.columns["x"])]
    usual = float(np.median(np.diff(places)))

    def at(time: float) -> StandardDeviations:
        raw = path.deviations(np.array([offset + time]))[:, :, 0]
        place = min(max(int(np.searchsorted(places, offset + time)), 1), len(places) - 1)
        between = float(places[place] - places[place - 1])
        step = between if between > SMOOTHING.missing * usual else 0.0
        outside = max(places[0] - (offset + time), offset + time - places[-1], 0.0)  # the path goes straight on there
        lost = ERRORS.pull * math.hypot(step**2 / 8.0, outside**2 / 2.0)
        across, along = (
            math.hypot(factor * float(raw[0, :2].max()), rounded * float(least[:2].max()), lost, accuracy)
            / straight.get(time, 1.0)
            for factor, rounded in ((ERRORS.across, 1.0), (ERRORS.time, ERRORS.truncated))
        )
        row = int(np.argmin(np.abs(flight.time - time)))
        V_K, n_z, gamma = (float(flight[name][row]) for name in ("V_K", "n_z", "gamma"))
        speed = math.hypot(
            ERRORS.velocity * float(raw[1].max()),
            ERRORS.wander * accuracy,
            ERRORS.pull * math.hypot(step / 4.0, outside),
        )
        pull = math.hypot(ERRORS.acceleration * float(raw[2].max()), ERRORS.jerk * accuracy)
        direction = math.atan2(speed, max(V_K, 1.0))
        when = along / max(V_K * math.cos(gamma), 1.0)
        turned = math.hypot(direction, when * abs(n_z) * g0 / max(V_K, 1.0))
        up = math.hypot(ERRORS.up * float(raw[0, 2]), float(least[2]), zero, lost, when * V_K * math.sin(gamma))
        bank = math.nan
        if roll is not None:
            pitch = abs(gamma) + abs(float(flight.values("alpha_A")[row]))
            slipping = 0.0 if full else sideslip * math.sin(min(pitch, 0.5 * math.pi))
            own, seen = roll.deviation(offset + time, math.hypot(when, late)), direction * math.sin(gamma)
            bank = math.hypot(own, seen, slipping, tilt, ERRORS.wings)
        if math.isnan(bank):  # estimated, and the aircraft may have rolled between what the path resolves
            rolled = roll_rate * max(between, SMOOTHING.step)
            bank = min(math.hypot(pull / (g0 * max(n_z, 0.1)), rolled), math.pi)
        tip = half_span * math.sin(min(bank, 0.5 * math.pi))
        known = pull / g0 if load is None else load.deviation(offset + time, when)
        return StandardDeviations(across, math.hypot(across, tip), up, bank, turned, speed, known, when)

    return at


class _ErrorHistory:
    """A recorded history, and how well it is known.

    Args:
        recording: with samples of the history.
        name: of the history.
        fastest: its greatest rate, in its unit per second.
        onset: in which it comes to that, s.
    """

    def __init__(self, recording: Recording, name: str, fastest: float, onset: float) -> None:
        self.recording, self.name, self.fastest, self.onset = recording, name, fastest, onset
        self.time, self.values = samples_of(recording, name)
        third = np.abs(np.diff(self.values, 3))
        noise = float(np.median(third)) / (0.6745 * math.sqrt(20.0)) if len(third) else 0.0
        self.noise = math.hypot(noise, rounding(self.values))

    def deviation(self, time: float, when: float) -> float:
        """Return the standard deviation at a time that is known to `when`, in the unit of the history.

        It is that of the samples, of what is lost between them, and of the rate of the history times that of the time.
        What is lost shows in the bend of the samples, but not all of it where they are far apart: of what the greatest
        rate and its onset allow a third counts. NaN where there are no samples around.
        """
        t, v = self.time, self.values
        row = int(np.searchsorted(t, time))
        if not 0 < row < len(t) or t[row] - t[row - 1] > HISTORIES.hole:
            return math.nan
        around = np.clip(np.arange(row - 2, row + 3), 0, len(t) - 1)
        rates = np.abs(np.diff(v[around])) / np.maximum(np.diff(t[around]), 1e-6)
        bend = float(between_samples(self.recording, self.name, np.array([time]))[0])
        step = float(t[row] - t[row - 1])
        lost = self.fastest * min(step / 2.0, step**2 / (8.0 * self.onset)) / 3.0
        return math.hypot(bend, lost, float(rates.max()) * when, self.noise)
