"""Where the nodes of a mesh went, and why."""

import numpy as np
from rich.table import Table

from airrace.cli.tables import plain_table
from airrace.procedure.result import StageResult, Why
from airrace.runs.run_object import REASONS
from airrace.trajectory import Array


def mesh_table(result: StageResult) -> Table:
    """One row per leg: its intervals, why they are as long as they are, and what is measured of them at worst."""
    flown, record = result.trajectory, result.mesh
    steps = np.diff(flown.time)
    rows: list[list[str]] = []
    for name, first, last in zip(flown.phases, flown.first_node, flown.first_node[1:], strict=False):
        leg = slice(first, last)
        counts = np.bincount(record.why[leg], minlength=len(Why))
        reasons = [str(count) if count else "" for count in counts.tolist()]
        rows.append([name, str(last - first), *_lengths(steps[leg]), *reasons, *_worst(record.defect, leg)])
        rows[-1] += _worst(record.drift, leg)
    title = f"{result.stage.value}: {len(steps)} intervals, and what they were last cut or joined for"
    reasons = [REASONS[why].replace(" ", "\n") for why in Why]
    numbers = ("intervals", "shortest\nms", "longest\nms", *reasons, "replay\ndefect", "Hamiltonian\nfrom -1")
    return plain_table(title, ("leg",), numbers, rows)


def _lengths(steps: Array) -> tuple[str, str]:
    return f"{1e3 * steps.min():.0f}", f"{1e3 * steps.max():.0f}"


def _worst(values: Array, leg: slice) -> list[str]:
    return [f"{values[leg].max():.1e}"]
