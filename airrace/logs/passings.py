"""The log placed on the course, and the passings of the course on its path.

An element that stands somewhere is passed where the path crosses the line through its centre, across one of the axes
along which it may be flown. Among all such crossings that sequence in the order of the course is a run which goes by
the elements most closely, in the shortest time, and leaves out fewest. What stands nowhere (a height, an attitude) is
passed between its neighbours, where the path comes nearest to what is asked.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from airrace.logs.recording import Recording, counted, refuse
from airrace.planning.race import Race
from airrace.records import record
from airrace.track.course import Passage
from airrace.track.geodetic import metres, placed
from airrace.trajectory import Array

FAR = 10_000.0
"""The distance from all that the course names beyond which a sample has nothing to do with its race, m."""
FASTEST = 340.0
"""The speed, m/s, that of sound: a sample that could only be reached and left faster is an outlier."""
SCATTER = 20.0
"""The distance between two samples, m, that their noise may explain and that no speed has to.

White noise of 2 m puts two of a million samples so far apart; what is nearer is left to the smoother, which knows the
noise."""
NEAREST_IN_TIME = 1e-4
"""The time below which two samples are one, s."""


def in_order(recording: Recording) -> Recording:
    """Return the recording without samples that lack a position, and without those that repeat a time."""
    columns = recording.columns
    heights = [columns[name] for name in ("height", "altitude") if name in columns]
    known: NDArray[np.bool_] = np.logical_or.reduce(np.isfinite(heights), axis=0)
    for name in ("latitude", "longitude", "x", "y"):
        if name in columns:
            known &= np.isfinite(columns[name])
    remarks: list[str] = []
    if not known.all():
        remarks.append(f"{counted(int((~known).sum()), 'sample')} without a position and left out")
    rows = np.flatnonzero(known)
    fresh = known.copy()
    fresh[rows] = _apart(recording.time[rows])
    if repeated := int(known.sum() - fresh.sum()):
        nearest = f"{1e3 * NEAREST_IN_TIME:g} ms"
        remarks.append(f"{counted(repeated, 'sample')} left out for coming less than {nearest} behind another")
    if fresh.sum() < 2:
        refuse(recording.path, 0, "has no two samples with a time and a position")
    return recording.select(fresh, *remarks)


def _apart(time: Array) -> NDArray[np.bool_]:
    """Return the samples that come late enough behind the last one of them; times rise or repeat."""
    apart = np.ones(len(time), bool)
    last = 0.0
    for row in (np.flatnonzero(np.diff(time) < NEAREST_IN_TIME) + 1).tolist():
        if apart[row - 1]:
            last = float(time[row - 1])
        apart[row] = time[row] - last >= NEAREST_IN_TIME
    return apart


def in_frame(recording: Recording, race: Race) -> Recording:
    """Return the recording with `x`, `y` and `height` in the track's frame, near the course and without outliers.

    Raises:
        InputError: it tells latitude and longitude and the course has no origin, or it is nowhere near the course.
    """
    columns = dict(recording.columns)
    if "x" not in columns:
        if not placed(race.course.origin):
            refuse(
                recording.path,
                0,
                f"tells latitude and longitude, but the course {race.course.name} has no origin; give it one with "
                "--set origin.latitude_deg=... and --set origin.longitude_deg=...",
            )
        columns["x"], columns["y"], _ = metres(columns["latitude"], columns["longitude"], race.course.origin)
    height = columns.get("height", np.full_like(recording.time, np.nan))
    if "altitude" in columns:
        height = np.where(np.isfinite(height), height, columns["altitude"] - race.course.origin.elevation)
    columns["height"] = height
    framed = replace(recording, columns=columns)
    near = _near(framed, race)
    if near.sum() < 2:
        refuse(
            recording.path,
            0,
            f"is nowhere within {FAR / 1000.0:g} km of the course {race.course.name}; is it another course, or are "
            "latitude and longitude mixed up?",
        )
    outliers = _leaps(framed) & near
    if not outliers.any():
        return framed.select(near)
    where = f"the first one in line {int(framed.lines[outliers][0])}"
    remark = f"{counted(int(outliers.sum()), 'outlier')} left out: leaps faster than sound, {where}"
    return framed.select(near & ~outliers, remark)


def _near(recording: Recording, race: Race) -> NDArray[np.bool_]:
    places = [one.element.place for one in race.course.passages if one.element.place is not None]
    north, east = np.array(places or [(0.0, 0.0)]).T
    x, y = recording.columns["x"], recording.columns["y"]
    inside = (x > north.min() - FAR) & (x < north.max() + FAR)
    return inside & (y > east.min() - FAR) & (y < east.max() + FAR) & (np.abs(recording.columns["height"]) < FAR)


def _leaps(recording: Recording) -> NDArray[np.bool_]:
    """Return the samples that are reached and left too fast, while their neighbours agree with one another."""
    places, time = np.stack([recording.columns[name] for name in ("x", "y", "height")]), recording.time
    leap = np.zeros(len(time), bool)
    if len(time) > 2:
        fast, around = (
            np.linalg.norm(places[:, k:] - places[:, :-k], axis=0) > FASTEST * (time[k:] - time[:-k]) + SCATTER
            for k in (1, 2)
        )
        leap[1:-1] = fast[1:] & fast[:-1] & ~around
    return leap


ASIDE = 60.0
"""The distance from the centre of an element beyond which, or beyond its reach, nothing is a passing, m."""
SCALE = 10.0
"""The distance from the centre at which a passing costs 1, m."""
SKIPPED = 40.0
"""The cost of an element that is not passed at all: more than that of the worst passing, 36."""
PACE = 0.05
"""The cost of a second, so that a run is not mixed with another one."""


@record
class LineCrossing:
    """A crossing of the line across an element.

    Attributes:
        time: when, s.
        axis: along which of its axes, rad.
        aside: how far to the right of its centre, m.
    """

    time: float
    axis: float
    aside: float


@record
class CourseRun:
    """A run through the course: one entry per passage, None where it was not passed or stands nowhere."""

    passings: tuple[LineCrossing | None, ...]

    @property
    def begin(self) -> float:
        """The time of its first passing, s."""
        return min(one.time for one in self.passings if one is not None)

    @property
    def end(self) -> float:
        """The time of its last passing, s."""
        return max(one.time for one in self.passings if one is not None)

    @property
    def count(self) -> int:
        """The number of passings that were made."""
        return sum(one is not None for one in self.passings)


def standing(passage: Passage) -> bool:
    """Return whether a passage stands at a place, so that its passing can be seen from above."""
    return passage.element.stands and passage.element.place is not None


def candidates(passage: Passage, time: Array, x: Array, y: Array) -> list[LineCrossing]:
    """Return all crossings of the line across an element, in the order of time.

    Args:
        passage: of an element that stands somewhere.
        time, x, y: the path, s and m, shape (n,).
    """
    place = passage.element.place
    assert place is not None
    axes = {round(one.axis, 9): one.axis for one in passage.element.crossings(passage.direction, 0.0, rolling=False)}
    reach = float(getattr(passage.element, "reach", 0.0))
    found: list[LineCrossing] = []
    for axis in axes.values():
        along = math.cos(axis) * (x - place[0]) + math.sin(axis) * (y - place[1])
        right = -math.sin(axis) * (x - place[0]) + math.cos(axis) * (y - place[1])
        rows = np.flatnonzero((along[:-1] < 0.0) & (along[1:] >= 0.0))
        share = along[rows] / (along[rows] - along[rows + 1])
        aside = right[rows] + share * (right[rows + 1] - right[rows])
        when = time[rows] + share * (time[rows + 1] - time[rows])
        near = np.abs(aside) <= ASIDE + reach
        found += [LineCrossing(float(t), axis, float(a)) for t, a in zip(when[near], aside[near], strict=True)]
    return sorted(found, key=lambda one: one.time)


def runs(race: Race, time: Array, x: Array, y: Array) -> list[CourseRun]:
    """Return the runs on a path that share no time, in their order; each makes half of the passings at least.

    Args:
        race: whose course it is.
        time, x, y: the path, s and m, shape (n,).
    """
    passages = race.course.passages
    known = [candidates(one, time, x, y) if standing(one) else [] for one in passages]
    needed = sum(standing(one) for one in passages)
    found: list[CourseRun] = []
    while True:
        best = _best(passages, known)
        if best is None or best.count < max(0.5 * needed, 1):
            return sorted(found, key=lambda one: one.begin)
        found.append(best)
        known = [[one for one in row if not best.begin <= one.time <= best.end] for row in known]


def _best(passages: Sequence[Passage], known: Sequence[Sequence[LineCrossing]]) -> CourseRun | None:
    """Return the run of the least cost, by dynamic programming from the last passage back to the first.

    At all times at which anything is passed it is known what the rest of the course costs from there; `later` is that
    cost behind each of the times, for the passages that are still to come.
    """
    times = np.unique([one.time for row in known for one in row])
    if not len(times):
        return None
    later = np.zeros(len(times) + 1)  # at the end of the path, too
    choices: list[Array] = []
    for passage, row in zip(reversed(passages), reversed(known), strict=True):
        choice = np.full(len(times) + 1, -1)
        if standing(passage):
            later, choice = _with_passage(times, later, row)
        choices.append(choice)
    place = int(np.argmin(later[:-1]))  # a run begins at any time, and waiting for it costs nothing
    passings: list[LineCrossing | None] = []
    for choice, row in zip(reversed(choices), known, strict=True):
        number = int(choice[place])
        passings.append(row[number] if number >= 0 else None)
        if number >= 0:
            place = int(np.searchsorted(times, row[number].time)) + 1
    return CourseRun(tuple(passings)) if any(one is not None for one in passings) else None


def _with_passage(times: Array, later: Array, row: Sequence[LineCrossing]) -> tuple[Array, Array]:
    """Return the cost of the rest from every time on with one more passage, and which of its crossings comes next."""
    when = np.array([one.time for one in row], np.float64)
    off = np.array([one.aside for one in row], np.float64) / SCALE
    at = np.searchsorted(times, when)
    mine = np.minimum(off * off, SKIPPED - 4.0) + later[at + 1] + PACE * when
    cost, index = np.full(len(times), np.inf), np.full(len(times), -1)
    worst_first = np.argsort(mine, kind="stable")[::-1]  # of several at one time the last that is written stays
    cost[at[worst_first]], index[at[worst_first]] = mine[worst_first], worst_first
    least = np.append(np.minimum.accumulate(cost[::-1])[::-1], np.inf)  # from every time on
    places = np.where(cost < least[1:], np.arange(len(times)), len(times))
    chosen = np.append(index, -1)[np.minimum.accumulate(places[::-1])[::-1]]
    best, choice = later + SKIPPED, np.full(len(times) + 1, -1)
    passed = least[:-1] - PACE * times
    taken = passed < best[:-1]
    best[:-1][taken], choice[:-1][taken] = passed[taken], chosen[taken]
    return best, choice
