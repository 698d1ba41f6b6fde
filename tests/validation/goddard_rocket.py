"""A rocket climbs as high as it can on its fuel (Goddard 1919), in units of its start: COPS 3 gives 1.01283.

Full thrust, a singular arc on which drag and weight are in balance, and no thrust.
"""

import casadi as ca
import numpy as np
from statement import KnownAnswer, Value, exactly

from airrace.optimal_control.problem import Boundary, Iterate, Objective, Phase, Problem, uniform
from airrace.optimal_control.quantities import Interval, T, Vector, quantity, vector
from airrace.optimal_control.system import system_of

thrust_max, drag_factor, exhaust_speed, m_end = 3.5, 310.0, 0.5, 0.6


@vector
class State(Vector[T]):
    h: T = quantity("1", scale=0.01, lower=1.0)
    v: T = quantity("1", scale=0.1, lower=0.0)
    m: T = quantity("1", lower=m_end, upper=1.0)


@vector
class Thrust(Vector[T]):
    thrust: T = quantity("1", lower=0.0, upper=thrust_max)


def rates(state: State, control: Thrust) -> State:
    drag = drag_factor * state.v**2 * ca.exp(-500.0 * (state.h - 1.0))
    return State(h=state.v, v=(control.thrust - drag) / state.m - 1.0 / state.h**2, m=-control.thrust / exhaust_speed)


SYSTEM = system_of("goddard-rocket", State, Thrust, rates)


def known_answers() -> tuple[KnownAnswer, ...]:
    intervals = 100
    problem = Problem(
        SYSTEM,
        parameters=(),
        start=Boundary(bounds={"h": exactly(1.0), "v": exactly(0.0), "m": exactly(1.0)}),
        phases=(Phase("climb", uniform(intervals), Interval(0.01, 10.0), Boundary(bounds={"m": exactly(m_end)})),),
        objective=Objective(time=0.0, terminal={"h": -1.0}),
    )
    k = np.linspace(0.0, 1.0, intervals + 1)
    states = np.array([np.ones_like(k), k * (1.0 - k), 1.0 + (m_end - 1.0) * k])
    guess = Iterate(np.array([1.0]), states, np.full((1, intervals), thrust_max / 2.0))
    value = Value("greatest height", "1", "1.01283", "COPS 3, Dolan, More & Munson 2004", 2e-5, lambda s: -s.objective)
    return (KnownAnswer("Goddard rocket", problem, guess, (value,)),)
