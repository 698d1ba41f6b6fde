"""How long an aircraft takes to turn from one attitude to another: it pulls at a load factor and rolls at a rate."""

import math
from collections.abc import Sequence

from airrace.environment.atmosphere import g0
from airrace.frames import product
from airrace.procedure.cruise import Cruise


def rotation_vector(start: Sequence[float], end: Sequence[float]) -> tuple[float, float, float]:
    """The shortest rotation from one attitude to another as a vector in the rotating frame, rad."""
    w, x, y, z = product([start[0], -start[1], -start[2], -start[3]], end)
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = math.sqrt(x * x + y * y + z * z)
    factor = 2.0 * math.atan2(sine, w) / sine if sine > 1e-12 else 2.0
    return factor * x, factor * y, factor * z


def rotation_time(start: Sequence[float], end: Sequence[float], pace: Cruise) -> float:
    """Seconds: rolling at the planned rate while pulling at the planned load factor; pushing takes three times as long.

    A turn of the path to the side is flown like a pull, for the aircraft can roll into it.
    """
    roll, pitch, yaw = rotation_vector(start, end)
    pull = g0 * (pace.n - 1.0) / pace.V
    sideways = math.hypot(pitch, yaw)
    return abs(roll) / pace.p + sideways / pull * (1.0 if pitch >= -1e-9 else 3.0)
