"""The point mass, and the kernels of all flight models."""

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import pytest
from bodies import fly_point_mass, wind_at
from flights import states, windy_airs
from hypothesis import given
from kernel_results import all_results
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from airrace.model.aircraft import Aircraft, aircraft_parameters
from airrace.model.dynamics.aerodynamics import LoadFactorPath
from airrace.model.dynamics.flight_model import FlightModel
from airrace.model.dynamics.point_mass import PointMassState, build_point_mass
from airrace.model.dynamics.six_dof import build_six_dof
from airrace.model.environment import Air, Profile, StaticWind, Thermal, atmosphere_parameters, density, g0
from airrace.model.frames import rotation
from airrace.model.track.course import Rules
from airrace.optimal_control.kernels import NativeKernel, build_kernels, casadi_kernels
from airrace.optimal_control.runge_kutta import DORMAND_PRINCE_5

Array = NDArray[np.float64]
KNOT = 1852.0 / 3600.0
CRUISE = PointMassState(
    x=0.0, y=0.0, z=-50.0, V_K=80.0, q0=1.0, q1=0.0, q2=0.0, q3=0.0, delta_T=1.0, n_z=1.0, n_y=0.0, p_Kbar=0.0
)


def thrust_minus_drag(
    aircraft: Aircraft, air: Air, state: PointMassState[float], path: LoadFactorPath[float], V_A: float
) -> float:
    """From the aircraft's own numbers, apart from the model under test (N)."""
    rho, drag, engine = density(state.z, atmosphere_parameters(air)), aircraft.drag, aircraft.propulsion
    C_D = drag.C_D0 + drag.k * (path.C_L - drag.C_L_minD) ** 2 + drag.C_Dbeta2 * path.beta_A**2
    P = engine.eta_p * engine.P_max
    T = state.delta_T * P * (1.132 * rho / 1.225 - 0.132) / math.hypot(V_A, P / engine.T_static)
    return T - 0.5 * rho * V_A**2 * aircraft.airframe.S * C_D


# --- force balance -----------------------------------------------------------------------------------------------


@given(states, windy_airs)
def test_axial_load_factor_in_wind_satisfies_the_balance_of_force_vectors(
    edge540: Aircraft, state: PointMassState[float], air: Air
) -> None:
    rate, path = fly_point_mass(edge540, air, state)
    R = np.array(rotation(state.q))
    n_x = rate.V_K / g0 - R[2, 0]
    V_A_Kbar = np.array([state.V_K, 0.0, 0.0]) - R.T @ wind_at(air, (state.x, state.y, state.z))
    V_A = float(np.linalg.norm(V_A_Kbar))
    a = V_A_Kbar / V_A
    side = np.cross([0.0, 0.0, 1.0], a) / np.linalg.norm(np.cross([0.0, 0.0, 1.0], a))
    lift = np.cross(a, side)
    weight = edge540.airframe.m * g0
    excess = thrust_minus_drag(edge540, air, state, path, V_A) / weight
    # unknown n_x, lift and side force: (n_x, n_y, -n_z) = excess a + L lift + Y side
    system = np.column_stack([[1.0, 0.0, 0.0], -lift, -side])
    expected, _, _ = np.linalg.solve(system, excess * a - np.array([0.0, state.n_y, -state.n_z]))
    assert n_x == pytest.approx(expected, abs=1e-6)


@given(states, windy_airs)
def test_lift_and_sideslip_make_the_load_factors(edge540: Aircraft, state: PointMassState[float], air: Air) -> None:
    _, path = fly_point_mass(edge540, air, state)
    R = np.array(rotation(state.q))
    V_A_Kbar = np.array([state.V_K, 0.0, 0.0]) - R.T @ wind_at(air, (state.x, state.y, state.z))
    V_A = float(np.linalg.norm(V_A_Kbar))
    a = V_A_Kbar / V_A
    qS = 0.5 * density(state.z, atmosphere_parameters(air)) * V_A**2 * edge540.airframe.S
    weight = edge540.airframe.m * g0
    up = np.array([0.0, 0.0, -1.0])
    lift = qS * path.C_L * (up - (up @ a) * a) / np.linalg.norm(up - (up @ a) * a)
    assert -lift[2] == pytest.approx(weight * state.n_z, rel=1e-9, abs=1e-6)
    Y = qS * aircraft_parameters(edge540).C_Y_trim * path.beta_A
    assert Y / weight == pytest.approx(state.n_y, rel=1e-9, abs=1e-9)


# --- special cases -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("knots", "n_z"), [(140.0, 5.9), (180.0, 9.7), (200.0, 12.0)])
def test_greatest_lift_gives_the_known_load_factors(edge540: Aircraft, knots: float, n_z: float) -> None:
    state = dataclasses.replace(CRUISE, z=0.0, V_K=knots * KNOT, n_z=n_z)
    assert abs(fly_point_mass(edge540, Air(), state)[1].C_L - edge540.lift.C_L_max) < 0.014


def test_full_power_level_flight_settles_at_the_speed_where_thrust_equals_drag(edge540: Aircraft) -> None:
    def acceleration(V_K: float) -> float:
        return fly_point_mass(edge540, Air(), dataclasses.replace(CRUISE, V_K=V_K))[0].V_K

    top = brentq(acceleration, 80.0, 150.0)
    state = dataclasses.replace(CRUISE, V_K=0.9 * top)
    flight = solve_ivp(
        lambda _, x: fly_point_mass(edge540, Air(), PointMassState[float].split(x))[0].join(),
        (0.0, 120.0),
        state.join(),
    )
    end = PointMassState[float].split(flight.y[:, -1])
    assert (end.z, end.V_K) == (pytest.approx(-50.0, abs=1e-6), pytest.approx(top, rel=1e-3))


def test_right_sideforce_needs_wind_from_the_left(edge540: Aircraft) -> None:
    assert fly_point_mass(edge540, Air(), dataclasses.replace(CRUISE, n_y=0.5))[1].beta_A < 0.0


# --- the system --------------------------------------------------------------------------------------------------


def test_still_air_costs_nothing_of_the_wind(edge540: Aircraft, rules: Rules) -> None:
    still = build_point_mass(edge540, rules, Air()).system
    windy = build_point_mass(edge540, rules, Air(wind=StaticWind(0.0, 5.0))).system
    assert still.rates.n_instructions() + 20 < windy.rates.n_instructions()


@given(states)
def test_projection_makes_the_attitude_unit_and_touches_nothing_else(
    edge540: Aircraft, rules: Rules, state: PointMassState[float]
) -> None:
    projection = build_point_mass(edge540, rules, Air()).system.projection
    assert projection is not None
    stretched = dataclasses.replace(
        state, **{name: 1.3 * q for name, q in zip(("q0", "q1", "q2", "q3"), state.q, strict=True)}
    )
    projected = np.array(projection(stretched.join())).ravel()
    assert projected == pytest.approx(np.array(state.join()), abs=1e-12)


WINDY = Air(wind=StaticWind(1.0, 5.0, Profile.POWER), thermals=(Thermal(0.0, 0.0, 2.0, 1000.0),))
CENTRES = {"z": -200.0, "V_K": 80.0, "q0": 0.8, "q1": 0.4, "q2": 0.3, "delta_T": 0.7, "n_z": 4.0}
SPREADS = {"x": 100.0, "y": 100.0, "z": 20.0, "V_K": 10.0, "delta_T": 0.1, "n_z": 2.0}


def flown(model: FlightModel, seed: int) -> list[np.ndarray]:
    """An interval of a hundredth of some seconds, somewhere in flight."""
    random = np.random.default_rng(seed)
    system = model.system
    x = [CENTRES.get(one.name, 0.0) + SPREADS.get(one.name, 0.1) * random.normal() for one in system.states]
    u = random.normal(size=len(system.controls))
    return [np.hstack([x, u, 6.0]), np.array([0.01]), model.parameter_values, random.normal(size=len(x))]


@pytest.mark.parametrize(
    ("build", "air", "counting"),
    [
        (build_point_mass, Air(), False),
        (build_point_mass, Air(), True),
        (build_point_mass, WINDY, False),
        (build_six_dof, Air(), False),
        (build_six_dof, WINDY, True),
    ],
)
def test_steps_have_the_derivatives_of_the_whole_graph(
    build: Callable[..., FlightModel], air: Air, counting: bool, edge540: Aircraft, rules: Rules
) -> None:
    model = build(edge540, rules, air, counting=counting)
    composed, graph = (make(model.system, DORMAND_PRINCE_5).step for make in (build_kernels, casadi_kernels))
    assert isinstance(composed, NativeKernel)
    given = intervals(model, 8)
    of_graph = all_results(graph, given)  # the native ones end with values and Jacobian again
    for mine, theirs in zip(all_results(composed, given)[: len(of_graph)], of_graph, strict=True):
        assert np.isfinite(theirs).all()
        scale = np.abs(theirs).max(axis=1, keepdims=True)
        assert (np.abs(mine - theirs) <= 1e-12 * scale).all()
    for mine, theirs in (
        (composed.jacobian_pattern, graph.jacobian_pattern),
        (composed.hessian_pattern, graph.hessian_pattern),
    ):
        assert set(zip(*mine.get_triplet(), strict=True)) == set(zip(*theirs.get_triplet(), strict=True))


def intervals(model: FlightModel, count: int) -> list[np.ndarray]:
    """Intervals of flight: y, own, shared once, multipliers."""
    each = [flown(model, seed) for seed in range(count)]
    y, own, _, lam = (np.stack(one) for one in zip(*each, strict=True))
    return [y, own, np.asarray(model.parameter_values), lam]
