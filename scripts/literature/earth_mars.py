"""The largest orbit that a small thrust reaches from Earth's in 193 days (Bryson & Ho 1975, 2.5)."""

import math

import casadi as ca
from benchmark import Benchmark, fixed_time

from airrace.optimal_control import Quantity, at, define_problem, initial_guess

THRUST, FLOW, SECONDS = 0.1405, 0.0749, 3.32


def rates(x, u):
    push = THRUST / (1.0 - FLOW * x.t)
    return {
        "t": 1.0,
        "r": x.v_r,
        "v_r": x.v_t**2 / x.r - 1.0 / x.r**2 + push * ca.sin(u.angle),
        "v_t": -x.v_r * x.v_t / x.r + push * ca.cos(u.angle),
    }


def benchmarks() -> tuple[Benchmark, ...]:
    problem = define_problem(
        "Earth to Mars",
        rates,
        states=[Quantity("t", "1"), Quantity("r", "1", lower=0.5), Quantity("v_r", "1"), Quantity("v_t", "1")],
        controls=[Quantity("angle", "rad", 3.0)],
        outputs={Quantity("too_fast", "1"): lambda x, u: x.v_t - 1.0 / ca.sqrt(x.r)},
        start=at(t=0.0, r=1.0, v_r=0.0, v_t=1.0),
        phases=fixed_time(SECONDS, 100, v_r=0.0, too_fast=0.0),
        end_cost=lambda ends: -ends[-1].r,
    )
    half = [math.pi / 4.0 if row < 50 else 1.75 * math.pi for row in range(100)]
    guess = initial_guess(problem, r=[1.0, 1.5], v_t=[1.0, 0.8], angle=half)
    source = "Bryson & Ho 1975: 1.525"
    return (Benchmark("Earth to Mars", problem, "1.525", source, guess=guess, maximum=True, tolerance=1e-3),)
