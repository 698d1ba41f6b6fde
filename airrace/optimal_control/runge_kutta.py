"""The explicit Runge-Kutta schemes for one shooting interval."""

from collections.abc import Callable
from typing import Any

from airrace.records import record

Column = Any  # of symbols or numbers: one formula serves casadi and numpy alike


@record
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

    def advance(
        self, rates: Callable[[Column, Column, Column], Column], x: Column, u: Column, p: Column, duration: Column
    ) -> Column:
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

# Verner (2010), https://doi.org/10.1007/s11075-009-9290-3: the weights of order 7 of the "most efficient" 7(6) pair, in
# the decimals of his table RKV76.IIa.Efficient.00001675585; the tenth stage serves only the error estimate.
VERNER_7 = RungeKutta(
    "v7",
    7,
    (
        (),
        (0.005,),
        (-1.0767901234567901234567, 1.1856790123456790123457),
        (0.0408333333333333333333, 0.0, 0.1225),
        (0.6389139236255726780508, 0.0, -2.4556726382236568096626, 2.2722587145980841316118),
        (
            *(-2.6615773750187571311193, 0.0, 10.8045138864561376956540),
            *(-8.3539146573961994119680, 0.8204875949566569791420),
        ),
        (
            *(6.0677414346967709927184, 0.0, -24.7112736359110857973420, 20.4275179307888939404577),
            *(-1.9061579788166471506241, 1.0061722492420680147900),
        ),
        (
            *(12.0546700762532029950911, 0.0, -49.7547849504689893280726, 41.1428886386046766325970),
            *(-4.4617601499740041856419, 2.0423348222391749598217, -0.0983484366540610737953),
        ),
        (
            *(10.1381465228818078764185, 0.0, -42.6411360317175021462285, 35.7638400399225700713502),
            *(-4.3480228403929076533404, 2.0098622683770358954419, 0.3487490460338272405954),
            -0.2714390051048312842371,
        ),
    ),
    (
        *(0.0471556184862722217043, 0.0, 0.0, 0.2575056429843415189596, 0.2621665397741262047714),
        *(0.1521609265673855740323, 0.4939969170032484246907, -0.2943031171403250441557, 0.0813174723249510999973),
    ),
)
"""A scheme of order 7 with nine stages.

In one step of 0.9 of a mode's time constant it errs by 5e-9 of the mode, where `DORMAND_PRINCE_5` errs by 2e-4.
"""
