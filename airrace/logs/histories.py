"""The histories of a recorded flight: what was measured, and what follows from the smoothed path."""

import numpy as np

from airrace.environment.atmosphere import atmosphere_parameters, density, g0
from airrace.logs.recording import Recording
from airrace.logs.smoothing import Path
from airrace.planning.race import Race
from airrace.quantities import Quantity
from airrace.results import airdata, attitude
from airrace.results.derivation import complete_histories
from airrace.results.flight import BODY_ATTITUDE, GLOSSARY, PATH_ATTITUDE, Basis, Histories, History
from airrace.trajectory import Array

SLOWEST = 1.0
"""The speed below which a path has no direction, m/s."""
DECLARATIONS = {
    **GLOSSARY,
    "x": Quantity("x", "m", text="north of the track's origin"),
    "y": Quantity("y", "m", text="east of the track's origin"),
    "n_z": Quantity("n_z", "1", text="load factor, 1 in level flight"),
    "n_x": Quantity("n_x", "1", text="load factor along the path"),
    "p_Kbar": Quantity("p_Kbar", "rad/s", text="roll rate about the velocity"),
    "C_L": Quantity("C_L", "1", text="lift coefficient"),
    "beta_A": Quantity("beta_A", "rad", text="aerodynamic sideslip"),
    **{name: Quantity(name, "1", text="attitude of the flight path") for name in PATH_ATTITUDE},
}
"""Declarations of all histories of a recorded flight, by name."""
MEASURED = ("V_G", "V_A", "V_I", "n_z", "phi", "theta", "psi")
"""The histories that stay as they were recorded, where they were."""
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
    measured = {name: values for name in MEASURED if (values := _interpolate(recording, name, time)) is not None}
    if {"phi", "theta", "psi"} <= set(measured):
        R_OB = _euler_axes(measured["psi"], measured["theta"], measured["phi"])
        x = velocity * _DOWN
        x = x / np.maximum(np.linalg.norm(x, axis=0), SLOWEST)
        y = R_OB[:, 1] - np.sum(R_OB[:, 1] * x, axis=0) * x  # the right wing, as far as it lies across the path
        y = y / np.maximum(np.linalg.norm(y, axis=0), 1e-9)
        z = np.asarray(np.cross(x, y, axis=0), np.float64)
        q = attitude.quaternions(np.stack([x, y, z], axis=1))
        derived |= zip((*PATH_ATTITUDE, *BODY_ATTITUDE), (*q, *attitude.quaternions(R_OB)), strict=True)
        derived["p_Kbar"] = _roll_rate(attitude.path_axes(q), time)
    bases = {**dict.fromkeys(derived, Basis.DERIVED), **dict.fromkeys(measured, Basis.MEASURED)}
    values = {**derived, **measured}
    given = {name: History(DECLARATIONS[name], values[name], basis) for name, basis in bases.items()}
    return complete_histories(race, given)


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
    speed = np.maximum(np.linalg.norm(velocity, axis=0), SLOWEST)
    e = velocity / speed
    force = acceleration + np.array([[0.0], [0.0], [g0]])
    along = np.sum(force * e, axis=0)
    across = force - along * e
    lift = np.maximum(np.linalg.norm(across, axis=0), 1e-6)
    x, z = _DOWN * e, -_DOWN * across / lift
    R = np.stack([x, np.cross(z, x, axis=0), z], axis=1)
    n_z, (north, east, up) = lift / g0, position
    V_A = np.linalg.norm(_DOWN * velocity - airdata.wind(race.air, north, east, -up), axis=0)
    rho = np.asarray(density(-up, atmosphere_parameters(race.air)), np.float64).reshape(up.shape)
    body = race.aircraft.airframe
    C_L = n_z * body.m * g0 / (0.5 * rho * np.maximum(V_A, SLOWEST) ** 2 * body.S)
    values = {"x": north, "y": east, "height": up, "z": -up, "V_K": speed, "n_z": n_z, "n_x": along / g0}
    values |= zip(PATH_ATTITUDE, attitude.quaternions(R), strict=True)
    return values | {"V_A": V_A, "C_L": C_L, "beta_A": np.zeros_like(C_L)}


def _interpolate(recording: Recording, name: str, time: Array) -> Array | None:
    """Return a recorded history at other times, angles along the shorter way; None where it is silent throughout."""
    values = recording.columns.get(name, np.empty(0))
    known = np.isfinite(values)
    if known.sum() < 2:
        return None
    found = np.interp(time, recording.time[known], _unwrap(name, values[known]))
    return np.remainder(found + np.pi, 2.0 * np.pi) - np.pi if name in ("phi", "psi") else found


def _unwrap(name: str, values: Array) -> Array:
    return np.unwrap(values) if DECLARATIONS[name].unit == "rad" else values


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
    known = np.isfinite(recording.columns[name])
    t, v = recording.time[known], recording.columns[name][known]
    if len(t) < 3:
        return np.full(len(times), np.nan)
    v = _unwrap(name, v)
    share = (t[1:-1] - t[:-2]) / (t[2:] - t[:-2])
    lost = np.pad(0.25 * np.abs(v[1:-1] - (1.0 - share) * v[:-2] - share * v[2:]), 1)
    around = np.clip(np.searchsorted(t, times)[:, None] + np.arange(-2, 2), 0, len(t) - 1)
    return lost[around].max(axis=1)


def _roll_rate(R: Array, time: Array) -> Array:
    """Return the roll rate about the velocity of rotation matrices over time, rad/s, shape (n,).

    Between two times the turn is `R_k^T R_(k+1)`, whose roll is `atan2(y'.z, y'.y)` seen from the first.
    """
    turns = np.einsum("jin,jkn->ikn", R[:, :, :-1], R[:, :, 1:])
    rate = np.arctan2(turns[2, 1], turns[1, 1]) / np.diff(time)
    return np.concatenate([rate[:1], 0.5 * (rate[1:] + rate[:-1]), rate[-1:]])


def _euler_axes(psi: Array, theta: Array, phi: Array) -> Array:
    """Return `R_OB` of heading, pitch and roll, rad, shape (3, 3, n)."""
    (cz, sz), (cy, sy), (cx, sx) = ((np.cos(one), np.sin(one)) for one in (psi, theta, phi))
    rows = (
        (cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx),
        (sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx),
        (-sy, cy * sx, cy * cx),
    )
    return np.array(rows)
