"""Small problems stated by `define_problem`, with answers in closed form."""

from airrace.optimal_control import Interval, Phase, Problem, Quantity, at, define_problem, uniform


def carried_mass(distance: float = 1.0, seconds: float = 1.0, intervals: int = 40, speed_max: float = 9.0) -> Problem:
    """From rest to rest with the least integral of the squared force: 12 d^2 / t^3, where speed is not limited."""
    return define_problem(
        "carried mass",
        lambda x, u: {"x": x.v, "v": u.f},
        states=[Quantity("x", "m"), Quantity("v", "m/s", upper=speed_max)],
        controls=[Quantity("f", "m/s2", 5.0)],
        start=at(x=0.0, v=0.0),
        phases=[Phase("carry", uniform(intervals), Interval.exactly(seconds), at(x=distance, v=0.0))],
        integral_cost=lambda x, u: u.f**2,
    )


def two_seconds(**ends: float) -> Problem:
    """Two phases of a second each: minimise u^2 + (x(1) - 2)^2 + (x(2) - 1)^2, whose answer is 2 with x = 1, 1."""
    return define_problem(
        "two seconds",
        lambda x, u: {"x": u.u},
        states=[Quantity("x", "m")],
        controls=[Quantity("u", "m/s")],
        start=at(x=0.0),
        phases=[
            Phase("first", uniform(2), Interval.exactly(1.0)),
            Phase("second", uniform(2), Interval.exactly(1.0), at(**ends)),
        ],
        integral_cost=lambda x, u: u.u**2,
        end_cost=lambda ends: (ends[1].x - 2.0) ** 2 + (ends[2].x - 1.0) ** 2,
    )
