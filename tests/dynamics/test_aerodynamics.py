"""The wind triangle, the drag polar, the lift curve."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airrace.aircraft.aircraft import Aircraft
from airrace.dynamics.aerodynamics import drag_coefficient, lift_curve, still_airflow, wind_airflow
from airrace.dynamics.aircraft_parameters import aircraft_parameters
from airrace.frames import quaternion, rotation

angle = st.floats(-3.1, 3.1)
winds = st.tuples(*[st.floats(-15.0, 15.0)] * 3)


@given(angle, st.floats(-1.5, 1.5), angle, st.floats(45.0, 120.0), winds)
def test_air_velocity_and_wind_add_up_to_ground_velocity(
    chi: float, gamma: float, mu: float, V_K: float, V_W: tuple[float, float, float]
) -> None:
    R = rotation(quaternion(chi, gamma, mu))
    flow = wind_airflow(V_K, R, V_W)
    V_A_O = np.array(R) @ [flow.u, flow.v, flow.w]
    assert V_A_O + np.array(V_W) == pytest.approx(V_K * np.array(R)[:, 0], abs=1e-10)
    assert np.linalg.norm(V_A_O) == pytest.approx(flow.V_A, rel=1e-12)


@pytest.mark.parametrize(("blows_from", "V_A"), [(0.0, 90.0), (math.pi, 70.0), (math.pi / 2, math.hypot(80.0, 10.0))])
def test_headwind_adds_and_tailwind_subtracts(blows_from: float, V_A: float) -> None:
    wind = (-10.0 * math.cos(blows_from), -10.0 * math.sin(blows_from), 0.0)
    flow = wind_airflow(80.0, rotation(quaternion(0.0, 0.0, 0.0)), wind)
    assert math.hypot(flow.u, flow.v, flow.w) == pytest.approx(V_A, rel=1e-12)
    assert math.isclose(flow.V_A, V_A, rel_tol=1e-12)


def test_wind_from_the_right_meets_the_right_side_and_updraft_meets_from_below() -> None:
    level_north = rotation(quaternion(0.0, 0.0, 0.0))
    assert wind_airflow(80.0, level_north, (0.0, -5.0, 0.0)).v == pytest.approx(5.0)
    assert wind_airflow(80.0, level_north, (0.0, 0.0, -5.0)).w == pytest.approx(5.0)


def test_still_air_is_met_along_the_path() -> None:
    flow = still_airflow(77.0)
    assert (flow.V_A, flow.u, flow.v, flow.w) == (77.0, 77.0, 0.0, 0.0)


@given(st.floats(-1.4, 1.4), st.floats(-0.2, 0.2))
def test_drag_is_least_at_its_lift_coefficient_and_without_sideslip(
    edge540: Aircraft, C_L: float, beta_A: float
) -> None:
    numbers = aircraft_parameters(edge540)
    assert drag_coefficient(C_L, beta_A, numbers) >= drag_coefficient(numbers.C_L_minD, 0.0, numbers) == numbers.C_D0
    assert drag_coefficient(C_L, beta_A, numbers) == drag_coefficient(C_L, -beta_A, numbers)


def test_drag_of_sideslip_equals_its_source_at_the_point_of_calibration(edge540: Aircraft) -> None:
    numbers = aircraft_parameters(edge540)
    added = drag_coefficient(0.0, 0.2, numbers) - drag_coefficient(0.0, 0.0, numbers)
    assert added == pytest.approx(0.17 * 0.2, rel=0.01)


def test_lift_is_linear_at_small_angles(edge540: Aircraft) -> None:
    for alpha_A in (-0.15, 0.0, 0.05, 0.15):
        assert lift_curve(alpha_A, edge540.lift) == pytest.approx(4.8 * alpha_A, abs=2e-3)


@given(st.floats(-1.5, 1.5), st.floats(0.0, 0.5))
def test_lift_curve_rises_between_its_limits(edge540: Aircraft, alpha_A: float, step: float) -> None:
    lift = edge540.lift
    assert lift.C_L_min < lift_curve(alpha_A, lift) < lift.C_L_max
    assert lift_curve(alpha_A + step, lift) >= lift_curve(alpha_A, lift)


def test_trimmed_side_force_includes_the_rudder_that_balances_the_yawing_moment(edge540: Aircraft) -> None:
    beta_A = 0.1
    zeta = -edge540.yaw.beta * beta_A / edge540.yaw.zeta  # C_n = 0
    C_Y = edge540.side_force.beta * beta_A + edge540.side_force.zeta * zeta
    assert aircraft_parameters(edge540).C_Y_trim * beta_A == pytest.approx(C_Y, rel=1e-12)
