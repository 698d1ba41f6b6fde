"""The models with an inner loop as systems that are optimised: compiled, bounded, differentiable, named."""

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import pytest
from bodies import (
    COMMANDS_HELD,
    STICK_FREE,
    as_state_space,
    as_state_space_inversion,
    as_transfer_functions,
    bodies,
    evaluated,
    fly_six_dof,
    fly_state_space,
    fly_state_space_inversion,
    fly_transfer_functions,
    level_trim,
    with_airframe,
)
from hypothesis import given, settings

from airrace.aircraft.aircraft import Aircraft
from airrace.dynamics.flight_model import FlightModel
from airrace.dynamics.point_mass import build_point_mass
from airrace.dynamics.six_dof import SixDofState, build_six_dof
from airrace.dynamics.state_space import build_state_space
from airrace.dynamics.state_space_inversion import build_state_space_inversion
from airrace.dynamics.transfer_functions import build_transfer_functions
from airrace.environment.air import Air, Profile, StaticWind, Thermal
from airrace.errors import InputError
from airrace.quantities import Interval
from airrace.system import System
from airrace.track.course import Rules

GUSTY = Air(wind=StaticWind(0.4, 8.0, Profile.POWER), thermals=(Thermal(30.0, 0.0, 2.5, 1400.0),))
DEGREE = math.pi / 180.0


@dataclass(frozen=True)
class Kind:
    """One of the models: how it is built, flown, and fed with some state of the whole aircraft."""

    name: str
    build: Callable[..., FlightModel]
    fly: Callable[..., Any]
    state: Callable[[SixDofState[float]], Any]
    control: Any
    roll_rate: str


KINDS = (
    Kind(
        "transfer-function",
        build_transfer_functions,
        fly_transfer_functions,
        as_transfer_functions,
        COMMANDS_HELD,
        "p_Kbar",
    ),
    Kind(
        "state-space-inversion",
        build_state_space_inversion,
        fly_state_space_inversion,
        as_state_space_inversion,
        COMMANDS_HELD,
        "p_s",
    ),
    Kind("state-space", build_state_space, fly_state_space, as_state_space, STICK_FREE, "p_s"),
    Kind("six-dof", build_six_dof, fly_six_dof, lambda state: state, STICK_FREE, "p_Kbar"),
)
every_model = pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
FLIGHT_PATH = ("x", "y", "z", "V_K", "q0", "q1", "q2", "q3", "delta_T")


def bounds(model: FlightModel) -> dict[str, tuple[float, float]]:
    system = model.system
    return {one.name: (one.lower, one.upper) for one in (*system.states, *system.controls, *system.path)}


@every_model
@settings(max_examples=20)
@given(some=bodies)
def test_compiled_system_equals_the_plain_equations(
    edge540: Aircraft, rules: Rules, kind: Kind, some: SixDofState[float]
) -> None:
    state = kind.state(some)
    rate, path = kind.fly(edge540, GUSTY, state)
    rates, values = evaluated(kind.build(edge540, rules, GUSTY), state, kind.control)
    assert rates == pytest.approx(np.array(rate.join()), rel=1e-9, abs=1e-9)
    assert values == pytest.approx(np.array(path.join()), rel=1e-9, abs=1e-9)


@every_model
@settings(max_examples=10)
@given(some=bodies)
def test_derivatives_agree_with_finite_differences(
    edge540: Aircraft, rules: Rules, kind: Kind, some: SixDofState[float]
) -> None:
    model, state = kind.build(edge540, rules, GUSTY), kind.state(some)
    exact = jacobian(model)(state.join(), kind.control.join(), model.parameter_values)
    for number, declared in enumerate(model.system.states):
        step = 1e-6 * declared.scale
        ahead, behind = (
            np.concatenate(
                evaluated(
                    model,
                    dataclasses.replace(state, **{declared.name: getattr(state, declared.name) + sign * step}),
                    kind.control,
                )
            )
            for sign in (1.0, -1.0)
        )
        assert (ahead - behind) / (2.0 * step) == pytest.approx(np.array(exact)[:, number], rel=1e-5, abs=1e-3)


def jacobian(model: FlightModel) -> ca.Function:
    """Of rates and path values with respect to the state."""
    system = model.system
    assert system.path_values is not None
    x, u, p = (ca.SX.sym(name, system.rates.size1_in(i)) for i, name in enumerate("xup"))
    everything = ca.vertcat(system.rates(x, u, p), system.path_values(x, u, p))
    return ca.Function("J", [x, u, p], [ca.jacobian(everything, x)])


@every_model
@pytest.mark.parametrize("air", [Air(), GUSTY], ids=["still", "gusty"])
@pytest.mark.parametrize("angle", [0.0, 14.0, -14.0])
def test_second_derivatives_are_finite_in_symmetric_flight_and_at_the_limits(
    edge540: Aircraft, rules: Rules, kind: Kind, air: Air, angle: float
) -> None:
    model = kind.build(edge540, rules, air)
    some = dataclasses.replace(level_trim(edge540, 80.0), alpha_K=angle * DEGREE, beta_K=angle * DEGREE, xi=0.0)
    assert model.system.path_values is not None
    x, u, p = (ca.SX.sym(name, model.system.rates.size1_in(i)) for i, name in enumerate("xup"))
    total = ca.sum1(model.system.rates(x, u, p)) + ca.sum1(model.system.path_values(x, u, p))
    H = ca.Function("H", [x, u, p], [ca.hessian(total, x)[0]])
    values = np.array(H(kind.state(some).join(), kind.control.join(), model.parameter_values))
    assert np.all(np.isfinite(values))


@every_model
def test_model_is_named_and_compiled_by_its_structure_alone(edge540: Aircraft, rules: Rules, kind: Kind) -> None:
    one = kind.build(edge540, rules, GUSTY)
    other = kind.build(with_airframe(edge540, m=800.0, I_xz=50.0), Rules(n_z=rules.n_z), GUSTY)
    assert one.system.name == other.system.name == f"{kind.name}+wind(power)+thermals(1)"
    assert kind.build(edge540, rules, Air(), counting=True).system.name == f"{kind.name}+rolls"
    assert one.system.parameters == other.system.parameters
    assert one.system.rates.serialize() == other.system.rates.serialize()
    assert not np.array_equal(one.parameter_values, other.parameter_values)
    assert one.parameter_values.shape == (len(one.system.parameters),)


@every_model
def test_every_model_carries_the_flight_path_first(edge540: Aircraft, rules: Rules, kind: Kind) -> None:
    system = kind.build(edge540, rules, Air()).system
    assert tuple(one.name for one in system.states[:9]) == FLIGHT_PATH
    assert system.controls[3].name == "delta_T_cmd"


@every_model
@settings(max_examples=5)
@given(some=bodies)
def test_rolls_are_counted_by_the_roll_rate_about_the_velocity(
    edge540: Aircraft, rules: Rules, kind: Kind, some: SixDofState[float]
) -> None:
    state = kind.state(some)
    rate, path = kind.fly(edge540, GUSTY, state)
    p_Kbar = (vars(state) | vars(path))[kind.roll_rate]
    system = kind.build(edge540, rules, GUSTY, counting=True)
    x, u = [*state.join(), 0.7, 20.0], [*kind.control.join(), 0.25, -3.0]
    rates = np.array(system.system.rates(x, u, system.parameter_values)).ravel()
    assert rates[-2:] == pytest.approx([p_Kbar + 0.25, -rate.z - 3.0], rel=1e-9, abs=1e-9)


@every_model
def test_limits_common_to_all_become_bounds(edge540: Aircraft, rules: Rules, kind: Kind) -> None:
    found = bounds(kind.build(edge540, rules, Air()))
    assert found["z"] == (-300.0, -5.0)
    assert found["V_K"] == (35.0, 118.0)
    assert found["n_z"] == (-4.0, 10.0)
    assert found["n_y"] == (-1.0, 1.0)
    assert found[kind.roll_rate] == (-6.0, 6.0)
    assert found["C_L"] == (-1.4, 1.4)
    assert found["beta_A"] == pytest.approx((-12.0 * DEGREE, 12.0 * DEGREE))
    assert found["delta_T"] == found["delta_T_cmd"] == (0.0, 1.0)


@every_model
def test_what_moves_the_aircraft_is_bounded_by_stick_or_surfaces(edge540: Aircraft, rules: Rules, kind: Kind) -> None:
    found = bounds(kind.build(edge540, rules, Air()))
    if kind.control is STICK_FREE:
        assert {found[name] for name in ("eta_dot", "xi_dot", "zeta_dot")} == {(-120.0 * DEGREE, 120.0 * DEGREE)}
    else:
        assert [found[f"{name}_dot"] for name in ("n_z_cmd", "n_y_cmd", "p_cmd")] == [
            (-40.0, 40.0),
            (-10.0, 10.0),
            (-40.0, 40.0),
        ]
        assert (found["n_z_cmd"], found["n_y_cmd"]) == ((-10.0, 12.0), (-1.0, 1.0))
        assert found["p_cmd"] == pytest.approx((-420.0 * DEGREE, 420.0 * DEGREE))
    if "n_z_dot" in found:
        assert (found["n_z_dot"], found["n_y_dot"]) == ((-40.0, 40.0), (-10.0, 10.0))
    if "eta" in found:
        assert found["xi"] == pytest.approx((-25.0 * DEGREE, 25.0 * DEGREE))
        assert found["zeta"] == pytest.approx((-30.0 * DEGREE, 30.0 * DEGREE))


@pytest.mark.parametrize("kind", KINDS[1:], ids=lambda kind: kind.name)
def test_angle_of_attack_ends_with_the_lift_curve_or_the_rules(edge540: Aircraft, rules: Rules, kind: Kind) -> None:
    stall = 1.4 / 4.8
    assert bounds(kind.build(edge540, rules, Air()))["alpha_A"] == pytest.approx((-stall, stall))
    strict = dataclasses.replace(rules, alpha_A=Interval(-0.1, 0.2))
    assert bounds(kind.build(edge540, strict, Air()))["alpha_A"] == (-0.1, 0.2)


@pytest.mark.parametrize("kind", KINDS[1:], ids=lambda kind: kind.name)
def test_rules_that_ask_for_a_stall_are_refused(edge540: Aircraft, rules: Rules, kind: Kind) -> None:
    with pytest.raises(InputError, match="alpha_A"):
        kind.build(edge540, dataclasses.replace(rules, alpha_A=Interval(0.35, 0.5)), Air())


@every_model
def test_what_is_declared_as_a_rate_is_one(edge540: Aircraft, rules: Rules, kind: Kind) -> None:
    assert_rates_are_declared(kind.build(edge540, rules, GUSTY, counting=True).system)


def test_what_the_point_mass_declares_as_a_rate_is_one(edge540: Aircraft, rules: Rules) -> None:
    assert_rates_are_declared(build_point_mass(edge540, rules, GUSTY, counting=True).system)


def assert_rates_are_declared(system: System) -> None:
    """A quantity is declared as the rate of a state exactly where that state's equation reads `x' = u`."""
    symbols = (("x", system.states), ("u", system.controls), ("p", system.parameters))
    x, u, p = (ca.SX.sym(name, len(of)) for name, of in symbols)
    rates, moving = system.rates(x, u, p), ca.vertcat(x, u)
    declared = (*system.states, *system.controls)
    found = {
        declared[column].name: system.states[row].name
        for row in range(len(system.states))
        for column in range(len(declared))
        if ca.is_equal(rates[row], moving[column], 1)
    }
    assert found == {one.name: one.rate_of for one in declared if one.rate_of}
