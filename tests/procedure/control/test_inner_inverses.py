"""Every inverse against its plant: what is commanded is what is flown."""

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from manoeuvres import MODEL_BUILDERS, build_model

from airrace.model.dynamics.flight_model import FlightModel
from airrace.model.dynamics.outer_loop import LoadFactors, load_factors
from airrace.model.frames import quaternion
from airrace.optimal_control.runge_kutta import RK4
from airrace.optimal_control.trajectory import Array
from airrace.procedure.control.dynamic_inversion import InnerController
from airrace.procedure.control.path_following import Commands
from airrace.procedure.fidelity import fidelity_of
from airrace.procedure.stage import STAGES, Stage

STEP = 0.005
MODELS = {stage: build_model(stage) for stage in MODEL_BUILDERS}
CONTROLLERS = {stage: fidelity_of(Stage(stage)).controller()(model) for stage, model in MODELS.items()}
FACTORS = {stage: load_factors(model.system) for stage, model in MODELS.items()}


def commands(n_z: float, n_y: float = 0.0, p: float = 0.0, n_x: float = 0.0) -> Commands[float]:
    """What is to be held."""
    return Commands(n_x=n_x, delta_T_dot=0.0, n_y=n_y, n_z=n_z, n_z_dot=0.0, p=p, p_dot=0.0)


def settled(stage: str, wanted: Commands[float], V_K: float = 90.0, gamma: float = 0.2, mu: float = 0.5) -> Array:
    """The state in which the model does what is wanted of it."""
    model, inner = MODELS[stage], CONTROLLERS[stage]
    known = dict(zip(("q0", "q1", "q2", "q3"), quaternion(0.7, gamma, mu), strict=True)) | {
        "z": -300.0,
        "V_K": V_K,
        "delta_T": 0.7,
    }
    x = np.array([known.get(one.name, 0.0) for one in model.system.states])
    for _ in range(40):
        x = np.asarray(inner.settled(x, wanted.join())).ravel()
    return x


def flown_factors(stage: str, x: Array, wanted: Commands[float]) -> LoadFactors[float]:
    """Load factors and roll rate in a state under control."""
    u = CONTROLLERS[stage].controls(x, wanted.join())
    return LoadFactors.split(np.asarray(FACTORS[stage](x, u, MODELS[stage].parameter_values)).ravel())


def closed_loop(model: FlightModel, inner: InnerController) -> Callable[[Array, Sequence[Commands[float]]], Array]:
    """States after each step of a flight in which the commands are given one by one."""
    x, c = ca.SX.sym("x", len(model.system.states)), ca.SX.sym("c", Commands.size())
    p = ca.DM(model.parameter_values)
    nothing = ca.SX.sym("nothing", 0)
    rates = ca.Function("rates", [x, c, nothing], [model.system.rates(x, inner.controls(x, c), p)])
    assert model.system.projection is not None
    step = ca.Function("step", [x, c], [model.system.projection(RK4.advance(rates, x, c, nothing, STEP))])

    def fly(start: Array, given: Sequence[Commands[float]]) -> Array:
        return np.asarray(step.mapaccum("flight", len(given))(start, np.array([one.join() for one in given]).T))

    return fly


def row_of(stage: str, name: str) -> int:
    """Where a state stands."""
    return [one.name for one in MODELS[stage].system.states].index(name)


@pytest.mark.parametrize("stage", MODEL_BUILDERS)
@given(n_z=st.floats(-3.0, 7.0), n_y=st.floats(-0.15, 0.15), p=st.floats(-2.0, 2.0))
def test_settled_model_flies_what_is_commanded(stage: str, n_z: float, n_y: float, p: float) -> None:
    wanted = commands(n_z, n_y, p)
    flown = flown_factors(stage, settled(stage, wanted), wanted)
    assert (flown.n_z, flown.n_y, flown.p_Kbar) == pytest.approx((n_z, n_y, p), abs=2e-3)


@pytest.mark.parametrize("stage", MODEL_BUILDERS)
@given(n_z=st.floats(-2.0, 6.0), n_y=st.floats(-0.1, 0.1))
def test_settled_model_stays_as_it_is(stage: str, n_z: float, n_y: float) -> None:
    wanted = commands(n_z, n_y)
    x = settled(stage, wanted)
    u = CONTROLLERS[stage].controls(x, wanted.join())
    rates = np.asarray(MODELS[stage].system.rates(x, u, MODELS[stage].parameter_values)).ravel()
    turning = ("alpha_K", "beta_K", "p_K", "p_s", "n_z", "n_y", "p_Kbar")
    inner = [row for row, one in enumerate(MODELS[stage].system.states) if one.name in turning]
    # what is left is the flight path itself, which turns and changes its speed
    assert np.abs(rates[inner]).max() < 0.15


@pytest.mark.parametrize("stage", MODEL_BUILDERS)
@pytest.mark.parametrize(("quantity", "size"), [("n_z", 0.5), ("n_z", -0.5), ("n_y", 0.05), ("p", 0.4), ("p", -0.4)])
def test_step_of_one_command_is_answered_and_moves_nothing_else(stage: str, quantity: str, size: float) -> None:
    before = {"n_z": 2.0, "n_y": 0.0, "p": 0.0}
    after = before | {quantity: before[quantity] + size}
    fly = closed_loop(MODELS[stage], CONTROLLERS[stage])
    wanted = commands(**after)
    states = fly(settled(stage, commands(**before), mu=0.0), [wanted] * 240)
    flown = [flown_factors(stage, x, wanted) for x in states.T[::4]]
    history = np.array([[one.n_z, one.n_y, one.p_Kbar] for one in flown])
    rows = {"n_z": 0, "n_y": 1, "p": 2}
    answered = (history[:, rows[quantity]] - before[quantity]) / size
    assert answered[-1] == pytest.approx(1.0, abs=0.05)
    assert answered.max() < 1.15
    others = {"n_z": 0.1, "n_y": 0.06, "p": 0.06}
    for name, row in rows.items():
        if name != quantity:
            assert np.abs(history[:, row] - before[name]).max() < others[name]


@pytest.mark.parametrize("stage", MODEL_BUILDERS)
@pytest.mark.parametrize("V_K", [55.0, 90.0])
def test_reversals_faster_than_the_controls_die_out(stage: str, V_K: float) -> None:
    fly = closed_loop(MODELS[stage], CONTROLLERS[stage])
    low, high = commands(-1.5), commands(3.0)
    start = settled(stage, low, V_K, mu=0.0)
    states = fly(start, [*([high] * 40), *([low] * 40), *([high] * 40), *([low] * 240)])
    flown = [flown_factors(stage, x, low) for x in states.T[::4]]
    assert max(abs(one.n_z) for one in flown) < 5.0
    assert flown[-1].n_z == pytest.approx(-1.5, abs=0.25)


@pytest.mark.parametrize("stage", MODEL_BUILDERS)
@given(
    n_z=st.floats(-20.0, 20.0),
    n_y=st.floats(-3.0, 3.0),
    p=st.floats(-20.0, 20.0),
    n_x=st.floats(-9.0, 9.0),
    V_K=st.floats(45.0, 110.0),
)
def test_controls_stay_within_their_bounds_whatever_is_commanded(
    stage: str, n_z: float, n_y: float, p: float, n_x: float, V_K: float
) -> None:
    x = settled(stage, commands(1.0), V_K)
    u = np.asarray(CONTROLLERS[stage].controls(x, commands(n_z, n_y, p, n_x).join())).ravel()
    for value, declared in zip(u, MODELS[stage].system.controls, strict=True):
        assert declared.lower <= value <= declared.upper


@pytest.mark.parametrize("stage", MODEL_BUILDERS)
@settings(max_examples=25)
@given(n_x=st.floats(-0.15, 0.05))
def test_lever_settles_where_the_load_factor_along_the_path_is_the_commanded_one(stage: str, n_x: float) -> None:
    fly = closed_loop(MODELS[stage], CONTROLLERS[stage])
    wanted = commands(1.0, n_x=n_x)
    x = fly(settled(stage, commands(1.0), gamma=0.0, mu=0.0), [wanted] * 500)[:, -1]
    assert 0.0 < x[row_of(stage, "delta_T")] < 1.0
    assert flown_factors(stage, x, wanted).n_x == pytest.approx(n_x, abs=0.01)


def test_every_model_with_an_inner_loop_has_an_inverse() -> None:
    assert {stage.value for stage in STAGES if fidelity_of(stage).inner_controller} == set(MODEL_BUILDERS)
