"""Logs as Tacview's ACMI 2.x text: one aircraft of it.

Values that a line leaves out are those of the line before, as the format has it.
"""

import math
from array import array
from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import datetime

import numpy as np

from airrace.logs.csv_log import ROWS_MAX
from airrace.logs.recording import Recording, listed, refuse

_HISTORIES = {"TAS": ("V_A", 1.0), "IAS": ("V_I", 1.0), "VerticalGForce": ("n_z", 1.0)}
_SLOTS = ("longitude", "latitude", "altitude", "phi", "theta", "psi")
_OF_PLACE = {3: (0, 1, 2), 5: (0, 1, 2), 6: (0, 1, 2, 3, 4, 5), 9: (0, 1, 2, 3, 4, 5)}
"""The places of longitude, latitude, altitude, roll, pitch and yaw in a transform, by the number of its values."""
_ANGLES = frozenset({"longitude", "latitude", "phi", "theta", "psi"})


@dataclass
class _RecordedAircraft:
    """An object of the recording and its samples; a sample is the values of `_SLOTS` and of `_HISTORIES`."""

    properties: dict[str, str] = field(default_factory=dict[str, str])
    now: list[float] = field(default_factory=lambda: [math.nan] * (len(_SLOTS) + len(_HISTORIES)))
    times: "array[float]" = field(default_factory=lambda: array("d"))
    lines: "array[int]" = field(default_factory=lambda: array("q"))
    rows: "array[float]" = field(default_factory=lambda: array("d"))


def read_acmi(path: str, lines: Iterable[str], wanted: str | None = None) -> Recording:
    """Return the flight of one aircraft of a recording.

    Args:
        path: of the file, for messages.
        lines: of the file.
        wanted: the name, pilot, call sign or number of the aircraft; None for the only one, or the first.

    Raises:
        InputError: it is no such recording, time runs backwards, or there is no such aircraft.
    """
    reader = _AcmiReader(path)
    for number, line in enumerate(_joined(lines), start=1):
        reader.take(number, line)
    return reader.recording(wanted)


def _joined(lines: Iterable[str]) -> Iterable[str]:
    for line in lines:
        yield line.rstrip("\r\n").lstrip("\ufeff")


class _AcmiReader:
    def __init__(self, path: str) -> None:
        self._path = path
        self._time = 0.0
        self._samples = 0
        self._objects: dict[str, _RecordedAircraft] = {}
        self._global: dict[str, str] = {}

    def take(self, number: int, line: str) -> None:
        """Take a line: a time, the end of an object, or properties of one."""
        if number == 1 and line != "FileType=text/acmi/tacview":
            refuse(self._path, 1, "is no ACMI recording: expected `FileType=text/acmi/tacview` in the first line")
        if number == 2 and not line.startswith("FileVersion=2."):
            refuse(self._path, 2, f"expected `FileVersion=2.x`, found `{line[:40]}`")
        if number <= 2 or not line or line.startswith(("//", "-")):
            return
        if line.startswith("#"):
            self._advance(number, line[1:])
        else:
            name, _, rest = line.partition(",")
            self._set(number, name.strip().lower(), rest)

    def _advance(self, number: int, text: str) -> None:
        time = self._number(number, text, "#")
        if time < self._time:
            refuse(self._path, number, f"time runs backwards: {time:g} s comes behind {self._time:g} s")
        self._time = time

    def _set(self, number: int, name: str, rest: str) -> None:
        entries = [one.partition("=") for one in _fields(rest)]
        if name == "0":
            self._global |= {key: value for key, _, value in entries}
            return
        one = self._objects.setdefault(name, _RecordedAircraft())
        moved = False
        for key, _, value in entries:
            if key == "T":
                self._move(number, one, value)
                moved = True
            elif key in _HISTORIES:
                one.now[len(_SLOTS) + list(_HISTORIES).index(key)] = self._number(number, value, key)
            else:
                one.properties[key] = value
        if moved:
            self._sample(number, one)

    def _sample(self, number: int, one: _RecordedAircraft) -> None:
        self._samples += 1
        if self._samples > ROWS_MAX:
            refuse(self._path, number, f"holds more than {ROWS_MAX} samples; cut the log to the flight")
        one.times.append(self._time)
        one.lines.append(number)
        one.rows.extend(one.now)

    def _move(self, number: int, one: _RecordedAircraft, value: str) -> None:
        parts = value.split("|")
        slots = _OF_PLACE.get(len(parts))
        if slots is None:
            refuse(self._path, number, f"a place has {len(parts)} values; expected 3, 5, 6 or 9", "T")
        for slot in slots:
            if parts[slot].strip():
                one.now[slot] = self._number(number, parts[slot], "T")

    def _number(self, number: int, text: str, key: str) -> float:
        try:
            value = float(text)
        except ValueError:
            refuse(self._path, number, f"`{text[:40]}` is no number", key)
        if not math.isfinite(value):
            refuse(self._path, number, f"`{text[:40]}` is no number", key)
        return value

    def recording(self, wanted: str | None) -> Recording:
        """Return the samples of the aircraft."""
        flying = {name: one for name, one in self._objects.items() if len(set(one.times)) >= 2}
        chosen = [(name, one) for name, one in flying.items() if wanted is None or wanted in _names(name, one)]
        if not chosen:
            known = listed([_names(name, one)[-1] for name, one in flying.items()]) or "none that moves"
            asked = "an aircraft" if wanted is None else f"`{wanted[:60]}`"
            refuse(self._path, 0, f"holds no flight of {asked}; it has {known}")
        name, one = next((pair for pair in chosen if "Air" in pair[1].properties.get("Type", "")), chosen[0])
        table = np.array(one.rows, np.float64).reshape(len(one.times), -1)
        columns = {slot: table[:, index] for index, slot in enumerate(_SLOTS)}
        columns = {slot: np.radians(values) if slot in _ANGLES else values for slot, values in columns.items()}
        columns["longitude"] = columns["longitude"] + math.radians(self._reference(0, "ReferenceLongitude"))
        columns["latitude"] = columns["latitude"] + math.radians(self._reference(0, "ReferenceLatitude"))
        for index, (history, factor) in enumerate(_HISTORIES.values()):
            columns[history] = factor * table[:, len(_SLOTS) + index]
        columns = {name: values for name, values in columns.items() if np.isfinite(values).any()}
        remarks = [f"it holds {len(flying)} aircraft, of which {_names(name, one)[-1]} is read"] * (len(flying) > 1)
        time = np.array(one.times, np.float64)
        lines = np.array(one.lines, np.int64)
        return Recording(self._path, "acmi", time - time[0], columns, lines, self._begins(time[0]), tuple(remarks))

    def _reference(self, number: int, key: str) -> float:
        return self._number(number, self._global[key], key) if key in self._global else 0.0

    def _begins(self, first: float) -> datetime | None:
        from airrace.logs.recording import instant

        try:
            return instant(datetime.fromisoformat(self._global["ReferenceTime"]).timestamp() + first)
        except (KeyError, ValueError):
            return None


def _names(name: str, one: _RecordedAircraft) -> list[str]:
    return [name, *(one.properties[key] for key in ("Name", "CallSign", "Pilot") if key in one.properties)]


def _fields(text: str) -> Iterable[str]:
    """Yield the properties of a line, which end at commas that no backslash precedes."""
    return (part.replace("\0", ",") for part in text.replace("\\,", "\0").split(","))
