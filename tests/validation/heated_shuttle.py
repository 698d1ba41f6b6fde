"""The space shuttle re-enters with the greatest cross-range, its leading edge no hotter than allowed (Betts 2010).

Without the limit the greatest latitude is 34.1412 degrees; with 70 BTU/ft2/s at the leading edge it is 30.6255 degrees.
Feet, pounds of force, slugs and seconds, as published; angle of attack and bank are linear over every interval.
"""

import math

import casadi as ca
import numpy as np
from statement import KnownAnswer, Value, exactly

from airrace.optimal_control.problem import Boundary, Iterate, Objective, Phase, Problem, interpolate
from airrace.optimal_control.quantities import Interval, T, Vector, quantity, vector
from airrace.optimal_control.solvers.solver import ProgramSolution
from airrace.optimal_control.system import system_of, with_linear_controls

g_0, m = 32.174, 203000.0 / 32.174  # ft/s2, slug
R_E, mu, S = 20902900.0, 0.14076539e17, 2690.0  # ft, ft3/s2, ft2
rho_0, h_r = 0.002378, 23800.0  # slug/ft3, ft
a_L = (-0.20704, 0.029244)  # of the lift, by powers of the angle of attack in degrees
b_D = (0.07854, -0.61592e-2, 0.621408e-3)  # of the drag
c_q = (1.0672181, -0.19213774e-1, 0.21286289e-3, -0.10117249e-5)  # of the heating
DEGREE = math.pi / 180.0


@vector
class State(Vector[T]):
    h: T = quantity("ft", scale=1e5, lower=0.0)
    theta: T = quantity("rad", scale=0.5, lower=-89 * DEGREE, upper=89 * DEGREE, text="latitude")
    v: T = quantity("ft/s", scale=1e4, lower=1.0)
    gamma: T = quantity("rad", scale=0.1, lower=-89 * DEGREE, upper=89 * DEGREE)
    psi: T = quantity("rad", text="azimuth")


@vector
class Attitude(Vector[T]):
    alpha: T = quantity("rad", scale=0.3, lower=0.0, upper=90 * DEGREE)
    beta: T = quantity("rad", lower=-89 * DEGREE, upper=1 * DEGREE, text="bank")


@vector
class Heating(Vector[T]):
    q: T = quantity("BTU/ft2/s", scale=70.0)


def polynomial(coefficients: tuple[float, ...], alpha: ca.SX) -> ca.SX:
    """Of the angle of attack in degrees."""
    degrees = alpha / DEGREE
    return sum(coefficient * degrees**power for power, coefficient in enumerate(coefficients))


def density(state: State) -> ca.SX:
    return rho_0 * ca.exp(-state.h / h_r)


def rates(state: State, control: Attitude) -> State:
    """Over a sphere that does not turn; the longitude, on which nothing depends, is left out."""
    v, gamma, psi, theta = state.v, state.gamma, state.psi, state.theta
    r = R_E + state.h
    g, qbar_S = mu / r**2, 0.5 * density(state) * v**2 * S
    L, D = polynomial(a_L, control.alpha) * qbar_S, polynomial(b_D, control.alpha) * qbar_S
    return State(
        h=v * ca.sin(gamma),
        theta=v / r * ca.cos(gamma) * ca.cos(psi),
        v=-D / m - g * ca.sin(gamma),
        gamma=L / (m * v) * ca.cos(control.beta) + ca.cos(gamma) * (v / r - g / v),
        psi=L * ca.sin(control.beta) / (m * v * ca.cos(gamma))
        + v / (r * ca.cos(theta)) * ca.cos(gamma) * ca.sin(psi) * ca.sin(theta),
    )


def heating(state: State, control: Attitude) -> Heating:
    """At the leading edge of the wing."""
    return Heating(
        q=polynomial(c_q, control.alpha) * 17700.0 * ca.sqrt(density(state)) * (1e-4 * state.v) ** 3.07,
    )


SHUTTLE = system_of("shuttle", State, Attitude, rates, Path=Heating, path=heating)
SYSTEM = with_linear_controls(SHUTTLE, seconds=100.0)


def latitude(solution: ProgramSolution) -> float:
    """Reached at the end, in degrees."""
    return float(solution.iterate.state[1, -1]) / DEGREE


def graded(intervals: int) -> tuple[float, ...]:
    """Fractions of a mesh that is finer at the beginning, where the shuttle skips in and out of the air."""
    return tuple(np.diff(np.linspace(0.0, 1.0, intervals + 1) ** 1.6).tolist())


def reentry(hottest: float | None, guessed_time: float, intervals: int) -> tuple[Problem, Iterate]:
    """The problem with a limit of the heating, BTU/ft2/s, and a straight guess."""
    begin = {"h": 260000.0, "theta": 0.0, "v": 25600.0, "gamma": -1 * DEGREE, "psi": 90 * DEGREE}
    end = {"h": 80000.0, "v": 2500.0, "gamma": -5 * DEGREE}
    limits = {"q": Interval(upper=hottest)} if hottest is not None else {}
    phase = Phase(
        "re-entry",
        graded(intervals),
        Interval(500.0, 4000.0),
        Boundary("end", {name: exactly(value) for name, value in end.items()}),
        bounds=limits,
    )
    problem = Problem(
        SYSTEM,
        parameters=(),
        start=Boundary("entry", {name: exactly(value) for name, value in begin.items()}),
        phases=(phase,),
        objective=Objective(time=0.0, terminal={"theta": -1.0}),
        time_scale=1000.0,
    )
    held = {"alpha": 17 * DEGREE, "beta": -50 * DEGREE}
    corners = ({**begin, **held}, {**end, "theta": 20 * DEGREE, "psi": 20 * DEGREE, **held})
    states = np.array([[corner[one.name] for one in SYSTEM.states] for corner in corners]).T
    return problem, interpolate(problem, [guessed_time], states, [0.0, 0.0])


def known_answers() -> tuple[KnownAnswer, ...]:
    source = "Betts 2010"
    answers: list[KnownAnswer] = []
    for name, hottest, published, time in (
        ("shuttle re-entry", None, "34.1412", 2000.0),
        ("shuttle re-entry, limited heating", 70.0, "30.6255", 2200.0),
    ):
        problem, guess = reentry(hottest, time, 120)
        value = Value("greatest cross-range", "deg", published, source, 1e-3, latitude)
        answers.append(KnownAnswer(name, problem, guess, (value,)))
    return tuple(answers)
