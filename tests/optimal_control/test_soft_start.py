"""A soft start begins where it was measured as long as that is worth its price, and else as near as is worth it.

A point that moves at most 1 m/s needs `|m|` s to the origin, and from a start that is `r` deviations of 1 m nearer
`|m| - r`; so the minimum of time and price is known.
"""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from airrace.optimal_control.elastic import augment, project
from airrace.optimal_control.problem import Boundary, Iterate, Phase, Problem, uniform
from airrace.optimal_control.quantities import Interval, Quantity
from airrace.optimal_control.soft_start import soften_start
from airrace.optimal_control.solve_problem import solve
from airrace.optimal_control.system import System

X, U, P = ca.SX.sym("x"), ca.SX.sym("u"), ca.SX.sym("p", 0)
SYSTEM = System(
    name="slider",
    states=(Quantity("x", "m"),),
    controls=(Quantity("u", "m/s", lower=-1.0, upper=1.0),),
    parameters=(),
    rates=ca.Function("rates", [X, U, P], [U]),
)
SHORTEST = 0.5
PROBLEM = Problem(
    system=SYSTEM,
    parameters=(),
    start=Boundary(),
    phases=(
        Phase("slide", uniform(5), Interval(SHORTEST, 20.0), end=Boundary("origin", {"x": Interval.exactly(0.0)})),
    ),
)


def softly(measured: float, price: float, problem: Problem = PROBLEM) -> tuple[float, float]:
    """Return the time and the deviations by which the start gives way."""
    soft = soften_start(problem, {"x": measured}, {"x": 1.0}, weight=price)
    guess = Iterate(np.array([1.0]), np.linspace(1.0, 0.0, 6)[None, :], np.full((1, 5), -1.0))
    solution = solve(soft, augment(guess, abs(measured - 1.0)))
    assert solution.success
    iterate, relaxed = project(solution.iterate)
    return float(iterate.durations.sum()), relaxed


@pytest.mark.parametrize("measured", [-2.0, 1.0, 3.0])
def test_a_price_above_the_slope_of_the_cost_leaves_the_start_where_it_was_measured(measured: float) -> None:
    seconds, relaxed = softly(measured, 1.5)
    assert seconds == pytest.approx(abs(measured), abs=1e-5)
    assert relaxed == pytest.approx(0.0, abs=1e-5)


def test_a_price_below_it_makes_the_start_give_way_as_far_as_it_gains() -> None:
    seconds, relaxed = softly(3.0, 0.5)
    assert seconds == pytest.approx(SHORTEST, abs=1e-5)
    assert relaxed == pytest.approx(3.0 - SHORTEST, abs=1e-5)


def test_a_start_without_a_solution_gives_way_by_the_least_that_has_one() -> None:
    states = (replace(SYSTEM.states[0], upper=2.0),)
    limited = replace(PROBLEM, system=replace(SYSTEM, states=states))
    seconds, relaxed = softly(3.0, 50.0, limited)
    assert seconds == pytest.approx(2.0, abs=1e-4)
    assert relaxed == pytest.approx(1.0, abs=1e-5)
