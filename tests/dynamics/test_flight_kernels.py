"""The compiled steps of the flight models have the derivatives of the whole graph."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from airrace.aircraft.aircraft import Aircraft
from airrace.dynamics.flight_model import FlightModel
from airrace.dynamics.point_mass import build_point_mass
from airrace.dynamics.six_dof import build_six_dof
from airrace.environment.air import Air, Profile, StaticWind, Thermal
from airrace.optimal_control.kernels import Kernel, build_kernels
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
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("AIRRACE_CACHE_DIR", str(tmp_path))
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
