"""The native steps of the flight models have the derivatives of the whole graph, and the same bits in all variants."""

from collections.abc import Callable

import numpy as np
import pytest
from kernel_results import all_results, assert_bitwise_equal, variants

from airrace.aircraft.aircraft import Aircraft
from airrace.dynamics.flight_model import FlightModel
from airrace.dynamics.point_mass import build_point_mass
from airrace.dynamics.six_dof import build_six_dof
from airrace.dynamics.state_space import build_state_space
from airrace.dynamics.state_space_inversion import build_state_space_inversion
from airrace.dynamics.transfer_functions import build_transfer_functions
from airrace.environment.air import Air, Profile, StaticWind, Thermal
from airrace.native.interpreter import Interpreter
from airrace.optimal_control.kernels import NativeKernel, build_kernels, casadi_kernels, native_kernels
from airrace.optimal_control.replay import casadi_function_at_points
from airrace.optimal_control.runge_kutta import DORMAND_PRINCE_5
from airrace.points import dense
from airrace.track.course import Rules

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
    for mine, theirs in zip(all_results(composed, given), all_results(graph, given), strict=True):
        assert np.isfinite(theirs).all()
        scale = np.abs(theirs).max(axis=1, keepdims=True)
        assert (np.abs(mine - theirs) <= 1e-12 * scale).all()
    for mine, theirs in (
        (composed.jacobian_pattern, graph.jacobian_pattern),
        (composed.hessian_pattern, graph.hessian_pattern),
    ):
        assert set(zip(*mine.get_triplet(), strict=True)) == set(zip(*theirs.get_triplet(), strict=True))


EVERY = [
    pytest.param(build, air, marks=[] if air == WINDY and build is build_six_dof else [pytest.mark.slow])
    for build in (
        *(build_point_mass, build_transfer_functions),
        *(build_state_space_inversion, build_state_space, build_six_dof),
    )
    for air in (Air(), WINDY)
]


@pytest.mark.parametrize(("build", "air"), EVERY)
def test_all_variants_have_the_same_bits_and_rates_those_of_casadi(
    build: Callable[..., FlightModel], air: Air, edge540: Aircraft, rules: Rules
) -> None:
    model = build(edge540, rules, air)
    system, n_x, count = model.system, len(model.system.states), 16
    given = intervals(model, count)
    y, _, p, _ = given
    path_lam = np.random.default_rng(0).normal(size=(count, len(system.path)))
    found: list[list[np.ndarray]] = []
    for library in variants().values():
        native = Interpreter(library)
        kernels = native_kernels(native, system, DORMAND_PRINCE_5)
        assert kernels.path is not None
        path_given = [y[:, :-1], np.zeros((count, 0)), p, path_lam]
        found.append([*all_results(kernels.step, given), *all_results(kernels.path, path_given)])
        for function in (system.rates, system.path_values):
            assert function is not None
            x, u = y[:, :n_x].T, y[:, n_x:-1].T
            assert_bitwise_equal(
                [native.at_points(dense(function), u, p)(x)], [casadi_function_at_points(function, u, p)(x)]
            )
    for one in found[1:]:
        assert_bitwise_equal(one, found[0])


def intervals(model: FlightModel, count: int) -> list[np.ndarray]:
    """Intervals of flight: y, own, shared once, multipliers."""
    each = [flown(model, seed) for seed in range(count)]
    y, own, _, lam = (np.stack(one) for one in zip(*each, strict=True))
    return [y, own, np.asarray(model.parameter_values), lam]
