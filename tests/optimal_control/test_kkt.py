"""The optimality conditions are measured as the textbook writes them."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from airrace.optimal_control.assembly import Assembly
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.kernels import casadi_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.optimality import KktError, kkt_error
from airrace.optimal_control.problem import Boundary, Objective, Phase, Problem, interpolate
from airrace.quantities import Interval, Quantity
from airrace.system import System


def creep() -> Problem:
    """Least time for x' = 2 u over one interval, u <= 3, from 0 to 12: t_f = 2, and each unit of x costs 1 / 6."""
    x, u, p = ca.SX.sym("x", 1), ca.SX.sym("u", 1), ca.SX.sym("p", 0)
    system = System(
        "creep",
        (Quantity("x", "m"),),
        (Quantity("u", "m/s", upper=3.0),),
        (),
        ca.Function("rates", [x, u, p], [2 * u]),
    )
    start, end = Boundary("start", {"x": Interval.exactly(0.0)}), Boundary("end", {"x": Interval.exactly(12.0)})
    return Problem(system, (), start, (Phase("creep", (1.0,), Interval(0.1, 9.0), end),))


def measured(duration: float, u: float, costate: float) -> tuple[KktError, np.ndarray, int]:
    problem = creep()
    layout = Layout(problem)
    functions = Evaluation(Assembly(layout, casadi_kernels(problem.system, problem.scheme)))
    w = layout.pack(interpolate(problem, [duration], np.array([[0.0, 12.0]]), [u]))
    lam_g = np.zeros(layout.constraints)
    lam_g[layout.gap_index[0, 0]] = costate
    return kkt_error(functions, layout, w, layout.parameter_values(), lam_g)


def test_the_optimum_and_its_costate_have_no_error() -> None:
    error, lam_x, _ = measured(duration=2.0, u=3.0, costate=1 / 6)
    assert error.largest == pytest.approx(0.0, abs=1e-12)
    # the control's bound carries 2 T / 6, the ends carry the costate
    layout = Layout(creep())
    assert lam_x[layout.control_index.ravel()] == pytest.approx([2 / 3])
    assert lam_x[layout.state_index.ravel()] == pytest.approx([1 / 6, -1 / 6])


def test_a_gap_is_a_primal_error() -> None:
    error, _, worst = measured(duration=1.5, u=3.0, costate=1 / 6)
    assert error.primal == pytest.approx(3.0)
    assert worst == Layout(creep()).gap_index[0, 0]


def test_a_value_outside_its_bound_is_a_primal_error() -> None:
    error, _, _ = measured(duration=1.5, u=4.0, costate=1 / 8)
    assert error.primal == pytest.approx(1.0)


def test_a_wrong_costate_is_a_dual_error() -> None:
    error, _, _ = measured(duration=2.0, u=3.0, costate=1 / 6 + 0.1)
    assert error.dual == pytest.approx(0.6)  # of the duration: 1 - 2 u costate


def test_a_multiplier_on_a_distant_bound_is_a_complementarity_error() -> None:
    error, _, _ = measured(duration=2.5, u=2.4, costate=1 / 4.8)
    assert error.primal == pytest.approx(0.0, abs=1e-12)
    assert error.complementarity == pytest.approx(2 * 2.5 / 4.8 * 0.6)


@pytest.mark.parametrize("field", ["primal", "dual", "complementarity"])
def test_a_missing_number_is_never_small(field: str) -> None:
    assert np.isnan(replace(KktError(1e-9, 1e-9, 1e-9), **{field: np.nan}).largest)


def test_objective_defaults_to_time() -> None:
    assert creep().objective == Objective(time=1.0)
