"""Conditions of second order: the recursion against dense eigenvalues, and saddles at which solvers claim success."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
import scipy.linalg
import scipy.sparse
from small_problems import PROBLEMS, random_point

from airrace.optimal_control import second_order as second_order_module
from airrace.optimal_control.assembly import Assembly, StageMatrices
from airrace.optimal_control.certificate import Curvature, SecondOrder
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.kernels import casadi_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.problem import Boundary, Objective, Phase, Problem, interpolate, uniform
from airrace.optimal_control.quantities import Interval, Quantity
from airrace.optimal_control.second_order import (
    ZERO_CURVATURE,
    StageQuadratic,
    descent_direction,
    direction_below,
    second_order,
)
from airrace.optimal_control.solve_problem import solve
from airrace.optimal_control.solvers import solver as solver_module
from airrace.optimal_control.solvers.interface import Ending, SolverOptions
from airrace.optimal_control.solvers.solver import STEP_FROM_SADDLE, PreparedProblem, ProgramSolution
from airrace.optimal_control.system import System

exactly = Interval.exactly


def form_of(
    hessian: list[np.ndarray], dynamics: list[np.ndarray], rows: list[np.ndarray], held: list[np.ndarray]
) -> StageQuadratic:
    """The form with these matrices by stage, of which every row is active, and equal weights."""
    counts = [len(block) for block in rows]
    return StageQuadratic(
        states=len(dynamics[0]),
        sizes=np.array([len(block) for block in hessian], dtype=np.int32),
        hessian=np.concatenate([block.ravel() for block in hessian]),
        dynamics=np.concatenate([F.T.ravel() for F in dynamics]),
        row_counts=np.array(counts, dtype=np.int32),
        rows=np.concatenate([block.ravel() for block in rows]),
        active=np.concatenate([np.ones(sum(counts), dtype=bool), *held]),
        weights=np.ones(len(hessian)),
    )


def random_form(random: np.random.Generator, intervals: int, m: int, u: int) -> StageQuadratic:
    """Any quadratic form, with rows of which some are active, now and then dependent, and unknowns that are held."""
    sizes = [m + random.integers(0, u + 1) for _ in range(intervals)] + [m]
    hessian = [block + block.T for block in (random.normal(size=(n, n)) for n in sizes)]
    dynamics = [random.normal(size=(m, n)) / np.sqrt(n) for n in sizes[:-1]]
    rows = [random.normal(size=(random.integers(0, 4) * (random.random() < 0.4), n)) for n in sizes]
    rows = [np.concatenate([one, one[:1] * 3.0]) if random.random() < 0.3 else one for one in rows]
    form = form_of(hessian, dynamics, rows, [random.random(n) < 0.15 for n in sizes])
    number = sum(len(one) for one in rows)
    active = np.concatenate([random.random(number) < 0.8, form.active[number:]])
    return replace(form, active=active, weights=random.uniform(0.1, 2.0, len(sizes)))


def shifted(form: StageQuadratic, shift: float) -> StageQuadratic:
    """The form with so much curvature taken off everywhere."""
    pairs = zip(form.hessians, form.weights, strict=True)
    return replace(form, hessian=np.concatenate([(H - shift * w * np.eye(len(H))).ravel() for H, w in pairs]))


def dense(form: StageQuadratic) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The whole Hessian, all that is active, and the weights of the norm."""
    begins, m = np.cumsum([0, *form.sizes]), form.states
    number = len(form.active) - begins[-1]
    gaps = np.zeros((m * len(form.steps), begins[-1]))
    for k, F in enumerate(form.steps):
        gaps[k * m : (k + 1) * m, begins[k] : begins[k + 1]] = F
        gaps[k * m : (k + 1) * m, begins[k + 1] : begins[k + 1] + m] -= np.eye(m)
    blocks = np.split(form.rows, np.cumsum(form.row_counts * form.sizes)[:-1])
    rows = scipy.linalg.block_diag(*(one.reshape(-1, n) for one, n in zip(blocks, form.sizes, strict=True)))
    held = np.eye(begins[-1])[form.active[number:]]
    active = np.concatenate([gaps, rows[form.active[:number]], held])
    return scipy.linalg.block_diag(*form.hessians), active, np.repeat(form.weights, form.sizes)


def curvatures(H: np.ndarray, active: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """All curvatures along directions that keep everything, in rising order."""
    Z = scipy.linalg.null_space(active, rcond=1e-9)
    return scipy.linalg.eigh(Z.T @ H @ Z, Z.T @ (weights[:, None] * Z), eigvals_only=True)


@pytest.mark.parametrize("seed", range(60))
def test_least_curvature_is_that_of_the_dense_reduced_hessian(seed: int) -> None:
    """With it planted at zero, the recursion finds all directions above a little less, and one below a little more."""
    random = np.random.default_rng(seed)
    form = random_form(random, *random.integers([1, 1, 0], [9, 6, 4]))
    H, active, weights = dense(form)
    found = curvatures(H, active, weights)
    if len(found) == 0:  # nothing can move
        assert direction_below(form, 1e9) is None
        return
    planted = shifted(form, found[0])
    margin = 1e-6 * max(1.0, np.abs(found).max())
    assert direction_below(planted, -margin) is None
    direction = direction_below(planted, margin)
    assert direction is not None
    assert planted.curvature(direction) <= 1.001 * margin
    assert np.abs(active @ direction).max() < 1e-9 * np.abs(direction).max()


@pytest.mark.parametrize("seed", range(20))
def test_negative_curvature_is_found_in_whichever_stage_it_hides(seed: int) -> None:
    """A definite form with a dent in a direction that all rows allow, of which no single stage knows."""
    random = np.random.default_rng(seed)
    form = random_form(random, 6, 3, 2)
    form = replace(form, hessian=np.concatenate([(H @ H.T + np.eye(len(H))).ravel() for H in form.hessians]))
    assert direction_below(form, 0.0) is None
    found = curvatures(*dense(form))
    if len(found) == 0:
        return
    dented = shifted(form, 1.01 * found[0])
    direction = direction_below(dented, 0.0)
    assert direction is not None
    assert dented.curvature(direction) < 0.0


def test_a_row_that_late_controls_cannot_keep_is_kept_by_earlier_ones() -> None:
    """Four integrators: of the first one's end all but the last four controls decide; what is left is free."""
    m, intervals = 4, 7
    F = np.hstack([np.eye(m) + np.diag(np.ones(m - 1), 1), np.eye(m)[:, -1:]])
    sizes = [m + 1] * intervals + [m]
    rows = [np.zeros((0, n)) for n in sizes]
    rows[-1] = np.eye(m)[:1]
    held = [np.zeros(n, dtype=bool) for n in sizes]
    held[0][:m] = True  # from rest
    hessian = [np.diag([0.0] * m + [1.0] * (n - m)) for n in sizes]
    form = form_of(hessian, [F] * intervals, rows, held)
    least, *_ = curvatures(*dense(form))
    assert direction_below(form, 0.999 * least) is None
    assert direction_below(form, 1.001 * least) is not None


@pytest.mark.parametrize("active", [5, 15, 30])
def test_a_limit_behind_three_lags_that_is_kept_for_long_hides_nothing(active: int) -> None:
    """Keeping the last of three integrators at every node is unstable by 3.7 per node [Astrom 1984]; a lever beside it
    costs next to nothing, and less than nothing once."""
    F = np.array([[1.0, 1.0, 0.5, 1.0 / 6.0, 0.0], [0.0, 1.0, 1.0, 0.5, 0.0], [0.0, 0.0, 1.0, 1.0, 0.0]])
    sizes, begin = [5] * 40 + [3], 4
    held = [np.zeros(n, dtype=bool) for n in sizes]
    for one in held[begin : begin + active]:
        one[0] = True
    hessian = [np.diag([1.0, 1.0, 1.0, 1e-3, 1e-7][:n]) for n in sizes]
    form = form_of(hessian, [F] * 40, [np.zeros((0, n)) for n in sizes], held)
    assert direction_below(form, 0.99e-7) is None
    assert direction_below(form, 1.01e-7) is not None
    hessian[2] = np.diag([1.0, 1.0, 1.0, 1e-3, -1e-7])
    dented = replace(form, hessian=np.concatenate([block.ravel() for block in hessian]))
    assert direction_below(dented, -1.01e-7) is None
    found = direction_below(dented, -0.99e-7)
    assert found is not None
    assert dented.curvature(found) == pytest.approx(-1e-7)


@pytest.mark.parametrize("name", sorted(PROBLEMS))
def test_form_of_a_program_is_its_hessian_and_its_jacobian(name: str) -> None:
    """With some rows and bounds active, against the sparse matrices of the whole program."""
    problem = PROBLEMS[name]
    layout = Layout(problem)
    functions = Evaluation(Assembly(layout, casadi_kernels(problem.system, problem.scheme)))
    w, lam_g = random_point(layout, 3)
    functions.at(w, layout.parameter_values())
    functions.lam_g[:] = lam_g
    matrices = StageMatrices(functions.assembly)
    assert matrices.write(functions.jacobian_sources(), functions.hessian_sources())
    random = np.random.default_rng(4)
    active = random.random(len(layout.row_index) + layout.unknowns) < 0.1
    form = StageQuadratic.of(matrices, active, np.full(layout.intervals + 1, 0.3))
    functions.linearise()
    functions.curve()
    H, J = (
        scipy.sparse.coo_matrix((values, (one.rows, one.columns)), shape=one.shape).toarray()
        for values, one in (
            (functions.hessian, functions.assembly.hessian),
            (functions.jacobian, functions.assembly.jacobian),
        )
    )
    of_rows, held = np.split(active, [len(layout.row_index)])
    places = np.concatenate([layout.gap_index.ravel(), layout.row_index[of_rows]])
    whole = np.concatenate([J[places], np.eye(layout.unknowns)[held]])
    found = curvatures(H, whole, np.full(layout.unknowns, 0.3))
    margin = 1e-6 * np.abs(found).max()
    assert direction_below(form, found[0] - margin) is None
    assert direction_below(form, found[0] + margin) is not None


def swing(stiffness: float, intervals: int = 20, lean: float = 0.0, low: float = -3.0) -> Problem:
    """Least `integral of u^2 / 2 - stiffness (1 - cos y) + lean y` for y' = u from y = 0 to y = 0 in 1 s.

    To stay at y = 0 is stationary without a lean. By Jacobi's condition it is a minimum where the stiffness is below
    pi^2, and a saddle above.
    """
    x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u", 1), ca.SX.sym("p", 0)
    cost = 0.5 * u**2 - stiffness * (1.0 - ca.cos(x[0])) + lean * x[0]
    states = Quantity("y", "rad", lower=low, upper=3.0), Quantity("cost", "1")
    rates = ca.Function("rates", [x, u, p], [ca.vertcat(u, cost)])
    system = System(f"swing {stiffness} {lean} {low}", states, (Quantity("u", "rad/s"),), (), rates)
    start = Boundary("start", {"y": exactly(0.0), "cost": exactly(0.0)})
    phases = (Phase("swing", uniform(intervals), exactly(1.0), Boundary("end", {"y": exactly(0.0)})),)
    return Problem(system, (), start, phases, Objective(time=0.0, terminal={"cost": 1.0}))


def solved(problem: Problem, solver: str, middle: float) -> ProgramSolution:
    """The point that a solver finds from a guess that bulges so far."""
    guess = interpolate(problem, [1.0], [[0.0, 0.0], [0.0, 0.0]], [0.0])
    guess.state[0] = middle * np.sin(np.pi * np.linspace(0.0, 1.0, problem.intervals + 1))
    solution = solve(problem, guess, solver=solver, options=SolverOptions(tolerance=1e-9, curvature=False))
    assert solution.success, solution.status
    return solution


def judged(problem: Problem, solution: ProgramSolution) -> tuple[SecondOrder, np.ndarray]:
    """The verdict and the direction."""
    found = second_order(problem, solution.iterate, solution.multipliers.constraints)
    assert found is not None
    return found


SADDLE, MINIMUM = 1.25 * np.pi**2, 0.8 * np.pi**2


def test_a_saddle_at_which_a_solver_claims_success_is_indefinite() -> None:
    problem = swing(SADDLE)
    solution = solved(problem, "ipopt", 0.0)
    assert np.abs(solution.iterate.state[0]).max() < 1e-6  # it stayed
    verdict, direction = judged(problem, solution)
    assert verdict.curvature is Curvature.INDEFINITE
    assert verdict.least < -ZERO_CURVATURE
    assert verdict.phase == "swing"
    y = direction[Layout(problem).state_index[:, 0]]
    assert y[[0, -1]] == pytest.approx(0.0, abs=1e-9)  # it keeps the ends


@pytest.mark.parametrize("intervals", [20, 40, 80])
def test_the_same_point_is_a_minimum_before_the_conjugate_point_on_every_mesh(intervals: int) -> None:
    problem = swing(MINIMUM, intervals)
    verdict, direction = judged(problem, solved(problem, "interior-point", 0.0))
    assert verdict.curvature is Curvature.POSITIVE
    assert np.isnan(verdict.least)
    assert not direction.any()


@pytest.mark.parametrize(("seconds", "expected"), [(0.1, Curvature.INDEFINITE), (1e-3, Curvature.SINGULAR)])
def test_a_saddle_that_gains_next_to_nothing_is_none(
    seconds: float, expected: Curvature, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The swing in a short part of a second of rest, its cost weighed so that all are as curved."""
    whole = swing(SADDLE / seconds**2, 10)
    states, rate = whole.system.states, Quantity("u", "rad/s", scale=np.pi / seconds)
    rest = Phase("rest", uniform(10), exactly(1.0 - seconds), bounds={"u": exactly(0.0)})
    brief = replace(whole.phases[0], duration=exactly(seconds))
    cost = replace(states[1], scale=1.0 / seconds)
    problem = replace(
        whole,
        system=replace(whole.system, states=(states[0], cost), controls=(rate,)),
        phases=(rest, brief),
        objective=replace(whole.objective, terminal={"cost": 0.02 * seconds**2}),
    )
    guess = interpolate(problem, [1.0 - seconds, seconds], [[0.0] * 3] * 2, [0.0])
    solution = solve(problem, guess, solver="ipopt", options=SolverOptions(tolerance=1e-12, curvature=False))
    verdict, _ = judged(problem, solution)
    assert verdict.curvature is expected
    monkeypatch.setattr(second_order_module, "GAIN_MIN", 0.0)
    verdict, _ = judged(problem, solution)
    assert verdict.curvature is Curvature.INDEFINITE


def test_stages_that_gain_next_to_nothing_hide_no_saddle() -> None:
    """Ten stages whose controls each cost -1e-3 u^2, and a short one behind them of -5e-7 u^2 that is more curved."""

    def form(cost: float) -> StageQuadratic:
        hessian = [np.diag([1.0, one]) for one in (*[2.0 * cost] * 10, -1e-6)]
        nothing = [np.zeros((0, 2)) for _ in hessian]
        whole = form_of(hessian, [np.eye(2)[:1]] * 10, nothing, [np.zeros(2, dtype=np.bool_) for _ in hessian])
        return replace(whole, weights=np.array([*[0.1] * 10, 1e-5]))

    first = direction_below(form(-1e-3), -0.01)
    assert first is not None
    assert np.flatnonzero(first).tolist() == [21]
    assert form(-1e-3).gain(first / np.abs(first).max()) == pytest.approx(5e-7)
    telling = descent_direction(form(-1e-3), 0.01)
    assert telling is not None
    assert form(-1e-3).gain(telling) == pytest.approx(1e-3)
    assert descent_direction(form(1e-3), 0.01) is None


def test_a_step_along_the_direction_leads_to_less_and_to_a_minimum() -> None:
    problem = swing(SADDLE)
    saddle = solved(problem, "ipopt", 0.0)
    best = solved(problem, "ipopt", 0.5)
    assert best.objective < saddle.objective - 0.01
    assert judged(problem, best)[0].curvature is Curvature.POSITIVE


@pytest.mark.parametrize(("lean", "expected"), [(1.0, Curvature.POSITIVE), (0.0, Curvature.SINGULAR)])
def test_a_limit_that_presses_holds_the_direction(lean: float, expected: Curvature) -> None:
    """To y >= 0 a lean presses every y; without one the limit is touched but idle: nobody knows what it holds."""
    stationary = solved(swing(SADDLE), "ipopt", 0.0)
    verdict, _ = judged(swing(SADDLE, lean=lean, low=0.0), stationary)
    assert verdict.curvature is expected
    assert (verdict.weakly_active > 0) == (lean == 0.0)


def test_a_shift_that_costs_nothing_is_singular() -> None:
    """Nothing asks where y begins: all y but its changes are free."""
    free = swing(0.0)
    start = replace(free.start, bounds={"cost": exactly(0.0)})
    problem = replace(free, start=start, phases=(replace(free.phases[0], end=Boundary("end")),))
    verdict, direction = judged(problem, solved(problem, "ipopt", 0.0))
    assert verdict.curvature is Curvature.SINGULAR
    assert abs(verdict.least) < ZERO_CURVATURE
    y = direction[Layout(problem).state_index[:, 0]]
    assert y == pytest.approx(np.ones(len(y)), abs=1e-2)


def corridor(change: float) -> Problem:
    """Least time from x = -1 to x = 1 along a corridor y = 0 in which one is faster by a change than far beside it."""
    x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u", 1), ca.SX.sym("p", 0)
    speed = 1.0 + change * ca.exp(-2.0 * x[1] ** 2)
    rates = ca.Function("rates", [x, u, p], [speed * ca.vertcat(ca.cos(u), ca.sin(u))])
    states, heading = (
        (Quantity("x", "m"), Quantity("y", "m", lower=-2.0, upper=2.0)),
        Quantity("chi", "rad", 1.0, -1.5, 1.5),
    )
    system = System(f"corridor {change}", states, (heading,), (), rates)
    start, half, end = (
        Boundary(name, {"x": exactly(place), **at})
        for name, place, at in (
            ("start", -1.0, {"y": exactly(0.0)}),
            ("half", 0.0, {}),
            ("end", 1.0, {"y": exactly(0.0)}),
        )
    )
    phases = tuple(Phase(one.name, uniform(8), Interval(0.1, 9.0), one) for one in (half, end))
    return Problem(system, (), start, phases)


@pytest.mark.parametrize("solver", ["interior-point", "ipopt"])
@pytest.mark.parametrize(("change", "expected"), [(-0.5, Curvature.INDEFINITE), (0.5, Curvature.POSITIVE)])
def test_straight_through_a_slow_corridor_is_a_saddle_of_time(solver: str, change: float, expected: Curvature) -> None:
    """In two phases of free duration, across whose end the direction goes on."""
    problem = corridor(change)
    duration = 1.0 / (1.0 + change)
    guess = interpolate(problem, [duration] * 2, [[-1.0, 0.0, 1.0], [0.0] * 3], [0.0])
    solution = solve(problem, guess, solver=solver, options=SolverOptions(tolerance=1e-9, curvature=False))
    is_minimum = expected is Curvature.POSITIVE
    assert solution.success is (is_minimum or solver == "ipopt")  # which knows nothing of curvature
    assert (solution.ending is Ending.SADDLE) is not solution.success
    assert solution.kkt.largest < 1e-8
    assert solution.objective == pytest.approx(2.0 * duration, rel=1e-6)
    assert judged(problem, solution)[0].curvature is expected


@pytest.mark.parametrize("factor", [1.0, 10.0])
def test_verdict_is_reported_with_its_threshold(factor: float) -> None:
    """The threshold is relaxed with the multipliers, as the KKT error is."""
    problem = swing(MINIMUM)
    weighed = replace(problem, objective=replace(problem.objective, terminal={"cost": 1e3 * factor}))
    verdict, _ = judged(weighed, solved(weighed, "ipopt", 0.0))
    assert verdict.threshold >= ZERO_CURVATURE
    assert str(verdict) == f"positive, above {verdict.threshold:.1e} s"


@pytest.mark.parametrize("solver", ["interior-point", "ipopt"])
@pytest.mark.parametrize("step", [0.001, STEP_FROM_SADDLE, 1.0])
def test_a_saddle_is_left_for_a_minimum(solver: str, step: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """However long the first step is: straight through the slow corridor, and to stay on the swing."""
    monkeypatch.setattr(solver_module, "STEP_FROM_SADDLE", step)
    straight = interpolate(corridor(-0.5), [2.0] * 2, [[-1.0, 0.0, 1.0], [0.0] * 3], [0.0])
    stay = interpolate(swing(SADDLE), [1.0], [[0.0, 0.0], [0.0, 0.0]], [0.0])
    for problem, guess in ((corridor(-0.5), straight), (swing(SADDLE), stay)):
        layout = Layout(problem)
        saddle, beyond = (
            PreparedProblem(
                layout,
                casadi_kernels(problem.system, problem.scheme),
                solver,
                SolverOptions(tolerance=1e-9, curvature=curvature),
            ).solve(layout, guess)
            for curvature in (False, True)
        )
        assert saddle.success is (solver == "ipopt")
        assert saddle.second_order is None
        assert beyond.success
        assert beyond.objective < saddle.objective - 0.01
        assert beyond.iterations > saddle.iterations
        assert beyond.status.endswith(", beyond a saddle")
        assert beyond.second_order is not None
        assert beyond.second_order.curvature is Curvature.POSITIVE
        assert beyond.kkt.largest < 1e-7


def test_a_saddle_from_which_no_way_leads_down_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a step the solver comes back to it."""
    monkeypatch.setattr(solver_module, "STEP_FROM_SADDLE", 0.0)
    problem = swing(SADDLE)
    layout, kernels = Layout(problem), casadi_kernels(problem.system, problem.scheme)
    guess = interpolate(problem, [1.0], [[0.0, 0.0], [0.0, 0.0]], [0.0])
    found = PreparedProblem(layout, kernels, "ipopt", SolverOptions(curvature=True)).solve(layout, guess)
    assert not found.success
    assert found.ending is Ending.SADDLE
    assert found.kkt.largest < 1e-7
    assert found.second_order is not None
    assert found.second_order.curvature is Curvature.INDEFINITE
