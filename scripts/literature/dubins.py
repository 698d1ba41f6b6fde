"""The shortest path of bounded curvature between two headings: a turn, a straight, a turn (Dubins 1957)."""

import math

import casadi as ca
from benchmark import Benchmark

from airrace.optimal_control import Interval, Phase, Quantity, at, define_problem, initial_guess, uniform

ASIDE, AHEAD = 4.0, 3.0


def shortest() -> float:
    """Left, straight, left from (0, 0) heading along x to (3, 4) heading against it."""
    across, up = AHEAD, ASIDE - 2.0  # from one centre of a turn to the other
    straight = math.hypot(across, up)
    return math.pi + straight  # both turns together are half a circle


def benchmarks() -> tuple[Benchmark, ...]:
    turn = {"u": Interval(-1.0, 1.0)}
    ends = [at(), at(), at("end", x=AHEAD, y=ASIDE, psi=math.pi)]
    problem = define_problem(
        "Dubins's car",
        lambda x, u: {"x": ca.cos(x.psi), "y": ca.sin(x.psi), "psi": u.u},
        states=[Quantity("x", "1", 3.0), Quantity("y", "1", 3.0), Quantity("psi", "rad", 3.0)],
        controls=[Quantity("u", "1", lower=-1.0, upper=1.0)],
        start=at(x=0.0, y=0.0, psi=0.0),
        phases=[
            Phase(name, uniform(10), Interval(0.05, 10.0), end, bounds=turn)
            for name, end in zip(("turn", "straight", "turn back"), ends, strict=True)
        ],
    )
    guess = initial_guess(
        problem, [1.0, 3.0, 2.0], psi=[0.0, 0.7, 0.7, math.pi], x=[0.0, 1.0, 3.0, 3.0], y=[0.0, 0.5, 2.0, 4.0]
    )
    return (
        Benchmark("Dubins's car", problem, f"{shortest():.7f}", "Dubins 1957", "multi-phase", guess, closed_form=True),
    )
