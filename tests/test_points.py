"""Functions at many points: the bits of casadi's own calls, without its matrices."""

import casadi as ca
import numpy as np
import pytest

from airrace.points import at_points

RANDOM = np.random.default_rng(3)


def example(*, sparse: bool = False) -> ca.Function:
    x, p = ca.SX.sym("x", 3), ca.SX.sym("p", 2)
    found = ca.vertcat(ca.sin(x[0]) * p[1], 0.0 if sparse else x[2] ** 2, ca.atan2(x[1], x[2]) + p[0])
    return ca.Function("example", [x, p], [ca.sparsify(found) if sparse else found])


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("count", [1, 7, 400])
def test_result_has_the_bits_of_a_call_of_casadi(count: int, sparse: bool) -> None:
    function = example(sparse=sparse)
    x, p = RANDOM.normal(size=(3, count)), RANDOM.normal(size=(2, count))
    assert np.array_equal(at_points(function, x, p), np.asarray(function.map(count)(x, p)))


def test_what_is_the_same_at_all_points_is_given_once() -> None:
    x, p = RANDOM.normal(size=(3, 5)), RANDOM.normal(size=2)
    assert np.array_equal(at_points(example(), x, p), at_points(example(), x, np.repeat(p[:, None], 5, axis=1)))


def test_arrays_of_any_layout_are_taken() -> None:
    x, p = RANDOM.normal(size=(5, 6)).T[::2], RANDOM.normal(size=2)
    assert np.array_equal(at_points(example(), x, p), at_points(example(), np.ascontiguousarray(x), p))


def test_argument_of_nothing_is_left_out() -> None:
    x, none = ca.SX.sym("x", 2), ca.SX.sym("p", 0)
    function = ca.Function("twice", [x, none], [2.0 * x])
    given = RANDOM.normal(size=(2, 4))
    assert np.array_equal(at_points(function, given, np.zeros(0)), 2.0 * given)


def test_argument_with_other_rows_is_refused() -> None:
    with pytest.raises(ValueError, match="argument 1 of example has 3 rows"):
        at_points(example(), np.zeros((3, 2)), np.zeros(3))
