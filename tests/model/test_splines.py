"""Splines through tables, of numbers and of symbols."""

import casadi as ca
import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from airrace.model.splines import Table

KNOTS = (-1.0, -0.3, 0.2, 0.9, 1.4)
VALUES = (0.3, 0.1, 0.05, 0.2, 0.7)
CURVE = Table((KNOTS,), tuple((value,) for value in VALUES))


def test_curve_is_the_natural_spline_through_the_table() -> None:
    expected = CubicSpline(KNOTS, VALUES, bc_type="natural")
    for x in np.linspace(KNOTS[0], KNOTS[-1], 23):
        assert float(CURVE(float(x))) == pytest.approx(float(expected(x)), abs=1e-12)


def test_curve_goes_on_straight_beyond_its_ends() -> None:
    for inner, outer in ((KNOTS[0], -3.0), (KNOTS[-1], 3.0)):
        step = 0.5 * (outer - inner)
        values = [float(CURVE(inner + count * step)) for count in (0, 1, 2)]
        assert values[2] - values[1] == pytest.approx(values[1] - values[0], rel=1e-9)


def test_symbols_give_the_numbers_and_a_second_derivative_without_jumps() -> None:
    x = ca.SX.sym("x")
    value = CURVE(x)
    second = ca.Function("second", [x], [ca.hessian(value, x)[0]])
    assert float(ca.Function("value", [x], [value])(0.4)) == pytest.approx(float(CURVE(0.4)), abs=1e-14)
    for knot in KNOTS:
        assert float(second(knot - 1e-9)) == pytest.approx(float(second(knot + 1e-9)), abs=1e-5)


@pytest.mark.parametrize("second", [(2.0,), (2.0, 3.0), (2.0, 3.0, 5.0)])
def test_surface_has_the_values_at_its_knots(second: tuple[float, ...]) -> None:
    rng = np.random.default_rng(2)
    values = rng.uniform(size=(len(KNOTS), len(second)))
    surface = Table((KNOTS, second), tuple(tuple(row) for row in values.tolist()))
    for row, x in enumerate(KNOTS):
        for column, y in enumerate(second):
            assert float(surface(x, y)) == pytest.approx(values[row, column], abs=1e-12)


def test_straight_table_stays_straight_in_both_variables() -> None:
    values = tuple(tuple(2.0 * x - 3.0 * y + x * y for y in (1.0, 2.0, 4.0)) for x in KNOTS)
    surface = Table((KNOTS, (1.0, 2.0, 4.0)), values)
    for x, y in ((0.0, 1.5), (-5.0, 7.0), (3.0, 0.0)):
        assert float(surface(x, y)) == pytest.approx(2.0 * x - 3.0 * y + x * y, abs=1e-11)
