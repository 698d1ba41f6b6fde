"""A recording as a flight of a race: run, path, histories, passings, violations, and what there is to tell of it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from airrace.environment.atmosphere import g0
from airrace.logs.passings import CourseRun, in_frame, in_order, runs, standing
from airrace.logs.recording import Recording, counted, refuse
from airrace.logs.smoothing import (
    DERIVED,
    EDGE,
    LONGEST,
    Path,
    between_samples,
    derived_histories,
    euler_axes,
    measured_histories,
    path_attitude,
    roll_rate,
    smooth,
)
from airrace.logs.violations import NONE_KNOWN, Penalties, StandardDeviations, Violation, violations
from airrace.planning.race import Race
from airrace.records import record
from airrace.results import Crossing, Flight, History, Source, attitude
from airrace.results.derivation import complete_histories
from airrace.results.flight import BODY_ATTITUDE, GLOSSARY, PATH_ATTITUDE, Basis, Histories
from airrace.track.course import Passage
from airrace.trajectory import Array

SAMPLING = 0.02
"""The time between two samples of a flown flight, s, as of an optimum's."""
COARSE = 0.2
"""The time between the samples among which a run is looked for, s."""
MARGIN = 5.0
"""The time that is smoothed before the first passing and behind the last one, s."""
GAP = 0.25
"""The time beyond which samples have a gap between them, s, if they are 2.5 times farther apart than usual, too."""
INFLATION = 2.5
"""The factor by which the positions at passings are less certain than the smoother's own equations say.

On optima of Rovinj 2014 with 0.02 to 1.5 m of noise they were off by 1.4 to 3.5 times that standard deviation, for
aircraft turn hardest beside gates."""
BANK_AT_A_GATE = math.radians(40.0)
"""The error of an estimated bank at a gate (root mean square) with 1 m of noise or more.

With less noise it falls as its power 0.4. Measured likewise, at 5 and 20 Hz: 6 to 9 degrees with 0.02 m, 13 to 21 with
0.1 m, 38 to 40 with 1.5 m. Wings are level at a gate for a few tenths of a second, at a load factor that hardly bends
the path."""
LOAD_FACTOR_AT_A_GATE = 1.7
"""The error of a load factor at a gate, g.

It falls as the power 0.25 of the noise: 0.6 to 0.8 with 0.02 m, 1.7 with 1.5 m.
"""
SLOPE_TIME = 0.15
"""The time by which the velocity across the path at a passing is less certain than its position, s.

It was measured likewise.
"""
TURNING_TIME = 0.02
"""The time of turning, s, by whose turn the direction of the path is uncertain.

Smoothing rounds the beginning of a pull. Root mean squares over all passings were 0.017 to 0.023 s with up to 0.02 m of
noise at 5 to 20 Hz.
"""
SPEED_OFF = 1.0
"""The error of the speed at a passing whose position is off by 1 m, m/s.

A smoother that takes the jerk for white noise looks at positions within a time `tau`; its positions are then off as
`tau^2.5`, its velocities as `tau^1.5`. So the speed is off as the power 0.6 of the position. On optima of Rovinj 2014
and Abu Dhabi 2016 with 0.02 to 1.5 m of noise, at 5 to 200 Hz, the root mean square was 0.7 to 0.9 of that.
"""
TOLD_RUNS = 12
"""The greatest number of runs whose beginning is told."""
TOLD = 5
"""The greatest number of gaps that are told one by one."""


@record
class LogFlight:
    """A flown run through a course.

    Attributes:
        flight: with its histories and crossings; its clock starts at the start.
        violations: of the rules.
        known: how well every passing is known, by the names of the passages.
        recording: the part of the log that it was made from, on the clock of the log.
        offset: the time of the log at which the flight's clock starts, s.
        remarks: what whoever looks at it should know, as sentences.
    """

    flight: Flight
    violations: tuple[Violation, ...]
    known: Mapping[str, StandardDeviations]
    recording: Recording
    offset: float
    remarks: tuple[str, ...]


def flight_from_log(
    recording: Recording,
    race: Race,
    *,
    label: str,
    penalties: Penalties = NONE_KNOWN,
    noise: float | None = None,
    run: int | None = None,
) -> LogFlight:
    """Return the flight that a recording tells of.

    Args:
        recording: as it was read.
        race: course, aircraft and air.
        label: what people call the flight by.
        penalties: of the season.
        noise: standard deviation of the positions, m; None to estimate it from them.
        run: which of several runs through the course, counted from 1; None for the one that passes most closely.

    Raises:
        InputError: the recording does not pass the course, or has no such run.
    """
    placed = in_frame(in_order(recording), race)
    chosen, remarks = _chosen_run(placed, race, run)
    if chosen.end - chosen.begin > LONGEST:
        refuse(
            placed.path, 0, f"a run of {chosen.end - chosen.begin:.0f} s is too long; at most {LONGEST:g} s are read"
        )
    within = (placed.time >= chosen.begin - MARGIN) & (placed.time <= chosen.end + MARGIN)
    part = placed.select(within, *remarks)
    path = smooth(part.time, np.stack([part.columns[name] for name in ("x", "y", "height")]), noise)
    fine = path.time[0] + SAMPLING * np.arange(int((path.time[-1] - path.time[0]) / SAMPLING) + 1)
    position, _, _ = path.at(fine)
    again = runs(race, fine, position[0], position[1])
    if not again:
        refuse(placed.path, 0, "its positions scatter too widely for a passing to be seen")
    final = max(again, key=lambda one: one.count)
    flight = _flight(race, part, path, final, label)
    known = _deviations(part, path, final, flight)
    axes = {p.name: one.axis for p, one in zip(race.course.passages, final.passings, strict=True) if one is not None}
    remarks = (*part.remarks, *_remarks(part, path, flight))
    return LogFlight(flight, violations(flight, axes, known, penalties), known, part, final.begin, remarks)


def _chosen_run(placed: Recording, race: Race, wanted: int | None) -> tuple[CourseRun, tuple[str, ...]]:
    """Return the run that is imported, as found on a coarse path, and a sentence where there are several."""
    found = runs(race, *_coarse(placed))
    if not found:
        count = sum(standing(one) for one in race.course.passages)
        refuse(
            placed.path,
            0,
            f"passes less than half of the {count} gates and pylons of {race.course.name} in their order; "
            "is it another course, or another origin?",
        )
    if wanted is not None and not 1 <= wanted <= len(found):
        refuse(placed.path, 0, f"has {len(found)} runs through the course; there is no run {wanted}")
    closest = [sum(one.aside**2 for one in run.passings if one is not None) for run in found]
    best = max(range(len(found)), key=lambda index: (found[index].count, -closest[index]))
    index = best if wanted is None else wanted - 1
    if len(found) == 1:
        return found[0], ()
    begins, own = ", ".join(f"{one.begin:.1f}" for one in found[:TOLD_RUNS]), ""
    if len(found) > TOLD_RUNS:
        begins, own = f"{begins}, ...", f", which begins at {found[index].begin:.1f} s"
    remark = f"the log holds {len(found)} runs, which begin {begins} s after its first sample; this is run {index + 1}"
    return found[index], (f"{remark}{own}",)


def _coarse(placed: Recording) -> tuple[Array, Array, Array]:
    """Return time, north and east on a coarse path, which goes straight on where the log ends."""
    inside = np.arange(placed.time[0], placed.time[-1] + 0.5 * COARSE, COARSE)
    time = np.concatenate([[inside[0] - EDGE], inside, [inside[-1] + EDGE]])
    places: list[Array] = []
    for name in ("x", "y"):
        values = np.interp(inside, placed.time, placed.columns[name])
        slopes = (np.diff(values[:3]).mean(), np.diff(values[-3:]).mean()) if len(inside) > 2 else (0.0, 0.0)
        ahead, behind = values[0] - slopes[0] / COARSE * EDGE, values[-1] + slopes[1] / COARSE * EDGE
        places.append(np.concatenate([[ahead], values, [behind]]))
    return time, places[0], places[1]


def _flight(race: Race, part: Recording, path: Path, run: CourseRun, label: str) -> Flight:
    """Return the flight from the first passing to the last one; its time axis holds all passings."""
    own = [one.time for one in run.passings if one is not None]
    between = np.arange(run.begin, run.end, SAMPLING)
    time = np.unique(np.concatenate([between[np.min(np.abs(between[:, None] - np.array(own)), axis=1) > 1e-6], own]))
    histories = _histories(race, part, path, time)
    flight = Flight(race, Source(label, remark="flown"), time - run.begin, histories, ())
    passings: list[Crossing] = []
    times = _times(race.course.passages, run, flight)
    for passage, when in zip(race.course.passages, times, strict=True):
        row = int(np.searchsorted(flight.time, when - 1e-9)) if math.isfinite(when) else -1
        values = {name: float(one.values[row]) for name, one in histories.items()} if row >= 0 else {}
        passings.append(Crossing(passage, float(flight.time[row]) if row >= 0 else math.nan, values))
    return replace(flight, crossings=tuple(passings))


def _histories(race: Race, part: Recording, path: Path, time: Array) -> Histories:
    position, velocity, acceleration = path.at(time)
    given: dict[str, History] = derived_histories(race, position, velocity, acceleration)
    measured = measured_histories(part, time)
    if {"phi", "theta", "psi"} <= set(measured):
        R_OB = euler_axes(*(measured[name].values for name in ("psi", "theta", "phi")))
        path_frame = path_attitude(velocity, R_OB[:, 1])
        rows = (*path_frame, *attitude.quaternions(R_OB))
        derived: dict[str, Array] = dict(zip((*PATH_ATTITUDE, *BODY_ATTITUDE), rows, strict=True))
        derived["p_Kbar"] = roll_rate(attitude.path_axes(path_frame), time)
        declared = {**GLOSSARY, **DERIVED}
        given |= {name: History(declared[name], values, Basis.DERIVED) for name, values in derived.items()}
    return complete_histories(race, {**given, **measured})


def _times(passages: Sequence[Passage], run: CourseRun, flight: Flight) -> list[float]:
    """Return the time of every passing on the flight's clock; NaN for what was not passed.

    What stands nowhere is passed between its neighbours, where the conditions are kept best; the highest such place if
    several keep them.
    """
    times = [math.nan if one is None else one.time - run.begin for one in run.passings]
    for index, passage in enumerate(passages):
        if standing(passage):
            continue
        before = max((one for one in times[:index] if math.isfinite(one)), default=0.0)
        later = zip(passages[index + 1 :], times[index + 1 :], strict=True)
        behind = (one for other, one in later if standing(other) and math.isfinite(one))
        after = next(behind, float(flight.time[-1]))
        rows = np.flatnonzero((flight.time > before) & (flight.time < after))
        if len(rows):
            times[index] = float(flight.time[rows[_nearest(passage, flight, rows)]])
    return times


def _nearest(passage: Passage, flight: Flight, rows: NDArray[np.int64]) -> int:
    """Return which of the rows keeps the conditions of an element that stands nowhere best."""
    columns = {name: flight[name][rows] for name in ("x", "y", "z")} | {"climb_sine": np.sin(flight["gamma"][rows])}
    off = np.zeros(len(rows))
    for name, allowed in passage.element.conditions(passage.element.axis or 0.0).items():
        if name in columns:
            scale = 100.0 if name == "climb_sine" else 1.0  # an angle weighs as much as so many metres
            values = scale * columns[name]
            off += np.maximum(values - scale * allowed.upper, 0.0) + np.maximum(scale * allowed.lower - values, 0.0)
    best = np.flatnonzero(off <= off.min() + 1e-9)
    return int(best[np.argmax(flight["height"][rows][best])])


def _deviations(part: Recording, path: Path, run: CourseRun, flight: Flight) -> Mapping[str, StandardDeviations]:
    """Return how well every passing is known, by the names of the passages; see `INFLATION` and `BANK_AT_A_GATE`.

    A bank that was recorded is known as well as the lines between its samples tell it.
    """
    made = [(one, crossing) for one, crossing in zip(run.passings, flight.crossings, strict=True) if one is not None]
    times = np.array([one.time for one, _ in made])
    places = INFLATION * path.deviations(times)
    noise = min(float(path.noise.max()), 1.0)
    estimated = np.full(len(times), BANK_AT_A_GATE * noise**0.4)
    banks = between_samples(part, "phi", times) if _is_measured(flight, "phi") else estimated
    load = math.nan if _is_measured(flight, "n_z") else LOAD_FACTOR_AT_A_GATE * noise**0.25
    found: dict[str, StandardDeviations] = {}
    for column, (_, crossing) in enumerate(made):
        north, east, up = places[:, column].tolist()
        across = max(north, east)
        worst = max(across, up)
        V_K = crossing.value("V_K")
        path_angle = math.hypot(math.atan2(worst / SLOPE_TIME, V_K), TURNING_TIME * crossing.value("n_z") * g0 / V_K)
        bank = float(banks[column])
        tip = 0.0 if math.isnan(bank) else 0.5 * flight.aircraft.airframe.b * math.sin(min(bank, 0.5 * math.pi))
        wing = math.hypot(across, tip)
        found[crossing.name] = StandardDeviations(across, wing, up, bank, path_angle, SPEED_OFF * worst**0.6, load)
    return found


def _remarks(part: Recording, path: Path, flight: Flight) -> list[str]:
    """Return sentences on rate, noise, outliers and gaps; times are those of the flight's clock."""
    steps = np.diff(part.time)
    usual = float(np.median(steps))
    north, east, up = path.scatter.tolist()
    remarks = [
        f"positions come at {1.0 / usual:.3g} Hz and scatter by {north:.2g}, {east:.2g} and {up:.2g} m "
        "about the smoothed path (north, east, up)"
    ]
    if count := int(path.outliers.sum()):
        first = int(part.lines[np.flatnonzero(path.outliers)[0]])
        remarks.append(f"{counted(count, 'outlier')} left out, the first one in line {first}")
    gaps = np.flatnonzero((steps > GAP) & (steps > 2.5 * usual))
    for row in gaps[:TOLD].tolist():
        remarks.append(f"a gap of {steps[row]:.2f} s behind line {part.lines[row]}: the path is bridged there")
    if len(gaps) > TOLD:
        remarks.append(f"and {len(gaps) - TOLD} more gaps")
    missing = [one.name for one in flight.crossings if not one.found]
    if missing:
        remarks.append(f"not passed: {', '.join(missing)}")
    estimated = [words for name, words in (("phi", "bank"), ("n_z", "load factor")) if not _is_measured(flight, name)]
    if estimated:
        remarks.append(f"estimated from the positions, not recorded: {', '.join(estimated)}")
    return remarks


def _is_measured(flight: Flight, name: str) -> bool:
    return name in flight and flight.basis(name) is Basis.MEASURED
