"""Composed of the stages' derivatives or taken from the graph of the whole step, a step has the same derivatives."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from kernel_results import all_results, random_intervals, results
from small_problems import PROBLEMS, rich_system

from airrace.optimal_control.kernels import NativeKernel, Part, build_kernels, casadi_kernels
from airrace.optimal_control.runge_kutta import DORMAND_PRINCE_5, RK4, RK4_TWICE, RungeKutta
from airrace.quantities import Quantity
from airrace.system import System


def system(
    rates: Callable[[ca.SX, ca.SX, ca.SX], list[ca.SX]],
    sizes: tuple[int, int, int],
    projection: Callable[[ca.SX], list[ca.SX]] | None = None,
) -> System:
    """A system with so many states, controls and parameters."""
    x, u, p = (ca.SX.sym(name, size) for name, size in zip("xup", sizes, strict=True))
    named = [tuple(Quantity(f"{one}", "1") for one in ca.vertsplit(symbols)) for symbols in (x, u, p)]
    project = ca.Function("project", [x], [ca.vertcat(*projection(x))]) if projection is not None else None
    return System("some", *named, ca.Function("rates", [x, u, p], [ca.vertcat(*rates(x, u, p))]), projection=project)


def car(x: ca.SX, u: ca.SX, p: ca.SX) -> list[ca.SX]:
    """Place (2), heading, speed; nothing depends on the place."""
    return [x[3] * ca.cos(x[2]), x[3] * ca.sin(x[2]), u[0] * x[3], p[0] * u[1] - p[1] * x[3] ** 2]


def linear(x: ca.SX, u: ca.SX, p: ca.SX) -> list[ca.SX]:
    return [x[1], -2.0 * x[0] - 0.3 * x[1] + u[0]]


def coupled(x: ca.SX, u: ca.SX, p: ca.SX) -> list[ca.SX]:
    """Curved in the control, in products of control and state, and in the parameter."""
    return [ca.exp(0.2 * u[0]) * x[1] * x[2], ca.sin(x[0] * p[0]) * u[0] ** 2, ca.SX(0.0), x[0] / (2.0 + ca.cos(x[3]))]


SYSTEMS: Mapping[str, System] = {
    **{name: problem.system for name, problem in PROBLEMS.items() if name not in ("everything", "one phase")},
    "rich": rich_system(),
    "rich, not projected": replace(rich_system(), projection=None),
    "place passes through": system(car, (4, 2, 2)),
    "place passes through a projection": system(car, (4, 2, 2), lambda x: [x[0], x[1], ca.sin(x[2]), x[3]]),
    "projection scales and mixes the place": system(
        car, (4, 2, 2), lambda x: [2.0 * x[0], x[1] * x[3], x[2] + ca.cos(x[0]), x[3]]
    ),
    "linear": system(linear, (2, 1, 0)),
    "a rate that is zero": system(coupled, (4, 1, 1)),
    "nothing moves": system(lambda x, u, p: [ca.SX(0.0), ca.SX(0.0)], (2, 1, 0)),
}
EULER = RungeKutta("euler", 1, ((),), (1.0,))
THRICE = replace(RK4_TWICE, name="rk4x3", steps=3)


def assert_equal(of: System, scheme: RungeKutta, given: Sequence[np.ndarray] | None = None) -> None:
    """Patterns are equal, and every result differs by no more than 1e-12 of its largest entry."""
    composed, graph = build_kernels(of, scheme).step, casadi_kernels(of, scheme).step
    assert isinstance(composed, NativeKernel)
    given = given or random_intervals(graph, 1, len(of.parameters), 5 * composed.lanes)
    for pair in (
        (composed.jacobian_pattern, graph.jacobian_pattern),
        (composed.hessian_pattern, graph.hessian_pattern),
    ):
        mine, theirs = (set(zip(*one.get_triplet(), strict=True)) for one in pair)
        assert mine == theirs
    for mine, theirs in zip(all_results(composed, given), all_results(graph, given), strict=True):
        assert np.isfinite(theirs).all()
        assert np.abs(mine - theirs).max(initial=0.0) <= 1e-12 * np.abs(theirs).max(initial=0.0)


@pytest.mark.parametrize("name", SYSTEMS)
def test_composed_derivatives_equal_those_of_the_whole_graph(name: str) -> None:
    assert_equal(SYSTEMS[name], DORMAND_PRINCE_5)


@pytest.mark.parametrize("scheme", [EULER, RK4, RK4_TWICE, THRICE], ids=lambda scheme: scheme.name)
def test_composed_derivatives_are_those_of_any_explicit_scheme(scheme: RungeKutta) -> None:
    assert_equal(rich_system(), scheme)


def test_an_interval_without_length_has_derivatives() -> None:
    step = casadi_kernels(rich_system(), DORMAND_PRINCE_5).step
    given = random_intervals(step, 1, len(rich_system().parameters), 8)
    given[0][:, -1] = 0.0
    assert_equal(rich_system(), DORMAND_PRINCE_5, given)


def test_step_derivatives_of_a_linear_system_are_the_scheme_s_polynomial() -> None:
    """x+ = R(h A) x, R the truncated exponential up to the order, for RK4."""
    step = build_kernels(system(linear, (2, 1, 0)), RK4).step
    h, rates = 0.4, np.array([[0.0, 1.0], [-2.0, -0.3]])
    expected = sum(np.linalg.matrix_power(h * rates, power) / math.factorial(power) for power in range(5))
    given = [np.tile(one, (step.lanes, 1)) for one in ([0.3, -0.7, 0.0, 1.6], [0.25], [], [0.0, 0.0])]
    given[2] = np.zeros(0)
    jacobian = np.zeros((2, 4))
    rows, columns = step.jacobian_pattern.get_triplet()
    jacobian[rows, columns] = results(step, Part.JACOBIAN, given)[1][0]
    assert jacobian[:, :2] == pytest.approx(expected, rel=1e-13, abs=1e-15)
