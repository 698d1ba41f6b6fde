"""The histories of a flown path: what positions in time say of speed, course, load factor and bank."""

import numpy as np

from airrace.environment.atmosphere import atmosphere_parameters, density, g0
from airrace.logs.recording import Recording
from airrace.planning.race import Race
from airrace.quantities import Quantity
from airrace.results import airdata, attitude
from airrace.results.glossary import GLOSSARY, PATH_ATTITUDE
from airrace.results.history import Basis, History
from airrace.trajectory import Array

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
    cz, sz = np.asarray(np.cos(psi)), np.asarray(np.sin(psi))
    cy, sy = np.asarray(np.cos(theta)), np.asarray(np.sin(theta))
    cx, sx = np.asarray(np.cos(phi)), np.asarray(np.sin(phi))
    return np.stack(
        [
            np.stack([cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx]),
            np.stack([sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx]),
            np.stack([-sy, cy * sx, cy * cx]),
        ]
    )


def _lift(race: Race, position: Array, V_K: Array, n_z: Array) -> dict[str, Array]:
    """Return true airspeed and the lift coefficient by the aircraft of the race, without sideslip."""
    north, east, up = position
    V_A = np.linalg.norm(V_K - airdata.wind(race.air, north, east, -up), axis=0)
    rho = np.asarray(density(-up, atmosphere_parameters(race.air)), np.float64).reshape(up.shape)
    body = race.aircraft.airframe
    C_L = n_z * body.m * g0 / (0.5 * rho * np.maximum(V_A, SLOWEST) ** 2 * body.S)
    return {"V_A": V_A, "C_L": C_L, "beta_A": np.zeros_like(C_L)}
