"""Counters of rolls: they turn with the roll rate and change no flight."""

import numpy as np
import pytest
from flights import controls, states
from hypothesis import given

from airrace.aircraft.aircraft import Aircraft
from airrace.dynamics.flight_model import FlightModel
from airrace.dynamics.point_mass import PointMassControl, PointMassState, build_point_mass
from airrace.environment.air import Air, StaticWind
from airrace.quantities import Interval
from airrace.track.course import Rules

RULES = Rules(n_z=Interval(-2.0, 10.0))
AIR = Air(wind=StaticWind(0.4, 8.0))
State, Control = PointMassState[float], PointMassControl[float]


@pytest.fixture(scope="module")
def counting(edge540: Aircraft) -> FlightModel:
    return build_point_mass(edge540, RULES, AIR, counting=True)


@pytest.fixture(scope="module")
def plain(edge540: Aircraft) -> FlightModel:
    return build_point_mass(edge540, RULES, AIR)


def rates(model: FlightModel, state: State, control: Control, counters: list[float], reset: list[float]) -> np.ndarray:
    x, u = [*state.join(), *counters], [*control.join(), *reset]
    return np.array(model.system.rates(x, u, model.parameter_values)).ravel()


@given(states, controls)
def test_counters_turn_with_the_roll_rate_and_rise_with_the_flight(
    counting: FlightModel, state: State, control: Control
) -> None:
    found = dict(
        zip(
            (one.name for one in counting.system.states),
            rates(counting, state, control, [1.0, 9.0], [0.0, 0.0]),
            strict=True,
        )
    )
    assert found["Phi"] == pytest.approx(state.p_Kbar, abs=1e-12)
    assert found["gain"] == pytest.approx(-found["z"], abs=1e-12)


@given(states, controls)
def test_resets_wind_the_counters_and_nothing_else(counting: FlightModel, state: State, control: Control) -> None:
    resting = rates(counting, state, control, [0.0, 0.0], [0.0, 0.0])
    wound = rates(counting, state, control, [2.0, -30.0], [-1.5, 4.0])
    assert wound[-2:] - resting[-2:] == pytest.approx([-1.5, 4.0], abs=1e-9)
    assert np.array_equal(wound[:-2], resting[:-2])


@given(states, controls)
def test_flight_is_the_same_with_and_without_counting(
    counting: FlightModel, plain: FlightModel, state: State, control: Control
) -> None:
    with_counters = rates(counting, state, control, [0.3, 5.0], [0.1, 0.1])
    assert with_counters[:-2] == pytest.approx(rates(plain, state, control, [], []), rel=1e-13, abs=1e-13)
