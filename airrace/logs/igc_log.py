"""IGC files, by the FAI's technical specification for GNSS flight recorders, appendix A."""

import math
import re
from collections.abc import Iterable
from datetime import UTC, datetime

import numpy as np

from airrace.logs.clocks import instant, unwrap_days
from airrace.logs.recording import LIMITS, Recording, SampleTable, count_of, refuse
from airrace.trajectory import Array

FIX = re.compile(r"B(\d\d)(\d\d)(\d\d)(\d\d)(\d{5})([NS])(\d{3})(\d{5})([EW])([AV])(-\d{4}|\d{5})(-\d{4}|\d{5})")
"""A fix: time of day, latitude, longitude, validity, the heights of barometer and satellites."""
_DATE = re.compile(r"H[FOP]DTE(?:DATE)?:?\s*(\d\d)(\d\d)(\d\d)")
_ADDITION = re.compile(r"(\d\d)(\d\d)([A-Z]{3})")
_MISSING = 5.0
"""How far from what the others tell a height of zero is none, m."""


def read_igc(path: str, lines: Iterable[str]) -> Recording:
    """Return the fixes (B records) of an IGC file, with the additions that its I record declares.

    Heights are those of the satellites, those of the barometer where all are zero. A fix that is no fix in space (`V`)
    is left out, unless most are. The first date counts for the first fix.

    Args:
        path: of the file, for messages.
        lines: of the file.

    Raises:
        InputError: it holds no fixes, or none that can be read.
    """
    samples = SampleTable(path, 6, "fix")
    additions: dict[str, tuple[int, int]] = {}
    date: float | None = None
    for number, line in enumerate(map(str.strip, lines), start=1):
        if line.startswith("B"):
            fix = FIX.match(line)
            values = None if fix is None else _fix_values(fix, line, additions)
            if values is None:
                message = f"is no fix of a flight recorder: `{line[:40]}`; expected BHHMMSSDDMMmmmN..."
                samples.leave_out(number, message)
            else:
                samples.append(number, *values)
        elif line.startswith("I"):
            additions = {code: (int(first) - 1, int(last)) for first, last, code in _ADDITION.findall(line[3:])}
        elif date is None and (found := _DATE.match(line)):
            day, month, year = (int(one) for one in found.groups())
            try:
                date = datetime(2000 + year if year < 80 else 1900 + year, month, day, tzinfo=UTC).timestamp()
            except ValueError:
                samples.leave_out(number, f"{day:02}{month:02}{year:02} is no date (day, month, year)", "HFDTE")
        if number - len(samples.lines) > LIMITS.idle:
            refuse(path, number, f"has more than {LIMITS.idle} lines without a fix; cut the log to the flight")
    numbers, (clock, latitude, longitude, gnss, baro, valid) = samples.arrays("holds no fixes (B records)")
    remarks = list(samples.remarks)
    if not np.any(gnss):
        remarks.append("heights are those of the barometer, in the standard atmosphere")
        altitude, barometric = baro, True
    else:
        altitude, barometric = _with_missing(gnss, baro, remarks), False
    if "TDS" not in additions:
        remarks.append("times are whole seconds, as this recorder writes them")
    time = unwrap_days(clock)
    begins = None if date is None else instant(date + float(clock[0]) % 86400.0)
    columns = {"latitude": latitude, "longitude": longitude, "altitude": altitude}
    found = Recording(path, "igc", time - time[0], columns, numbers, begins, barometric=barometric)
    flat = valid < 0.5
    if 0 < flat.sum() <= 0.5 * len(flat):
        remarks.append(f"{count_of(int(flat.sum()), 'fix')} left out as not valid (`V`)")
        found = found.select(~flat)
    return found.select(np.ones(len(found.time), bool), *remarks)


def _fix_values(fix: re.Match[str], line: str, additions: dict[str, tuple[int, int]]) -> tuple[float, ...] | None:
    """Return time of day (s), latitude, longitude (rad), heights of satellites and barometer (m), 1 where it is valid.

    Additions are the further digits of the second (TDS) and of the minutes of both angles (LAD, LOD). None where a
    fix names no place on the globe, or no time.
    """
    more = {code: text for code, (first, last) in additions.items() if (text := line[first:last]).isdecimal()}
    hours, minutes, seconds, south, north, ns, east, rest, ew, validity, baro, gnss = fix.groups()
    fraction, lad, lod = (float(f"0.{more.get(code, '0')}") for code in ("TDS", "LAD", "LOD"))
    angles = int(south) + (int(north) + lad) / 60000.0, int(east) + (int(rest) + lod) / 60000.0
    if angles[0] > 90.0 or angles[1] > 180.0 or int(hours) > 24 or int(minutes) > 59 or int(seconds) > 60:
        return None
    latitude, longitude = (math.radians(one) for one in angles)
    signs = 1.0 if ns == "N" else -1.0, 1.0 if ew == "E" else -1.0
    time = 3600.0 * int(hours) + 60.0 * int(minutes) + int(seconds) + fraction
    return time, signs[0] * latitude, signs[1] * longitude, float(gnss), float(baro), float(validity == "A")


def _with_missing(gnss: Array, baro: Array, remarks: list[str]) -> Array:
    """Return the heights of the satellites, NaN where they are zero although the barometer tells another height."""
    zero, place = gnss == 0.0, np.arange(len(gnss))
    if not zero.any():
        return gnss
    others = ~zero
    expected = np.interp(place, place[others], gnss[others])
    if np.any(baro):
        expected = baro + np.median((gnss - baro)[others])
    missing = zero & (np.abs(expected) > _MISSING)
    if missing.any():
        remarks.append(f"{count_of(int(missing.sum()), 'fix')} without a height of the satellites")
    return np.where(missing, np.nan, gnss)
