"""Cues: what the pilot does on every leg, as a chain: every cue begins with the bank, the pull and the height with
which the one before it ends.

A cue says of the bank that it changes evenly, and of the pull how it begins, its extreme, its mean and how it ends:
the load goes to the extreme, stays there, and leaves it again, at one rate such that the mean is right. What these
words leave out of the lift's direction and size adds up to an angle by which the path turns otherwise,

    da = g0 int (n'_z sin mu' - n_z sin mu, n'_z cos mu' - n_z cos mu) / V_K dt

A leg is cut at every roll, and else where da would become too large: into as few cues as that takes, and of those the
truest. Near the vertical, where the bank has no meaning, the angle rolled about the velocity takes its place.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from airrace.flights.results.flight import Flight, Leg, legs_of, way
from airrace.model.environment import g0
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
"""That of the height in which apexes are looked for, s: an apex is flat for a second."""
ROLL_RATE = math.radians(80.0)
"""The roll rate from which on a change of bank is a roll, rad/s: aircraft of races roll by 200 to 420 deg/s between
gates and ease their bank by at most 60 deg/s within a turn."""
ROLL_ENDS = math.radians(40.0)
"""The roll rate at which it begins and ends, rad/s."""
ROLL_PAUSE = 0.5
"""The time for which a roll may be slower in between, s: those that set in slowly halt for a moment."""
ROLL_ANGLE = math.radians(30.0)
"""The smallest roll that cuts a leg, rad: what is less is a correction within a turn."""
HOLD_ANGLE = math.radians(5.0)
"""The change of bank below which it is held, rad: pilots read a horizon no better."""
HEIGHT_CHANGE = 30.0
"""The height of an apex, m: more than level turns rise and fall."""
VERTICAL = math.radians(65.0)
"""The climb angle beyond which a bank has no meaning, rad."""
CUT_STEP = 0.2
"""The time between the places at which a leg may be cut, besides those of its rolls, s: pilots react no faster."""
SHORTEST = 0.15
"""The time within which a roll begins or ends at a passing, s: less is no cue of its own."""
STROKE = 0.6
"""The time within which a roll is one stroke of the stick, s."""
ROUGH = 1.5
"""The drift from which on a stroke, or what lies between two neighbouring places, is cut once more, as a multiple of
what words may leave out."""
DRIFT = 4.0
"""The distance that the words of a cue may lead away from the line up to the next passing, m: those of a leg together
by 15 m."""
DRIFT_ANGLE = math.radians(1.5)
"""The angle that they may turn the path by at most, rad: those of a leg together by 5 degrees."""
DRIFT_COST = 1.0
"""The number of cues that a chain may be longer by to save the whole drift of one cue."""


@dataclass(frozen=True)
class CueState:
    """The flight where one cue ends and the next begins.

    Attributes:
        time: s after the start.
        bank: right wing down, rad; without a meaning near the vertical.
        n_z: load factor, g.
        height: above the track's origin, m.
        course: over ground, clockwise from north, rad; NaN near the vertical, where it has no meaning.
    """

    time: float
    bank: float
    n_z: float
    height: float
    course: float


@dataclass(frozen=True)
class Apex:
    """The highest point between two lower stretches.

    Attributes:
        time: s after the start.
        height: m.
        over_the_top: whether the lift points below the horizon there.
    """

    time: float
    height: float
    over_the_top: bool


@dataclass(frozen=True)
class Cue:
    """What is done on a part of a leg.

    Attributes:
        number: counts from 1, all over the flight.
        leg: of which it is a part.
        passing: the name of the passing that its begin is nearer to along the way, of the two at the ends of the leg.
        distance: of its begin behind that passing along the way, m; negative before it, NaN where positions are not
            known.
        begin, end: the flight at both ends; `end` is the `begin` of the next cue, its course that to pull out on.
        rolled: the angle by which the bank changes, or, of a vertical cue, that rolled about the velocity, positive to
            the right, rad; more than a half turn where the aircraft rolls so far.
        vertical: whether the path is nearly vertical somewhere, so that the bank has no meaning.
        n_z_extreme: the load factor that is gone to, the greatest or the least one, g.
        n_z_mean: its mean over time, g.
        apex: the highest point, where there is one in it.
    """

    number: int
    leg: Leg
    passing: str
    distance: float
    begin: CueState
    end: CueState
    rolled: float
    vertical: bool
    n_z_extreme: float
    n_z_mean: float
    apex: Apex | None

    @property
    def time(self) -> float:
        """The time at which it begins, s after the start."""
        return self.begin.time

    @property
    def duration(self) -> float:
        """The time that it takes, s."""
        return self.end.time - self.begin.time

    @property
    def side(self) -> str:
        """The direction of the change of bank: `left` or `right`; empty where the bank is held."""
        if abs(self.rolled) < HOLD_ANGLE:
            return ""
        return "right" if self.rolled > 0.0 else "left"

    @property
    def action(self) -> str:
        """What is done with the bank: `roll`, `ease` or `hold`."""
        if not self.side:
            return "hold"
        return "roll" if abs(self.rolled) >= ROLL_RATE * self.duration else "ease"

    @property
    def inverted(self) -> bool:
        """Whether the change of bank leads through inverted flight, from and to a bank that is well away from it."""
        return self._passes(math.pi)

    @property
    def level(self) -> bool:
        """Whether it leads through level flight, from and to a bank that is well away from it."""
        return self._passes(0.0)

    def _passes(self, bank: float) -> bool:
        sign, margin = math.copysign(1.0, self.rolled), 0.5 * ROLL_ANGLE
        ahead = sign * (bank - self.begin.bank) % (2.0 * math.pi)
        return not self.vertical and margin < ahead < abs(self.rolled) - margin


def cues_of(flight: Flight) -> tuple[Cue, ...]:
    """Return the cues of all complete legs, in the order in which they begin.

    None where the flight knows neither load factor nor attitude; NaN of its histories are bridged by straight lines.
    """
    path = _SmoothPath.from_flight(flight)
    if path is None:
        return ()
    rolls, apexes = _rolls(path), _apexes(path)
    cues: list[Cue] = []
    for leg in legs_of(flight):
        if leg.is_complete:
            part = _LegPath.of(path, leg)
            for first, last in itertools.pairwise(_chain(part, rolls)):
                cues.append(_cue(flight, len(cues) + 1, leg, part, (first, last), apexes))
    return tuple(cues)


def load_profile(time: Array, duration: float, begin: float, extreme: float, end: float, mean: float) -> Array:
    """Return the load factor that words describe, g, shape (n,): to the extreme, along it, and away from it.

    Both ramps have one rate, with which the mean is right; where the mean is too far from the extreme for that, they
    meet at it.

    Args:
        time: since the cue began, s, shape (n,).
        duration: of the cue, s.
        begin, extreme, end, mean: load factors, g.
    """
    rise, fall = abs(extreme - begin), abs(extreme - end)
    if rise + fall == 0.0:
        return np.full_like(time, extreme)
    # The ramps take s per g, and leave out half of a rectangle each: (rise^2 + fall^2) / 2 per g.
    ramp = 2.0 * duration * abs(extreme - mean) / (rise * rise + fall * fall)
    ramp = min(ramp, duration / (rise + fall))
    corners = [0.0, ramp * rise, duration - ramp * fall, duration]
    return np.interp(time, corners, [begin, extreme, extreme, end])


@dataclass(frozen=True, eq=False)
class _SmoothPath:
    """A flight from its first to its last passing at evenly spaced times: smoothed histories, SI units and radians.

    Attributes:
        begin: the first time, s after the start.
        p: roll rate about the velocity; rolled: its integral; each of shape (n,).
        gamma: climb; mu: bank; chi: course over ground; the latter continuous; each of shape (n,).
        n_z: load factor; V_K; height; smooth_height; each of shape (n,).
    """

    begin: float
    p: Array
    rolled: Array
    n_z: Array
    V_K: Array
    height: Array
    smooth_height: Array
    gamma: Array
    mu: Array
    chi: Array

    @classmethod
    def from_flight(cls, flight: Flight) -> "_SmoothPath | None":
        """Return the samples of a flight; None where it does not know enough."""
        passed = [crossing.time for crossing in flight.crossings if crossing.found]
        if len(passed) < 2 or not flight.has(*QUATERNION, "V_K", "gamma", "mu", "chi"):
            return None
        begin, end = passed[0], passed[-1]
        times = begin + STEP * np.arange(max(2, math.ceil((end - begin) / STEP) + 1))

        def sample(values: Array) -> Array | None:
            rows = np.isfinite(values)
            return np.interp(times, flight.time[rows], values[rows]) if rows.sum() > 1 else None

        q = np.array([flight[name] for name in QUATERNION])
        measured = "p_Kbar" in flight and np.isfinite(flight["p_Kbar"]).all()
        p = sample(flight["p_Kbar"] if measured else roll_rate_of(flight.time, q))
        n_z, height, V_K = (sample(flight.values(name)) for name in ("n_z", "height", "V_K"))
        gamma, mu, chi = (sample(np.unwrap(flight[name])) for name in ("gamma", "mu", "chi"))
        if p is None or n_z is None or height is None or V_K is None or gamma is None:
            return None
        if mu is None or chi is None:
            return None
        rolled = STEP * (np.cumsum(p) - 0.5 * (p + p[0]))  # not smoothed: a roll may end at once, as at a passing
        p, n_z = _smooth(p, ROLL_SMOOTHING), _smooth(n_z, LOAD_SMOOTHING)
        return cls(begin, p, rolled, n_z, V_K, height, _smooth(height, HEIGHT_SMOOTHING), gamma, mu, chi)

    @property
    def time(self) -> Array:
        """The times of the samples, s after the start, shape (n,)."""
        return np.asarray(self.begin + STEP * np.arange(len(self.p)), np.float64)


@dataclass(frozen=True, eq=False)
class _LegPath:
    """One leg at evenly spaced times, its passings among them.

    Attributes:
        time: s after the start, shape (n,).
        n_z, V_K, height, gamma: g, m/s, m, rad, each of shape (n,).
        mu: bank, chi: course over ground, both continuous; rolled: the angle rolled about the velocity; rad, each of
            shape (n,).
    """

    time: Array
    n_z: Array
    V_K: Array
    height: Array
    gamma: Array
    mu: Array
    chi: Array
    rolled: Array

    @classmethod
    def of(cls, path: _SmoothPath, leg: Leg) -> "_LegPath":
        steps = max(round(leg.time / STEP), 4)
        time = np.linspace(leg.before.time, leg.after.time, steps + 1)
        histories = (path.n_z, path.V_K, path.height, path.gamma, path.mu, path.chi, path.rolled)
        return cls(time, *(np.interp(time, path.time, history) for history in histories))

    def is_vertical(self, first: int, last: int) -> bool:
        """Return whether the path is nearly vertical somewhere between two rows."""
        return bool(np.abs(self.gamma[first : last + 1]).max() > VERTICAL)

    def angle(self, first: int, last: int) -> Array:
        """Return the bank between two rows, or the angle rolled where that has no meaning, rad, shape (m,)."""
        return (self.rolled if self.is_vertical(first, last) else self.mu)[first : last + 1]

    def load(self, first: int, last: int) -> tuple[float, float, Array]:
        """Return the extreme and the mean load factor between two rows, and the profile that they describe, g.

        Of the greatest and the least load the one is the extreme whose profile is the truer.
        """
        n_z, time = self.n_z[first : last + 1], self.time[first : last + 1] - self.time[first]
        duration = float(time[-1])
        mean = float(np.sum(0.5 * (n_z[1:] + n_z[:-1]) * np.diff(time))) / duration
        profiles: list[tuple[float, float, Array]] = []
        for extreme in (float(n_z.max()), float(n_z.min())):
            profile = load_profile(time, duration, float(n_z[0]), extreme, float(n_z[-1]), mean)
            profiles.append((float(np.abs(np.cumsum(profile - n_z)).max()), extreme, profile))
        _, extreme, profile = min(profiles, key=lambda candidate: candidate[0])
        return extreme, mean, profile

    def drift(self, first: int, last: int) -> float:
        """Return what words leave out between two rows, as a share of what they may."""
        angle, n_z = self.angle(first, last), self.n_z[first : last + 1]
        bank: Array = np.linspace(float(angle[0]), float(angle[-1]), len(angle))
        _, _, load = self.load(first, last)
        step, V_K = float(self.time[1] - self.time[0]), self.V_K[first : last + 1]
        across = np.cumsum((load * np.sin(bank) - n_z * np.sin(angle)) / V_K)
        up = np.cumsum((load * np.cos(bank) - n_z * np.cos(angle)) / V_K)
        way_left = step * float(self.V_K[first:].sum())
        return g0 * step * float(np.hypot(across, up).max()) / min(DRIFT_ANGLE, DRIFT / way_left)


def _chain(leg: _LegPath, rolls: Sequence[tuple[float, float]]) -> list[int]:
    """Return the rows at which the cues of a leg meet, from its first to its last: the cheapest way along the places
    at which it may be cut, none of whose cues goes across the begin or the end of a roll.

    Args:
        leg: the leg.
        rolls: the times at which they begin and end, s after the start.
    """
    places, edges = _places(leg, rolls)
    costs: dict[int, tuple[float, int]] = {0: (0.0, 0)}
    for number, begin in enumerate(places):
        for end in places[number + 1 :]:
            drift = leg.drift(begin, end)
            shortest = end == places[number + 1]  # which stands whatever it leaves out
            cost = costs[begin][0] + 1.0 + DRIFT_COST * drift * drift
            if (shortest or drift <= 1.0) and (end not in costs or cost < costs[end][0]):
                costs[end] = cost, begin
            if end in edges:
                break
    chain = [places[-1]]
    while chain[0]:
        chain.insert(0, costs[chain[0]][1])
    return chain


def _places(leg: _LegPath, rolls: Sequence[tuple[float, float]]) -> tuple[list[int], set[int]]:
    """Return the rows at which a leg may be cut, in order, and those at which it has to be; see `_chain`.

    A stroke of the stick is cut only where its words would leave out too much.
    """
    step, last = float(leg.time[1] - leg.time[0]), len(leg.time) - 1
    margin = math.ceil(SHORTEST / step)
    places = set(range(0, last - margin, round(CUT_STEP / step)))
    edges: set[int] = set()
    for begin, end in rolls:
        first, behind = (round((time - float(leg.time[0])) / step) for time in (begin, end))
        first, behind = first if first > margin else 0, behind if behind < last - margin else last
        if behind <= 0 or first >= last:
            continue  # a roll of another leg
        if end - begin < STROKE:
            places -= set(range(first + 1, behind))
        edges |= {row for row in (first, behind) if 0 < row < last}
    places |= edges | {0, last}
    pairs = list(itertools.pairwise(sorted(places)))
    while pairs:
        first, behind = pairs.pop()
        if step * (behind - first) > SHORTEST and leg.drift(first, behind) > ROUGH:
            middle = (first + behind) // 2
            places.add(middle)
            pairs += [(first, middle), (middle, behind)]
    return sorted(places), edges


def _cue(flight: Flight, number: int, leg: Leg, path: _LegPath, rows: tuple[int, int], apexes: Sequence[Apex]) -> Cue:
    """Return the cue between two rows of a leg."""
    first, last = rows
    begin, end = (
        CueState(
            float(path.time[row]),
            math.remainder(float(path.mu[row]), 2.0 * math.pi),
            float(path.n_z[row]),
            float(path.height[row]),
            float(path.chi[row]) % (2.0 * math.pi) if abs(path.gamma[row]) < VERTICAL else math.nan,
        )
        for row in rows
    )
    angle, (extreme, mean, _) = path.angle(first, last), path.load(first, last)
    apex = next((apex for apex in apexes if begin.time <= apex.time < end.time), None)
    passing, distance = _place(flight, leg, begin.time)
    vertical, rolled = path.is_vertical(first, last), float(angle[-1] - angle[0])
    return Cue(number, leg, passing, distance, begin, end, rolled, vertical, extreme, mean, apex)


def _place(flight: Flight, leg: Leg, time: float) -> tuple[str, float]:
    """Return the nearer passing of a leg at a time along the way, and the distance behind it, m."""
    if not flight.has("x", "y", "z"):
        return leg.after.name, math.nan
    distance = way(flight, leg)
    at, length = float(np.interp(time, flight.time[leg.rows], distance)), float(distance[-1])
    return (leg.before.name, at) if at < 0.5 * length else (leg.after.name, at - length)


def roll_rate_of(time: Array, q: Array) -> Array:
    """Return the rate about the x axis of the attitude of a frame, rad/s, shape (n,), from its quaternions.

    omega_x = 2 (q0 q1' - q1 q0' - q2 q3' + q3 q2')
    """
    # The same attitude has two quaternions: a recorder may change from one to the other.
    q = q * np.cumprod(np.append(1.0, np.where(np.sum(q[:, 1:] * q[:, :-1], axis=0) < 0.0, -1.0, 1.0)))
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


def _rolls(path: _SmoothPath) -> list[tuple[float, float]]:
    """Return the times at which every roll begins and ends, s after the start, in order."""
    rolls: list[tuple[float, float]] = []
    for first, last in _stretches_of_roll(path.p):
        fastest = float(np.abs(path.p[first : last + 1]).max())
        angle = STEP * float(path.p[first : last + 1].sum())
        if fastest >= ROLL_RATE and abs(angle) >= ROLL_ANGLE:
            rolls.append((path.begin + STEP * first, path.begin + STEP * last))
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


def _apexes(path: _SmoothPath) -> list[Apex]:
    """Return all apexes in order."""
    points = turning_points(path.smooth_height, HEIGHT_CHANGE)
    inner = [row for number, (row, kind) in enumerate(points) if kind > 0 and 0 < number < len(points) - 1]
    time = path.time
    return [Apex(float(time[row]), float(path.height[row]), math.cos(path.mu[row]) < 0.0) for row in inner]
