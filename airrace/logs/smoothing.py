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

import numpy as np
from numpy.typing import NDArray

from airrace.environment.atmosphere import atmosphere_parameters, density, g0
from airrace.logs.recording import Recording
from airrace.planning.race import Race
from airrace.quantities import Quantity
from airrace.records import record
from airrace.results import airdata, attitude
from airrace.results.flight import GLOSSARY, PATH_ATTITUDE, Basis, History
from airrace.trajectory import Array

STEP = 0.05
"""The time between two nodes of the path, s. Half of it gains less than a tenth of a degree of bank."""
DENSITY = np.array([1000.0, 1000.0, 300.0])
"""The density of the jerk's noise, m^2/s^5: north, east and up.

It was chosen on Rovinj 2014, sampled at 5 and at 20 Hz with 1.5 m of noise: with a third or with three times of these
values, neither bank nor load factor is better by more than a tenth.
"""
FREEDOM = 1.0
"""The degrees of freedom of the distribution of the jerk."""
ITERATIONS = 20
"""The number of times that the weights are renewed; later ones move the path by centimetres."""
OUTLYING = 5.0
"""The number of standard deviations from the path beyond which a position is an outlier and left out."""
MOSTLY = 0.5
"""The share of positions that are no outliers, at least; with fewer the noise was misjudged, and none is left out."""
LEAST_NOISE, MOST_NOISE = 0.02, 30.0
"""The bounds of the noise that is estimated from the positions themselves, m."""
EDGE = 0.5
"""The time for which the path goes on before the first position and behind the last one, s.

A log may begin or end at a gate.
"""
LONGEST = 1200.0
"""The time of the longest path that is smoothed, s."""


@record
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
        u, h = (times - self.time[k]) / STEP, STEP
        position = _cubic(self.position, self.velocity, k, u, h)
        velocity = _cubic(self.velocity, self.acceleration, k, u, h)
        acceleration = (1.0 - u) * self.acceleration[:, k] + u * self.acceleration[:, k + 1]
        return position, velocity, acceleration

    def deviations(self, times: Array) -> Array:
        """Return the standard deviation of the position at the nodes next to some times, m, shape (3, m)."""
        k = np.clip(np.rint((times - self.time[0]) / STEP).astype(np.int64), 0, len(self.time) - 1)
        column = np.arange(len(times))
        found = np.empty((3, len(times)))
        for axis, factor in enumerate(self.factors):
            unit = np.zeros((factor.shape[1], len(times)))
            unit[3 * k, column] = 1.0
            found[axis] = np.sqrt(_solved(factor, unit)[3 * k, column])
        return found


def smooth(time: Array, places: Array, noise: float | None = None) -> Path:
    """Return the path of positions.

    Args:
        time: s, rising, shape (m,), at most `LONGEST` long.
        places: north, east and up, m, shape (3, m).
        noise: standard deviation of the positions, m; None to estimate it.
    """
    sigma = np.full(3, max(noise, LEAST_NOISE)) if noise is not None else _noise(time, places)
    nodes = time[0] - EDGE + STEP * np.arange(int(np.ceil((time[-1] - time[0] + 2.0 * EDGE) / STEP)) + 1)
    system = _System(nodes, time)
    weights, near = np.ones(len(nodes) - 1), np.ones(len(time), bool)
    states, factors, off = np.zeros((3, len(nodes), 3)), list[Array](), np.zeros_like(places)
    for _ in range(ITERATIONS):
        solved = [system.solve(places[axis], near / sigma[axis] ** 2, weights / DENSITY[axis]) for axis in range(3)]
        states, factors = np.stack([state for state, _ in solved]), [factor for _, factor in solved]
        surprise = np.sum([system.surprise(states[axis]) / DENSITY[axis] for axis in range(3)], axis=0)
        weights = (FREEDOM + 9.0) / (FREEDOM + surprise)  # of the nine numbers of a step
        off = places - system.positions(states)
        near = np.logical_and.reduce(np.abs(off) < OUTLYING * sigma[:, None], axis=0)
        if near.mean() <= MOSTLY:
            near = np.ones_like(near)
    scatter = np.sqrt(np.mean(off[:, near] ** 2, axis=1)) if near.any() else np.full(3, np.nan)
    position, velocity, acceleration = np.moveaxis(states, 2, 0)
    return Path(nodes, position, velocity, acceleration, sigma, np.logical_not(near), scatter, tuple(factors))


def _noise(time: Array, places: Array) -> Array:
    """Return the noise by the median of fourth differences, in which the flight itself is small.

    For white noise their standard deviation is `sqrt(70) sigma`.
    """
    if len(time) < 10:
        return np.full(3, 1.5)
    even = np.abs(np.diff(time) - np.median(np.diff(time))) < 0.05 * np.median(np.diff(time))
    rows = np.flatnonzero(even[:-3] & even[1:-2] & even[2:-1] & even[3:])
    if len(rows) < 5:
        return np.full(3, 1.5)
    fourth = np.abs(np.diff(places, 4, axis=1)[:, rows])
    sigma = np.median(fourth, axis=1) / (0.6745 * np.sqrt(70.0))
    level = np.full(2, sigma[:2].mean())
    return np.clip(np.append(level, sigma[2]), LEAST_NOISE, MOST_NOISE)


class _System:
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
        A, W = self._step, self._information
        diagonal, beside = np.zeros((self._count, 3, 3)), -weights[:, None, None] * (A.T @ W)
        diagonal[:-1] += weights[:, None, None] * (A.T @ W @ A)
        diagonal[1:] += weights[:, None, None] * W
        outer = certainty[:, None, None] * self._seen[:, :, None] * self._seen[:, None, :]
        np.add.at(diagonal, self._node, outer)
        right = np.zeros((self._count, 3))
        np.add.at(right, self._node, (certainty * places)[:, None] * self._seen)
        diagonal += 1e-9 * np.eye(3)  # so that a path without positions at its ends has a solution
        factor = _factorised(_banded(diagonal, beside))
        return _solved(factor, right.ravel()).reshape(-1, 3), factor

    def surprise(self, state: Array) -> Array:
        """Return the squared jerk of every step, in terms of a density of one, shape (n - 1,)."""
        off = state[1:] - state[:-1] @ self._step.T
        return np.einsum("ni,ij,nj->n", off, self._information, off)

    def positions(self, states: Array) -> Array:
        """Return the path at the times of the measurements, shape (3, m); states of shape (3, n, 3)."""
        return np.einsum("mi,ami->am", self._seen, states[:, self._node])


def _factorised(banded: Array) -> Array:
    # Imported here, as below: every command loads this module, few smooth a path, and scipy takes 0.3 s to load.
    from scipy.linalg import cholesky_banded  # pyright: ignore[reportUnknownVariableType] - untyped in scipy

    return np.asarray(cholesky_banded(banded, lower=True, check_finite=False), np.float64)


def _solved(factor: Array, right: Array) -> Array:
    from scipy.linalg import cho_solve_banded  # pyright: ignore[reportUnknownVariableType] - untyped in scipy

    return np.asarray(cho_solve_banded((factor, True), right, check_finite=False), np.float64)


def _banded(diagonal: Array, beside: Array) -> Array:
    """Return a symmetric matrix of blocks in the lower banded form of LAPACK."""
    banded = np.zeros((6, 3 * len(diagonal)))
    for column in range(3):
        for row in range(3):
            if row >= column:
                banded[row - column, column::3] = diagonal[:, row, column]
            banded[3 + row - column, column : 3 * len(beside) : 3] = beside[:, column, row]
    return banded


def _cubic(values: Array, slopes: Array, k: NDArray[np.int64], u: Array, h: float) -> Array:
    u2, u3 = u * u, u * u * u
    return (
        (2.0 * u3 - 3.0 * u2 + 1.0) * values[:, k]
        + h * (u3 - 2.0 * u2 + u) * slopes[:, k]
        + (3.0 * u2 - 2.0 * u3) * values[:, k + 1]
        + h * (u3 - u2) * slopes[:, k + 1]
    )


DERIVED = {
    "x": Quantity("x", "m", text="north of the track's origin"),
    "y": Quantity("y", "m", text="east of the track's origin"),
    "n_z": Quantity("n_z", "1", text="load factor, 1 in level flight"),
    "n_x": Quantity("n_x", "1", text="load factor along the path"),
    "p_Kbar": Quantity("p_Kbar", "rad/s", text="roll rate about the velocity"),
    "C_L": Quantity("C_L", "1", text="lift coefficient"),
    "beta_A": Quantity("beta_A", "rad", text="aerodynamic sideslip"),
    **{name: Quantity(name, "1", text="attitude of the flight path") for name in PATH_ATTITUDE},
}
"""Declarations of what is derived here, by name; the others stand in the glossary."""
MEASURED = ("V_G", "V_A", "V_I", "n_z", "phi", "theta", "psi")
"""The histories that are kept as they were recorded, where they were."""
SLOWEST = 1.0
"""The speed below which a path has no direction, m/s."""


def derived_histories(race: Race, position: Array, velocity: Array, acceleration: Array) -> dict[str, History]:
    """Return what follows from a path, all of it derived.

    The load factor is what the acceleration leaves across the path once gravity is taken out. A flight without
    sideslip has its lift along -z of the flight-path frame, which is the estimate of the bank:

        f = a + g0 e_up,      n_z = |f - (f . e) e| / g0,      z_Kbar = -(f - (f . e) e) / (n_z g0)

    Negative load factors look like a roll on the back. A roll rate is not told: a roll takes a quarter of a
    second, less than such an estimate resolves.

    Args:
        race: course, aircraft and air.
        position, velocity, acceleration: north, east and up, m, m/s and m/s^2, each of shape (3, n).
    """
    speed = np.maximum(np.linalg.norm(velocity, axis=0), SLOWEST)
    e = velocity / speed
    force = acceleration + np.array([[0.0], [0.0], [g0]])
    along = np.sum(force * e, axis=0)
    across = force - along * e
    lift = np.maximum(np.linalg.norm(across, axis=0), 1e-6)
    down = np.array([[1.0], [1.0], [-1.0]])  # from up to down
    x, z = down * e, -down * across / lift
    R = np.stack([x, np.cross(z, x, axis=0), z], axis=1)
    values = {"x": position[0], "y": position[1], "height": position[2], "z": -position[2], "V_K": speed}
    values |= {"n_z": lift / g0, "n_x": along / g0}
    values |= dict(zip(PATH_ATTITUDE, attitude.quaternions(R), strict=True))
    values |= _lift(race, position, down * velocity, lift / g0)
    return {name: History(DERIVED.get(name) or GLOSSARY[name], one, Basis.DERIVED) for name, one in values.items()}


def roll_rate(R: Array, time: Array) -> Array:
    """Return the roll rate about the velocity of rotation matrices over time, rad/s, shape (n,).

    Between two times the turn is `R_k^T R_(k+1)`, whose roll is `atan2(y'.z, y'.y)` seen from the first.
    """
    turned = np.einsum("jin,jkn->ikn", R[:, :, :-1], R[:, :, 1:])
    rate = np.arctan2(turned[2, 1], turned[1, 1]) / np.diff(time)
    return np.concatenate([rate[:1], 0.5 * (rate[1:] + rate[:-1]), rate[-1:]])


def measured_histories(recording: Recording, time: Array) -> dict[str, History]:
    """Return what was recorded besides the positions, at other times; all of it measured.

    Angles are interpolated along the shorter way. Where a column is silent it is filled from its neighbours; one
    that is silent throughout is left out.

    Args:
        recording: with its own time.
        time: of the flight, on the same clock, s.
    """
    found: dict[str, History] = {}
    for name in MEASURED:
        values = recording.columns.get(name)
        if values is None or np.isfinite(values).sum() < 2:
            continue
        known = np.isfinite(values)
        angle = GLOSSARY[name].unit == "rad" if name in GLOSSARY else False
        given = np.unwrap(values[known]) if angle else values[known]
        there = np.interp(time, recording.time[known], given)
        there = np.remainder(there + np.pi, 2.0 * np.pi) - np.pi if name in ("phi", "psi") else there
        found[name] = History(GLOSSARY.get(name) or DERIVED[name], there, Basis.MEASURED)
    return found


def between_samples(recording: Recording, name: str, times: Array) -> Array:
    """Return how far a recorded history may be from the straight lines between its samples, in its unit, shape (m,).

    What a sample `v_k` differs by from the line between its neighbours is what sampling half as often would lose. The
    error of interpolation goes with the square of the step, so a quarter of it is lost between samples; the greatest
    such number of the samples around a time counts.

    Args:
        recording: with samples of the history.
        name: of the history.
        times: on the clock of the recording, s, shape (m,).
    """
    values = recording.columns[name]
    known = np.isfinite(values)
    t, v = recording.time[known], values[known]
    if len(t) < 3:
        return np.full(len(times), np.nan)
    v = np.unwrap(v) if name in GLOSSARY and GLOSSARY[name].unit == "rad" else v
    share = (t[1:-1] - t[:-2]) / (t[2:] - t[:-2])
    lost = np.pad(0.25 * np.abs(v[1:-1] - (1.0 - share) * v[:-2] - share * v[2:]), 1)
    behind = np.searchsorted(t, times)
    around = np.clip(behind[:, None] + np.arange(-2, 2), 0, len(t) - 1)
    return lost[around].max(axis=1)


def path_attitude(velocity: Array, right_wing: Array) -> list[Array]:
    """Return the quaternion of the flight-path frame whose y axis is the right wing, as far as it lies across the path.

    Args:
        velocity: north, east and up, m/s, shape (3, n).
        right_wing: its direction, north, east and down, shape (3, n).
    """
    x: Array = velocity * np.array([[1.0], [1.0], [-1.0]])
    x = x / np.maximum(np.linalg.norm(x, axis=0), SLOWEST)
    y = right_wing - np.sum(right_wing * x, axis=0) * x
    y = y / np.maximum(np.linalg.norm(y, axis=0), 1e-9)
    z = np.asarray(np.cross(x, y, axis=0), dtype=np.float64)
    return attitude.quaternions(np.stack([x, y, z], axis=1))


def euler_axes(psi: Array, theta: Array, phi: Array) -> Array:
    """Return `R_OB` of heading, pitch and roll, rad, shape (3, 3, n)."""
    (cz, sz), (cy, sy), (cx, sx) = ((np.cos(one), np.sin(one)) for one in (psi, theta, phi))
    rows = (
        (cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx),
        (sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx),
        (-sy, cy * sx, cy * cx),
    )
    return np.array(rows)


def _lift(race: Race, position: Array, V_K: Array, n_z: Array) -> dict[str, Array]:
    """Return true airspeed and the lift coefficient by the aircraft of the race, without sideslip."""
    north, east, up = position
    V_A = np.linalg.norm(V_K - airdata.wind(race.air, north, east, -up), axis=0)
    rho = np.asarray(density(-up, atmosphere_parameters(race.air)), np.float64).reshape(up.shape)
    body = race.aircraft.airframe
    C_L = n_z * body.m * g0 / (0.5 * rho * np.maximum(V_A, SLOWEST) ** 2 * body.S)
    return {"V_A": V_A, "C_L": C_L, "beta_A": np.zeros_like(C_L)}
