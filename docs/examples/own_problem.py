"""The engine on a problem of its own: move a mass by one metre, from rest to rest, in the least time."""

from airrace.optimal_control.problem import Boundary, Phase, Problem, corners, interpolate, uniform
from airrace.optimal_control.quantities import Interval, T, Vector, quantity, vector
from airrace.optimal_control.solve_problem import solve
from airrace.optimal_control.system import system_of

exactly = Interval.exactly


@vector
class State(Vector[T]):
    x: T = quantity("m")
    v: T = quantity("m/s", scale=5.0)


@vector
class Force(Vector[T]):
    f: T = quantity("m/s2", scale=20.0, lower=-20.0, upper=20.0)


end = Boundary("end", {"x": exactly(1.0), "v": exactly(0.0)})
problem = Problem(
    system_of("sliding mass", State, Force, lambda x, u: State(x=x.v, v=u.f)),
    parameters=(),
    start=Boundary("start", {"x": exactly(0.0), "v": exactly(0.0)}),
    phases=(Phase("push", uniform(10), Interval(0.01, 5.0)), Phase("brake", uniform(10), Interval(0.01, 5.0), end)),
)
at = corners(State(x=0.0, v=0.0), State(x=0.5, v=1.0), State(x=1.0, v=0.0))
solution = solve(problem, interpolate(problem, [0.5, 0.5], at, [0.0]))
print(f"{solution.objective:.6f} s; the answer is {2 / 20**0.5:.6f} s")
