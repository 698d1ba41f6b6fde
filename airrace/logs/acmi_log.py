"""Tacview's ACMI 2.x as text, in which what a line leaves out is as in the line before."""

import math
import re
from array import array
from collections.abc import Iterable, Iterator, Mapping
from datetime import datetime

import numpy as np

from airrace.logs.clocks import instant
from airrace.logs.recording import LIMITS, Recording, SampleTable, enumerate_words, refuse

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
                self.properties[key] = value[: LIMITS.text]

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


def read_acmi(path: str, lines: Iterable[str], wanted: str | None = None) -> Recording:
    """Return the flight of one aircraft of an ACMI recording, with those of the others.

    Args:
        path: of the file, for messages.
        lines: of the file.
        wanted: the name, pilot, call sign or number of the aircraft; None for any.

    Raises:
        InputError: it is no such recording, it is too large, or there is no such aircraft.
    """
    objects: dict[str, _RecordedObject] = {}
    common: dict[str, str] = {}
    read = SampleTable(path, 0)  # of all objects
    time = 0.0
    for number, line in _logical_lines(lines):
        if number - len(read.lines) > LIMITS.idle:
            refuse(path, number, f"has more than {LIMITS.idle} lines without a place; cut the log to the flight")
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
        name = name.strip().lower()[: LIMITS.text]
        properties = {key: value for key, _, value in (one.replace("\0", ",").partition("=") for one in parts)}
        if name == "0":
            common |= {key: properties[key][: LIMITS.text] for key in _COMMON if key in properties}
            continue
        if name not in objects:
            if len(objects) >= LIMITS.objects:
                refuse(path, number, f"holds more than {LIMITS.objects} objects; cut the log to the flight")
            objects[name] = _RecordedObject()
        one = objects[name]
        one.update(read, number, properties)
        if "T" in properties:
            read.append(number)
            one.samples = one.samples or SampleTable(path, 1 + len(_COLUMNS))
            one.samples.append(number, time, *one.now)
    flying = _choose(path, objects, wanted, read)
    remarks = read.remarks
    if len(flying) > 1:
        remarks += (f"it holds {len(flying)} aircraft: {enumerate_words([_name_of(*one) for one in flying.items()])}",)
    first, *others = [_recording(path, one, common, remarks) for one in flying.values()]
    return first.with_others(others)


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
        if continues and length < LIMITS.line:
            parts.append(line[:-1])
            continue
        yield begun, "\n".join([*parts, line])
        parts, length = [], 0
    if parts:
        yield begun, "\n".join(parts)


def _choose(
    path: str, objects: Mapping[str, _RecordedObject], wanted: str | None, read: SampleTable
) -> dict[str, _RecordedObject]:
    """Return the aircraft that move, or the one that is wanted, by their numbers."""
    moving = {name: one for name, one in objects.items() if one.moves}
    chosen = {name: one for name, one in moving.items() if one.may_fly}
    if wanted is not None:
        chosen = dict([each for each in moving.items() if wanted in (each[0], *each[1].names)][:1])
    if not chosen:
        read.refuse_first_fault()
        known = enumerate_words([_name_of(*one) for one in moving.items()]) or "none that moves"
        asked = "an aircraft" if wanted is None else f"`{wanted[:60]}`"
        refuse(path, 0, f"holds no flight of {asked}; it has {known}")
    typed = {name: one for name, one in chosen.items() if "Type" in one.properties}
    return typed or chosen


def _name_of(name: str, one: _RecordedObject) -> str:
    return [name, *one.names][-1]


def _recording(path: str, one: _RecordedObject, common: Mapping[str, str], remarks: tuple[str, ...]) -> Recording:
    assert one.samples is not None  # what moves has samples
    lines, (times, *values) = one.samples.arrays("")
    columns = dict(zip(_COLUMNS, values, strict=True))
    for name in _PLACE:
        columns[name] = columns[name] if name == "altitude" else np.radians(columns[name])
    for name, key in (("longitude", "ReferenceLongitude"), ("latitude", "ReferenceLatitude")):
        if key in common:
            columns[name] = columns[name] + math.radians(one.samples.number(0, common[key], key))
    columns = {name: values for name, values in columns.items() if np.isfinite(values).any()}
    if missing := [name for name in ("longitude", "latitude", "altitude") if name not in columns]:
        refuse(path, 0, f"tells no {missing[0]} of `{_name_of('', one)}`")
    try:
        begins = instant(datetime.fromisoformat(common["ReferenceTime"]).timestamp() + times[0])
    except (KeyError, ValueError, OverflowError, OSError):
        begins = None
    return Recording(path, "acmi", times - times[0], columns, lines, begins, remarks, label=_name_of("", one))
