"""A ship crosses a shear current in least time (Zermelo; Bryson & Ho 1975, 2.7): tan(heading) is linear in time.

The headings at the ends are theirs, 105 and 240 degrees; where the ship begins follows from them.
"""

import math

import casadi as ca
from benchmark import Benchmark, free_time

from airrace.optimal_control import Quantity, at, define_problem, initial_guess

BEGIN, END = math.radians(105.0), math.radians(240.0)


def place() -> tuple[float, float]:
    """Where the ship begins, of the closed form: (3.66, -1.86) after rounding."""
    tangent, secant = math.tan, lambda angle: 1.0 / math.cos(angle)
    y = secant(BEGIN) - secant(END)
    rest = secant(END) * (tangent(END) - tangent(BEGIN)) - tangent(BEGIN) * (secant(END) - secant(BEGIN))
    logarithm = math.log((tangent(END) + secant(END)) / (tangent(BEGIN) + secant(BEGIN)))
    return 0.5 * (rest + logarithm), -y


def benchmarks() -> tuple[Benchmark, ...]:
    x, y = place()
    problem = define_problem(
        "Zermelo's ship",
        lambda x, u: {"x": ca.cos(u.heading) - x.y, "y": ca.sin(u.heading)},
        states=[Quantity("x", "1", 3.0), Quantity("y", "1", 3.0)],
        controls=[Quantity("heading", "rad", 2.0)],
        start=at(x=x, y=y),
        phases=free_time(1.0, 20.0, 100, x=0.0, y=0.0),
    )
    heading = [BEGIN + (END - BEGIN) * (row + 0.5) / 100.0 for row in range(100)]
    published = f"{math.tan(END) - math.tan(BEGIN):.7f}"
    guess = initial_guess(problem, [6.0], heading=heading)
    return (Benchmark("Zermelo's ship", problem, published, "Bryson & Ho 1975, 2.7", guess=guess, closed_form=True),)
