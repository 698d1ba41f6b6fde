"""Small problems without meaning that together use every part of the problem language."""

from collections.abc import Mapping
from dataclasses import replace

import casadi as ca
import numpy as np

from airrace.optimal_control.layout import Layout
from airrace.optimal_control.problem import (
    Boundary,
    Iterate,
    Objective,
    PathConstraint,
    Phase,
    Problem,
    StartCost,
    uniform,
)
from airrace.optimal_control.quantities import Interval, Quantity
from airrace.optimal_control.system import Observation, System


def rich_system() -> System:
    """Three states, two controls, two parameters; path quantities with and without controls; a projection."""
    x, u, p = ca.SX.sym("x", 3), ca.SX.sym("u", 2), ca.SX.sym("p", 2)
    (a, b, c), (s, t), (k, m) = ca.vertsplit(x), ca.vertsplit(u), ca.vertsplit(p)
    rates = [b * ca.cos(c) + k * s, m * ca.sin(a) - b * t, s * t + 0.1 * a * c]
    path = [a * b + s * s * k, ca.sin(c) * a * m]
    return System(
        name="rich",
        states=(Quantity("a", "m", 2.0, -9.0, 9.0), Quantity("b", "m/s", 0.5), Quantity("c", "rad", 3.0)),
        controls=(Quantity("s", "m/s2", 4.0, -2.0, 2.0), Quantity("t", "1/s", 0.25)),
        parameters=(Quantity("k", "1"), Quantity("m", "1")),
        rates=ca.Function("rates", [x, u, p], [ca.vertcat(*rates)]),
        path=(Quantity("load", "1", 5.0, -3.0, 8.0), Quantity("height", "m", 0.3, -4.0)),
        path_values=ca.Function("path", [x, u, p], [ca.vertcat(*path)]),
        projection=ca.Function("project", [x], [ca.vertcat(a, b, ca.sin(c))]),
    )


def gate() -> Observation:
    """Two quantities of two states, as seen from a place with two numbers."""
    x, place = ca.SX.sym("x", 3), ca.SX.sym("place", 2)
    values = ca.vertcat((x[0] - place[0]) ** 2 + ca.sin(x[2]), x[0] * x[2] * place[1])
    quantities = (Quantity("distance", "m", 3.0, text="distance from the gate"), Quantity("lean", "m rad", 0.2))
    parameters = (Quantity("place", "m"), Quantity("slope", "1"))
    return Observation("gate", quantities, parameters, ca.Function("gate", [x, place], [values]))


def pylon() -> Observation:
    """One quantity of all states, one number."""
    x, place = ca.SX.sym("x", 3), ca.SX.sym("place", 1)
    values = ca.Function("pylon", [x, place], [ca.exp(0.1 * x[0]) * x[1] - place * x[2]])
    return Observation("pylon", (Quantity("clearance", "m", 7.0),), (Quantity("side", "1"),), values)


def rich_problem() -> Problem:
    """Three phases with uneven meshes, observations of two kinds at four boundaries, a bounded state at one of them.

    Two phases have path constraints: one goes on from the first to the second, another begins there.
    """
    seen, near = Interval(-6.0, 6.0), {"distance": Interval(upper=9.0), "lean": Interval(-1.0, 1.0)}
    gates, pylons = gate(), pylon()
    lasting = PathConstraint("lasting", {"distance": Interval(-7.0, 9.5)}, gates, (0.1, 0.9))
    begun = PathConstraint("begun", {"clearance": Interval(lower=-20.0)}, pylons, (0.2,))
    return Problem(
        rich_system(),
        parameters=(0.7, -0.4),
        start=Boundary("start", {"a": Interval.exactly(0.5), "lean": seen}, gates, (0.3, 1.2)),
        phases=(
            Phase(
                "one",
                (0.2, 0.5, 0.3),
                Interval(0.1, 3.0),
                Boundary("first", {"clearance": seen}, pylons, (0.6,)),
                path_constraints=(lasting,),
            ),
            Phase(
                "two",
                (0.6, 0.4),
                Interval(0.2, 2.0),
                Boundary("second", near, gates, (-0.2, 0.4)),
                bounds={"load": Interval(-1.0, 2.0), "b": Interval(-2.0, 2.0), "s": Interval(-1.0, 1.0)},
                path_constraints=(lasting, begun),
            ),
            Phase("three", (1.0,), Interval(0.1, 1.0), Boundary("finish", {"clearance": seen}, pylons, (-0.3,))),
        ),
        objective=Objective(time=0.8, terminal={"b": -0.3, "c": 0.2}, regularisation={"b": 0.3, "s": 0.05, "t": 0.4}),
        time_scale=0.7,
    )


def staged_problem() -> Problem:
    """The rich problem with a jump at the end of each of its phases but the last, of some states only."""
    problem = rich_problem()
    first, second, third = problem.phases
    end = replace(second.end, bounds={**second.end.bounds, "b": Interval(-1.5, 1.5)})
    phases = (replace(first, jump={"a": -0.3, "c": 0.2}), replace(second, end=end, jump={"b": 0.4}), third)
    return replace(problem, phases=phases)


def ended_problem() -> Problem:
    """The rich problem with jumps and with costs of the states at both ends that are curved in all of them."""
    x, b = ca.SX.sym("x", 3), ca.SX.sym("b", 1)
    values = ca.vertcat(ca.exp(0.3 * x[0]) * x[1] - b * x[2] ** 2, ca.sin(x[0] * x[2]))
    quantities = (Quantity("effort", "1", 4.0), Quantity("swing", "1"), Quantity("idle", "1"))
    seen = ca.Function("ended", [x, b], [ca.vertcat(values, x[1])])
    ending = Observation("ending", quantities, (Quantity("b", "1"),), seen)
    problem = staged_problem()
    terminal = {**problem.objective.terminal, "effort": 0.6, "swing": -0.4}
    start = StartCost({"effort": -0.5, "idle": 0.2}, ending, (0.4,))
    objective = replace(problem.objective, terminal=terminal, observation=ending, values=(0.7,), start=start)
    return replace(problem, objective=objective)


def _modest(states: int, controls: int, path: int) -> Problem:
    """Two phases of a system with few states, controls and path quantities, without observations."""
    x, u, p = ca.SX.sym("x", states), ca.SX.sym("u", controls), ca.SX.sym("p", 0)
    total = ca.sum1(u) + ca.sum1(ca.sin(x))
    system = System(
        name="modest",
        states=tuple(Quantity(f"x{index}", "1", 1.0 + index) for index in range(states)),
        controls=tuple(Quantity(f"u{index}", "1", 2.0 + index) for index in range(controls)),
        parameters=(),
        rates=ca.Function("rates", [x, u, p], [ca.vertcat(*[total - x[index] for index in range(states)])]),
        path=tuple(Quantity(f"c{index}", "1", 3.0, -1.0, 1.0) for index in range(path)),
        path_values=ca.Function("path", [x, u, p], [ca.vertcat(*[total * x[0]] * path)]) if path else None,
    )
    phases = (Phase("one", uniform(2), Interval(0.1, 2.0)), Phase("two", uniform(1), Interval(0.1, 2.0)))
    return Problem(system, (), Boundary(), phases)


PROBLEMS: Mapping[str, Problem] = {
    "everything": rich_problem(),
    "jumps": staged_problem(),
    "final cost": ended_problem(),
    "one of each": _modest(states=1, controls=1, path=1),
    "no controls": _modest(states=2, controls=0, path=1),
    "no path quantities": _modest(states=2, controls=2, path=0),
    "one state alone": _modest(states=1, controls=0, path=0),
    "one phase": replace(rich_problem(), phases=rich_problem().phases[:1]),
}


def random_iterate(problem: Problem, seed: int) -> Iterate:
    """Any values."""
    random = np.random.default_rng(seed)
    n_x, n_u, N = len(problem.system.states), len(problem.system.controls), problem.intervals
    return Iterate(
        random.uniform(0.3, 0.9, len(problem.phases)), random.normal(size=(n_x, N + 1)), random.normal(size=(n_u, N))
    )


def random_point(layout: Layout, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Scaled unknowns that satisfy no constraint, and multipliers; shapes (n_w,), (n_g,)."""
    random = np.random.default_rng(seed)
    w = random.normal(scale=0.7, size=layout.unknowns)
    w[layout.duration_index] = random.uniform(0.3, 0.9, len(layout.duration_index)) / layout.problem.time_scale
    return w, random.normal(size=layout.constraints)
