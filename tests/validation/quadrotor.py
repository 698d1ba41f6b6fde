"""A quadrotor with limited tilt and tilt rates flies 5 m to the side in least time: CTDirect.jl gives 1.492."""

import casadi as ca
import numpy as np
from statement import KnownAnswer, Value, exactly, objective

from airrace.optimal_control.problem import Boundary, Objective, Phase, Problem, corners, interpolate, uniform
from airrace.optimal_control.quantities import Interval, T, Vector, quantity, vector
from airrace.optimal_control.system import system_of

g, tilt_max, tilt_rate_max = 9.81, 0.55, 3.0


@vector
class State(Vector[T]):
    x: T = quantity("m", scale=5.0)
    y: T = quantity("m", scale=5.0)
    z: T = quantity("m", scale=5.0)
    vx: T = quantity("m/s", scale=5.0)
    vy: T = quantity("m/s", scale=5.0)
    vz: T = quantity("m/s", scale=5.0)
    phi: T = quantity("rad", lower=-np.pi / 2, upper=np.pi / 2)
    theta: T = quantity("rad", lower=-np.pi / 2, upper=np.pi / 2)
    penalty: T = quantity("s")


@vector
class Control(Vector[T]):
    a: T = quantity("m/s2", scale=10.0, lower=0.0, upper=5.0 * 9.18)
    phi_dot: T = quantity("rad/s", lower=-tilt_rate_max, upper=tilt_rate_max)
    theta_dot: T = quantity("rad/s", lower=-tilt_rate_max, upper=tilt_rate_max)
    psi: T = quantity("rad")


@vector
class Tilt(Vector[T]):
    cosine: T = quantity("1", lower=float(np.cos(tilt_max)))


def rates(state: State, control: Control) -> State:
    (c_r, s_r), (c_p, s_p) = ((ca.cos(angle), ca.sin(angle)) for angle in (state.phi, state.theta))
    c_y, s_y = ca.cos(control.psi), ca.sin(control.psi)
    angles = state.phi**2 + state.theta**2 + control.psi**2
    return State(
        x=state.vx,
        y=state.vy,
        z=state.vz,
        vx=control.a * (c_y * s_p * c_r + s_y * s_r),
        vy=control.a * (s_y * s_p * c_r - c_y * s_r),
        vz=control.a * c_p * c_r - g,
        phi=control.phi_dot,
        theta=control.theta_dot,
        penalty=1e-8 * (angles + control.a**2) + 1e2 * control.psi**2,
    )


SYSTEM = system_of(
    "quadrotor", State, Control, rates, Path=Tilt, path=lambda x, u: Tilt(cosine=ca.cos(x.theta) * ca.cos(x.phi))
)


def known_answers() -> tuple[KnownAnswer, ...]:
    begin = dict.fromkeys(State.names(), 0.0) | {"z": 2.5}
    target = {"x": 0.01, "y": 5.0, "z": 2.5, "vx": 0.0, "vy": 0.0, "vz": 0.0}
    end = Boundary(bounds={name: exactly(value) for name, value in target.items()})
    problem = Problem(
        SYSTEM,
        parameters=(),
        start=Boundary(bounds={name: exactly(value) for name, value in begin.items()}),
        phases=(Phase("flight", uniform(100), Interval(0.1, 20.0), end),),
        objective=Objective(time=1.0, terminal={"penalty": 1.0}),
    )
    states = corners(State(**begin), State(**(begin | target)))
    guess = interpolate(problem, [1.0], states, [10.0, 0.0, 0.0, 0.0])
    value = Value("least time", "s", "1.492", "tests of CTDirect.jl", 2e-3, objective)
    return (KnownAnswer("quadrotor", problem, guess, (value,)),)
