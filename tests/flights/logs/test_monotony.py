"""More of what a rule limits is never judged more mildly."""

import functools
import itertools
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from synthetic import csv_text, fixes, imported, known

from airrace.flights.logs.errors import CommonErrors, Receiver
from airrace.flights.logs.log_flight import LogFlight
from airrace.flights.logs.quality import ReceiverAccuracy
from airrace.flights.logs.violations import FlightErrors, StandardDeviations, passing_windows, violations
from airrace.flights.results import Flight, History, TimedCrossing, attitude
from airrace.flights.results.penalties import ENDS_RACE, Penalties
from airrace.model.frames import QUATERNION
from airrace.optimal_control.quantities import KNOT
from airrace.optimal_control.trajectory import Array

RULES = Penalties(
    pylon=3.0,
    missed=4.0,
    too_high=2.0,
    too_low=ENDS_RACE,
    bank=2.0,
    climb=2.0,
    start_speed=1.0,
    start_speed_end=210.0 * KNOT,
    load_factor=1.0,
    load_factor_from=11.0,
    load_factor_time=0.6,
    load_factor_end=12.0,
)
EXACT = fixes(20.0, noise=0.02, gap=(0.0, 0.0))
DEVIATIONS = StandardDeviations(across=0.1, tip=0.2, up=0.1, bank=0.03, path=0.01, speed=0.3, load=0.15, time=0.001)


@functools.cache
def flown() -> LogFlight:
    return imported(csv_text(EXACT), RULES, accuracy=0.02)


@functools.cache
def axes() -> dict[str, float]:
    found: dict[str, float] = {}
    for crossing in flown().flight.crossings:
        ways = [way.axis for way in crossing.passage.element.crossings(crossing.passage.direction, 0.0, rolling=False)]
        found[crossing.name] = max(ways, key=lambda axis: math.cos(axis - crossing.value("chi")))
    return found


def severity(flight: Flight) -> tuple[float, int]:
    """The penalties of what is certain, and its number."""
    accuracy = ReceiverAccuracy(np.full(2, 0.1), np.full(2, 0.1), "")
    common = CommonErrors(Receiver(np.array([0.0, 100.0]), accuracy))
    common = common.with_windows(passing_windows(flight, axes(), lambda _: DEVIATIONS, 0.0), np.zeros(3))
    errors = FlightErrors(lambda _: DEVIATIONS, lambda _: DEVIATIONS, common)
    certain = [violation for violation in violations(flight, axes(), errors, RULES) if violation.certain]
    return sum(violation.penalty for violation in certain if not math.isnan(violation.penalty)), len(certain)


def with_passing(name: str, change: Callable[[TimedCrossing], dict[str, float]]) -> Flight:
    flight = flown().flight
    crossings = [
        replace(crossing, values={**crossing.values, **change(crossing)}) if crossing.name == name else crossing
        for crossing in flight.crossings
    ]
    return replace(flight, crossings=tuple(crossings))


def attitude_of(chi: float, gamma: float, mu: float) -> dict[str, float]:
    (cz, sz), (cy, sy), (cx, sx) = ((math.cos(angle), math.sin(angle)) for angle in (chi, gamma, mu))
    R = [
        [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
        [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
        [-sy, cy * sx, cy * cx],
    ]
    q = attitude.quaternions(np.array(R)[:, :, None])
    angles = {"chi": chi, "gamma": gamma, "mu": mu}
    return angles | {name: float(values[0]) for name, values in zip(QUATERNION, q, strict=True)}


def higher(by: float) -> Flight:
    return with_passing("1:g4", lambda at: {"z": at.value("z") - by, "height": at.value("height") + by})


def aside(by: float) -> Flight:
    side = axes()["1:g4"] + 0.5 * math.pi
    return with_passing(
        "1:g4", lambda at: {"x": at.value("x") + by * math.cos(side), "y": at.value("y") + by * math.sin(side)}
    )


def banked(by: float) -> Flight:
    return with_passing("1:g4", lambda at: attitude_of(at.value("chi"), 0.0, math.radians(by)))


def climbing(by: float) -> Flight:
    return with_passing("1:g4", lambda at: attitude_of(at.value("chi"), math.radians(by), 0.0))


def askew(by: float) -> Flight:
    return with_passing("1:g4", lambda _: attitude_of(axes()["1:g4"] + math.radians(by), 0.0, 0.0))


def faster(by: float) -> Flight:
    return with_passing("0:g0", lambda _: {"V_K": by * KNOT, "V_A": by * KNOT, "V_I": by * KNOT})


SWEEPS: dict[str, tuple[Callable[[float], Flight], Array]] = {
    "height": (higher, np.linspace(5.0, 40.0, 12)),
    "depth": (lambda by: higher(-by), np.linspace(0.0, 12.0, 9)),
    "aside": (aside, np.linspace(0.0, 30.0, 25)),
    "bank": (banked, np.linspace(5.0, 60.0, 9)),
    "climb": (climbing, np.linspace(5.0, 60.0, 9)),
    "course": (askew, np.linspace(40.0, 80.0, 9)),
    "speed": (faster, np.linspace(199.0, 215.0, 17)),
}


@pytest.mark.parametrize("quantity", SWEEPS)
def test_more_of_a_measure_of_a_passing_is_never_judged_more_mildly(quantity: str) -> None:
    change, values = SWEEPS[quantity]
    judged = [severity(change(float(value))) for value in values]
    assert all(later >= earlier for earlier, later in itertools.pairwise(judged))
    assert judged[-1] > judged[0]


def loaded(peak: float, lasting: float) -> Flight:
    """A flight of 3 g with a plateau of the load factor."""
    flight = flown().flight
    n_z = flight.histories["n_z"]
    edge = np.clip((0.5 * lasting + 0.1 - np.abs(flight.time - 20.0)) / 0.1, 0.0, 1.0)
    return replace(
        flight, histories={**flight.histories, "n_z": History(n_z.quantity, 3.0 + (peak - 3.0) * edge, n_z.basis)}
    )


def test_more_g_or_longer_is_never_judged_more_mildly(monkeypatch: pytest.MonkeyPatch) -> None:
    """10 to 14 g in steps of 0.1 g, held for 0.2 to 2 s."""
    monkeypatch.setattr("airrace.flights.logs.violations.distances", lambda _: ())  # of the same path
    flight = replace(flown().flight, crossings=())
    peaks, times = np.arange(10.0, 14.05, 0.1), np.arange(0.2, 2.05, 0.2)
    common = CommonErrors(Receiver(np.array([0.0, 100.0]), ReceiverAccuracy(np.full(2, 0.1), np.full(2, 0.1), "")))
    errors = FlightErrors(lambda _: DEVIATIONS, lambda _: DEVIATIONS, common)

    def penalty(peak: float, lasting: float) -> float:
        shaken = replace(flight, histories=loaded(peak, lasting).histories)
        return sum(breach.penalty for breach in violations(shaken, {}, errors, RULES) if breach.certain)

    judged = np.array([[penalty(float(peak), float(lasting)) for lasting in times] for peak in peaks])
    assert (judged[1:] >= judged[:-1]).all()
    assert (judged[:, 1:] >= judged[:, :-1]).all()
    assert set(judged.ravel().tolist()) == {0.0, 1.0, math.inf}


@pytest.mark.parametrize("peak", [11.9, 12.2, 12.6])
def test_a_load_factor_around_the_limit_that_ends_a_race_is_judged_as_one_that_lasts(peak: float) -> None:
    time = known().time
    load = np.interp(np.clip(EXACT.time, 0.0, time[-1]), time, known().histories["n_z"])
    edge = np.clip((0.7 - np.abs(EXACT.time - 30.0)) / 0.1, 0.0, 1.0)
    load = np.minimum(load, 6.0) * (1.0 - edge) + peak * edge + 0.03 * np.sin(7.0 * EXACT.time)
    rows = zip(csv_text(EXACT).splitlines(), ["load factor", *(f"{g:.3f}" for g in load)], strict=True)
    breaches = imported("\n".join(",".join(row) for row in rows) + "\n", RULES).violations
    assert any(breach.rule == "load-factor" and breach.certain for breach in breaches)
