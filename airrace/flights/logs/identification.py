"""An aircraft identified from recorded flights: drag, power and wind by output error, and the greatest roll rate.

In the method of output error the path obeys the point mass, its lift alone is free. It is the most probable path, as
of `smoothing`, but its speed follows from the aircraft's drag and thrust:

    r' = v      v' = u - e (e . u) + g0 (e_D + n_x e)      u' = j - e (u . e')      j' = -j / lag - e (j . e') + noise

`e = v / |v|`, and `u` is the lift over mass, carried along with the path; it changes as fast as aircraft roll and pull.
`n_x` is that of the point mass at full throttle, with the thrust along the body. States at all nodes, factors of the
aircraft's numbers and winds are found together by the method of Gauss and Newton. The states are eliminated node by
node, and what is left is the information matrix of the others [R. E. Maine & K. W. Iliff, Identification of Dynamic
Systems, NASA RP-1138, 1985]. The most probable lift is smoother than the true one, so that its variance is added to its
square before drag is made of it, and the noise is as strong as the lift is lively around a node.

Deviations of the information matrix hold where the residuals along the path are white. They grow with their scatter and
with the root of the number of samples that an independent one stands for.

The quickest roll of a race counts as one at full ailerons. Its mean rate is compared with what an aircraft can at that
airspeed. It tells of the aircraft only where it is held: a roll that ends sooner is quicker over half of the time.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import cast

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from airrace.flights.logs.histories import samples_of
from airrace.flights.logs.log_flight import LogFlight
from airrace.flights.logs.recording import rounding
from airrace.flights.logs.smoothing import STEP, Path
from airrace.flights.logs.violations import is_measured
from airrace.model.aircraft import Aircraft, AircraftParameters, aircraft_parameters
from airrace.model.dynamics.aerodynamics import Airflow, axial_load_factor, load_factor_coefficients, thrust
from airrace.model.dynamics.flight_manual import roll_rate
from airrace.model.environment import Air, WindField, atmosphere_parameters, density, g0
from airrace.optimal_control.trajectory import Array

FACTORS = 3
"""The number of factors: of C_D0, k and power."""
STATES = 12


LIFT_LAG = 0.15
"""The time in which the rate of the lift changes, s: half of the 0.2 to 0.4 s that a roll of 80 degrees takes."""
RATE_NOISE = 2e4
"""The density of the noise of that rate before the path is known, m^2/s^7."""
NOISE_WINDOW = 0.3
"""The time within which it is equally strong, s."""
NOISE_LEAST = 0.02
"""The share of its mean that it has everywhere, at least."""
STEP_DEVIATIONS = (0.003, 0.003, 0.3)
"""The deviations of position, velocity and lift from the equations after a step of the path, m, m/s, m/s^2, so that the
matrices are regular."""
ALONG_PATH_DEVIATION = 1.0
"""The deviation of the components of `u` and `j` along the path, which have no effect, m/s^2 and m/s^3."""
LIFT_ROUNDING = 0.5
"""The rounding of the size of the lift at zero, m/s^2."""
GAP_DEVIATION = 50.0
"""The deviation of the lift over mass in gaps, at most, m/s^2."""
WIND_DEVIATION = 5.0
"""The deviation of the wind from the course's before anything is measured, m/s."""
FACTOR_DEVIATION = 1.0
"""Likewise of the logarithms of the factors."""
ITERATIONS = 6
"""The number of iterations; twice as many move factors by a quarter of their deviations."""
VISIBLE_DEVIATION = 0.3
"""The greatest deviation with which a factor counts as seen in the data."""
SAMPLES_MIN = 50
"""The least number of samples of the path."""
RATE_MIN = 4.0
"""The least number of samples per second: 5 Hz is measured."""


@dataclass
class RecordedPath:
    """The part of a log that is fitted, on the nodes of its smoothed path; north, east, down.

    Attributes:
        states: position, velocity, `u` and `j` at the nodes, shape (n, 12).
        places: recorded, m, shape (m, 3); `noise`: their standard deviation by axis, m, shape (3,).
        node, late: the node before each place, and the time since it, s, shape (m,).
        noises: densities of the noise between the nodes, m^2/s^7, shape (n - 1,).
        variance: of `u` across the path, m^2/s^4, shape (n - 1,).
        residuals: of the places along the path, in deviations, shape (m,).
    """

    states: Array
    places: Array
    noise: Array
    node: NDArray[np.int64]
    late: Array
    noises: Array
    variance: Array
    residuals: Array

    @property
    def colour(self) -> float:
        """The factor of deviations for residuals along the path that scatter otherwise than noise, or not freely."""
        x = self.residuals - self.residuals.mean()
        rho = np.correlate(x, x, "full")[len(x) :] / float(x @ x)
        first = int(np.argmax(rho <= 0.0)) if (rho <= 0.0).any() else len(rho)
        return max(1.0, math.sqrt(float(np.mean(self.residuals**2)) * (1.0 + 2.0 * float(rho[:first].sum()))))


def recorded_path(path: Path, time: Array, places: Array, begin: float, end: float) -> RecordedPath:
    """Return what of a smoothed path lies between two times, s.

    Args:
        path: smoothed from the places.
        time: of the places, s, shape (m,).
        places: north, east and up, m, shape (3, m); NaN where an axis is not known.
        begin, end: of the flight at full power.
    """
    down, good = np.array([[1.0], [1.0], [-1.0]]), ~path.outliers & np.isfinite(places).all(axis=0)
    good &= (time >= begin) & (time <= end)
    first, last = time[good][[0, -1]].tolist()  # where no place is near the lift is unknown
    inside = (path.time > first - STEP) & (path.time < last + STEP)
    nodes = path.time[inside]
    position, velocity, force = (
        (down * values[:, inside]).T for values in (path.position, path.velocity, path.acceleration)
    )
    force = force - np.array([0.0, 0.0, g0])
    e = velocity / np.linalg.norm(velocity, axis=1)[:, None]
    u = force - e * np.sum(force * e, axis=1)[:, None]
    node = np.clip(((time[good] - nodes[0]) / STEP).astype(np.int64), 0, len(nodes) - 2)
    return RecordedPath(
        np.hstack([position, velocity, u, np.zeros_like(u)]),
        (down * places[:, good]).T,
        path.noise,
        node,
        time[good] - nodes[node],
        np.full(len(nodes) - 1, RATE_NOISE),
        np.zeros(len(nodes) - 1),
        np.zeros(int(good.sum())),
    )


@dataclass(frozen=True, eq=False)
class Estimate:
    """What is found in paths.

    Attributes:
        factors: logarithms of the factors of C_D0, k and power, shape (3,); zero where they are not visible.
        visible: whether the data determine them, shape (3,).
        winds: in addition to the course's, north and east, by path, m/s, shape (l, 2).
        covariance: of factors and winds, shape (3 + 2 l, 3 + 2 l).
    """

    factors: Array
    visible: NDArray[np.bool_]
    winds: Array
    covariance: Array

    @property
    def deviations(self) -> Array:
        """The standard deviations of factors and winds, shape (3 + 2 l,)."""
        return np.sqrt(np.diag(self.covariance))

    def aircraft(self, start: Aircraft) -> Aircraft:
        """Return the aircraft that has the factors."""
        C_D0, k, power = np.exp(self.factors).tolist()
        return replace(
            start,
            drag=replace(start.drag, C_D0=C_D0 * start.drag.C_D0, k=k * start.drag.k),
            propulsion=replace(start.propulsion, P_max=power * start.propulsion.P_max),
        )


def estimate_factors(aircraft: Aircraft, air: Air, paths: Sequence[RecordedPath]) -> Estimate:
    """Return factors and winds with which an aircraft flies along all paths; the paths become those it flies.

    What is not visible is found out first, and left at the start's value then.
    """
    step, hidden = _step_function(aircraft, air), np.zeros(FACTORS, np.bool_)
    values, covariance = _solve(step, paths, hidden)
    hidden = np.sqrt(np.diag(covariance))[:FACTORS] > VISIBLE_DEVIATION
    if hidden.any() and not hidden.all():
        values, covariance = _solve(step, paths, hidden)
    colour = max(path.colour for path in paths)
    factors = np.where(hidden, 0.0, values[:FACTORS])
    return Estimate(factors, ~hidden, values[FACTORS:].reshape(-1, 2), colour**2 * covariance)


def _solve(step: ca.Function, paths: Sequence[RecordedPath], hidden: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return factors and winds with their covariance."""
    prior = np.array([FACTOR_DEVIATION**-2] * FACTORS + [WIND_DEVIATION**-2] * (2 * len(paths)))
    prior[:FACTORS][hidden] = 1e12  # as good as certain
    values, information = np.zeros(len(prior)), np.diag(prior)
    for _ in range(ITERATIONS):
        information, score = np.diag(prior), -prior * values
        moves: list[tuple[Array, Array, NDArray[np.int64]]] = []
        for number, path in enumerate(paths):
            own = np.array([*range(FACTORS), FACTORS + 2 * number, FACTORS + 2 * number + 1])
            X, own_information, own_score = _eliminate(path, step, values[own])
            information[np.ix_(own, own)] += own_information
            score[own] += own_score
            moves.append((X[:, :, 0], X[:, :, 1:], own))
        change = np.linalg.solve(information, score)
        values = values + change
        for path, (alone, by_value, own) in zip(paths, moves, strict=True):
            path.states = path.states + alone - by_value @ change[own]
    return values, np.linalg.inv(information)


def _eliminate(path: RecordedPath, step: ca.Function, values: Array) -> tuple[Array, Array, Array]:
    """Return the change of the states, with what every value takes from it, and information and score of the values.

    The normal equations are block-tridiagonal: `D` on the diagonal, `-W A` beside it. The variances of the states come
    out on the way back, and from them the strength of the noise for the next time.
    """
    n, p, h = len(path.states), len(values), STEP
    after, acceleration, by_state, by_value = (
        np.asarray(derivative.full(), np.float64)
        for derivative in step.map(n - 1)(path.states[:-1].T, values, path.variance)
    )
    A, B = (derivative.reshape(STATES, n - 1, -1).transpose(1, 0, 2) for derivative in (by_state, by_value))
    defect = path.states[1:] - after.T
    W = np.empty((n - 1, STATES))
    for block, deviation in enumerate(STEP_DEVIATIONS):
        W[:, 3 * block : 3 * block + 3] = deviation**-2
    W[:, 9:] = 1.0 / (h * path.noises[:, None])
    beside = A.transpose(0, 2, 1) * W[:, None, :]  # of k with k + 1, its sign turned
    D, right = np.zeros((n, STATES, STATES)), np.zeros((n, STATES, 1 + p))
    D[:-1] += beside @ A
    D[1:] += W[:, :, None] * np.eye(STATES)
    causes = np.concatenate([-defect[:, :, None], -B], axis=2)
    right[1:] += W[:, :, None] * causes
    right[:-1] -= beside @ causes
    e = path.states[:, 3:6] / np.linalg.norm(path.states[:, 3:6], axis=1)[:, None]
    for part in (slice(6, 9), slice(9, 12)):
        D[:, part, part] += e[:, :, None] * e[:, None, :] / ALONG_PATH_DEVIATION**2
        right[:, part, 0] -= e * np.sum(e * path.states[:, part], axis=1)[:, None] / ALONG_PATH_DEVIATION**2
    t, node = path.late[:, None], path.node
    curve = 0.5 * t * t * acceleration.T[node]
    residuals = path.places - path.states[node, :3] - t * path.states[node, 3:6] - curve
    sensitivity = np.hstack([t**0, t, 0.5 * t * t, 0.0 * t])
    jacobian = (sensitivity[:, None, :, None] * np.eye(3)[:, None, :]).reshape(len(t), 3, STATES)
    np.add.at(D, node, np.einsum("mai,a,maj->mij", jacobian, path.noise**-2, jacobian))
    np.add.at(right[:, :, 0], node, np.einsum("mai,a,ma->mi", jacobian, path.noise**-2, residuals))
    path.residuals = np.sum(residuals / path.noise * e[node], axis=1)
    border = right[:, :, 1:].copy()
    inverses, X, jumps = np.empty_like(D), right, np.zeros(n - 1)
    inverses[0] = np.linalg.inv(D[0])
    for k in range(1, n):
        gain = beside[k - 1].T @ inverses[k - 1]
        X[k] += gain @ X[k - 1]
        inverses[k] = np.linalg.inv(D[k] - gain @ beside[k - 1])
    covariance = inverses.copy()
    X[-1] = inverses[-1] @ X[-1]
    for k in range(n - 2, -1, -1):
        gain, later = inverses[k] @ beside[k], covariance[k + 1]
        X[k] = inverses[k] @ X[k] + gain @ X[k + 1]
        cross = A[k] @ gain @ later
        covariance[k] += gain @ later @ gain.T
        path.variance[k] = min(_across(covariance[k, 6:9, 6:9], e[k]), GAP_DEVIATION**2)
        jumps[k] = _across((later + A[k] @ covariance[k] @ A[k].T - cross - cross.T)[9:, 9:], e[k])
    path.noises = _noises(np.sum(defect[:, 9:] ** 2, axis=1) + jumps)
    score = np.einsum("kip,ki->p", B, W * defect) - np.einsum("kip,ki->p", border, X[:, :, 0])
    information = np.einsum("kip,ki,kiq->pq", B, W, B) - np.einsum("kip,kiq->pq", border, X[:, :, 1:])
    return X, information, score


def _across(covariance: Array, e: Array) -> float:
    return float(np.trace(covariance) - e @ covariance @ e)


def _noises(squares: Array) -> Array:
    """Return the density of the noise around every step from the expected squares of its jumps, m^2/s^6."""
    half = int(NOISE_WINDOW / STEP)
    near = np.hanning(2 * half + 3)[1:-1]
    local = np.convolve(squares, near, "same") / np.convolve(np.ones(len(squares)), near, "same")
    return (local + NOISE_LEAST * local.mean()) / (2.0 * STEP)


def _step_function(aircraft: Aircraft, air: Air) -> ca.Function:
    """Return (state, values, variance of u) -> (state after a step, acceleration, derivatives of the former)."""
    s, values, variance = ca.SX.sym("s", STATES), ca.SX.sym("values", FACTORS + 2), ca.SX.sym("variance")
    start, power = aircraft_parameters(aircraft), ca.exp(values[2])
    polar = {"C_D0": start.C_D0 * ca.exp(values[0]), "k": start.k * ca.exp(values[1])}
    numbers = AircraftParameters[ca.SX](**(vars(start) | polar | {"P": start.P * power, "V_s": start.V_s * power}))
    field, atmosphere, down = WindField.from_air(air), atmosphere_parameters(air), ca.DM([0.0, 0.0, 1.0])

    def rates(s: ca.SX) -> ca.SX:
        r, v, u, j = s[:3], s[3:6], s[6:9], s[9:]
        V = ca.norm_2(v)
        e = v / V
        lift = u - e * ca.dot(e, u)
        n_z = ca.sqrt(ca.sumsqr(lift) + variance + LIFT_ROUNDING**2) / g0
        z = -lift / ca.sqrt(ca.sumsqr(lift) + LIFT_ROUNDING**2)
        W_N, W_E, W_D = field.velocity(r[0], r[1], r[2], field.values(air))
        V_A = cast(ca.SX, v - ca.vertcat(W_N + values[3], W_E + values[4], W_D))
        flow = Airflow(ca.norm_2(V_A), ca.dot(V_A, e), ca.dot(V_A, ca.cross(z, e)), ca.dot(V_A, z))
        rho = density(r[2], atmosphere)
        pull = thrust(1.0, flow.V_A, rho, numbers) / (numbers.m * g0)
        C_L = load_factor_coefficients(n_z, 0.0, flow, rho, numbers).C_L
        alpha = (C_L - aircraft.lift.C_L0) / aircraft.lift.C_Lalpha
        wing = cast(ca.SX, n_z - pull * ca.sin(alpha))  # the thrust carries the rest
        coefficients = load_factor_coefficients(wing, 0.0, flow, rho, numbers)
        balance = axial_load_factor(wing, 0.0, coefficients, 1.0, flow, rho, numbers)
        n_x = cast(ca.SX, balance - pull * (1.0 - ca.cos(alpha)))
        bend = lift + g0 * (down - e * e[2])
        turn = bend / V
        return ca.vertcat(
            v, bend + e * (g0 * (n_x + e[2])), j - e * ca.dot(u, turn), -j / LIFT_LAG - e * ca.dot(j, turn)
        )

    h, first = STEP, rates(s)
    second = rates(s + 0.5 * h * first)
    third = rates(s + 0.5 * h * second)
    after = s + h / 6.0 * (first + 2.0 * second + 2.0 * third + rates(s + h * third))
    outputs = [after, first[3:6], ca.jacobian(after, s), ca.jacobian(after, values)]
    return ca.Function("step", [s, values, variance], outputs, {"cse": True})


# How a roll rate is measured; tried with 0 to 2 degrees of noise at 10 to 50 Hz.
ROLL_WINDOW = 0.4
"""The time of which the mean rate counts, s."""
STEADY_SHARE = 0.93
"""The share of the greatest mean rate over half of that time that it must have. Rolls of Rovinj 2014, which reach the
aircraft's rate, have 0.94 to 1, those of Chiba 2015, which end at 0.7 of it, at most 0.92."""
ROLL_STEP_MAX = 0.11
"""The longest time between two samples of the roll, s."""
GREATEST_EXCESS = 0.85
"""The excess of the greatest of many means over the true rate, in deviations of one."""
AIRSPEED_DEVIATION = 0.01
"""The relative deviation of the airspeed: 2 kt of unknown wind."""
STEEP_ROLL = math.radians(50.0)
"""The climb or dive beyond which a roll alone may jump, rad."""
VISIBLE_RATE_DEVIATION = 0.1
"""The greatest deviation with which the rate counts as seen."""
RATE_FACTOR_MAX = 0.7
"""The greatest size of its logarithm; beyond it the record is doubted, not the aircraft."""


@dataclass(frozen=True)
class RollRate:
    """The logarithm of the factor of an aircraft's roll rate, and its standard deviation."""

    factor: float
    deviation: float

    def aircraft(self, start: Aircraft) -> Aircraft:
        """Return the aircraft that rolls so much faster at the same damping."""
        more = math.exp(self.factor)
        return replace(
            start,
            roll=replace(start.roll, C_lxi=more * start.roll.C_lxi),
            yaw=replace(start.yaw, C_nxi=more * start.yaw.C_nxi),
            point_mass=replace(start.point_mass, p=more * start.point_mass.p),
        )


def measure_roll_rate(aircraft: Aircraft, logs: Sequence[LogFlight]) -> RollRate | None:
    """Return the roll rate of the quickest roll of all logs; None where none of them shows one that is held."""
    estimates = [_log_roll_rate(aircraft, log) for log in logs]
    roll_rates = [estimate for estimate in estimates if estimate is not None]
    return max(roll_rates, key=lambda roll_rate: roll_rate.factor, default=None)


def _log_roll_rate(aircraft: Aircraft, log: LogFlight) -> RollRate | None:
    flight = log.flight
    if not (is_measured(flight, "phi") and "p_Kbar" in flight.histories):
        return None
    time, roll = samples_of(log.recording, "phi")  # fresh ones
    if np.median(np.diff(time)) > ROLL_STEP_MAX:
        return None
    limits = np.minimum(aircraft.point_mass.p, roll_rate(aircraft, 1.0) * flight["V_A"])
    shares = np.where(np.abs(flight["gamma"]) < STEEP_ROLL, flight["p_Kbar"] / limits, 0.0)
    count = round(ROLL_WINDOW / float(np.median(np.diff(flight.time))))
    means, shorter = _means(shares, count), _means(shares, count // 2)
    white = float(np.median(np.abs(np.diff(roll, 3)))) / 0.6745 / math.sqrt(20.0)  # its third differences
    deviation = max(white, rounding(roll)) * math.sqrt(2.0) / ROLL_WINDOW / aircraft.point_mass.p
    rate = float(means.max()) - GREATEST_EXCESS * deviation
    if rate <= 0.0 or means.max() < STEADY_SHARE * shorter.max():
        return None
    estimate = RollRate(math.log(rate), math.hypot(deviation / rate, AIRSPEED_DEVIATION))
    return estimate if estimate.deviation < VISIBLE_RATE_DEVIATION and abs(estimate.factor) < RATE_FACTOR_MAX else None


def _means(values: Array, count: int) -> Array:
    """Return the sizes of the means of so many values in a row."""
    return np.abs(np.convolve(values, np.full(count, 1.0 / count), "valid"))
