"""The check of fatrop's ABI: before the first solve, is its C interface laid out as expected?

A field that another release inserts into a struct would not be an error to ctypes: callbacks would be called in each
other's places and results would be read from beside where they stand. So before the first solve of a process a problem
with a known answer is solved, which takes a few milliseconds: a state x and a control u over one interval,

    minimise u^2 + x_1^2   subject to   x_0 = 1,   x_1 = x_0 + u,   0 <= x_1 <= 5,

with the optimum u = -1/2, x_1 = 1/2.
"""

from functools import cache

import casadi as ca
import numpy as np

from airrace.errors import SolverCrash
from airrace.optimal_control.assembly import Assembly
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.kernels import casadi_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.problem import Boundary, Objective, Phase, Problem
from airrace.optimal_control.runge_kutta import RK4
from airrace.optimal_control.solvers.fatrop.library import OUTPUT
from airrace.optimal_control.solvers.fatrop.solver import FatropSolver
from airrace.optimal_control.solvers.interface import Bounds
from airrace.quantities import Interval, Quantity
from airrace.system import Observation, System

TESTED = "3.8.2"
"""The release of casadi whose header `tests/optimal_control/test_fatrop_interface.py` compares field by field."""


@cache
def require_known_interface() -> None:
    """Solve the problem with the known answer, once per process.

    Raises:
        SolverCrash: the library behaves otherwise than expected.
    """
    OUTPUT.muted = True
    try:
        difference = _difference()
    except SolverCrash as error:
        difference = str(error)
    finally:
        OUTPUT.muted = False
    if difference:
        version = ca.CasadiMeta.version()
        raise SolverCrash(f"the solver fatrop in casadi {version} is not laid out as in casadi {TESTED}: {difference}")


def _difference() -> str:
    """Return how the answer differs from what is expected; empty if it does not."""
    problem = _problem()
    layout = Layout(problem)
    solver = FatropSolver(Evaluation(Assembly(layout, casadi_kernels(problem.system, problem.scheme))), {"tol": 1e-8})
    bounds = Bounds(*layout.unknown_bounds(), *layout.constraint_bounds())
    guess = np.clip(np.full(layout.unknowns, 0.3), bounds.lower, bounds.upper)
    found = solver.solve(guess, bounds, layout.parameter_values())
    iterate = layout.unpack(found.w)
    numbers = [*iterate.state[0].tolist(), *iterate.control[0].tolist()]
    if not found.success:
        return f"it answers {found.status}"
    # An interior point method stays off its bounds by about its tolerance, 1e-8.
    if np.abs(np.array(numbers) - (1.0, 0.5, -0.5)).max() > 1e-6:
        return f"the optimum is read as {numbers}"
    if found.reported_iterations != found.hessians:  # one in every iteration
        return f"{found.reported_iterations} iterations are read"
    return ""


def _problem() -> Problem:
    x, u, nothing = ca.SX.sym("x"), ca.SX.sym("u"), ca.SX.sym("nothing", 0)
    state, control = Quantity("x", "1", lower=0.0, upper=5.0), Quantity("u", "1")
    system = System("probe", (state,), (control,), (), ca.Function("rates", [x, u, nothing], [u]))
    square = Observation("square", (Quantity("square", "1"),), (), ca.Function("square", [x, nothing], [x**2]))
    return Problem(
        system=system,
        parameters=(),
        start=Boundary("start", bounds={"x": Interval.exactly(1.0)}),
        phases=(Phase("only", (1.0,), Interval.exactly(1.0)),),
        objective=Objective(time=0.0, terminal={"square": 1.0}, regularisation={"u": 1.0}, observation=square),
        scheme=RK4,
    )
