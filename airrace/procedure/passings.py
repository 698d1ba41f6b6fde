"""The passings of a course by names and kinds, by which runs of the same passings are told from others."""

import itertools
from collections.abc import Sequence

from airrace.errors import UsageError
from airrace.track.course import Course

Passing = tuple[str, str]
"""The name of a passing and, where it is known, its kind."""


def passings_of(course: Course) -> list[Passing]:
    """Return the names and kinds of the elements that a course passes, in order."""
    return [(passage.name, type(passage.element).__name__.lower()) for passage in course.passages]


def ensure_same_passings(here: Sequence[Passing], there: Sequence[Passing], name: str) -> None:
    """Refuse a run whose passings differ: its flight leads through another course.

    Args:
        here: the passings of the race to be flown.
        there: those of the run to start from; kinds may be unknown, which is an empty text.
        name: what users call that run.

    Raises:
        UsageError: naming the first passing that differs.
    """
    for number, (mine, other) in enumerate(itertools.zip_longest(here, there), start=1):
        if mine is None or other is None:
            longer, one = ("this course", mine) if other is None else (name, other)
            assert one is not None  # only one of the two sequences has ended
            raise UsageError(f"{name} flies other passings: only {longer} has a passing number {number}, {one[0]}")
        same_kind = mine[1] == other[1] or not (mine[1] and other[1])
        if mine[0] != other[0] or not same_kind:
            first, second = (f"{one[0]} ({one[1]})" if not same_kind and one[1] else one[0] for one in (other, mine))
            raise UsageError(
                f"{name} flies other passings: number {number} is {first} there and {second} here; "
                "start without it, or keep the names and the order of the passings"
            )
