"""The compiled steps of the flight models have the derivatives of the whole graph, in every lane, and their rates."""

import ctypes
from collections.abc import Callable

import numpy as np
import pytest
from kept import compile_quickly, keep_kernels
from same_bits import assert_same_bits

from airrace.aircraft.aircraft import Aircraft
from airrace.dynamics.flight_model import FlightModel
from airrace.dynamics.point_mass import build_point_mass
from airrace.dynamics.six_dof import build_six_dof
from airrace.dynamics.state_space import build_state_space
from airrace.dynamics.state_space_inversion import build_state_space_inversion
from airrace.dynamics.transfer_functions import build_transfer_functions
from airrace.environment.air import Air, Profile, StaticWind, Thermal
from airrace.optimal_control.compiled_rates import compiled_rows, interpreted
from airrace.optimal_control.kernels import Kernel, build_kernels, cached_rows
from airrace.optimal_control.lanes import SINGLE
from airrace.optimal_control.machine import machine as machine_of
from airrace.optimal_control.machine_kernels import machine_kernels
from airrace.optimal_control.runge_kutta import DORMAND_PRINCE_5
from airrace.track.course import Rules

WINDY = Air(wind=StaticWind(1.0, 5.0, Profile.POWER), thermals=(Thermal(0.0, 0.0, 2.0, 1000.0),))
CENTRES = {"z": -200.0, "V_K": 80.0, "q0": 0.8, "q1": 0.4, "q2": 0.3, "delta_T": 0.7, "n_z": 4.0}
SPREADS = {"x": 100.0, "y": 100.0, "z": 20.0, "V_K": 10.0, "delta_T": 0.1, "n_z": 2.0}


def outputs(kernel: Kernel, point: list[np.ndarray]) -> list[np.ndarray]:
    """Values, Jacobian, gradient and Hessian at (y, own, shared, lam)."""
    results = [kernel.value(*point[:3]), *kernel.jacobian(*point[:3]), *kernel.hessian(*point)]
    return [np.asarray(one.full()) for one in results]


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
def test_compiled_steps_have_the_derivatives_of_the_whole_graph(
    build: Callable[..., FlightModel],
    air: Air,
    counting: bool,
    edge540: Aircraft,
    rules: Rules,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    keep_kernels(monkeypatch)
    compile_quickly(monkeypatch)
    model = build(edge540, rules, air, counting=counting)
    compiled = build_kernels(model.system, DORMAND_PRINCE_5, compiled=True)
    if not compiled.compiled:
        pytest.skip("there is no C compiler")
    graph = build_kernels(model.system, DORMAND_PRINCE_5, compiled=False)
    for seed in range(3):
        point = flown(model, seed)
        for mine, theirs in zip(outputs(compiled.step, point), outputs(graph.step, point), strict=True):
            assert np.isfinite(theirs).all()
            assert np.abs(mine - theirs).max() <= 1e-12 * np.abs(theirs).max()
    for mine, theirs in ((compiled.step.jacobian, graph.step.jacobian), (compiled.step.hessian, graph.step.hessian)):
        assert set(zip(*mine.sparsity_out(1).get_triplet(), strict=True)) == set(
            zip(*theirs.sparsity_out(1).get_triplet(), strict=True)
        )


MODELS = [
    (build_point_mass, WINDY),
    pytest.param(build_transfer_functions, Air(), marks=pytest.mark.slow),
    (build_state_space_inversion, Air()),
    pytest.param(build_state_space, Air(), marks=pytest.mark.slow),
    (build_six_dof, WINDY),
]
OPTIMISED = (build_point_mass,)
"""Of these the bits are compared as they are compiled for flights; of the others as they are compiled quickly."""


EVERY = [
    pytest.param(build, air, marks=[] if air == Air() and build is build_six_dof else [pytest.mark.slow])
    for build in (
        *(build_point_mass, build_transfer_functions),
        *(build_state_space_inversion, build_state_space, build_six_dof),
    )
    for air in (Air(), WINDY)
]


@pytest.mark.parametrize(("build", "air"), EVERY)
def test_the_machine_has_the_bits_of_what_is_compiled(
    build: Callable[..., FlightModel], air: Air, edge540: Aircraft, rules: Rules, monkeypatch: pytest.MonkeyPatch
) -> None:
    keep_kernels(monkeypatch)
    machine_of.cache_clear()
    model = build(edge540, rules, air)
    interpreted = machine_kernels(model.system, DORMAND_PRINCE_5)
    if interpreted is None:
        pytest.skip("there is no C compiler, or none for several intervals at once")
    compile_quickly(monkeypatch)
    compiled = build_kernels(model.system, DORMAND_PRINCE_5, compiled=True)
    calls = 3
    y, own, p, lam = (one.T for one in columns(model, calls * compiled.step.lanes))
    shared = np.tile(p, calls)
    path_lam = np.random.default_rng(0).normal(size=(len(y), len(model.system.path)))
    for mine, theirs, given in (
        (interpreted.step, compiled.step, [y, own, shared, lam]),
        (interpreted.path, compiled.path, [y[:, :-1], np.zeros(0), shared, path_lam]),
    ):
        assert mine is not None
        assert theirs is not None
        assert_same_bits(mine, theirs, calls, given)


def columns(model: FlightModel, count: int) -> list[np.ndarray]:
    """Intervals of flight side by side: y, own, shared once, multipliers."""
    each = [flown(model, seed) for seed in range(count)]
    stacked = [np.stack(one, axis=1) for one in zip(*each, strict=True)]
    return [stacked[0], stacked[1], model.parameter_values, stacked[3]]


@pytest.mark.parametrize(("build", "air"), MODELS)
def test_lanes_and_compiled_rates_have_the_bits_of_single_numbers(
    build: Callable[..., FlightModel],
    air: Air,
    edge540: Aircraft,
    rules: Rules,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    keep_kernels(monkeypatch)
    if build not in OPTIMISED:
        compile_quickly(monkeypatch)
    model = build(edge540, rules, air)
    system = model.system
    lanes = build_kernels(system, DORMAND_PRINCE_5, compiled=True)
    library = cached_rows(system, DORMAND_PRINCE_5)
    if library is None:
        pytest.skip("there is no C compiler, or none for several intervals at once")
    single = build_kernels(system, DORMAND_PRINCE_5, compiled=True, instructions=SINGLE)
    assert lanes.path is not None
    assert single.path is not None
    y, own, p, lam = columns(model, lanes.step.lanes)
    path_lam = np.random.default_rng(0).normal(size=(len(system.path), lanes.step.lanes))
    nothing = np.zeros((0, lanes.step.lanes))
    for mine, theirs, given in (
        (lanes.step, single.step, [y, own, p, lam]),
        (lanes.path, single.path, [y[:-1], nothing, p, path_lam]),
    ):
        assert mine.several is not None
        found = outputs(mine.several, given)
        for lane in range(mine.lanes):
            point = [given[0][:, lane], given[1][:, lane], p, given[3][:, lane]]
            for several, one in zip(found, outputs(theirs, point), strict=True):
                width = one.shape[1]
                assert np.isfinite(one).all()
                assert np.array_equal(several[:, lane * width : (lane + 1) * width], one)
    n_x = len(system.states)
    for name, function in (("rates", system.rates), ("path", system.path_values)):
        assert function is not None
        compiled = compiled_rows(ctypes.CDLL(str(library)), name, function.size1_out(0), y[n_x:-1], p)(y[:n_x])
        assert np.array_equal(compiled, interpreted(function, y[n_x:-1], p)(y[:n_x]))
        assert np.array_equal(compiled, np.asarray(function(y[:n_x], y[n_x:-1], p)))
