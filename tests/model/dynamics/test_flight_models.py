"""What holds of all flight models alike: their systems, derivatives, bounds, names, mirror images and counters."""

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
    Array,
    as_point_mass,
    as_state_space,
    as_state_space_inversion,
    as_transfer_functions,
    bodies,
    evaluated,
    fly_point_mass,
    fly_six_dof,
    fly_state_space,
    fly_state_space_inversion,
    fly_transfer_functions,
    level_trim,
    mirrored,
    with_airframe,
)
from flights import HOLD, mirrored_air, windy_airs
from hypothesis import given, settings

from airrace.errors import InputError
from airrace.model.aircraft import Aircraft
from airrace.model.dynamics.flight_model import FlightModel
from airrace.model.dynamics.point_mass import build_point_mass
from airrace.model.dynamics.six_dof import SixDofState, build_six_dof
from airrace.model.dynamics.state_space import build_state_space
from airrace.model.dynamics.state_space_inversion import build_state_space_inversion
from airrace.model.dynamics.transfer_functions import build_transfer_functions
from airrace.model.environment import Air, Profile, StaticWind, Thermal
from airrace.model.track.course import Rules
from airrace.optimal_control.quantities import Interval

GUSTY = Air(wind=StaticWind(0.4, 8.0, Profile.POWER), thermals=(Thermal(30.0, 0.0, 2.5, 1400.0),))
DEGREE = math.pi / 180.0
FLIGHT_PATH = ("x", "y", "z", "V_K", "q0", "q1", "q2", "q3", "delta_T")


@dataclass(frozen=True)
class Kind:
    """One of the models: how it is built, flown, and fed with some state of the whole aircraft."""

    name: str
    build: Callable[..., FlightModel]
    fly: Callable[..., Any]
    state: Callable[[SixDofState[float]], Any]
    control: Any
    roll_rate: str = "p_Kbar"


KINDS = (
    Kind("point-mass", build_point_mass, fly_point_mass, as_point_mass, HOLD),
    Kind("transfer-function", build_transfer_functions, fly_transfer_functions, as_transfer_functions, COMMANDS_HELD),
    Kind(
        "state-space-inversion",
        build_state_space_inversion,
        fly_state_space_inversion,
        as_state_space_inversion,
        COMMANDS_HELD,
        "p_s",
    ),
    Kind("state-space", build_state_space, fly_state_space, as_state_space, STICK_FREE, "p_s"),
    Kind("six-dof", build_six_dof, fly_six_dof, lambda state: state, STICK_FREE),
)
every_model = pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
models_with_angles = pytest.mark.parametrize("kind", KINDS[2:], ids=lambda kind: kind.name)


def bounds(model: FlightModel) -> dict[str, tuple[float, float]]:
    system = model.system
    return {one.name: (one.lower, one.upper) for one in (*system.states, *system.controls, *system.path)}


def symbols(model: FlightModel) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """State, control, parameters, and rates and path values of them."""
    system = model.system
    assert system.path_values is not None
    x, u, p = (ca.SX.sym(name, system.rates.size1_in(i)) for i, name in enumerate("xup"))
    return x, u, p, ca.vertcat(system.rates(x, u, p), system.path_values(x, u, p))


@every_model
@settings(max_examples=10)
@given(some=bodies)
def test_compiled_system_equals_the_plain_equations_and_its_derivatives_finite_differences(
    edge540: Aircraft, rules: Rules, kind: Kind, some: SixDofState[float]
) -> None:
    model, state = kind.build(edge540, rules, GUSTY), kind.state(some)
    rate, path = kind.fly(edge540, GUSTY, state)
    rates, values = evaluated(model, state, kind.control)
    assert rates == pytest.approx(np.array(rate.join()), rel=1e-9, abs=1e-9)
    assert values == pytest.approx(np.array(path.join()), rel=1e-9, abs=1e-9)
    x, u, p, everything = symbols(model)
    jacobian = ca.Function("J", [x, u, p], [ca.jacobian(everything, x)])
    exact = np.array(jacobian(state.join(), kind.control.join(), model.parameter_values))

    def moved(name: str, by: float) -> Array:
        there = dataclasses.replace(state, **{name: getattr(state, name) + by})
        return np.concatenate(evaluated(model, there, kind.control))

    for number, declared in enumerate(model.system.states):
        step = 1e-6 * declared.scale
        slope = (moved(declared.name, step) - moved(declared.name, -step)) / (2.0 * step)
        assert slope == pytest.approx(exact[:, number], rel=1e-5, abs=1e-3)


@every_model
@pytest.mark.parametrize("air", [Air(), GUSTY], ids=["still", "gusty"])
def test_second_derivatives_are_finite_in_symmetric_flight_at_the_limits_and_at_the_ground(
    edge540: Aircraft, rules: Rules, kind: Kind, air: Air
) -> None:
    model, trim = kind.build(edge540, rules, air), level_trim(edge540, 80.0)
    x, u, p, everything = symbols(model)
    H = ca.Function("H", [x, u, p], [ca.hessian(ca.sum1(everything), x)[0]])
    for angle in (0.0, 14.0 * DEGREE, -14.0 * DEGREE):
        for place in ({"z": -50.0}, {"x": 30.0, "z": -100.0}, {"x": 30.0, "z": 0.0}, {"x": 30.0, "z": 50.0}):
            some = dataclasses.replace(trim, alpha_K=angle, beta_K=angle, xi=0.0, **place)
            values = H(kind.state(some).join(), kind.control.join(), model.parameter_values)
            assert np.all(np.isfinite(np.array(values)))


@every_model
def test_model_is_named_and_compiled_by_its_structure_alone(edge540: Aircraft, rules: Rules, kind: Kind) -> None:
    one = kind.build(edge540, rules, GUSTY)
    calmer = dataclasses.replace(GUSTY, wind=StaticWind(2.0, 1.0, Profile.POWER), temperature_offset=20.0)
    other = kind.build(with_airframe(edge540, m=800.0, I_xz=50.0), Rules(n_z=rules.n_z), calmer)
    still, counting = kind.build(edge540, rules, Air()), kind.build(edge540, rules, Air(), counting=True)
    assert one.system.name == other.system.name == f"{kind.name}+wind(power)+thermals(1)"
    assert (still.system.name, counting.system.name) == (kind.name, f"{kind.name}+rolls")
    assert one.system.parameters == other.system.parameters
    assert one.system.rates is other.system.rates
    assert len({id(model.system.rates) for model in (one, still, counting)}) == 3
    assert not np.array_equal(one.parameter_values, other.parameter_values)
    assert one.parameter_values.shape == (len(one.system.parameters),)
    assert tuple(state.name for state in one.system.states[:9]) == FLIGHT_PATH
    assert one.system.controls[3].name == "delta_T_cmd"


@every_model
@settings(max_examples=5)
@given(some=bodies)
def test_rolls_are_counted_by_the_roll_rate_about_the_velocity_and_change_no_flight(
    edge540: Aircraft, rules: Rules, kind: Kind, some: SixDofState[float]
) -> None:
    state = kind.state(some)
    rate, path = kind.fly(edge540, GUSTY, state)
    p_Kbar = (vars(state) | vars(path))[kind.roll_rate]
    model, plain = (kind.build(edge540, rules, GUSTY, counting=counting) for counting in (True, False))
    x, u = [*state.join(), 0.7, 20.0], [*kind.control.join(), 0.25, -3.0]
    rates = np.array(model.system.rates(x, u, model.parameter_values)).ravel()
    assert rates[-2:] == pytest.approx([p_Kbar + 0.25, -rate.z - 3.0], rel=1e-9, abs=1e-9)
    assert rates[:-2] == pytest.approx(evaluated(plain, state, kind.control)[0], rel=1e-13, abs=1e-13)


@every_model
def test_limits_of_aircraft_and_rules_become_bounds(edge540: Aircraft, rules: Rules, kind: Kind) -> None:
    found = bounds(kind.build(edge540, rules, Air()))
    assert found["z"] == (-300.0, -5.0)
    assert found["V_K"] == (35.0, 118.0)
    assert found["n_z"] == (-4.0, 10.0)
    assert found["n_y"] == (-1.0, 1.0)
    assert found[kind.roll_rate] == (-6.0, 6.0)
    assert found["C_L"] == (-1.4, 1.4)
    assert found["beta_A"] == pytest.approx((-12.0 * DEGREE, 12.0 * DEGREE))
    assert found["delta_T"] == found["delta_T_cmd"] == (0.0, 1.0)
    assert found["q0"] == found["x"] == (-math.inf, math.inf)
    if kind.control is STICK_FREE:
        assert {found[name] for name in ("eta_dot", "xi_dot", "zeta_dot")} == {(-120.0 * DEGREE, 120.0 * DEGREE)}
    elif kind.control is COMMANDS_HELD:
        rates = [found[f"{name}_dot"] for name in ("n_z_cmd", "n_y_cmd", "p_cmd")]
        assert rates == [(-40.0, 40.0), (-10.0, 10.0), (-40.0, 40.0)]
        assert (found["n_z_cmd"], found["n_y_cmd"]) == ((-10.0, 12.0), (-1.0, 1.0))
        assert found["p_cmd"] == pytest.approx((-420.0 * DEGREE, 420.0 * DEGREE))
    else:
        assert found["p_Kbar_dot"] == (-40.0, 40.0)
    if "n_z_dot" in found:
        assert (found["n_z_dot"], found["n_y_dot"]) == ((-40.0, 40.0), (-10.0, 10.0))
    if "eta" in found:
        assert found["xi"] == pytest.approx((-25.0 * DEGREE, 25.0 * DEGREE))
        assert found["zeta"] == pytest.approx((-30.0 * DEGREE, 30.0 * DEGREE))


@models_with_angles
def test_angle_of_attack_ends_with_the_lift_curve_or_the_rules(edge540: Aircraft, rules: Rules, kind: Kind) -> None:
    stall = 1.4 / 4.8
    assert bounds(kind.build(edge540, rules, Air()))["alpha_A"] == pytest.approx((-stall, stall))
    strict, stalling = (dataclasses.replace(rules, alpha_A=Interval(*ends)) for ends in ((-0.1, 0.2), (0.35, 0.5)))
    assert bounds(kind.build(edge540, strict, Air()))["alpha_A"] == (-0.1, 0.2)
    with pytest.raises(InputError, match=r"rules\.alpha_min_deg"):
        kind.build(edge540, stalling, Air())


@every_model
def test_a_quantity_is_declared_as_a_rate_exactly_where_the_equation_says_so(
    edge540: Aircraft, rules: Rules, kind: Kind
) -> None:
    system = kind.build(edge540, rules, GUSTY, counting=True).system
    x, u, p = (ca.SX.sym(name, system.rates.size1_in(i)) for i, name in enumerate("xup"))
    rates, moving = system.rates(x, u, p), ca.vertcat(x, u)
    declared = (*system.states, *system.controls)
    found = {
        declared[column].name: system.states[row].name
        for row in range(len(system.states))
        for column in range(len(declared))
        if ca.is_equal(rates[row], moving[column], 1)
    }
    assert found == {one.name: one.rate_of for one in declared if one.rate_of}


@every_model
@settings(max_examples=40)
@given(some=bodies, air=windy_airs)
def test_a_mirrored_aircraft_in_mirrored_wind_has_mirrored_rates_and_no_wind_is_still_air(
    edge540: Aircraft, kind: Kind, some: SixDofState[float], air: Air
) -> None:
    state = kind.state(some)
    rate, path = kind.fly(edge540, air, state)
    other_rate, other_path = kind.fly(edge540, mirrored_air(air), mirrored(state))
    assert list(other_rate.join()) == pytest.approx(list(mirrored(rate).join()), rel=1e-8, abs=1e-8)
    assert list(other_path.join()) == pytest.approx(list(mirrored(path).join()), rel=1e-8, abs=1e-8)
    still, calm = (kind.fly(edge540, one, state) for one in (Air(), Air(wind=StaticWind(0.3, 0.0))))
    for one, other in zip(still, calm, strict=True):
        assert list(one.join()) == pytest.approx(list(other.join()), rel=1e-9, abs=1e-9)
