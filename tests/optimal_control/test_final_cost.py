"""A cost of the final state that is no linear one, against the closed form of a linear-quadratic problem.

From x = X a control u is to bring x' = u near b within T seconds: minimise `s (x(T) - b)^2 + integral of u^2 / 2`. The
control is constant, `x(T) - b = (X - b) / (1 + 2 s T)`, and the cost is `s (X - b)^2 / (1 + 2 s T)`.
"""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from airrace.optimal_control.kernels import casadi_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.optimality import costates, hamiltonian
from airrace.optimal_control.problem import Boundary, Iterate, Objective, Phase, Problem, interpolate, uniform
from airrace.optimal_control.solve import solve
from airrace.optimal_control.solvers.process.messages import SolveRequest
from airrace.optimal_control.solvers.process.worker import SolveServer
from airrace.optimal_control.solvers.solver import SOLVERS, PreparedProblem, SolverOptions
from airrace.quantities import Interval, Quantity, T, Vector, quantity, vector
from airrace.system import Observation, system_of

exactly = Interval.exactly
X, S, SECONDS = 3.0, 0.7, 1.5
TIGHT = SolverOptions(tolerance=1e-9)


@vector
class Place(Vector[T]):
    x: T = quantity("m", scale=2.0)


@vector
class Speed(Vector[T]):
    u: T = quantity("m/s", scale=4.0)


SYSTEM = system_of("walker", Place, Speed, lambda x, u: Place(x=u.u))


def away(power: int = 2) -> Observation:
    """How far the walker is from a place, to some power."""
    x, b = ca.SX.sym("x", 1), ca.SX.sym("b", 1)
    seen = ca.Function("away", [x, b], [(x - b) ** power])
    return Observation(f"away to the power of {power}", (Quantity("miss", "m2"),), (Quantity("b", "m"),), seen)


AWAY = away()


def walk(b: float, observation: Observation = AWAY) -> tuple[Problem, Iterate]:
    """The problem with the place b, and a guess."""
    effort = 0.5 * 4.0**2  # the regularisation takes the control in units of its scale
    objective = Objective(
        time=0.0, terminal={"miss": S}, regularisation={"u": effort}, observation=observation, values=(b,)
    )
    phases = (Phase("walk", uniform(2), exactly(SECONDS / 3)), Phase("on", uniform(3), exactly(2 * SECONDS / 3)))
    problem = Problem(SYSTEM, (), Boundary("start", {"x": exactly(X)}), phases, objective)
    return problem, interpolate(problem, [SECONDS / 3, 2 * SECONDS / 3], [[X, 2.0, 1.0]], [-0.1])


def least_cost(b: float) -> float:
    return S * (X - b) ** 2 / (1 + 2 * S * SECONDS)


# casadi's interface to fatrop never ends here, for nothing in the problem is an inequality.
@pytest.mark.parametrize("solver", ["fatrop", "ipopt"])
def test_least_cost_is_that_of_the_closed_form(solver: str) -> None:
    solution = solve(*walk(-0.5), solver=solver, options=TIGHT)
    assert solution.success, solution.status
    assert solution.objective == pytest.approx(least_cost(-0.5), rel=1e-7)
    assert solution.iterate.state[0, -1] + 0.5 == pytest.approx(3.5 / (1 + 2 * S * SECONDS), rel=1e-7)
    assert solution.kkt.largest < 1e-7


def test_costate_ends_with_the_slope_of_the_cost() -> None:
    """And, as the equations do not depend on x, it is the same all along; so is the Hamiltonian."""
    problem, guess = walk(-0.5)
    solution = solve(problem, guess, options=TIGHT)
    slope = 2 * S * (float(solution.iterate.state[0, -1]) + 0.5)
    assert costates(Layout(problem), solution.multipliers.constraints) == pytest.approx(np.full((1, 5), slope))
    u = float(solution.iterate.control[0, 0])
    found = hamiltonian(problem, solution.iterate, solution.multipliers.constraints)
    assert found == pytest.approx(np.full(5, slope * u + u**2 / 2))


def test_a_prepared_problem_takes_other_parameters_of_the_cost() -> None:
    problem, guess = walk(-0.5)
    kernels = casadi_kernels(SYSTEM, problem.scheme)
    prepared = PreparedProblem(Layout(problem), kernels, SOLVERS["fatrop"], TIGHT, threads=1)
    for b in (-0.5, 1.0):
        assert prepared.solve(Layout(walk(b)[0]), guess).objective == pytest.approx(least_cost(b), rel=1e-7)


def test_a_worker_tells_costs_apart() -> None:
    server = SolveServer()
    fourth = away(4)

    def cost(problem: Problem, guess: Iterate) -> float:
        return server.solve(SolveRequest(problem, guess, None, "fatrop", TIGHT, 1)).objective

    quartic = cost(*walk(0.0, fourth))
    assert cost(*walk(0.0)) == pytest.approx(least_cost(0.0), rel=1e-7)
    assert cost(*walk(1.0)) == pytest.approx(least_cost(1.0), rel=1e-7)
    assert cost(*walk(0.0, fourth)) == quartic
    assert abs(quartic - least_cost(0.0)) > 0.1
    assert len(server._prepared) == 2


def test_a_weight_of_a_state_adds_to_what_is_observed() -> None:
    problem, guess = walk(0.0)
    both = replace(problem, objective=replace(problem.objective, terminal={"miss": S, "x": 0.4}))
    # s x^2 + 0.4 x is s (x - b)^2 - s b^2 with b = -0.2 / s
    b = -0.2 / S
    assert solve(both, guess, options=TIGHT).objective == pytest.approx(least_cost(b) - S * b**2, rel=1e-7)
