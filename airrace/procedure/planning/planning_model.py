"""The planning model: a typical speed, load factor and roll rate of the aircraft, from its own numbers.

With them follows the time that it takes to turn from one attitude to another.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from airrace.model.aircraft import Aircraft
from airrace.model.dynamics.flight_manual import top_speed
from airrace.model.environment import g0
from airrace.model.frames import product
from airrace.model.track.course import Roll, Rules, Turning

AIR_DENSITY = 1.225
"""The density of the air in plans, kg/m3, ISA at sea level; a plan need not know the day."""
SHARE_OF_TOP_SPEED = 0.77
"""The planning speed as a share of the top speed of level flight."""
TURN_LOAD_FACTOR = 6.0
"""The load factor of planned turns, g, where limits and lift allow it."""
SHARE_OF_LIMIT = 0.6
"""The load factor of planned turns as a share of the allowed one, at most."""
TURN_LOAD_FACTOR_MIN = 2.5
"""The least load factor of planned turns, g; below it they become so wide that the plan misses the point."""


@dataclass(frozen=True)
class PlanningModel:
    """The planning speed `V` (m/s), load factor `n` in turns (g), roll rate `p` (rad/s), and half the span (m)."""

    V: float
    n: float
    p: float
    semispan: float = 0.0

    @property
    def radius(self) -> float:
        """The radius of a level turn, m."""
        return self.V**2 / (g0 * math.sqrt(self.n**2 - 1.0))


def cruise(aircraft: Aircraft, rules: Rules) -> PlanningModel:
    """Return three quarters of the top speed, and a load factor that lift and limits leave with a margin."""
    envelope = aircraft.envelope.V
    V = min(max(SHARE_OF_TOP_SPEED * top_speed(aircraft), 1.1 * envelope.lower), 0.95 * envelope.upper)
    lift = 0.5 * AIR_DENSITY * V**2 * aircraft.airframe.S * min(aircraft.lift.C_L_max, rules.C_L.upper)
    n_lift = lift / (aircraft.airframe.m * g0)
    n_limit = min(aircraft.envelope.n_z.upper, rules.n_z.upper)
    n = max(min(TURN_LOAD_FACTOR, SHARE_OF_LIMIT * n_limit, 0.8 * n_lift), TURN_LOAD_FACTOR_MIN)
    return PlanningModel(V, n, 0.5 * min(aircraft.point_mass.p, rules.p), 0.5 * aircraft.airframe.b)


ROUNDING = 1e-6
"""The difference of attitude that counts as none, rad."""


def rotation_vector(
    start: Sequence[float], end: Sequence[float], rolled: float = 0.0, *, prefer_last: bool = False
) -> tuple[float, float, float]:
    """Return the shortest rotation from one attitude to another as a vector in the rotating frame, rad.

    Of two that are half a circle long it is the one that pulls; if neither does, the one that rolls back where the
    aircraft has rolled before (`rolled`, rad, positive to the right). If that decides nothing either, both will do, and
    rounding picks one of them; a mirror does not change which. With `prefer_last` it is the other one.
    """
    w, x, y, z = product([start[0], -start[1], -start[2], -start[3]], end)
    either = -1.0 if (w < 0.0) is not prefer_last else 1.0
    if next((component for component in (w, y, -x * rolled) if abs(component) > ROUNDING), either) < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = math.sqrt(x * x + y * y + z * z)
    factor = 2.0 * math.atan2(sine, w) / sine if sine > 1e-12 else 2.0
    return factor * x, factor * y, factor * z


def turn_by(start: Sequence[float], vector: Sequence[float], part: float) -> list[float]:
    """Return the attitude after a part of a rotation given as a vector in the rotating frame, rad."""
    vector = [part * angle for angle in vector]
    angle = math.sqrt(sum(component * component for component in vector))
    factor = math.sin(angle / 2) / angle if angle > 1e-12 else 0.5
    return product(start, [math.cos(angle / 2), *(factor * component for component in vector)])


def rotation_time(start: Sequence[float], end: Sequence[float], pace: PlanningModel) -> float:
    """Return the time of a rotation, s: rolling at the planned rate, pulling at the planned load factor.

    Pushing takes three times as long as pulling.

    A turn of the path to the side is planned like a pull, for the aircraft can roll into it.
    """
    roll, pitch, yaw = rotation_vector(start, end)
    return abs(roll) / pace.p + _turning_time(pitch, yaw, pace)


def roll_time(
    start: Sequence[float], end: Sequence[float], roll: Roll, pace: PlanningModel, *, prefer_last: bool = False
) -> tuple[float, float]:
    """Return the time (s) and the signed angle (rad, positive to the right) of a roll that leads from one attitude to
    another.

    Where both sides are equally far it is to the right, or to the left where the last of equal choices is asked for.
    """
    between, pitch, yaw = rotation_vector(start, end)
    angle = _least_roll(between, roll, prefer_last=prefer_last)
    return abs(angle) / pace.p + _turning_time(pitch, yaw, pace), angle


def _least_roll(between: float, roll: Roll, *, prefer_last: bool) -> float:
    """Return the smallest roll that turns far enough and ends at the angle `between` (rad)."""
    right = roll.angle + _less_than_full(between - roll.angle)
    left = roll.angle + _less_than_full(-between - roll.angle)
    match roll.turning:
        case Turning.RIGHT:
            return right
        case Turning.LEFT:
            return -left
        case Turning.EITHER:
            return right if right - left <= (-ROUNDING if prefer_last else ROUNDING) else -left


def _less_than_full(angle: float) -> float:
    """Return an angle in [0, 2 pi); what rounding has put just below a full circle becomes zero."""
    wrapped = angle % (2.0 * math.pi)
    return 0.0 if wrapped > 2.0 * math.pi - ROUNDING else wrapped


def _turning_time(pitch: float, yaw: float, pace: PlanningModel) -> float:
    pull = g0 * (pace.n - 1.0) / pace.V
    angle = math.hypot(pitch, yaw)
    pushed = max(0.0, -pitch / angle) if angle > ROUNDING else 0.0
    # A push takes three times a pull: downwards an aircraft and its pilot bear about a third.
    return angle / pull * (1.0 + 2.0 * pushed)
