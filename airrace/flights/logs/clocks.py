"""The clocks of logs: how times are written, in which unit they count, and which of them cannot be true.

Times of flight recorders run back for single samples, begin again at midnight, count whole seconds for several samples,
and stand in units that no header names. What follows from the samples around a time is followed; the rest is left out.
"""

import contextlib
import math
import re
from datetime import UTC, datetime, tzinfo

import numpy as np
from numpy.typing import NDArray

from airrace.flights.logs.recording import count_of, refuse, resolution
from airrace.model.environment import g0
from airrace.optimal_control.quantities import plain_number
from airrace.optimal_control.trajectory import Array

DAY = 86400.0
_CLOCK = re.compile(r"(\d{1,2}):(\d{2})(?::(\d{2}(?:[.,]\d*)?))?(?: ?([AP])M)?(?: ?Z| UTC)?", re.IGNORECASE)
_ISO = re.compile(r"\d{4}-\d{2}-\d{2}")
_DATED = re.compile(r"(\d{1,4}[./-]\d{1,2}[./-]\d{1,4})[ T,;]+(\d{1,2}:.*)")
DATE_ORDERS = ("ymd", "dmy", "mdy")
"""The orders of year, month and day in dates."""
_LEAP = re.compile(r":60(?!\d)")
TICKS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Units of numbers that count time, s."""


SINCE_1970_MIN = 1e8
"""From this many seconds on a number counts from 1970, not from the recorder's start."""
SINCE_1970_MAX = 1e11
"""Up to this many, s."""
MOVED_MIN = 50.0
"""The distance between two samples from which the speed of the aircraft follows, m."""
ROWS_MAX = 200_000
"""The number of rows that are looked at for the speed, about."""
RACE_SPEEDS = (15.0, 340.0)
"""The speeds of aircraft in a race, m/s; they distinguish units that differ by a factor of 1000."""
FLIGHT_SPEEDS = (2.0, 1000.0)
"""The speeds of aircraft, m/s."""
STRAYS_MAX = 5
"""The number of samples in a row, with wrong times while those around them agree, that are left out at least."""
STEP_BACK_SAMPLES = 2000
"""The number of samples around a step back in which its end is looked for."""
STEPS_BACK_WORK = 2_000_000
"""The number of samples that are looked at for all steps back of a log."""

JUMP_MIN, JUMP_STEPS = 1.0, 5.0
"""The least step of a clock that jumps, s, and in terms of the usual one."""
JUMP_SHARE = 0.3
"""The share by which the way across a jump may differ from that of a usual step."""
JUMP_NEIGHBOURS = 4
"""The number of steps before and after it whose velocity counts."""
CUT_MIN = 0.05
"""The least step of times that are cut off, s."""
UNEVEN_SHARE = 0.2
"""The share of steps that are not the usual one from which on samples are not taken on the clock's own steps."""
CUT_SCATTER = 0.12
"""The relative change of speed from sample to sample from which on times are cut off. On optima with vertical turns,
sampled every 1 to 3 s, it is 0.09 at most (median of a log), and 0.15 at least where such times are cut to seconds."""
PULL = 9.0
"""The standard deviation of the acceleration along the path, by thrust and drag, m/s^2."""
ENERGY_TIME = 3.0
"""The time over which the energy of the aircraft is averaged, s."""
REPAIRS = 3
"""The number of times that the energy follows from repaired times, and these from it."""
CUT_ROUNDING = 1e-6
"""The share of a step by which a time may lie before it."""
WAY_MIN = 1.0
"""The way between two samples below which it says nothing of their times, m."""


def guess_notation(text: str) -> str:
    """Return how a time is written: `iso`, `dated` (13.04.2014 hh:mm:ss), `clock` (hh:mm:ss) or `number`."""
    if _ISO.match(text):
        return "iso"
    return "dated" if _DATED.fullmatch(text) else "clock" if ":" in text else "number"


def parse_time(notation: str, text: str, zone: tzinfo | None) -> float:
    """Return seconds, or the number where times count in a unit that is found out later.

    Raises:
        ValueError: the text is no such time.
    """
    if notation == "iso":
        return iso_seconds(text, zone)
    if notation == "clock":
        return _clock_seconds(text)
    if notation == "dated":
        if (match := _DATED.fullmatch(text)) is None:
            raise ValueError(text)
        return date_seconds(match[1], "", zone) + _clock_seconds(match[2])
    if notation == "hhmmss":
        integer, _, decimals = text.partition(".")
        digits = f"{int(integer):06d}"
        return _clock_seconds(f"{digits[:-4]}:{digits[-4:-2]}:{digits[-2:]}.{decimals or 0}")
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(text)
    return value


def _clock_seconds(text: str) -> float:
    if match := _CLOCK.fullmatch(text):
        hours, minutes, seconds = int(match[1]), int(match[2]), float((match[3] or "0").replace(",", "."))
        if match[4]:
            hours = hours % 12 + 12 * (match[4] in "Pp")
        if hours <= 24 and minutes <= 59 and seconds < 61.0:
            return 3600.0 * hours + 60.0 * minutes + seconds
    raise ValueError(text)


def iso_seconds(text: str, zone: tzinfo | None) -> float:
    """Return the seconds since 1970 of an ISO 8601 time; where it names no zone, in the given one or UTC.

    A leap second is the second behind the one before.

    Raises:
        ValueError: it is no such time.
    """
    when, leaps = _iso_time(text)
    return (when if when.tzinfo is not None else when.replace(tzinfo=zone or UTC)).timestamp() + leaps


def names_zone(text: str) -> bool:
    """Return whether an ISO 8601 time names its zone."""
    return _iso_time(text)[0].tzinfo is not None


def _iso_time(text: str) -> tuple[datetime, int]:
    """Return a time, and 1 where it is the leap second behind it."""
    plain, leaps = _LEAP.subn(":59", text, count=1)
    return datetime.fromisoformat(plain), leaps


def date_seconds(text: str, order: str, zone: tzinfo | None) -> float:
    """Return the seconds since 1970 at which a day begins.

    Args:
        text: `2014-04-13`, `13.4.14`, `130414`, `20140413`.
        order: of its numbers, of `DATE_ORDERS`; empty to take the day first unless it cannot be.
        zone: of the day; None for UTC.

    Raises:
        ValueError: it is no such date.
    """
    parts = re.findall(r"\d+", text)
    if len(parts) == 1 and len(parts[0]) in (6, 8):
        digits, size = parts[0], len(parts[0]) - 4
        order = order or ("ymd" if size == 4 and digits[:2] in ("19", "20") else "dmy")
        cuts = (0, size, size + 2) if order == "ymd" else (0, 2, 4)
        parts = [digits[begin:end] for begin, end in zip(cuts, (*cuts[1:], len(digits)), strict=True)]
    if len(parts) != 3:
        raise ValueError(text)
    if len(parts[0]) == 4:
        order = "ymd"
    elif not order:
        order = "mdy" if int(parts[1]) > 12 else "dmy"
    numbers = dict(zip(order, map(int, parts), strict=True))
    year = numbers["y"]
    if year < 100:
        year += 2000 if year < 80 else 1900
    return datetime(year, numbers["m"], numbers["d"], tzinfo=zone or UTC).timestamp()


def offset_seconds(text: str) -> float:
    """Return the seconds by which local times are ahead of UTC, as `-04:00` tells them.

    Raises:
        ValueError: the text is no such offset.
    """
    seconds = _clock_seconds(text.lstrip("+-"))
    return -seconds if text.startswith("-") else seconds


def instant(seconds: float) -> datetime | None:
    """Return the instant so many seconds after 1970; None where no calendar reaches."""
    with contextlib.suppress(OverflowError, OSError, ValueError):
        return datetime.fromtimestamp(seconds, UTC)


def unwrap_days(seconds: Array) -> Array:
    """Return times of a clock that begins again at midnight, s, without these jumps.

    A single time that is wrong by half a day returns as it has come, and so is no midnight.
    """
    return np.unwrap(seconds, period=DAY)


def find_tick(path: str, time: Array, places: Array, unit: str, column: str) -> tuple[float, tuple[str, ...]]:
    """Return what numbers that count time count in, s, by the speed that they make of the way, and remarks.

    Args:
        path: of the log, for messages.
        time: as the numbers stand, shape (n,).
        places: north and east, m, shape (2, n); NaN where they are not known.
        unit: that the log or its mapping names, of `TICKS`; empty where none is named.
        column: of the time, for messages.

    Raises:
        InputError: the unit that is named cannot be true.
    """
    speed = usual_speed(time, places)
    if math.isnan(speed):  # nothing moves, but numbers that count from 1970 show their unit by their size
        large = float(np.median(np.abs(time)))
        likely = next((name for name, tick in TICKS.items() if large * tick < SINCE_1970_MAX), "s")
        return TICKS[unit or likely], ()
    low, high = FLIGHT_SPEEDS if unit else RACE_SPEEDS
    fitting = [name for name, tick in TICKS.items() if RACE_SPEEDS[0] <= speed / tick <= RACE_SPEEDS[1]]
    named = unit or "s"
    if low <= speed / TICKS[named] <= high or not fitting:
        return TICKS[named], ()
    likely = fitting[0]
    if unit:
        seconds = (time[-1] - time[0]) * TICKS[unit]
        spans = f"{seconds / DAY:.0f} days" if abs(seconds) > 2.0 * DAY else f"{plain_number(seconds)} s"
        refuse(
            path,
            0,
            f"spans {spans} and moves at {plain_number(speed / TICKS[unit], 2)} m/s; are its times {likely}? "
            f"Then say --column 'time={column} [{likely}]'",
            column,
        )
    return TICKS[likely], (f"times are taken as {likely}: so the aircraft flies at {speed / TICKS[likely]:.0f} m/s",)


def usual_speed(time: Array, places: Array) -> float:
    """Return the median speed over so many samples that some hundred metres are covered; NaN where nothing moves."""
    finite = np.flatnonzero(np.isfinite(places).all(axis=0))
    finite = finite[:: max(1, len(finite) // ROWS_MAX)]
    time, places = time[finite], places[:, finite]
    lag = 1
    while lag < len(time):
        way = np.linalg.norm(places[:, lag:] - places[:, :-lag], axis=0)
        took = time[lag:] - time[:-lag]
        moving = (way > MOVED_MIN) & (way < 100.0 * MOVED_MIN) & (took > 0.0)
        if np.count_nonzero(moving) >= 5 * lag:  # one leap makes as many pairs as the lag has samples
            return float(np.median(way[moving] / took[moving]))
        lag *= 2
    return math.nan


def true_times(path: str, time: Array, lines: NDArray[np.int64]) -> tuple[NDArray[np.bool_], tuple[str, ...]]:
    """Return which samples have times that run forwards, and remarks on the others.

    Single times that fit neither of their neighbours are wrong. Where time runs back for good the recorder began
    again, or its clock was set; the longest part counts.

    Args:
        path: of the log, for messages.
        time: s, shape (n,).
        lines: of the samples, likewise.

    Raises:
        InputError: time runs back almost everywhere.
    """
    keep, cuts, work = np.ones(len(time), bool), [0], 0
    steps = np.diff(time)
    back = (np.flatnonzero(steps < 0.0) + 1).tolist()
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    for row in back:
        if not keep[row]:
            continue
        before = row - 1
        while before > cuts[-1] and not keep[before]:
            before -= 1
        if not keep[before] or time[before] <= time[row]:
            continue
        late = early = 0  # samples that are late behind their neighbours, and early before them
        while late < STEP_BACK_SAMPLES and row + late < len(time) and time[row + late] < time[before]:
            late += 1
        returns = row + late < len(time)
        last = before
        while early < STEP_BACK_SAMPLES and last >= cuts[-1] and (not keep[last] or time[last] > time[row]):
            early += int(keep[last])
            last -= 1
        work += late + before - last
        if work > STEPS_BACK_WORK:
            refuse(path, int(lines[row]), "time runs backwards again and again; a log must be in the order of its time")
        step_back = float(time[before] - time[row])
        if not returns and late > STRAYS_MAX:
            late = STEP_BACK_SAMPLES
        fewer = min(early, late)
        if (fewer > STRAYS_MAX and fewer * usual > 0.5 * step_back) or fewer >= STEP_BACK_SAMPLES:
            cuts.append(row)
        elif late <= early:
            keep[row : row + late] = False
        else:
            keep[last + 1 : row] = False
    remarks: list[str] = []
    if not keep.all():
        first = int(lines[np.flatnonzero(~keep)[0]])
        left = count_of(int((~keep).sum()), "sample")
        remarks.append(f"{left} left out for times that do not fit those around them, the first one in line {first}")
    if len(cuts) > 1:
        parts = list(zip(cuts, [*cuts[1:], len(time)], strict=True))
        begin, end = max(parts, key=lambda part: int(keep[part[0] : part[1]].sum()))
        keep[:begin] = keep[end:] = False
        where = ", ".join(str(lines[row]) for row in cuts[1:4])
        remarks.append(
            f"time runs backwards for good in line {where}: only the longest part is read, lines {lines[begin]} to "
            f"{lines[end - 1]}"
        )
    return keep, tuple(remarks)


def repair_jumps(time: Array, places: Array, lines: NDArray[np.int64]) -> tuple[Array, tuple[str, ...]]:
    """Return times without the jumps of a clock that goes on otherwise, and remarks.

    Where a step in time is long, but the aircraft moves on as it does in a usual step, with the speed and in the
    direction of its neighbours, the clock has jumped: nothing that flies waits there. A gap after which it is elsewhere
    stays.

    Args:
        time: s, rising, shape (n,).
        places: north and east, m, shape (2, n); NaN where they are not known.
        lines: of the samples, shape (n,).
    """
    finite = np.flatnonzero(np.isfinite(places).all(axis=0))
    if len(finite) < 2 * JUMP_NEIGHBOURS:
        return time, ()
    steps, ways = np.diff(time[finite]), np.diff(places[:, finite])
    usual, repaired, remarks = float(np.median(steps)), time, list[str]()
    for row in np.flatnonzero(steps > max(JUMP_MIN, JUMP_STEPS * usual)).tolist():
        around = [*range(row - JUMP_NEIGHBOURS, row), *range(row + 1, row + 1 + JUMP_NEIGHBOURS)]
        around = [step for step in around if 0 <= step < len(steps) and 0.0 < steps[step] < JUMP_STEPS * usual]
        if len(around) < JUMP_NEIGHBOURS:
            continue
        velocity = np.median(ways[:, around] / steps[around], axis=1)
        speed = float(np.hypot(*velocity))
        took = float(np.hypot(*ways[:, row])) / max(speed, RACE_SPEEDS[0])
        aside = float(np.hypot(*(ways[:, row] - velocity * took)))
        if speed < RACE_SPEEDS[0] or abs(took - usual) > JUMP_SHARE * usual or aside > JUMP_SHARE * speed * took:
            continue
        jump = float(steps[row]) - usual
        repaired = np.where(time >= time[finite[row + 1]], repaired - jump, repaired)
        moved = float(np.hypot(*ways[:, row]))
        remarks.append(
            f"the clock jumps by {jump:.3f} s in line {lines[finite[row + 1]]} while the aircraft moves {moved:.0f} m: "
            f"times behind it are taken {jump:.3f} s earlier"
        )
    return repaired, tuple(remarks)


def cut_step(time: Array, places: Array) -> float:
    """Return the step to which times are cut off that were not taken on it, s; 0 where there is none.

    Recorders that cut times to whole seconds but do not measure on them show it: seconds hold several samples, but not
    all as many; or steps are uneven, and the speed from sample to sample scatters as no aircraft's does. Neither the
    speed over ground nor that in space at one height, by the energy, may explain the steps.

    Args:
        time: s, not falling, shape (n,).
        places: north, east and up, m, shape (3, n), or (2, n) without heights; NaN where they are not known.
    """
    placed = np.isfinite(places[:2]).all(axis=0)
    time, places = time[placed], places[:, placed]
    step = resolution(time)
    if step < CUT_MIN:
        return 0.0
    first = np.flatnonzero(np.diff(time, prepend=-np.inf) > 0.0)
    counts, steps = np.diff(first, append=len(time)), np.diff(time[first])
    if counts[counts > 1].sum() > 0.5 * len(time):
        return step if np.ptp(counts[1:-1]) > 0 else 0.0
    uneven = np.mean(np.abs(steps - np.median(steps)) > 0.25 * step)  # the median may lie between two steps
    if uneven <= UNEVEN_SHARE:
        return 0.0
    space = _in_space(places)[:, first]
    height = 0.5 * (space[2, 1:] + space[2, :-1])
    kinetic = 0.5 * (np.linalg.norm(np.diff(space), axis=0) / steps) ** 2
    level = np.sqrt(2.0 * np.maximum(kinetic + g0 * (height - np.median(height)), 0.0))
    over_ground = np.hypot(*np.diff(space[:2])) / steps
    scatter = min(
        float(np.median(np.abs(np.diff(speed)))) / max(float(np.median(speed)), RACE_SPEEDS[0])
        for speed in (level, over_ground)
    )
    return step if scatter > CUT_SCATTER else 0.0


def repair_cut(time: Array, places: Array, step: float) -> tuple[Array, Array, Array]:
    """Return times that were cut off as the way tells them, their standard deviations, s, and those of the relative
    rate of this clock, each of shape (n,).

    The first sample with each time was taken within the step, or within the usual time between two samples, behind it.
    From one such sample to the next thrust and drag change the speed little, and height changes it as the energy tells.
    With `t_i` for their true times, `z_i` and `s_i` for the middles and the deviations of these intervals, `d_i` for
    the way in space to the next one, `v_i` for the speed that the energy, averaged over some seconds, gives at the
    height there, and `u_i` for `v_i (t_(i+1) - t_i) / d_i`,

        sum_i (t_i - z_i)^2 / s_i^2 + sum_i (u_i - u_(i-1))^2 / q_i^2  ->  min

    where `q_i` is `PULL` over `v_i` times the time between the middles of both ways. What is between these samples
    follows from its share of the way. Where a time comes to lie far outside its interval, the way does not tell the
    times: they are returned as they came, with the deviation of a time anywhere within a step.

    Args:
        time: s, rising, shape (n,), with the whole step before each.
        places: north, east and up, m, shape (3, n), or (2, n) without heights; only heights may be NaN.
        step: s.
    """
    usual = (time[-1] - time[0]) / (len(time) - 1)
    unknown = np.full(len(time), step / math.sqrt(12.0))
    unrepaired = time, unknown, math.sqrt(2.0) * unknown / max(step, usual)
    stamps = np.floor(time / step + CUT_ROUNDING) * step
    space = _in_space(places)
    ways = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(space), axis=0))])
    first = np.flatnonzero(np.diff(stamps, prepend=-np.inf) > 0.0)
    counts = np.diff(first, append=len(time))
    apart = np.diff(ways[first], prepend=-np.inf) > WAY_MIN
    first, counts = first[apart], counts[apart]
    if len(first) < 3:
        return unrepaired
    within = np.minimum(np.maximum(step / counts, usual), step)  # where samples are missing the first one may be late
    within[0] = step  # the log may begin anywhere
    middle, certainty = stamps[first] + 0.5 * within, 12.0 / within**2
    way, took = np.diff(ways[first]), np.diff(stamps[first])
    between = 0.5 * (took[1:] + took[:-1])
    height = 0.5 * (space[2, first[1:]] + space[2, first[:-1]])
    true, rows = middle, np.arange(len(first) - 2)
    covariance = np.diag(1.0 / certainty)
    for _ in range(REPAIRS):
        speed = _speed_by_energy(true, way, height)
        change = PULL * between / (0.5 * (speed[1:] + speed[:-1]))
        slowness, slower = speed / way, np.zeros((len(rows), len(first)))
        slower[rows, rows] = slowness[:-1]
        slower[rows, rows + 1] = -slowness[:-1] - slowness[1:]
        slower[rows, rows + 2] = slowness[1:]
        covariance = np.linalg.inv(np.diag(certainty) + slower.T @ (slower / change[:, None] ** 2))
        true = covariance @ (certainty * middle)
        if (np.diff(true) <= 0.0).any() or (np.abs(true - middle) > within).any():
            return unrepaired
    variance = np.diag(covariance)
    steps = np.sqrt(variance[1:] + variance[:-1] - 2.0 * np.diag(covariance, 1))
    centres = 0.5 * (ways[first[1:]] + ways[first[:-1]])
    return (
        _along(ways, ways[first], true),
        np.interp(ways, ways[first], np.sqrt(variance)),
        np.interp(ways, centres, steps / np.diff(true)),
    )


def _in_space(places: Array) -> Array:
    """Return places with heights everywhere, m, shape (3, n): between those that are known, and 0 where none is."""
    heights = places[2] if len(places) > 2 else np.full(places.shape[1], np.nan)
    known = np.flatnonzero(np.isfinite(heights))
    filled = np.interp(np.arange(len(heights)), known, heights[known]) if len(known) else np.zeros(len(heights))
    return np.stack([places[0], places[1], filled])


def _speed_by_energy(time: Array, way: Array, height: Array) -> Array:
    """Return the speeds on the ways between some times by the energy around them, m/s.

    Args:
        time: s, shape (n,).
        way: between them, m, shape (n - 1,).
        height: on these ways, m, likewise.
    """
    energy = 0.5 * (way / np.diff(time)) ** 2 + g0 * height
    centres = 0.5 * (time[1:] + time[:-1])
    weights = np.exp(-0.5 * ((centres[:, None] - centres) / ENERGY_TIME) ** 2) * way
    kinetic = weights @ energy / weights.sum(axis=1) - g0 * height
    return np.sqrt(2.0 * np.maximum(kinetic, 0.5 * RACE_SPEEDS[0] ** 2))


def _along(ways: Array, known: Array, times: Array) -> Array:
    """Return the times at some ways by those at known ones, between which they rise smoothly, and straight outside."""
    from scipy.interpolate import PchipInterpolator  # every command loads this module, and few repair a clock

    inside = np.asarray(PchipInterpolator(known, times)(np.clip(ways, known[0], known[-1])), np.float64)
    before, behind = (np.diff(times) / np.diff(known))[[0, -1]]
    return inside + before * np.minimum(ways - known[0], 0.0) + behind * np.maximum(ways - known[-1], 0.0)


def spread_repeated(time: Array, step: float = 0.0) -> tuple[Array, tuple[str, ...]]:
    """Return times of which several samples share each one spread over the time to the next, and a remark.

    Recorders of 5 Hz that write whole seconds do so. Where most samples have a time of their own nothing is changed,
    unless times are known to be cut off; then how they are spread is no matter of a remark.

    Args:
        time: s, not falling, shape (n,).
        step: to which times are cut off, s; 0 where they are not known to be.
    """
    starts = np.flatnonzero(np.diff(time, prepend=-np.inf) > 0.0)
    counts = np.diff(starts, append=len(time))
    if step > 0.0:
        group = np.repeat(np.arange(len(starts)), counts)
        return time + (np.arange(len(time)) - starts[group]) * step / counts[group], ()
    if len(starts) < 2 or counts[counts > 1].sum() <= 0.5 * len(time):
        return time, ()
    often = np.bincount(counts)
    usual = len(often) - 1 - int(np.argmax(often[::-1]))
    if usual < 2:
        return time, ()
    step = float(np.min(np.diff(time[starts])))
    group = np.repeat(np.arange(len(starts)), counts)
    place = np.arange(len(time)) - starts[group]
    place[group == 0] += max(usual - int(counts[0]), 0)  # what is missing in the first one was not recorded yet
    share = step / np.maximum(np.append(counts, usual)[group], usual)
    remark = f"{usual} samples share each time: they are spread evenly over it"
    return time + place * share, (remark,)
