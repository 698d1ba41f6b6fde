"""An insurance pays the expenses of a patient whom it cannot audit (Bocop): the greatest expected utility is 2.059511.

The premium P is a free constant, and what is paid on average has to be P. Bocop's state is the payment I; its rate is
divided by the marginal utility `s y`, `y = exp(-s R)`, of the revenue `R = 1 - P + I - m`: too stiff for explicit
integration. With y as the state instead, `y_dot = gamma t v'(m) h` is smooth; 400 intervals give 2.059476.
"""

import casadi as ca
import numpy as np
from statement import KnownAnswer, Value, exactly

from airrace.optimal_control.problem import Boundary, Iterate, Objective, Phase, Problem, uniform
from airrace.quantities import T, Vector, quantity, vector
from airrace.system import observation_of, system_of

gamma, lam, health, wealth, s, duration = 0.2, 0.25, 1.5, 1.0, 10.0, 10.0


@vector
class State(Vector[T]):
    y: T = quantity("1", lower=1e-4, upper=1.0)
    m: T = quantity("1", lower=0.0, upper=1.5)
    cost: T = quantity("1")
    utility: T = quantity("1")
    P: T = quantity("1", lower=0.0)
    t: T = quantity("s", scale=10.0)


@vector
class Expense(Vector[T]):
    h: T = quantity("1/s", lower=0.0, upper=25.0)


@vector
class Contract(Vector[T]):
    payment: T = quantity("1", lower=0.0, upper=1.5)
    H: T = quantity("1", lower=0.0)


@vector
class Terms(Vector[T]):
    payment: T = quantity("1")
    balance: T = quantity("1")


def contract(state: State) -> Contract:
    effect = state.m**2 / (1.0 + state.m**2)
    return Contract(
        payment=state.P + state.m - wealth - ca.log(state.y) / s, H=health - gamma * state.t * (1.0 - effect)
    )


def rates(state: State, control: Expense) -> State:
    illness = lam * ca.exp(-lam * state.t) + np.exp(-lam * duration) / duration
    values = contract(state)
    return State(
        y=gamma * state.t * 2.0 * state.m / (1.0 + state.m**2) ** 2 * control.h,
        m=control.h,
        cost=values.payment * illness,
        utility=(1.0 - state.y + values.H) * illness,
        P=0.0,
        t=1.0,
    )


def terms(state: State) -> Terms:
    return Terms(payment=contract(state).payment, balance=state.P - state.cost)


SYSTEM = system_of("insurance", State, Expense, rates, Path=Contract, path=lambda x, _: contract(x))
TERMS = observation_of("terms", State, Terms, terms)


def known_answers() -> tuple[KnownAnswer, ...]:
    intervals = 100
    begin = {"m": 0.001, "cost": 0.0, "utility": 0.0, "t": 0.0, "payment": 0.0}
    end = Boundary("end", {"balance": exactly(0.0)}, TERMS)
    problem = Problem(
        SYSTEM,
        parameters=(),
        start=Boundary("start", {name: exactly(value) for name, value in begin.items()}, TERMS),
        phases=(Phase("contract", uniform(intervals), exactly(duration), end),),
        objective=Objective(time=0.0, terminal={"utility": -1.0}),
        time_scale=duration,
    )
    states = np.full((State.size(), intervals + 1), 0.1)
    states[-1] = np.linspace(0.0, duration, intervals + 1)
    guess = Iterate(np.array([duration]), states, np.full((1, intervals), 0.1))
    value = Value("greatest utility", "1", "2.059511", "tests of CTDirect.jl", 1e-3, lambda s: -s.objective)
    return (KnownAnswer("insurance without audit", problem, guess, (value,)),)
