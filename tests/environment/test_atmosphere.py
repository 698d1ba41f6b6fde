"""The air of the day against published values and its own laws."""

import casadi as ca
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airrace.environment import (
    R_AIR,
    Air,
    AtmosphereParameters,
    atmosphere_parameters,
    density,
    g0,
    pressure,
    temperature,
)
from airrace.frames import power, smooth_clip, smooth_maximum

# geopotential height (m), temperature (K), pressure (Pa), density (kg/m3) [ICAO Doc 7488, US Standard Atmosphere 1976]
STANDARD = (
    (0.0, 288.150, 101325.0, 1.22500),
    (500.0, 284.900, 95460.8, 1.16727),
    (1000.0, 281.650, 89874.6, 1.11164),
    (2000.0, 275.150, 79495.2, 1.00649),
    (3000.0, 268.650, 70108.5, 0.909122),
    (5000.0, 255.650, 54019.9, 0.736116),
    (11000.0, 216.650, 22632.1, 0.363918),
)
days = st.builds(
    Air,
    temperature_offset=st.floats(-40.0, 40.0),
    pressure_offset=st.floats(-5000.0, 5000.0),
    elevation=st.floats(-300.0, 3000.0),
)
depths = st.floats(-1000.0, 50.0)


@pytest.mark.parametrize(("height", "T", "p", "rho"), STANDARD)
def test_standard_day_reproduces_the_published_table(height: float, T: float, p: float, rho: float) -> None:
    standard = atmosphere_parameters(Air())
    assert temperature(-height, standard) == pytest.approx(T, abs=1e-9)
    assert pressure(-height, standard) == pytest.approx(p, rel=1e-5)
    assert density(-height, standard) == pytest.approx(rho, rel=1e-5)


def test_origin_on_a_hill_sees_the_air_of_its_elevation() -> None:
    low, high = atmosphere_parameters(Air()), atmosphere_parameters(Air(elevation=1500.0))
    assert density(-20.0, high) == pytest.approx(density(-1520.0, low), rel=1e-14)


@given(days, depths)
def test_offsets_shift_temperature_everywhere_and_pressure_at_sea_level(day: Air, z: float) -> None:
    air, standard = atmosphere_parameters(day), atmosphere_parameters(Air(elevation=day.elevation))
    assert temperature(z, air) - temperature(z, standard) == pytest.approx(day.temperature_offset, abs=1e-9)
    assert pressure(day.elevation, air) == pytest.approx(101325.0 + day.pressure_offset, rel=1e-12)


@given(days, depths)
def test_air_is_an_ideal_gas(day: Air, z: float) -> None:
    air = atmosphere_parameters(day)
    assert density(z, air) * R_AIR * temperature(z, air) == pytest.approx(pressure(z, air), rel=1e-13)


@given(days, depths)
def test_pressure_carries_the_weight_of_the_air_above(day: Air, z: float) -> None:
    air = atmosphere_parameters(day)
    slope = (pressure(z + 1.0, air) - pressure(z - 1.0, air)) / 2.0
    assert slope == pytest.approx(g0 * density(z, air), rel=1e-6)


def test_density_of_symbols_equals_density_of_numbers() -> None:
    z, p = ca.SX.sym("z"), ca.SX.sym("p", AtmosphereParameters.size())
    function = ca.Function("rho", [z, p], [density(z, AtmosphereParameters.split(p))])
    air = atmosphere_parameters(Air(temperature_offset=12.0, pressure_offset=-700.0, elevation=430.0))
    assert float(function(-75.0, air.join())) == pytest.approx(density(-75.0, air), rel=1e-14)


number = st.floats(-100.0, 100.0)


@given(number, number, st.floats(1e-3, 10.0))
def test_smooth_maximum_lies_above_the_maximum_by_half_its_width_at_most(a: float, b: float, width: float) -> None:
    excess = smooth_maximum(a, b, width) - max(a, b)
    assert -1e-12 <= excess <= 0.5 * width + 1e-12


@given(number, st.floats(0.0, 10.0), st.floats(1e-2, 1.0))
def test_smooth_clip_rises_and_stays_within_its_limits(x: float, step: float, width: float) -> None:
    assert -2.0 <= smooth_clip(x, -2.0, 3.0, width) <= 3.0
    assert smooth_clip(x + step, -2.0, 3.0, width) >= smooth_clip(x, -2.0, 3.0, width) - 1e-12


def test_smooth_clip_leaves_the_middle_alone_and_closes_in_on_its_limits() -> None:
    assert smooth_clip(0.0, -1.0, 1.0, 0.1) == pytest.approx(0.0, abs=1e-15)
    assert smooth_clip(100.0, -1.0, 1.0, 0.1) == pytest.approx(1.0, abs=1e-5)
    assert smooth_clip(-100.0, -1.0, 1.0, 0.1) == pytest.approx(-1.0, abs=1e-5)


@given(st.floats(1e-3, 100.0), st.floats(-5.0, 5.0))
def test_power_is_the_power(x: float, exponent: float) -> None:
    assert power(x, exponent) == pytest.approx(x**exponent, rel=1e-12)
