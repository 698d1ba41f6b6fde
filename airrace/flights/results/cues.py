"""Cues: what the pilot does on every leg, in the order in which it happens: rolls, pulls, pushes, and the apexes.

A cue is found from the histories by their own changes, with hysteresis, so that a change below a threshold, such as
noise, is none:

    roll:  |p| rises above `roll_rate`; it lasts while p keeps its sign and |p| falls below `roll_rate_end` for no
           longer than `roll_pause`
    pull:  a maximum of n_z between two minima, each lower by `load_change`; it lasts while n_z lies above the middle
           between the maximum and the higher of 1 g and the minimum on that side; a push likewise, upside down
    apex:  a maximum of the height, higher by `height_change` than what lies before and behind it

The direction of a pull is that of the turn about the vertical, int cos^2(gamma) dchi, which no loop makes singular.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from airrace.flights.results.flight import Flight, Leg, legs_of, way
from airrace.model.frames import QUATERNION
from airrace.optimal_control.trajectory import Array

STEP = 0.02
"""The time between the samples in which cues are looked for, s: a tenth of the shortest roll of a race, 0.2 s."""
LOAD_SMOOTHING = 0.03
"""The standard deviation of the Gaussian that the load factor is smoothed with, s. It takes a white noise of 0.1 g at
50 Hz to 0.04 g, and 0.4 g from a peak that rises and falls by 20 g/s."""
ROLL_SMOOTHING = 0.06
"""That of the roll rate, s, which logs have as the slope of an attitude: a white noise of 1 deg at 50 Hz is one of 4
deg/s behind it."""
HEIGHT_SMOOTHING = 0.2
"""That of the height, s: an apex is flat for a second."""
ROLL_BEGINS = math.radians(80.0)
"""The roll rate about the velocity at which a roll begins, rad/s: aircraft of races roll by 200 to 420 deg/s between
gates and change their bank by at most 60 deg/s within a turn."""
ROLL_ENDS = math.radians(40.0)
"""The roll rate at which it ends, rad/s."""
ROLL_PAUSE = 0.5
"""The time for which a roll may be slower in between, s: those that set in slowly halt for a moment."""
ROLL_ANGLE = math.radians(45.0)
"""The smallest roll that counts, rad: to and from gates aircraft roll by 50 to 180 degrees, and what is less is a
correction within a turn."""
LOAD_CHANGE = 2.5
"""The change between a maximum of the load factor and the minima beside it, g: half of what the flattest turns of a
race take."""
PULL = 3.0
"""The least load factor of a pull, g."""
PUSH = -0.5
"""The largest load factor of a push, g."""
LOAD_DURATION = 0.25
"""The shortest pull or push that counts, s: what is shorter is no act of the pilot's own."""
HEIGHT_CHANGE = 30.0
"""The height of an apex, m: more than level turns rise and fall."""
SIDE_ANGLE = math.radians(20.0)
"""The angle about the vertical from which on a pull has a side, rad."""
VERTICAL = math.radians(65.0)
"""The climb angle beyond which a bank has no meaning, rad."""
TOGETHER = 0.25
"""The time within which a roll and a pull begin at once, s; the roll comes first."""
CUE_PAUSE = 0.75
"""The longest time between two actions that make one cue, s."""


@dataclass(frozen=True)
class RollAction:
    """A roll about the velocity.

    Attributes:
        time: of its start, s after the start.
        duration: s.
        bank_from, bank_to: the bank at both ends, right wing down, rad.
        angle: rolled, positive to the right, rad; more than a half turn where the aircraft rolls so far.
        climb: climb angle in its middle, rad; in vertical flight the bank has no meaning.
    """

    time: float
    duration: float
    bank_from: float
    bank_to: float
    angle: float
    climb: float

    @property
    def side(self) -> str:
        """The direction: `left` or `right`."""
        return "right" if self.angle > 0.0 else "left"

    @property
    def vertical(self) -> bool:
        """Whether it is on a vertical line."""
        return abs(self.climb) > VERTICAL

    @property
    def inverted(self) -> bool:
        """Whether it leads through inverted flight, from and to a bank that is well away from it."""
        return self._passes(math.pi)

    @property
    def level(self) -> bool:
        """Whether it leads through level flight, from and to a bank that is well away from it."""
        return self._passes(0.0)

    def _passes(self, bank: float) -> bool:
        sign, margin = math.copysign(1.0, self.angle), 0.5 * ROLL_ANGLE
        ahead = sign * (bank - self.bank_from) % (2.0 * math.pi)
        return margin < ahead < abs(self.angle) - margin


@dataclass(frozen=True)
class Pull:
    """A pull, or a push.

    Attributes:
        time: of its start, s after the start.
        duration: s.
        n_z: the greatest load factor of a pull, the least one of a push, g.
        turn: about the vertical, positive to the right, rad.
        lateral, upward: the mean of the load factor's components to the right and up, g.
        apex: the height of an apex on the way from the load's minimum before to that behind it, m; NaN without one.
        over_the_top: whether the lift points below the horizon there.
    """

    time: float
    duration: float
    n_z: float
    turn: float
    lateral: float
    upward: float
    apex: float
    over_the_top: bool

    @property
    def side(self) -> str:
        """The direction: `left`, `right`, or, where it is neither a turn nor to the side, `up` or `down`."""
        if abs(self.turn) < SIDE_ANGLE and abs(self.lateral) < abs(self.upward):
            return "up" if self.upward > 0.0 else "down"
        return "right" if self.turn > 0.0 else "left"


@dataclass(frozen=True)
class Apex:
    """The highest point between two lower stretches, without a pull: time, s after the start, and height, m."""

    time: float
    height: float
    duration: float = 0.0


Action = RollAction | Pull | Apex


@dataclass(frozen=True)
class Cue:
    """What is done at one place: one action, or a roll and what follows on it at once.

    Attributes:
        leg: on which it begins.
        passing: the passing that is nearer along the way, of the two at the ends of the leg.
        distance: behind that passing along the way, m; negative before it, NaN where positions are not known.
        actions: in the order in which they begin.
    """

    leg: Leg
    passing: str
    distance: float
    actions: tuple[Action, ...]

    @property
    def time(self) -> float:
        """The time at which the first action begins, s after the start."""
        return self.actions[0].time


def cues_of(flight: Flight) -> tuple[Cue, ...]:
    """Return the cues of all complete legs, in the order in which they begin.

    None where the flight knows neither load factor nor attitude; NaN of its histories are bridged by straight lines.
    """
    path = _SmoothPath.from_flight(flight)
    if path is None:
        return ()
    apexes = _apexes(path)
    pulls = _pulls(path, apexes)
    inside = {apex for apex, _ in apexes if any(pull.apex == float(path.height[apex]) for pull in pulls)}
    lone = [Apex(path.time_of(row), float(path.height[row])) for row, _ in apexes if row not in inside]
    actions = _in_order([*_rolls(path), *pulls, *lone])
    cues: list[Cue] = []
    for leg in legs_of(flight):
        if leg.is_complete:
            own = [action for action in actions if leg.before.time <= action.time < leg.after.time]
            cues += [_cue(flight, leg, group) for group in _groups(own)]
    return tuple(cues)


@dataclass(frozen=True, eq=False)
class _SmoothPath:
    """A flight from its first to its last passing at evenly spaced times: smoothed histories, SI units and radians.

    Attributes:
        begin: the first time, s after the start.
        p: roll rate about the velocity; n_z: load factor; height; each of shape (n,).
        chi, gamma, mu: course, continuous; climb; bank; each of shape (n,).
    """

    begin: float
    p: Array
    n_z: Array
    height: Array
    chi: Array
    gamma: Array
    mu: Array

    @classmethod
    def from_flight(cls, flight: Flight) -> "_SmoothPath | None":
        """Return the samples of a flight; None where it does not know enough."""
        passed = [crossing.time for crossing in flight.crossings if crossing.found]
        if len(passed) < 2 or not flight.has(*QUATERNION, "chi", "gamma", "mu"):
            return None
        step, begin, end = STEP, passed[0], passed[-1]
        times = begin + step * np.arange(max(2, int((end - begin) / step + 1e-6) + 1))

        def sample(values: Array) -> Array | None:
            rows = np.isfinite(values)
            return np.interp(times, flight.time[rows], values[rows]) if rows.sum() > 1 else None

        q = np.array([flight[name] for name in QUATERNION])
        measured = "p_Kbar" in flight and np.isfinite(flight["p_Kbar"]).all()
        p = sample(flight["p_Kbar"] if measured else _roll_rate(flight.time, q))
        n_z, height = sample(flight.values("n_z")), sample(flight.values("height"))
        turned = [sample(np.unwrap(flight[name])) for name in ("chi", "mu")]
        chi, gamma, mu = turned[0], sample(flight["gamma"]), turned[1]
        if p is None or n_z is None or height is None or chi is None or gamma is None or mu is None:
            return None
        return cls(
            begin,
            _smooth(p, ROLL_SMOOTHING),
            _smooth(n_z, LOAD_SMOOTHING),
            _smooth(height, HEIGHT_SMOOTHING),
            chi,
            gamma,
            mu,
        )

    def time_of(self, row: int) -> float:
        """Return the time of a sample, s after the start."""
        return self.begin + STEP * row


def _roll_rate(time: Array, q: Array) -> Array:
    """Return the rate about the x axis of the attitude of a frame, rad/s, shape (n,), from its quaternions.

    omega_x = 2 (q0 q1' - q1 q0' - q2 q3' + q3 q2')
    """
    q0, q1, q2, q3 = np.gradient(q, time, axis=1)
    return np.asarray(2.0 * (q[0] * q1 - q[1] * q0 - q[2] * q3 + q[3] * q2), np.float64)


def _smooth(values: Array, deviation: float) -> Array:
    """Return samples smoothed by a Gaussian, whose ends are continued by their first and last values."""
    half = math.ceil(4.0 * deviation / STEP)
    weights = np.exp(-0.5 * (STEP * np.arange(-half, half + 1) / deviation) ** 2)
    return np.asarray(np.convolve(np.pad(values, half, mode="edge"), weights / weights.sum(), mode="valid"), np.float64)


def turning_points(values: Array, change: float) -> list[tuple[int, int]]:
    """Return the maxima and minima between which values change by at least `change`, in order.

    Args:
        values: shape (n,).
        change: smaller ones between two others are passed over.

    Returns:
        Their rows, each with 1 for a maximum or -1 for a minimum, in turn; the last one is that of a change that has
        not turned back yet.
    """
    points: list[tuple[int, int]] = []
    high = low = direction = 0
    for row, value in enumerate(values.tolist()):
        high = row if value > values[high] else high
        low = row if value < values[low] else low
        if direction >= 0 and value <= values[high] - change:
            points.append((high, 1))
            direction, low = -1, row
        elif direction <= 0 and value >= values[low] + change:
            points.append((low, -1))
            direction, high = 1, row
    if direction:
        points.append((high, 1) if direction > 0 else (low, -1))
    return points


def _rolls(path: _SmoothPath) -> list[RollAction]:
    """Return all rolls in order."""
    rolls: list[RollAction] = []
    for first, last in _stretches_of_roll(path.p):
        fastest = float(np.abs(path.p[first : last + 1]).max())
        angle = STEP * float(path.p[first : last + 1].sum())
        if fastest >= ROLL_BEGINS and abs(angle) >= ROLL_ANGLE:
            begin, end = (math.remainder(float(path.mu[row]), 2.0 * math.pi) for row in (first, last))
            climb = float(path.gamma[(first + last) // 2])
            rolls.append(RollAction(path.time_of(first), STEP * (last - first), begin, end, angle, climb))
    return rolls


def _stretches_of_roll(p: Array) -> list[tuple[int, int]]:
    """Return the first and last rows of all stretches on which p is faster than the end of a roll, in order; two the
    same way with hardly a pause between them are one.
    """
    side = np.where(np.abs(p) > ROLL_ENDS, np.sign(p), 0.0)
    edges = [0, *(np.flatnonzero(np.diff(side)) + 1).tolist(), len(p)]
    stretches: list[tuple[int, int]] = []
    for first, end in itertools.pairwise(edges):
        if not side[first]:
            continue
        joins = stretches and side[first] == side[stretches[-1][1]]
        if joins and STEP * (first - stretches[-1][1]) < ROLL_PAUSE:
            stretches[-1] = (stretches[-1][0], end - 1)
        else:
            stretches.append((first, end - 1))
    return stretches


def _apexes(path: _SmoothPath) -> list[tuple[int, bool]]:
    """Return the rows of all apexes, each with whether the lift points below the horizon there."""
    points = turning_points(path.height, HEIGHT_CHANGE)
    inner = [row for number, (row, kind) in enumerate(points) if kind > 0 and 0 < number < len(points) - 1]
    return [(row, math.cos(path.mu[row]) < 0.0) for row in inner]


def _pulls(path: _SmoothPath, apexes: Sequence[tuple[int, bool]]) -> list[Pull]:
    points, pulls = turning_points(path.n_z, LOAD_CHANGE), list[Pull]()
    rows = [0, *(row for row, _ in points), len(path.n_z) - 1]
    for number, (row, kind) in enumerate(points, start=1):
        peak, before, behind = float(path.n_z[row]), rows[number - 1], rows[number + 1]
        if kind * peak < kind * (PULL if kind > 0 else PUSH):
            continue
        first = last = row
        while first > before and _beyond(path, first - 1, peak, kind, before):
            first -= 1
        while last < behind and _beyond(path, last + 1, peak, kind, behind):
            last += 1
        part = slice(first, last + 1)
        turn = float(np.sum(np.cos(path.gamma[part][1:]) ** 2 * np.diff(path.chi[part])))
        lateral = float(np.mean(path.n_z[part] * np.sin(path.mu[part])))
        upward = float(np.mean(path.n_z[part] * np.cos(path.mu[part]) * np.cos(path.gamma[part])))
        apex = next(((at, over) for at, over in apexes if kind > 0 and before <= at <= behind), None)
        height, over = (math.nan, False) if apex is None else (float(path.height[apex[0]]), apex[1])
        duration = STEP * (last - first)
        if duration >= LOAD_DURATION:
            pulls.append(Pull(path.time_of(first), duration, peak, turn, lateral, upward, height, over))
    return pulls


def _beyond(path: _SmoothPath, row: int, peak: float, kind: int, end: int) -> bool:
    """Return whether a load lies beyond the middle between a peak and what is left beside it: 1 g, or the value at
    `end` where that is nearer to the peak."""
    base = kind * max(kind * float(path.n_z[end]), kind * 1.0)
    return kind * float(path.n_z[row]) > kind * 0.5 * (peak + base)


def _in_order(actions: Sequence[Action]) -> list[Action]:
    """Return actions by the time of their start; a roll before a pull that begins at once with it."""
    ordered = sorted(actions, key=lambda action: action.time)
    for number in range(1, len(ordered)):
        before, action = ordered[number - 1], ordered[number]
        if (
            isinstance(action, RollAction)
            and not isinstance(before, RollAction)
            and action.time - before.time < TOGETHER
        ):
            ordered[number - 1 : number + 1] = action, before
    return ordered


def _groups(actions: Sequence[Action]) -> list[tuple[Action, ...]]:
    """Return actions in groups: every roll begins one, and so does what follows after a pause."""
    groups: list[tuple[Action, ...]] = []
    for action in actions:
        last = groups[-1][-1] if groups else None
        joins = (
            last is not None
            and not isinstance(action, RollAction)
            and action.time - last.time - last.duration < CUE_PAUSE
        )
        groups[-1:] = [(*groups[-1], action)] if joins else [*groups[-1:], (action,)]
    return groups


def _cue(flight: Flight, leg: Leg, actions: tuple[Action, ...]) -> Cue:
    before, behind = leg.before.name, leg.after.name
    if not flight.has("x", "y", "z"):
        return Cue(leg, behind, math.nan, actions)
    distance = way(flight, leg)
    at, length = float(np.interp(actions[0].time, flight.time[leg.rows], distance)), float(distance[-1])
    nearer = at < 0.5 * length
    return Cue(leg, before if nearer else behind, at if nearer else at - length, actions)
