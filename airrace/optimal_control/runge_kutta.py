"""The explicit Runge-Kutta schemes for one shooting interval."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

Column = Any  # of symbols or numbers: one formula serves casadi and numpy alike


@dataclass(frozen=True)
class RungeKutta:
    """A Butcher tableau, applied `steps` times within an interval.

    Attributes:
        name: for messages and the names of kernels.
        order: the theoretical order of convergence.
        a: rows of the strictly lower triangle; `a[0]` is empty.
        b: weights.
    """

    name: str
    order: int
    a: tuple[tuple[float, ...], ...]
    b: tuple[float, ...]
    steps: int = 1

    def advance(self, rates: Callable[..., Column], x: Column, u: Column, p: Column, duration: Column) -> Column:
        """Return the state after `duration` seconds with the control held.

        Shapes are (n_x,), (n_u,), (n_p,), or these as columns.
        """
        h = duration / self.steps
        for _ in range(self.steps):
            slopes: list[Column] = []
            for row in self.a:
                y = x
                for weight, slope in zip(row, slopes, strict=True):
                    if weight:
                        y = y + h * weight * slope
                slopes.append(rates(y, u, p))
            for weight, slope in zip(self.b, slopes, strict=True):
                if weight:
                    x = x + h * weight * slope
        return x


RK4 = RungeKutta("rk4", 4, ((), (1 / 2,), (0.0, 1 / 2), (0.0, 0.0, 1.0)), (1 / 6, 1 / 3, 1 / 3, 1 / 6))
"""The classical scheme of order 4."""
RK4_TWICE = RungeKutta("rk4x2", 4, RK4.a, RK4.b, steps=2)
"""The classical scheme with two steps per interval."""

# Dormand & Prince (1980): the fifth-order weights; the seventh stage serves only their error estimate.
DORMAND_PRINCE_5 = RungeKutta(
    "dp5",
    5,
    (
        (),
        (1 / 5,),
        (3 / 40, 9 / 40),
        (44 / 45, -56 / 15, 32 / 9),
        (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
        (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    ),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)
