"""A table of where the nodes of a mesh went, and why."""

import numpy as np
from rich.table import Table
from rich.text import Text

from airrace.cli.tables import plain_table
from airrace.procedure.result import RefinementReason, StageResult
from airrace.runs.json_objects import REASONS
from airrace.trajectory import Array


def mesh_table(result: StageResult) -> Table:
    """Return a table of the legs: their intervals, the worst values measured, and the reasons for their lengths."""
    flown, record = result.trajectory, result.mesh
    steps = np.diff(flown.time)
    title = f"{result.stage.value}: {len(steps)} intervals, and what they were last cut or joined for"
    numbers = ("intervals", "shortest\nms", "longest\nms", "replay\ndefect", "Hamiltonian\nfrom -1")
    table = plain_table(title, ("leg to",), numbers, ())
    table.add_column("last cut or joined for")
    ends = [name.rpartition(" -> ")[2] for name in flown.phases]
    for name, first, last in zip(ends, flown.first_node, flown.first_node[1:], strict=False):
        leg = slice(first, last)
        measured = (_worst(record.defect, leg), _worst(record.drift, leg))
        cells = [name, str(last - first), *_lengths(steps[leg]), *measured, _reasons(record.why[leg])]
        table.add_row(*(Text(cell) for cell in cells))
    return table


def _reasons(why: np.ndarray) -> str:
    """Return how many intervals owe their length to which reason, the most frequent reason first."""
    counts = np.bincount(why, minlength=len(RefinementReason)).tolist()
    told = sorted(
        ((count, REASONS[reason]) for reason, count in zip(RefinementReason, counts, strict=True) if count),
        reverse=True,
    )
    return ", ".join(f"{reason} {count}" for count, reason in told)


def _lengths(steps: Array) -> tuple[str, str]:
    return f"{1e3 * steps.min():.0f}", f"{1e3 * steps.max():.0f}"


def _worst(values: Array, leg: slice) -> str:
    return f"{values[leg].max():.1e}"
