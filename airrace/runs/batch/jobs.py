"""Jobs: the combinations of courses, aircraft and swept values, each with a name and all that is needed to fly it."""

import hashlib
import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any, Self

from airrace.errors import UsageError
from airrace.files.inputs import Document


@dataclass(frozen=True)
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
        clauses = {
            "track": "the track changed",
            "aircraft": "the aircraft changed",
            "settings": "the settings changed",
            "overrides": "--set or --sweep changed",
            "until": f"the last stage was {earlier.until} and is {self.until}",
            "versions": f"it was solved with other versions ({earlier.versions}; now {self.versions})",
        }
        return [clause for name, clause in clauses.items() if getattr(earlier, name) != getattr(self, name)]


@dataclass(frozen=True)
class Job:
    """A course to be solved once. It holds texts, not files, so it means the same on any computer.

    Attributes:
        name: stable, readable, a valid name of a file; unique in its batch. The checkpoint is `NAME.h5`.
        course: the course's own name in reports: that of its file.
        track, aircraft: the documents.
        settings: None for the defaults.
        overrides: `key=value`, in their order: those of `--set`, then those of the sweeps.
        swept: the value of every sweep, by key: what tells this job from its siblings.
        until: the name of the last stage.
        versions: those of airrace and of what its numbers depend on, on the computer that planned the job.
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
            overrides=hashlib.sha256(json.dumps(self.overrides).encode()).hexdigest(),
            until=self.until,
            versions=self.versions,
        )

    # Any: JSON of `asdict`.
    @classmethod
    def from_object(cls, plain: Mapping[str, Any]) -> Self:
        """Return the job that `asdict` was called on, also after a round trip through JSON.

        Raises:
            KeyError, TypeError: it is no such object.
        """
        values: dict[str, Any] = {
            **plain,
            **{name: plain[name] and Document(**plain[name]) for name in ("track", "aircraft", "settings")},
            "overrides": tuple(plain["overrides"]),
            "swept": tuple((key, value) for key, value in plain["swept"]),
        }
        return cls(**values)


@cache
def _hash_of(text: str) -> str:
    """Return the sha256 (hex) of a text; cached, for thousands of jobs share few documents."""
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()


VALUES_MAX = 100_000
"""The largest number of values of a sweep."""
DIRECTIONS = ("from_deg", "heading_deg", "pass_side_deg")
"""The last parts of keys whose values repeat after 360 degrees."""

Combination = tuple[tuple[str, str], ...]
"""A value for every swept key, as pairs of key and value."""

_NUMBER = re.compile(r"[-+]?(0|[1-9][0-9]*)(\.[0-9]+)?")


@dataclass(frozen=True)
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
    for item in [text.strip() for text in items] or [""]:
        if not item:
            raise ValueError("a value is missing between two commas" if len(items) > 1 else "no values are given")
        parts = item.split(":")
        if len(parts) == 3 and all(_NUMBER.fullmatch(part.strip()) for part in parts):
            values += _range(key, item)
        else:
            values.append(_decimal(Decimal(item)) if _NUMBER.fullmatch(item) else item)
    if len(values) > VALUES_MAX:
        raise ValueError(f"has {len(values)} values; at most {VALUES_MAX} are swept")
    ((value, number),) = Counter(values).most_common(1)
    if number > 1:
        raise ValueError(f"the value {value} is given twice")
    return Sweep(key, tuple(values))


def combinations(sweeps: Sequence[Sweep]) -> Iterator[Combination]:
    """Yield every combination of the sweeps' values, the last sweep varying fastest; without sweeps an empty one."""
    keys = [sweep.key for sweep in sweeps]
    for values in product(*(sweep.values for sweep in sweeps)):
        yield tuple(zip(keys, values, strict=True))


def cover(sweeps: Sequence[Sweep]) -> Iterator[Combination]:
    """Yield a few combinations in which every value of every sweep occurs, so that a fault of any value shows."""
    for number in range(max((len(sweep.values) for sweep in sweeps), default=1)):
        yield tuple((sweep.key, sweep.values[number % len(sweep.values)]) for sweep in sweeps)


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
    """Return a number in its shortest decimal form."""
    text = f"{value:f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text in ("-0", "+0") else text.removeprefix("+")


LENGTH_MAX = 160
"""The longest name, in bytes; longer names are cut, and end with a hash of the whole."""

_UNFIT = re.compile(r"[^\w.,=+-]")


def job_name(course: Path, aircraft: Path | None, swept: Combination) -> str:
    """Return the name of a job.

    Args:
        course: the track file.
        aircraft: the aircraft file, None where the track's own is used.
        swept: the value of every sweep.
    """
    lasts = [key.rpartition(".")[2] for key, _ in swept]
    values: list[str] = []
    for last, (key, value) in zip(lasts, swept, strict=True):
        values.append(f"{last if lasts.count(last) == 1 else key}={value}")
    parts = [course.stem, *([] if aircraft is None else [aircraft.stem]), *values]
    name = _UNFIT.sub("_", ",".join(parts))
    if name.startswith("."):  # such a file would be hidden
        name = f"_{name[1:]}"
    if len(name.encode()) <= LENGTH_MAX:
        return name
    begin = name.encode()[: LENGTH_MAX - 9].decode(errors="ignore")
    return f"{begin}~{hashlib.sha256(name.encode()).hexdigest()[:8]}"


def refuse_clashes(named: Iterable[tuple[str, str]]) -> None:
    """Make sure that no two jobs write to one file, even where the file system does not distinguish `A` from `a`.

    Args:
        named: name of each job, and what it is made of in the user's words.

    Raises:
        UsageError: two do; both are named.
    """
    origins: dict[str, str] = {}
    for name, origin in named:
        first_origin = origins.get(name.casefold())
        if first_origin is not None:
            both = f"{origin}, which is given twice" if first_origin == origin else f"{first_origin} and {origin}"
            raise UsageError(f"two jobs would write {name}.h5: {both}; fly them in two batches, or rename a file")
        origins[name.casefold()] = origin
