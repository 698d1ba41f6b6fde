"""A recording as a flight of a race: run, path, histories, passings, violations, and remarks on them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from airrace.errors import InputError
from airrace.flights.logs.clocks import repair_cut
from airrace.flights.logs.deviations import deviations_of, place_roundings
from airrace.flights.logs.errors import CommonErrors, Receiver
from airrace.flights.logs.histories import log_histories
from airrace.flights.logs.passings import CourseRun, find_runs, in_frame, in_order, stands
from airrace.flights.logs.plausibility import in_feet_if_so, plausible, roll_offsets
from airrace.flights.logs.quality import receiver_accuracy
from airrace.flights.logs.recording import Recording, count_of, refuse
from airrace.flights.logs.smoothing import DURATION_MAX, EDGE, Path, smooth
from airrace.flights.logs.violations import (
    FlightErrors,
    StandardDeviations,
    Violation,
    is_measured,
    passing_windows,
    violations,
)
from airrace.flights.results import Flight, Source, TimedCrossing
from airrace.flights.results.penalties import NONE_KNOWN, Penalties
from airrace.model.track.course import Passage
from airrace.optimal_control.quantities import plain_number
from airrace.optimal_control.trajectory import Array
from airrace.race import Race

SAMPLING = 0.02
"""The time between two samples of the flight, s, as of an optimum's."""
COARSE_SAMPLING = 0.2
"""That between the samples among which a run is looked for, s."""
REGISTERED = 3.0
"""The offset beyond which the flight is moved before it is judged, m: in the time that it takes to fly so far a turn of
8 g departs from the straight line by less than 0.05 m, and what is linear in the errors needs no move."""
REGISTRATIONS = 2
"""The number of times that it is moved, at most."""
SMOOTHED_MARGIN = 5.0
"""The time that is smoothed before the first passing and behind the last one, s."""
GAP = 0.25
"""The time beyond which samples have a gap between them, s, if they are also farther apart than usual."""
GAP_FACTOR = 2.5
"""By this factor."""
RUNS_MAX = 12
"""The greatest number of runs whose start is in the remarks."""
GAPS_MAX = 5
"""The greatest number of gaps with a remark of their own."""


@dataclass(frozen=True)
class LogFlight:
    """A recorded run through a course.

    Attributes:
        flight: with its histories and crossings; its clock starts at the start.
        violations: of the rules.
        known: the accuracy of every passing, by the names of the passages.
        recording: the part of the log that it was made from, on the clock of the log.
        offset: the time of the log at which the flight's clock starts, s.
        remarks: for the reader, as sentences.
        noise: standard deviation of the positions that was given, m; None where it was estimated.
        assumption: the accuracy that judgements assume, in words.
        axes: along which axis each element was passed, rad, by the names of the passages.
        errors: how well the flight is known.
        penalties: of the season.
    """

    flight: Flight
    violations: tuple[Violation, ...]
    known: Mapping[str, StandardDeviations]
    recording: Recording
    offset: float
    remarks: tuple[str, ...]
    noise: float | None
    assumption: str
    axes: Mapping[str, float]
    errors: FlightErrors
    penalties: Penalties


def flight_from_log(
    recording: Recording,
    race: Race,
    *,
    label: str,
    penalties: Penalties = NONE_KNOWN,
    noise: float | None = None,
    run: int | None = None,
    height_offset: float = 0.0,
) -> LogFlight:
    """Return the flight in a recording.

    Args:
        recording: as it was read.
        race: course, aircraft and air.
        label: what people call the flight by.
        penalties: of the season.
        noise: standard deviation of the positions, m; None to estimate it from them.
        run: which of several runs through the course, counted from 1; None for the one that passes most closely.
        height_offset: added to its heights, m.

    Raises:
        InputError: the recording does not pass the course, or has no such run.
    """
    framed, chosen, remarks = _choose_flight(recording, race, run)
    if (duration := chosen.end - chosen.begin) > DURATION_MAX:
        most = f"at most {DURATION_MAX:g} s are read"
        refuse(framed.path, 0, f"a run of {duration:.0f} s is too long; {most}")
    framed = in_feet_if_so(framed, race, chosen).raised(height_offset)
    within = (framed.time >= chosen.begin - SMOOTHED_MARGIN) & (framed.time <= chosen.end + SMOOTHED_MARGIN)
    part = _with_repaired_clock(framed.select(within, *remarks))
    return flight_of_part(part, race, label=label, penalties=penalties, noise=noise)


def _with_repaired_clock(part: Recording) -> Recording:
    """Return a part of a recording whose times are cut off with those that the way tells, and a remark.

    Samples without a position, as of an attitude, keep their place between those that have one.
    """
    if not part.cut:
        return part
    placed = np.flatnonzero(np.isfinite(part.columns["x"]) & np.isfinite(part.columns["y"]))
    places = np.stack([part.columns[name][placed] for name in ("x", "y", "height")])
    time, deviation, rate = repair_cut(part.time[placed], places, part.cut)
    cut = "whole seconds" if part.cut == 1.0 else f"steps of {plain_number(part.cut, 3)} s"
    remark = f"times are cut to {cut} at an uneven rate"
    usual = plain_number(float(np.median(deviation)), 2)
    if np.array_equal(time, part.time[placed]):
        remark += f", and the way tells no others: they are known to {usual} s"
    else:
        remark += f": the way between them tells them to {usual} s"
    all_time = np.interp(part.time, part.time[placed], time)
    columns = {
        **part.columns,
        "clock_deviation": np.interp(part.time, part.time[placed], deviation),
        "clock_rate_deviation": np.interp(part.time, part.time[placed], rate),
    }
    return replace(part, time=all_time, columns=columns).select(np.ones(len(all_time), bool), remark)


def flight_of_part(
    part: Recording, race: Race, *, label: str, penalties: Penalties = NONE_KNOWN, noise: float | None = None
) -> LogFlight:
    """Return the flight in the part of a recording that holds one run, in the track's frame.

    What a `LogFlight` holds as its recording gives the same flight once more. Arguments and errors are those of
    `flight_from_log`.
    """
    placed = part.select(np.isfinite(part.columns["x"]))
    places, least = np.stack([placed.columns[name] for name in ("x", "y", "height")]), place_roundings(placed)
    if np.isfinite(places[2]).sum() < 2:
        refuse(part.path, 0, "has no heights on the course")
    path = smooth(placed.time, places, noise, least)
    part = plausible(part, path, race)
    accuracy = receiver_accuracy(part)
    common = CommonErrors(Receiver(part.time, accuracy, stated=part.accuracy is not None, barometric=part.barometric))
    registrations = 0
    while True:
        moved = replace(path, position=path.position - common.registration[:, None])
        run = _find_run(race, part, moved)
        flight = _flight(race, part, moved, run, label)
        axes = run.axes(race.course.passages)
        late, offsets = roll_offsets(race, part, path, run) if is_measured(flight, "phi") else ((0.0, 0.0), ())
        known = partial(deviations_of, part, path, least, flight, run.begin, axes, late=late[0], tilt=late[1])
        own = known(common=common, own=True)
        common = common.with_windows(passing_windows(flight, axes, own, run.begin), common.registration)
        if registrations == REGISTRATIONS or np.linalg.norm(common.offset - common.registration) <= REGISTERED:
            break
        registrations += 1
        common = common.with_windows((), common.offset)
    errors = FlightErrors(own, known(common=common), common, run.begin)
    accuracies = {crossing.name: errors.at(crossing.time) for crossing in flight.crossings if crossing.found}
    losses = [loss] if (loss := accuracy.loss(part.time - run.begin)) else []
    remarks = (*part.remarks, *losses, *common.remarks, *offsets, *_remarks(placed, path, flight, accuracies))
    broken = violations(flight, axes, errors, penalties)
    return LogFlight(
        flight, broken, accuracies, part, run.begin, remarks, noise, accuracy.text, axes, errors, penalties
    )


def judged_together(logs: Sequence[LogFlight]) -> tuple[LogFlight, ...]:
    """Return flights over one course as they are judged with gates where all of them together tell that these stand.

    A flight that is given twice, and one over other gates than the first, tells nothing of them. Without a gate that
    stands elsewhere every flight is returned as it is.
    """
    course = logs[0].flight.course
    gates = [(passage.name, passage.element) for passage in course.passages]
    numbers: dict[tuple[float, ...], list[int]] = {}  # of the logs of each flight
    for number, log in enumerate(logs):
        if [(passage.name, passage.element) for passage in log.flight.course.passages] == gates:
            flight = tuple(crossing.time for crossing in log.flight.crossings if crossing.found)
            numbers.setdefault(flight, []).append(number)
    errors = [logs[same[0]].errors.common for same in numbers.values()]
    together = errors[0].beside(errors[1:])
    if len(errors) == 1 or not together.displaced:
        return tuple(logs)
    judged = list(logs)
    for own, same in enumerate(numbers.values()):
        others = [*errors[:own], *errors[own + 1 :]]
        for number in same:
            log = logs[number]
            common = log.errors.common.beside(others, together.displaced)
            known = replace(log.errors, common=common)
            broken = violations(log.flight, log.axes, known, log.penalties)
            before = log.errors.common.displacement_remarks
            remarks = (*(remark for remark in log.remarks if remark not in before), *common.displacement_remarks)
            judged[number] = replace(log, errors=known, remarks=remarks, violations=broken)
    return tuple(judged)


def _find_run(race: Race, part: Recording, path: Path) -> CourseRun:
    """Return the run through the course on a smoothed path."""
    fine = path.time[0] + SAMPLING * np.arange(int((path.time[-1] - path.time[0]) / SAMPLING) + 1)
    (x, y, _), _, _ = path.at(fine)
    runs = find_runs(race, fine, x, y)
    if not runs:
        refuse(part.path, 0, "its positions scatter too widely for a passing to be seen")
    return max(runs, key=lambda run: len(run.made))


def _choose_flight(
    recording: Recording, race: Race, number: int | None
) -> tuple[Recording, CourseRun, tuple[str, ...]]:
    """Return the aircraft or track that passes the course best, in the track's frame, its run, and remarks.

    Raises:
        InputError: none of them passes the course; the error is that of the first one.
    """
    candidates: list[tuple[Recording, CourseRun, tuple[str, ...]]] = []
    first: InputError | None = None
    for candidate in (recording, *recording.others):
        try:
            framed = in_frame(in_order(candidate), race)
            candidates.append((framed, *_choose_run(framed, race, number)))
        except InputError as error:
            first = first or error
    if not candidates:
        assert first is not None  # there is one recording at least
        raise first
    framed, chosen, remarks = max(candidates, key=lambda candidate: len(candidate[1].made))
    if recording.others:
        remarks = (f"{framed.label} is taken, which passes the course", *remarks)
    return framed, chosen, remarks


def _choose_run(framed: Recording, race: Race, number: int | None) -> tuple[CourseRun, tuple[str, ...]]:
    """Return the run that is imported, as found on a coarse path, and a sentence where there are several."""
    runs = find_runs(race, *_coarse_path(framed))
    if not runs:
        count = sum(stands(passage) for passage in race.course.passages)
        if count == 0:
            refuse(framed.path, 0, f"looks like others: {race.course.name} has no gate and no pylon that stands")
        refuse(
            framed.path,
            0,
            f"passes less than half of the {count} gates and pylons of {race.course.name} in their order; "
            "is it another course, or another origin?",
        )
    if number is not None and not 1 <= number <= len(runs):
        refuse(framed.path, 0, f"has {len(runs)} runs through the course; there is no run {number}")
    best = max(runs, key=lambda run: (len(run.made), -sum(passing.aside**2 for passing in run.made)))
    index = runs.index(best) if number is None else number - 1
    if len(runs) == 1:
        return runs[0], ()
    begins, own = ", ".join(f"{run.begin:.1f}" for run in runs[:RUNS_MAX]), ""
    if len(runs) > RUNS_MAX:
        begins, own = f"{begins}, ...", f", which begins at {runs[index].begin:.1f} s"
    remark = f"the log holds {len(runs)} runs, which begin {begins} s after its first sample; this is run {index + 1}"
    return runs[index], (f"{remark}{own}",)


def _coarse_path(framed: Recording) -> tuple[Array, Array, Array]:
    """Return time, north and east on a coarse path, which goes straight on where the log ends."""
    placed = framed.select(np.isfinite(framed.columns["x"]) & np.isfinite(framed.columns["y"]))
    step, edge = COARSE_SAMPLING, EDGE
    rows = np.flatnonzero(np.diff(np.floor(placed.time / step), prepend=-np.inf) > 0.0)
    rows = np.unique([*rows.tolist(), len(placed.time) - 1])
    inside = placed.time[rows]
    time = np.concatenate([[inside[0] - edge], inside, [inside[-1] + edge]])
    step_rows = np.minimum(len(rows) - 1, 3)
    places: list[Array] = []
    for name in ("x", "y"):
        values = placed.columns[name][rows]
        ahead, behind = values[0], values[-1]
        if step_rows > 0:
            ahead = ahead - (values[step_rows] - values[0]) / (inside[step_rows] - inside[0]) * edge
            behind = behind + (values[-1] - values[-1 - step_rows]) / (inside[-1] - inside[-1 - step_rows]) * edge
        places.append(np.concatenate([[ahead], values, [behind]]))
    return time, places[0], places[1]


def _flight(race: Race, part: Recording, path: Path, run: CourseRun, label: str) -> Flight:
    """Return the flight from the first passing to the last one; its time axis holds all passings."""
    own = np.array([passing.time for passing in run.made])
    between = np.arange(run.begin, run.end, SAMPLING)
    time = np.unique(np.concatenate([between[np.min(np.abs(between[:, None] - own), axis=1) > 1e-6], own]))
    histories = log_histories(race, part, path, time)
    flight = Flight(race, Source(label, remark="flown"), time - run.begin, histories, ())
    passings: list[TimedCrossing] = []
    times = _passing_times(race.course.passages, run, flight)
    for passage, when in zip(race.course.passages, times, strict=True):
        if math.isfinite(when):
            row = int(np.searchsorted(flight.time, when - 1e-9))
            values = {name: float(history.values[row]) for name, history in histories.items()}
            passings.append(TimedCrossing(passage, float(flight.time[row]), values))
        else:
            passings.append(TimedCrossing(passage, math.nan, {}))
    return replace(flight, crossings=tuple(passings))


def _passing_times(passages: Sequence[Passage], run: CourseRun, flight: Flight) -> list[float]:
    """Return the time of every passing on the flight's clock; NaN for what was not passed.

    What stands nowhere (a height, an attitude) is passed between its neighbours, where its conditions are violated
    least; the highest such place if several meet them.
    """
    times = [math.nan if passing is None else passing.time - run.begin for passing in run.passings]
    for index, passage in enumerate(passages):
        if stands(passage):
            continue
        before = max((time for time in times[:index] if math.isfinite(time)), default=0.0)
        later = zip(passages[index + 1 :], times[index + 1 :], strict=True)
        after = next(
            (time for neighbour, time in later if stands(neighbour) and math.isfinite(time)), float(flight.time[-1])
        )
        rows = np.flatnonzero((flight.time > before) & (flight.time < after))
        if not len(rows):
            continue
        columns = {name: flight[name][rows] for name in ("x", "y", "z")} | {"climb_sine": np.sin(flight["gamma"][rows])}
        violation = np.zeros(len(rows))
        for name, allowed in passage.element.conditions(passage.element.axis or 0.0).items():
            if name in columns:
                scale = 100.0 if name == "climb_sine" else 1.0  # an angle weighs as much as so many metres
                values = scale * columns[name]
                violation += np.maximum(values - scale * allowed.upper, 0.0)
                violation += np.maximum(scale * allowed.lower - values, 0.0)
        best = rows[violation <= violation.min() + 1e-9]
        times[index] = float(flight.time[best[np.argmax(flight["height"][best])]])
    return times


def _remarks(part: Recording, path: Path, flight: Flight, accuracies: Mapping[str, StandardDeviations]) -> list[str]:
    """Return sentences on rate, noise, outliers and gaps; times are those of the flight's clock."""
    steps = np.diff(part.time)
    usual = float(np.median(steps))
    north, east, up = (plain_number(scatter, 2) for scatter in path.scatter.tolist())
    remarks = [
        f"positions come at {1.0 / usual:.3g} Hz and scatter by {north}, {east} and {up} m "
        "about the smoothed path (north, east, up)"
    ]
    if count := int(path.outliers.sum()):
        first = int(part.lines[path.outliers][0])
        remarks.append(f"{count_of(count, 'outlier')} left out, the first one in line {first}")
    gaps = np.flatnonzero((steps > GAP) & (steps > GAP_FACTOR * usual))
    for row in gaps[:GAPS_MAX].tolist():
        remarks.append(f"a gap of {steps[row]:.2f} s behind line {part.lines[row]}: the path is bridged there")
    if len(gaps) > GAPS_MAX:
        remarks.append(f"and {len(gaps) - GAPS_MAX} more gaps")
    missing = [crossing.name for crossing in flight.crossings if not crossing.found]
    if missing:
        remarks.append(f"not passed: {', '.join(missing)}")
    estimated = [words for name, words in (("phi", "bank"), ("n_z", "load factor")) if not is_measured(flight, name)]
    if estimated:
        remarks.append(f"estimated from the positions, not recorded: {', '.join(estimated)}")
    times = [deviation.time for deviation in accuracies.values()]
    if times:
        usual, worst = (1e3 * float(seconds) for seconds in (np.median(times), max(times)))
        remarks.append(
            f"times of passings are known to {plain_number(usual, 2)} ms, the worst one to {plain_number(worst, 2)} ms"
        )
    return remarks
