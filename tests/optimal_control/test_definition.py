"""Problems stated in one call: parameters, integral costs, and costs of the ends of several phases."""

import math
from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest
from own_problems import carried_mass, two_seconds

from airrace.optimal_control import (
    Interval,
    Phase,
    Problem,
    Quantity,
    at,
    define_problem,
    initial_guess,
    solve,
    uniform,
)


def test_integral_cost_has_the_closed_form() -> None:
    solution = solve(carried_mass())
    held = 12.0 / (1.0 - 1.0 / 40**2)  # on 40 intervals of held forces
    assert solution.objective == pytest.approx(held, rel=1e-6)
    assert solution.state("integral_cost")[[0, -1]] == pytest.approx([0.0, held], rel=1e-6)


def test_a_cost_sees_the_ends_of_several_phases() -> None:
    solution = solve(two_seconds())
    assert solution.success, solution.status
    assert solution.objective == pytest.approx(2.0, abs=1e-6)
    assert solution.state("x")[[2, 4]] == pytest.approx([1.0, 1.0], abs=1e-6)


def test_a_cost_sees_the_start_and_the_clock() -> None:
    problem = define_problem(
        "waiting",
        lambda x, u: {"x": u.u},
        states=[Quantity("x", "m")],
        controls=[Quantity("u", "m/s", lower=-1.0, upper=1.0)],
        start=at(x=(-5.0, 5.0)),
        phases=[Phase("a", uniform(2), Interval(0.1, 5.0)), Phase("b", uniform(2), Interval(0.1, 5.0), at(x=3.0))],
        end_cost=lambda ends: (ends[0].x - 1.0) ** 2 + (ends[1].clock - 0.7) ** 2 + (ends[2].clock - 2.5) ** 2,
    )
    solution = solve(problem)
    assert solution.success, solution.status
    assert solution.objective == pytest.approx(0.0, abs=1e-6)
    assert solution.state("x")[0] == pytest.approx(1.0, abs=1e-3)
    assert solution.durations == pytest.approx({"a": 0.7, "b": 1.8}, abs=1e-3)


def test_a_parameter_is_optimised() -> None:
    """The angle at which a ball flies farthest is 45 degrees."""
    problem = define_problem(
        "thrown ball",
        lambda x, u: {"x": 10.0 * ca.cos(x.angle), "y": 10.0 * ca.sin(x.angle) - 9.81 * x.t, "t": 1.0},
        states=[Quantity("x", "m", 10.0), Quantity("y", "m", 10.0, lower=0.0), Quantity("t", "s")],
        parameters=[Quantity("angle", "rad", lower=0.1, upper=1.5)],
        start=at(x=0.0, y=0.0, t=0.0),
        phases=[Phase("flight", uniform(10), Interval(0.5, 3.0), at(y=0.0))],
        end_cost=lambda ends: -ends[-1].x + (ends[0].angle - ends[-1].angle) ** 2,
    )
    solution = solve(problem)
    assert solution.success, solution.status
    assert solution.parameter("angle") == pytest.approx(math.pi / 4.0, abs=1e-5)
    assert solution.objective == pytest.approx(-100.0 / 9.81, rel=1e-7)
    with pytest.raises(KeyError, match="changes"):
        solution.parameter("x")


def test_outputs_are_limited_along_the_path_and_at_boundaries() -> None:
    def problem(distance: float) -> Problem:
        return define_problem(
            "round a pillar",
            lambda x, u: {"x": ca.cos(u.heading), "y": ca.sin(u.heading)},
            states=[Quantity("x", "m"), Quantity("y", "m")],
            controls=[Quantity("heading", "rad", lower=-1.5, upper=1.5)],
            outputs={
                Quantity("away", "m2", lower=1.0): lambda x, u: x.x**2 + x.y**2,
                Quantity("height", "m"): lambda x, u: x.y - 0.1,
            },
            start=at(x=-2.0, y=0.0),
            phases=[Phase("pass", uniform(60), Interval(1.0, 20.0), at(x=distance, height=(-0.1, 0.0)))],
        )

    stated = problem(2.0)
    solution = solve(stated, initial_guess(stated, y=np.sin(np.linspace(0.0, math.pi, 61))))
    assert solution.success, solution.status
    # two tangents and the arc between them; the second may end a little higher than it began
    assert solution.objective < 2.0 * math.sqrt(3.0) + math.pi / 3.0
    assert solution.output("away").min() > 1.0 - 1e-6
    assert solution.output("height")[-1] == pytest.approx(0.0, abs=1e-6)
    assert (solution.multiplier("away") < 1e-6).all()  # a lower limit
    assert solution.multiplier("height")[-1] > 0.0  # an upper one


def stated(**changed: object) -> Problem:
    arguments: dict[str, object] = {
        "rates": lambda x, u: {"x": u.u},
        "states": [Quantity("x", "m")],
        "controls": [Quantity("u", "m/s", lower=-1.0, upper=1.0)],
        "start": at(x=0.0),
        "phases": [Phase("only", uniform(3), Interval(0.1, 5.0), at(x=1.0))],
    }
    arguments |= changed
    return define_problem("stated", **arguments)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rates": lambda x, u: {}}, "have none of x"),
        ({"rates": lambda x, u: {"x": u.u, "y": 0.0}}, "y, which are no states"),
        ({"rates": lambda x, u: [u.u]}, "no dictionary"),
        ({"start": at(y=0.0)}, "boundary 'the start' bounds unknown quantities: y"),
        ({"scheme": "rk9"}, "the scheme is 'rk9'; give DORMAND_PRINCE_5"),
        ({"phases": [Phase("only", 20, Interval(0.1, 5.0))]}, "is 20; give fractions, as uniform"),
        ({"states": [Quantity("integral_cost", "m")], "rates": lambda x, u: {"integral_cost": u.u}}, "call yours"),
        ({"outputs": {Quantity("out", "1"): lambda x, u: u.u}, "start": at(out=0.0)}, "depends on controls"),
        ({"controls": [Quantity("x", "m/s")], "rates": lambda x, u: {"x": u.x}}, "declares twice: x"),
    ],
)
def test_what_is_misstated_is_refused_by_name(change: dict[str, object], message: str) -> None:
    if "call yours" in message:
        change = change | {"integral_cost": lambda x, u: u.u**2}
    with pytest.raises(ValueError, match=message):
        stated(**change)


def test_an_equation_of_something_unknown_says_what_there_is() -> None:
    with pytest.raises(AttributeError, match="there is no 'v' here, only x"):
        stated(rates=lambda x, u: {"x": x.v})


def test_ranges_are_values_pairs_or_intervals() -> None:
    boundary = at("gate", a=1.0, b=(None, 2.0), c=Interval(0.0, 3.0))
    assert boundary.name == "gate"
    assert dict(boundary.bounds) == {"a": Interval(1.0, 1.0), "b": Interval(-math.inf, 2.0), "c": Interval(0.0, 3.0)}


def test_a_guess_goes_straight_between_what_is_asked() -> None:
    problem = carried_mass(distance=4.0, intervals=4)
    guess = initial_guess(problem)
    assert guess.state[0].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert guess.durations.tolist() == [1.0]
    better = initial_guess(problem, x=[0.0, 8.0], v=2.0, f=[1.0, 2.0, 3.0, 4.0])
    assert better.state[0].tolist() == [0.0, 2.0, 4.0, 6.0, 8.0]
    assert better.control[0].tolist() == [1.0, 2.0, 3.0, 4.0]
    assert (better.state[1] == 2.0).all()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"q": 1.0}, "no states or controls are called q; there are x, v"),
        ({"x": [1.0, 2.0, 3.0]}, "3 values of x are given; one is asked for, or 41"),
        ({"f": [1.0, 2.0]}, "2 values of f are given; one is asked for, or 40"),
        ({"durations": [1.0, 2.0]}, "2 durations are given, and the problem has 1 phases"),
    ],
)
def test_a_guess_that_does_not_fit_is_refused(arguments: dict[str, object], message: str) -> None:
    make: Callable[..., object] = initial_guess
    with pytest.raises(ValueError, match=message):
        make(carried_mass(), **arguments)
