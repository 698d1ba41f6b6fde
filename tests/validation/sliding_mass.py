"""A mass slides from rest to rest in minimum time: x'' = f, abs(f) <= 20, from 0 to 1; t_f = 2 / sqrt(20)."""

import math

from statement import KnownAnswer, exactly, least_time

from airrace.optimal_control.problem import Boundary, Phase, Problem, corners, interpolate, uniform
from airrace.optimal_control.quantities import Interval, T, Vector, quantity, vector
from airrace.optimal_control.system import system_of


@vector
class State(Vector[T]):
    x: T = quantity("m")
    v: T = quantity("m/s")


@vector
class Force(Vector[T]):
    f: T = quantity("N/kg", scale=20.0, lower=-20.0, upper=20.0)


SYSTEM = system_of("sliding-mass", State, Force, lambda x, u: State(x=x.v, v=u.f))


def sliding_mass(count: int) -> KnownAnswer:
    """The way in a number of phases of equal length."""
    ends = [Boundary(bounds={"x": exactly(index / count)}) for index in range(1, count)]
    ends.append(Boundary(bounds={"x": exactly(1.0), "v": exactly(0.0)}))
    problem = Problem(
        SYSTEM,
        parameters=(),
        start=Boundary(bounds={"x": exactly(0.0), "v": exactly(0.0)}),
        # an even number of intervals: the force changes its sign at the end of one of them
        phases=tuple(Phase(f"stretch {index}", uniform(6), Interval(0.01, 5.0), end) for index, end in enumerate(ends)),
    )
    between = [State(x=index / count, v=1.0) for index in range(1, count)]
    states = corners(State(x=0.0, v=0.0), *between, State(x=1.0, v=0.0))
    return KnownAnswer(
        f"sliding mass, {count} phase{'s' if count > 1 else ''}",
        problem,
        interpolate(problem, [1.0 / count] * count, states, [0.0]),
        (least_time(2 / math.sqrt(20), tolerance=1e-7),),
    )


def known_answers() -> tuple[KnownAnswer, ...]:
    return tuple(sliding_mass(count) for count in (1, 2, 3, 4))
