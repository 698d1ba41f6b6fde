"""A flight that is known is recovered from a noisy log: its passings, legs, speed and bank."""

import math

import numpy as np
import pytest
from synthetic import GAP, LEAD, Fixes, csv_text, fixes, flown, imported, known, race

from airrace.flights.logs.histories import DECLARATIONS, path_histories
from airrace.flights.logs.log_flight import LogFlight
from airrace.flights.logs.smoothing import smooth
from airrace.flights.results import Basis, Flight, History, legs_of
from airrace.flights.results.derivation import complete_histories
from airrace.model.environment import g0
from airrace.optimal_control.trajectory import Array


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def angle_errors(flight: Flight, name: str) -> Array:
    return np.angle(np.exp(1j * (flight[name] - known().at(name, flight.time))))


def bank_errors(one: LogFlight) -> tuple[Array, Array, Array]:
    """Errors of the bank, deg, away from the gap; the true load factor and roll rate there."""
    time = one.flight.time
    away = (time < GAP[0] - 0.5) | (time > GAP[1] + 0.5)
    error = np.degrees(angle_errors(one.flight, "mu"))
    return error[away], known().at("n_z", time)[away], known().at("p_Kbar", time)[away]


def assert_passings(one: LogFlight, near: float) -> None:
    begin = known().passings["0:g0"]
    for crossing in one.flight.crossings:
        assert crossing.time == pytest.approx(known().passings[crossing.name] - begin, abs=near)


@pytest.mark.parametrize("hz", [5.0, 20.0])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_an_optimum_is_recovered_and_breaks_no_rule_for_certain(hz: float, seed: int) -> None:
    """Passings within 0.05 s, legs within 0.1 s, the bank of turns within 8 degrees (root mean square).

    The bank is that where the aircraft pulls more than 2 g and does not roll: while it rolls at 400 deg/s, and at 1 g,
    positions with 1.5 m of noise do not tell it.
    """
    one = flown(hz, seed)
    assert_passings(one, 0.05)
    times = list(known().passings.values())
    for leg, before, after in zip(legs_of(one.flight), times[:-1], times[1:], strict=True):
        assert leg.time == pytest.approx(after - before, abs=0.1)
    error, n_z, p = bank_errors(one)
    turning = (n_z > 2.0) & (np.abs(p) < math.radians(30.0))
    assert turning.mean() > 0.3
    assert rms(error[turning]) < 8.0
    assert [one for one in one.violations if one.certain] == []


def test_the_better_the_positions_the_better_the_bank() -> None:
    errors: list[float] = []
    for noise in (1.5, 0.5, 0.1, 0.02):
        error, n_z, _ = bank_errors(flown(20.0, 1, noise))
        errors.append(rms(error[n_z > 2.0]))
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 4.0


def test_a_flight_has_its_own_clock_speed_and_course_and_says_what_is_derived() -> None:
    one = flown(20.0, 1)
    flight = one.flight
    assert flight.time[0] == 0.0 == flight.crossings[0].time
    assert one.offset == pytest.approx(LEAD - 0.013, abs=0.05)
    assert (np.diff(flight.time) > 0.0).all()
    assert np.diff(flight.time).max() < 0.0201
    assert {crossing.time for crossing in flight.crossings} <= set(flight.time.tolist())
    assert rms(flight["V_K"] - known().at("V_K", flight.time)) < 1.5
    assert math.degrees(rms(flight["gamma"] - known().at("gamma", flight.time))) < 2.0
    assert math.degrees(np.sqrt(np.median(angle_errors(flight, "chi") ** 2))) < 1.0
    assert {flight.basis(name) for name in ("V_K", "n_z", "mu", "V_I", "height")} == {Basis.DERIVED}
    assert "p_Kbar" not in flight
    remarks = " ".join(one.remarks)
    assert "at 20 Hz and scatter by" in remarks
    assert "a gap of 0.35 s behind line" in remarks
    assert "estimated from the positions, not recorded: bank, load factor" in remarks


@pytest.mark.parametrize("hz", [200.0, 1000.0])
def test_noise_at_a_high_rate_is_not_taken_for_leaps(hz: float) -> None:
    """Between two samples that are a millisecond apart, 1.5 m of noise look faster than sound."""
    one = imported(csv_text(fixes(hz)))
    assert not any("outlier" in remark for remark in one.remarks)
    assert_passings(one, 0.02)


def test_outliers_are_left_out() -> None:
    lines = csv_text(fixes(20.0)).splitlines()
    for row, (north, east) in {200: (400.0, 0.0), 700: (9.0, -9.0)}.items():
        time, x, y, height = (float(one) for one in lines[row].split(","))
        lines[row] = f"{time},{x + north},{y + east},{height}"
    one = imported("\n".join(lines) + "\n")
    remarks = " ".join(one.remarks)
    assert "1 outlier is left out: leaps faster than sound, the first one in line 201" in remarks
    assert "1 outlier is left out, the first one in line 701" in remarks
    good = flown(20.0, 1).flight
    assert [c.time for c in one.flight.crossings] == pytest.approx([c.time for c in good.crossings], abs=0.01)


def test_of_samples_that_come_within_a_tenth_of_a_millisecond_one_is_kept() -> None:
    seen = fixes(20.0)
    shifts = 0.00006 * np.arange(5)
    time = (seen.time[:, None] + shifts).ravel()
    often = Fixes(time, *(np.repeat(one, len(shifts)) for one in (seen.north, seen.east, seen.height)))
    one = imported(csv_text(often, offset=52.0, digits=5))
    assert f"{2 * len(seen.time)} samples are left out for coming less than 0.1 ms behind another" in one.remarks


def test_noise_is_estimated_and_one_that_is_said_too_small_leaves_no_log_without_positions() -> None:
    for noise in (0.1, 1.5, 5.0):
        seen = fixes(20.0, noise=noise, gap=(0.0, 0.0))
        path = smooth(seen.time, np.stack([seen.north, seen.east, seen.height]))
        assert path.noise == pytest.approx(noise, rel=0.2)
        assert path.scatter == pytest.approx(noise, rel=0.2)
    seen = fixes(20.0, noise=5.0)
    path = smooth(seen.time, np.stack([seen.north, seen.east, seen.height]), noise=1e-6)
    assert np.isfinite(path.position).all()
    assert path.outliers.mean() < 0.5


def test_a_straight_line_is_smoothed_into_itself() -> None:
    time = np.arange(0.0, 10.0, 0.1)
    places = np.stack([80.0 * time, -3.0 * time, np.full_like(time, 50.0)])
    position, velocity, acceleration = smooth(time, places).at(time)
    assert position == pytest.approx(places, abs=1e-6)
    assert velocity[0] == pytest.approx(80.0, abs=1e-4)
    assert np.abs(acceleration).max() < 1e-3


def test_a_level_turn_has_the_load_factor_and_attitude_of_its_bank() -> None:
    """`n_z = 1 / cos(mu)`, `tan(mu) = V^2 / (g r)`, for a turn to the right."""
    speed, bank = 80.0, math.radians(70.0)
    radius = speed**2 / (g0 * math.tan(bank))
    angle = np.linspace(0.0, 3.0, 50)
    position = np.stack([radius * np.sin(angle), radius * (1.0 - np.cos(angle)), np.full_like(angle, 30.0)])
    velocity = speed * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)])
    acceleration = speed**2 / radius * np.stack([-np.sin(angle), np.cos(angle), np.zeros_like(angle)])
    values = path_histories(race(), position, velocity, acceleration)
    histories = complete_histories(
        race(), {name: History(DECLARATIONS[name], one, Basis.DERIVED) for name, one in values.items()}
    )
    assert histories["n_z"].values == pytest.approx(1.0 / math.cos(bank))
    assert histories["mu"].values == pytest.approx(bank)
    assert histories["gamma"].values == pytest.approx(0.0, abs=1e-12)
    assert np.unwrap(histories["chi"].values) == pytest.approx(angle)
