"""Manoeuvres of the point mass flown by the model of every fidelity."""

import dataclasses
import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from manoeuvres import MODEL_BUILDERS, SCRIPTS, build_model, flown

from airrace.model.dynamics.outer_loop import FlightPathState
from airrace.model.environment import Air, Profile, StaticWind, Thermal, g0
from airrace.model.frames import product, quaternion, rotation
from airrace.optimal_control.problem import Boundary, Phase, Problem, uniform
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.runge_kutta import RK4
from airrace.optimal_control.trajectory import Array, Trajectory
from airrace.procedure.control.path_following import (
    SOFTENING,
    Commands,
    PathGains,
    Reference,
    ReferencePoint,
    errors,
    from_optimum,
    path_following,
    path_rate,
    soften,
)
from airrace.procedure.control.simulation import STEP, Followed, follow, tracking_simulator
from airrace.procedure.fidelity import fidelity_of
from airrace.procedure.stage import Stage

DEGREE = np.pi / 180.0
WINDY = Air(wind=StaticWind(0.9, 8.0, Profile.POWER), thermals=(Thermal(200.0, 20.0, 2.0, 1400.0),))
IN_WIND = [name for name in SCRIPTS if name != "vertical roll"]
"""A vertical roll at no load factor has nothing to hold against a crosswind that turns around the aircraft."""
STILL = Air()


def followed(
    stage: str,
    name: str,
    air: Air = STILL,
    *,
    intervals: int = 50,
    step: float = STEP,
    gains: PathGains | None = None,
) -> Followed:
    """A manoeuvre flown by the model of a fidelity."""
    reference = flown(name, air).reference
    nodes = np.linspace(0.0, reference.duration, intervals + 1)
    flying = tracking_simulator(build_model(stage, air), fidelity_of(Stage(stage)).controller(), gains=gains, step=step)
    return follow(flying, reference, nodes=nodes)


def row(stage: str, name: str) -> int:
    return [one.name for one in build_model(stage).system.states].index(name)


@pytest.mark.parametrize(("name", "air"), [*((name, STILL) for name in SCRIPTS), *((name, WINDY) for name in IN_WIND)])
@pytest.mark.parametrize("stage", MODEL_BUILDERS)
def test_manoeuvre_is_followed_in_the_air_that_the_reference_was_flown_in(stage: str, name: str, air: Air) -> None:
    flight = followed(stage, name, air)
    assert flight.finished
    assert flight.tracking_error < 3.0
    assert flight.end_distance < 1.0
    assert abs(flight.end_roll) < 8.0 * DEGREE
    assert flight.time[0] == 0.0
    assert flight.durations.sum() == pytest.approx(flight.time[-1])
    if air is STILL:
        assert flight.time[-1] == pytest.approx(flown(name).reference.duration, rel=0.02)


@pytest.mark.parametrize("stage", MODEL_BUILDERS)
def test_half_the_step_leads_to_the_same_flight(stage: str) -> None:
    for name in ("7 g slalom", "half Cuban eight"):
        whole, half = followed(stage, name), followed(stage, name, step=STEP / 2)
        assert np.linalg.norm(whole.state[:3] - half.state[:3], axis=0).max() < 0.05


def test_same_flight_twice_is_the_same() -> None:
    one, other = followed("six-dof", "barrel roll"), followed("six-dof", "barrel roll")
    assert np.array_equal(one.state, other.state)
    assert np.array_equal(one.control, other.control)


def mirrored(reference: Reference) -> Reference:
    """The reference seen in a mirror that exchanges east and west."""
    odd = ("y", "v_E", "a_E", "q1", "q3", "n_y", "p_Kbar", "soft_p", "soft_p_dot")
    histories = dataclasses.replace(reference.histories, **{name: -getattr(reference.histories, name) for name in odd})
    return dataclasses.replace(reference, histories=histories)


@pytest.mark.parametrize("stage", MODEL_BUILDERS)
def test_mirrored_reference_is_followed_in_the_mirrored_way(stage: str) -> None:
    reference = flown("7 g slalom").reference
    nodes = np.linspace(0.0, reference.duration, 30)
    flying = tracking_simulator(build_model(stage), fidelity_of(Stage(stage)).controller())
    one, other = (follow(flying, each, nodes=nodes) for each in (reference, mirrored(reference)))
    signs = np.array([[1.0], [-1.0], [1.0]])
    assert signs * other.state[:3] == pytest.approx(one.state[:3], abs=1e-4)
    assert other.tracking_error == pytest.approx(one.tracking_error, abs=1e-4)


@pytest.mark.parametrize("stage", MODEL_BUILDERS)
def test_controls_lead_from_node_to_node_within_their_bounds(stage: str) -> None:
    model = build_model(stage)
    flight = followed(stage, "half Cuban eight", intervals=240)
    steps = np.diff(flight.time)
    for value, declared in zip(flight.control, model.system.controls, strict=True):
        assert declared.lower <= value.min()
        assert value.max() <= declared.upper
    legs = zip(flight.state.T[:-1], flight.control.T, steps, strict=True)
    ends = np.column_stack([_integrated(stage, x, u, duration) for x, u, duration in legs])
    missed = ends - flight.state[:, 1:]
    assert np.linalg.norm(missed[:3], axis=0).max() < 0.05
    commanded = [index for index, one in enumerate(model.system.states) if one.name in ("eta", "xi", "zeta", "n_z_cmd")]
    assert np.abs(missed[commanded]).max() < 1e-6
    assert np.abs(missed[row(stage, "delta_T")]).max() < 0.02


def _integrated(stage: str, x: Array, u: Array, duration: float) -> Array:
    model, parts = build_model(stage), 5
    for _ in range(parts):
        x = np.asarray(RK4.advance(model.system.rates, x, u, model.parameter_values, duration / parts)).ravel()
    return x


@pytest.mark.parametrize("stage", MODEL_BUILDERS)
def test_departure_is_a_value(stage: str) -> None:
    flight = followed(stage, "half Cuban eight", gains=PathGains(K_p=-30.0, K_v=-30.0, K_mu=-20.0))
    assert not flight.finished
    assert np.isnan(flight.time[-1])
    assert np.isnan(flight.state[:, -1]).all()
    assert flight.time[0] == 0.0
    assert np.isfinite(flight.state[:, 0]).all()


@pytest.mark.parametrize("stage", MODEL_BUILDERS)
def test_rolls_are_counted_along(stage: str) -> None:
    model = build_model(stage, counting=True)
    reference = flown("barrel roll", counting=True).reference
    nodes = np.linspace(0.0, reference.duration, 40)
    flight = follow(tracking_simulator(model, fidelity_of(Stage(stage)).controller()), reference, nodes=nodes)
    histories = {one.name: values for one, values in zip(model.system.states, flight.state, strict=True)}
    assert histories["Phi"][-1] == pytest.approx(2.0 * np.pi, abs=0.1)
    assert histories["gain"] == pytest.approx(np.interp(nodes, reference.s, reference.histories.gain), abs=2.0)


def test_phases_are_those_of_the_reference() -> None:
    whole = flown("barrel roll").reference
    parts = dataclasses.replace(whole, boundaries=np.array([0.0, 1.0, 2.5, whole.duration]))
    nodes = np.linspace(0.0, whole.duration, 21)
    flying = tracking_simulator(build_model("six-dof"), fidelity_of(Stage.SIX_DOF).controller())
    flight = follow(flying, parts, nodes=nodes)
    times = np.interp(parts.boundaries, nodes, flight.time)
    assert flight.durations == pytest.approx(np.diff(times), abs=1e-3)


GAINS = PathGains()
HISTORIES = {
    "Phi": 0.0,
    "gain": 0.0,
    "Phi_reset": 0.0,
    "gain_reset": 0.0,
    "soft_n_z_dot": 0.7,
    "soft_p_dot": -0.4,
    "delta_T": 0.8,
    "delta_T_dot": 0.1,
}

angle, offset = st.floats(-3.1, 3.1), st.floats(-5.0, 5.0)


def point(
    chi: float, gamma: float, mu: float, V: float, n: tuple[float, float, float], p: float
) -> ReferencePoint[float]:
    """A reference that flies with the load factors `n`, all told."""
    q = quaternion(chi, gamma, mu)
    R = np.array(rotation(q))
    a = g0 * (R @ [n[0], n[1], -n[2]] + [0.0, 0.0, 1.0])
    return ReferencePoint(
        **dict(zip(("x", "y", "z"), (20.0, -30.0, -90.0), strict=True)),
        **dict(zip(("v_N", "v_E", "v_D"), (V * R[:, 0]).tolist(), strict=True)),
        **dict(zip(("a_N", "a_E", "a_D"), a.tolist(), strict=True)),
        **dict(zip(("q0", "q1", "q2", "q3"), q, strict=True)),
        n_y=n[1],
        n_z=n[2],
        soft_n_z=n[2],
        p_Kbar=p,
        soft_p=p,
        **HISTORIES,
    )


points = st.builds(
    point,
    angle,
    st.floats(-1.5, 1.5),
    angle,
    st.floats(50.0, 110.0),
    st.tuples(st.floats(-1.0, 1.0), st.floats(-0.5, 0.5), st.floats(-3.0, 9.0)),
    st.floats(-5.0, 5.0),
)


def state_at(here: ReferencePoint[float], *, V_K: float | None = None) -> FlightPathState[float]:
    """The aircraft where and as the reference is."""
    V = math.sqrt(sum(one * one for one in here.velocity))
    q0, q1, q2, q3 = here.q
    return FlightPathState(x=here.x, y=here.y, z=here.z, V_K=V if V_K is None else V_K, q0=q0, q1=q1, q2=q2, q3=q3)


def moved(
    state: FlightPathState[float], right: float = 0.0, up: float = 0.0, forward: float = 0.0
) -> FlightPathState[float]:
    """The aircraft beside where it was, as its own wings see it, m."""
    step = np.array(rotation(state.q)) @ [forward, right, -up]
    return dataclasses.replace(state, x=state.x + step[0], y=state.y + step[1], z=state.z + step[2])


def turned(state: FlightPathState[float], p: float, q: float, r: float) -> FlightPathState[float]:
    """The aircraft in another attitude: a small rotation about its own axes, rad."""
    q0, q1, q2, q3 = product(state.q, (1.0, p / 2, q / 2, r / 2))
    return dataclasses.replace(state, q0=q0, q1=q1, q2=q2, q3=q3)


LEVEL = point(0.3, 0.0, 0.0, 80.0, (0.0, 0.0, 1.0), 0.0)
PULLING = point(0.3, 0.1, 0.9, 80.0, (0.0, 0.0, 4.0), 0.0)


@given(points)
def test_without_an_error_the_reference_itself_is_commanded(here: ReferencePoint[float]) -> None:
    commands, rate = path_following(state_at(here), here, GAINS)
    R, a = np.array(rotation(here.q)), np.array(here.acceleration)
    assert rate == pytest.approx(1.0)
    assert commands.n_x == pytest.approx((R.T @ (a - [0.0, 0.0, g0]))[0] / g0, abs=1e-9)
    assert (commands.n_y, commands.n_z, commands.p) == pytest.approx((here.n_y, here.n_z, here.p_Kbar), abs=1e-9)
    assert (commands.n_z_dot, commands.p_dot, commands.delta_T_dot) == pytest.approx((0.7, -0.4, 0.1))
    assert vars(errors(state_at(here), here)) == pytest.approx({"distance": 0.0, "roll": 0.0}, abs=1e-7)


@given(points, offset, offset, offset, st.floats(-0.3, 0.3), st.floats(-10.0, 10.0))
def test_mirrored_flight_is_commanded_the_mirrored_way_and_the_quaternions_sign_does_not_matter(
    here: ReferencePoint[float], right: float, up: float, forward: float, roll: float, faster: float
) -> None:
    state = turned(moved(state_at(here), right, up, forward), roll, 0.0, 0.0)
    state = dataclasses.replace(state, V_K=state.V_K + faster)
    seen, rate = path_following(state, here, GAINS)
    odd = ("y", "v_E", "a_E", "q1", "q3", "n_y", "p_Kbar", "soft_p", "soft_p_dot")
    there = dataclasses.replace(here, **{name: -getattr(here, name) for name in odd})
    mirrored = dataclasses.replace(state, y=-state.y, q1=-state.q1, q3=-state.q3)
    expected = dataclasses.replace(seen, n_y=-seen.n_y, p=-seen.p, p_dot=-seen.p_dot)
    commands, same = path_following(mirrored, there, GAINS)
    assert same == pytest.approx(rate)
    assert commands.join() == pytest.approx(expected.join(), abs=1e-9)
    other = dataclasses.replace(state, q0=-state.q0, q1=-state.q1, q2=-state.q2, q3=-state.q3)
    assert path_following(other, here, GAINS)[0].join() == pytest.approx(seen.join(), abs=1e-9)


@pytest.mark.parametrize(("forward", "rate"), [(4.0, 1.05), (-4.0, 0.95), (900.0, 1.5), (-900.0, 0.5)])
def test_aircraft_ahead_hurries_the_clock_and_one_behind_delays_it_within_limits(forward: float, rate: float) -> None:
    assert GAINS.along == (0.5, 1.5)
    assert path_rate(moved(state_at(LEVEL), forward=forward), LEVEL, GAINS) == pytest.approx(rate)


def test_aircraft_is_led_back_by_lever_lift_and_bank_and_without_lift_by_side_force() -> None:
    def commands(here: ReferencePoint[float], **offset: float) -> Commands[float]:
        return path_following(moved(state_at(here), **offset), here, GAINS)[0]

    slow = path_following(state_at(LEVEL, V_K=78.0), LEVEL, GAINS)[0]
    assert slow.n_x == pytest.approx(GAINS.K_V * 2.0 / g0)
    high, low = (commands(PULLING, up=up).n_z for up in (2.0, -2.0))
    assert (high, low) == pytest.approx((4.0 - 2.0 * GAINS.K_p / g0, 4.0 + 2.0 * GAINS.K_p / g0))
    assert commands(PULLING, right=2.0).p < -0.1
    assert commands(PULLING, right=-2.0).p > 0.1
    pushing, floating = (point(0.3, 0.1, 0.9, 80.0, (0.0, 0.0, n_z), 0.0) for n_z in (-2.0, 0.0))
    assert commands(pushing, right=2.0).p > 0.1
    beside = commands(floating, right=0.5)
    assert beside.p == pytest.approx(0.0, abs=1e-9)
    assert beside.n_y < -0.05


@given(st.floats(-0.2, 0.2))
def test_bank_error_is_rolled_out(roll: float) -> None:
    floating = point(0.3, 0.1, 0.9, 80.0, (0.0, 0.0, 0.0), 0.0)
    state = turned(state_at(floating), -roll, 0.0, 0.0)
    error = errors(state, floating).roll
    assert error == pytest.approx(2.0 * math.atan(roll / 2.0))
    assert path_following(state, floating, GAINS)[0].p == pytest.approx(GAINS.K_mu * error)


def test_symbols_and_floats_agree() -> None:
    state = turned(moved(state_at(PULLING), 1.0, -2.0, 3.0), 0.1, -0.05, 0.02)
    x, r = ca.SX.sym("x", FlightPathState.size()), ca.SX.sym("r", ReferencePoint.size())
    commands, rate = path_following(FlightPathState.split(x), ReferencePoint.split(r), GAINS)
    function = ca.Function("law", [x, r], [ca.vertcat(*commands.join(), rate)])
    values = np.asarray(function(state.join(), PULLING.join())).ravel()
    floats, same = path_following(state, PULLING, GAINS)
    assert values == pytest.approx([*floats.join(), same])
    assert len(values) == Commands.size() + 1


@pytest.mark.parametrize("name", SCRIPTS)
def test_velocity_and_acceleration_are_the_derivatives_of_the_path(name: str) -> None:
    flight = flown(name)
    reference = flight.reference
    speed = np.linalg.norm(np.array(reference.histories.velocity), axis=0)
    assert speed == pytest.approx(flight.state[3])
    inside = slice(2, -2)
    for lower, upper in (("position", "velocity"), ("velocity", "acceleration")):
        histories, rates = (np.array(getattr(reference.histories, one)) for one in (lower, upper))
        differences = np.gradient(histories, reference.s, axis=1)
        # a central difference is wrong by h^2/6 of the third derivative, at a corner by h/2 of the change of slope;
        # load factors change by 30 g/s at most
        assert np.abs(differences - rates)[:, inside].max() < (0.02 if upper == "velocity" else 1.5)


def test_softening_leaves_straight_histories_alone_is_neither_early_nor_late_and_keeps_the_integral() -> None:
    s = np.linspace(0.0, 3.0, 400)
    inside = (s > SOFTENING + 0.01) & (s < 2.99 - SOFTENING)
    assert soften(s, 2.0 - 3.0 * s)[inside] == pytest.approx((2.0 - 3.0 * s)[inside])
    assert soften(s, np.full(400, 4.0)) == pytest.approx(np.full(400, 4.0))
    s = np.linspace(0.0, 2.0, 2001)
    ramp = np.interp(s, (0.9, 1.1), (0.0, 1.0))
    soft = soften(s, ramp)
    assert soft + soft[::-1] == pytest.approx(np.ones(2001), abs=1e-3)
    assert np.trapezoid(soft, s) == pytest.approx(np.trapezoid(ramp, s), abs=1e-4)
    assert np.all(np.diff(soft) >= -1e-12)
    assert soft[s < 0.89 - SOFTENING].max() < 1e-9


def test_optimum_is_sampled_as_it_was_flown() -> None:
    flight = flown("barrel roll")
    system, intervals = flight.model.system, len(flight.s) - 1
    first = intervals // 3
    lengths = np.array([first, intervals - first]) * (flight.s[-1] / intervals)
    phases = tuple(
        Phase(name, uniform(count), Interval(0.1, 9.0)) for name, count in (("a", first), ("b", intervals - first))
    )
    problem = Problem(system, tuple(flight.model.parameter_values.tolist()), Boundary(), phases)
    trajectory = Trajectory(
        phases=("a", "b"),
        first_node=np.array([0, first, intervals]),
        durations=lengths,
        time=flight.s,
        states=system.states,
        state=flight.state,
        controls=system.controls,
        control=flight.control[:, :-1],
    )
    sampled, grid = from_optimum(flight.model, problem, trajectory), flight.reference
    assert np.all(np.diff(sampled.s) > 0.0)
    assert sampled.boundaries == pytest.approx([0.0, flight.s[first], flight.s[-1]])
    for name in ("position", "velocity", "acceleration", "q"):
        expected = np.array(getattr(grid.histories, name))
        assert np.array(getattr(sampled.histories, name))[:, ::10] == pytest.approx(expected, abs=1e-6)
