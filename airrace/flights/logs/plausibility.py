"""Recorded columns compared with the path: units that are not stated, and values that cannot be true."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from airrace.flights.logs.csv_log import FIELDS
from airrace.flights.logs.histories import HOLE, STEEP, path_histories, samples_of
from airrace.flights.logs.passings import HEIGHTS, CourseRun
from airrace.flights.logs.recording import Recording
from airrace.flights.logs.smoothing import Path
from airrace.flights.logs.violations import beyond, height_window
from airrace.flights.results import attitude
from airrace.model.frames import QUATERNION
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.trajectory import Array
from airrace.race import Race

ROWS_MAX = 4000
"""The number of rows that are looked at, at most."""
SPEED_MIN = 20.0
"""The speed below which nothing is compared, m/s."""
SPEED_SHARE = 0.35
"""The share of the speed by which a recorded one may differ, for wind and thin air."""
TURNING_LOAD = 2.5
"""The load factor from which on bank and load factor of the path are certain enough, 1."""
STILL_LOAD_DIFFERENCE = 3.0
"""The largest difference of load factors of one that stands still: noise makes the path's wrong by a g or two."""
LOAD_DIFFERENCE_LEFT = 0.5
"""The share of the difference of load factors that is left, at most, where they are recorded otherwise."""
LOAD_DIFFERENCE = 1.5
"""The largest difference of load factors, 1."""
BANK_DIFFERENCE = math.radians(45.0)
"""That of banks, rad."""
ROLL_SCATTER = math.radians(5.0)
"""The scatter of a roll that moves at all, rad."""
BANKED_SINE = 0.35
"""The sine of the bank from which on its side is certain."""
CLIMB_DIFFERENCE = math.radians(30.0)
"""The largest difference of climb angles, rad."""
COURSE_DIFFERENCE = math.radians(60.0)
"""That of courses, rad."""
FULL_TURN = 6.4
"""The angle in rad that no angle in degrees stays below in a race."""
TOO_HIGH = 5.0
"""The height by which passings are too high for heights to be taken as feet, m."""
FEET_LEFT = 0.25
"""The share of the excess height that is left in feet, at most."""
FEET_SCATTER = 1.5
"""The scatter of the heights at passings, in terms of the widest window, below which they are no feet."""
WINDOWS_MIN = 3
"""The number of passings with a window of heights that are needed for feet to be found out."""
LAG_MAX = 0.5
"""The time by which the roll may be late, s."""
LAG_STEP = 0.02
"""The steps in which that is looked for, s."""
LAG_EVIDENCE = 0.02
"""The share by which roll and path differ more at lags that are not as likely as the best: with a metre of noise they
differ by 1 % more at no lag, and by 5 % where the roll is late by 0.1 s."""
REPORTED = (0.05, 3.0)
"""The lag, s, and the offset of the roll, deg, from which on they are reported."""
_SPEEDS = FIELDS["true_airspeed"].units
_FOOT = FIELDS["altitude"].units["ft"]
_ANGLES = ("phi", "theta", "psi")


def in_feet_if_so(framed: Recording, race: Race, run: CourseRun) -> Recording:
    """Return the recording with heights in feet, where their unit is not stated and only so they fit the course."""
    name = next((height for height in HEIGHTS if height in framed.unsaid), None)
    finite = np.isfinite(framed.columns["height"])
    if name is None or not finite.any():
        return framed
    ground = race.course.origin.elevation if name == "altitude" else 0.0
    times = np.array([math.nan if passing is None else passing.time for passing in run.passings])
    metres = np.interp(times, framed.time[finite], framed.columns["height"][finite])
    feet = (metres + ground) * _FOOT - ground
    axes = [0.0 if passing is None else passing.axis for passing in run.passings]
    windows = [height_window(passage.element, axis) for passage, axis in zip(race.course.passages, axes, strict=True)]
    excess = _beyond(metres, windows)
    if len(excess) < WINDOWS_MIN or np.median(np.abs(excess)) < TOO_HIGH:
        return framed
    scatter = float(np.ptp(metres[np.isfinite(_all_beyond(metres, windows))]))
    widest = max(window.upper - window.lower for window in windows if math.isfinite(window.upper - window.lower))
    left = np.median(np.abs(_beyond(feet, windows)))
    if left > FEET_LEFT * np.median(np.abs(excess)) or scatter < FEET_SCATTER * widest:
        return framed
    columns = {**framed.columns, "height": (framed.columns["height"] + ground) * _FOOT - ground}
    if name == "altitude":
        columns["altitude"] = framed.columns["altitude"] * _FOOT
    remark = f"heights are taken as feet: as metres they are {np.median(excess):.0f} m off the windows of the course"
    return replace(framed, columns=columns, remarks=(*framed.remarks, remark))


def roll_offsets(
    race: Race, part: Recording, path: Path, run: CourseRun
) -> tuple[tuple[float, float], tuple[str, ...]]:
    """Return by how much the recorded roll is late, s, and off, rad, both without sign, and remarks.

    In turns the roll is that of the path but for two things that no sample shows: its clock may be another than that
    of the positions, and its sensor may be mounted obliquely. They are found where roll and path agree best.
    """
    time = path.time[(path.time >= run.begin) & (path.time <= run.end)]
    derived = path_histories(race, *path.at(time))
    _, gamma, mu = attitude.euler_angles(attitude.path_axes([derived[name] for name in QUATERNION]))
    turning = (derived["n_z"] > TURNING_LOAD) & (np.abs(gamma) < STEEP)
    if not turning.any():
        return (0.0, 0.0), ()
    count = round(LAG_MAX / LAG_STEP)
    lags = LAG_STEP * np.arange(-count, count + 1)
    at, roll = samples_of(part, "phi")
    apart = _around(np.interp(time[turning] + lags[:, None], at, roll) - mu[turning])
    differences = np.minimum(np.abs(apart), BANK_DIFFERENCE).mean(axis=1)
    best = int(np.argmin(differences))
    likely = lags[differences <= (1.0 + LAG_EVIDENCE) * differences[best]]
    likely = np.where(np.abs(likely) < 1.5 * LAG_STEP, 0.0, likely)  # one step is none
    late, tilt = float(lags[best]), float(np.median(apart[best]))
    remarks: list[str] = []
    if abs(late) > REPORTED[0] and np.abs(likely).min() > 0.0:
        side = "late" if late > 0.0 else "early"
        remarks.append(
            f"the recorded roll comes {abs(late):.2f} s {side} against the positions: banks are less certain"
        )
    if abs(math.degrees(tilt)) > REPORTED[1]:
        degrees = f"{math.degrees(tilt):.1f} deg"
        remarks.append(f"the recorded roll is off the path's by {degrees}, so that banks are less certain")
    return (math.hypot(float(np.sqrt(np.mean(likely**2))), LAG_STEP / math.sqrt(12.0)), abs(tilt)), tuple(remarks)


def _all_beyond(heights: Array, windows: Sequence[Interval]) -> Array:
    """Return by how much each height is beyond its window, m; NaN where there is no window, or no height."""
    excess = np.full(len(heights), math.nan)
    for row, (height, window) in enumerate(zip(heights, windows, strict=True)):
        if math.isfinite(window.upper) and math.isfinite(height):
            excess[row] = beyond(height, window)
    return excess


def _beyond(heights: Array, windows: Sequence[Interval]) -> Array:
    excess = _all_beyond(heights, windows)
    return excess[np.isfinite(excess)]


def plausible(part: Recording, path: Path, race: Race) -> Recording:
    """Return the recording with its columns in the units that fit the path, and without those that contradict it.

    Args:
        part: around the run, on the clock of the log.
        path: smoothed from its positions.
        race: course, aircraft and air.
    """
    inside = np.flatnonzero((part.time >= path.time[0]) & (part.time <= path.time[-1]))
    rows = inside[:: max(1, len(inside) // ROWS_MAX)]
    derived = path_histories(race, *path.at(part.time[rows]))
    chi, gamma, mu = attitude.euler_angles(attitude.path_axes([derived[name] for name in QUATERNION]))
    fast, turning = derived["V_K"] > SPEED_MIN, derived["n_z"] > TURNING_LOAD
    columns, remarks = dict(part.columns), list[str]()

    def difference(
        name: str, true: Array, where: NDArray[np.bool_], measure: Callable[[Array], Array] = np.asarray
    ) -> float:
        differences = measure(columns[name][rows] - true)[where & np.isfinite(columns[name][rows])]
        return float(np.median(np.abs(differences))) if len(differences) else 0.0

    def drop(names: tuple[str, ...], why: str) -> None:
        dropped = [name for name in names if columns.pop(name, None) is not None]
        remarks.append(f"the recorded {', '.join(dropped)} {'is' if len(dropped) == 1 else 'are'} not used: {why}")

    for name in ("V_G", "V_A", "V_I"):
        recorded = fast & np.isfinite(columns[name][rows]) if name in columns else np.zeros(len(rows), bool)
        if not recorded.any():
            continue
        ratio = float(np.median(columns[name][rows][recorded] / derived["V_K"][recorded]))
        if name in part.unsaid and ratio > 0.0:
            unit = min(_SPEEDS, key=lambda unit: abs(math.log(ratio * _SPEEDS[unit])))
            if unit != "m/s":
                columns[name] = columns[name] * _SPEEDS[unit]
                remarks.append(f"{name} is taken in {unit}: so it fits the path")
            ratio *= _SPEEDS[unit]
        if abs(ratio - 1.0) > SPEED_SHARE:
            drop((name,), f"it is {ratio:.2g} times the speed of the path")
    if "n_z" in columns and "n_z" not in part.mapped:
        columns["n_z"], remark = _load_factor(columns["n_z"], rows[fast], derived["n_z"][fast])
        remarks += remark
    if "n_z" in columns and difference("n_z", derived["n_z"], turning) > LOAD_DIFFERENCE:
        drop(("n_z",), f"in turns it is off the path's by {difference('n_z', derived['n_z'], turning):.1f} g")
    angles = [name for name in _ANGLES if name in columns and name in part.unsaid]
    largest = float(np.nanmax(np.abs(columns[angles[0]]), initial=0.0)) if angles else 0.0  # of the roll, if any
    moves = bool(angles) and float(np.nanstd(np.degrees(columns[angles[0]]))) > ROLL_SCATTER
    if 0.0 < math.degrees(largest) < FULL_TURN and turning.any() and moves:
        for name in angles:
            columns[name] = np.degrees(columns[name])
        remarks.append("angles are taken in radians, for none is larger than a full turn of these")
    banked = turning & (np.abs(np.sin(mu)) > BANKED_SINE)
    for name, what, where, true, measure, most in (
        ("phi", "roll", banked, mu, _around, BANK_DIFFERENCE),
        ("n_z", "load factor", fast, derived["n_z"], np.asarray, STILL_LOAD_DIFFERENCE),
    ):
        if name not in columns:
            continue
        near = _latest(part.time, columns[name], part.time[rows[where]])
        wrong = (near >= 0) & (np.abs(measure(columns[name][near] - true[where])) > most)
        stuck = _stuck(part.time, columns[name], near[wrong])
        if stuck.any():
            columns[name] = np.where(stuck, np.nan, columns[name])
            first = int(part.lines[stuck][0])
            remarks.append(f"the recorded {what} stands still in turns from line {first} on and is not used there")
    off, turned = (difference("phi", bank, banked, _around) if "phi" in columns else 0.0 for bank in (mu, -mu))
    if turned < BANK_DIFFERENCE < off:
        columns["phi"] = -columns["phi"]
        remarks.append("the recorded roll is taken with the other sign: so it fits the turns of the path")
    elif off > BANK_DIFFERENCE:
        drop(("phi",), f"in turns it is off the path's by {math.degrees(off):.0f} deg")
    for name, true, most in (("theta", gamma, CLIMB_DIFFERENCE), ("psi", chi, COURSE_DIFFERENCE)):
        if name in columns and (off := difference(name, true, fast, _around)) > most:
            drop((name,), f"it is off the path's by {math.degrees(off):.0f} deg")
    return replace(part, columns=columns, remarks=(*part.remarks, *remarks))


def _latest(time: Array, values: Array, when: Array) -> NDArray[np.int64]:
    """Return at some times the last sample that is known, its number; -1 before the first."""
    finite = np.flatnonzero(np.isfinite(values))
    if not len(finite):
        return np.full(len(when), -1, np.int64)
    near = np.searchsorted(time[finite], when, side="right") - 1
    return np.where(near >= 0, finite[near], -1)


def _stuck(time: Array, values: Array, wrong: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which samples of a history belong to one that stands still, although some of it are wrong, shape (n,).

    Args:
        time, values: of all samples, shape (n,).
        wrong: the numbers of samples that contradict the path.
    """
    finite = np.flatnonzero(np.isfinite(values))
    stretch = np.full(len(values), -1)
    stretch[finite] = np.cumsum(np.diff(values[finite], prepend=np.inf) != 0.0) - 1
    begins = np.flatnonzero(np.diff(stretch[finite], prepend=-1))
    ends = np.append(begins[1:], len(finite)) - 1
    still = time[finite[ends]] - time[finite[begins]] > HOLE
    bad = np.zeros(len(begins) + 1, np.bool_)  # the last one for what is not known
    bad[stretch[wrong]] = True
    return np.append(still, False)[stretch] & bad[stretch]


_LOADS = ((1.0, 1.0, "without the 1 g of level flight"), (-1.0, 0.0, "downward"), (-1.0, 1.0, "downward, without 1 g"))
"""How load factors are recorded besides upward with the 1 g: factor and summand that undo it, and words for it."""


def _load_factor(recorded: Array, rows: NDArray[np.int64], derived: Array) -> tuple[Array, tuple[str, ...]]:
    """Return a recorded load factor upward and with the 1 g of level flight, and a remark where it was not so.

    Args:
        recorded: of all samples, shape (n,).
        rows: the samples that are looked at, shape (m,).
        derived: of the path there, shape (m,).
    """
    finite = np.isfinite(recorded[rows])
    if not finite.any() or np.ptp(recorded[rows][finite]) == 0.0:  # what does not move has no zero
        return recorded, ()

    def off(factor: float, summand: float) -> float:
        return float(np.median(np.abs(factor * recorded[rows][finite] + summand - derived[finite])))

    factor, summand, words = min(_LOADS, key=lambda load: off(load[0], load[1]))
    if off(factor, summand) > LOAD_DIFFERENCE_LEFT * off(1.0, 0.0):
        return recorded, ()
    return factor * recorded + summand, (f"load factors are taken as recorded {words}: so they fit the path",)


def _around(angle: Array) -> Array:
    return np.remainder(angle + np.pi, 2.0 * np.pi) - np.pi
