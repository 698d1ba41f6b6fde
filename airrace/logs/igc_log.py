"""Logs as IGC files of flight recorders: the B records, with the additions that their I record declares.

The format is that of the FAI's technical specification for GNSS flight recorders, appendix A.
"""

import math
import re
from array import array
from collections.abc import Iterable
from datetime import UTC, datetime

import numpy as np

from airrace.logs.recording import DAY, Recording, first_backwards, instant, refuse, unwrapped

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
    reader = _IgcReader(path)
    for number, line in enumerate(lines, start=1):
        reader.take(number, line.rstrip())
    return reader.recording()


class _IgcReader:
    def __init__(self, path: str) -> None:
        self._path = path
        self._rows = tuple(array("d") for _ in range(5))
        self._lines = array("q")
        self._additions: dict[str, tuple[int, int]] = {}
        self._day: float | None = None
        self._flat = 0

    def take(self, number: int, line: str) -> None:
        """Take a record; those that say nothing of the flight path are passed over."""
        if found := _DATE.match(line):
            self._day = self._day_of(number, *(int(one) for one in found.groups()))
        elif line.startswith("I"):
            self._additions = {code: (int(first) - 1, int(last)) for first, last, code in _ADDITION.findall(line[3:])}
        elif line.startswith("B"):
            self._fix(number, line)

    def _day_of(self, number: int, day: int, month: int, year: int) -> float:
        try:
            return datetime(2000 + year if year < 80 else 1900 + year, month, day, tzinfo=UTC).timestamp()
        except ValueError:
            refuse(self._path, number, f"{day:02}{month:02}{year:02} is no date (day, month, year)")

    def _fix(self, number: int, line: str) -> None:
        found = _FIX.match(line)
        if not found:
            refuse(self._path, number, f"is no fix of a flight recorder: `{line[:40]}`; expected BHHMMSSDDMMmmmN...")
        hours, minutes, seconds, south, north, ns, east, rest, ew, _, baro, gnss = found.groups()
        latitude = float(south) + float(north) / 60000.0
        longitude = float(east) + float(rest) / 60000.0
        time = 3600.0 * int(hours) + 60.0 * int(minutes) + int(seconds) + self._fraction(line)
        values = (
            time,
            math.radians(latitude if ns == "N" else -latitude) + self._finer(line, "LAD"),
            math.radians(longitude if ew == "E" else -longitude) + self._finer(line, "LOD"),
            float(gnss),
            float(baro),
        )
        for column, value in zip(self._rows, values, strict=True):
            column.append(value)
        self._lines.append(number)

    def _digits(self, line: str, code: str) -> str:
        first, last = self._additions.get(code, (0, 0))
        text = line[first:last]
        return text if text.isdigit() else ""

    def _fraction(self, line: str) -> float:
        """Return the decimals of the second, where they are recorded."""
        text = self._digits(line, "TDS")
        return float(f"0.{text}") if text else 0.0

    def _finer(self, line: str, code: str) -> float:
        """Return the further decimals of the minutes of an angle, rad; away from the equator and from Greenwich."""
        text = self._digits(line, code)
        size = math.radians(float(f"0.{text}") / 60000.0) if text else 0.0
        negative = "S" in line[7:15] if code == "LAD" else "W" in line[15:24]
        return -size if negative else size

    def recording(self) -> Recording:
        """Return all fixes.

        Raises:
            InputError: there are none, or time runs backwards.
        """
        if len(self._lines) < 2:
            refuse(self._path, 0, "holds no fixes (B records)")
        clock, latitude, longitude, gnss, baro = (np.array(one, np.float64) for one in self._rows)
        lines, time = np.array(self._lines, np.int64), unwrapped(clock)
        if (row := first_backwards(time)) is not None:
            refuse(self._path, int(lines[row]), "time runs backwards; fixes must be in the order of their time")
        barometric = not np.any(gnss)
        columns = {"latitude": latitude, "longitude": longitude, "altitude": baro if barometric else gnss}
        remarks = ["heights are those of the barometer, in the standard atmosphere"] if barometric else []
        if "TDS" not in self._additions:
            remarks.append("times are whole seconds, as this recorder writes them")
        begins = None if self._day is None else instant(self._day + float(clock[0]) % DAY)
        return Recording(self._path, "igc", time - time[0], columns, lines, begins, tuple(remarks))
