"""A cruise missile climbs and dives onto its target in minimum time (Subchan & Zbikowski 2007): 40.912 s."""

import math

import casadi as ca
from statement import KnownAnswer, Value, exactly, objective

from airrace.optimal_control.problem import Boundary, Phase, Problem, corners, interpolate, uniform
from airrace.optimal_control.quantities import Interval, T, Vector, quantity, vector
from airrace.optimal_control.system import system_of

m, g, S = 1005.0, 9.81, 0.3376


@vector
class State(Vector[T]):
    gamma: T = quantity("rad")
    V: T = quantity("m/s", scale=300.0, lower=200.0, upper=310.0)
    x: T = quantity("m", scale=1000.0)
    h: T = quantity("m", scale=1000.0, lower=0.0)
    alpha: T = quantity("rad", scale=0.1, lower=-0.3, upper=0.3)


@vector
class Control(Vector[T]):
    thrust: T = quantity("N", scale=6000.0, lower=1000.0, upper=6000.0)
    alpha_dot: T = quantity("rad/s", scale=0.1)


@vector
class Load(Vector[T]):
    n: T = quantity("1", lower=-4.0, upper=4.0)


def lift(state: State) -> ca.SX:
    return dynamic_pressure(state) * S * 21.9 * state.alpha


def drag(state: State) -> ca.SX:
    return dynamic_pressure(state) * S * (-1.9431 * state.alpha**2 - 0.1499 * state.alpha + 0.2359)


def dynamic_pressure(state: State) -> ca.SX:
    rho = 3.312e-9 * state.h**2 - 1.142e-4 * state.h + 1.224
    return 0.5 * rho * state.V**2


def rates(state: State, control: Control) -> State:
    gamma, V, alpha = state.gamma, state.V, state.alpha
    along, L = control.thrust - drag(state), lift(state)
    return State(
        gamma=(along * ca.sin(alpha) + L * ca.cos(alpha)) / (m * V) - g * ca.cos(gamma) / V,
        V=(along * ca.cos(alpha) - L * ca.sin(alpha)) / m - g * ca.sin(gamma),
        x=V * ca.cos(gamma),
        h=V * ca.sin(gamma),
        alpha=control.alpha_dot,
    )


SYSTEM = system_of("terminal-bunt", State, Control, rates, Path=Load, path=lambda x, u: Load(n=lift(x) / (m * g)))


def known_answers() -> tuple[KnownAnswer, ...]:
    target = {"gamma": -math.pi / 2, "V": 310.0, "x": 10000.0, "h": 0.0}
    launch = {"gamma": 0.0, "V": 272.0, "x": 0.0, "h": 30.0}
    approach = Phase(
        "approach",
        uniform(30),
        Interval(10.0, 60.0),
        Boundary(bounds={"x": exactly(7500.0)}),
        bounds={"h": Interval(lower=30.0)},
    )
    dive = Phase(
        "dive",
        uniform(30),
        Interval(5.0, 60.0),
        Boundary(bounds={name: exactly(value) for name, value in target.items()}),
    )
    problem = Problem(
        SYSTEM,
        parameters=(),
        start=Boundary(bounds={name: exactly(value) for name, value in launch.items()}),
        phases=(approach, dive),
        time_scale=20.0,
    )
    top = State(gamma=0.0, V=280.0, x=7500.0, h=1500.0, alpha=0.0)
    states = corners(State(**launch, alpha=0.0), top, State(**target, alpha=0.0))
    guess = interpolate(problem, [27.0, 14.0], states, [6000.0, 0.0])
    source = "the problem of Subchan & Zbikowski 2007"
    time = Value("least time", "s", "40.912", source, 0.0005, objective)
    return (KnownAnswer("terminal bunt", problem, guess, (time,)),)
