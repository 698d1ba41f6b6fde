"""Explicit Runge-Kutta schemes for one shooting interval, and their steps as tables for the native library.

From the tables (sizes, scheme, patterns) `step.c` composes a step and its derivatives. The step is a function of
y = (x, u, T), its stages evaluate f at z = (x, u). Patterns are boolean matrices; a product of two is true where some
path leads through both.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from airrace.optimal_control.system import System

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


GROUP = 4
"""The multiple of numbers to which rows of sensitivities are padded, as in `step.c`."""

Pattern = NDArray[np.bool_]
Table = Sequence[int]


@dataclass(frozen=True, eq=False)
class Derivatives:
    """A function of z (and of parameters) and its derivatives in z.

    Attributes:
        linear: its values and their Jacobian.
        curved: with multipliers as last argument, the upper triangle of the Hessian of lam . values.
        values: which values may differ from zero, shape (n,).
        jacobian: shape (n, n_z).
        hessian: both triangles, shape (n_z, n_z).
        untouched: arguments that are handed on as they are and serve for nothing else, shape (n_z,).
    """

    linear: ca.Function
    curved: ca.Function
    values: Pattern
    jacobian: Pattern
    hessian: Pattern
    untouched: Pattern


def _derivatives(name: str, arguments: list[ca.SX], z: ca.SX, values: ca.SX) -> Derivatives:
    """Return the functions `name_linear` and `name_curved` of `values`, functions of `arguments`, derived in z."""
    lam = ca.SX.sym("lam", values.numel())
    jacobian = ca.jacobian(values, z)
    upper = ca.triu(ca.hessian(ca.dot(lam, values), z)[0])
    curved = _pattern(upper.sparsity())
    columns = [jacobian[:, place] for place in range(z.numel())]
    untouched = [column.sparsity().row() == [place] and column.nz[0].is_one() for place, column in enumerate(columns)]
    return Derivatives(
        linear=ca.Function(f"{name}_linear", arguments, [ca.densify(values), jacobian], {"cse": True}),
        curved=ca.Function(f"{name}_curved", [*arguments, lam], [upper], {"cse": True}),
        values=_pattern(ca.sparsify(values).sparsity())[:, 0],
        jacobian=_pattern(jacobian.sparsity()),
        hessian=curved | curved.T,
        untouched=np.array(untouched, dtype=bool),
    )


@dataclass(frozen=True, eq=False)
class StepParts:
    """The parts that a step is put together from, and the patterns of its derivatives.

    Attributes:
        system, scheme: whose step.
        alone: f as a casadi function, `rates`.
        rates, projection: f and the projection with their derivatives; None without a projection.
        active: the entries of y on which anything but the same entry of x depends; the last of them is T.
        stage: sensitivity dz/dy, all stages together, shape (n_x + n_u, n_y).
        end: sensitivity of the end before the projection, shape (n_x, n_y).
        jacobian: the step's, shape (n_x, n_y).
        hessian: the step's, upper triangle, shape (n_y, n_y).
    """

    system: System
    scheme: RungeKutta
    alone: ca.Function
    rates: Derivatives
    projection: Derivatives | None
    active: list[int]
    stage: Pattern
    end: Pattern
    jacobian: ca.Sparsity
    hessian: ca.Sparsity

    @property
    def generated(self) -> list[ca.Function]:
        """The derivatives, each by its own name."""
        parts = [part for part in (self.rates, self.projection) if part is not None]
        return [function for part in parts for function in (part.linear, part.curved)]


def step_parts(system: System, scheme: RungeKutta) -> StepParts:
    """Return what a step of a system is put together from."""
    n_x, n_u, n_p = len(system.states), len(system.controls), len(system.parameters)
    x, u, p = ca.SX.sym("x", n_x), ca.SX.sym("u", n_u), ca.SX.sym("p", n_p)
    values = system.rates(x, u, p)
    rates = _derivatives("rates", [x, u, p], ca.vertcat(x, u), values)
    projection = None if system.projection is None else _derivatives("projection", [x], x, system.projection(x))
    dx, du = np.eye(n_x, n_x + n_u + 1, dtype=bool), np.eye(n_u, n_x + n_u + 1, n_x, dtype=bool)
    stage, hessian = (np.zeros((rows, n_x + n_u + 1), dtype=bool) for rows in (n_x + n_u, n_x + n_u + 1))
    for _ in range(scheme.steps):
        slopes: list[Pattern] = []
        for row in scheme.a:
            S = np.vstack([_advance(dx, row, slopes, rates.values), du])
            slopes.append(rates.jacobian @ S)
            stage |= S
            hessian |= S.T @ rates.hessian @ S
            hessian[:, -1] |= slopes[-1].any(axis=0)
        dx = _advance(dx, scheme.b, slopes, rates.values)
    jacobian, passive = dx, ~np.any(rates.jacobian[:, :n_x], axis=0)
    if projection is not None:
        jacobian = projection.jacobian @ dx
        hessian |= dx.T @ projection.hessian @ dx
        passive = passive & projection.untouched
    return StepParts(
        system=system,
        scheme=scheme,
        alone=ca.Function("rates", [x, u, p], [ca.densify(values)], {"cse": True}),
        rates=rates,
        projection=projection,
        active=[place for place in range(n_x + n_u + 1) if place >= n_x or not passive[place]],
        stage=stage,
        end=dx,
        jacobian=_sparsity(jacobian),
        hessian=_sparsity(np.triu(hessian | hessian.T)),
    )


def _advance(dx: Pattern, weights: Sequence[float], slopes: Sequence[Pattern], values: Pattern) -> Pattern:
    """Return the sensitivity of `x + h sum_j weights_j K_j`; h depends on T."""
    total = dx.copy()
    for weight, slope in zip(weights, slopes, strict=True):
        if weight:
            total |= slope
            total[:, -1] |= values
    return total


def step_tables(parts: StepParts) -> list[Table]:
    """Return all tables of a step but those of its functions, in the order in which `step.c` reads them."""
    system, active, rates = parts.system, parts.active, parts.rates
    padded = -(-len(active) // GROUP) * GROUP
    place = {entry: number for number, entry in enumerate(active)}
    acting = np.flatnonzero(np.any(rates.jacobian[:, : len(system.states)], axis=0)).tolist()
    n_y = len(system.states) + len(system.controls) + 1
    smooth_parts = [part for part in (rates, parts.projection) if part is not None]
    sizes = [
        len(system.states),
        len(system.controls),
        len(system.parameters),
        len(parts.scheme.a),
        parts.scheme.steps,
        len(active),
        padded,
        len(acting),
        int(parts.projection is not None),
        parts.jacobian.nnz(),
        parts.hessian.nnz(),
        rates.linear.nnz_out(1),
        max(max(part.linear.nnz_out(1), part.curved.nnz_out(0)) for part in smooth_parts),
    ]
    return [
        sizes,
        [place.get(entry, -1) for entry in range(n_y)],
        acting,
        [row * padded + place[column] if column in place else -1 for row, column in _nonzeros(parts.jacobian)],
        [place[row] * padded + place[column] for row, column in _nonzeros(parts.hessian)],
        *_derivative_tables(rates, parts.stage[:, active]),
        *_derivative_tables(parts.projection, parts.end[:, active]),
    ]


def scheme_numbers(scheme: RungeKutta) -> list[float]:
    """Return the rows of a, each as long as there are stages, and b."""
    stages = len(scheme.a)
    return [*(weight for row in scheme.a for weight in (*row, *[0.0] * (stages - len(row)))), *scheme.b]


def _derivative_tables(part: Derivatives | None, sensitivity: Pattern) -> list[Table]:
    """Return the tables of a function's Jacobian and Hessian.

    Among them are the curved arguments and, by column of y, those that depend on it.
    """
    if part is None:
        return [*_row_compressed(0, []), [], *_row_compressed(0, []), *_row_compressed(0, [])]
    variables = np.flatnonzero(np.any(part.hessian, axis=0)).tolist()
    number = {variable: place for place, variable in enumerate(variables)}
    jacobian = [(*place, source) for source, place in enumerate(_nonzeros(part.linear.sparsity_out(1)))]
    hessian = enumerate(_nonzeros(part.curved.sparsity_out(0)))
    upper = [(number[row], number[column], source) for source, (row, column) in hessian]
    lower = [(column, row, source) for row, column, source in upper if row != column]
    columns, dependent = (places.tolist() for places in np.nonzero(sensitivity[variables].T))
    return [
        *_row_compressed(len(part.jacobian), jacobian),
        variables,
        *_row_compressed(len(variables), upper + lower),
        *_row_compressed(sensitivity.shape[1], [(*both, 0) for both in zip(columns, dependent, strict=True)]),
    ]


def _row_compressed(rows: int, entries: Iterable[tuple[int, int, int]]) -> list[Table]:
    """Return the tables of (row, column, source): starts of the rows, columns, sources."""
    ordered = sorted(entries)
    starts = np.searchsorted([row for row, _, _ in ordered], np.arange(rows + 1))
    return [starts.tolist(), [column for _, column, _ in ordered], [source for _, _, source in ordered]]


def _nonzeros(sparsity: ca.Sparsity) -> list[tuple[int, int]]:
    """Return the rows and columns of the nonzeros in casadi's order."""
    return list(zip(*sparsity.get_triplet(), strict=True))


def _pattern(sparsity: ca.Sparsity) -> Pattern:
    """Return where the nonzeros are, as a boolean matrix of the same shape."""
    pattern = np.zeros(sparsity.shape, dtype=bool)
    pattern[sparsity.get_triplet()] = True
    return pattern


def _sparsity(pattern: Pattern) -> ca.Sparsity:
    rows, columns = np.nonzero(pattern)
    return ca.Sparsity.triplet(len(pattern), pattern.shape[1], rows.tolist(), columns.tolist())
