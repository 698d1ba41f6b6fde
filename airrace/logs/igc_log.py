"""Logs as IGC files of flight recorders: the B records, with the additions that their I record declares.

The format is that of the FAI's technical specification for GNSS flight recorders, appendix A.
"""

import math
import re
from collections.abc import Iterable
from datetime import UTC, datetime

import numpy as np

from airrace.logs.recording import DAY, Recording, SampleTable, instant, refuse, unwrapped

_FIX = re.compile(r"B(\d\d)(\d\d)(\d\d)(\d\d)(\d{5})([NS])(\d{3})(\d{5})([EW])([AV])(-\d{4}|\d{5})(-\d{4}|\d{5})")
_DATE = re.compile(r"H[FOP]DTE(?:DATE)?:?\s*(\d\d)(\d\d)(\d\d)")
_ADDITION = re.compile(r"(\d\d)(\d\d)([A-Z]{3})")


def read_igc(path: str, lines: Iterable[str]) -> Recording:
    """Return the fixes of an IGC file; heights are those of the satellites, those of the barometer where they are zero.

    Args:
        path: of the file, for messages.
        lines: of the file.

    Raises:
        InputError: it holds no fixes, or one of them is damaged.
    """
    samples = SampleTable(path, 5)
    additions: dict[str, tuple[int, int]] = {}
    day: float | None = None
    for number, line in enumerate(map(str.rstrip, lines), start=1):
        if found := _DATE.match(line):
            day = _date(path, number, *(int(one) for one in found.groups()))
        elif line.startswith("I"):
            additions = {code: (int(first) - 1, int(last)) for first, last, code in _ADDITION.findall(line[3:])}
        elif line.startswith("B"):
            fix = _FIX.match(line)
            if not fix:
                refuse(path, number, f"is no fix of a flight recorder: `{line[:40]}`; expected BHHMMSSDDMMmmmN...")
            more = {code: text for code, (first, last) in additions.items() if (text := line[first:last]).isdigit()}
            samples.append(number, *_fix_values(fix, more))
    lines_of, (clock, latitude, longitude, gnss, baro) = samples.arrays("holds no fixes (B records)")
    time = unwrapped(clock)
    samples.ensure_rising(time, "time runs backwards; fixes must be in the order of their time")
    barometric = not np.any(gnss)
    columns = {"latitude": latitude, "longitude": longitude, "altitude": baro if barometric else gnss}
    remarks = ["heights are those of the barometer, in the standard atmosphere"] if barometric else []
    if "TDS" not in additions:
        remarks.append("times are whole seconds, as this recorder writes them")
    begins = None if day is None else instant(day + float(clock[0]) % DAY)
    return Recording(path, "igc", time - time[0], columns, lines_of, begins, tuple(remarks))


def _date(path: str, line: int, day: int, month: int, year: int) -> float:
    try:
        return datetime(2000 + year if year < 80 else 1900 + year, month, day, tzinfo=UTC).timestamp()
    except ValueError:
        refuse(path, line, f"{day:02}{month:02}{year:02} is no date (day, month, year)")


def _fix_values(fix: re.Match[str], more: dict[str, str]) -> tuple[float, ...]:
    """Return time of day (s), latitude and longitude (rad), and the heights of satellites and barometer (m).

    `more` holds the further digits of the second (TDS) and of the minutes of both angles (LAD, LOD).
    """
    hours, minutes, seconds, south, north, ns, east, rest, ew, _, baro, gnss = fix.groups()
    fraction, latitude, longitude = (float(f"0.{more.get(code, '0')}") for code in ("TDS", "LAD", "LOD"))
    latitude = math.radians(float(south) + float(north) / 60000.0) + math.radians(latitude / 60000.0)
    longitude = math.radians(float(east) + float(rest) / 60000.0) + math.radians(longitude / 60000.0)
    time = 3600.0 * int(hours) + 60.0 * int(minutes) + int(seconds) + fraction
    signs = 1.0 if ns == "N" else -1.0, 1.0 if ew == "E" else -1.0
    return time, signs[0] * latitude, signs[1] * longitude, float(gnss), float(baro)
