"""A rocket on rails in least time below a limit of speed, in units of its own: push, hold the speed, brake.

The problem of ACADO's and GEKKO's tutorials, whose arcs a test integrates one after the other. Flights whose thrust
alternates at the end of the hold are a little faster on very fine meshes: they burn fuel, and a lighter rocket brakes
sooner.
"""

from statement import KnownAnswer, Value, objective

from airrace.optimal_control import (
    Boundary,
    Interval,
    Phase,
    Problem,
    Quantity,
    at,
    define_problem,
    initial_guess,
    uniform,
)
from airrace.optimal_control.runge_kutta import VERNER_7
from airrace.optimal_control.solvers.interface import SolverOptions

SPEED_MAX, THRUST_MAX, DRAG = 1.7, 1.1, 0.2
HOLD = DRAG * SPEED_MAX**2
END = at("end", s=10.0, v=0.0)


def rocket(*phases: Phase) -> Problem:
    return define_problem(
        "rocket below a limit of speed",
        lambda x, u: {"s": x.v, "v": (u.thrust - DRAG * x.v**2) / x.m, "m": -0.01 * u.thrust**2},
        states=[
            Quantity("s", "m", 10.0),
            Quantity("v", "m/s", lower=0.0, upper=SPEED_MAX),
            Quantity("m", "kg", lower=0.1),
        ],
        controls=[Quantity("thrust", "N", lower=-THRUST_MAX, upper=THRUST_MAX)],
        start=at(s=0.0, v=0.0, m=1.0),
        phases=phases,
        scheme=VERNER_7,
    )


def in_one_phase(intervals: int, duration_min: float) -> Problem:
    return rocket(Phase("whole", uniform(intervals), Interval(duration_min, 15.0), END))


def in_arcs(intervals: int, duration_min: float) -> Problem:
    """Push, hold and brake; what holds and brakes is known, the push is left to the solver."""
    at_limit = at(v=SPEED_MAX)
    arcs: tuple[tuple[str, Interval, Boundary], ...] = (
        ("push", Interval(), at_limit),
        ("hold", Interval.exactly(HOLD), Boundary()),
        ("brake", Interval.exactly(-THRUST_MAX), END),
    )
    return rocket(
        *(
            Phase(name, uniform(intervals), Interval(duration_min, 15.0), end, bounds={"thrust": thrust})
            for name, thrust, end in arcs
        )
    )


def known_answers() -> tuple[KnownAnswer, ...]:
    problem = in_arcs(10, 0.5)
    source = "its arcs, integrated"
    durations = (("push", "1.933893517"), ("hold", "4.208286835"), ("brake", "1.276810550"))
    values = (
        Value("least time", "s", "7.418990902", source, 5e-9, objective),
        *(
            Value(f"its {name}", "s", text, source, 5e-9, lambda s, row=row: float(s.iterate.durations[row]))
            for row, (name, text) in enumerate(durations)
        ),
        Value("its final mass", "kg", "0.947091268", source, 5e-9, lambda s: float(s.iterate.state[2, -1])),
    )
    options = SolverOptions(tolerance=1e-10)
    return (KnownAnswer("rocket below a limit of speed", problem, initial_guess(problem), values, options),)
