"""A settled inner loop: what it asks, what it leaves free, the same of every model and in any wind."""

from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest
from bodies import ODD, level_trim
from numpy.typing import NDArray

from airrace.model.aircraft import Aircraft
from airrace.model.dynamics.flight_model import FlightModel
from airrace.model.dynamics.observations import settled_observation
from airrace.model.dynamics.outer_loop import FlightPathState
from airrace.model.dynamics.point_mass import build_point_mass
from airrace.model.dynamics.six_dof import build_six_dof
from airrace.model.dynamics.state_space import build_state_space
from airrace.model.dynamics.state_space_inversion import build_state_space_inversion
from airrace.model.dynamics.transfer_functions import build_transfer_functions
from airrace.model.environment import Air, Profile, StaticWind, Thermal
from airrace.model.frames import quaternion
from airrace.model.track.course import Rules
from airrace.optimal_control.replay import integrate

Array = NDArray[np.float64]
Build = Callable[..., FlightModel]
BUILDERS = (
    build_point_mass,
    build_transfer_functions,
    build_state_space_inversion,
    build_state_space,
    build_six_dof,
)
CALM = Air()
GUSTY = Air(wind=StaticWind(0.4, 8.0, Profile.POWER), thermals=(Thermal(30.0, 0.0, 2.5, 1400.0),))
OUTER = {*FlightPathState.names(), "delta_T"}
ROLL_RATES = {"p_Kbar", "p_s", "p_K"}
every_model = pytest.mark.parametrize("build", BUILDERS, ids=lambda build: build.__name__.removeprefix("build_"))
every_air = pytest.mark.parametrize("air", [CALM, GUSTY], ids=["calm", "gusty"])


def flight_path(*, bank: float = 0.7, climb: float = 0.2) -> dict[str, float]:
    attitude = dict(zip(("q0", "q1", "q2", "q3"), quaternion(0.5, climb, bank), strict=True))
    return {"x": 40.0, "y": -30.0, "z": -60.0, "V_K": 85.0, "delta_T": 0.8} | attitude


def seen(model: FlightModel, x: Array) -> Array:
    """What is zero in a settled flight."""
    return np.asarray(settled_observation(model).values(x, model.parameter_values)).ravel()


def inner(model: FlightModel) -> list[int]:
    """Places of the states of the inner loop."""
    return [row for row, one in enumerate(model.system.states) if one.name not in OUTER]


def slopes_of(model: FlightModel) -> Callable[[Array], Array]:
    """Scaled derivatives of what is zero in a settled flight by the states of the inner loop, at a state."""
    observation = settled_observation(model)
    derivative, nothing = observation.values.jacobian(), ca.DM.zeros(len(observation.quantities))
    scale = np.array([one.scale for one in model.system.states])
    return lambda x: (np.asarray(derivative(x, model.parameter_values, nothing)[0]) * scale)[:, inner(model)]


def settled_state(model: FlightModel, path: dict[str, float], *, n_z: float, p: float) -> Array:
    """The settled state next to a load factor (g) and a roll rate (rad/s) on the flight path, by Newton's method."""
    start = {"n_z": n_z, "n_z_cmd": n_z, "alpha_K": 0.02 * n_z, "p_cmd": p} | dict.fromkeys(ROLL_RATES, p)
    x = np.array([(path | start).get(one.name, 0.0) for one in model.system.states])
    scale = np.array([one.scale for one in model.system.states])[inner(model)]
    slopes, values = slopes_of(model), settled_observation(model).values
    for _ in range(20):
        missing = -np.asarray(values(x, model.parameter_values)).ravel()
        x[inner(model)] += scale * np.linalg.lstsq(slopes(x), missing, rcond=None)[0]
    return x


def rates(model: FlightModel, x: Array) -> dict[str, float]:
    """Of all states, with controls at zero."""
    controls = np.zeros(len(model.system.controls))
    values = np.asarray(model.system.rates(x, controls, model.parameter_values)).ravel()
    return dict(zip([one.name for one in model.system.states], values.tolist(), strict=True))


@every_air
@every_model
def test_settled_state_stands_still_but_for_the_flight_path(
    edge540: Aircraft, rules: Rules, build: Build, air: Air
) -> None:
    model = build(edge540, rules, air)
    x = settled_state(model, flight_path(), n_z=4.0, p=2.0)
    assert seen(model, x) == pytest.approx(0.0, abs=1e-9)
    moving = {name for name, rate in rates(model, x).items() if abs(rate) > 1e-6}
    assert moving <= OUTER
    assert {"x", "y", "z", "q1"} <= moving


@every_air
@every_model
def test_flown_with_controls_at_rest_the_inner_loop_leaves_a_settled_state_only_in_second_order(
    edge540: Aircraft, rules: Rules, build: Build, air: Air
) -> None:
    model = build(edge540, rules, air)
    x = settled_state(model, flight_path(), n_z=4.0, p=2.0)
    controls = np.zeros(len(model.system.controls))

    def flow(_: float, state: Array) -> Array:
        return np.asarray(model.system.rates(state, controls, model.parameter_values)).ravel()

    short = np.array([0.0, 1e-4, 2e-4])
    flown = integrate(flow, x, short, relative=1e-12, absolute=1e-12)[inner(model)]
    once, twice = np.abs(flown[:, 1:] - flown[:, :1]).T
    assert twice == pytest.approx(4.0 * once, rel=0.2, abs=1e-9)
    assert twice.max() < 1e-4


@every_air
@every_model
def test_load_factor_and_roll_rate_alone_are_left_free(edge540: Aircraft, rules: Rules, build: Build, air: Air) -> None:
    model = build(edge540, rules, air)
    x = settled_state(model, flight_path(), n_z=4.0, p=2.0)
    slopes = slopes_of(model)(x)
    values = np.linalg.svd(slopes)[1]
    assert len(slopes) == len(inner(model)) - 2
    assert values.min() > 1e-3 * values.max()


@pytest.mark.parametrize("rolling", [-3.0, 0.0, 3.0])
@pytest.mark.parametrize("build", [build_transfer_functions, build_state_space_inversion])
def test_commands_are_what_they_command(edge540: Aircraft, rules: Rules, build: Build, rolling: float) -> None:
    model = build(edge540, rules, CALM)
    x = dict(
        zip(
            [one.name for one in model.system.states],
            settled_state(model, flight_path(), n_z=5.0, p=rolling),
            strict=True,
        )
    )
    assert x["p_cmd"] == pytest.approx(x.get("p_Kbar", x.get("p_s")), abs=1e-9)
    if "n_z" in x:
        assert (x["n_z_cmd"], x["n_y_cmd"]) == pytest.approx((x["n_z"], 0.0), abs=1e-9)


def test_trim_of_the_whole_aircraft_is_settled(edge540: Aircraft, rules: Rules) -> None:
    trim = level_trim(edge540, 80.0)
    model = build_six_dof(edge540, rules, CALM)
    assert seen(model, np.array(trim.join())) == pytest.approx(0.0, abs=1e-8)


@every_model
def test_slipping_aircraft_is_not_settled(edge540: Aircraft, rules: Rules, build: Build) -> None:
    model = build(edge540, rules, CALM)
    x = settled_state(model, flight_path(), n_z=4.0, p=2.0)
    names = [one.name for one in model.system.states]
    x[names.index("n_y" if "n_y" in names else "beta_K")] += 0.01
    assert abs(seen(model, x)[0]) > 0.01


@every_model
def test_settled_state_in_a_mirror_is_settled(edge540: Aircraft, rules: Rules, build: Build) -> None:
    breeze = Air(wind=StaticWind(0.4, 8.0))
    reflected = Air(wind=StaticWind(-0.4, 8.0))
    model, image = build(edge540, rules, breeze), build(edge540, rules, reflected)
    x = settled_state(model, flight_path(), n_z=4.0, p=2.0)
    signs = np.array([-1.0 if one.name in ODD else 1.0 for one in model.system.states])
    assert seen(image, signs * x) == pytest.approx(0.0, abs=1e-9)


@every_air
@every_model
def test_limits_along_the_path_hold_at_the_last_node_for_they_depend_on_states_alone(
    edge540: Aircraft, rules: Rules, build: Build, air: Air
) -> None:
    values = build(edge540, rules, air).system.path_values
    assert values is not None
    assert values.jac_sparsity(0, 1).nnz() == 0
