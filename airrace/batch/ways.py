"""The way round in which a job was flown, and the one that came next."""

from collections.abc import Mapping
from typing import Any

from airrace.records import record


@record
class Ways:
    """The ways round that a job has tried, in short.

    Attributes:
        flown: the way that was proved, in words.
        tried: how many there were, this one among them.
        next: the fastest of the others, in words; empty where there is none.
        behind: the time by which that one is behind on the rough mesh, s; None if there is none.
    """

    flown: str
    tried: int
    next: str = ""
    behind: float | None = None


# Any: JSON
def ways_of(run: Mapping[str, Any] | None) -> Ways | None:
    """Return the ways of the stage that explored, from the object of `airrace optimize --json`; None without one."""
    told = [stage["ways"] for stage in (run or {}).get("stages", ()) if stage.get("ways")]
    if not told:
        return None
    flown, *others = told[0]
    if not others:
        return Ways(flown["way"], 1)
    return Ways(flown["way"], 1 + len(others), others[0]["way"], others[0]["difference_s"])
