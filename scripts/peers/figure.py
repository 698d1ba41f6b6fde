"""The figure of `benchmark_peers.py`: errors against processor seconds. Needs matplotlib."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
from matplotlib.ticker import FuncFormatter

COLOURS = ("#56b4e9", "#0072b2", "#222222", "#d55e00", "#009e73")
DOTS_PER_INCH = 110
LEAST = 1e-3  # ms and mm, of an error that is drawn


def draw(rows: Sequence[Any], reference: float, path: Path) -> None:
    """One line per tool; solving alone filled, with setting up open."""
    figure, panels = plt.subplots(1, 2, figsize=(9.5, 4.2), layout="constrained", sharex=True)
    errors = (
        (lambda row: 1e3 * row.position_error, "largest position error of a phase, mm"),
        (lambda row: 1e3 * abs(row.race_time - reference), "error of the race time, ms"),
    )
    tools = list(dict.fromkeys(row.tool for row in rows))
    for axes, (error, label) in zip(panels, errors, strict=True):
        for tool, colour in zip(tools, COLOURS, strict=False):
            mine = [row for row in rows if row.tool == tool and row.answers[-1].flight is not None]
            up = [max(error(row), LEAST) for row in mine]
            solving = [row.median(lambda answer: answer.processor_solve) for row in mine]
            everything = [row.median(lambda answer: answer.processor) for row in mine]
            axes.loglog(solving, up, "o-", color=colour, markersize=5, linewidth=1.2, label=tool)
            axes.loglog(everything, up, "o--", color=colour, markersize=5, linewidth=0.7, markerfacecolor="none")
            for row, x, y in zip(mine, solving, up, strict=True):
                axes.annotate(str(row.segments), (x, y), (4, 4), textcoords="offset points", fontsize=7, color=colour)
        axes.set(xlabel="processor seconds; open: with set-up", ylabel=label)
        axes.grid(color="#e6e6e6", linewidth=0.6)
        axes.set_axisbelow(True)
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False)
    figure.savefig(path, dpi=DOTS_PER_INCH, metadata={"Software": None})
    plt.close(figure)
