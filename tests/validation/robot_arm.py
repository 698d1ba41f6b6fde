"""A robot arm of variable length turns from rest to rest in least time: COPS 3 gives 9.1409."""

import casadi as ca
import numpy as np
from statement import KnownAnswer, Value, exactly, objective

from airrace.optimal_control.problem import Boundary, Iterate, Phase, Problem, uniform
from airrace.optimal_control.quantities import Interval, T, Vector, quantity, vector
from airrace.optimal_control.system import system_of

L, theta_end = 5.0, 2.0 * np.pi / 3.0


@vector
class State(Vector[T]):
    rho: T = quantity("m", lower=0.0, upper=L)
    theta: T = quantity("rad", lower=-np.pi, upper=np.pi)
    phi: T = quantity("rad", lower=0.0, upper=np.pi)
    rho_dot: T = quantity("m/s")
    theta_dot: T = quantity("rad/s")
    phi_dot: T = quantity("rad/s")


@vector
class Torque(Vector[T]):
    u_rho: T = quantity("1", lower=-1.0, upper=1.0)
    u_theta: T = quantity("1", lower=-1.0, upper=1.0)
    u_phi: T = quantity("1", lower=-1.0, upper=1.0)


def rates(state: State, control: Torque) -> State:
    inertia = ((L - state.rho) ** 3 + state.rho**3) / 3.0
    return State(
        rho=state.rho_dot,
        theta=state.theta_dot,
        phi=state.phi_dot,
        rho_dot=control.u_rho / L,
        theta_dot=control.u_theta / (inertia * ca.sin(state.phi) ** 2),
        phi_dot=control.u_phi / inertia,
    )


SYSTEM = system_of("robot-arm", State, Torque, rates)


def known_answers() -> tuple[KnownAnswer, ...]:
    intervals = 100
    rest = {"rho": 4.5, "phi": np.pi / 4.0, "rho_dot": 0.0, "theta_dot": 0.0, "phi_dot": 0.0}
    at_rest = {name: exactly(value) for name, value in rest.items()}
    end = Boundary(bounds=at_rest | {"theta": exactly(theta_end)})
    problem = Problem(
        SYSTEM,
        parameters=(),
        start=Boundary(bounds=at_rest | {"theta": exactly(0.0)}),
        phases=(Phase("turn", uniform(intervals), Interval(0.1, 100.0), end),),
    )
    k = np.linspace(0.0, 1.0, intervals + 1)
    values = rest | {"theta": theta_end * k**2, "theta_dot": 2.0 * theta_end * k}
    states = np.array([np.broadcast_to(values[name], k.shape) for name in State.names()])
    guess = Iterate(np.array([1.0]), states, np.zeros((3, intervals)))
    value = Value("least time", "1", "9.1409", "COPS 3, Dolan, More & Munson 2004", 3e-3, objective)
    return (KnownAnswer("robot arm", problem, guess, (value,)),)
