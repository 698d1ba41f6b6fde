"""Warm starts: known multipliers, the predictor-corrector method and the Riccati recursion that solves its steps."""

from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from small_problems import PROBLEMS, random_iterate, random_point

from airrace.optimal_control import sparse_assembly
from airrace.optimal_control.assembly import Assembly
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.kernels import casadi_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.mesh_refinement import divide, limits_of, transfer_multipliers
from airrace.optimal_control.problem import Boundary, Iterate, Objective, Phase, Problem, uniform
from airrace.optimal_control.runge_kutta import RK4
from airrace.optimal_control.solvers import predictor_corrector
from airrace.optimal_control.solvers.fatrop.stages import (
    INEQUALITIES,
    LEAST_FACTOR,
    InitialPoint,
    Rows,
    Stages,
    scale_by_multipliers,
)
from airrace.optimal_control.solvers.interface import Algorithm, Bounds, Multipliers, SolverOptions
from airrace.optimal_control.solvers.predictor_corrector import StageSystem
from airrace.optimal_control.solvers.solver import PreparedProblem, Solution
from airrace.optimal_control.sparse_assembly import COOBuilder, Entries, Memory, StageAssembly, unique_rows
from airrace.quantities import Interval, Quantity
from airrace.system import System
from airrace.trajectory import Array

STEPS = "predictor-corrector"
LIMITS_KEPT = 1e-5  # fatrop relaxes limits by 1e-8 after their factors of 1e-2 and more


def solved(
    problem: Problem,
    guess: Iterate,
    multipliers: Multipliers | None = None,
    barrier: float = 1e-5,
    *,
    algorithm: Algorithm = "predictor-corrector",
    tolerance: float = 1e-8,
) -> Solution:
    kernels = casadi_kernels(problem.system, problem.scheme)
    options = SolverOptions(tolerance, 200, barrier, algorithm=algorithm)
    prepared = PreparedProblem(Layout(problem), kernels, "fatrop", options, threads=1)
    found = prepared.solve(Layout(problem), guess, multipliers)
    assert found.success
    return found


def bisect_all(name: str) -> tuple[Problem, Iterate, Multipliers]:
    """A problem on a mesh twice as fine, with the optimum on its own mesh and its multipliers carried over."""
    problem = PROBLEMS[name]
    first = solved(problem, random_iterate(problem, 1), barrier=0.1)
    mesh, guess = divide(problem.mesh, first.iterate, None, np.full(problem.intervals, 2))
    phases = tuple(replace(phase, fractions=cut) for phase, cut in zip(problem.phases, mesh, strict=True))
    finer = replace(problem, phases=phases)
    return finer, guess, transfer_multipliers(first.multipliers, Layout(problem), Layout(finer))


@pytest.mark.parametrize("name", ["everything", "jumps", "final cost", "one phase"])
def test_steps_lead_to_the_optimum_that_fatrop_finds_in_fewer_iterations(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem, guess, multipliers = bisect_all(name)
    found = solved(problem, guess, multipliers)
    monkeypatch.setattr(predictor_corrector, "library", lambda: None)
    expected = solved(problem, guess, multipliers)
    assert STEPS in found.status
    assert STEPS not in expected.status
    assert found.iterations < expected.iterations
    assert found.objective == pytest.approx(expected.objective, abs=LIMITS_KEPT)
    assert found.kkt.largest < 1e-7
    assert found.multipliers.constraints == pytest.approx(expected.multipliers.constraints, abs=1e-3)


@pytest.mark.parametrize("known", [False, True])
def test_fatrop_is_asked_where_steps_give_up(known: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    problem, guess, multipliers = bisect_all("everything")
    expected = solved(problem, guess, multipliers)
    few = replace(predictor_corrector.PARAMETERS, iterations_max=1)
    monkeypatch.setattr(predictor_corrector, "PARAMETERS", few)
    found = solved(problem, guess, multipliers if known else None)
    assert STEPS not in found.status
    assert found.iterations > 1
    assert found.objective == pytest.approx(expected.objective, abs=LIMITS_KEPT)


@pytest.mark.parametrize(
    ("downhill", "nearly_feasible", "led_on"), [(5, 1e-3, True), (6, 1e-3, False), (5, 0.0, False)]
)
def test_steps_go_on_as_long_as_they_lead_downhill(
    downhill: int, nearly_feasible: float, led_on: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem, guess, multipliers = bisect_all("everything")
    slow = replace(guess, durations=1.2 * guess.durations)  # from there the fifth step leads to the optimum
    few = replace(
        predictor_corrector.PARAMETERS,
        iterations_max=4,
        downhill=downhill,
        nearly_feasible=nearly_feasible,
        nearly_optimal=0.0,
    )
    monkeypatch.setattr(predictor_corrector, "PARAMETERS", few)
    assert (STEPS in solved(problem, slow, multipliers).status) is led_on


def with_idle_control(cost: Callable[[ca.SX], ca.SX], least: float, idle: float) -> Solution:
    """The optimum of a problem with a control between `least` and 1 that only its cost is of, from a guess of it."""
    x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u", 2), ca.SX.sym("p", 0)
    rates = ca.Function("rates", [x, u, p], [ca.vertcat(u[0], 4.0 * cost(u[1]))])
    states = Quantity("x", "1"), Quantity("cost", "1")
    system = System("idle", states, (Quantity("u", "1"), Quantity("idle", "1", lower=least, upper=1.0)), (), rates)
    exactly = Interval.exactly
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
    found = solved(problem, Iterate(np.array([1.0]), state, control), known, barrier=1e-8, tolerance=1e-7)
    assert STEPS in found.status
    return found


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


def test_steps_that_lead_nowhere_begin_again_with_a_larger_barrier_parameter(monkeypatch: pytest.MonkeyPatch) -> None:
    parameters = replace(predictor_corrector.PARAMETERS, as_long=np.inf)  # what goes to and fro is not damped
    monkeypatch.setattr(predictor_corrector, "PARAMETERS", parameters)
    found = with_idle_control(cycling_cost, -1.0, 0.3)
    assert parameters.recentred_every < found.iterations <= parameters.recentred_every + 10
    assert found.iterate.control[1] == pytest.approx(0.0, abs=1e-2)


@pytest.mark.parametrize(("algorithm", "barrier"), [("predictor-corrector", 1e-5), ("line-search", 1e-2)])
def test_multipliers_that_mislead_do_not_change_the_optimum(algorithm: Algorithm, barrier: float) -> None:
    problem, guess, multipliers = bisect_all("everything")
    expected = solved(problem, guess, multipliers)
    wrong = Multipliers(-multipliers.constraints[::-1].copy(), 0.3 * np.ones_like(multipliers.bounds))
    found = solved(problem, guess, wrong, barrier, algorithm=algorithm)
    assert found.objective == pytest.approx(expected.objective, abs=LIMITS_KEPT)


@pytest.mark.parametrize("known", [False, True])
def test_steps_come_first_where_the_options_say_so(known: bool) -> None:
    problem, guess, multipliers = bisect_all("everything")
    known_multipliers = multipliers if known else None
    first = solved(problem, guess, known_multipliers)
    other = solved(problem, guess, known_multipliers, algorithm="line-search")
    assert STEPS in first.status
    assert STEPS not in other.status
    assert first.objective == pytest.approx(other.objective, abs=LIMITS_KEPT)


EVERYTHING = PROBLEMS["everything"]
ROWS = np.arange(4)
LOWER = np.array([0.0, -np.inf, -1.0, -1.0])
UPPER = np.array([np.inf, 2.0, 1.0, 1.0])
BARRIER = 1e-4


def solve_from(
    problem: Problem, guess: Iterate, multipliers: Multipliers | None = None, barrier: float = 0.1
) -> Solution:
    return solved(problem, guess, multipliers, barrier, algorithm="line-search", tolerance=1e-9)


def known(values: list[float], multipliers: list[float]) -> InitialPoint:
    return InitialPoint(np.array(values), np.array(multipliers), BARRIER)


def test_multiplier_of_a_weighed_side_is_one() -> None:
    """Each row presses on one of its limits: its side times its factor has the multiplier 1."""
    sides = scale_by_multipliers(ROWS, LOWER, UPPER, known([0.0, 2.0, 1.0, -1.0], [-3.0, 5.0, 0.7, -0.4]))
    assert sides.copies.tolist() == [1, 1, 2, 2]
    assert sides.items.tolist() == [0, 1, 2, 2, 3, 3]
    pressing = [0, 1, 3, 4]
    assert sides.factors[pressing] == pytest.approx([3.0, 5.0, 0.7, 0.4])
    assert sides.factors[[2, 5]] == pytest.approx([LEAST_FACTOR] * 2)


def test_weighed_sides_ask_for_the_same() -> None:
    generator = np.random.default_rng(1)
    for _ in range(50):
        at, lam = generator.uniform(-1.0, 1.0, 4), generator.normal(size=4) * generator.integers(0, 2, 4)
        sides = scale_by_multipliers(ROWS, LOWER, UPPER, InitialPoint(at, lam, BARRIER))
        for v in (-1.5, -1.0, -0.2, 0.0, 0.9, 1.0, 1.7, 2.0, 2.5):
            values = sides.factors * v + sides.shifts
            within = (sides.lower - 1e-12 <= values) & (values <= sides.upper + 1e-12)
            met = [bool(within[sides.items == row].all()) for row in ROWS]
            assert met == [bool(low <= v <= high) for low, high in zip(LOWER, UPPER, strict=True)]


@pytest.mark.parametrize("slack", [0.2, 0.4])
def test_slack_times_multiplier_is_the_barrier_where_nothing_presses(slack: float) -> None:
    given = InitialPoint(np.array([slack]), np.zeros(1), barrier=0.01)
    sides = scale_by_multipliers(ROWS[:1], LOWER[:1], UPPER[:1], given)
    assert sides.factors * slack == pytest.approx(given.barrier)
    assert sides.factors[0] > LEAST_FACTOR


@pytest.mark.parametrize("name", ["everything", "jumps", "final cost"])
def test_known_multipliers_lead_to_the_same_optimum_in_fewer_iterations(name: str) -> None:
    problem = PROBLEMS[name]
    first = solve_from(problem, random_iterate(problem, 1))
    cold = solve_from(problem, first.iterate, barrier=1e-6)
    warm = solve_from(problem, first.iterate, first.multipliers, barrier=1e-6)
    assert warm.iterations < cold.iterations
    assert warm.objective == pytest.approx(cold.objective, abs=1e-7)
    assert warm.kkt.largest < 1e-6
    assert warm.multipliers.constraints == pytest.approx(cold.multipliers.constraints, abs=1e-4)


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


def test_multipliers_carried_to_a_finer_mesh_save_iterations() -> None:
    finer, guess, multipliers = bisect_all("one phase")
    cold, warm = (solve_from(finer, guess, one, barrier=1e-4) for one in (None, multipliers))
    assert warm.iterations <= cold.iterations
    assert warm.objective == pytest.approx(cold.objective, abs=1e-6)


def evaluated(name: str) -> tuple[Evaluation, np.ndarray, np.ndarray]:
    """The program at a random point, with its dense Hessian and Jacobian."""
    problem = PROBLEMS[name]
    layout = Layout(problem)
    functions = Evaluation(Assembly(layout, casadi_kernels(problem.system, problem.scheme)))
    w, lam_g = random_point(layout, 3)
    functions.at(w, layout.parameter_values())
    functions.lam_f, functions.lam_g[:] = 1.0, lam_g
    functions.linearise()
    functions.curve()
    H, J = np.zeros((layout.unknowns, layout.unknowns)), np.zeros((layout.constraints, layout.unknowns))
    for matrix, sums, nonzeros in (
        (H, functions.assembly.hessian, functions.hessian),
        (J, functions.assembly.jacobian, functions.jacobian),
    ):
        matrix[sums.rows, sums.columns] = nonzeros
    return functions, H, J


def written(functions: Evaluation) -> StageSystem:
    system = StageSystem(functions.assembly)
    assert system.write(functions.jacobian_sources(), functions.hessian_sources())
    return system


@pytest.mark.parametrize("name", PROBLEMS)
def test_step_solves_the_system_of_the_whole_program_and_leads_to_a_minimum(name: str) -> None:
    functions, H, J = evaluated(name)
    layout = functions.assembly.layout
    system, random = written(functions), np.random.default_rng(4)
    weights = random.uniform(50.0, 100.0, system.rows + system.unknowns)
    assert system.factorise(weights)
    stationarity, gaps = random.normal(size=system.unknowns), random.normal(size=system.gaps)
    step, multipliers = system.solve(stationarity, gaps)
    G, C = J[layout.gap_index.ravel()], J[layout.row_index]
    curvature = H + C.T @ (weights[: system.rows, None] * C) + np.diag(weights[system.rows :])
    assert curvature @ step + G.T @ multipliers == pytest.approx(stationarity, abs=1e-9)
    assert G @ step == pytest.approx(gaps, abs=1e-10)
    values = random.normal(size=system.rows + system.unknowns)
    assert system.values(step) == pytest.approx(np.concatenate([C @ step, step]), abs=1e-12)
    expected = C.T @ values[: system.rows] + values[system.rows :]
    assert system.transpose_multiply(values) == pytest.approx(expected, abs=1e-12)
    weights = np.zeros(system.rows + system.unknowns)
    weights[system.rows :] = -1e3
    assert not system.factorise(weights)  # this step leads to no minimum


def test_identity_stands_in_for_the_hessian() -> None:
    functions, _, J = evaluated("everything")
    system = StageSystem(functions.assembly)
    assert system.write_identity(functions.jacobian_sources())
    assert system.factorise(np.zeros(system.rows + system.unknowns))
    stationarity = np.random.default_rng(6).normal(size=system.unknowns)
    step, multipliers = system.solve(stationarity, np.zeros(system.gaps))
    G = J[functions.assembly.layout.gap_index.ravel()]
    assert step + G.T @ multipliers == pytest.approx(stationarity, abs=1e-10)
    system.clear()
    assert system.write(functions.jacobian_sources(), functions.hessian_sources())
    other = written(functions)
    weights = np.full(system.rows + system.unknowns, 50.0)
    assert system.factorise(weights) == other.factorise(weights)
    assert system.solve(stationarity, np.zeros(system.gaps))[0] == pytest.approx(
        other.solve(stationarity, np.zeros(system.gaps))[0], abs=1e-12
    )


def test_without_a_library_nothing_is_available(monkeypatch: pytest.MonkeyPatch) -> None:
    functions, _, _ = evaluated("everything")
    assert predictor_corrector.available(functions.assembly)
    monkeypatch.setattr(predictor_corrector, "library", lambda: None)
    assert not predictor_corrector.available(functions.assembly)


ROOM = 4000
"""More numbers than the matrices of any of these stages have."""


@pytest.fixture(params=PROBLEMS, scope="module")
def functions(request: pytest.FixtureRequest) -> Evaluation:
    """A program at some point."""
    problem = PROBLEMS[request.param]
    layout = Layout(problem)
    found = Evaluation(Assembly(layout, casadi_kernels(problem.system, problem.scheme)))
    found.at(random_point(layout, 1)[0], layout.parameter_values())
    found.lam_g[:] = np.random.default_rng(1).normal(size=layout.constraints)
    return found


def rows_of(functions: Evaluation, *, weighed: bool) -> Rows:
    layout = functions.assembly.layout
    bounds = Bounds(*layout.unknown_bounds(), *layout.constraint_bounds())
    known = None
    if weighed:
        values = np.concatenate([functions.g, functions.w])
        known = InitialPoint(values, np.random.default_rng(2).normal(size=len(values)), 1e-3)
    return Rows(Stages(functions.assembly), bounds, known)


def empty(stages: int, families: int) -> Memory:
    begins = ROOM * np.arange(stages * families).reshape(stages, families)
    return Memory(np.full(begins.size * ROOM, np.pi), begins)


@pytest.fixture(params=["native", "numpy"])
def added_up_by(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if request.param == "numpy":
        monkeypatch.setattr(sparse_assembly, "library", lambda: None)
    assert (sparse_assembly.library() is not None) == (request.param == "native")


@pytest.mark.usefixtures("added_up_by")
@pytest.mark.parametrize("weighed", [False, True])
def test_the_jacobian_of_every_stage_is_that_of_the_program(functions: Evaluation, *, weighed: bool) -> None:
    rows = rows_of(functions, weighed=weighed)
    memory = empty(rows.stages.count, 3)
    assert rows.jacobian.write(functions.jacobian_sources(), memory, rows.weights)
    functions.linearise()
    whole = functions.assembly.jacobian
    numbers, items = rows.locate(whole)
    places = rows.stages.place_in_stage[whole.columns[numbers]]
    at = memory.begins[rows.columns.stages[items], rows.columns.families[items]] + rows.offsets(items, places)
    assert memory.doubles[at].tolist() == (functions.jacobian[numbers] * rows.factors[items]).tolist()
    assert (np.delete(memory.doubles, at) == np.pi).all()


@pytest.mark.usefixtures("added_up_by")
def test_the_hessian_of_every_stage_is_that_of_the_program(functions: Evaluation) -> None:
    stages = Stages(functions.assembly)
    memory = empty(stages.count, 1)
    assert stages.hessian.write(functions.hessian_sources(), memory)
    functions.curve()
    whole = functions.assembly.hessian
    stage = stages.stage_of_unknown[whole.rows]
    row, column = stages.place_in_stage[whole.rows], stages.place_in_stage[whole.columns]
    at = memory.begins[stage, 0] + stages.matrices.offsets(stage, row, column)
    assert memory.doubles[at].tolist() == functions.hessian.tolist()
    assert (np.delete(memory.doubles, at) == np.pi).all()
    stages.hessian.fill(stages.on_diagonal.astype(np.float64), memory)
    assert memory.doubles[at].tolist() == (row == column).astype(np.float64).tolist()


@pytest.mark.usefixtures("added_up_by")
@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_what_is_no_number_is_told_and_can_be_cleaned(functions: Evaluation, number: float) -> None:
    rows = rows_of(functions, weighed=False)
    memory, drawn = empty(rows.stages.count, 3), functions.jacobian_sources()
    drawn[: len(drawn) // 2] = number
    assert not rows.jacobian.write(drawn, memory, rows.weights)
    assert not np.isfinite(memory.doubles).all()
    rows.jacobian.clean(memory)
    assert np.isfinite(memory.doubles).all()


def test_a_finer_mesh_has_stages_of_the_same_kinds() -> None:
    problem = PROBLEMS["one phase"]
    (phase,) = problem.phases
    counts: list[int] = []
    for intervals in (20, 80):
        finer = replace(problem, phases=(replace(phase, fractions=(1.0 / intervals,) * intervals, watches=()),))
        assembly = Assembly(Layout(finer), casadi_kernels(finer.system, finer.scheme))
        counts.append(len(unique_rows(assembly.structure_keys(rows=True))[1]))
    assert counts[0] == counts[1] < 8


def test_inequalities_alone_have_factors(functions: Evaluation) -> None:
    rows = rows_of(functions, weighed=True)
    own = rows.columns.families == INEQUALITIES
    assert rows.weights.values.tolist() == rows.factors[own].tolist()
    first = rows.weights.begins[rows.columns.stages[own]] + rows.columns.numbers[own]
    assert first.tolist() == list(range(own.sum()))


def test_rows_are_of_a_kind_where_all_numbers_are_equal() -> None:
    kind, first = unique_rows(np.array([[1, 2], [3, 4], [1, 2], [1, 4]]))
    assert kind[0] == kind[2]
    assert len(set(kind.tolist())) == 3
    assert [kind[one] for one in first] == [0, 1, 2]
    assert sorted(first.tolist()) == [0, 1, 3]


def test_numbers_of_several_blocks_and_turns_are_added_in_order() -> None:
    """Two stages are alike: the third number of each is the sum of three, from two blocks."""
    contributions = COOBuilder(4, 1)
    numbers = np.arange(3)
    contributions.add_block(6, np.array([0, 3]))
    contributions.add(numbers, np.zeros(3, dtype=np.int64), np.array([1.0, 10.0, 1e16]), numbers)
    contributions.add_block(2, np.array([0, 1]))
    for weight in (1.0, -1e16):
        contributions.add(np.array([2]), np.array([0]), np.array([weight]), np.array([0]))
    sums = contributions.build()
    nothing = np.zeros(3, dtype=np.int64)
    entries = Entries(nothing, numbers)
    repeated, memory = (
        StageAssembly(sums, entries, np.zeros(2, dtype=np.int64)),
        Memory(np.zeros(8), np.array([[0], [4]])),
    )
    drawn: Array = np.array([1.0, 2.0, 1.0, 3.0, 4.0, 1.0, 1.0, 1.0])
    assert repeated.write(drawn, memory)
    third = (1e16 + 1.0) - 1e16
    assert memory.doubles.tolist() == [1.0, 20.0, third, 0.0, 3.0, 40.0, third, 0.0]
