"""Optimality: the KKT error, the Hamiltonian, costates and costs of the final state."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from airrace.optimal_control.assembly import Assembly
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.kernels import casadi_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.optimality import KktError, costates, errors_in_objective, hamiltonian, kkt_error
from airrace.optimal_control.problem import Boundary, Iterate, Objective, Phase, Problem, interpolate, uniform
from airrace.optimal_control.quantities import Interval, Quantity, T, Vector, quantity, vector
from airrace.optimal_control.solve_problem import solve
from airrace.optimal_control.solvers.interface import SolverOptions
from airrace.optimal_control.solvers.messages import SolveRequest
from airrace.optimal_control.solvers.solver import PreparedProblem, ProgramSolution
from airrace.optimal_control.solvers.worker import SolveServer
from airrace.optimal_control.system import Observation, System, system_of


def creep() -> Problem:
    """Least time for x' = 2 u over one interval, u <= 3, from 0 to 12: t_f = 2, and each unit of x costs 1 / 6."""
    x, u, p = ca.SX.sym("x", 1), ca.SX.sym("u", 1), ca.SX.sym("p", 0)
    system = System(
        "creep",
        (Quantity("x", "m"),),
        (Quantity("u", "m/s", upper=3.0),),
        (),
        ca.Function("rates", [x, u, p], [2 * u]),
    )
    start, end = Boundary("start", {"x": Interval.exactly(0.0)}), Boundary("end", {"x": Interval.exactly(12.0)})
    return Problem(system, (), start, (Phase("creep", (1.0,), Interval(0.1, 9.0), end),))


def measured(duration: float, u: float, costate: float) -> tuple[KktError, np.ndarray, int]:
    problem = creep()
    layout = Layout(problem)
    functions = Evaluation(Assembly(layout, casadi_kernels(problem.system, problem.scheme)))
    w = layout.pack(interpolate(problem, [duration], np.array([[0.0, 12.0]]), [u]))
    lam_g = np.zeros(layout.constraints)
    lam_g[layout.gap_index[0, 0]] = costate
    return kkt_error(functions, layout, w, layout.parameter_values(), lam_g)


def test_the_optimum_and_its_costate_have_no_error() -> None:
    error, lam_x, _ = measured(duration=2.0, u=3.0, costate=1 / 6)
    assert error.largest == pytest.approx(0.0, abs=1e-12)
    # the control's bound carries 2 T / 6, the ends carry the costate
    layout = Layout(creep())
    assert lam_x[layout.control_index.ravel()] == pytest.approx([2 / 3])
    assert lam_x[layout.state_index.ravel()] == pytest.approx([1 / 6, -1 / 6])


@pytest.mark.parametrize(
    ("duration", "u", "costate", "kind", "expected"),
    [
        pytest.param(1.5, 3.0, 1 / 6, "primal", 3.0, id="a gap"),
        pytest.param(1.5, 4.0, 1 / 8, "primal", 1.0, id="outside a bound"),
        pytest.param(2.0, 3.0, 1 / 6 + 0.1, "dual", 0.6, id="wrong costate"),  # of the duration: 1 - 2 u costate
        pytest.param(2.5, 2.4, 1 / 4.8, "complementarity", 2 * 2.5 / 4.8 * 0.6, id="multiplier of a distant bound"),
    ],
)
def test_each_violation_is_an_error_of_its_kind(
    duration: float, u: float, costate: float, kind: str, expected: float
) -> None:
    error, _, worst = measured(duration, u, costate)
    assert getattr(error, kind) == pytest.approx(expected)
    if kind == "primal":
        assert worst == Layout(creep()).gap_index[0, 0]
    else:
        assert error.primal == pytest.approx(0.0, abs=1e-12)


def test_a_violated_equality_is_a_primal_error_alone() -> None:
    """However large its multiplier is: only inequalities have slacks."""
    error, _, _ = measured(duration=1.5, u=3.0, costate=1 / 6)
    assert error.primal == pytest.approx(3.0)
    assert error.complementarity == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("field", ["primal", "dual", "complementarity"])
def test_a_missing_number_is_never_small(field: str) -> None:
    assert np.isnan(replace(KktError(1e-9, 1e-9, 1e-9), **{field: np.nan}).largest)


def test_objective_defaults_to_time() -> None:
    assert creep().objective == Objective(time=1.0)


FASTEST = 20.0  # m/s2
LEAST_TIME = 2.0 / np.sqrt(FASTEST)  # from rest to rest over 1 m


def sliding_mass() -> System:
    x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u", 1), ca.SX.sym("p", 0)
    states, force = (Quantity("x", "m", 0.7), Quantity("v", "m/s", 3.0)), Quantity("f", "m/s2", 11.0, -FASTEST, FASTEST)
    return System("sliding-mass", states, (force,), (), ca.Function("rates", [x, u, p], [ca.vertcat(x[1], u)]))


SYSTEM = sliding_mass()


def least_time(intervals: int = 10, **objective: object) -> Problem:
    """Rest to rest in two phases that meet wherever is best."""
    at_rest = {"v": Interval.exactly(0.0)}
    start = Boundary("start", {"x": Interval.exactly(0.0), **at_rest})
    end = Boundary("end", {"x": Interval.exactly(1.0), **at_rest})
    half = Boundary("half")
    phases = (
        Phase("out", uniform(intervals // 2), Interval(0.01, 5.0), half),
        Phase("back", uniform(intervals - intervals // 2), Interval(0.01, 5.0), end),
    )
    return Problem(SYSTEM, (), start, phases, objective=Objective(**objective))


def solved(problem: Problem) -> ProgramSolution:
    guess = interpolate(problem, (0.5, 0.5), [[0.0, 0.5, 1.0], [0.0, 1.0, 0.0]], (0.0,))
    options = SolverOptions(tolerance=1e-9)
    solution = solve(problem, guess, options=options)
    assert solution.success
    return solution


def found(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Costates and Hamiltonian of the optimum."""
    solution = solved(problem)
    multipliers = solution.multipliers.constraints
    return costates(Layout(problem), multipliers), hamiltonian(problem, solution.iterate, multipliers)


def test_costates_of_least_time_are_those_of_bang_and_bang_and_the_hamiltonian_is_minus_one() -> None:
    """The velocity's falls from -1 / FASTEST v to plus as much and is zero at the switch; its slope is the place's."""
    p, H = found(least_time())
    # The switch may be at any node of either phase.
    durations, slope = solved(least_time()).iterate.durations, 2.0 / (FASTEST * LEAST_TIME)
    times = np.cumsum(np.repeat(durations / 5, 5))
    assert p[1] == pytest.approx(slope * (times - 0.5 * LEAST_TIME), abs=1e-5)
    assert p[0] == pytest.approx(-slope * np.ones(10), abs=1e-5)
    assert pytest.approx(-np.ones(10), abs=1e-6) == H
    p_3, H_3 = found(least_time(time=3.0))
    assert pytest.approx(3.0 * H, abs=1e-5) == H_3
    assert p_3[0] == pytest.approx(3.0 * p[0], abs=1e-5)


def test_costates_are_what_a_shift_costs_and_an_error_of_integration() -> None:
    """A start that is 1 mm ahead saves as much time as the costate of the place there says."""
    free = least_time()
    solution = solved(free)
    ahead = replace(free, start=Boundary("start", {"x": Interval.exactly(1e-3), "v": Interval.exactly(0.0)}))
    p_x, p_v = costates(Layout(free), solution.multipliers.constraints)
    assert p_x[0] * 1e-3 == pytest.approx(solved(ahead).objective - solution.objective, rel=2e-3)
    defect = np.zeros((2, 10))
    defect[:, 0] = 1e-3 / np.array([one.scale for one in SYSTEM.states])
    error = errors_in_objective(free, defect, solution.multipliers.constraints)
    assert error[0] == pytest.approx(1e-3 * (p_x[0] + p_v[0]))
    assert (error[1:] == 0.0).all()
    assert error[0] < 0.0


def test_hamiltonian_counts_the_regularisation() -> None:
    """With a price on the force the optimum is smooth; time's and force's shares still add up to -1."""
    smooth = least_time(40, regularisation={"f": 0.5})
    solution = solved(smooth)
    H = hamiltonian(smooth, solution.iterate, solution.multipliers.constraints)
    assert np.abs(H + 1.0).max() < 5e-3
    assert np.abs(solution.iterate.control).max() < FASTEST  # nothing is at a limit
    plain = replace(smooth, objective=Objective())
    without = hamiltonian(plain, solution.iterate, solution.multipliers.constraints)
    assert np.abs(without + 1.0).max() > 0.05


def test_hamiltonian_counts_the_weight_of_a_state() -> None:
    """To first order in the intervals: the sum takes the state where they begin, the Hamiltonian where they end."""
    drift = []
    for intervals in (100, 200):
        weighed = least_time(intervals, regularisation={"f": 0.5, "v": 0.2})
        solution = solved(weighed)
        H = hamiltonian(weighed, solution.iterate, solution.multipliers.constraints)
        drift.append(np.abs(H + 1.0).max())
        forgetful = replace(weighed, objective=Objective(regularisation={"f": 0.5}))
        without = hamiltonian(forgetful, solution.iterate, solution.multipliers.constraints)
        assert np.abs(without + 1.0).max() > 0.05
    assert drift[1] < 5e-3
    assert drift[1] == pytest.approx(0.5 * drift[0], rel=0.1)


def test_hamiltonian_strays_where_a_mesh_hides_the_switch() -> None:
    """One free phase on an odd number of intervals: the force cannot change sign in the middle of one."""
    whole = replace(least_time(), phases=(replace(least_time().phases[1], fractions=uniform(5)),))
    guess = interpolate(whole, (1.0,), [[0.0, 1.0], [0.0, 0.0]], (0.0,))
    solution = solve(whole, guess, options=SolverOptions(tolerance=1e-9))
    drift = np.abs(hamiltonian(whole, solution.iterate, solution.multipliers.constraints) + 1.0)
    assert drift.argmax() == 2
    assert drift.max() > 0.02


exactly = Interval.exactly
X, S, SECONDS = 3.0, 0.7, 1.5
TIGHT = SolverOptions(tolerance=1e-9)


@vector
class Place(Vector[T]):
    x: T = quantity("m", scale=2.0)


@vector
class Speed(Vector[T]):
    u: T = quantity("m/s", scale=4.0)


WALKER = system_of("walker", Place, Speed, lambda x, u: Place(x=u.u))


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
    problem = Problem(WALKER, (), Boundary("start", {"x": exactly(X)}), phases, objective)
    return problem, interpolate(problem, [SECONDS / 3, 2 * SECONDS / 3], [[X, 2.0, 1.0]], [-0.1])


def least_cost(b: float) -> float:
    return S * (X - b) ** 2 / (1 + 2 * S * SECONDS)


# Nothing in the problem is an inequality.
@pytest.mark.parametrize("solver", ["interior-point", "ipopt"])
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
    kernels = casadi_kernels(WALKER, problem.scheme)
    prepared = PreparedProblem(Layout(problem), kernels, "interior-point", TIGHT, threads=1)
    for b in (-0.5, 1.0):
        assert prepared.solve(Layout(walk(b)[0]), guess).objective == pytest.approx(least_cost(b), rel=1e-7)


def test_a_worker_tells_costs_apart() -> None:
    server = SolveServer()
    fourth = away(4)

    def cost(problem: Problem, guess: Iterate) -> float:
        return server.solve(SolveRequest(problem, guess, None, "interior-point", TIGHT, 1)).objective

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
