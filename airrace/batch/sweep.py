"""Sweeps over the inputs' numbers, and the names of the jobs they make.

VALUES is a list, `0,5,10`, whose items may be ranges, `first:last:step`. **A range includes its last value** where a
step leads there, `0:20:5` is 0, 5, 10, 15 and 20; but a full circle is closed once: of a direction, `0:360:45` ends
with 315. Numbers are decimal, so `0:1:0.1` has no rounding in it, and have one way to be written: `5.0` is `5`.

`COURSE[,AIRCRAFT][,KEY=VALUE]...`: the file of the course; that of the aircraft where the batch names aircraft; the
value of every sweep, by the last part of its key or, where two sweeps share that, by all of it.
"""

import hashlib
import re
from collections.abc import Iterable, Iterator, Sequence
from decimal import Decimal
from itertools import product
from pathlib import Path

from airrace.errors import UsageError
from airrace.records import record

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
