"""Load factors and roll rate read back from the motion they make."""

import math

import numpy as np
import pytest
from flights import controls, states, windy_airs
from hypothesis import given
from hypothesis import strategies as st

from airrace.aircraft.aircraft import Aircraft
from airrace.dynamics.outer_loop import FlightPathState, flight_path_rates
from airrace.dynamics.outer_loop_inverse import LoadFactors, load_factors, load_factors_of_motion
from airrace.dynamics.point_mass import PointMassControl, PointMassState, build_point_mass
from airrace.dynamics.six_dof import build_six_dof
from airrace.environment.air import Air
from airrace.frames import rotation
from airrace.track.course import Rules

g = st.floats(-10.0, 10.0)


@given(states, g, g, g, st.floats(-7.0, 7.0))
def test_inverse_of_the_outer_loop_is_its_inverse(
    state: PointMassState[float], n_x: float, n_y: float, n_z: float, p_Kbar: float
) -> None:
    given_factors = {"n_x": n_x, "n_y": n_y, "n_z": n_z, "p_Kbar": p_Kbar}
    rates = flight_path_rates(state, rotation(state.q), **given_factors)
    assert vars(load_factors_of_motion(state, rates)) == pytest.approx(given_factors, abs=1e-9)


@given(states, st.floats(0.5, 2.0), g, g)
def test_length_of_the_quaternion_does_not_matter(
    state: PointMassState[float], length: float, n_y: float, n_z: float
) -> None:
    q0, q1, q2, q3 = (length * one for one in state.q)
    longer = FlightPathState(x=0.0, y=0.0, z=-9.0, V_K=state.V_K, q0=q0, q1=q1, q2=q2, q3=q3)
    rates = flight_path_rates(longer, rotation(longer.q), n_x=0.0, n_y=n_y, n_z=n_z, p_Kbar=1.0)
    read = load_factors_of_motion(longer, rates)
    assert (read.n_y, read.n_z, read.p_Kbar) == pytest.approx((n_y, n_z, 1.0), abs=1e-9)


@given(states, controls, windy_airs)
def test_load_factors_of_the_point_mass_are_its_states(
    edge540: Aircraft, rules: Rules, state: PointMassState[float], control: PointMassControl[float], air: Air
) -> None:
    model = build_point_mass(edge540, rules, air)
    read = load_factors(model.system)(state.join(), control.join(), model.parameter_values)
    n = LoadFactors[float].split(np.asarray(read).ravel())
    assert (n.n_y, n.n_z, n.p_Kbar) == pytest.approx((state.n_y, state.n_z, state.p_Kbar), abs=1e-9)


@given(st.floats(-0.2, 0.25), st.floats(-0.2, 0.2), st.floats(-4.0, 4.0), st.floats(-0.4, 0.4))
def test_load_factors_of_six_degrees_of_freedom_are_its_path_quantities(
    edge540: Aircraft, rules: Rules, alpha: float, beta: float, p: float, zeta: float
) -> None:
    model = build_six_dof(edge540, rules, Air())
    flight = [0.0, 0.0, -50.0, 80.0, math.cos(0.4), math.sin(0.4), 0.0, 0.0, 0.7]
    x, u = [*flight, alpha, beta, p, 0.3, 0.2, -0.1, 0.1, zeta], [0.0, 0.0, 0.0, 1.0]
    arguments = (x, u, model.parameter_values)
    read = LoadFactors[float].split(np.asarray(load_factors(model.system)(*arguments)).ravel())
    assert model.system.path_values is not None
    seen = np.asarray(model.system.path_values(*arguments)).ravel()
    path = dict(zip([one.name for one in model.system.path], seen, strict=True))
    assert (read.n_z, read.n_y, read.p_Kbar) == pytest.approx([path[name] for name in ("n_z", "n_y", "p_Kbar")])
