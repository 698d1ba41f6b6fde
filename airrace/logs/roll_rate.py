"""The greatest roll rate of an aircraft, from a recorded roll.

The quickest roll of a race counts as one at full ailerons. Its mean rate is compared with what an aircraft can at that
airspeed. It tells of the aircraft only where it is held: a roll that ends sooner is quicker over half of the time.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from airrace.aircraft import Aircraft
from airrace.dynamics.flight_manual import roll_rate
from airrace.logs.deviations import is_measured
from airrace.logs.histories import samples_of
from airrace.logs.log_flight import LogFlight
from airrace.logs.recording import rounding
from airrace.records import record
from airrace.trajectory import Array


@record
class RollSettings:
    """The settings of the measurement of a roll rate; measured with 0 to 2 degrees of noise at 10 to 50 Hz.

    Attributes:
        held: the time of which the mean rate counts, s.
        share: of the greatest mean rate over half of that time that it must have. Rolls of Rovinj 2014, which reach the
            aircraft's rate, have 0.94 to 1, those of Chiba 2015, which end at 0.7 of it, at most 0.92.
        step: between two samples of the roll, at most, s.
        excess: of the greatest of many means over the true rate, in deviations of one.
        airspeed: relative deviation of the airspeed: 2 kt of unknown wind.
        steep: climb or dive beyond which a roll alone may jump, rad.
        visible: the greatest deviation with which the rate counts as seen.
        factor: the greatest size of its logarithm; beyond it the record is doubted, not the aircraft.
    """

    held: float = 0.4
    share: float = 0.93
    step: float = 0.11
    excess: float = 0.85
    airspeed: float = 0.01
    steep: float = math.radians(50.0)
    visible: float = 0.1
    factor: float = 0.7


ROLL = RollSettings()


@record
class RollRate:
    """The logarithm of the factor of an aircraft's roll rate, and its standard deviation."""

    factor: float
    deviation: float

    def aircraft(self, start: Aircraft) -> Aircraft:
        """Return the aircraft that rolls so much faster at the same damping."""
        more = math.exp(self.factor)
        return replace(
            start,
            roll=replace(start.roll, C_lxi=more * start.roll.C_lxi),
            yaw=replace(start.yaw, C_nxi=more * start.yaw.C_nxi),
            point_mass=replace(start.point_mass, p=more * start.point_mass.p),
        )


def measure_roll_rate(aircraft: Aircraft, logs: Sequence[LogFlight]) -> RollRate | None:
    """Return the roll rate of the quickest roll of all logs; None where none of them shows one that is held."""
    seen = [one for one in (_of_log(aircraft, log) for log in logs) if one is not None]
    return max(seen, key=lambda one: one.factor, default=None)


def _of_log(aircraft: Aircraft, log: LogFlight) -> RollRate | None:
    flight = log.flight
    if not (is_measured(flight, "phi") and "p_Kbar" in flight.histories):
        return None
    time, roll = samples_of(log.recording, "phi")  # fresh ones
    if np.median(np.diff(time)) > ROLL.step:
        return None
    limits = np.minimum(aircraft.point_mass.p, roll_rate(aircraft, 1.0) * flight["V_A"])
    shares = np.where(np.abs(flight["gamma"]) < ROLL.steep, flight["p_Kbar"] / limits, 0.0)
    count = round(ROLL.held / float(np.median(np.diff(flight.time))))
    means, shorter = _means(shares, count), _means(shares, count // 2)
    white = float(np.median(np.abs(np.diff(roll, 3)))) / 0.6745 / math.sqrt(20.0)  # its third differences
    deviation = max(white, rounding(roll)) * math.sqrt(2.0) / ROLL.held / aircraft.point_mass.p
    rate = float(means.max()) - ROLL.excess * deviation
    if rate <= 0.0 or means.max() < ROLL.share * shorter.max():
        return None
    found = RollRate(math.log(rate), math.hypot(deviation / rate, ROLL.airspeed))
    return found if found.deviation < ROLL.visible and abs(found.factor) < ROLL.factor else None


def _means(values: Array, count: int) -> Array:
    """Return the sizes of the means of so many values in a row."""
    return np.abs(np.convolve(values, np.full(count, 1.0 / count), "valid"))
