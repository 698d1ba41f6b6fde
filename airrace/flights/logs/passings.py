"""The log placed on the course, and the passings of the course on its path.

An element that stands somewhere is passed where the path crosses the line through its centre, across one of the axes
along which it may be passed. Among all such crossings that sequence in the order of the course is a run which goes by
the elements most closely, in the shortest time, and leaves out fewest.
"""

import itertools
import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from airrace.flights.logs.clocks import cut_step, repair_jumps, spread_repeated, true_times
from airrace.flights.logs.recording import Recording, count_of, ground, refuse, repeats
from airrace.model.track.course import Passage, metres
from airrace.optimal_control.trajectory import Array
from airrace.race import Race

FAR = 10_000.0
"""The distance from all that the course names beyond which a sample has nothing to do with its race, m."""
SPEED_OF_SOUND = 340.0
"""The speed of sound, m/s: a sample that could only be reached and left faster is an outlier."""
SCATTER = 20.0
"""The distance between two samples that their noise may explain and no speed has to, m. White noise of 2 m puts two of
a million samples so far apart; what is nearer is left to the smoother, which knows the noise."""
NO_HEIGHT = 10.0
"""How far from zero the heights around a height of zero must be for it to be none, m."""
SAME_TIME = 1e-4
"""The time below which two samples are one, s."""
ASIDE = 60.0
"""The distance from the centre of an element beyond which, or beyond its reach, nothing is a passing, m."""
SILENCE = 10.0
"""The time between two samples beyond which what was passed between them is unknown, s."""
COST_DISTANCE = 10.0
"""The distance from the centre at which a passing costs 1, m."""
SLANT_COST = 20.0
"""The cost of a passing by its slant, beyond that which is as good as none: of several axes it is along the one that it
follows."""
FREE_SLANT = 0.5
"""The slant up to which a passing is as good as another, that of 60 degrees."""
SAME_PASSING, SAME_PLACE, LESS_SLANT = 0.5, 5.0, 0.05
"""The time (s) and the distance from the centre (m) within which the lines of an element of several axes are crossed in
one passing, and the slant by which it is along another of them."""
SKIPPED_COST = 40.0
"""The cost of an element that is not passed at all."""
UNREACHED_COST = 39.5
"""The cost of one that comes before the first passing or behind the last one: a log that begins late or ends early has
a part of a run, and no passing in its middle is the start or the finish."""
COST_MAX = 36.0
"""The cost of the worst passing."""
SECOND_COST = 0.05
"""The cost of a second, so that a run is not mixed with another one."""
PLACES = ("latitude", "longitude", "x", "y")
HEIGHTS = ("height", "altitude")
MEASURED = ("V_G", "V_A", "V_I", "n_z", "phi", "theta", "psi")
"""The histories that stay as they were recorded, where they were."""


def in_order(recording: Recording) -> Recording:
    """Return the recording with times that run forwards, and without what is no measurement.

    Left out are times that cannot be true, empty samples, positions that repeat a time, and numbers that
    only repeat an earlier measurement; these are NaN then.

    Raises:
        InputError: too little is left.
    """
    forwards, remarks = true_times(recording.path, recording.time, recording.lines)
    recording = recording.select(forwards, *remarks)
    time, remarks = repair_jumps(recording.time, ground(recording.columns), recording.lines)
    recording = replace(recording, time=time).select(np.ones(len(time), bool), *remarks)
    cut = cut_step(recording.time, _space(recording))
    time, remarks = spread_repeated(recording.time, cut)
    recording = replace(recording, time=time, cut=cut).select(np.ones(len(time), bool), *remarks)
    columns = recording.columns
    placed = _place(recording)
    recorded = [np.isfinite(columns[name]) for name in MEASURED if name in columns]
    informative: NDArray[np.bool_] = np.logical_or.reduce([placed, *recorded])
    remarks = ()
    if silent := int((~informative).sum()):
        remarks += (f"{count_of(silent, 'sample')} without a position and left out",)
    time, apart, last = recording.time[placed], np.ones(int(placed.sum()), bool), 0.0
    for row in (np.flatnonzero(np.diff(time) < SAME_TIME) + 1).tolist():
        if apart[row - 1]:
            last = float(time[row - 1])
        apart[row] = time[row] - last >= SAME_TIME
    if repeated := int((~apart).sum()):
        nearest = f"{1e3 * SAME_TIME:g} ms"
        remarks += (f"{count_of(repeated, 'sample')} left out for coming less than {nearest} behind another",)
    informative[np.flatnonzero(placed)] = apart
    fresh = _with_fresh_columns(recording.select(informative, *remarks))
    heights = [np.isfinite(fresh.columns[name][_place(fresh)]) for name in HEIGHTS if name in columns]
    if _place(fresh).sum() < 2:
        refuse(recording.path, 0, "has no two samples with a time and a position")
    if np.logical_or.reduce(heights).sum() < 2:
        refuse(recording.path, 0, "has no heights; a flight over a course needs them")
    return fresh


def _place(recording: Recording) -> NDArray[np.bool_]:
    """Return which samples have a position over ground."""
    columns = recording.columns
    return np.asarray(
        np.logical_and.reduce([np.isfinite(columns[place]) for place in PLACES if place in columns]), np.bool_
    )


def _with_fresh_columns(recording: Recording) -> Recording:
    """Return the recording with NaN in the place of what is repeated, and of heights that are none."""
    columns, remarks = dict(recording.columns), list[str]()
    places = [name for name in PLACES if name in columns]
    finite = np.flatnonzero(_place(recording))
    stale = np.zeros(len(recording.time), bool)
    stale[finite] = repeats(np.stack([columns[name][finite] for name in places]), recording.time[finite])
    if stale.any():
        rows = len(finite) / max(len(finite) - int(stale.sum()), 1)
        remarks.append(f"positions are held over {rows:.3g} rows in the mean: only fresh ones count")
        for name in places:
            columns[name] = np.where(stale, np.nan, columns[name])
    for name in (*HEIGHTS, *MEASURED):
        if name not in columns:
            continue
        values = columns[name]
        finite = np.flatnonzero(np.isfinite(values))
        repeated = np.zeros(len(values), bool)
        repeated[finite] = repeats(values[None, finite], recording.time[finite])
        if name in HEIGHTS:
            repeated |= stale & (np.diff(values, prepend=np.nan) == 0.0)
            missing = _missing_heights(values)
            if missing.any():
                first = int(recording.lines[missing][0])
                remarks.append(
                    f"{count_of(int(missing.sum()), 'height')} missing (zero), the first one in line {first}"
                )
            repeated |= missing
        columns[name] = np.where(repeated, np.nan, values)
    return replace(recording, columns=columns).select(np.ones(len(stale), bool), *remarks)


def _missing_heights(values: Array) -> NDArray[np.bool_]:
    """Return which heights are zero although those around them are far from it."""
    zero, place = values == 0.0, np.arange(len(values))
    recorded = np.isfinite(values) & ~zero
    if not zero.any() or recorded.sum() < 2:
        return np.zeros(len(values), bool)
    return zero & (np.abs(np.interp(place, place[recorded], values[recorded])) > NO_HEIGHT)


def _space(recording: Recording) -> Array:
    """Return north, east and up, m, near enough for a speed, shape (3, n); heights are NaN where they are not known."""
    columns = recording.columns
    heights = [columns[name] for name in HEIGHTS if name in columns]
    unknown = np.full(len(recording.time), np.nan)
    return np.stack([*ground(columns), heights[0] if heights else unknown])


def in_frame(recording: Recording, race: Race) -> Recording:
    """Return the recording with `x`, `y` and `height` in the track's frame, near the course and without outliers.

    Samples without a position stay.

    Raises:
        InputError: it has latitude and longitude and the course has no origin, or it is nowhere near the course.
    """
    course, columns = race.course, dict(recording.columns)
    if "x" not in columns:
        if not course.origin.has_coordinates:
            refuse(
                recording.path,
                0,
                f"has latitude and longitude, but the course {course.name} has no origin; give it one with "
                "--set origin.latitude_deg=... and --set origin.longitude_deg=...",
            )
        latitude, longitude = columns["latitude"], columns["longitude"]
        on_globe = (np.abs(latitude) <= 0.5 * np.pi) & (np.abs(longitude) <= 2.0 * np.pi)
        columns["x"], columns["y"], _ = metres(
            np.where(on_globe, latitude, np.nan), np.where(on_globe, longitude, np.nan), course.origin
        )
    height = columns.get("height", np.full_like(recording.time, np.nan))
    if "altitude" in columns:
        height = np.where(np.isfinite(height), height, columns["altitude"] - course.origin.elevation)
    columns["height"] = height
    placed = np.isfinite(columns["x"]) & np.isfinite(columns["y"])
    places = [passage.element.place for passage in course.passages if passage.element.place is not None]
    near = placed & ~(np.abs(height) > FAR)
    for name, values in zip(("x", "y"), np.array(places or [(0.0, 0.0)]).T, strict=True):
        near &= (columns[name] > values.min() - FAR) & (columns[name] < values.max() + FAR)
    if near.sum() < 2:
        refuse(
            recording.path,
            0,
            f"is nowhere within {FAR / 1000.0:g} km of the course {course.name}; is it another course, or are "
            "latitude and longitude mixed up?",
        )
    leaps = np.zeros(len(placed), bool)
    leaps[placed] = _leaps(recording.time[placed], np.stack([columns[name][placed] for name in ("x", "y", "height")]))
    outliers = leaps & near
    remarks: list[str] = []
    if outliers.any():
        where = f"the first one in line {int(recording.lines[outliers][0])}"
        remarks.append(f"{count_of(int(outliers.sum()), 'outlier')} left out: leaps faster than sound, {where}")
    return replace(recording, columns=columns).select((near & ~outliers) | ~placed, *remarks)


def _leaps(time: Array, places: Array) -> NDArray[np.bool_]:
    """Return the samples that are reached and left too fast, while their neighbours agree with one another."""
    leap = np.zeros(len(time), bool)
    if len(time) > 2:
        fast, around = (
            np.linalg.norm(np.nan_to_num(places[:, k:] - places[:, :-k]), axis=0)
            > SPEED_OF_SOUND * (time[k:] - time[:-k]) + SCATTER
            for k in (1, 2)
        )
        leap[1:-1] = fast[1:] & fast[:-1] & ~around
    return leap


@dataclass(frozen=True)
class LineCrossing:
    """A crossing of the line across an element: when (s), along which of its axes (rad), how far to the right (m).

    `slant` is one minus the cosine of the angle between path and axis.
    """

    time: float
    axis: float
    aside: float
    slant: float = 0.0


@dataclass(frozen=True)
class CourseRun:
    """A run through the course: one entry per passage, None where it was not passed or stands nowhere."""

    passings: tuple[LineCrossing | None, ...]

    @property
    def made(self) -> list[LineCrossing]:
        """The passings that were made."""
        return [passing for passing in self.passings if passing is not None]

    def axes(self, passages: Sequence[Passage]) -> dict[str, float]:
        """Return along which axis each element was passed, rad, by the names of the passages."""
        passings = zip(passages, self.passings, strict=True)
        return {passage.name: passing.axis for passage, passing in passings if passing is not None}

    @property
    def begin(self) -> float:
        """The time of its first passing, s."""
        return min(passing.time for passing in self.made)

    @property
    def end(self) -> float:
        """The time of its last passing, s."""
        return max(passing.time for passing in self.made)


def stands(passage: Passage) -> bool:
    """Return whether a passage stands at a place, so that its passing can be seen from above."""
    return passage.element.stands and passage.element.place is not None


def line_crossings(passage: Passage, time: Array, x: Array, y: Array) -> list[LineCrossing]:
    """Return all crossings of the line across an element, in the order of time.

    Args:
        passage: of an element; one that stands nowhere is never crossed.
        time, x, y: the path, s and m, shape (n,).
    """
    place = passage.element.place
    if place is None or not passage.element.stands:
        return []
    axes = {
        round(crossing.axis, 9): crossing.axis
        for crossing in passage.element.crossings(passage.direction, 0.0, rolling=False)
    }
    reach = float(getattr(passage.element, "reach", 0.0))
    crossings: list[LineCrossing] = []
    for axis in axes.values():
        along = math.cos(axis) * (x - place[0]) + math.sin(axis) * (y - place[1])
        right = -math.sin(axis) * (x - place[0]) + math.cos(axis) * (y - place[1])
        rows = np.flatnonzero((along[:-1] < 0.0) & (along[1:] >= 0.0))
        share = along[rows] / (along[rows] - along[rows + 1])
        aside = right[rows] + share * (right[rows + 1] - right[rows])
        when = time[rows] + share * (time[rows + 1] - time[rows])
        near = (np.abs(aside) <= ASIDE + reach) & (time[rows + 1] - time[rows] <= SILENCE)
        forwards, sideways = along[rows + 1] - along[rows], right[rows + 1] - right[rows]
        slant = 1.0 - forwards / np.hypot(forwards, sideways)
        columns = (values[near].tolist() for values in (when, aside, slant))
        crossings += [LineCrossing(t, axis, a, s) for t, a, s in zip(*columns, strict=True)]
    crossings.sort(key=lambda crossing: crossing.time)
    return [crossing for crossing in crossings if not _is_along_another(crossing, crossings)]


def _is_along_another(crossing: LineCrossing, crossings: Sequence[LineCrossing]) -> bool:
    """Return whether an element of several axes is passed there along another axis, which the path follows better.

    Args:
        crossing: of its line across one axis.
        crossings: of all its lines, in the order of time.
    """
    row = bisect_left(crossings, crossing.time - SAME_PASSING, key=lambda other: other.time)
    for other in itertools.takewhile(lambda other: other.time <= crossing.time + SAME_PASSING, crossings[row:]):
        near = abs(other.aside) <= abs(crossing.aside) + SAME_PLACE
        if other.axis != crossing.axis and near and other.slant < crossing.slant - LESS_SLANT:
            return True
    return False


def find_runs(race: Race, time: Array, x: Array, y: Array) -> list[CourseRun]:
    """Return the runs on a path that share no time, in their order; each makes half of the passings at least.

    Args:
        race: whose course it is.
        time, x, y: the path, s and m, shape (n,).
    """
    passages = race.course.passages
    crossings = [line_crossings(passage, time, x, y) for passage in passages]
    needed = sum(stands(passage) for passage in passages)
    runs: list[CourseRun] = []
    while True:
        best = _best_run(passages, crossings)
        if len(best.made) < max(0.5 * needed, 1):
            return sorted(runs, key=lambda run: run.begin)
        runs.append(best)
        for place, row in enumerate(crossings):
            crossings[place] = [crossing for crossing in row if not best.begin <= crossing.time <= best.end]


def _best_run(passages: Sequence[Passage], crossings: Sequence[Sequence[LineCrossing]]) -> CourseRun:
    """Return the run of the least cost, by dynamic programming from the last passage back to the first.

    At all times at which anything is passed it is known what the rest of the course costs from there; `later` is that
    cost behind each of the times, for the passages that are still to come.
    """
    times = np.unique([crossing.time for row in crossings for crossing in row])
    if not len(times):
        return CourseRun(())
    later = np.zeros(len(times) + 1)  # at the end of the path, too
    choices: list[Array] = []
    remaining, starts = 0, list[tuple[float, int]]()  # the cost of what comes behind a passage, and where it begins
    for passage, row in zip(reversed(passages), reversed(crossings), strict=True):
        choice = np.full(len(times) + 1, -1)
        if stands(passage):
            later, choice = _with_passage(times, later, row)
            remaining += 1
            ended = later >= UNREACHED_COST * remaining  # nothing more is passed
            later[ended], choice[ended] = UNREACHED_COST * remaining, -2
        choices.append(choice)
        place = int(np.argmin(later[:-1]))  # a run begins at any time, and waiting for it costs nothing
        starts.append((float(later[place]), place))
    standing = np.cumsum([stands(passage) for passage in passages]) - [stands(passage) for passage in passages]
    costs = [cost + UNREACHED_COST * int(n) for (cost, _), n in zip(reversed(starts), standing, strict=True)]
    begin = int(np.argmin(costs))
    place = starts[::-1][begin][1]
    passings: list[LineCrossing | None] = [None] * begin
    for choice, row in list(zip(reversed(choices), crossings, strict=True))[begin:]:
        number = int(choice[place])
        if number == -2:
            break
        passings.append(row[number] if number >= 0 else None)
        if number >= 0:
            place = int(np.searchsorted(times, row[number].time)) + 1
    return CourseRun((*passings, *[None] * (len(passages) - len(passings))))


def _with_passage(times: Array, later: Array, row: Sequence[LineCrossing]) -> tuple[Array, Array]:
    """Return the cost of the rest from every time on with one more passage, and which of its crossings comes next."""
    when = np.array([crossing.time for crossing in row], np.float64)
    off = np.array([crossing.aside for crossing in row], np.float64) / COST_DISTANCE
    at = np.searchsorted(times, when)
    slant = SLANT_COST * np.maximum(np.array([crossing.slant for crossing in row], np.float64) - FREE_SLANT, 0.0)
    costs = np.minimum(off * off + slant, COST_MAX) + later[at + 1] + SECOND_COST * when
    cost, index = np.full(len(times), np.inf), np.full(len(times), -1)
    worst_first = np.argsort(costs, kind="stable")[::-1]  # of several at one time the last that is written stays
    cost[at[worst_first]], index[at[worst_first]] = costs[worst_first], worst_first
    least = np.append(np.minimum.accumulate(cost[::-1])[::-1], np.inf)  # from every time on
    places = np.where(cost < least[1:], np.arange(len(times)), len(times))
    chosen = np.append(index, -1)[np.minimum.accumulate(places[::-1])[::-1]]
    best, choice = later + SKIPPED_COST, np.full(len(times) + 1, -1)
    passed = least[:-1] - SECOND_COST * times
    taken = passed < best[:-1]
    best[:-1][taken], choice[:-1][taken] = passed[taken], chosen[taken]
    return best, choice
