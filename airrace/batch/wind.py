"""The results of a sweep over the wind: its best and its worst, what a knot costs, and from which direction.

Per course, aircraft and values of all other sweeps; only certified flights count. The sensitivity is the slope of the
straight line that fits race time against wind speed best.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from airrace.batch.ranking import Row
from airrace.inputs.units import KNOT
from airrace.records import record
from airrace.runs.exit_codes import ExitCode

DIRECTION = "environment.wind.from_deg"
SPEEDS: Mapping[str, float] = {"environment.wind.speed_kt": 1.0, "environment.wind.speed_m_s": 1.0 / KNOT}
"""The keys of the wind's speed, and the knots in one of their units."""


@record
class Bearing:
    """The race times in one direction of the wind.

    Attributes:
        from_deg: where it blows from, as swept.
        mean: the mean of the race times, s.
        per_knot: race time for a knot of wind, s/kt; None with one speed only.
    """

    from_deg: str
    mean: float
    per_knot: float | None


@record
class WindSummary:
    """The race times of one course in several winds.

    Attributes:
        title: what was flown, in words.
        flights: the number of certified flights.
        best, worst: the fastest and the slowest of them.
        per_knot: race time for a knot of wind over all directions, s/kt; None with one speed only.
        bearings: the results by direction, in the order of the sweep; empty if the direction was not swept.
    """

    title: str
    flights: int
    best: Row
    worst: Row
    per_knot: float | None
    bearings: tuple[Bearing, ...]

    def as_object(self) -> dict[str, object]:
        """Return the summary as plain values, for JSON."""
        return {
            "of": self.title,
            "flights": self.flights,
            "best": _flight(self.best),
            "worst": _flight(self.worst),
            "s_per_kt": self.per_knot,
            "directions": [
                {"from_deg": one.from_deg, "mean_s": one.mean, "s_per_kt": one.per_knot} for one in self.bearings
            ],
        }


def wind_summaries(rows: Sequence[Row]) -> list[WindSummary]:
    """Return a summary of every course that was flown in several winds; none if the wind was not swept."""
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        if row.result.code == ExitCode.DONE and row.result.race_time is not None and _is_wind_swept(row):
            others = [f"{key}={value}" for key, value in row.step.swept if key != DIRECTION and key not in SPEEDS]
            key = (row.step.track, row.step.aircraft or "", row.step.course, *others)
            groups.setdefault(key, []).append(row)
    return [_summary(key, group) for key, group in groups.items() if len(group) > 1]


def wind_words(row: Row) -> str:
    """Return the swept part of a job's wind in words, e.g. `10 kt from 45`."""
    swept = dict(row.step.swept)
    speeds = [f"{swept[key]} {'kt' if key.endswith('kt') else 'm/s'}" for key in SPEEDS if key in swept]
    return " ".join([*speeds, *([f"from {swept[DIRECTION]}"] if DIRECTION in swept else [])])


def _is_wind_swept(row: Row) -> bool:
    return any(key == DIRECTION or key in SPEEDS for key, _ in row.step.swept)


def _summary(key: tuple[str, ...], group: Sequence[Row]) -> WindSummary:
    _, aircraft, course, *others = key
    inorder = sorted(group, key=_time)
    directions = sorted({dict(row.step.swept).get(DIRECTION, "") for row in group} - {""}, key=_number)
    bearings = [
        _bearing(one, [row for row in group if dict(row.step.swept).get(DIRECTION) == one]) for one in directions
    ]
    title = ", ".join([course, *([Path(aircraft).stem] if aircraft else []), *others])
    return WindSummary(title, len(group), inorder[0], inorder[-1], _slope(group), tuple(bearings))


def _bearing(direction: str, rows: Sequence[Row]) -> Bearing:
    return Bearing(direction, sum(map(_time, rows)) / len(rows), _slope(rows))


def _slope(rows: Sequence[Row]) -> float | None:
    """Return the slope of race time over wind speed, s/kt, by least squares; None where the speed does not vary."""
    points = [(speed, _time(row)) for row in rows if (speed := _knots(row)) is not None]
    if len({speed for speed, _ in points}) < 2:
        return None
    middle = sum(speed for speed, _ in points) / len(points)
    spread = sum((speed - middle) ** 2 for speed, _ in points)
    return sum((speed - middle) * time for speed, time in points) / spread


def _knots(row: Row) -> float | None:
    for key, value in row.step.swept:
        if key in SPEEDS and math.isfinite(number := _number(value)):
            return number * SPEEDS[key]
    return None


def _time(row: Row) -> float:
    assert row.result.race_time is not None  # only flights are summarised
    return row.result.race_time


def _number(text: str) -> float:
    """Return the number that a text stands for; infinity if it is none, such as the `null` that takes a key out."""
    try:
        return float(text)
    except ValueError:
        return math.inf


def _flight(row: Row) -> dict[str, object]:
    return {"name": row.step.name, "wind": wind_words(row), "race_time_s": row.result.race_time}
