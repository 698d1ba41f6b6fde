"""Direction, profile and smoothness of the static wind."""

import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airrace.environment.air import Profile, StaticWind
from airrace.environment.static_wind import static_wind, static_wind_parameters

profiles = st.sampled_from(Profile)
winds = st.builds(
    StaticWind,
    origin=st.floats(-math.pi, math.pi),
    speed=st.floats(0.5, 15.0),
    profile=profiles,
    reference_height=st.floats(5.0, 100.0),
    exponent=st.floats(0.05, 0.4),
    roughness=st.floats(1e-3, 3.0),
)


def speed_at(h: float, wind: StaticWind) -> float:
    return math.hypot(*static_wind(wind.profile, h, static_wind_parameters(wind)))


@pytest.mark.parametrize("profile", Profile)
def test_wind_blows_from_its_origin(profile: Profile) -> None:
    wind = StaticWind(origin=math.radians(270.0), speed=8.0, profile=profile, reference_height=20.0)
    north, east = static_wind(profile, 20.0, static_wind_parameters(wind))
    assert (north, east) == (pytest.approx(0.0, abs=1e-12), pytest.approx(8.0, rel=1e-12))


@given(winds)
def test_reference_height_sees_the_given_speed(wind: StaticWind) -> None:
    assert speed_at(wind.reference_height, wind) == pytest.approx(wind.speed, rel=1e-12)


@given(winds, st.floats(-50.0, 1000.0))
def test_direction_is_the_same_at_every_height(wind: StaticWind, h: float) -> None:
    north, east = static_wind(wind.profile, h, static_wind_parameters(wind))
    assert north * wind.east - east * wind.north == pytest.approx(0.0, abs=1e-9)
    assert north * wind.north + east * wind.east > 0.0


def test_constant_profile_knows_no_height() -> None:
    wind = StaticWind(0.7, 9.0)
    assert speed_at(-50.0, wind) == pytest.approx(9.0, rel=1e-15)
    assert speed_at(500.0, wind) == pytest.approx(9.0, rel=1e-15)


def test_power_profile_follows_the_power_law_at_flying_heights() -> None:
    wind = StaticWind(0.7, 9.0, Profile.POWER, reference_height=10.0, exponent=0.2)
    for h in (15.0, 40.0, 150.0):
        assert speed_at(h, wind) == pytest.approx(9.0 * (h / 10.0) ** 0.2, rel=2e-3)


def test_logarithmic_profile_follows_the_logarithm_at_flying_heights() -> None:
    wind = StaticWind(0.7, 9.0, Profile.LOG, reference_height=10.0, roughness=0.1)
    for h in (15.0, 40.0, 150.0):
        assert speed_at(h, wind) == pytest.approx(9.0 * math.log(h / 0.1) / math.log(10.0 / 0.1), rel=2e-3)


@pytest.mark.parametrize("roughness", [0.03, 0.5, 3.0])
def test_logarithmic_profile_never_reverses_at_the_ground(roughness: float) -> None:
    wind = StaticWind(math.pi, 9.0, Profile.LOG, reference_height=20.0, roughness=roughness)
    north, _ = static_wind(Profile.LOG, -50.0, static_wind_parameters(wind))
    assert 0.0 < north < 9.0


@given(winds, st.floats(-50.0, 300.0), st.floats(0.0, 50.0))
def test_wind_never_weakens_with_height(wind: StaticWind, h: float, step: float) -> None:
    assert speed_at(h + step, wind) >= speed_at(h, wind) * (1.0 - 1e-12)


@pytest.mark.parametrize("profile", Profile)
def test_second_derivative_is_continuous_down_to_below_the_ground(profile: Profile) -> None:
    h = ca.SX.sym("h")
    speed = static_wind(profile, h, static_wind_parameters(StaticWind(math.pi, 10.0, profile)))[0] + 0.0 * h
    second = ca.Function("second", [h], [ca.jacobian(ca.jacobian(speed, h), h)])
    heights = np.linspace(-50.0, 50.0, 20001)
    curvature = np.array([float(second(one)) for one in heights])
    assert np.all(np.isfinite(curvature))
    # neighbours 5 mm apart differ little beside the largest value: no jump
    assert np.max(np.abs(np.diff(curvature))) <= 0.03 * max(np.max(np.abs(curvature)), 1e-12)
