"""The difference between two runs as a table."""

from collections.abc import Sequence

from rich.table import Table

from airrace.cli.tables import plain_table
from airrace.procedure.restart import SourceRun
from airrace.procedure.result import StageResult
from airrace.procedure.split_comparison import compared, last_common


def comparison_table(start: SourceRun, results: Sequence[StageResult]) -> Table | None:
    """Return a table of the legs: time before and after, what was lost on the leg and so far.

    It is None where the two runs have no stage in common.
    """
    common = last_common(start.results, results)
    if common is None:
        return None
    comparison = compared(*common)
    rows = [
        (leg.name, f"{leg.before:.3f}", f"{leg.after:.3f}", f"{leg.difference:+.3f}", f"{leg.cumulative:+.3f}")
        for leg in comparison.legs
    ]
    rows.append(("race", f"{comparison.before:.3f}", f"{comparison.after:.3f}", f"{comparison.difference:+.3f}", ""))
    remark = "" if comparison.certified else " (not certified in both: a few ms may be the mesh)"
    title = f"{common[1].stage.value} against {start.name}: {comparison.difference:+.3f} s{remark}"
    return plain_table(title, ("leg to",), ("before\ns", "after\ns", "difference\ns", "so far\ns"), rows)
