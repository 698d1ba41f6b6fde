"""A chain of length 4 hangs between two heights: the least potential energy is that of a catenary.

`x(t) = c cosh((t - t_0) / c) + l` through (0, 1) and (1, 3); the guess is that of COPS 3.
"""

import casadi as ca
import numpy as np
from scipy.optimize import brentq
from statement import KnownAnswer, Value, exactly, objective

from airrace.optimal_control.problem import Boundary, Iterate, Objective, Phase, Problem, uniform
from airrace.optimal_control.quantities import T, Vector, quantity, vector
from airrace.optimal_control.system import system_of

length, left, right = 4.0, 1.0, 3.0


@vector
class State(Vector[T]):
    x: T = quantity("m")
    energy: T = quantity("m2")
    length: T = quantity("m")


@vector
class Slope(Vector[T]):
    u: T = quantity("1")


def rates(state: State, control: Slope) -> State:
    arc = ca.sqrt(1.0 + control.u**2)
    return State(x=control.u, energy=state.x * arc, length=arc)


SYSTEM = system_of("hanging-chain", State, Slope, rates)


def least_energy() -> float:
    """The integral of x along the catenary, by the formulas of its length and height."""
    chord = np.sqrt(length**2 - (right - left) ** 2)
    c = brentq(lambda c: 2.0 * c * np.sinh(0.5 / c) - chord, 0.05, 10.0, xtol=1e-15)
    t_0 = 0.5 - c * np.arctanh((right - left) / length)
    begin, end = -t_0 / c, (1.0 - t_0) / c
    offset = left - c * np.cosh(begin)
    squares = 0.5 * (end - begin) + 0.25 * (np.sinh(2.0 * end) - np.sinh(2.0 * begin))  # of cosh
    return float(c**2 * squares + offset * length)


def known_answers() -> tuple[KnownAnswer, ...]:
    intervals = 100
    problem = Problem(
        SYSTEM,
        parameters=(),
        start=Boundary(bounds={"x": exactly(left), "energy": exactly(0.0), "length": exactly(0.0)}),
        phases=(
            Phase(
                "chain",
                uniform(intervals),
                exactly(1.0),
                Boundary(bounds={"x": exactly(right), "length": exactly(length)}),
            ),
        ),
        objective=Objective(time=0.0, terminal={"energy": 1.0}),
    )
    k = np.linspace(0.0, 1.0, intervals + 1)
    slope = 4.0 * (right - left) * (k - 0.25)
    x = 4.0 * (right - left) * k * (0.5 * k - 0.25) + left
    guess = Iterate(np.array([1.0]), np.array([x, x * slope, slope]), slope[None, :-1])
    value = Value(
        *("least energy", "m2", f"{least_energy():.10f}", "closed form", 1e-3), of=objective, closed_form=True
    )
    return (KnownAnswer("hanging chain", problem, guess, (value,)),)
