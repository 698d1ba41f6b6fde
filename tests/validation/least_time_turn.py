"""Least time to a quadrant for a vehicle of constant speed that turns at 2 rad/s at most: Jennings's problem 1 [1990].

A circle, and the straight line that leaves it towards the corner of the quadrant.
"""

import math

import casadi as ca
from statement import KnownAnswer, Value, objective

from airrace.optimal_control import (
    Boundary,
    Interval,
    Iterate,
    Phase,
    Problem,
    Quantity,
    at,
    define_problem,
    initial_guess,
    uniform,
)
from airrace.optimal_control.runge_kutta import VERNER_7

LEAST_TIME = math.sqrt(12.0) + (math.pi - math.acos(1.0 / 7.0)) / 2.0
SWITCH = LEAST_TIME - math.sqrt(12.0)  # s, from the circle to the line
END = at("quadrant", x2=(None, 0.0), x3=(None, 0.0))


def turn(*phases: Phase) -> Problem:
    return define_problem(
        "least time turn",
        lambda x, u: {"x1": u.u, "x2": ca.cos(x.x1), "x3": ca.sin(x.x1)},
        states=[Quantity("x1", "rad"), Quantity("x2", "m", 4.0), Quantity("x3", "m", 4.0)],
        controls=[Quantity("u", "rad/s", 2.0, lower=-2.0, upper=2.0)],
        start=at(x1=math.pi / 2.0, x2=4.0, x3=0.0),
        phases=phases,
        scheme=VERNER_7,
    )


def in_one_phase(intervals: int) -> Problem:
    """On equal intervals, over which the control is held: slower than the optimum, unless a node is at the switch."""
    return turn(Phase("whole", uniform(intervals), Interval(0.1, 20.0), END))


def in_arcs(intervals: int) -> Problem:
    """The circle and the line, whose controls are known."""
    arcs = (("circle", 2.0, Boundary()), ("line", 0.0, END))
    return turn(
        *(
            Phase(name, uniform(intervals), Interval(0.01, 20.0), end, bounds={"u": Interval.exactly(u)})
            for name, u, end in arcs
        )
    )


def standing_guess(problem: Problem) -> Iterate:
    """Straight on for a second, away from where the vehicle has to go."""
    return initial_guess(problem, [1.0 / len(problem.phases)] * len(problem.phases), x1=math.pi / 2.0, u=0.0)


def known_answers() -> tuple[KnownAnswer, ...]:
    problem = in_arcs(4)
    time = Value("least time", "s", f"{LEAST_TIME:.10f}", "closed form", 1e-8, objective, closed_form=True)
    switch = Value(
        "its switch",
        "s",
        f"{SWITCH:.10f}",
        "closed form",
        1e-8,
        lambda s: float(s.iterate.durations[0]),
        closed_form=True,
    )
    return (KnownAnswer("least time turn", problem, initial_guess(problem), (time, switch)),)
