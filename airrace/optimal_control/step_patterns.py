"""The patterns of a Runge-Kutta step's derivatives: where they may differ from zero, found stage by stage.

The step is a function of y = (x, u, T), its stages evaluate f at z = (x, u). Patterns are boolean matrices; a product
of two is true where some path leads through both.
"""

from collections.abc import Sequence

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from airrace.optimal_control.runge_kutta import RungeKutta
from airrace.records import record

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
