"""The double integrator is brought from (1, 0) to the origin in minimum time, abs(u) <= 1; t_f = 2, switching at 1."""

from statement import KnownAnswer, exactly, least_time

from airrace.optimal_control.problem import Boundary, Phase, Problem, corners, interpolate, uniform
from airrace.optimal_control.quantities import Interval, T, Vector, quantity, vector
from airrace.optimal_control.system import system_of


@vector
class State(Vector[T]):
    x: T = quantity("m")
    v: T = quantity("m/s")


@vector
class Control(Vector[T]):
    u: T = quantity("m/s2", lower=-1.0, upper=1.0)


SYSTEM = system_of("double-integrator", State, Control, lambda x, u: State(x=x.v, v=u.u))


def known_answers() -> tuple[KnownAnswer, ...]:
    """One interval each before and after a switch that is free."""
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
    guess = interpolate(problem, [1.5, 0.8], states, [0.0])
    time = least_time(2.0, tolerance=1e-7)
    return (KnownAnswer("double integrator, free switch", problem, guess, (time,)),)
