"""A glider stays aloft in the least wind gradient b (after Zhao 2004): 0.0635870 ft/s per ft; [ft, slug, s].

The gradient and the speed and heading at the start are states that do not change.
"""

import math

import casadi as ca
import numpy as np
from statement import KnownAnswer, Value, exactly, objective

from airrace.optimal_control.problem import Boundary, Iterate, Objective, Phase, Problem, uniform
from airrace.optimal_control.quantities import Interval, T, Vector, quantity, vector
from airrace.optimal_control.system import observation_of, system_of

m, g, rho, S = 5.6, 32.2, 0.002378, 45.09703
DEGREE = math.pi / 180


@vector
class State(Vector[T]):
    x: T = quantity("ft", scale=1000.0, lower=-1500.0, upper=1500.0)
    y: T = quantity("ft", scale=1000.0, lower=-1000.0, upper=1000.0)
    h: T = quantity("ft", scale=1000.0, lower=0.0, upper=1000.0)
    v: T = quantity("ft/s", scale=100.0, lower=10.0, upper=350.0)
    gamma: T = quantity("rad", lower=-75 * DEGREE, upper=75 * DEGREE)
    psi: T = quantity("rad")
    n: T = quantity("1", lower=-2.0, upper=5.0)
    phi: T = quantity("rad", lower=-75 * DEGREE, upper=75 * DEGREE)
    b: T = quantity("1/s", scale=0.1, lower=0.005, upper=0.15)
    v_start: T = quantity("ft/s", scale=100.0)
    psi_start: T = quantity("rad")


@vector
class Control(Vector[T]):
    n_dot: T = quantity("1/s")
    phi_dot: T = quantity("rad/s")


@vector
class Lift(Vector[T]):
    C_L: T = quantity("1", lower=0.0, upper=1.5)


@vector
class Gain(Vector[T]):
    dv: T = quantity("ft/s", scale=100.0)
    dpsi: T = quantity("rad")


def lift_coefficient(state: State) -> ca.SX:
    return state.n * m * g / (0.5 * rho * S * state.v**2)


def rates(state: State, control: Control) -> State:
    v, gamma, psi, phi, b = state.v, state.gamma, state.psi, state.phi, state.b
    L, D = state.n * m * g, 0.5 * rho * S * v**2 * (0.00873 + 0.045 * lift_coefficient(state) ** 2)
    h_dot = v * ca.sin(gamma)
    return State(
        x=v * ca.cos(gamma) * ca.sin(psi) + b * state.h,
        y=v * ca.cos(gamma) * ca.cos(psi),
        h=h_dot,
        v=-D / m - g * ca.sin(gamma) - b * h_dot * ca.cos(gamma) * ca.sin(psi),
        gamma=(L * ca.cos(phi) - m * g * ca.cos(gamma) + m * b * h_dot * ca.sin(gamma) * ca.sin(psi)) / (m * v),
        psi=(L * ca.sin(phi) - m * b * h_dot * ca.cos(psi)) / (m * v * ca.cos(gamma)),
        n=control.n_dot,
        phi=control.phi_dot,
        b=0.0,
        v_start=0.0,
        psi_start=0.0,
    )


def gain(state: State) -> Gain:
    """Since the start of the cycle."""
    return Gain(dv=state.v - state.v_start, dpsi=state.psi - state.psi_start)


SYSTEM = system_of("soaring-glider", State, Control, rates, Path=Lift, path=lambda x, u: Lift(C_L=lift_coefficient(x)))
SINCE_START = observation_of("since the start", State, Gain, gain)


def guess(intervals: int) -> Iterate:
    """One turn that climbs upwind and descends downwind, in 22 s."""
    turn = np.linspace(0.0, 2 * math.pi, intervals + 1)
    constant = np.ones_like(turn)
    flight = State(
        x=-200.0 * (1.0 - np.cos(turn)),
        y=-200.0 * np.sin(turn),
        h=250.0 * (1.0 - np.cos(turn)),
        v=150.0 + 50.0 * np.cos(turn),
        gamma=0.5 * np.sin(turn),
        psi=turn,
        n=2.0 * constant,
        phi=constant,
        b=0.1 * constant,
        v_start=200.0 * constant,
        psi_start=0.0 * constant,
    )
    return Iterate(np.array([22.0]), np.array(flight.join()), np.zeros((Control.size(), intervals)))


def known_answers() -> tuple[KnownAnswer, ...]:
    # gamma is periodic; as the cycle begins and ends on the ground and never dips below it, gamma is zero there
    at_origin = {name: exactly(0.0) for name in ("x", "y", "h", "gamma")}
    start = at_origin | {"dv": exactly(0.0), "dpsi": exactly(0.0)}
    end = at_origin | {"dv": exactly(0.0), "dpsi": exactly(2 * math.pi)}
    problem = Problem(
        SYSTEM,
        parameters=(),
        start=Boundary("start", start, SINCE_START),
        phases=(Phase("cycle", uniform(200), Interval(10.0, 30.0), Boundary("end", end, SINCE_START)),),
        objective=Objective(time=0.0, terminal={"b": 1.0}),
        time_scale=10.0,
    )
    source = "a spectral solution of the problem of Zhao 2004"
    gradient = Value("least wind gradient", "1/s", "0.0635870", source, 5e-7, objective)
    return (KnownAnswer("dynamic soaring", problem, guess(200), (gradient,)),)
