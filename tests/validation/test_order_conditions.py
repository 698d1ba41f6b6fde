"""The tableaus meet the order conditions of rooted trees up to their order, and no further."""

import numpy as np
import pytest
from convergence import SCHEMES
from rooted_trees import gamma, tableau, trees, violation

from airrace.optimal_control.runge_kutta import RK4, RungeKutta

every_scheme = pytest.mark.parametrize("scheme", SCHEMES, ids=lambda scheme: scheme.name)


@every_scheme
def test_all_conditions_up_to_the_order_hold(scheme: RungeKutta) -> None:
    assert [violation(scheme, nodes) for nodes in range(1, scheme.order + 1)] == pytest.approx(
        [0.0] * scheme.order, abs=1e-14
    )


@every_scheme
def test_the_order_is_not_understated(scheme: RungeKutta) -> None:
    assert violation(scheme, scheme.order + 1) > 1e-5


@every_scheme
def test_every_row_has_a_weight_for_each_stage_before_it(scheme: RungeKutta) -> None:
    assert [len(row) for row in scheme.a] == list(range(len(scheme.b)))


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
