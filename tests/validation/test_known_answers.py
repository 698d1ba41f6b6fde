"""Textbook problems with known answers, and orders of convergence."""

import functools
import math
from dataclasses import dataclass

import delta_iii
import double_integrator
import level_turn
import numpy as np
import pytest
import reorientation
from convergence import MESHES, SCHEMES, integration_errors, observed_order, optimum_errors, order_of_optima
from numpy.typing import NDArray
from statement import KnownAnswer, objective
from textbook import known_answers

from airrace.optimal_control.problem import interpolate
from airrace.optimal_control.runge_kutta import DORMAND_PRINCE_5, RK4, RungeKutta
from airrace.optimal_control.solve_problem import solve
from airrace.optimal_control.solvers.interface import Ending

both_solvers = pytest.mark.parametrize("solver", ["interior-point", "ipopt"])


@both_solvers
@pytest.mark.parametrize("answer", known_answers(), ids=lambda answer: answer.name)
def test_optimum_has_the_known_values(answer: KnownAnswer, solver: str) -> None:
    solution = answer.solve(solver)
    assert solution.success, solution.status
    for value in answer.values:
        assert value.of(solution) == pytest.approx(float(value.published), abs=value.tolerance), value.name


@both_solvers
def test_free_switches_and_turns_take_as_long_as_the_closed_forms_say(solver: str) -> None:
    solution = double_integrator.known_answers()[0].solve(solver)
    assert solution.iterate.durations == pytest.approx([1.0, 1.0], abs=1e-6)
    assert solution.iterate.control.ravel() == pytest.approx([-1.0, 1.0], abs=1e-6)
    solution = level_turn.known_answers()[0].solve(solver)
    assert solution.iterate.durations[[0, 2]] == pytest.approx(level_turn.phi_m / level_turn.p, abs=1e-5)


def test_closed_forms_give_the_numbers_that_are_quoted() -> None:
    closed = {answer.name: float(value.published) for answer in known_answers() for value in answer.values}
    assert closed["level turn, limited roll"] == pytest.approx(4.4127867, abs=5e-8)
    assert closed["sliding mass, 4 phases"] == pytest.approx(0.4472136, abs=5e-8)


@both_solvers
def test_body_switching_freely_turns_with_all_its_torque(solver: str) -> None:
    (answer,) = reorientation.known_answers()
    assert np.abs(answer.solve(solver).iterate.control) == pytest.approx(50.0, abs=1e-3)


@both_solvers
def test_body_on_a_uniform_mesh_takes_little_longer_than_the_published_time(solver: str) -> None:
    problem, guess = reorientation.on_a_uniform_mesh(60)
    solution = KnownAnswer("uniform", problem, guess, ()).solve(solver)
    assert solution.success, solution.status
    assert 28.6304 < objective(solution) < 28.6304 + 0.01
    middle_of_arc = [5, 20, 28, 35, 48, 57]
    signs = np.sign(solution.iterate.control[:, middle_of_arc]).T.tolist()
    assert signs == [list(arc) for arc in reorientation.SIGNS]


def test_an_ascent_through_the_earth_is_given_up_at_once() -> None:
    """Air at a depth of 200 km makes derivatives from which a solver may never come back."""
    problem, guess = delta_iii.ascent((2, 2, 2, 2))
    begin = guess.state[:, 0]
    share = np.linspace(0.0, 1.0, 5)
    states = np.repeat(begin[:, None], 5, axis=1)
    above, east = begin[:3] / np.linalg.norm(begin[:3]), np.array([0.0, 1.0, 0.0])
    orbit = 6.55e6 * (np.cos(0.55) * above + np.sin(0.55) * east)
    states[:3] = np.outer(begin[:3], 1 - share) + np.outer(orbit, share)
    states[3:6] = np.outer([-7000.0, 7000.0, -2000.0], share)
    states[6] = begin[6] * (1 - share) + 7600.0 * share
    straight = interpolate(problem, guess.durations, states, [0.0, 0.0])
    solution = solve(problem, straight, stall_seconds=60.0)
    assert not solution.success
    assert solution.ending in (Ending.NOT_FINITE, Ending.NO_STEP)
    assert solution.iterations < 50


every_scheme = pytest.mark.parametrize("scheme", SCHEMES, ids=lambda scheme: scheme.name)


@every_scheme
def test_errors_of_integration_and_of_an_optimum_fall_with_the_order_of_the_scheme(scheme: RungeKutta) -> None:
    assert observed_order(integration_errors, scheme) == pytest.approx(scheme.order, abs=0.2)
    assert observed_order(optimum_errors, scheme) == pytest.approx(order_of_optima(scheme), abs=0.2)


def test_a_symmetric_growth_flatters_an_odd_order() -> None:
    """Why the growth that is measured is not symmetric."""
    errors = np.array(optimum_errors(DORMAND_PRINCE_5, [16, 32, 64], reached=0.9))
    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx(6.0, abs=0.1)


@every_scheme
def test_two_steps_in_an_interval_are_one_step_in_each_half(scheme: RungeKutta) -> None:
    errors = np.array(integration_errors(scheme, [2 * intervals for intervals in MESHES[:3]]))
    doubled = RungeKutta("doubled", scheme.order, scheme.a, scheme.b, steps=2 * scheme.steps)
    assert np.array(integration_errors(doubled, MESHES[:3])) == pytest.approx(errors, rel=1e-9)


@every_scheme
def test_all_conditions_up_to_the_order_hold_and_no_more(scheme: RungeKutta) -> None:
    assert [len(row) for row in scheme.a] == list(range(len(scheme.b)))
    conditions = [violation(scheme, nodes) for nodes in range(1, scheme.order + 1)]
    assert conditions == pytest.approx([0.0] * scheme.order, abs=1e-14)
    assert violation(scheme, scheme.order + 1) > 1e-5


def test_trees_are_as_many_as_counted_and_their_densities_as_known() -> None:
    assert [len(trees(nodes)) for nodes in range(1, 8)] == [1, 1, 2, 4, 9, 20, 48]  # Cayley 1857
    assert sorted(gamma(tree) for tree in trees(4)) == [4, 8, 12, 24]  # bushy 4, then 8 and 12, tall 24


def test_a_wrong_weight_is_found() -> None:
    wrong = RungeKutta("wrong", 4, RK4.a, (1 / 6, 1 / 3 + 1e-6, 1 / 3 - 1e-6, 1 / 6))
    assert violation(wrong, 1) < 1e-14
    assert max(violation(wrong, nodes) for nodes in (2, 3, 4)) > 1e-8


def test_two_steps_halve_the_nodes() -> None:
    twice = tableau(RungeKutta("twice", 4, RK4.a, RK4.b, steps=2))
    assert twice.A.sum(axis=1) == pytest.approx([0, 0.25, 0.25, 0.5, 0.5, 0.75, 0.75, 1.0])
    assert twice.b.sum() == pytest.approx(1.0)
    assert not np.triu(twice.A).any()


Tree = tuple["Tree", ...]  # of the branches at its root, sorted; a single node has none


@dataclass(frozen=True)
class Tableau:
    """Weights of a whole interval: `A` (s, s) and `b` (s,)."""

    A: NDArray[np.float64]
    b: NDArray[np.float64]


def tableau(scheme: RungeKutta) -> Tableau:
    """Of all steps of an interval, taken as one."""
    stages, steps = len(scheme.b), scheme.steps
    own = np.array([[*row, *[0.0] * (stages - len(row))] for row in scheme.a])
    A = np.zeros((stages * steps, stages * steps))
    for step in range(steps):
        rows = slice(step * stages, (step + 1) * stages)
        A[rows, rows] = own / steps
        A[rows, : step * stages] = np.tile(np.array(scheme.b) / steps, step)
    return Tableau(A, np.tile(np.array(scheme.b) / steps, steps))


@functools.cache
def trees(nodes: int) -> tuple[Tree, ...]:
    """All rooted trees with this many nodes."""
    if nodes == 1:
        return ((),)
    # a node more is a leaf more, somewhere
    return tuple(sorted({grown for tree in trees(nodes - 1) for grown in with_a_leaf(tree)}))


def with_a_leaf(tree: Tree) -> set[Tree]:
    """The tree with one leaf more, at any of its nodes."""
    grown = {tuple(sorted((*tree, ())))}
    for index, branch in enumerate(tree):
        others = tree[:index] + tree[index + 1 :]
        grown |= {tuple(sorted((*others, larger))) for larger in with_a_leaf(branch)}
    return grown


def size(tree: Tree) -> int:
    """Number of nodes."""
    return 1 + sum(size(branch) for branch in tree)


def gamma(tree: Tree) -> int:
    """The tree's density: the product of the sizes of all its subtrees."""
    return size(tree) * math.prod(gamma(branch) for branch in tree)


def elementary_weight(scheme: Tableau, tree: Tree) -> float:
    """What the scheme makes of the tree's elementary differential."""
    return float(scheme.b @ _at_stages(scheme, tree))


def _at_stages(scheme: Tableau, tree: Tree) -> NDArray[np.float64]:
    product = np.ones(len(scheme.b))
    for branch in tree:
        product = product * (scheme.A @ _at_stages(scheme, branch))
    return product


def violation(scheme: RungeKutta, nodes: int) -> float:
    """By how much the worst of the conditions of this order is missed."""
    weights = tableau(scheme)
    return max(abs(elementary_weight(weights, tree) - 1 / gamma(tree)) for tree in trees(nodes))
