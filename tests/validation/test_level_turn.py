"""A level turn with limited roll rate p and load factor n, wings level at both ends, in minimum time.

    chi' = g tan(phi) / V,  abs(phi') <= p,  cos(phi) >= 1 / n

Roll in, hold, roll out, with `phi_m = acos(1 / n)` and `dr = g ln(n) / (V p)` turned in each roll:

    t_f = 2 phi_m / p + (dchi - 2 dr) V / (g tan phi_m)
"""

import math

import casadi as ca
import pytest
from statement import corners, exactly, optimum, textbook_system

from airrace.optimal_control.problem import Boundary, Phase, Problem, interpolated, uniform
from airrace.quantities import Interval, T, Vector, quantity, vector

g, V, n, p, dchi = 9.80665, 100.0, 8.0, 2 * math.pi, math.pi


@vector
class State(Vector[T]):
    chi: T = quantity("rad")
    phi: T = quantity("rad", lower=-math.pi / 2, upper=math.pi / 2)


@vector
class RollRate(Vector[T]):
    phi_dot: T = quantity("rad/s", scale=p, lower=-p, upper=p)


@vector
class Lift(Vector[T]):
    vertical_share: T = quantity("1", scale=1 / n, lower=1 / n)


SYSTEM = textbook_system(
    "level-turn",
    State,
    RollRate,
    lambda x, u: State(chi=g / V * ca.tan(x.phi), phi=u.phi_dot),
    Path=Lift,
    path=lambda x, u: Lift(vertical_share=ca.cos(x.phi)),
)


@pytest.mark.parametrize("solver", ["fatrop", "ipopt"])
def test_turn_rolls_in_holds_and_rolls_out_as_the_closed_form_says(solver: str) -> None:
    level = {"phi": exactly(0.0)}
    problem = Problem(
        SYSTEM,
        parameters=(),
        start=Boundary(bounds={"chi": exactly(0.0)} | level),
        phases=(
            Phase("roll in", uniform(24), Interval(0.05, 5.0)),
            Phase("hold", uniform(4), Interval(0.05, 10.0)),
            Phase("roll out", uniform(24), Interval(0.05, 5.0), Boundary(bounds={"chi": exactly(dchi)} | level)),
        ),
    )
    states = corners(
        State(chi=0.0, phi=0.0), State(chi=0.1, phi=1.3), State(chi=dchi - 0.1, phi=1.3), State(chi=dchi, phi=0.0)
    )
    solution = optimum(problem, interpolated(problem, [0.3, 5.0, 0.3], states, [0.0]), solver, tolerance=1e-9)

    phi_m, dr = math.acos(1 / n), g / (V * p) * math.log(n)
    closed_form = 2 * phi_m / p + (dchi - 2 * dr) * V / (g * math.tan(phi_m))
    assert solution.success, solution.status
    assert closed_form == pytest.approx(4.4127867, abs=5e-8)
    assert solution.objective == pytest.approx(closed_form, abs=5e-7)
    assert solution.iterate.durations[[0, 2]] == pytest.approx(phi_m / p, abs=1e-5)
