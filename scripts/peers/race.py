"""The race that all tools fly: a point mass in still air through point gates, its limits, and the guess.

The equations are those of docs/theory/model.md, written with arithmetic operators only, so that one text serves every
tool's expressions, casadi's symbols and numpy's rows. The state is `NORTH` to `ROLL_RATE` of airrace's point mass, the
control the rates of its commands; both come in this order everywhere. Numbers and limits are read from the shipped
course and aircraft, as airrace reads them.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from airrace.files.inputs import load_inputs
from airrace.model.dynamics.flight_model import FlightModel
from airrace.model.dynamics.point_mass import build_point_mass
from airrace.model.environment import Air
from airrace.optimal_control.trajectory import Array

ROOT = Path(__file__).resolve().parents[2]
Scalar = Any  # an expression of whichever tool

G_0 = 9.80665  # m/s2
R_AIR, LAPSE, T_0, P_0 = 287.05287, 0.0065, 288.15, 101325.0  # standard atmosphere: J/(kg K), K/m, K, Pa
TANGENT_AT_LEAST = 1200.0  # m, of the cubic between two passages of one place; its loop is then 180 m across
SPEED_GUESS = 85.0  # m/s
LOAD_GUESS = 6.0  # g, at most
SAMPLES = 200  # of a cubic, to find its length


@dataclass(frozen=True)
class Gate:
    """A point that is passed exactly, in metres; with a direction, the path crosses it level on that heading.

    Attributes:
        north, east, height: of the point, m.
        heading: of the path at the point in the guess, rad; counted on past full turns.
        fixed: whether the path must have this heading, and be level; otherwise the crossing is free.
    """

    north: float
    east: float
    height: float
    heading: float
    fixed: bool

    @property
    def position(self) -> tuple[float, float, float]:
        """North, east, down."""
        return self.north, self.east, -self.height


def _lap(turns: float) -> tuple[Gate, ...]:
    """One lap of the manner of `sixteen_phases`, after so many full turns; its first gate is the start line's last."""
    rows = (
        (-20.0, 250.0, 90.0, False),
        (20.0, 420.0, 90.0, False),
        (-20.0, 590.0, 90.0, False),
        (170.0, 800.0, -10.0, True),
        (280.0, 480.0, -90.0, True),
        (280.0, 480.0, 180.0, True),
        (230.0, 60.0, 255.0, True),
        (0.0, 0.0, 90.0, True),
    )
    return tuple(Gate(n, e, 20.0, np.radians(chi + 360.0 * turns), fixed) for n, e, chi, fixed in rows)


START = Gate(0.0, 0.0, 20.0, np.radians(90.0), True)


@dataclass(frozen=True)
class Numbers:
    """The aircraft, as it enters the equations: SI."""

    m: float
    S: float
    C_D0: float
    k: float
    C_L_minD: float
    C_Dbeta2: float
    C_Y_trim: float
    P: float
    V_s: float
    tau_T: float


@dataclass(frozen=True)
class Guess:
    """Durations (phases,), and states at the nodes of every phase (phases, 12, segments + 1); controls are held."""

    durations: Array
    states: Array
    control: Array


@dataclass(frozen=True)
class Race:
    """Everything that is common to all tools.

    Attributes:
        gates: the end of every phase.
        start: the state when the clock starts (12,).
        numbers: of the aircraft.
        model: airrace's own model of it, whose declarations carry limits and scales.
    """

    gates: tuple[Gate, ...]
    start: Array
    numbers: Numbers
    model: FlightModel

    def rates(self, x: Sequence[Scalar], u: Sequence[Scalar]) -> list[Scalar]:
        """The time derivatives of the state."""
        return rates(x, u, self.numbers)

    def coefficients(self, x: Sequence[Scalar]) -> tuple[Scalar, Scalar]:
        """Lift coefficient and sideslip, which are limited along the path."""
        return coefficients(x, self.numbers)

    def guess(self, segments: int) -> Guess:
        """Cubics from gate to gate, flown level at one speed and banked as their turns need."""
        places = (START, *self.gates)
        phases = [_cubic(*pair) for pair in itertools.pairwise(places)]
        durations = np.array([_length(curve(np.linspace(0, 1, SAMPLES))[0]) / SPEED_GUESS for curve in phases])
        course = np.nan
        states = []
        for curve, duration in zip(phases, durations, strict=True):
            position, _ = curve(np.linspace(0, 1, segments + 1))
            fine = np.unwrap(np.arctan2(*curve(np.linspace(0, 1, SAMPLES * segments + 1))[1][1::-1]))
            turned = fine[::SAMPLES]
            if np.isfinite(course):
                turned = turned + 2 * np.pi * np.round((course - turned[0]) / (2 * np.pi))
            course = turned[-1]
            turning = np.gradient(turned) * segments / duration
            states.append(_states(position, turned, turning))
        return Guess(durations, np.array(states), np.array([0.0, 0.0, 0.0, 1.0]))


def the_race(laps: int = 2) -> Race:
    """The race of so many laps of eight phases."""
    inputs = load_inputs(ROOT / "tracks" / "sixteen_phases.yaml").race
    model = build_point_mass(inputs.aircraft, inputs.course.rules, Air())
    names = [one.name for one in model.system.parameters]
    values = dict(zip(names, model.parameter_values.tolist(), strict=True))
    numbers = Numbers(**{name: values[name] for name in Numbers.__dataclass_fields__})
    start = _states(np.array([START.position]).T, np.array([START.heading]), np.zeros(1))[:, 0]
    return Race(tuple(gate for lap in range(laps) for gate in _lap(lap)), start, numbers, model)


def density(z: Scalar) -> Scalar:
    """Of the standard atmosphere, kg/m3, at z metres below sea level."""
    ratio = 1.0 + (LAPSE / T_0) * z
    return P_0 / (R_AIR * T_0) * ratio ** (G_0 / (R_AIR * LAPSE) - 1.0)


def rotation_columns(q: Sequence[Scalar]) -> tuple[list[Scalar], list[Scalar]]:
    """First column and last row of `R_OKbar`: the direction of the path, and down as seen from the path's frame."""
    q0, q1, q2, q3 = q
    s = 2.0 / (q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
    forward = [1.0 - s * (q2 * q2 + q3 * q3), s * (q1 * q2 + q0 * q3), s * (q1 * q3 - q0 * q2)]
    return forward, [forward[2], s * (q2 * q3 + q0 * q1), 1.0 - s * (q1 * q1 + q2 * q2)]


def coefficients(x: Sequence[Scalar], of: Numbers) -> tuple[Scalar, Scalar]:
    """Lift coefficient and sideslip (rad) that make the load factors."""
    z, V, n_z, n_y = x[2], x[3], x[9], x[10]
    load = of.m * G_0 / (0.5 * of.S) / (density(z) * V * V)
    return load * n_z, load * n_y * (1.0 / of.C_Y_trim)


def rates(x: Sequence[Scalar], u: Sequence[Scalar], of: Numbers) -> list[Scalar]:
    """The time derivatives of the state, SI."""
    _, _, z, V, q0, q1, q2, q3, delta_T, n_z, n_y, p = x
    (e_N, e_E, e_D), (_, R_32, R_33) = rotation_columns((q0, q1, q2, q3))
    rho = density(z)
    C_L, beta = coefficients(x, of)
    C_D = of.C_D0 + of.k * (C_L - of.C_L_minD) * (C_L - of.C_L_minD) + of.C_Dbeta2 * beta * beta
    T = of.P * delta_T * (1.132 * R_AIR * T_0 / P_0 * rho - 0.132) / (V * V + of.V_s * of.V_s) ** 0.5
    n_x = (T - (0.5 * of.S) * rho * V * V * C_D) * (1.0 / (of.m * G_0))
    q = G_0 * (n_z - R_33) / V
    r = G_0 * (n_y + R_32) / V
    return [
        V * e_N,
        V * e_E,
        V * e_D,
        G_0 * (n_x + e_D),
        -0.5 * (q1 * p + q2 * q + q3 * r),
        0.5 * (q0 * p + q2 * r - q3 * q),
        0.5 * (q0 * q - q1 * r + q3 * p),
        0.5 * (q0 * r + q1 * q - q2 * p),
        (u[3] - delta_T) * (1.0 / of.tau_T),
        u[0],
        u[1],
        u[2],
    ]


def crossing(q: Sequence[Scalar], cosine: Scalar, sine: Scalar) -> tuple[Scalar, Scalar]:
    """The path's direction across a heading and down; both are zero where the crossing is fixed."""
    (e_N, e_E, e_D), _ = rotation_columns(q)
    return cosine * e_E - sine * e_N, e_D


def _cubic(one: Gate, other: Gate) -> Any:
    """Hermite's cubic between two gates: from s (n,) to positions and tangents (3, n)."""
    a, b = np.array(one.position), np.array(other.position)
    chord = float(np.linalg.norm(b - a))
    size = chord if chord > 1.0 else TANGENT_AT_LEAST
    t, w = (size * np.array([np.cos(gate.heading), np.sin(gate.heading), 0.0]) for gate in (one, other))
    square, cube = 3 * (b - a) - 2 * t - w, 2 * (a - b) + t + w

    def at(s: Array) -> tuple[Array, Array]:
        powers = (s**0, s, s**2, s**3)
        position = sum(np.outer(c, power) for c, power in zip((a, t, square, cube), powers, strict=True))
        return position, np.outer(t, powers[0]) + np.outer(2 * square, s) + np.outer(3 * cube, s**2)

    return at


def _length(position: Array) -> float:
    return float(np.linalg.norm(np.diff(position, axis=1), axis=0).sum())


def _states(position: Array, course: Array, turning: Array) -> Array:
    """States on a level path at full power, (12, n), banked as much as a turn at these rad/s needs."""
    zero, one = np.zeros_like(course), np.ones_like(course)
    n_z = np.minimum(np.hypot(1.0, SPEED_GUESS / G_0 * turning), LOAD_GUESS)
    bank = np.sign(turning) * np.arccos(1.0 / n_z)
    (c, s), (d, e) = ((np.cos(angle / 2), np.sin(angle / 2)) for angle in (course, bank))
    return np.array([*position, SPEED_GUESS * one, c * d, c * e, s * e, s * d, one, n_z, zero, zero])
