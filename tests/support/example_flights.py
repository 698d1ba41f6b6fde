"""Flights for tests: optima that are solved once, and flights that are known in closed form."""

import functools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np

import airrace
from airrace.api.run import Run
from airrace.files.inputs import load_inputs
from airrace.flights.results import Basis, Flight, History, Source, TimedCrossing
from airrace.flights.results.derivation import complete_histories
from airrace.model.environment import StaticWind, g0
from airrace.model.frames import quaternion
from airrace.optimal_control.quantities import Quantity
from airrace.optimal_control.trajectory import Array
from airrace.race import Race

ROOT = Path(__file__).parents[2]


@functools.cache
def half_cuban() -> Run:
    """The half Cuban eight flown by the point mass."""
    return airrace.optimize("half_cuban_eight", until="point-mass", search="off")


@functools.cache
def windy() -> Run:
    """The same in a wind that blows across."""
    wind = ["environment.wind.from_deg=70", "environment.wind.speed_kt=20"]
    return airrace.optimize("half_cuban_eight", until="point-mass", search="off", set=wind)


@functools.cache
def shipped(course: str) -> Run:
    """A shipped course flown by all stages."""
    return airrace.optimize(course)


def rovinj(wind: StaticWind | None = None) -> Race:
    """The course of Rovinj 2014, in still air or in a wind."""
    race = load_inputs("rovinj_2014").race
    return race if wind is None else replace(race, air=replace(race.air, wind=wind))


def circling(
    race: Race,
    *,
    speed: float = 80.0,
    bank: float = math.radians(60.0),
    height: float = 50.0,
    seconds: float = 20.0,
    label: str = "circle",
) -> Flight:
    """A level turn to the right at a constant speed over ground; it makes the passings evenly spaced in time.

    `tan(bank) = V chi_dot / g0`, and the load factor is `1 / cos(bank)`.
    """
    time = np.linspace(0.0, seconds, 401)
    rate = g0 * math.tan(bank) / speed
    radius, course = speed / rate, rate * time
    q = np.array([quaternion(chi, 0.0, bank) for chi in course.tolist()]).T
    columns: dict[tuple[str, str], Array] = {
        ("x", "m"): radius * np.sin(course),
        ("y", "m"): radius * (1.0 - np.cos(course)),
        ("z", "m"): np.full_like(time, -height),
        ("V_K", "m/s"): np.full_like(time, speed),
        ("n_z", "1"): np.full_like(time, 1.0 / math.cos(bank)),
        **{(f"q{index}", "1"): row for index, row in enumerate(q)},
    }
    given = {name: History(Quantity(name, unit), values, Basis.SOLVED) for (name, unit), values in columns.items()}
    histories = complete_histories(race, given)
    count = len(race.course.passages)
    crossings: list[TimedCrossing] = []
    for number, passage in enumerate(race.course.passages):
        row = round(number * (len(time) - 1) / (count - 1))
        values = {name: float(one.values[row]) for name, one in histories.items()}
        crossings.append(TimedCrossing(passage, float(time[row]), values))
    return Flight(race, Source(label), time, histories, tuple(crossings))
