"""The files that a pattern means, found within bounds: `**` neither follows links nor walks through a whole disk."""

import glob
import os
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

FOLDERS_MAX = 10_000
"""The largest number of folders that one pattern is looked for in; a tenth of a second's work on most disks."""
MATCHES_MAX = 20_000
"""The largest number of files that one pattern may mean; each of them is read before anything is flown."""
ANY_DEPTH = "**"


class TooWideError(Exception):
    """An error of a pattern that would be looked for in too many places, in words."""


def matching(pattern: str) -> list[str]:
    """Return the files that match a pattern, sorted by name.

    Raises:
        TooWideError: too many folders or files would have to be looked at.
    """
    found = list(islice((name for name in _expanded(pattern) if not os.path.isdir(name)), MATCHES_MAX + 1))
    if len(found) > MATCHES_MAX:
        raise TooWideError(f"matches more than {MATCHES_MAX} files; name fewer of them")
    return sorted(found)


def _expanded(pattern: str) -> Iterator[str]:
    parts = Path(pattern).parts
    if ANY_DEPTH not in parts:
        yield from glob.iglob(pattern)
        return
    place = parts.index(ANY_DEPTH)
    above, below = parts[:place], parts[place + 1 :]
    names = below or ("*",)
    for folder in _folders(os.path.join(*above) if above else ""):
        yield from _expanded(os.path.join(glob.escape(folder), *names))


def _folders(pattern: str) -> Iterator[str]:
    """Yield the folders that match and all within them, but for hidden ones and those that only links lead to."""
    looked_at = 0
    for top in glob.iglob(pattern) if pattern else [""]:
        for folder, within, _ in os.walk(top or os.curdir, followlinks=False):
            looked_at += 1
            if looked_at > FOLDERS_MAX:
                raise TooWideError(f"leads through more than {FOLDERS_MAX} folders; name one further down")
            within[:] = sorted(name for name in within if not name.startswith("."))
            yield folder if top else os.path.relpath(folder).removeprefix(os.curdir)
