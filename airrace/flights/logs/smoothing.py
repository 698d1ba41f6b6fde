"""Positions with noise smoothed into a path: position, velocity and acceleration at evenly spaced times.

The path is the most probable one where the jerk `j` of the aircraft is mostly small and now and then very large, as it
is in a race, and the positions `z_k` at times `t_k` scatter by `sigma` (m):

    sum_k |z_k - r(t_k)|^2 / (2 sigma^2)  -  sum_i log p(j_i)  ->  min,      j_i of Student's t-distribution

Between two nodes the jerk is white noise of the density `q`; with one degree of freedom its logarithm is a sum of
weighted squares whose weights follow from the path itself. So the weights are found by iteration, and every step is
the smoother of Rauch, Tung and Striebel, solved as a banded system of equations. With a normal distribution instead the
rolls of a race are smeared, or the noise is followed: on an optimum sampled at 20 Hz with 1.5 m of noise the bank is
off by 15 degrees (root mean square, where the aircraft does not roll), and by 6 with this one.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airrace.optimal_control.trajectory import Array

STEP = 0.05
"""The time between two nodes of the path, s. Half of it gains less than a tenth of a degree of bank."""
JERK_NOISE = (1000.0, 1000.0, 300.0)
"""The density of the jerk's noise, north, east and up, m^2/s^5. On Rovinj 2014, sampled at 5 and at 20 Hz with 1.5 m of
noise, a third or three times of it makes neither bank nor load factor better by more than a tenth."""
FREEDOM = 1.0
"""The degrees of freedom of the distribution of the jerk."""
ITERATIONS = 20
"""The number of iterations of the weights; later ones move the path by centimetres."""
OUTLYING = 5.0
"""The standard deviations from the path beyond which a position is an outlier and left out."""
INLIER_SHARE = 0.5
"""The share of positions that are no outliers, at least; with fewer the noise was misjudged, and all count."""
NOISE_MIN = 0.02
"""The least noise that is estimated from the positions themselves, m."""
NOISE_MAX = 30.0
"""The largest, m."""
USUAL_NOISE = 1.5
"""The noise that is taken where there are too few positions for an estimate, m."""
MISSING_FACTOR = 1.5
"""The multiple of the usual step between samples beyond which some are missing."""
HARD_TURNS = 5.0
"""The percentile of the weights that stands for hard turns."""
EDGE = 0.5
"""The time for which the path goes on before the first position and behind the last one, s: it may begin at a gate."""
DURATION_MAX = 1200.0
"""The longest path that is smoothed, s."""


@dataclass(frozen=True, eq=False)
class Path:
    """A smoothed path on evenly spaced nodes.

    Attributes:
        time: of the nodes, s, shape (n,).
        position, velocity, acceleration: north, east and up, m, m/s, m/s^2, each of shape (3, n).
        noise: standard deviation of the positions, m, north, east and up, shape (3,).
        outliers: which of the given positions were left out, shape (m,).
        scatter: root mean square of the distance of the others from the path, by axis, m, shape (3,).
        factors: what `deviations` needs: the weighted normal equations of every axis, factored.
    """

    time: Array
    position: Array
    velocity: Array
    acceleration: Array
    noise: Array
    outliers: NDArray[np.bool_]
    scatter: Array
    factors: tuple[Array, ...]

    def at(self, times: Array) -> tuple[Array, Array, Array]:
        """Return position, velocity and acceleration at other times within the path, each of shape (3, m).

        Positions and velocities are those of cubics through the nodes, with the slopes there.
        """
        k = np.clip(np.searchsorted(self.time, times, side="right") - 1, 0, len(self.time) - 2)
        h = STEP
        u = (times - self.time[k]) / h
        u2, u3 = u * u, u * u * u
        position, velocity = (
            (2.0 * u3 - 3.0 * u2 + 1.0) * values[:, k]
            + h * (u3 - 2.0 * u2 + u) * slopes[:, k]
            + (3.0 * u2 - 2.0 * u3) * values[:, k + 1]
            + h * (u3 - u2) * slopes[:, k + 1]
            for values, slopes in ((self.position, self.velocity), (self.velocity, self.acceleration))
        )
        return position, velocity, (1.0 - u) * self.acceleration[:, k] + u * self.acceleration[:, k + 1]

    def deviations(self, times: Array) -> Array:
        """Return standard deviations of position, velocity and acceleration at the nodes next to some times.

        By the equations alone, as if the weights of the jerk were known; m, m/s, m/s^2, shape (3, 3, m), by quantity
        and axis.
        """
        k = np.clip(np.rint((times - self.time[0]) / STEP).astype(np.int64), 0, len(self.time) - 1)
        rows = (3 * k + np.arange(3)[:, None]).ravel()
        column = np.arange(len(rows))
        unit = np.zeros((3 * len(self.time), len(rows)))
        unit[rows, column] = 1.0
        variances = [_solve(factor, unit)[rows, column].reshape(3, -1) for factor in self.factors]
        return np.sqrt(np.stack(variances, axis=1))


def smooth(time: Array, places: Array, noise: float | None = None, least: Array | float = 0.0) -> Path:
    """Return the path of positions.

    Args:
        time: s, rising, shape (m,), no longer than `DURATION_MAX`.
        places: north, east and up, m, shape (3, m); NaN where an axis is not known.
        noise: standard deviation of the positions, m; None to estimate it.
        least: the least that it may be, by axis, m: numbers that are written coarsely have the noise of their rounding.
    """
    finite: NDArray[np.bool_] = np.isfinite(places)
    sigma = np.full(3, max(noise, NOISE_MIN)) if noise is not None else _estimate_noise(time, places)
    sigma = np.maximum(sigma, np.asarray(least, np.float64))
    places = np.where(finite, places, 0.0)
    count = int(np.ceil((time[-1] - time[0] + 2.0 * EDGE) / STEP)) + 1
    nodes = time[0] - EDGE + STEP * np.arange(count)
    equations = _NormalEquations(nodes, time)
    weights, inliers = np.ones(count - 1), np.ones(len(time), np.bool_)
    states, residuals = np.zeros((3, count, 3)), np.zeros_like(places)
    for _ in range(ITERATIONS):
        for axis, density in enumerate(JERK_NOISE):
            certainty = (inliers & finite[axis]) / sigma[axis] ** 2
            states[axis], _ = equations.solve(places[axis], certainty, weights / density)
        surprise = np.sum([equations.surprise(state) / q for state, q in zip(states, JERK_NOISE, strict=True)], axis=0)
        weights = (FREEDOM + 9.0) / (FREEDOM + surprise)  # of the nine numbers of a step
        residuals = np.where(finite, places - equations.positions(states), 0.0)
        inliers = np.logical_and.reduce(np.abs(residuals) < OUTLYING * sigma[:, None], axis=0)
        if inliers.mean() <= INLIER_SHARE:
            inliers = np.ones_like(inliers)
    factors = [
        equations.solve(
            places[axis],
            (inliers & finite[axis]) / sigma[axis] ** 2,
            _cautious(weights, nodes, time[finite[axis]]) / density,
        )[1]
        for axis, density in enumerate(JERK_NOISE)
    ]
    used = inliers & finite
    scatter = np.sqrt(np.sum(residuals**2 * used, axis=1) / np.maximum(np.sum(used, axis=1), 1))
    position, velocity, acceleration = np.moveaxis(states, 2, 0)
    return Path(nodes, position, velocity, acceleration, sigma, np.logical_not(inliers), scatter, tuple(factors))


def _cautious(weights: Array, nodes: Array, time: Array) -> Array:
    """Return the weights for standard deviations: where samples are missing the aircraft may have turned hard.

    No data show a jerk there, so that the most probable path is a calm one.
    """
    steps = np.diff(time, prepend=nodes[0], append=nodes[-1])
    behind = np.searchsorted(time, 0.5 * (nodes[1:] + nodes[:-1]))
    missing = steps[behind] > MISSING_FACTOR * np.median(steps)
    if missing.all() or not missing.any():
        return weights
    hard = float(np.percentile(weights[~missing], HARD_TURNS))
    return np.where(missing, np.minimum(weights, hard), weights)


def _estimate_noise(time: Array, places: Array) -> Array:
    """Return the noise by the median of fourth differences, in which the flight itself is small.

    For white noise their standard deviation is `sqrt(70) sigma`.
    """
    sigma: list[float] = []
    for place in places:
        finite = np.isfinite(place)
        steps = np.diff(time[finite])
        even = np.abs(steps - np.median(steps)) < 0.05 * np.median(steps)
        rows = np.flatnonzero(even[:-3] & even[1:-2] & even[2:-1] & even[3:]) if len(steps) >= 9 else ()
        if len(rows) < 5:
            sigma.append(USUAL_NOISE)
        else:
            sigma.append(float(np.median(np.abs(np.diff(place[finite], 4)[rows])) / (0.6745 * np.sqrt(70.0))))
    level = 0.5 * (sigma[0] + sigma[1])
    return np.clip(np.array([level, level, sigma[2]]), NOISE_MIN, NOISE_MAX)


class _NormalEquations:
    """The normal equations of one axis: states (position, velocity, acceleration) at the nodes."""

    def __init__(self, nodes: Array, time: Array) -> None:
        h = STEP
        self._step = np.array([[1.0, h, h * h / 2.0], [0.0, 1.0, h], [0.0, 0.0, 1.0]])
        covariance = np.array(
            [[h**5 / 20.0, h**4 / 8.0, h**3 / 6.0], [h**4 / 8.0, h**3 / 3.0, h**2 / 2.0], [h**3 / 6.0, h**2 / 2.0, h]]
        )
        self._information = np.linalg.inv(covariance)
        self._count = len(nodes)
        self._node = np.clip(((time - nodes[0]) / h).astype(np.int64), 0, self._count - 2)
        late = time - nodes[self._node]
        self._seen = np.stack([np.ones_like(late), late, late * late / 2.0], axis=1)

    def solve(self, places: Array, certainty: Array, weights: Array) -> tuple[Array, Array]:
        """Return the states, shape (n, 3), and the factored equations, shape (6, 3 n).

        Args:
            places: measured, shape (m,).
            certainty: of them, 1/m^2, shape (m,).
            weights: of the jerk between the nodes, s^5/m^2, shape (n - 1,).
        """
        # Imported here, as below: every command loads this module, few smooth a path, and scipy takes 0.3 s to load.
        from scipy.linalg import cholesky_banded  # pyright: ignore[reportUnknownVariableType] - untyped in scipy

        A, W = self._step, self._information
        diagonal, beside = np.zeros((self._count, 3, 3)), -weights[:, None, None] * (A.T @ W)
        diagonal[:-1] += weights[:, None, None] * (A.T @ W @ A)
        diagonal[1:] += weights[:, None, None] * W
        np.add.at(diagonal, self._node, certainty[:, None, None] * self._seen[:, :, None] * self._seen[:, None, :])
        right = np.zeros((self._count, 3))
        np.add.at(right, self._node, (certainty * places)[:, None] * self._seen)
        diagonal += 1e-9 * np.eye(3)  # so that a path without positions at its ends has a solution
        banded = np.zeros((6, 3 * self._count))  # the lower band, as LAPACK stores it
        for column in range(3):
            for row in range(3):
                if row >= column:
                    banded[row - column, column::3] = diagonal[:, row, column]
                banded[3 + row - column, column : 3 * len(beside) : 3] = beside[:, column, row]
        factor = np.asarray(cholesky_banded(banded, lower=True, check_finite=False), np.float64)
        return _solve(factor, right.ravel()).reshape(-1, 3), factor

    def surprise(self, state: Array) -> Array:
        """Return the squared jerk of every step, in terms of a density of one, shape (n - 1,)."""
        jumps = state[1:] - state[:-1] @ self._step.T
        return np.einsum("ni,ij,nj->n", jumps, self._information, jumps)

    def positions(self, states: Array) -> Array:
        """Return the path at the times of the measurements, shape (3, m); states of shape (3, n, 3)."""
        return np.einsum("mi,ami->am", self._seen, states[:, self._node])


def _solve(factor: Array, right: Array) -> Array:
    from scipy.linalg import cho_solve_banded  # pyright: ignore[reportUnknownVariableType] - untyped in scipy

    return np.asarray(cho_solve_banded((factor, True), right, check_finite=False), np.float64)
