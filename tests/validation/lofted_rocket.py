"""A rocket without air burns for a given time and then falls as far away as possible (Lawden 1963, flat Earth).

With the acceleration n g and the thrust at the angle theta above the horizon, the range is a nonlinear function of the
state at burnout. The best angle is constant, and its sine s is the root of s^3 - 2 n s^2 + n = 0 between 1/n and 1.
"""

import casadi as ca
import numpy as np
from statement import KnownAnswer, Value, exactly

from airrace.optimal_control.problem import Boundary, Objective, Phase, Problem, corners, interpolate, uniform
from airrace.optimal_control.quantities import T, Vector, quantity, vector
from airrace.optimal_control.system import observation_of, system_of

g, n, tau = 9.80665, 2.0, 60.0


@vector
class State(Vector[T]):
    x: T = quantity("m", scale=1e4)
    y: T = quantity("m", scale=1e4)
    vx: T = quantity("m/s", scale=500.0)
    vy: T = quantity("m/s", scale=500.0)


@vector
class Control(Vector[T]):
    theta: T = quantity("rad", lower=0.0, upper=np.pi / 2)


@vector
class Impact(Vector[T]):
    range: T = quantity("m", scale=1e5)


def rates(state: State, control: Control) -> State:
    return State(
        x=state.vx,
        y=state.vy,
        vx=n * g * ca.cos(control.theta),
        vy=n * g * ca.sin(control.theta) - g,
    )


def impact(state: State) -> Impact:
    """Where the parabola from burnout meets the ground."""
    return Impact(range=state.x + state.vx / g * (state.vy + ca.sqrt(state.vy**2 + 2 * g * state.y)))


SYSTEM = system_of("rocket on a flat Earth", State, Control, rates)
IMPACT = observation_of("impact", State, Impact, impact)


def best_angle() -> float:
    """The root of Lawden's cubic, rad."""
    roots = np.roots([1.0, -2.0 * n, 0.0, n])
    (sine,) = [float(root.real) for root in roots if abs(root.imag) < 1e-12 and 1.0 / n < root.real < 1.0]
    return float(np.arcsin(sine))


def range_at(theta: float) -> float:
    """The range with the thrust always at this angle, m."""
    vx, vy = n * g * np.cos(theta) * tau, (n * np.sin(theta) - 1.0) * g * tau
    return float(impact(State(x=vx * tau / 2, y=vy * tau / 2, vx=vx, vy=vy)).range)


def known_answers() -> tuple[KnownAnswer, ...]:
    problem = Problem(
        SYSTEM,
        parameters=(),
        start=Boundary(bounds={name: exactly(0.0) for name in State.names()}),
        phases=(Phase("burn", uniform(10), exactly(tau)),),
        objective=Objective(time=0.0, terminal={"range": -1e-5}, observation=IMPACT),
        time_scale=tau,
    )
    states = corners(State(x=0.0, y=0.0, vx=0.0, vy=0.0), State(x=3e4, y=1e4, vx=1000.0, vy=300.0))
    guess = interpolate(problem, [tau], states, [0.9])
    theta = best_angle()
    reached = Value(
        *("greatest range", "km", f"{range_at(theta) / 1e3:.10f}", "closed form", 1e-6),
        of=lambda solution: -100.0 * solution.objective,
        closed_form=True,
    )
    angle = Value(
        *("its angle", "rad", f"{theta:.10f}", "closed form", 1e-6),
        of=lambda solution: float(solution.iterate.control.mean()),
        closed_form=True,
    )
    return (KnownAnswer("rocket on a flat Earth", problem, guess, (reached, angle)),)
