"""The comparison of two stages by their gate splits, leg by leg: where time was won and where it was lost."""

from collections.abc import Sequence

from airrace.procedure.result import StageResult
from airrace.records import record


@record
class LegTimes:
    """The times of one leg in two flights.

    Attributes:
        name: of the passing that it ends in.
        before, after: seconds from the passing before to this one, in the one flight and in the other.
        cumulative: what the other flight has lost from the start up to this passing, s; negative where it has won.
    """

    name: str
    before: float
    after: float
    cumulative: float

    @property
    def difference(self) -> float:
        """The time that the other flight loses on this leg, s; negative where it wins."""
        return self.after - self.before


@record
class SplitComparison:
    """The comparison of two flights of the same passings.

    Attributes:
        before, after: their race times, s.
        legs: leg by leg.
        certified: whether both are; otherwise a mesh may have done something to one of the race times.
    """

    before: float
    after: float
    legs: tuple[LegTimes, ...]
    certified: bool = True

    @property
    def difference(self) -> float:
        """The time that the other flight loses in all, s; negative where it is faster."""
        return self.after - self.before


def compare_splits(before: StageResult, after: StageResult) -> SplitComparison:
    """Compare one flight with another of the same passings.

    Raises:
        ValueError: the passings are others.
    """
    if [split.name for split in before.splits] != [split.name for split in after.splits]:
        raise ValueError("only flights of the same passings can be compared leg by leg")
    first, second = ([split.time for split in one.splits] for one in (before, after))
    legs = tuple(
        LegTimes(
            name=before.splits[end].name,
            before=first[end] - first[end - 1],
            after=second[end] - second[end - 1],
            cumulative=second[end] - first[end],
        )
        for end in range(1, len(before.splits))
    )
    both = before.certified and after.certified
    return SplitComparison(before.trajectory.race_time, after.trajectory.race_time, legs, both)


def last_common(before: Sequence[StageResult], after: Sequence[StageResult]) -> tuple[StageResult, StageResult] | None:
    """Return the highest stage that holds in both of two runs, from either; None if there is none."""
    earlier = {one.stage: one for one in before if one.holds}
    common = [one for one in after if one.holds and one.stage in earlier]
    return (earlier[common[-1].stage], common[-1]) if common else None
