"""The double integrator is brought from (1, 0) to the origin in minimum time, abs(u) <= 1; t_f = 2, switching at 1."""

import pytest
from statement import corners, exactly, optimum, textbook_system

from airrace.optimal_control.problem import Boundary, Phase, Problem, interpolated, uniform
from airrace.quantities import Interval, T, Vector, quantity, vector


@vector
class State(Vector[T]):
    x: T = quantity("m")
    v: T = quantity("m/s")


@vector
class Control(Vector[T]):
    u: T = quantity("m/s2", lower=-1.0, upper=1.0)


SYSTEM = textbook_system("double-integrator", State, Control, lambda x, u: State(x=x.v, v=u.u))


@pytest.mark.parametrize("solver", ["fatrop", "ipopt"])
def test_a_free_switch_between_two_phases_finds_its_place(solver: str) -> None:
    within = Interval(0.01, 5.0)
    problem = Problem(
        SYSTEM,
        parameters=(),
        start=Boundary(bounds={"x": exactly(1.0), "v": exactly(0.0)}),
        phases=(
            Phase("accelerate", uniform(1), within),
            Phase("brake", uniform(1), within, Boundary(bounds={"x": exactly(0.0), "v": exactly(0.0)})),
        ),
    )
    states = corners(State(x=1.0, v=0.0), State(x=0.5, v=-0.5), State(x=0.0, v=0.0))
    solution = optimum(problem, interpolated(problem, [1.5, 0.8], states, [0.0]), solver)
    assert solution.success, solution.status
    assert solution.objective == pytest.approx(2.0, abs=1e-6)
    assert solution.iterate.durations == pytest.approx([1.0, 1.0], abs=1e-6)
    assert solution.iterate.control.ravel() == pytest.approx([-1.0, 1.0], abs=1e-6)
