"""A hang glider flies as far as it can through a thermal (Bulirsch, Nerz, Pesch & von Stryk 1993): 1248.03 m."""

import casadi as ca
from statement import KnownAnswer, Value, exactly

from airrace.optimal_control.problem import Boundary, Objective, Phase, Problem, corners, interpolate, uniform
from airrace.optimal_control.quantities import Interval, T, Vector, quantity, vector
from airrace.optimal_control.system import system_of

m, g, S, rho = 100.0, 9.80665, 14.0, 1.13


@vector
class State(Vector[T]):
    x: T = quantity("m", scale=1000.0, lower=0.0)
    y: T = quantity("m", scale=1000.0, lower=0.0)
    vx: T = quantity("m/s", scale=10.0, lower=0.0)
    vy: T = quantity("m/s", scale=10.0)
    C_L: T = quantity("1", lower=0.0, upper=1.4)


@vector
class LiftRate(Vector[T]):
    C_L_dot: T = quantity("1/s", scale=0.1)


def rates(state: State, control: LiftRate) -> State:
    X = (state.x / 100 - 2.5) ** 2
    updraught = 2.5 * (1 - X) * ca.exp(-X)
    Vy = state.vy - updraught
    vr = ca.sqrt(state.vx**2 + Vy**2)
    qbar_S = 0.5 * rho * S * vr**2
    L, D = state.C_L * qbar_S, (0.034 + 0.069662 * state.C_L**2) * qbar_S
    return State(
        x=state.vx,
        y=state.vy,
        vx=(-L * Vy / vr - D * state.vx / vr) / m,
        vy=(L * state.vx / vr - D * Vy / vr) / m - g,
        C_L=control.C_L_dot,
    )


SYSTEM = system_of("hang-glider", State, LiftRate, rates)


def known_answers() -> tuple[KnownAnswer, ...]:
    velocity = {"vx": 13.2275675, "vy": -1.28750052}
    held = {name: exactly(value) for name, value in velocity.items()}
    problem = Problem(
        SYSTEM,
        parameters=(),
        start=Boundary(bounds={"x": exactly(0.0), "y": exactly(1000.0)} | held),
        phases=(Phase("glide", uniform(200), Interval(10.0, 200.0), Boundary(bounds={"y": exactly(900.0)} | held)),),
        objective=Objective(time=0.0, terminal={"x": -1.0}),
        time_scale=100.0,
    )
    states = corners(State(x=0.0, y=1000.0, C_L=1.0, **velocity), State(x=1250.0, y=900.0, C_L=1.0, **velocity))
    guess = interpolate(problem, [100.0], states, [0.0])
    source = "Bulirsch, Nerz, Pesch & von Stryk 1993"
    reached = Value("greatest range", "m", "1248.03", source, 0.005, lambda solution: -solution.objective)
    time = Value("its time", "s", "98.44", source, 0.005, lambda solution: float(solution.iterate.durations[0]))
    return (KnownAnswer("hang glider in a thermal", problem, guess, (reached, time)),)
