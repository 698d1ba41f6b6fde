"""How well the passings of a recorded flight are known: standard deviations, from its samples themselves."""

import math
from collections.abc import Callable, Mapping

import numpy as np

from airrace.flights.logs.errors import CommonErrors
from airrace.flights.logs.histories import HOLE, between_samples, samples_of
from airrace.flights.logs.recording import EARTH_RADIUS, Recording, rounding
from airrace.flights.logs.smoothing import MISSING_FACTOR, STEP, Path
from airrace.flights.logs.violations import COSINE_MIN, StandardDeviations, is_measured
from airrace.flights.results import Flight
from airrace.model.dynamics.limits import flight_limits
from airrace.model.environment import g0
from airrace.optimal_control.trajectory import Array

# By how much passings are less certain than the smoother's own equations say, which take its weights for known.
# Measured on optima, recorded at 1 to 50 Hz with 0 to 3 m of noise (`scripts/experiments/noisy_logs.py`). Their errors,
# divided by those deviations, had root mean squares of 0.5 to 2 and tails beyond that of a normal distribution: the
# greatest ones of a thousand were 8 (over ground), 8 (height), 13 (velocity) and 13 (acceleration).
ACROSS_FACTOR = 2.3
"""The factor of the standard deviation over ground; with these factors four deviations are beyond all errors that were
measured."""
UP_FACTOR = 2.7
"""That of heights."""
VELOCITY_FACTOR = 3.75
"""That of velocities."""
ACCELERATION_FACTOR = 4.0
"""That of accelerations."""
TIME_FACTOR = 1.5
"""That of the position for the time of a passing: 68 and 95 % lie within one and two of these deviations."""
SIDESLIP_MAX = math.radians(15.0)
"""The largest sideslip, rad; it rolls a body that is pitched up, which a roll without heading does not show."""
UNKNOWN_PULL = 40.0
"""The unknown acceleration where samples are missing, m/s^2."""
DRIFT_RATE = 0.5
"""The ratio of an error of the velocity behind the smoother to one of the positions that wanders for 20 s
(Gauss-Markov), 1/s; measured likewise (`--errors receiver`), rounded up."""
DRIFT_RATE_2 = 1.4
"""That of the acceleration, 1/s^2."""
BIAS_TIME = 0.2
"""The time around an instant over which the mean distance of the positions from the path is its bias there, s: what the
smoother takes from a dip or from the peak of a turn lasts as long."""
TRUNCATION_FACTOR = 2.0
"""The ratio of the deviation of numbers that may have been cut off to that of rounding: half a step beside it."""
ROLL_ONSET = 0.1
"""The time in which an aircraft comes to its greatest rate of roll, s."""
LOAD_ONSET = 0.2
"""That in which it comes to its greatest rate of the load factor, s."""
LOAD_RATE = 25.0
"""The greatest rate of the load factor, 1/s."""
ACCELEROMETER = 0.03
"""The zero of an accelerometer, g: data sheets of MEMS sensors state 0.02 to 0.06 g."""
WINGS = math.radians(0.1)
"""The angle by which the wings may lie otherwise across the path, for there is sideslip, rad."""


def place_roundings(placed: Recording) -> Array:
    """Return the standard deviations of rounding of north, east and up, m, shape (3,)."""
    columns = placed.columns
    roundings = [rounding(columns[name]) for name in ("x", "y")]
    if "latitude" in columns:
        narrow = math.cos(float(np.nanmedian(columns["latitude"])))
        roundings = [
            EARTH_RADIUS * rounding(columns["latitude"]),
            EARTH_RADIUS * narrow * rounding(columns["longitude"]),
        ]
    return np.array([*roundings, rounding(columns["height"])])


def deviations_of(
    part: Recording,
    path: Path,
    least: Array,
    flight: Flight,
    offset: float,
    axes: Mapping[str, float],
    *,
    common: CommonErrors,
    own: bool = False,
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
        common: the errors that samples share.
        own: whether positions are to be known beside these, which count for times only.
        late, tilt: by which all recorded rolls may be late, s, and off together, rad.
    """
    limits = flight_limits(flight.aircraft, flight.course.rules)
    roll_rate, sideslip = limits.p_Kbar.upper, min(limits.beta_A.upper, SIDESLIP_MAX)
    roll = _ErrorHistory(part, "phi", roll_rate, ROLL_ONSET) if is_measured(flight, "phi") else None
    load = _ErrorHistory(part, "n_z", LOAD_RATE, LOAD_ONSET) if is_measured(flight, "n_z") else None
    full = is_measured(flight, "theta") and is_measured(flight, "psi")
    straight = {
        crossing.time: max(abs(math.cos(crossing.value("chi") - axes[crossing.name])), COSINE_MIN)
        for crossing in flight.crossings
        if crossing.found and crossing.name in axes
    }
    half_span = 0.5 * flight.aircraft.airframe.b
    placed = part.select(np.isfinite(part.columns["x"]))
    places, heights = placed.time, placed.time[np.isfinite(placed.columns["height"])]
    residuals = np.stack([placed.columns[name] for name in ("x", "y", "height")]) - path.at(places)[0]
    residuals[:, path.outliers] = np.nan
    usual = float(np.median(np.diff(places)))
    clocks = placed.columns.get("clock_deviation", np.zeros(len(places)))
    rates = placed.columns.get("clock_rate_deviation", np.zeros(len(places)))  # relative

    def bias(time: float) -> tuple[float, float]:
        """Return the mean distance of the positions around a time from the path, over ground and of heights, m."""
        inside = slice(*np.searchsorted(places, [time - BIAS_TIME, time + BIAS_TIME]))
        around = residuals[:, inside][:, np.isfinite(residuals[:, inside]).all(axis=0)]
        north, east, up = around.mean(axis=1) if around.shape[1] > 1 else np.zeros(3)
        return math.hypot(north, east), abs(float(up))

    def at(time: float) -> StandardDeviations:
        row = int(np.argmin(np.abs(flight.time - time)))
        V_K, n_z, gamma, chi = (float(flight[name][row]) for name in ("V_K", "n_z", "gamma", "chi"))
        mean, covariance = common.at(offset + time)
        drift = common.drift(offset + time)
        if not common.windows:  # not measured yet
            covariance = np.diag([drift[0] ** 2, drift[0] ** 2, drift[1] ** 2])
        aside, ahead = np.array([-math.sin(chi), math.cos(chi)]), np.array([math.cos(chi), math.sin(chi)])
        beside, along_path = (
            math.hypot(axis @ mean[:2], math.sqrt(max(axis @ covariance[:2, :2] @ axis, 0.0)))
            for axis in (aside, ahead)
        )
        zero = 0.0 if own else math.hypot(mean[2], math.sqrt(max(float(covariance[2, 2]), 0.0)))
        raw = path.deviations(np.array([offset + time]))[:, :, 0]
        (lost, lost_speed), (sag, lost_climb) = (
            _lost_between(times, offset + time, usual) for times in (places, heights)
        )
        place = min(max(int(np.searchsorted(places, offset + time)), 1), len(places) - 1)
        between = float(places[place] - places[place - 1])
        smoothed = bias(offset + time)
        noise = float(raw[0, :2].max()), float(least[:2].max())
        across = math.hypot(ACROSS_FACTOR * noise[0], noise[1], lost, smoothed[0], 0.0 if own else beside)
        along = math.hypot(TIME_FACTOR * noise[0], TRUNCATION_FACTOR * noise[1], lost, smoothed[0], along_path)
        across, along = (deviation / straight.get(time, 1.0) for deviation in (across, along))
        bend = 0.5 * abs(n_z) * g0 * (along / max(V_K * math.cos(gamma), 1.0)) ** 2  # of the path within that time
        across = math.hypot(across, bend)
        rate = float(np.interp(offset + time, places, rates))  # a clock that is fast makes all speeds too low
        across_speed = math.hypot(
            VELOCITY_FACTOR * float(raw[1].max()),
            DRIFT_RATE * drift[1],
            max(lost_speed, lost_climb),
        )
        speed = math.hypot(across_speed, V_K * rate)
        pull = math.hypot(
            ACCELERATION_FACTOR * float(raw[2].max()), DRIFT_RATE_2 * drift[1], 2.0 * rate * (abs(n_z) + 1.0) * g0
        )
        direction = math.atan2(across_speed, max(V_K, 1.0))
        when = math.hypot(along / max(V_K * math.cos(gamma), 1.0), float(np.interp(offset + time, places, clocks)))
        turned = math.hypot(direction, when * abs(n_z) * g0 / max(V_K, 1.0))
        climbing = when * V_K * math.sin(gamma)
        up = math.hypot(
            UP_FACTOR * float(raw[0, 2]), float(least[2]), zero, sag, smoothed[1], bend, 0.0 if own else climbing
        )
        bank = math.nan
        if roll is not None:
            pitch = abs(gamma) + abs(float(flight.values("alpha_A")[row]))
            slipping = 0.0 if full else sideslip * math.sin(min(pitch, 0.5 * math.pi))
            measured, turning = roll.deviation(offset + time, math.hypot(when, late)), direction * math.sin(gamma)
            bank = math.hypot(measured, turning, slipping, tilt, WINGS)
        if math.isnan(bank):  # estimated, and the aircraft may have rolled between what the path resolves
            rolled = roll_rate * max(between, STEP)
            bank = min(math.hypot(pull / (g0 * max(n_z, 0.1)), rolled), math.pi)
        tip = half_span * math.sin(min(bank, 0.5 * math.pi))
        load_deviation = pull / g0
        if load is not None:  # of a peak, whenever it is
            load_deviation = math.hypot(load.deviation(offset + time, 0.0), ACCELEROMETER)
        return StandardDeviations(across, math.hypot(across, tip), up, bank, turned, speed, load_deviation, when)

    return at


def _lost_between(times: Array, time: float, usual: float) -> tuple[float, float]:
    """Return the standard deviations of what is lost of place and speed between two samples, m and m/s.

    Args:
        times: of the samples, s.
        time: at which the flight is, s.
        usual: step between samples, s.
    """
    place = min(max(int(np.searchsorted(times, time)), 1), len(times) - 1)
    between = float(times[place] - times[place - 1])
    step = between if between > MISSING_FACTOR * usual else 0.0
    outside = max(times[0] - time, time - times[-1], 0.0)  # the path goes straight on there
    since = min(max(time - float(times[place - 1]), 0.0), between)
    sag = UNKNOWN_PULL * math.hypot(since * (between - since) / 2.0, outside**2 / 2.0)
    return sag, UNKNOWN_PULL * math.hypot(step / 4.0, outside)


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
        if not 0 < row < len(t) or t[row] - t[row - 1] > HOLE:
            return math.nan
        around = np.clip(np.arange(row - 2, row + 3), 0, len(t) - 1)
        rates = np.abs(np.diff(v[around])) / np.maximum(np.diff(t[around]), 1e-6)
        bend = float(between_samples(self.recording, self.name, np.array([time]))[0])
        step = float(t[row] - t[row - 1])
        lost = self.fastest * min(step / 2.0, step**2 / (8.0 * self.onset)) / 3.0
        return math.hypot(bend, lost, float(rates.max()) * when, self.noise)
