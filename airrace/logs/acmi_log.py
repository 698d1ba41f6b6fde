"""Logs as Tacview's ACMI 2.x text: one aircraft of it.

Values that a line leaves out are those of the line before, as the format has it.
"""

import math
from array import array
from collections.abc import Iterable, Iterator
from datetime import datetime

import numpy as np

from airrace.logs.recording import Recording, SampleTable, instant, listed, refuse

_PLACE = ("longitude", "latitude", "altitude", "phi", "theta", "psi")
_PLACE_VALUES = {3: 3, 5: 3, 6: 6, 9: 6}
"""The number of values of a transform that are in `_PLACE`, by the number of all its values."""
_PROPERTIES = {"TAS": "V_A", "IAS": "V_I", "VerticalGForce": "n_z"}
_COLUMNS = (*_PLACE, *_PROPERTIES.values())


class _RecordedAircraft:
    """An object of the recording: its properties, its present values by `_COLUMNS`, and its samples."""

    def __init__(self, path: str) -> None:
        self.properties: dict[str, str] = {}
        self.now = array("d", [math.nan] * len(_COLUMNS))
        self.samples = SampleTable(path, 1 + len(_COLUMNS))

    def names(self) -> list[str]:
        return [self.properties[key] for key in ("Name", "CallSign", "Pilot") if key in self.properties]


def read_acmi(path: str, lines: Iterable[str], wanted: str | None = None) -> Recording:
    """Return the flight of one aircraft of a recording.

    Args:
        path: of the file, for messages.
        lines: of the file.
        wanted: the name, pilot, call sign or number of the aircraft; None for the only one, or the first.

    Raises:
        InputError: it is no such recording, time runs backwards, or there is no such aircraft.
    """
    objects: dict[str, _RecordedAircraft] = {}
    common: dict[str, str] = {}
    read = SampleTable(path, 0)  # of all objects
    time = 0.0
    for number, raw in enumerate(lines, start=1):
        line = raw.rstrip("\r\n").lstrip("\ufeff")
        if number == 1 and line != "FileType=text/acmi/tacview":
            refuse(path, 1, "is no ACMI recording: expected `FileType=text/acmi/tacview` in the first line")
        if number == 2 and not line.startswith("FileVersion=2."):
            refuse(path, 2, f"expected `FileVersion=2.x`, found `{line[:40]}`")
        if number <= 2 or not line or line.startswith(("//", "-")):
            continue
        if line.startswith("#"):
            before, time = time, read.number(number, line[1:], "#")
            if time < before:
                refuse(path, number, f"time runs backwards: {time:g} s comes behind {before:g} s")
            continue
        name, _, rest = line.partition(",")
        name = name.strip().lower()
        properties = {key: value for key, _, value in (one.partition("=") for one in _fields(rest))}
        if name == "0":
            common |= properties
            continue
        one = objects[name] = objects.get(name) or _RecordedAircraft(path)
        _update(read, number, one, properties)
        if "T" in properties:
            read.append(number)
            one.samples.append(number, time, *one.now)
    return _recording(path, objects, common, wanted)


def _fields(text: str) -> Iterator[str]:
    """Yield the properties of a line, which end at commas that no backslash precedes."""
    return (part.replace("\0", ",") for part in text.replace("\\,", "\0").split(","))


def _update(read: SampleTable, line: int, one: _RecordedAircraft, properties: dict[str, str]) -> None:
    """Take the properties of a line as the present values of an object."""
    for key, value in properties.items():
        if key == "T":
            parts = value.split("|")
            if len(parts) not in _PLACE_VALUES:
                refuse(read.path, line, f"a place has {len(parts)} values; expected 3, 5, 6 or 9", "T")
            for slot, part in enumerate(parts[: _PLACE_VALUES[len(parts)]]):
                if part.strip():
                    one.now[slot] = read.number(line, part, "T")
        elif key in _PROPERTIES:
            one.now[_COLUMNS.index(_PROPERTIES[key])] = read.number(line, value, key)
        else:
            one.properties[key] = value


def _recording(
    path: str, objects: dict[str, _RecordedAircraft], common: dict[str, str], wanted: str | None
) -> Recording:
    flying = {name: one for name, one in objects.items() if len(set(one.samples.columns[0])) >= 2}
    named = {name: [name, *one.names()] for name, one in flying.items()}
    chosen = [name for name in flying if wanted is None or wanted in named[name]]
    if not chosen:
        known = listed([names[-1] for names in named.values()]) or "none that moves"
        asked = "an aircraft" if wanted is None else f"`{wanted[:60]}`"
        refuse(path, 0, f"holds no flight of {asked}; it has {known}")
    name = next((name for name in chosen if "Air" in flying[name].properties.get("Type", "")), chosen[0])
    lines, (time, *values) = flying[name].samples.arrays("")
    columns = dict(zip(_COLUMNS, values, strict=True))
    for one in _PLACE:
        columns[one] = columns[one] if one == "altitude" else np.radians(columns[one])
    for one, key in (("longitude", "ReferenceLongitude"), ("latitude", "ReferenceLatitude")):
        if key in common:
            columns[one] = columns[one] + math.radians(flying[name].samples.number(0, common[key], key))
    columns = {one: values for one, values in columns.items() if np.isfinite(values).any()}
    remarks = [f"it holds {len(flying)} aircraft, of which {named[name][-1]} is read"] * (len(flying) > 1)
    try:
        begins = instant(datetime.fromisoformat(common["ReferenceTime"]).timestamp() + time[0])
    except (KeyError, ValueError):
        begins = None
    return Recording(path, "acmi", time - time[0], columns, lines, begins, tuple(remarks))
