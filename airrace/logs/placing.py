"""A recording put in order and placed in the track's frame: what cannot be true is left out, and told."""

import numpy as np
from numpy.typing import NDArray

from airrace.logs.recording import Recording, counted, refuse
from airrace.planning.race import Race
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
    places = [name for name in ("latitude", "longitude", "x", "y", "altitude", "height") if name in recording.columns]
    heights = [recording.columns[name] for name in ("height", "altitude") if name in recording.columns]
    known: NDArray[np.bool_] = np.logical_or.reduce(np.isfinite(heights), axis=0)
    for name in places:
        if name not in ("altitude", "height"):
            known &= np.isfinite(recording.columns[name])
    told: list[str] = []
    if not known.all():
        told.append(f"{counted(int((~known).sum()), 'sample')} without a position and left out")
    fresh = known.copy()
    rows = np.flatnonzero(known)
    fresh[rows] = _apart(recording.time[rows])
    if repeated := int(known.sum() - fresh.sum()):
        nearest = f"{1e3 * NEAREST_IN_TIME:g} ms"
        told.append(f"{counted(repeated, 'sample')} left out for coming less than {nearest} behind another")
    if fresh.sum() < 2:
        refuse(recording.path, 0, "has no two samples with a time and a position")
    return recording.kept(fresh, *told)


def _apart(time: Array) -> NDArray[np.bool_]:
    """Return the samples that come late enough behind the last one that is kept; times rise or repeat."""
    kept = np.ones(len(time), bool)
    last = 0.0
    for row in (np.flatnonzero(np.diff(time) < NEAREST_IN_TIME) + 1).tolist():
        if kept[row - 1]:
            last = float(time[row - 1])
        kept[row] = time[row] - last >= NEAREST_IN_TIME
    return kept


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
    told = Recording(
        recording.path, recording.format, recording.time, columns, recording.lines, recording.begins, recording.remarks
    )
    near = _near(told, race)
    if near.sum() < 2:
        refuse(
            recording.path,
            0,
            f"is nowhere within {FAR / 1000.0:g} km of the course {race.course.name}; is it another course, or are "
            "latitude and longitude mixed up?",
        )
    outliers = _leaps(told) & near
    if count := int(outliers.sum()):
        line = int(told.lines[np.flatnonzero(outliers)[0]])
        where = f"the first one in line {line}"
        return told.kept(near & ~outliers, f"{counted(count, 'outlier')} left out: leaps faster than sound, {where}")
    return told.kept(near)


def _near(recording: Recording, race: Race) -> NDArray[np.bool_]:
    places = [one.element.place for one in race.course.passages if one.element.place is not None]
    north, east = np.array(places or [(0.0, 0.0)]).T
    x, y = recording.columns["x"], recording.columns["y"]
    inside = (x > north.min() - FAR) & (x < north.max() + FAR)
    return inside & (y > east.min() - FAR) & (y < east.max() + FAR) & (np.abs(recording.columns["height"]) < FAR)


def _leaps(recording: Recording) -> NDArray[np.bool_]:
    """Return the samples that are reached and left too fast, while their neighbours agree with one another."""
    places = np.stack([recording.columns[name] for name in ("x", "y", "height")])
    time = recording.time
    leap = np.zeros(len(time), bool)
    if len(time) < 3:
        return leap
    fast = _too_far(places[:, 1:] - places[:, :-1], np.diff(time))
    around = np.logical_not(_too_far(places[:, 2:] - places[:, :-2], time[2:] - time[:-2]))
    leap[1:-1] = fast[1:] & fast[:-1] & around
    return leap


def _too_far(way: Array, seconds: Array) -> NDArray[np.bool_]:
    return np.asarray(np.linalg.norm(way, axis=0) > FASTEST * seconds + SCATTER, bool)
