"""A Delta III launches the greatest mass into a transfer orbit (Benson 2005, Betts 2010): 7529.7123 kg at burnout.

Six of nine solid boosters burn beside the first stage, then the other three, then the first stage alone, then the
second stage until the orbit is reached. Between these phases what is empty is dropped: mass, thrust and flow of mass
are states that jump. SI units, axes fixed in space with z to the north. The direction of the thrust is told by two
angles that are linear over every interval.
"""

import math
from dataclasses import dataclass

import casadi as ca
import numpy as np
from statement import KnownAnswer, Value, exactly

from airrace.optimal_control.problem import Boundary, Iterate, Objective, Phase, Problem, uniform
from airrace.optimal_control.quantities import Interval, T, Vector, quantity, vector
from airrace.optimal_control.replay import integrate
from airrace.optimal_control.system import observation_of, of_first_states, system_of, with_linear_controls

mu, R_E, omega_E = 3.986012e14, 6378145.0, 7.29211585e-5  # m3/s2, m, rad/s
rho_0, h_r, S, C_D = 1.225, 7200.0, 4 * math.pi, 0.5  # kg/m3, m, m2, 1
TURN = 260.0  # s
STILL = 1e-3  # m/s
SITE = math.radians(28.5)  # latitude
PAYLOAD = 4164.0  # kg
SEMIMAJOR, ECCENTRICITY = 24361140.0, 0.7308  # m, 1
OMEGA, PERIGEE = math.radians(269.8), math.radians(130.5)  # node, argument of perigee; the inclination is the latitude


@dataclass(frozen=True)
class Motor:
    """`thrust` N, `mass` full and `propellant` kg, `burns` s."""

    thrust: float
    mass: float
    propellant: float
    burns: float

    @property
    def flow(self) -> float:
        return self.propellant / self.burns

    @property
    def empty(self) -> float:
        return self.mass - self.propellant


BOOSTER = Motor(628500.0, 19290.0, 17010.0, 75.2)
FIRST = Motor(1083100.0, 104380.0, 95550.0, 261.0)
SECOND = Motor(110094.0, 19300.0, 16820.0, 700.0)
STAGES = (  # boosters that burn, the stage that does, seconds, kilograms dropped at the end
    (6, FIRST, BOOSTER.burns, 6 * BOOSTER.empty),
    (3, FIRST, BOOSTER.burns, 3 * BOOSTER.empty),
    (0, FIRST, FIRST.burns - 2 * BOOSTER.burns, FIRST.empty),
    (0, SECOND, SECOND.burns, 0.0),
)
NAMES = ("six boosters", "three boosters", "first stage", "second stage")


@vector
class State(Vector[T]):
    x: T = quantity("m", scale=1e6)
    y: T = quantity("m", scale=1e6)
    z: T = quantity("m", scale=1e6)
    vx: T = quantity("m/s", scale=1e3)
    vy: T = quantity("m/s", scale=1e3)
    vz: T = quantity("m/s", scale=1e3)
    m: T = quantity("kg", scale=1e4)
    thrust: T = quantity("N", scale=1e6)
    flow: T = quantity("kg/s", scale=1e3)


@vector
class Direction(Vector[T]):
    elevation: T = quantity("rad", text="above the plane of the equator")
    azimuth: T = quantity("rad", text="from x towards y")


@vector
class Orbit(Vector[T]):
    """Five numbers that tell an orbit: its angular momentum, and its eccentricity towards perigee and across."""

    hx: T = quantity("m2/s", scale=1e10)
    hy: T = quantity("m2/s", scale=1e10)
    hz: T = quantity("m2/s", scale=1e10)
    along: T = quantity("1")
    across: T = quantity("1")


def norm(vector_: ca.SX) -> ca.SX:
    return ca.sqrt(ca.sumsqr(vector_))


def rates(state: State, control: Direction) -> State:
    r, v = ca.vertcat(state.x, state.y, state.z), ca.vertcat(state.vx, state.vy, state.vz)
    through_air = v - ca.vertcat(-omega_E * state.y, omega_E * state.x, 0.0)
    airspeed = ca.sqrt(ca.sumsqr(through_air) + STILL**2)  # at the launch it is zero, where the root has no slope
    drag = -0.5 * rho_0 * ca.exp((R_E - norm(r)) / h_r) * S * C_D * airspeed * through_air
    across = ca.cos(control.elevation)
    forwards = ca.vertcat(across * ca.cos(control.azimuth), across * ca.sin(control.azimuth), ca.sin(control.elevation))
    v_dot = -mu * r / norm(r) ** 3 + (state.thrust * forwards + drag) / state.m
    velocity, acceleration = ca.vertsplit(v), ca.vertsplit(v_dot)
    return State(
        **dict(zip(("x", "y", "z"), velocity, strict=True)),
        **dict(zip(("vx", "vy", "vz"), acceleration, strict=True)),
        m=-state.flow,
        thrust=0.0,
        flow=0.0,
    )


def target() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Directions to the perigee, ahead of it, and across the orbit."""
    (c_O, s_O), (c_i, s_i), (c_w, s_w) = ((math.cos(one), math.sin(one)) for one in (OMEGA, SITE, PERIGEE))
    to_node, ahead = np.array([c_O, s_O, 0.0]), np.array([-s_O * c_i, c_O * c_i, s_i])
    return c_w * to_node + s_w * ahead, c_w * ahead - s_w * to_node, np.cross(to_node, ahead)


def orbit(state: State) -> Orbit:
    """The orbit around the Earth if the thrust ended now."""
    r, v = ca.vertcat(state.x, state.y, state.z), ca.vertcat(state.vx, state.vy, state.vz)
    h = ca.cross(r, v)
    eccentricity = ca.cross(v, h) / mu - r / norm(r)
    perigee, ahead, _ = target()
    along, across = ca.dot(eccentricity, perigee), ca.dot(eccentricity, ahead)
    return Orbit(hx=h[0], hy=h[1], hz=h[2], along=along, across=across)


def reached() -> dict[str, float]:
    """The numbers of the orbit that is to be reached."""
    hx, hy, hz = math.sqrt(mu * SEMIMAJOR * (1 - ECCENTRICITY**2)) * target()[2]
    return {"hx": hx, "hy": hy, "hz": hz, "along": ECCENTRICITY, "across": 0.0}


ROCKET = system_of("Delta III", State, Direction, rates)
SYSTEM = with_linear_controls(ROCKET, seconds=100.0)
REACHED = of_first_states(observation_of("orbit", State, Orbit, orbit), SYSTEM)


def burning(stage: int) -> dict[str, float]:
    """Thrust and flow of mass during a phase."""
    boosters, motor, *_ = STAGES[stage]
    return {
        "thrust": boosters * BOOSTER.thrust + motor.thrust,
        "flow": boosters * BOOSTER.flow + motor.flow,
    }


def jump(stage: int) -> dict[str, float]:
    """What changes at the end of a phase."""
    before, after = burning(stage), burning(stage + 1)
    return {"m": -STAGES[stage][-1]} | {name: after[name] - before[name] for name in before}


def launch() -> dict[str, float]:
    """At rest on the turning Earth."""
    x = R_E * math.cos(SITE)
    mass = 9 * BOOSTER.mass + FIRST.mass + SECOND.mass + PAYLOAD
    place = {"x": x, "y": 0.0, "z": R_E * math.sin(SITE), "vx": 0.0, "vy": omega_E * x, "vz": 0.0}
    return place | {"m": mass} | burning(0)


def ascent(intervals: tuple[int, ...]) -> tuple[Problem, Iterate]:
    """The problem, and a flight that turns from the vertical to the east as a guess."""
    last = len(STAGES) - 1
    phases = tuple(
        Phase(
            name,
            uniform(count),
            Interval(100.0, seconds) if stage == last else exactly(seconds),
            Boundary("orbit", {name: exactly(value) for name, value in reached().items()}, REACHED)
            if stage == last
            else Boundary(f"end of {name}"),
            jump=jump(stage) if stage < last else {},
        )
        for stage, (name, count, (_, _, seconds, _)) in enumerate(zip(NAMES, intervals, STAGES, strict=True))
    )
    problem = Problem(
        SYSTEM,
        parameters=(),
        start=Boundary("launch", {name: exactly(value) for name, value in launch().items()}),
        phases=phases,
        objective=Objective(time=0.0, terminal={"m": -1e-3}),
        time_scale=100.0,
    )
    return problem, turning(problem)


def turning(problem: Problem) -> Iterate:
    """A flight whose thrust turns evenly from the vertical to the horizontal within TURN, in the plane to the east."""
    pole = np.cross([math.cos(SITE), 0.0, math.sin(SITE)], [0.0, 1.0, 0.0])

    def angles(t: float, x: np.ndarray) -> np.ndarray:
        turned = 0.5 * math.pi * min(t / TURN, 1.0)
        up = x[:3] / np.linalg.norm(x[:3])
        forwards = math.cos(turned) * up + math.sin(turned) * np.cross(pole, up)
        return np.array([math.asin(forwards[2]), math.atan2(forwards[1], forwards[0])])

    durations = np.array([STAGES[0][2], STAGES[1][2], STAGES[2][2], 660.0])
    x, t, columns = np.array(list(launch().values())), 0.0, []
    for stage, (phase, seconds) in enumerate(zip(problem.phases, durations, strict=True)):
        times = t + seconds * np.concatenate([[0.0], np.cumsum(phase.fractions)])
        flown = integrate(
            lambda t, x: np.asarray(ROCKET.rates(x, angles(t, x), [])).ravel(), x, times, relative=1e-6, absolute=1e-3
        )
        columns += [np.append(one, angles(time, one)) for one, time in zip(flown.T[:-1], times, strict=False)]
        x, t = flown[:, -1] + problem.jumps[:9, stage], t + seconds
    columns.append(np.append(x, angles(t, x)))
    state = np.array(columns).T
    steps = np.concatenate([np.array(one.fractions) * T for one, T in zip(problem.phases, durations, strict=True)])
    return Iterate(durations, state, np.diff(state[9:], axis=1) / steps)


def known_answers() -> tuple[KnownAnswer, ...]:
    problem, guess = ascent((10, 10, 10, 20))
    mass = Value("greatest mass", "kg", "7529.7123", "Benson 2005", 0.01, lambda solution: -1e3 * solution.objective)
    return (KnownAnswer("Delta III ascent", problem, guess, (mass,)),)
