"""A Runge-Kutta step as tables, from which `step.c` composes it and its derivatives: sizes, scheme, patterns.

The step is a function of y = (x, u, T), its stages evaluate f at z = (x, u). Patterns are boolean matrices; a product
of two is true where some path leads through both.
"""

from collections.abc import Iterable, Sequence
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from airrace.optimal_control.runge_kutta import RungeKutta
from airrace.records import record
from airrace.system import System

Pattern = NDArray[np.bool_]


@record
class Derivatives:
    """A function of z (and of parameters) and its derivatives in z.

    Attributes:
        name: of the function.
        linear: its values and their Jacobian.
        curved: with multipliers as last argument, the upper triangle of the Hessian of lam . values.
        values: which values may differ from zero, shape (n,).
        jacobian: shape (n, n_z).
        hessian: both triangles, shape (n_z, n_z).
        untouched: arguments that are handed on as they are and serve for nothing else, shape (n_z,).
    """

    name: str
    linear: ca.Function
    curved: ca.Function
    values: Pattern
    jacobian: Pattern
    hessian: Pattern
    untouched: Pattern


@record
class StepPatterns:
    """The patterns of the derivatives of a step.

    Attributes:
        active: the entries of y on which anything but the same entry of x depends; the last of them is T.
        stage: sensitivity dz/dy, all stages together, shape (n_x + n_u, n_y).
        end: sensitivity of the end before the projection, shape (n_x, n_y).
        jacobian: the step's, shape (n_x, n_y).
        hessian: the step's, upper triangle, shape (n_y, n_y).
    """

    active: list[int]
    stage: Pattern
    end: Pattern
    jacobian: Pattern
    hessian: Pattern


def derivatives(name: str, arguments: list[ca.SX], z: ca.SX, values: ca.SX) -> Derivatives:
    """Return the functions `name_linear` and `name_curved` of `values`, functions of `arguments`, derived in z."""
    lam = ca.SX.sym("lam", values.numel())
    jacobian = ca.jacobian(values, z)
    upper = ca.triu(ca.hessian(ca.dot(lam, values), z)[0])
    options = {"cse": True}
    curved = pattern(upper.sparsity())
    return Derivatives(
        name=name,
        linear=ca.Function(f"{name}_linear", arguments, [ca.densify(values), jacobian], options),
        curved=ca.Function(f"{name}_curved", [*arguments, lam], [upper], options),
        values=pattern(ca.sparsify(values).sparsity())[:, 0],
        jacobian=pattern(jacobian.sparsity()),
        hessian=curved | curved.T,
        untouched=np.array([_is_unit(jacobian[:, place], place) for place in range(z.numel())], dtype=bool),
    )


def step_patterns(scheme: RungeKutta, rates: Derivatives, projection: Derivatives | None) -> StepPatterns:
    """Return the patterns of a step along `rates`, projected at its end."""
    n_x, n_z = rates.jacobian.shape
    dx, du = np.eye(n_x, n_z + 1, dtype=bool), np.eye(n_z - n_x, n_z + 1, n_x, dtype=bool)
    stage, hessian = np.zeros((n_z, n_z + 1), dtype=bool), np.zeros((n_z + 1, n_z + 1), dtype=bool)
    for _ in range(scheme.steps):
        slopes: list[Pattern] = []
        for row in scheme.a:
            S = np.vstack([_advanced(dx, row, slopes, rates.values), du])
            slopes.append(rates.jacobian @ S)
            stage |= S
            hessian |= S.T @ rates.hessian @ S
            hessian[:, -1] |= slopes[-1].any(axis=0)
        dx = _advanced(dx, scheme.b, slopes, rates.values)
    jacobian = dx
    if projection is not None:
        jacobian = projection.jacobian @ dx
        hessian |= dx.T @ projection.hessian @ dx
    return StepPatterns(_active(rates, projection), stage, dx, jacobian, np.triu(hessian | hessian.T))


def pattern(sparsity: ca.Sparsity) -> Pattern:
    """Return where the nonzeros are, as a boolean matrix of the same shape."""
    found = np.zeros(sparsity.shape, dtype=bool)
    rows, columns = sparsity.get_triplet()
    found[rows, columns] = True
    return found


def _advanced(dx: Pattern, weights: Sequence[float], slopes: Sequence[Pattern], values: Pattern) -> Pattern:
    """Return the sensitivity of `x + h sum_j weights_j K_j`; h depends on T."""
    total = dx.copy()
    for weight, slope in zip(weights, slopes, strict=True):
        if weight:
            total |= slope
            total[:, -1] |= values
    return total


def _active(rates: Derivatives, projection: Derivatives | None) -> list[int]:
    n_x, n_z = rates.jacobian.shape
    passive = ~np.any(rates.jacobian[:, :n_x], axis=0)
    if projection is not None:
        passive = passive & projection.untouched
    return [place for place in range(n_z + 1) if place >= n_x or not passive[place]]


def _is_unit(column: ca.SX, place: int) -> bool:
    """Return whether a column of a Jacobian is one at `place` and zero elsewhere."""
    return column.sparsity().row() == [place] and column.nz[0].is_one()


GROUP = 4
"""The multiple of numbers to which rows of sensitivities are padded, as in `step.c`."""

Table = Sequence[int]


@record
class StepParts:
    """The parts that a step is put together from.

    Attributes:
        system, scheme: whose step.
        alone: f as a casadi function, `rates`.
        rates, projection: f and the projection with their derivatives; None without a projection.
        patterns: of the step's derivatives.
    """

    system: System
    scheme: RungeKutta
    alone: ca.Function
    rates: Derivatives
    projection: Derivatives | None
    patterns: StepPatterns

    @property
    def derived(self) -> list[Derivatives]:
        """The functions with derivatives."""
        return [one for one in (self.rates, self.projection) if one is not None]

    @property
    def generated(self) -> list[ca.Function]:
        """The derivatives, each by its own name."""
        return [function for one in self.derived for function in (one.linear, one.curved)]

    @cached_property
    def jacobian(self) -> ca.Sparsity:
        """The pattern of the step's Jacobian."""
        return _sparsity(self.patterns.jacobian)

    @cached_property
    def hessian(self) -> ca.Sparsity:
        """The pattern of the step's Hessian, upper triangle."""
        return _sparsity(self.patterns.hessian)

    @cached_property
    def acting(self) -> list[int]:
        """The states that f depends on."""
        return np.flatnonzero(np.any(self.rates.jacobian[:, : len(self.system.states)], axis=0)).tolist()


def step_parts(system: System, scheme: RungeKutta) -> StepParts:
    """Return what a step of a system is put together from."""
    x, u = ca.SX.sym("x", len(system.states)), ca.SX.sym("u", len(system.controls))
    p = ca.SX.sym("p", len(system.parameters))
    values = system.rates(x, u, p)
    alone = ca.Function("rates", [x, u, p], [ca.densify(values)], {"cse": True})
    rates = derivatives("rates", [x, u, p], ca.vertcat(x, u), values)
    projection = None
    if system.projection is not None:
        projection = derivatives("projection", [x], x, system.projection(x))
    return StepParts(system, scheme, alone, rates, projection, step_patterns(scheme, rates, projection))


def step_tables(parts: StepParts) -> list[Table]:
    """Return all tables of a step but those of its functions, in the order in which `step.c` reads them."""
    patterns, active = parts.patterns, parts.patterns.active
    padded = -(-len(active) // GROUP) * GROUP
    place = {entry: number for number, entry in enumerate(active)}
    jacobian = [row * padded + place[column] if column in place else -1 for row, column in _entries(parts.jacobian)]
    hessian = [place[row] * padded + place[column] for row, column in _entries(parts.hessian)]
    return [
        _sizes(parts, padded),
        [place.get(entry, -1) for entry in range(len(patterns.hessian))],
        parts.acting,
        jacobian,
        hessian,
        *_derivative_tables(parts.rates, patterns.stage[:, active]),
        *_derivative_tables(parts.projection, patterns.end[:, active]),
    ]


def scheme_numbers(scheme: RungeKutta) -> list[float]:
    """Return the rows of a, each as long as there are stages, and b."""
    stages = len(scheme.a)
    return [*(weight for row in scheme.a for weight in (*row, *[0.0] * (stages - len(row)))), *scheme.b]


def _sizes(parts: StepParts, padded: int) -> Table:
    system, scheme = parts.system, parts.scheme
    nonzeros = [count for one in parts.derived for count in (one.linear.nnz_out(1), one.curved.nnz_out(0))]
    return [
        len(system.states),
        len(system.controls),
        len(system.parameters),
        len(scheme.a),
        scheme.steps,
        len(parts.patterns.active),
        padded,
        len(parts.acting),
        int(parts.projection is not None),
        parts.jacobian.nnz(),
        parts.hessian.nnz(),
        parts.rates.linear.nnz_out(1),
        max(nonzeros),
    ]


def _derivative_tables(part: Derivatives | None, sensitivity: Pattern) -> list[Table]:
    """Return the tables of a function's Jacobian and Hessian.

    They tell which arguments are curved and, by column of y, which of those depend on it.
    """
    if part is None:
        return [*_compressed(0, []), [], *_compressed(0, []), *_compressed(0, [])]
    variables = np.flatnonzero(np.any(part.hessian, axis=0)).tolist()
    number = {variable: place for place, variable in enumerate(variables)}
    jacobian = [(row, column, source) for source, (row, column) in enumerate(_entries(part.linear.sparsity_out(1)))]
    upper = [
        (number[row], number[column], source)
        for source, (row, column) in enumerate(_entries(part.curved.sparsity_out(0)))
    ]
    lower = [(column, row, source) for row, column, source in upper if row != column]
    columns, dependent = (places.tolist() for places in np.nonzero(sensitivity[variables].T))
    return [
        *_compressed(len(part.jacobian), jacobian),
        variables,
        *_compressed(len(variables), upper + lower),
        *_compressed(sensitivity.shape[1], [(*both, 0) for both in zip(columns, dependent, strict=True)]),
    ]


def _compressed(rows: int, given: Iterable[tuple[int, int, int]]) -> list[Table]:
    """Return row-compressed tables of (row, column, source): starts of the rows, columns, sources."""
    ordered = sorted(given)
    starts = np.searchsorted([row for row, _, _ in ordered], np.arange(rows + 1))
    return [starts.tolist(), [column for _, column, _ in ordered], [source for _, _, source in ordered]]


def _entries(sparsity: ca.Sparsity) -> list[tuple[int, int]]:
    """Return the rows and columns of the nonzeros in casadi's order."""
    rows, columns = sparsity.get_triplet()
    return list(zip(rows, columns, strict=True))


def _sparsity(pattern: Pattern) -> ca.Sparsity:
    rows, columns = np.nonzero(pattern)
    return ca.Sparsity.triplet(len(pattern), pattern.shape[1], rows.tolist(), columns.tolist())
