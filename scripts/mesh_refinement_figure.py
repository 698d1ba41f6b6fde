"""The figure of `mesh_refinement.py`: accuracy against nodes and seconds, and where the nodes are. Needs matplotlib."""

from collections.abc import Callable, Sequence
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator
from mesh_comparison import FINER, Comparison, Measured

from airrace.procedure.result import RefinementReason

BLUE, ORANGE, BLACK, GREY = "#0072b2", "#d55e00", "#222222", "#777777"
DOTS_PER_INCH = 110
LEAST = 5e-3  # ms, of an error that is drawn
REASONS = {
    RefinementReason.FIRST: ("first mesh", "#999999"),
    RefinementReason.CALM: ("joined where calm", "#009e73"),
    RefinementReason.HAMILTONIAN: ("Hamiltonian", "#d55e00"),
    RefinementReason.RACE_TIME: ("race time", "#cc79a7"),
    RefinementReason.INTEGRATION: ("replay", "#56b4e9"),
    RefinementReason.LIMITS: ("limits", "#e69f00"),
}
TITLE = "intervals of the answer, by what they were last made shorter or longer for"

Value = Callable[[Comparison, Measured], float]


def nodes(_: Comparison, one: Measured) -> float:
    return one.nodes


def seconds(_: Comparison, one: Measured) -> float:
    return one.cumulated


def error(course: Comparison, one: Measured) -> float:
    return max(1e3 * course.error(one), LEAST)


def drift(_: Comparison, one: Measured) -> float:
    return one.drift


ROWS: tuple[tuple[Value, Value, str, str], ...] = (
    (nodes, error, "nodes", "error of the race time, ms"),
    (nodes, drift, "nodes", "largest drift of the Hamiltonian"),
    (seconds, error, "seconds in the solver, cumulated", "error of the race time, ms"),
)


def draw(courses: Sequence[Comparison], path: Path) -> None:
    """One column per course, and the intervals of the first one below."""
    figure = plt.figure(figsize=(max(3.1 * len(courses), 8.0), 12.5), layout="constrained")
    upper, lower = figure.subfigures(2, 1, height_ratios=(len(ROWS), 1.35))
    panels = upper.subplots(len(ROWS), len(courses), sharey="row", sharex="row", squeeze=False)
    for axes_of_row, (across, up, x_label, y_label) in zip(panels, ROWS, strict=True):
        for axes, course in zip(axes_of_row, courses, strict=True):
            draw_chains(axes, course, across, up)
            axes.set(xlabel=x_label)
            for axis in (axes.xaxis, axes.yaxis):
                axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            if across is nodes:
                axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axes.xaxis.set_minor_formatter(FuncFormatter(lambda *_: ""))
        axes_of_row[0].set(ylabel=y_label)
    for axes, course in zip(panels[0], courses, strict=True):
        axes.set_title(course.name)
    columns = 4 if len(courses) > 2 else 2
    labels = panels[0, 0].get_legend_handles_labels()
    upper.legend(*labels, loc="outside upper center", ncols=columns, frameon=False)
    intervals = lower.subplots()
    draw_intervals(intervals, courses[0])
    lower.legend(
        *intervals.get_legend_handles_labels(), loc="outside lower center", ncols=6, frameon=False, title=TITLE
    )
    for axes in figure.axes:
        axes.grid(color="#e6e6e6", linewidth=0.6)
        axes.set_axisbelow(True)
    figure.savefig(path, dpi=DOTS_PER_INCH, metadata={"Software": None})
    plt.close(figure)


def draw_chains(axes: Axes, course: Comparison, across: Value, up: Value) -> None:
    """Both ways of refining, on logarithmic axes."""
    steps = {one.spacing: one for one in course.uniform}
    straight = (course.refined[0], *(steps[spacing] for spacing in FINER if spacing in steps))
    uniform = straight if across is seconds else course.uniform  # what lies between or was solved backwards costs extra
    for meshes, colour, style, label in (
        (uniform, ORANGE, "s--", "uniform meshes"),
        (course.refined, BLUE, "o-", "the procedure's meshes"),
    ):
        x, y = ([value(course, one) for one in meshes] for value in (across, up))
        axes.loglog(x, y, style, color=colour, linewidth=1.2, markersize=3.5, label=label)
    at = across(course, course.answer), up(course, course.answer)
    axes.loglog(*at, "o", color=BLUE, markersize=9, markerfacecolor="none", label="its answer")
    axes.axhline(at[1], color=BLUE, linewidth=0.7, linestyle=":")
    if up is error:
        label = "how far the last halving moved the race time compared with"
        axes.axhspan(LEAST, max(1e3 * course.uncertainty, LEAST), color=GREY, alpha=0.15, linewidth=0.0, label=label)


def draw_intervals(axes: Axes, course: Comparison) -> None:
    """How long the intervals are along the race, why, and the passings."""
    flown, why = course.result.trajectory, course.result.mesh.why
    steps, middle = np.diff(flown.time), 0.5 * (flown.time[1:] + flown.time[:-1])
    axes.stairs(steps, flown.time, baseline=None, color=GREY, linewidth=0.6)
    for reason, (text, colour) in REASONS.items():
        mine = why == reason
        if mine.any():
            label = f"{int(mine.sum())}: {text}"
            axes.semilogy(middle[mine], steps[mine], ".", color=colour, markersize=5, label=label, linestyle="none")
    first = course.as_accurate("both")
    one = first or course.uniform[-1]
    text = f"{one.nodes} uniform nodes, {'as accurate' if first else 'still less accurate'}"
    axes.axhline(one.spacing, color=ORANGE, linestyle="--", linewidth=1.2, label=text)
    for split in course.result.splits:
        axes.axvline(split.time, color=BLACK, linewidth=0.6, linestyle=":")
        style = {"rotation": 90, "fontsize": 7, "color": GREY, "ha": "center", "va": "bottom"}
        axes.text(split.time, 1.01, split.name, transform=axes.get_xaxis_transform(), **style)
    axes.set(xlabel=f"time along {course.name}, s", ylabel="length of an interval, s", xlim=(0.0, flown.time[-1]))
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(FuncFormatter(lambda *_: ""))
