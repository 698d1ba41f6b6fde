"""A solver that is told the multipliers begins where they are, on the same mesh and on another one."""

from dataclasses import replace

import numpy as np
import pytest
from small_problems import PROBLEMS, random_iterate

from airrace.optimal_control.kernels import casadi_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.multiplier_transfer import Kind, limits_of, transfer_multipliers
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.refinement import divide
from airrace.optimal_control.solvers.fatrop.stages import LEAST_FACTOR, PrimalDualPoint, plain, weighed
from airrace.optimal_control.solvers.solver import SOLVERS, Multipliers, PreparedProblem, Solution, SolverOptions

EVERYTHING = PROBLEMS["everything"]
ROWS = np.arange(4)
LOWER = np.array([0.0, -np.inf, -1.0, -1.0])
UPPER = np.array([np.inf, 2.0, 1.0, 1.0])
BARRIER = 1e-4


def solved(
    problem: Problem,
    guess: Iterate,
    multipliers: Multipliers | None = None,
    barrier: float = 0.1,
    tolerance: float = 1e-9,
) -> Solution:
    kernels = casadi_kernels(problem.system, problem.scheme)
    options = SolverOptions(tolerance=tolerance, iterations_max=200, barrier=barrier)
    found = PreparedProblem(Layout(problem), kernels, SOLVERS["fatrop"], options, threads=1).solve(
        Layout(problem), guess, multipliers
    )
    assert found.success
    return found


def known(values: list[float], multipliers: list[float]) -> PrimalDualPoint:
    return PrimalDualPoint(np.array(values), np.array(multipliers), BARRIER)


def test_rows_of_which_nothing_is_known_stay_as_they_are() -> None:
    sides = plain(ROWS, LOWER, UPPER)
    assert sides.items.tolist() == ROWS.tolist()
    assert sides.factors.tolist() == [1.0] * 4
    assert (sides.lower.tolist(), sides.upper.tolist()) == (LOWER.tolist(), UPPER.tolist())


def test_multiplier_of_a_weighed_side_is_one() -> None:
    """Each row presses on one of its limits: its side times its factor has the multiplier 1."""
    sides = weighed(ROWS, LOWER, UPPER, known([0.0, 2.0, 1.0, -1.0], [-3.0, 5.0, 0.7, -0.4]))
    assert sides.copies.tolist() == [1, 1, 2, 2]
    assert sides.items.tolist() == [0, 1, 2, 2, 3, 3]
    pressing = [0, 1, 3, 4]
    assert sides.factors[pressing] == pytest.approx([3.0, 5.0, 0.7, 0.4])
    assert sides.factors[[2, 5]] == pytest.approx([LEAST_FACTOR] * 2)


def test_weighed_sides_ask_for_the_same() -> None:
    generator = np.random.default_rng(1)
    for _ in range(50):
        at, lam = generator.uniform(-1.0, 1.0, 4), generator.normal(size=4) * generator.integers(0, 2, 4)
        sides = weighed(ROWS, LOWER, UPPER, PrimalDualPoint(at, lam, BARRIER))
        for v in (-1.5, -1.0, -0.2, 0.0, 0.9, 1.0, 1.7, 2.0, 2.5):
            values = sides.factors * v + sides.shifts
            within = (sides.lower - 1e-12 <= values) & (values <= sides.upper + 1e-12)
            met = [bool(within[sides.items == row].all()) for row in ROWS]
            assert met == [bool(low <= v <= high) for low, high in zip(LOWER, UPPER, strict=True)]


@pytest.mark.parametrize("slack", [0.2, 0.4])
def test_slack_times_multiplier_is_the_barrier_where_nothing_presses(slack: float) -> None:
    given = PrimalDualPoint(np.array([slack]), np.zeros(1), barrier=0.01)
    sides = weighed(ROWS[:1], LOWER[:1], UPPER[:1], given)
    assert sides.factors * slack == pytest.approx(given.barrier)
    assert sides.factors[0] > LEAST_FACTOR


@pytest.mark.parametrize("name", ["everything", "jumps", "final cost"])
def test_known_multipliers_lead_to_the_same_optimum_in_fewer_iterations(name: str) -> None:
    problem = PROBLEMS[name]
    first = solved(problem, random_iterate(problem, 1))
    cold = solved(problem, first.iterate, barrier=1e-6)
    warm = solved(problem, first.iterate, first.multipliers, barrier=1e-6)
    assert warm.iterations < cold.iterations
    assert warm.objective == pytest.approx(cold.objective, abs=1e-7)
    assert warm.kkt.largest < 1e-6
    assert warm.multipliers.constraints == pytest.approx(cold.multipliers.constraints, abs=1e-4)


def test_multipliers_that_mislead_do_not_change_the_optimum() -> None:
    first = solved(EVERYTHING, random_iterate(EVERYTHING, 1))
    wrong = Multipliers(-first.multipliers.constraints[::-1].copy(), 0.3 * np.ones_like(first.multipliers.bounds))
    found = solved(EVERYTHING, first.iterate, wrong, barrier=1e-2)
    assert found.objective == pytest.approx(first.objective, abs=1e-6)


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
    fine = Layout(
        replace(
            EVERYTHING,
            phases=tuple(
                replace(phase, fractions=fractions) for phase, fractions in zip(EVERYTHING.phases, mesh, strict=True)
            ),
        )
    )
    both = np.zeros(coarse.constraints + coarse.unknowns)
    limits = limits_of(coarse)
    for (kind, _), limit in limits.items():
        if kind in (Kind.NODE, Kind.INTERVAL):
            both[limit.places] = limit.weights
    found = transfer_multipliers(Multipliers(both[: coarse.constraints], both[coarse.constraints :]), coarse, fine)
    there = np.concatenate([found.constraints, found.bounds])
    for key, limit in limits_of(fine).items():
        if key in limits and key[0] in (Kind.NODE, Kind.INTERVAL):
            expected = limit.weights * np.isin(np.floor(limit.along), np.floor(limits[key].along))
            assert there[limit.places] == pytest.approx(expected, rel=1e-12)


def test_multipliers_carried_to_a_finer_mesh_save_iterations() -> None:
    problem = PROBLEMS["one phase"]
    first = solved(problem, random_iterate(problem, 1))
    mesh, guess = divide(problem.mesh, first.iterate, None, np.full(problem.intervals, 2))
    (phase,) = problem.phases
    finer = replace(problem, phases=(replace(phase, fractions=mesh[0]),))
    multipliers = transfer_multipliers(first.multipliers, Layout(problem), Layout(finer))
    cold, warm = (solved(finer, guess, one, barrier=1e-4) for one in (None, multipliers))
    assert warm.iterations <= cold.iterations
    assert warm.objective == pytest.approx(cold.objective, abs=1e-6)
