"""Natural cubic splines through tables, of one and of two variables, as expressions of symbols or numbers.

Between the first and the last knot a spline is twice continuously differentiable; beyond them it goes on straight. With
`(x)_+ = max(x, 0)` and knots `t_k`

    s(x) = a + b x + sum c_k (x - t_k)_+^3,     sum c_k = 0,     sum c_k t_k = 0

and the coefficients are linear in the values at the knots. Of two variables the basis is the product of two of these.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from airrace.model.elementary import maximum
from airrace.optimal_control.quantities import Scalar
from airrace.optimal_control.trajectory import Array


@dataclass(frozen=True)
class Table:
    """Values over one or two variables.

    Attributes:
        knots: of each variable, increasing.
        values: one per knot of the first variable, each a tuple of one per knot of the second (a single one where
            there is no second).
    """

    knots: tuple[tuple[float, ...], ...]
    values: tuple[tuple[float, ...], ...]

    def __call__(self, *arguments: Scalar) -> Scalar:
        """Return the spline's value; there are as many arguments as variables."""
        first = _basis(arguments[0], self.knots[0])
        second = _basis(arguments[1], self.knots[1]) if len(self.knots) > 1 else [1.0]
        total: Scalar = 0.0
        for row, factor in zip(self._coefficients, first, strict=True):
            along: Scalar = 0.0
            for coefficient, other in zip(row, second, strict=True):
                along = along + float(coefficient) * other
            total = total + along * factor
        return total

    @functools.cached_property
    def _coefficients(self) -> Array:
        coefficients = _interpolation(self.knots[0]) @ np.array(self.values)
        return coefficients @ _interpolation(self.knots[1]).T if len(self.knots) > 1 else coefficients


def _scaled(x: Scalar, knots: Sequence[float]) -> Scalar:
    return (x - knots[0]) / ((knots[-1] - knots[0]) or 1.0)


def _basis(x: Scalar, knots: Sequence[float]) -> list[Scalar]:
    """Return 1, x and the cubes, in units of the range of the knots; one knot makes a constant."""
    if len(knots) == 1:
        return [1.0]
    scaled = _scaled(x, knots)
    cubes: list[Scalar] = []
    for knot in knots:
        beyond = maximum(scaled - _scaled(knot, knots), 0.0)
        cubes.append(beyond * beyond * beyond)
    return [1.0, scaled, *cubes]


def _interpolation(knots: Sequence[float]) -> Array:
    """Return the matrix from values at the knots to coefficients, shape (n + 2, n)."""
    count = len(knots)
    if count == 1:
        return np.ones((1, 1))
    t = np.array([_scaled(knot, knots) for knot in knots])
    system = np.zeros((count + 2, count + 2))
    system[:count, 0], system[:count, 1] = 1.0, t
    system[:count, 2:] = np.maximum(t[:, None] - t[None, :], 0.0) ** 3
    system[count, 2:], system[count + 1, 2:] = 1.0, t
    coefficients: Array = np.linalg.solve(system, np.eye(count + 2, count)).astype(np.float64)
    return coefficients
