"""A flight that knows nothing but the words of its cues, and flies them as a point mass from gate to gate."""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from airrace.flights.results import Flight
from airrace.flights.results.cues import cues_of, load_profile
from airrace.model.aircraft import AircraftParameters, aircraft_parameters
from airrace.model.dynamics.outer_loop import FlightPathState, PoweredState
from airrace.model.dynamics.point_mass import load_factor_flight
from airrace.model.environment import Weather, WindField, atmosphere_parameters
from airrace.model.frames import QUATERNION, quaternion, rotation
from airrace.optimal_control.trajectory import Array
from airrace.pages.views.cue_tables import cue_rows

STEP = 0.01
"""The step of the flight, s: half of it moves the end of a leg by less than a decimetre."""
Words = Mapping[str, Any]  # Any: a row of `airrace brief --json`


@dataclass(frozen=True)
class Deviation:
    """How far words lead away from the flight that they describe, on one leg.

    Attributes:
        leg: its name.
        cues: their number.
        distance: the largest distance at any instant, m.
        angle: the largest angle between the velocities, rad.
    """

    leg: str
    cues: int
    distance: float
    angle: float


def spoken_deviations(flight: Flight) -> list[Deviation]:
    """Fly the words of every leg, full throttle, from the flight's own state at the passing before it.

    Words have whole degrees, tenths of g and hundredths of a second, as people read them.
    """
    deviations: list[Deviation] = []
    for leg, words in itertools.groupby(cue_rows(cues_of(flight)).objects(), key=lambda row: str(row["leg"])):
        rows = list(words)
        begin = rows[0]["time_s"]
        start = flight.at([begin])
        state = np.array([*(start[name][0] for name in FlightPathState.names()), 1.0])
        times, states = [begin], [state]
        for row in rows:
            for time, spoken in _fly(flight, states[-1], row):
                times.append(time)
                states.append(spoken)
        deviations.append(_deviation(flight.at(times), np.array(states).T, leg, len(rows)))
    return deviations


def _deviation(flight: Flight, spoken: Array, leg: str, cues: int) -> Deviation:
    places = np.array([flight[name] for name in ("x", "y", "z")])
    ahead = np.array([rotation([flight[name] for name in QUATERNION])[axis][0] for axis in range(3)])
    spoken_ahead = np.array([rotation(list(spoken[4:8]))[axis][0] for axis in range(3)])
    distance = float(np.linalg.norm(spoken[:3] - places, axis=0).max())
    angle = math.acos(min(1.0, float(np.sum(ahead * spoken_ahead, axis=0).min())))
    return Deviation(leg, cues, distance, angle)


def _fly(flight: Flight, state: Array, words: Words) -> list[tuple[float, Array]]:
    """Return the times and states behind every step of a cue."""
    duration = round(words["duration_s"], 2)
    count = max(math.ceil(duration / STEP), 1)
    step = words["duration_s"] / count
    middles = duration * (np.arange(count) + 0.5) / count
    names = ("n_z_from", "n_z_extreme", "n_z_to", "n_z_mean")
    load = load_profile(middles, duration, *(round(words[name], 1) for name in names))
    first, rolled = (math.radians(round(words[name])) for name in ("bank_from_deg", "rolled_deg"))
    bank = first + rolled * middles / duration
    rate = rolled / duration if words["vertical"] else 0.0
    aircraft = aircraft_parameters(flight.aircraft)
    field = WindField.from_air(flight.air)
    weather = Weather(atmosphere_parameters(flight.air), field, field.values(flight.air))
    path: list[tuple[float, Array]] = []
    for number in range(count):
        if not words["vertical"]:
            state = state.copy()
            state[4:8] = _banked(state, bank[number])
        n_z = float(load[number])
        half = state + 0.5 * step * _rates(state, n_z, rate, aircraft, weather)
        state = state + step * _rates(half, n_z, rate, aircraft, weather)
        path.append((words["time_s"] + step * (number + 1), state))
    return path


def _rates(state: Array, n_z: float, p_Kbar: float, aircraft: AircraftParameters[float], weather: Weather) -> Array:
    powered = PoweredState[float](**dict(zip(PoweredState.names(), state.tolist(), strict=True)))
    rates, _, _, _ = load_factor_flight(powered, n_z, 0.0, p_Kbar, aircraft=aircraft, weather=weather)
    return np.array([*rates.join(), 0.0])


def _banked(state: Array, bank: float) -> list[float]:
    """Return the attitude with the velocity of a state and another bank."""
    R = rotation(state[4:8].tolist())
    return quaternion(math.atan2(R[1][0], R[0][0]), -math.asin(max(-1.0, min(1.0, R[2][0]))), bank)
