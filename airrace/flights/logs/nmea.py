"""NMEA 0183: the sentences of a receiver, RMC, GGA and GNS, with GSA and GST for its accuracy and ZDA for the date.

Sentences of one time make one sample, whichever talkers they are of; only those with a position begin one: a receiver
may send the date (ZDA) or the accuracy (GST) of another second between them. One whose checksum is wrong is left out
and counted, and so is one without a checksum in a file whose first sentence has one.
"""

import math
import re
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from airrace.flights.logs.angles import packed_degrees
from airrace.flights.logs.clocks import DAY, date_seconds, instant, parse_time, unwrap_days
from airrace.flights.logs.quality import FixType, fix_type
from airrace.flights.logs.recording import IDLE_MAX, Recording, SampleTable, refuse
from airrace.optimal_control.quantities import KNOT

_SENTENCE = re.compile(r"\$(?P<content>[A-Z]{2}(?P<kind>[A-Z]{3}),[^*$]*)(?:\*(?P<sum>\w{2}))?")
POSITION = re.compile(r"\$[A-Z]{2}(RMC|GGA|GNS),")
"""A sentence with a position; a logger may have put a time before it."""
_PLACED = ("RMC", "GGA", "GNS")
_TIMED = (*_PLACED, "GST", "ZDA")
_COLUMNS = ("latitude", "longitude", "altitude", "V_G", "fix_type", "satellites")
_QUALITY = ("hdop", "vdop", "pdop", "h_acc", "v_acc")
_MODES = {"R": FixType.FIXED, "F": FixType.FLOAT, "P": FixType.SPACE, "D": FixType.DIFFERENTIAL, "A": FixType.SPACE}
"""Fix types by the letters of a GNS sentence, the best first; others are no fixes."""


class _Epoch:
    """What the sentences of one time tell: clock (s), first line, and values by `_COLUMNS` and `_QUALITY`."""

    def __init__(self, time: float, line: int) -> None:
        self.time, self.line, self.values = time, line, dict[str, float]()

    def add(self, values: Mapping[str, float]) -> None:
        """Take what is new; without a fix by one sentence there is none by the others."""
        for name, value in values.items():
            if math.isfinite(value):
                self.values.setdefault(name, value)
        if values.get("fix_type") == FixType.NONE:
            self.values["fix_type"] = float(FixType.NONE)

    def append_to(self, samples: SampleTable) -> None:
        """Become a sample, if it tells of a position."""
        if math.isfinite(self.time) and self.values.keys() & {"latitude", "fix_type"}:
            samples.append(self.line, self.time, *(self.values.get(name, math.nan) for name in _COLUMNS + _QUALITY))


def read_nmea(path: str, lines: Iterable[str]) -> Recording:
    """Return the positions of a receiver, with heights above the sea by GGA or GNS and speeds over ground by RMC.

    Args:
        path: of the file, for messages.
        lines: of the file.

    Raises:
        InputError: it holds no two times with a position, or none with a height.
    """
    faults, samples = SampleTable(path, 0, "sentence"), SampleTable(path, 1 + len(_COLUMNS + _QUALITY))
    epoch, summed = _Epoch(math.nan, 0), None
    dated: tuple[float, float] | None = None  # seconds since 1970 at the begin of a day, and the clock on it
    for number, line in enumerate(lines, start=1):
        if number - len(samples.lines) > IDLE_MAX:
            refuse(path, number, f"has more than {IDLE_MAX} lines without a position; cut the log to the flight")
        if (sentence := _SENTENCE.search(line)) is None:
            continue
        summed = sentence["sum"] is not None if summed is None else summed
        if problem := _problem(sentence, summed=summed):
            faults.leave_out(number, problem, problem.partition(":")[0])
            continue
        kind, fields = sentence["kind"], sentence["content"].strip().split(",")[1:]
        try:
            time = parse_time("hhmmss", fields[0], None) if kind in _TIMED and fields[0] else math.nan
            values, day = _values(kind, fields), _day(kind, fields)
        except (ValueError, IndexError, OverflowError):
            faults.leave_out(number, f"is no {kind} sentence: `{line.strip()[:60]}`", "fields")
            continue
        if kind in _PLACED and math.isfinite(time) and time != epoch.time:
            epoch.append_to(samples)
            epoch = _Epoch(time, number)
        epoch.add(values)
        if dated is None and math.isfinite(time + day):
            dated = day, time
    epoch.append_to(samples)
    if len(samples.lines) < 2:
        faults.refuse_first_fault()
    rows, (time, *columns) = samples.arrays("is NMEA without positions: expected RMC and GGA sentences")
    histories = dict(zip(_COLUMNS + _QUALITY, columns, strict=True))
    if not np.isfinite(histories["altitude"]).any():
        refuse(path, 0, "is NMEA without heights: expected GGA or GNS sentences, beside RMC for the date")
    histories = {name: values for name, values in histories.items() if np.isfinite(values).any()}
    begins = None
    if dated is not None:
        day, clock = dated
        begins = instant(day + clock + math.remainder(float(time[0]) - clock, DAY))
    time = unwrap_days(time)
    return Recording(path, "nmea", time - time[0], histories, rows, begins, faults.remarks)


def parse_sentence(text: str) -> tuple[float, dict[str, float]]:
    """Return the clock of one sentence, s, and what it tells, as `_values`; NaN and nothing where it has no position.

    Raises:
        ValueError: it is damaged.
    """
    sentence = _SENTENCE.search(text)
    if sentence is None:
        raise ValueError("is no sentence")
    if problem := _problem(sentence, summed=sentence["sum"] is not None):
        raise ValueError(problem)
    kind, fields = sentence["kind"], sentence["content"].strip().split(",")[1:]
    if kind not in _PLACED:
        return math.nan, {}
    try:
        return parse_time("hhmmss", fields[0], None), _values(kind, fields)
    except (ValueError, IndexError, OverflowError):
        raise ValueError(f"is no {kind} sentence with a fix") from None


def _problem(sentence: re.Match[str], *, summed: bool) -> str:
    """Return why a sentence is not believed; empty where it is."""
    if not summed:
        return ""
    if sentence["sum"] is None:
        return f"is cut: `{sentence['content'].strip()[:60]}` has no checksum"
    total = 0
    for letter in sentence["content"].encode("utf-8", "replace"):
        total ^= letter
    stated = sentence["sum"].upper()
    return "" if stated == f"{total:02X}" else f"is damaged: its checksum is {total:02X}, and {stated} is stated"


def _values(kind: str, fields: Sequence[str]) -> dict[str, float]:
    """Return what a sentence tells, by the names of histories; NaN where a field is empty.

    Raises:
        ValueError, IndexError: it is no such sentence.
    """
    match kind:
        case "RMC":
            values = _place(fields[2:6]) | {"V_G": KNOT * _number(fields[6])}
            return values if fields[1] == "A" else values | {"fix_type": float(FixType.NONE)}
        case "GGA":
            values = {"fix_type": fix_type(fields[5], "nmea"), "altitude": _number(fields[8])}
        case "GNS":
            modes = [fix for letter, fix in _MODES.items() if letter in fields[5]]
            values = {"fix_type": float(modes[0] if modes else FixType.NONE), "altitude": _number(fields[8])}
        case "GSA":
            return {name: _number(field) for name, field in zip(("pdop", "hdop", "vdop"), fields[14:17], strict=True)}
        case "GST":
            north, east, up = (_number(field) for field in fields[5:8])
            return {"h_acc": math.hypot(north, east) / math.sqrt(2.0), "v_acc": up}
        case _:
            return {}
    return values | _place(fields[1:5]) | {"satellites": _number(fields[6]), "hdop": _number(fields[7])}


def _place(fields: Sequence[str]) -> dict[str, float]:
    """Return the place of `4504.907,N,01336.99,E`, rad."""
    south, north_or_south, west, east_or_west = fields
    if not south or not west:
        return {}
    signs = {"N": 1.0, "S": -1.0}.get(north_or_south), {"E": 1.0, "W": -1.0}.get(east_or_west)
    if signs[0] is None or signs[1] is None:
        raise ValueError(fields)
    latitude, longitude = signs[0] * packed_degrees(south), signs[1] * packed_degrees(west)
    return {"latitude": math.radians(latitude), "longitude": math.radians(longitude)}


def _day(kind: str, fields: Sequence[str]) -> float:
    """Return the seconds since 1970 at which the day of a sentence begins; NaN where it names none."""
    if kind == "RMC" and fields[8]:
        return date_seconds(fields[8], "dmy", None)
    if kind == "ZDA" and all(fields[1:4]):
        return date_seconds("-".join(fields[1:4]), "dmy", None)
    return math.nan


def _number(field: str) -> float:
    return float(field) if field else math.nan
