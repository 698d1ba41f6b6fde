"""Jobs: the combinations of courses, aircraft and swept values, each with a name and all that is needed to fly it."""

import hashlib
import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, fields
from decimal import Decimal
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any, Self

from airrace.errors import UsageError
from airrace.inputs import Document
from airrace.records import record


@record
class Fingerprint:
    """All that the result of a job depends on; each part is a hash or a short text, so that a change can be named.

    Attributes:
        track, aircraft, settings: sha256 of the documents' texts; `settings` is empty where the defaults are used.
        overrides: sha256 of the `key=value` texts, in their order.
        until: the last stage.
        versions: the versions of airrace and of what its numbers depend on, as one text.
    """

    track: str
    aircraft: str
    settings: str
    overrides: str
    until: str
    versions: str

    def changes(self, earlier: Self) -> list[str]:
        """Return what differs from an earlier fingerprint, one clause for each part."""
        return [
            _clause(field.name, getattr(earlier, field.name), getattr(self, field.name))
            for field in fields(self)
            if getattr(earlier, field.name) != getattr(self, field.name)
        ]


@record
class Job:
    """A course to be flown once. It holds texts, not files, so it means the same on any machine.

    Attributes:
        name: stable, readable, a valid name of a file; unique in its batch. The checkpoint is `NAME.h5`.
        course: the course's own name in reports: that of its file.
        track, aircraft: the documents.
        settings: None for the defaults.
        overrides: `key=value`, in their order: those of `--set`, then those of the sweeps.
        swept: the value of every sweep, by key: what tells this job from its siblings.
        until: the name of the last stage.
        versions: those of airrace and of what its numbers depend on, on the machine that planned the job.
    """

    name: str
    course: str
    track: Document
    aircraft: Document
    settings: Document | None
    overrides: tuple[str, ...]
    swept: tuple[tuple[str, str], ...]
    until: str
    versions: str

    @property
    def fingerprint(self) -> Fingerprint:
        return Fingerprint(
            track=_hash_of(self.track.text),
            aircraft=_hash_of(self.aircraft.text),
            settings="" if self.settings is None else _hash_of(self.settings.text),
            overrides=hash_of_all(self.overrides),
            until=self.until,
            versions=self.versions,
        )

    def as_object(self) -> dict[str, object]:
        """Return the job as plain values, for JSON."""
        return asdict(self)

    # Any: JSON that `as_object` wrote.
    @classmethod
    def from_object(cls, plain: Mapping[str, Any]) -> Self:
        """Return the job that `as_object` was called on, also after a round trip through JSON.

        Raises:
            KeyError, TypeError: it is no such object.
        """
        settings = plain["settings"]
        return cls(
            name=plain["name"],
            course=plain["course"],
            track=Document(**plain["track"]),
            aircraft=Document(**plain["aircraft"]),
            settings=None if settings is None else Document(**settings),
            overrides=tuple(plain["overrides"]),
            swept=tuple((key, value) for key, value in plain["swept"]),
            until=plain["until"],
            versions=plain["versions"],
        )


def hash_of_all(texts: Iterable[str]) -> str:
    """Return the sha256 (hex) of several texts in their order."""
    return hashlib.sha256(json.dumps(list(texts)).encode()).hexdigest()


@cache
def _hash_of(text: str) -> str:
    """Return the sha256 (hex) of a text; cached, for thousands of jobs share few documents."""
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()


def _clause(part: str, before: str, now: str) -> str:
    match part:
        case "until":
            return f"the last stage was {before} and is {now}"
        case "versions":
            return f"it was flown with other versions ({before}; now {now})"
        case "overrides":
            return "--set or --sweep changed"
        case "settings":
            return "the settings changed"
        case _:
            return f"the {part} changed"


VALUES_MAX = 100_000
"""The largest number of values of a sweep."""
DIRECTIONS = ("from_deg", "heading_deg", "pass_side_deg")
"""The last parts of keys whose values repeat after 360 degrees."""

Combination = tuple[tuple[str, str], ...]
"""A value for every swept key, as pairs of key and value."""

_NUMBER = re.compile(r"[-+]?(0|[1-9][0-9]*)(\.[0-9]+)?")


@record
class Sweep:
    """A key as `--set` takes it, and the values it is given in turn, as texts."""

    key: str
    values: tuple[str, ...]


def parse_sweep(text: str) -> Sweep:
    """Return the sweep that `KEY=VALUES` stands for.

    Raises:
        ValueError: the text is no sweep; the error's text says why.
    """
    key, equals, values = text.partition("=")
    if not equals or not all(part.strip() for part in key.split(".")):
        raise ValueError(f"`{text}` is not of the form key=values, e.g. environment.wind.speed_kt=0,5,10")
    return sweep_of(key.strip(), values.split(","))


def sweep_of(key: str, items: Sequence[str]) -> Sweep:
    """Return a sweep over single values and ranges.

    Raises:
        ValueError: there is no value, a range leads nowhere, or a value comes twice.
    """
    values: list[str] = []
    for item in (one.strip() for one in items):
        if not item:
            raise ValueError("a value is missing between two commas" if len(items) > 1 else "no values are given")
        values += _range(key, item) if _is_range(item) else [canonical(item)]
    if len(values) > VALUES_MAX:
        raise ValueError(f"has {len(values)} values; at most {VALUES_MAX} are swept")
    twice = _first_repeated(values)
    if twice is not None:
        raise ValueError(f"the value {twice} is given twice")
    return Sweep(key, tuple(values))


def combinations(sweeps: Sequence[Sweep]) -> Iterator[Combination]:
    """Yield every combination of the sweeps' values, the last sweep varying fastest; without sweeps an empty one."""
    keys = [sweep.key for sweep in sweeps]
    for values in product(*(sweep.values for sweep in sweeps)):
        yield tuple(zip(keys, values, strict=True))


def count(sweeps: Iterable[Sweep]) -> int:
    """Return the number of combinations."""
    total = 1
    for sweep in sweeps:
        total *= len(sweep.values)
    return total


def cover(sweeps: Sequence[Sweep]) -> Iterator[Combination]:
    """Yield a few combinations in which every value of every sweep occurs, so that a fault of any value shows."""
    for number in range(max((len(sweep.values) for sweep in sweeps), default=1)):
        yield tuple((sweep.key, sweep.values[number % len(sweep.values)]) for sweep in sweeps)


def canonical(text: str) -> str:
    """Return a number in its shortest decimal form, and any other text unchanged."""
    return _decimal(Decimal(text)) if _NUMBER.fullmatch(text) else text


def _is_range(text: str) -> bool:
    parts = text.split(":")
    return len(parts) == 3 and all(_NUMBER.fullmatch(part.strip()) for part in parts)


def _range(key: str, text: str) -> list[str]:
    first, last, step = (Decimal(part.strip()) for part in text.split(":"))
    if step == 0 or (last - first) / step < 0:
        raise ValueError(f"the range {text} (first:last:step) never arrives")
    steps = int((last - first) / step)
    if steps >= VALUES_MAX:
        raise ValueError(f"the range {text} has more than {VALUES_MAX} values")
    values = [first + number * step for number in range(steps + 1)]
    if key.rpartition(".")[2] in DIRECTIONS and abs(values[-1] - first) == 360:
        values.pop()
    return [_decimal(value) for value in values]


def _decimal(value: Decimal) -> str:
    text = f"{value:f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text in ("-0", "+0") else text.removeprefix("+")


def _first_repeated(values: Sequence[str]) -> str | None:
    seen: set[str] = set()
    for value in values:
        if value in seen:
            return value
        seen.add(value)
    return None


LENGTH_MAX = 160
"""The longest name, in bytes; longer names are cut, and end with a hash of the whole."""

_UNFIT = re.compile(r"[^\w.,=+-]")


def job_name(course: Path, aircraft: Path | None, swept: Combination) -> str:
    """Return the name of a job.

    Args:
        course: the track file.
        aircraft: the aircraft file, None where the track's own is flown.
        swept: the value of every sweep.
    """
    keys = short_keys([key for key, _ in swept])
    values = [f"{key}={value}" for key, (_, value) in zip(keys, swept, strict=True)]
    parts = [course.stem, *([] if aircraft is None else [aircraft.stem]), *values]
    name = _UNFIT.sub("_", ",".join(parts))
    if name.startswith("."):  # such a file would be hidden
        name = f"_{name[1:]}"
    if len(name.encode()) <= LENGTH_MAX:
        return name
    kept = name.encode()[: LENGTH_MAX - 9].decode(errors="ignore")
    return f"{kept}~{hashlib.sha256(name.encode()).hexdigest()[:8]}"


def short_keys(keys: Sequence[str]) -> list[str]:
    """Return the last part of every key, or all of it where another key ends alike."""
    lasts = [key.rpartition(".")[2] for key in keys]
    return [last if lasts.count(last) == 1 else key for last, key in zip(lasts, keys, strict=True)]


def refuse_clashes(named: Iterable[tuple[str, str]]) -> None:
    """Make sure that no two jobs write to one file, even where the file system does not distinguish `A` from `a`.

    Args:
        named: name of each job, and what it is made of in the user's words.

    Raises:
        UsageError: two do; both are named.
    """
    seen: dict[str, str] = {}
    for name, origin in named:
        other = seen.get(name.casefold())
        if other is not None:
            both = f"{origin}, which is given twice" if other == origin else f"{other} and {origin}"
            raise UsageError(f"two jobs would write {name}.h5: {both}; fly them in two batches, or rename a file")
        seen[name.casefold()] = origin
