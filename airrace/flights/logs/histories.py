"""The histories of a recorded flight: what was measured, and what follows from the smoothed path."""

from collections.abc import Mapping

import numpy as np

from airrace.flights.logs.passings import MEASURED
from airrace.flights.logs.recording import Recording
from airrace.flights.logs.smoothing import Path
from airrace.flights.results import attitude
from airrace.flights.results.derivation import complete_histories, wind_along
from airrace.flights.results.flight import BODY_ATTITUDE, GLOSSARY, Basis, Histories, History
from airrace.model.environment import atmosphere_parameters, density, g0
from airrace.model.frames import QUATERNION
from airrace.optimal_control.quantities import Quantity
from airrace.optimal_control.trajectory import Array
from airrace.race import Race

SPEED_MIN = 1.0
"""The speed below which a path has no direction, m/s."""
HOLE = 0.5
"""The time between two samples of a history beyond which nothing is known between them, s."""
STEEP = np.radians(60.0)
"""The climb angle beyond which no bank follows from a roll alone, rad."""
ALPHA_MAX = 0.35
"""The largest angle of attack that is plausible, rad."""
DECLARATIONS = {
    **GLOSSARY,
    "x": Quantity("x", "m", text="north of the track's origin"),
    "y": Quantity("y", "m", text="east of the track's origin"),
    "n_z": Quantity("n_z", "1", text="load factor, 1 in level flight"),
    "n_x": Quantity("n_x", "1", text="load factor along the path"),
    "p_Kbar": Quantity("p_Kbar", "rad/s", text="roll rate about the velocity"),
    "C_L": Quantity("C_L", "1", text="lift coefficient"),
    "beta_A": Quantity("beta_A", "rad", text="aerodynamic sideslip"),
    "beta_K": Quantity("beta_K", "rad", text="kinematic sideslip of the body, by which its wing is turned in the path"),
    **{name: Quantity(name, "1", text="attitude of the flight path") for name in QUATERNION},
}
"""Declarations of all histories of a recorded flight, by name."""
_DOWN = np.array([[1.0], [1.0], [-1.0]])  # turns up into down


def log_histories(race: Race, recording: Recording, path: Path, time: Array) -> Histories:
    """Return all histories of a flight.

    Args:
        race: course, aircraft and air.
        recording: on the clock of the log.
        path: smoothed from its positions.
        time: of the flight, on the same clock, s.
    """
    position, velocity, acceleration = path.at(time)
    derived = path_histories(race, position, velocity, acceleration)
    chi, gamma, mu = attitude.euler_angles(attitude.path_axes([derived[name] for name in QUATERNION]))
    fillings = {**derived, "V_G": np.hypot(*velocity[:2]), "phi": mu, "theta": gamma, "psi": chi}
    measured: dict[str, Array] = {}
    for name in MEASURED:
        values = _interpolate(recording, name, time)
        finite = np.isfinite(values)
        if name == "phi" and finite.any():
            derived |= _recorded_attitude(race, derived, velocity, recording, time)
        if finite.all() or (finite.mean() > 0.5 and name in fillings):
            measured[name] = np.where(finite, values, fillings.get(name, values))
    bases = {**dict.fromkeys(derived, Basis.DERIVED), **dict.fromkeys(measured, Basis.MEASURED)}
    values = {**derived, **measured}
    recorded_histories = {name: History(DECLARATIONS[name], values[name], basis) for name, basis in bases.items()}
    return complete_histories(race, recorded_histories)


def path_histories(race: Race, position: Array, velocity: Array, acceleration: Array) -> dict[str, Array]:
    """Return what follows from a path, by name.

    The load factor is what the acceleration leaves across the path once gravity is taken out. A flight without
    sideslip has its lift along -z of the flight-path frame, which is the estimate of the bank:

        f = a + g0 e_up,      n_z = |f - (f . e) e| / g0,      z_Kbar = -(f - (f . e) e) / (n_z g0)

    Negative load factors look like a roll on the back. There is no roll rate: a roll takes a quarter of a second, less
    than such an estimate resolves.

    Args:
        race: course, aircraft and air.
        position, velocity, acceleration: north, east and up, m, m/s and m/s^2, each of shape (3, n).
    """
    speed = np.maximum(np.linalg.norm(velocity, axis=0), SPEED_MIN)
    e = velocity / speed
    force = acceleration + np.array([[0.0], [0.0], [g0]])
    along = np.sum(force * e, axis=0)
    across = force - along * e
    lift = np.maximum(np.linalg.norm(across, axis=0), 1e-6)
    x, z = _DOWN * e, -_DOWN * across / lift
    R = np.stack([x, np.cross(z, x, axis=0), z], axis=1)
    n_z, (north, east, up) = lift / g0, position
    V_A = np.linalg.norm(_DOWN * velocity - wind_along(race.air, north, east, -up), axis=0)
    rho = np.asarray(density(-up, atmosphere_parameters(race.air)), np.float64).reshape(up.shape)
    body = race.aircraft.airframe
    C_L = n_z * body.m * g0 / (0.5 * rho * np.maximum(V_A, SPEED_MIN) ** 2 * body.S)
    values = {"x": north, "y": east, "height": up, "z": -up, "V_K": speed, "n_z": n_z, "n_x": along / g0}
    values |= zip(QUATERNION, attitude.quaternions(R), strict=True)
    return values | {"V_A": V_A, "C_L": C_L, "beta_A": np.zeros_like(C_L)}


def _recorded_attitude(
    race: Race, derived: Mapping[str, Array], velocity: Array, recording: Recording, time: Array
) -> dict[str, Array]:
    """Return the attitude of path and body, and the roll rate, by the recorded angles as far as they are there.

    Where roll, pitch and heading are recorded the wings are those of the body, as far as they lie across the path, and
    what is left of them along it is its kinematic sideslip.
    A roll without the others is one about a body that flies along the path at its angle of attack, without sideslip:

        tan(phi) = cos(gamma) sin(mu) / (cos(alpha) cos(gamma) cos(mu) - sin(alpha) sin(gamma))
    """
    psi, theta, phi = (_interpolate(recording, name, time) for name in ("psi", "theta", "phi"))
    axes = attitude.path_axes([derived[name] for name in QUATERNION])
    _, gamma, mu = attitude.euler_angles(axes)
    full, roll = np.isfinite(psi + theta + phi), np.isfinite(phi)
    alpha = np.clip(attitude.angle_of_attack(derived["C_L"], race.aircraft.lift), -ALPHA_MAX, ALPHA_MAX)
    a, b = np.cos(gamma) * np.cos(phi), np.sin(phi) * np.cos(alpha) * np.cos(gamma)
    c = np.sin(phi) * np.sin(alpha) * np.sin(gamma)
    turned = np.arctan2(b, a) - np.arcsin(np.clip(c / np.maximum(np.hypot(a, b), 1e-9), -1.0, 1.0)) - mu
    turned = np.where(roll & ~full & (np.abs(gamma) < STEEP), turned, 0.0)
    x, y, z = axes[:, 0], axes[:, 1], axes[:, 2]
    y, z = np.cos(turned) * y + np.sin(turned) * z, np.cos(turned) * z - np.sin(turned) * y
    R_OB = _euler_axes(*(np.where(full, angle, 0.0) for angle in (psi, theta, phi)))
    wing = R_OB[:, 1] - np.sum(R_OB[:, 1] * x, axis=0) * x
    wing = wing / np.maximum(np.linalg.norm(wing, axis=0), 1e-9)
    y = np.where(full, wing, y)
    z = np.where(full, np.cross(x, wing, axis=0), z)
    q = attitude.quaternions(np.stack([x, y, z], axis=1))
    attitudes: dict[str, Array] = {}
    attitudes.update(zip(QUATERNION, q, strict=True))
    if full.all():
        attitudes.update(zip(BODY_ATTITUDE, attitude.quaternions(R_OB), strict=True))
        attitudes["beta_K"] = np.arcsin(np.clip(np.sum(R_OB[:, 1] * x, axis=0), -1.0, 1.0))
    if roll.all():
        attitudes["p_Kbar"] = _roll_rate(attitude.path_axes(q), time)
    return attitudes


def _interpolate(recording: Recording, name: str, time: Array) -> Array:
    """Return a recorded history at other times, angles along the shorter way; NaN where it is silent."""
    if np.isfinite(recording.columns.get(name, np.empty(0))).sum() < 2:
        return np.full_like(time, np.nan)
    at, values = samples_of(recording, name)
    interpolated = np.interp(time, at, values)
    behind = np.searchsorted(at, time, side="right")
    inside = (behind > 0) & (behind < len(at))
    gap = np.where(inside, at[np.clip(behind, 0, len(at) - 1)] - at[np.clip(behind - 1, 0, len(at) - 1)], np.inf)
    edge = np.minimum(np.abs(time - at[0]), np.abs(time - at[-1]))
    interpolated = np.where((gap <= HOLE) | (edge <= 0.1), interpolated, np.nan)
    return np.remainder(interpolated + np.pi, 2.0 * np.pi) - np.pi if name in ("phi", "psi") else interpolated


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
    t, v = samples_of(recording, name)
    if len(t) < 3:
        return np.full(len(times), np.nan)
    share = (t[1:-1] - t[:-2]) / (t[2:] - t[:-2])
    lost = np.pad(0.25 * np.abs(v[1:-1] - (1.0 - share) * v[:-2] - share * v[2:]), 1)
    around = np.clip(np.searchsorted(t, times)[:, None] + np.arange(-2, 2), 0, len(t) - 1)
    return lost[around].max(axis=1)


def samples_of(recording: Recording, name: str) -> tuple[Array, Array]:
    """Return times and values of a recorded history where it is known, angles without jumps, each of shape (m,)."""
    finite = np.isfinite(recording.columns[name])
    values = recording.columns[name][finite]
    return recording.time[finite], np.unwrap(values) if DECLARATIONS[name].unit == "rad" else values


def _roll_rate(R: Array, time: Array) -> Array:
    """Return the roll rate about the velocity of rotation matrices over time, rad/s, shape (n,).

    Between two times the turn is `R_k^T R_(k+1)`, whose roll is `atan2(y'.z, y'.y)` seen from the first.
    """
    turns = np.einsum("jin,jkn->ikn", R[:, :, :-1], R[:, :, 1:])
    rate = np.arctan2(turns[2, 1], turns[1, 1]) / np.diff(time)
    return np.concatenate([rate[:1], 0.5 * (rate[1:] + rate[:-1]), rate[-1:]])


def _euler_axes(psi: Array, theta: Array, phi: Array) -> Array:
    """Return `R_OB` of heading, pitch and roll, rad, shape (3, 3, n)."""
    (cz, sz), (cy, sy), (cx, sx) = ((np.cos(angle), np.sin(angle)) for angle in (psi, theta, phi))
    rows = (
        (cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx),
        (sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx),
        (-sy, cy * sx, cy * cx),
    )
    return np.array(rows)
