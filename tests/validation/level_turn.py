"""A level turn with limited roll rate p and load factor n, wings level at both ends, in minimum time.

    chi' = g tan(phi) / V,  abs(phi') <= p,  cos(phi) >= 1 / n

Roll in, hold, roll out, with `phi_m = acos(1 / n)` and `dr = g ln(n) / (V p)` turned in each roll:

    t_f = 2 phi_m / p + (dchi - 2 dr) V / (g tan phi_m)
"""

import math

import casadi as ca
from statement import KnownAnswer, exactly, least_time

from airrace.optimal_control.problem import Boundary, Phase, Problem, corners, interpolate, uniform
from airrace.optimal_control.quantities import Interval, T, Vector, quantity, vector
from airrace.optimal_control.system import system_of

g, V, n, p, dchi = 9.80665, 100.0, 8.0, 2 * math.pi, math.pi
phi_m, dr = math.acos(1 / n), g / (V * p) * math.log(n)


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


SYSTEM = system_of(
    "level-turn",
    State,
    RollRate,
    lambda x, u: State(chi=g / V * ca.tan(x.phi), phi=u.phi_dot),
    Path=Lift,
    path=lambda x, u: Lift(vertical_share=ca.cos(x.phi)),
)


def known_answers() -> tuple[KnownAnswer, ...]:
    """Three phases, whose ends are free."""
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
    guess = interpolate(problem, [0.3, 5.0, 0.3], states, [0.0])
    time = least_time(2 * phi_m / p + (dchi - 2 * dr) * V / (g * math.tan(phi_m)), tolerance=5e-7)
    return (KnownAnswer("level turn, limited roll", problem, guess, (time,)),)
