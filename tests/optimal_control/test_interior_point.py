"""The interior point method: its step, its line search, known multipliers, and how it ends."""

import sys
from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from known_flights import rest_to_rest
from small_problems import PROBLEMS, random_iterate, random_point

from airrace.optimal_control.assembly import Assembly
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.kernels import casadi_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.mesh_refinement import divide, limits_of, transfer_multipliers
from airrace.optimal_control.problem import Boundary, Iterate, Objective, Phase, Problem, interpolate, uniform
from airrace.optimal_control.quantities import Interval, Quantity
from airrace.optimal_control.runge_kutta import RK4
from airrace.optimal_control.solvers import INTERIOR_POINT, IPOPT, bounded_program, interior_point
from airrace.optimal_control.solvers.bounded_program import EQUALITY_WEIGHT, BoundedProgram, Measures, ProgramVector
from airrace.optimal_control.solvers.interface import (
    Bounds,
    Ending,
    Multipliers,
    SolverOptions,
)
from airrace.optimal_control.solvers.solver import PreparedProblem, ProgramSolution
from airrace.optimal_control.system import System

exactly = Interval.exactly


def attempt(
    problem: Problem,
    guess: Iterate,
    multipliers: Multipliers | None = None,
    barrier: float = 0.1,
    *,
    solver: str = INTERIOR_POINT,
    tolerance: float = 1e-8,
    iterations_max: int = 200,
    stagnation_max: int = 60,
) -> ProgramSolution:
    kernels = casadi_kernels(problem.system, problem.scheme)
    options = SolverOptions(tolerance, iterations_max, barrier, stagnation_max=stagnation_max)
    return PreparedProblem(Layout(problem), kernels, solver, options, threads=1).solve(
        Layout(problem), guess, multipliers
    )


def solved(
    problem: Problem,
    guess: Iterate,
    multipliers: Multipliers | None = None,
    barrier: float = 0.1,
    *,
    solver: str = INTERIOR_POINT,
    tolerance: float = 1e-8,
) -> ProgramSolution:
    solution = attempt(problem, guess, multipliers, barrier, solver=solver, tolerance=tolerance)
    assert solution.success, solution.status
    assert solution.solver == solver
    return solution


EVERYTHING = PROBLEMS["everything"]

# the step


def bounded(name: str) -> tuple[BoundedProgram, ProgramVector, ProgramVector, Measures]:
    """A program with its bounds, linearised at a random point."""
    problem = PROBLEMS[name]
    layout = Layout(problem)
    functions = Evaluation(Assembly(layout, casadi_kernels(problem.system, problem.scheme)))
    functions.p[:] = layout.parameter_values()
    functions.forget()
    bounds = Bounds(*layout.unknown_bounds(), *layout.constraint_bounds())
    program = BoundedProgram(functions, bounds)
    point, residuals, random = program.vector(), program.vector(), np.random.default_rng(3)
    point.w[:] = random_point(layout, 3)[0]
    point.y[:], point.e[:] = random.normal(size=len(point.y)), random.normal(size=len(point.e))
    point.s[:], point.z[:] = random.uniform(0.1, 1.0, len(point.s)), random.uniform(0.1, 1.0, len(point.z))
    measures = program.linearise(point, residuals)
    assert measures is not None
    return program, point, residuals, measures


@pytest.fixture(params=PROBLEMS, scope="module")
def at_a_point(request: pytest.FixtureRequest) -> tuple[BoundedProgram, ProgramVector, ProgramVector, Measures]:
    return bounded(request.param)


def dense(program: BoundedProgram) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The Hessian of the Lagrangian, and the Jacobians of gaps, equalities and slacks."""
    functions = program.functions
    layout = functions.assembly.layout
    functions.linearise()
    functions.curve()
    H, J = np.zeros((layout.unknowns, layout.unknowns)), np.zeros((layout.constraints, layout.unknowns))
    for matrix, sums, nonzeros in (
        (H, functions.assembly.hessian, functions.hessian),
        (J, functions.assembly.jacobian, functions.jacobian),
    ):
        matrix[sums.rows, sums.columns] = nonzeros
    rows = np.vstack([J[layout.row_index], np.eye(layout.unknowns)])
    return H, J[layout.gap_index.ravel()], rows[program.equality], program.sign[:, None] * rows[program.inequality]


DAMPING = 100.0  # enough for a step to a minimum from anywhere


def test_step_solves_the_linear_conditions(
    at_a_point: tuple[BoundedProgram, ProgramVector, ProgramVector, Measures],
) -> None:
    """Those of interior_point.c, written down densely."""
    program, point, residuals, _ = at_a_point
    H, F, C, B = dense(program)
    assert program.factorise(point, DAMPING)
    step, products = program.vector(), np.random.default_rng(4).normal(size=len(point.s))
    program.solve(point, residuals, products, step)
    curvature = H @ step.w + DAMPING * step.w
    stationarity = curvature + F.T @ step.y + C.T @ step.e - B.T @ step.z
    assert stationarity == pytest.approx(-residuals.w, abs=1e-8)
    assert F @ step.w == pytest.approx(-residuals.y, abs=1e-9)
    assert C @ step.w - step.e / EQUALITY_WEIGHT == pytest.approx(-residuals.e, abs=1e-9)
    assert B @ step.w - step.s == pytest.approx(-residuals.s, abs=1e-9)
    assert point.s * step.z + point.z * step.s == pytest.approx(products, abs=1e-9)


def test_residuals_are_the_violations_of_the_conditions(
    at_a_point: tuple[BoundedProgram, ProgramVector, ProgramVector, Measures],
) -> None:
    program, point, residuals, measures = at_a_point
    functions = program.functions
    layout = functions.assembly.layout
    functions.objective_gradient()
    _, F, C, B = dense(program)
    expected = functions.f_gradient + F.T @ point.y + C.T @ point.e - B.T @ point.z
    assert residuals.w == pytest.approx(expected, abs=1e-9)
    assert residuals.y == pytest.approx(
        functions.g[layout.gap_index.ravel()] - layout.constraint_bounds()[0][layout.gap_index.ravel()]
    )
    assert residuals.s == pytest.approx(program.slacks(point.w) - point.s)
    products = point.s * point.z
    assert measures.mean_product == pytest.approx(products.mean())
    assert (measures.least_product, measures.largest_product) == (products.min(), products.max())
    violations = np.abs(np.concatenate([residuals.y, residuals.e, residuals.s]))
    assert measures.primal == violations.max()
    assert measures.infeasibility == pytest.approx(violations.sum())
    assert measures.stationarity == np.abs(residuals.w).max()


def test_inertia_tells_where_a_step_leads_to_no_minimum(
    at_a_point: tuple[BoundedProgram, ProgramVector, ProgramVector, Measures],
) -> None:
    program, point, _, _ = at_a_point
    assert not program.factorise(point, -1e3 - float((point.z / point.s).sum()))


def test_steps_keep_slacks_and_multipliers_positive_and_bring_the_conditions_closer(
    at_a_point: tuple[BoundedProgram, ProgramVector, ProgramVector, Measures],
) -> None:
    program, point, residuals, _ = at_a_point
    assert program.factorise(point, DAMPING)
    step, next_point = program.vector(), program.vector()
    primal, dual = program.predict_and_correct(point, residuals, 1e-9, step)
    assert 0.0 < primal <= 1.0
    assert 0.0 < dual <= 1.0
    next_point.become(point, step, primal, dual)
    assert next_point.s.min() > 0.0
    assert next_point.z.min() > 0.0
    _, F, C, _ = dense(program)
    assert F @ (primal * step.w) == pytest.approx(-primal * residuals.y, abs=1e-9)  # linear: they close by that share
    assert C @ step.w - step.e / EQUALITY_WEIGHT == pytest.approx(-residuals.e, abs=1e-9)


def test_the_first_multipliers_balance_the_gradient_best() -> None:
    """Least squares: what is left of the gradient is orthogonal to the gradients of gaps and equalities."""
    problem = EVERYTHING
    layout = Layout(problem)
    functions = Evaluation(Assembly(layout, casadi_kernels(problem.system, problem.scheme)))
    functions.p[:] = layout.parameter_values()
    functions.forget()
    bounds = Bounds(*layout.unknown_bounds(), *layout.constraint_bounds())
    program = BoundedProgram(functions, bounds)
    solve = interior_point._Solve(program, SolverOptions())
    solve._begin(layout.pack(random_iterate(problem, 1)), None)
    functions.objective_gradient()
    point = solve._point
    program.go_to(point)
    functions.values()
    functions.curve()
    _, F, C, _ = dense(program)
    left = functions.f_gradient + F.T @ point.y + C.T @ point.e
    assert F @ left == pytest.approx(np.zeros(len(F)), abs=1e-6)
    assert C @ left == pytest.approx(np.zeros(len(C)), abs=1e-4)  # of which the penalty leaves some
    assert point.s * point.z == pytest.approx(np.full(len(point.s), 0.1))


# centring, restarts, local infeasibility


@pytest.mark.parametrize("barrier", [1e-6, 1e-2, 10.0])
def test_centred_products_are_at_least_the_barrier_parameter_and_the_larger_factor_is_kept(barrier: float) -> None:
    random = np.random.default_rng(5)
    slacks, multipliers = random.normal(size=200), 10.0 ** random.uniform(-8.0, 3.0, size=200)  # slacks: even negative
    s, z = interior_point.centre(slacks, multipliers, barrier)
    assert (s * z >= barrier * (1.0 - 1e-12)).all()
    assert (s >= slacks).all()
    assert (np.minimum(s, z) > 0.0).all()
    large, middle = np.maximum(slacks, multipliers), np.sqrt(barrier)
    kept = np.where(multipliers >= slacks, z, s)
    assert kept == pytest.approx(np.maximum(large, middle), rel=1e-12)
    small = large < middle
    assert s[small] == pytest.approx(middle)  # both are small: neither tells anything
    assert z[small] == pytest.approx(middle)


def solve_at_a_point(product: float) -> tuple[interior_point._Solve, Measures]:
    """A solve without progress over some iterates, with all products of slack and multiplier equal."""
    program, point, _, _ = bounded("everything")
    solve = interior_point._Solve(program, SolverOptions())
    solve._point.whole[:] = point.whole
    solve._point.s[:] = solve._point.z[:] = np.sqrt(product)
    measures = program.linearise(solve._point, solve._residuals)
    assert measures is not None
    solve._recent.extend([measures.violation] * interior_point.MEMORY)
    return solve, measures


@pytest.mark.parametrize(("ratio", "centred"), [(0.9, True), (1.1, False)])
def test_without_progress_a_point_off_its_central_path_is_centred_and_another_searched_from(
    ratio: float, centred: bool
) -> None:
    _, measures = solve_at_a_point(1.0)
    product = ratio * interior_point.PRODUCT_RATIO * measures.primal
    for _ in range(2):  # as the infeasibility depends on the slacks
        solve, measures = solve_at_a_point(product)
        product = ratio * interior_point.PRODUCT_RATIO * measures.primal
    target = interior_point.CENTRING * measures.primal
    products: list[np.ndarray] = []
    solve._take_free_step = lambda: bool(products.append(solve._point.s * solve._point.z)) or True  # type: ignore
    solve._take_search_step = lambda _: True  # type: ignore
    assert solve._advance(measures)
    assert (solve._search is None) is centred
    if centred:
        assert products[0].min() == pytest.approx(target)
        # not again before the objective has fallen
        solve._recent.extend([0.0] * interior_point.MEMORY)
        assert solve._advance(measures)
        assert solve._search is not None


def test_where_no_step_is_found_slacks_and_multipliers_are_reset_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    products: list[np.ndarray] = []
    barriers: list[float] = []

    def no_step(search: interior_point.FilterSearch, point: ProgramVector, *_: object) -> None:
        products.append(point.s * point.z)
        barriers.append(search.barrier)
        point.z[:] = 1e6  # whatever led astray

    monkeypatch.setattr(interior_point.FilterSearch, "advance", no_step)
    free_steps: list[interior_point._Solve] = []
    monkeypatch.setattr(interior_point._Solve, "_take_free_step", lambda solve: bool(free_steps.append(solve)))
    program, point, _, _ = bounded("everything")
    result = interior_point._Solve(program, SolverOptions()).solve(point.w, None, begins_in_search=True)
    assert result.ending is Ending.NO_STEP
    assert len(products) == 1 + interior_point.RESTARTS_MAX
    assert len(free_steps) == interior_point.RESTARTS_MAX
    for previous, product in zip(barriers, products[1:], strict=False):
        expected = max(interior_point.RESTART_FACTOR * previous, interior_point.RESTART_BARRIER_MIN)
        assert product == pytest.approx(expected)


def infeasible_measures(infeasibility: float, primal: float = 1.0) -> Measures:
    return Measures(primal, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, infeasibility)


@pytest.mark.parametrize(
    ("reduction", "primal", "stagnates"),
    [(0.0, 1.0, True), (0.001, 1.0, True), (0.11, 1.0, False), (0.0, 1e-4, False)],
    ids=["none", "a thousandth", "enough", "nearly feasible"],
)
def test_violations_that_stay_tell_a_locally_infeasible_program(
    reduction: float, primal: float, stagnates: bool
) -> None:
    program, _, _, _ = bounded("everything")
    solve = interior_point._Solve(program, SolverOptions())
    stay = SolverOptions().stagnation_max + 1
    verdicts: list[bool] = []
    for number in range(stay + 1):
        verdicts.append(solve._stagnates(infeasible_measures((1.0 - reduction) ** number, primal)))
    assert not any(verdicts[:-1])
    assert verdicts[-1] is stagnates


def test_a_reduction_of_the_violations_begins_the_count_of_stagnation_anew() -> None:
    program, _, _, _ = bounded("everything")
    solve = interior_point._Solve(program, SolverOptions())
    stay = SolverOptions().stagnation_max
    half = [1.0] * stay + [0.5] * (stay + 1)
    for infeasibility in half:
        assert not solve._stagnates(infeasible_measures(infeasibility))
    assert solve._stagnates(infeasible_measures(0.5))


@pytest.mark.parametrize("end", [3.0, 10.0])
def test_an_end_out_of_reach_is_locally_infeasible(end: float) -> None:
    """With a speed of 3 at most, 3 can be reached in a second, 10 cannot."""
    problem = coasting(lambda _, u: u, lambda x: x, start=0.0, lowest=-9.0, end=exactly(end))
    solution = attempt(problem, level(problem, 0.0), stagnation_max=2)
    assert solution.success is (end == 3.0)
    if not solution.success:
        assert solution.ending is Ending.INFEASIBLE
        assert 3 <= solution.iterations < 10


# optima


@pytest.mark.parametrize("name", PROBLEMS)
def test_optimum_is_that_of_ipopt_with_bounds_kept_as_they_are(name: str) -> None:
    problem = PROBLEMS[name]
    own = solved(problem, random_iterate(problem, 1))
    other = solved(problem, own.iterate, barrier=1e-4, solver=IPOPT)  # there may be several optima
    assert own.objective == pytest.approx(other.objective, rel=1e-6)
    assert own.kkt.largest < 1e-7
    assert own.kkt.primal < 3e-9


def test_a_problem_without_inequalities_is_solved_by_newtons_method() -> None:
    swing, guess = rest_to_rest()
    (f,) = swing.system.controls
    unlimited = replace(swing.system, controls=(replace(f, lower=-np.inf, upper=np.inf),))
    (phase,) = swing.phases
    objective = Objective(regularisation={"f": 1.0})
    problem = replace(swing, system=unlimited, phases=(replace(phase, duration=exactly(2.0)),), objective=objective)
    lower, upper = Layout(problem).unknown_bounds()
    assert not ((lower < upper) & (np.isfinite(lower) | np.isfinite(upper))).any()
    own, other = (solved(problem, guess, solver=solver) for solver in (INTERIOR_POINT, IPOPT))
    assert own.objective == pytest.approx(other.objective, rel=1e-9)
    assert own.iterations <= 6


def test_one_solver_serves_bounds_of_changing_kinds() -> None:
    first, *others = EVERYTHING.phases
    problems = [
        replace(EVERYTHING, phases=(replace(first, bounds={"load": load}), *others))
        for load in (Interval(-2.0, 7.0), Interval(lower=-2.0), Interval(-2.0, 7.0))
    ]
    kernels = casadi_kernels(EVERYTHING.system, EVERYTHING.scheme)
    prepared = PreparedProblem(Layout(problems[0]), kernels, INTERIOR_POINT, SolverOptions(1e-8, 200), threads=1)
    for problem in problems:
        guess = random_iterate(problem, 1)
        again, fresh = prepared.solve(Layout(problem), guess), solved(problem, guess)
        assert again.objective == fresh.objective
        assert (again.iterate.state == fresh.iterate.state).all()


def test_without_the_native_library_ipopt_is_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bounded_program, "library", lambda: None)
    solution = attempt(EVERYTHING, random_iterate(EVERYTHING, 1))
    assert solution.success
    assert solution.solver == IPOPT


# known multipliers


def bisect_all(name: str) -> tuple[Problem, Iterate, Multipliers]:
    """A problem on a mesh twice as fine, with the optimum on its own mesh and its multipliers carried over."""
    problem = PROBLEMS[name]
    first = solved(problem, random_iterate(problem, 1))
    mesh, guess = divide(problem.mesh, first.iterate, None, np.full(problem.intervals, 2))
    phases = tuple(replace(phase, fractions=cut) for phase, cut in zip(problem.phases, mesh, strict=True))
    finer = replace(problem, phases=phases)
    return finer, guess, transfer_multipliers(first.multipliers, Layout(problem), Layout(finer))


@pytest.mark.parametrize("name", ["everything", "jumps", "final cost", "one phase"])
def test_multipliers_of_a_coarser_mesh_save_iterations(name: str) -> None:
    problem, guess, multipliers = bisect_all(name)
    warm, cold = solved(problem, guess, multipliers, 1e-5), solved(problem, guess)
    assert warm.iterations < cold.iterations
    assert warm.iterations <= 10
    assert warm.objective == pytest.approx(cold.objective, abs=1e-6)
    assert warm.multipliers.constraints == pytest.approx(cold.multipliers.constraints, abs=1e-3)


def test_multipliers_that_mislead_do_not_change_the_optimum() -> None:
    problem, guess, multipliers = bisect_all("everything")
    expected = solved(problem, guess, multipliers, 1e-5)
    wrong = Multipliers(-multipliers.constraints[::-1].copy(), 0.3 * np.ones_like(multipliers.bounds))
    assert solved(problem, guess, wrong, 1e-5).objective == pytest.approx(expected.objective, abs=1e-6)


@pytest.mark.parametrize("name", PROBLEMS)
def test_carried_to_the_same_problem_the_multipliers_of_limits_stay(name: str) -> None:
    layout = Layout(PROBLEMS[name])
    generator = np.random.default_rng(2)
    given = Multipliers(generator.normal(size=layout.constraints), generator.normal(size=layout.unknowns))
    both, again = (
        np.concatenate([one.constraints, one.bounds])
        for one in (given, transfer_multipliers(given, layout, Layout(PROBLEMS[name])))
    )
    places = np.concatenate([limit.places for limit in limits_of(layout).values()])
    assert again[places] == pytest.approx(both[places], rel=1e-12)
    assert len(np.unique(places)) == len(places)
    rest = np.setdiff1d(np.arange(len(both)), places)
    assert again[rest].tolist() == [0.0] * len(rest)
    handed_on = layout.constraints + layout.duration_index  # the durations that no phase begins with have no limit
    assert set(rest.tolist()) <= {*layout.gap_index.ravel().tolist(), *handed_on.tolist()}


def test_on_a_finer_mesh_the_multipliers_of_a_limit_add_up_to_the_same() -> None:
    """A limit that presses evenly all along a phase weighs the same, whatever the mesh."""
    coarse = Layout(EVERYTHING)
    mesh, _ = divide(EVERYTHING.mesh, random_iterate(EVERYTHING, 1), None, np.full(EVERYTHING.intervals, 3))
    phases = [replace(phase, fractions=cut) for phase, cut in zip(EVERYTHING.phases, mesh, strict=True)]
    fine = Layout(replace(EVERYTHING, phases=tuple(phases)))
    both = np.zeros(coarse.constraints + coarse.unknowns)
    limits = limits_of(coarse)
    for (kind, _), limit in limits.items():
        if kind in ("node", "interval"):
            both[limit.places] = limit.weights
    found = transfer_multipliers(Multipliers(both[: coarse.constraints], both[coarse.constraints :]), coarse, fine)
    there = np.concatenate([found.constraints, found.bounds])
    for key, limit in limits_of(fine).items():
        if key in limits and key[0] in ("node", "interval"):
            expected = limit.weights * np.isin(np.floor(limit.along), np.floor(limits[key].along))
            assert there[limit.places] == pytest.approx(expected, rel=1e-12)


# steps that need help


def with_idle_control(cost: Callable[[ca.SX], ca.SX], least: float, idle: float) -> ProgramSolution:
    """The optimum of a problem with a control between `least` and 1 that only its cost is of, from a guess of it."""
    x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u", 2), ca.SX.sym("p", 0)
    rates = ca.Function("rates", [x, u, p], [ca.vertcat(u[0], 4.0 * cost(u[1]))])
    states = Quantity("x", "1"), Quantity("cost", "1")
    system = System("idle", states, (Quantity("u", "1"), Quantity("idle", "1", lower=least, upper=1.0)), (), rates)
    problem = Problem(
        system=system,
        parameters=(),
        start=Boundary("start", bounds={"x": exactly(1.0), "cost": exactly(0.0)}),
        phases=(Phase("only", uniform(4), exactly(1.0), end=Boundary("end", bounds={"x": exactly(0.0)})),),
        objective=Objective(time=0.0, regularisation={"u": 1.0}, terminal={"cost": 1.0}),
        scheme=RK4,
    )
    layout = Layout(problem)
    state, control = np.array([np.linspace(1.0, 0.0, 5), np.zeros(5)]), np.array([[-1.0] * 4, [idle] * 4])
    known = Multipliers(np.zeros(layout.constraints), np.zeros(layout.unknowns))
    return solved(problem, Iterate(np.array([1.0]), state, control), known, barrier=1e-8, tolerance=1e-7)


@pytest.mark.parametrize(("slope", "curvature"), [(4e-7, -2e-6), (5.7e-7, -3e-6), (8e-7, -3e-6)])
def test_a_control_that_hardly_matters_keeps_no_product_too_large(slope: float, curvature: float) -> None:
    """Its step is so long that slack times multiplier, predicted to second order, would stay."""

    def cost(idle: ca.SX) -> ca.SX:
        return (slope + 0.5 * curvature * (idle - 0.41)) * (idle - 0.41)

    assert with_idle_control(cost, 0.0, 0.41).iterations <= 5


def cycling_cost(v: ca.SX) -> ca.SX:
    """Newton's method for v + tanh(40 v) / 10 = 0 leads from everywhere but near 0 to 0.1, and from there to -0.1."""
    return 1e-4 * (0.5 * v**2 + ca.log(ca.cosh(40.0 * v)) / 400.0)


def test_steps_to_and_fro_are_damped() -> None:
    found = with_idle_control(cycling_cost, -1.0, 0.3)
    assert found.iterations <= 20
    assert found.iterate.control[1] == pytest.approx(0.0, abs=1e-2)


def test_steps_to_and_fro_that_are_not_damped_are_searched_along(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interior_point, "REVERSAL_RATIO", np.inf)
    solution = with_idle_control(cycling_cost, -1.0, 0.3)
    assert solution.iterations <= 40
    assert solution.iterate.control[1] == pytest.approx(0.0, abs=1e-2)


def coasting(
    rate: Callable[[ca.SX, ca.SX], ca.SX],
    path: Callable[[ca.SX], ca.SX],
    start: float,
    lowest: float,
    *,
    end: Interval = Interval(),
) -> Problem:
    """Come as low as possible within a second, with little control."""
    x, u, p = ca.SX.sym("x", 1), ca.SX.sym("u", 1), ca.SX.sym("p", 0)
    system = System(
        name="coasting",
        states=(Quantity("x", "m"),),
        controls=(Quantity("u", "m/s", 1.0, -3.0, 3.0),),
        parameters=(),
        rates=ca.Function("rates", [x, u, p], [rate(x, u)]),
        path=(Quantity("c", "1", 1.0, lowest),),
        path_values=ca.Function("path", [x, u, p], [path(x)]),
    )
    phase = Phase("all", uniform(4), exactly(1.0), end=Boundary("end", {"x": end}))
    objective = Objective(time=0.0, terminal={"x": 1.0}, regularisation={"u": 1e-3})
    return Problem(system, (), Boundary("start", {"x": exactly(start)}), (phase,), objective)


def level(problem: Problem, height: float) -> Iterate:
    return interpolate(problem, [1.0], np.array([[height, height]]), [0.0])


def test_newtons_method_that_diverges_is_led_back_by_the_line_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """atan(30 u) = 0 is the equation on which whole Newton steps from 0.3 go to and fro, ever farther."""
    problem = coasting(lambda _, u: ca.atan(30.0 * u), lambda x: x, start=1.0, lowest=-9.0, end=exactly(1.0))
    guess = interpolate(problem, [1.0], np.array([[1.0, 1.0]]), [0.3])
    solution = solved(problem, guess)
    assert solution.iterate.control == pytest.approx(np.zeros((1, 4)), abs=1e-4)

    def no_search(*_: object) -> bool:
        return False

    monkeypatch.setattr(interior_point.FilterSearch, "_search", no_search)
    assert not attempt(problem, guess).success


def test_steps_to_where_a_constraint_has_no_value_are_taken_back() -> None:
    """ln x >= -2: the first steps lead to negative x."""
    problem = coasting(lambda _, u: u, ca.log, start=1.0, lowest=-2.0)
    solution = solved(problem, level(problem, 1.0))
    assert solution.iterate.state[0, -1] == pytest.approx(np.exp(-2.0), rel=1e-6)


# how it ends


def test_derivatives_that_are_not_finite_end_the_solve() -> None:
    """sqrt(x) has a value at x = 0 but no slope."""
    problem = coasting(lambda x, u: u - ca.sqrt(x), lambda x: x, start=0.0, lowest=-1.0)
    solution = attempt(problem, level(problem, 0.0))
    assert not solution.success
    assert solution.ending is Ending.NOT_FINITE


def test_huge_derivatives_end_the_solve() -> None:
    problem = coasting(lambda x, u: u - 1e12 * x, lambda x: x, start=0.0, lowest=-1.0)
    solution = attempt(problem, level(problem, 0.0))
    assert not solution.success
    assert solution.iterations < 100
    assert np.isfinite(solution.iterate.state).all()


def test_a_condition_out_of_reach_ends_the_solve() -> None:
    far = replace(EVERYTHING.start, bounds={"distance": Interval(upper=-20.0)})  # a square and a sine
    solution = attempt(replace(EVERYTHING, start=far), random_iterate(EVERYTHING, 1))
    assert not solution.success
    assert solution.ending in (Ending.NO_STEP, Ending.INFEASIBLE)
    assert solution.kkt.primal > 1.0


def test_a_limit_of_iterations_is_reported() -> None:
    solution = attempt(EVERYTHING, random_iterate(EVERYTHING, 1), iterations_max=2)
    assert not solution.success
    assert solution.ending is Ending.ITERATION_LIMIT
    assert solution.iterations == 2


class Failing:
    """A standard output that cannot be written to after some lines."""

    def __init__(self, lines: int) -> None:
        self.lines = lines

    def write(self, text: str) -> int:
        self.lines -= text.count("\n")
        if self.lines < 0:
            raise BrokenPipeError
        return len(text)


def test_an_error_while_printing_ends_the_solve_and_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    kernels = casadi_kernels(EVERYTHING.system, EVERYTHING.scheme)
    prepared = PreparedProblem(Layout(EVERYTHING), kernels, INTERIOR_POINT, SolverOptions(1e-8, 200), threads=1)
    guess = random_iterate(EVERYTHING, 1)
    with monkeypatch.context() as patched:
        patched.setattr(sys, "stdout", Failing(5))
        with pytest.raises(BrokenPipeError):
            prepared.solve(Layout(EVERYTHING), guess)
    assert prepared.solve(Layout(EVERYTHING), guess).objective == solved(EVERYTHING, guess).objective


def test_time_in_functions_is_part_of_the_time() -> None:
    solution = solved(EVERYTHING, random_iterate(EVERYTHING, 1))
    assert 0.0 < solution.derivative_seconds < solution.seconds
