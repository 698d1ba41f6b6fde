"""Gusts after Dryden at low altitude, MIL-F-8785C (1980), 3.7.3: forming filters, discretised exactly.

At the height h in feet (10 to 1000 ft) and with the wind W20 at 20 ft,

    sigma_w = 0.1 W20,   sigma_u = sigma_v = sigma_w / (0.177 + 0.000823 h)^0.4
    L_w = h,             L_u = L_v = h / (0.177 + 0.000823 h)^1.2

u is along the course over ground, v to its right, w down. With T = L / V and the airspeed V, white noise of unit
density drives

    H_u = sigma_u sqrt(2 T_u) / (1 + T_u s)
    H_v = sigma_v sqrt(T_v) (1 + sqrt(3) T_v s) / (1 + T_v s)^2,   H_w alike

The states of the filters are scaled such that their stationary covariance does not depend on T: of the first order 1,
of the second I / 4, with the output (1, sqrt(3)). So they stay stationary where speed and height change.
"""

from collections.abc import Sequence
from enum import StrEnum

import numpy as np

from airrace.quantities import KNOT
from airrace.records import record
from airrace.trajectory import Array

FOOT = 0.3048
"""One foot in m."""
STATES = 5
"""The number of states: one of u, two each of v and w."""
STATIONARY = np.diag([1.0, 0.25, 0.25, 0.25, 0.25])
"""The stationary covariance of the states."""


class Gusts(StrEnum):
    """An intensity of turbulence."""

    NONE = "none"
    LIGHT = "light"
    MODERATE = "moderate"
    SEVERE = "severe"

    @property
    def wind_at_20_ft(self) -> float:
        """The wind at 20 ft that belongs to it by MIL-F-8785C: 15, 30 and 45 kt; m/s."""
        return KNOT * {"none": 0.0, "light": 15.0, "moderate": 30.0, "severe": 45.0}[self.value]


@record
class GustFilter:
    """The filters along a flight, for N steps of equal time.

    Attributes:
        step: F of every step, shape (N, 5, 5).
        noise: a square root of the covariance of what a step adds, shape (N, 5, 5).
        output: standard deviations and shape: (u, v, w) of the states, m/s, shape (N, 3, 5).
    """

    step: Array
    noise: Array
    output: Array

    @classmethod
    def of(cls, gusts: Gusts, height: Array, speed: Array, seconds: float) -> "GustFilter":
        """Return the filters at heights (m) and airspeeds (m/s), each of shape (N,), for steps of so many seconds."""
        sigma, length = intensity(gusts, height)
        scaled = seconds * speed / length  # steps in units of T, shape (3, N)
        count = len(speed)
        step, noise, output = (np.zeros((count, rows, STATES)) for rows in (STATES, STATES, 3))
        step[:, 0, 0] = np.exp(-scaled[0])
        noise[:, 0, 0] = np.sqrt(-np.expm1(-2.0 * scaled[0]))
        output[:, 0, 0] = sigma[0]
        for axis, first in ((1, 1), (2, 3)):
            s = scaled[axis]
            block = np.exp(-s)[:, None, None] * np.moveaxis(np.array([[1.0 + s, s], [-s, 1.0 - s]]), 2, 0)
            part = slice(first, first + 2)
            step[:, part, part] = block
            noise[:, part, part] = np.linalg.cholesky(0.25 * (np.eye(2) - block @ np.swapaxes(block, 1, 2)))
            output[:, axis, part] = sigma[axis][:, None] * np.array([1.0, np.sqrt(3.0)])
        return cls(step, noise, output)

    def draw(self, generators: Sequence[np.random.Generator]) -> Array:
        """Return histories of (u, v, w), m/s, shape (N, 3, n), stationary from their start, one per generator."""
        count = len(self.step)
        white = np.stack([one.standard_normal((count + 1, STATES)) for one in generators], axis=2)
        state, found = np.sqrt(np.diag(STATIONARY))[:, None] * white[0], np.empty((count, 3, len(generators)))
        for k in range(count):
            found[k] = _times(self.output[k], state)
            state = _times(self.step[k], state) + _times(self.noise[k], white[k + 1])
        return found


def _times(matrix: Array, columns: Array) -> Array:
    """Return a product whose bits do not depend on the number of columns."""
    return np.sum(matrix[:, :, None] * columns, axis=1)


def intensity(gusts: Gusts, height: Array) -> tuple[Array, Array]:
    """Return standard deviations (m/s) and lengths (m) of u, v, w at heights (m); each of shape (3, n)."""
    h = np.clip(height / FOOT, 10.0, 1000.0)
    ratio, sigma = 0.177 + 0.000823 * h, 0.1 * gusts.wind_at_20_ft
    level, long = sigma / ratio**0.4, h * FOOT / ratio**1.2
    return np.stack([level, level, np.full_like(h, sigma)]), np.stack([long, long, h * FOOT])
