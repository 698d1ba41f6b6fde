"""Names of jobs: stable from call to call, readable, and valid names of files.

`COURSE[,AIRCRAFT][,KEY=VALUE]...`: the file of the course; that of the aircraft where the batch names aircraft; the
value of every sweep, by the last part of its key or, where two sweeps share that, by all of it.
"""

import hashlib
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from airrace.batch.sweep import Combination
from airrace.errors import UsageError

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
