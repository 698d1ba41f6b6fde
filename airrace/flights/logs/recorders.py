"""The formats of recorders: IGC, Tacview's ACMI and FIT.

IGC is read by the FAI's technical specification for GNSS flight recorders, appendix A; ACMI 2.x as text, in which what
a line leaves out is as in the line before; FIT, of sports watches and cycle computers, by the library fitdecode.
"""

import math
import re
from array import array
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from typing import IO, Any

import numpy as np

from airrace.errors import InputError
from airrace.flights.logs.clocks import instant, unwrap_days
from airrace.flights.logs.recording import (
    IDLE_MAX,
    LINE_MAX,
    OBJECTS_MAX,
    TEXT_MAX,
    Recording,
    SampleTable,
    count_of,
    enumerate_words,
    refuse,
)
from airrace.optimal_control.trajectory import Array
from airrace.runtime.resources import extra

# IGC


FIX = re.compile(r"B(\d\d)(\d\d)(\d\d)(\d\d)(\d{5})([NS])(\d{3})(\d{5})([EW])([AV])(-\d{4}|\d{5})(-\d{4}|\d{5})")
"""A fix: time of day, latitude, longitude, validity, the heights of barometer and satellites."""
_DATE = re.compile(r"H[FOP]DTE(?:DATE)?:?\s*(\d\d)(\d\d)(\d\d)")
_ADDITION = re.compile(r"(\d\d)(\d\d)([A-Z]{3})")
_QUALITY = {"SIU": ("satellites", 1.0), "FXA": ("h_acc", 0.5), "VXA": ("v_acc", 0.5)}
"""Additions of quality: satellites in use, and accuracies, of which 95 % of all errors are within."""
_MISSING = 5.0
"""The distance from the expected height beyond which a height of zero is a missing one, m."""


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
    samples = SampleTable(path, 6 + len(_QUALITY), "fix")
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
        elif date is None and (recording := _DATE.match(line)):
            day, month, year = (int(group) for group in recording.groups())
            try:
                date = datetime(2000 + year if year < 80 else 1900 + year, month, day, tzinfo=UTC).timestamp()
            except ValueError:
                samples.leave_out(number, f"{day:02}{month:02}{year:02} is no date (day, month, year)", "HFDTE")
        if number - len(samples.lines) > IDLE_MAX:
            refuse(path, number, f"has more than {IDLE_MAX} lines without a fix; cut the log to the flight")
    numbers, (clock, latitude, longitude, gnss, baro, valid, *quality) = samples.arrays("holds no fixes (B records)")
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
    for (name, scale), values in zip(_QUALITY.values(), quality, strict=True):
        if np.isfinite(values).any():
            columns[name] = scale * values
    recording = Recording(path, "igc", time - time[0], columns, numbers, begins, barometric=barometric)
    flat = valid < 0.5
    if 0 < flat.sum() <= 0.5 * len(flat):
        remarks.append(f"{count_of(int(flat.sum()), 'fix')} left out as not valid (`V`)")
        recording = recording.select(~flat)
    return recording.select(np.ones(len(recording.time), bool), *remarks)


def _fix_values(fix: re.Match[str], line: str, additions: dict[str, tuple[int, int]]) -> tuple[float, ...] | None:
    """Return time of day (s), latitude, longitude (rad), heights of satellites and barometer (m), 1 where it is valid,
    and its quality.

    Additions are the further digits of the second (TDS) and of the minutes of both angles (LAD, LOD). None where a
    fix names no place on the globe, or no time.
    """
    more = {code: text for code, (first, last) in additions.items() if (text := line[first:last]).isdecimal()}
    hours, minutes, seconds, south, north, ns, east, longitude_minutes, ew, validity, baro, gnss = fix.groups()
    fraction, lad, lod = (float(f"0.{more.get(code, '0')}") for code in ("TDS", "LAD", "LOD"))
    angles = int(south) + (int(north) + lad) / 60000.0, int(east) + (int(longitude_minutes) + lod) / 60000.0
    if angles[0] > 90.0 or angles[1] > 180.0 or int(hours) > 24 or int(minutes) > 59 or int(seconds) > 60:
        return None
    latitude, longitude = (math.radians(angle) for angle in angles)
    signs = 1.0 if ns == "N" else -1.0, 1.0 if ew == "E" else -1.0
    time = 3600.0 * int(hours) + 60.0 * int(minutes) + int(seconds) + fraction
    quality = [float(more.get(code, "nan")) for code in _QUALITY]
    return time, signs[0] * latitude, signs[1] * longitude, float(gnss), float(baro), float(validity == "A"), *quality


def _with_missing(gnss: Array, baro: Array, remarks: list[str]) -> Array:
    """Return the heights of the satellites, NaN where they are zero although the barometer shows another height."""
    zero, place = gnss == 0.0, np.arange(len(gnss))
    if not zero.any():
        return gnss
    recorded = ~zero
    expected = np.interp(place, place[recorded], gnss[recorded])
    if np.any(baro):
        expected = baro + np.median((gnss - baro)[recorded])
    missing = zero & (np.abs(expected) > _MISSING)
    if missing.any():
        remarks.append(f"{count_of(int(missing.sum()), 'fix')} without a height of the satellites")
    return np.where(missing, np.nan, gnss)


# ACMI


_PLACE = ("longitude", "latitude", "altitude", "phi", "theta", "psi")
_PLACE_VALUES = {3: 3, 5: 3, 6: 6, 9: 6}
"""The number of values of a transform that are in `_PLACE`, by the number of all its values."""
_PROPERTIES = {"TAS": "V_A", "IAS": "V_I", "VerticalGForce": "n_z"}
_COLUMNS = (*_PLACE, *_PROPERTIES.values())
_NAMES = ("Name", "CallSign", "Pilot")
_RECORD = re.compile(r"#|-|[0-9a-fA-F]+,")
_COMMON = ("ReferenceTime", "ReferenceLongitude", "ReferenceLatitude")


class _RecordedObject:
    """An object of an ACMI recording: what it is called, its present values by `_COLUMNS`, and its samples."""

    def __init__(self) -> None:
        self.properties: dict[str, str] = {}
        self.now = array("d", [math.nan] * len(_COLUMNS))
        self.samples: SampleTable | None = None

    def update(self, faults: SampleTable, line: int, properties: Mapping[str, str]) -> None:
        """Take the properties of a line as the present values; what cannot be read is counted with the faults."""
        for key, value in properties.items():
            if key == "T":
                parts = value.split("|")
                if len(parts) not in _PLACE_VALUES:
                    message = f"a place has {len(parts)} values; expected 3, 5, 6 or 9"
                    faults.leave_out(line, message, "T", whole=False)
                    continue
                for slot, part in enumerate(parts[: _PLACE_VALUES[len(parts)]]):
                    if part.strip():
                        self.now[slot] = faults.number(line, part, "T")
            elif key in _PROPERTIES:
                self.now[_COLUMNS.index(_PROPERTIES[key])] = faults.number(line, value, key)
            elif key in (*_NAMES, "Type"):
                self.properties[key] = value[:TEXT_MAX]

    @property
    def names(self) -> list[str]:
        """What it is called."""
        return [self.properties[key] for key in _NAMES if key in self.properties]

    @property
    def may_fly(self) -> bool:
        """Whether it is an aircraft, or does not say what it is."""
        return "Type" not in self.properties or "Air" in self.properties["Type"].split("+")

    @property
    def moves(self) -> bool:
        """Whether it was recorded at two times at least."""
        return self.samples is not None and len(set(self.samples.columns[0][:1000])) >= 2


def read_acmi(path: str, lines: Iterable[str], aircraft: str | None = None) -> Recording:
    """Return the flight of one aircraft of an ACMI recording, with those of the others.

    Args:
        path: of the file, for messages.
        lines: of the file.
        aircraft: its name, pilot, call sign or number; None for any.

    Raises:
        InputError: it is no such recording, it is too large, or there is no such aircraft.
    """
    objects: dict[str, _RecordedObject] = {}
    common: dict[str, str] = {}
    read = SampleTable(path, 0)  # of all objects
    time = 0.0
    for number, line in _logical_lines(lines):
        if number - len(read.lines) > IDLE_MAX:
            refuse(path, number, f"has more than {IDLE_MAX} lines without a place; cut the log to the flight")
        if number == 1 and line != "FileType=text/acmi/tacview":
            refuse(path, 1, "is no ACMI recording: expected `FileType=text/acmi/tacview` in the first line")
        if number == 2 and not line.startswith("FileVersion=2."):
            refuse(path, 2, f"expected `FileVersion=2.x`, found `{line[:40]}`")
        if number <= 2 or not line or line.startswith("-"):
            continue
        if line.startswith("#"):
            seconds = read.number(number, line[1:], "#")
            time = time if math.isnan(seconds) else seconds
            continue
        name, *parts = line.replace("\\,", "\0").split(",")  # commas behind a backslash belong to a value
        name = name.strip().lower()[:TEXT_MAX]
        entries = [part.replace("\0", ",").partition("=") for part in parts]
        properties = {key: value for key, _, value in entries}
        if name == "0":
            common |= {key: properties[key][:TEXT_MAX] for key in _COMMON if key in properties}
            continue
        if name not in objects:
            if len(objects) >= OBJECTS_MAX:
                refuse(path, number, f"holds more than {OBJECTS_MAX} objects; cut the log to the flight")
            objects[name] = _RecordedObject()
        recorded = objects[name]
        recorded.update(read, number, properties)
        if "T" in properties:
            read.append(number)
            recorded.samples = recorded.samples or SampleTable(path, 1 + len(_COLUMNS))
            recorded.samples.append(number, time, *recorded.now)
    flying = _choose(path, objects, aircraft, read)
    remarks = read.remarks
    if len(flying) > 1:
        names = enumerate_words([_name_of(*entry) for entry in flying.items()])
        remarks += (f"it holds {len(flying)} aircraft: {names}",)
    first, *companions = [_recording(path, recorded, common, remarks) for recorded in flying.values()]
    return replace(first, others=tuple(companions))


def _logical_lines(lines: Iterable[str]) -> Iterator[tuple[int, str]]:
    """Yield the lines with their numbers; a backslash at its end joins a line with the next one, over comments, too.

    A line that begins as records do ends a text that a comment has interrupted.
    """
    begun, parts, length, interrupted = 0, list[str](), 0, False
    for number, raw in enumerate(lines, start=1):
        line = raw.rstrip("\r\n").lstrip("\ufeff")
        if line.startswith("//"):
            interrupted = True
            if not parts:
                yield number, ""
            continue
        if parts and interrupted and _RECORD.match(line):
            yield begun, "\n".join(parts)
            parts, length = [], 0
        interrupted = False
        continues = (len(line) - len(line.rstrip("\\"))) % 2 == 1
        begun, length = (begun if parts else number), length + len(line)
        if continues and length < LINE_MAX:
            parts.append(line[:-1])
            continue
        yield begun, "\n".join([*parts, line])
        parts, length = [], 0
    if parts:
        yield begun, "\n".join(parts)


def _choose(
    path: str, objects: Mapping[str, _RecordedObject], aircraft: str | None, read: SampleTable
) -> dict[str, _RecordedObject]:
    """Return the aircraft that move, or the selected one, by their numbers."""
    moving = {name: recorded for name, recorded in objects.items() if recorded.moves}
    chosen = {name: recorded for name, recorded in moving.items() if recorded.may_fly}
    if aircraft is not None:
        chosen = dict([entry for entry in moving.items() if aircraft in (entry[0], *entry[1].names)][:1])
    if not chosen:
        read.refuse_first_fault()
        moving_names = enumerate_words([_name_of(*entry) for entry in moving.items()]) or "none that moves"
        subject = "an aircraft" if aircraft is None else f"`{aircraft[:60]}`"
        refuse(path, 0, f"holds no flight of {subject}; it has {moving_names}")
    typed = {name: recorded for name, recorded in chosen.items() if "Type" in recorded.properties}
    return typed or chosen


def _name_of(name: str, recorded_object: _RecordedObject) -> str:
    return [name, *recorded_object.names][-1]


def _recording(
    path: str, recorded_object: _RecordedObject, common: Mapping[str, str], remarks: tuple[str, ...]
) -> Recording:
    assert recorded_object.samples is not None  # what moves has samples
    lines, (times, *values) = recorded_object.samples.arrays("")
    columns = dict(zip(_COLUMNS, values, strict=True))
    for name in _PLACE:
        columns[name] = columns[name] if name == "altitude" else np.radians(columns[name])
    for name, key in (("longitude", "ReferenceLongitude"), ("latitude", "ReferenceLatitude")):
        if key in common:
            columns[name] = columns[name] + math.radians(recorded_object.samples.number(0, common[key], key))
    columns = {name: values for name, values in columns.items() if np.isfinite(values).any()}
    if missing := [name for name in ("longitude", "latitude", "altitude") if name not in columns]:
        refuse(path, 0, f"has no {missing[0]} of `{_name_of('', recorded_object)}`")
    try:
        begins = instant(datetime.fromisoformat(common["ReferenceTime"]).timestamp() + times[0])
    except (KeyError, ValueError, OverflowError, OSError):
        begins = None
    return Recording(
        path, "acmi", times - times[0], columns, lines, begins, remarks, label=_name_of("", recorded_object)
    )


# FIT


SEMICIRCLE = math.pi / 2**31
"""The unit of latitude and longitude, rad."""


def read_fit(path: str, file: IO[bytes]) -> Recording:
    """Return the records of a FIT file: latitude, longitude, altitude and ground speed.

    Args:
        path: of the file, for messages.
        file: at its start.

    Raises:
        InputError: it is damaged before the second record, or holds no records with a place.
        UsageError: fitdecode is not installed.
    """
    fitdecode: Any = extra("fitdecode", "a FIT file", "fit")  # Any: it has no types
    samples = SampleTable(path, 6, "record")
    options = {"check_crc": fitdecode.CrcCheck.DISABLED, "error_handling": fitdecode.ErrorHandling.IGNORE}
    number = 0
    try:
        with fitdecode.FitReader(file, **options) as frames:
            for frame in frames:
                if not isinstance(frame, fitdecode.FitDataMessage) or frame.name != "record":
                    continue
                number += 1
                if number - len(samples.lines) > IDLE_MAX:
                    refuse(path, number, f"has more than {IDLE_MAX} records without a place")
                _append(samples, number, {field.name: field.value for field in frame.fields})
    except InputError:
        raise
    except Exception as error:  # fitdecode raises errors of many kinds for damaged bytes
        why = str(error) or type(error).__name__
        if len(samples.lines) < 2:
            refuse(path, 0, f"is a damaged FIT file: {why}")
        samples.leave_out(number + 1, f"is damaged: {why}", "rest")
    numbers, (time, latitude, longitude, altitude, speed, accuracy) = samples.arrays(
        "holds no records with time and place"
    )
    columns = {"latitude": latitude, "longitude": longitude, "altitude": altitude, "V_G": speed, "h_acc": accuracy}
    columns = {name: values for name, values in columns.items() if np.isfinite(values).any()}
    remarks = (*samples.remarks, "times are whole seconds, as FIT writes them")
    return Recording(path, "fit", time - time[0], columns, numbers, instant(float(time[0])), remarks)


def _append(samples: SampleTable, number: int, values: dict[str, Any]) -> None:  # Any: as fitdecode decodes them
    when = values.get("timestamp")
    if not isinstance(when, datetime):
        samples.leave_out(number, "has no time", "timestamp")
        return
    place = [_number(values.get(name)) * SEMICIRCLE for name in ("position_lat", "position_long")]
    altitude, speed = (_enhanced_value(values, name) for name in ("altitude", "speed"))
    samples.append(number, when.timestamp(), *place, altitude, speed, _number(values.get("gps_accuracy")))


def _enhanced_value(values: dict[str, Any], name: str) -> float:
    """Return the enhanced value of a field where there is one, else the plain one."""
    enhanced = _number(values.get(f"enhanced_{name}"))
    return _number(values.get(name)) if math.isnan(enhanced) else enhanced


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else math.nan
