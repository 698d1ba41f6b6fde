"""The comparison of a run with the one it was started from: the difference in race time, leg by leg."""

from collections.abc import Sequence

from airrace.procedure.restart import SourceRun
from airrace.procedure.result import StageResult
from airrace.procedure.split_comparison import compared, last_common
from airrace.runs.run_object import finite


def comparison_object(start: SourceRun, results: Sequence[StageResult]) -> dict[str, object] | None:
    """Return the object `compared` of the answer, seconds; None where no stage holds in both runs."""
    common = last_common(start.results, results)
    if common is None:
        return None
    comparison = compared(*common)
    return {
        "with": start.name,
        "stage": common[1].stage.value,
        "certified": comparison.certified,
        "race_time_s": _seconds(comparison.before, comparison.after),
        "legs": [
            {"passing": leg.name, **_seconds(leg.before, leg.after), "cumulative": finite(leg.cumulative)}
            for leg in comparison.legs
        ],
    }


def _seconds(before: float, after: float) -> dict[str, object]:
    return {"before": finite(before), "after": finite(after), "difference": finite(after - before)}
