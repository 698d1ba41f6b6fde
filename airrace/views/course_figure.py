"""A course as a drawing in a file. It needs matplotlib, which comes with the extra `plot`."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from airrace.environment.air import StaticWind
from airrace.planning.race import Race
from airrace.quantities import KNOT
from airrace.trajectory import Array
from airrace.views.course_drawing import LEGIBLE, draw_elements, draw_surroundings, joined, write_labels
from airrace.views.drawing import BLUE, COLOURS, GREY, Axes, Figure, names_as_they_are, new_figure, save_figure
from airrace.views.labels import Box
from airrace.views.map_model import MapModel

LONGER_EDGE, SHORTER_EDGE_MIN = 9.0, 4.0  # of the map, inches
LEGEND_WIDTH = 2.4  # inches
LABELS_MAX = 60  # elements; of longer courses no names are written
ARROWS_MAX = 120  # ways
LAPS_MAX = 6  # with an entry of their own in the legend
PAD = 0.06  # of the extent, around what is drawn


def draw_course(race: Race, seen: MapModel, path: Path) -> None:
    """Draw a course into a file, replacing it as a whole.

    Raises:
        StorageError: the system refused.
    """
    save_figure(course_figure(race, seen), path)


@names_as_they_are
def course_figure(race: Race, seen: MapModel) -> Figure:
    """Return the drawing: equal axes in metres, north up."""
    pad = PAD * max(seen.north - seen.south, seen.east - seen.west)
    frame = Box(seen.west - pad, seen.south - pad, seen.east - seen.west + 2 * pad, seen.north - seen.south + 2 * pad)
    scale = LONGER_EDGE / max(frame.width, frame.height)
    size = (max(scale * frame.width, SHORTER_EDGE_MIN), max(scale * frame.height, SHORTER_EDGE_MIN))
    figure = new_figure(size[0] + LEGEND_WIDTH + 1.0, size[1] + 1.0, layout="compressed")
    axes = figure.add_subplot()
    axes.set(
        xlim=(frame.left, frame.left + frame.width),
        ylim=(frame.bottom, frame.bottom + frame.height),
        xlabel="east, m",
        ylabel="north, m",
        aspect="equal",
    )
    axes.grid(color="#e6e6e6", linewidth=0.6)
    axes.set_axisbelow(True)
    figure.suptitle(seen.course.name, x=0.02, ha="left", fontweight="bold", fontsize=14)
    axes.set_title(_subtitle(race), loc="left", fontsize=9, color=GREY)
    draw_surroundings(axes, seen, frame)
    _draw_ways(axes, seen)
    draw_elements(axes, seen, frame)
    figure.legend(loc="outside right upper", frameon=False, fontsize=9)
    figure.draw_without_rendering()  # the positions of the axes are known only afterwards
    _draw_wind(axes, seen, race.air.wind)
    if len(seen.marks) <= LABELS_MAX:
        write_labels(figure, axes, seen, frame)
    return figure


def _subtitle(race: Race) -> str:
    n_z = min(race.course.rules.n_z.upper, race.aircraft.envelope.n_z.upper)
    return f"{race.aircraft.name}, at most {n_z:g} g\nnumbers count the passings; 0 is the start"


def _draw_ways(axes: Axes, seen: MapModel) -> None:
    """Draw one colour per lap; earlier laps are wider, so that all are seen where they coincide."""
    if not all(way.planned for way in seen.ways):
        axes.plot([], [], color=GREY, linewidth=1.4, linestyle=(0, (2, 2)), label="straight, turns not planned")
    laps = sorted({max(way.lap, 1) for way in seen.ways})
    for number, lap in enumerate(laps):
        colour = COLOURS[number % len(COLOURS)]
        width = 1.4 + 1.6 * (min(len(laps), 4) - 1 - min(number, 3))
        for planned in (True, False):
            lines = [way.line for way in seen.ways if max(way.lap, 1) == lap and way.planned is planned]
            if lines:
                north, east = joined(lines).T
                style = "solid" if planned else (0, (2, 2))
                axes.plot(east, north, color=colour, linewidth=width, linestyle=style, alpha=0.85, zorder=3)
        if number < LAPS_MAX:
            axes.plot([], [], color=colour, linewidth=width, label=f"lap {lap}, as planned")
        if len(seen.ways) <= ARROWS_MAX:
            _draw_directions(axes, [way.line for way in seen.ways if max(way.lap, 1) == lap], colour)


def _draw_directions(axes: Axes, lines: list[Array], colour: str) -> None:
    """Draw an arrowhead in the middle of every way."""
    for line in lines:
        middle = len(line) // 2
        (north, east), (before_north, before_east) = line[middle], line[middle - 1]
        if (north, east) != (before_north, before_east):
            style = {"arrowstyle": "-|>", "color": colour, "linewidth": 0.0, "mutation_scale": 15}
            axes.annotate("", xy=(east, north), xytext=(before_east, before_north), arrowprops=style, zorder=4)


def _draw_wind(axes: Axes, seen: MapModel, wind: StaticWind | None) -> None:
    """Draw an arrow of the wind in the corner that has least in it."""
    if wind is None or wind.speed == 0.0:
        return
    lines = [way.line for way in seen.ways] or [np.array([[mark.north, mark.east]]) for mark in seen.marks]
    points = np.concatenate(lines)[:, ::-1]
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    share = (points - (left, bottom)) / (right - left, top - bottom)
    corner = min(
        ((0.12, 0.9), (0.88, 0.9), (0.12, 0.12), (0.88, 0.12)),
        key=lambda corner: -float(np.hypot(*(share - corner).T).min()),
    )
    step = 22.0 * np.array([math.sin(wind.origin + math.pi), math.cos(wind.origin + math.pi)])  # points
    within: dict[str, Any] = {"xycoords": "axes fraction", "textcoords": "offset points", "zorder": 8}
    head, tail = axes.transAxes.transform(corner), axes.figure.dpi / 72.0 * step
    ends = [tuple(axes.transAxes.inverted().transform(head + sign * tail)) for sign in (1.0, -1.0)]
    arrow = {"arrowstyle": "-|>", "color": BLUE, "linewidth": 2.0, "mutation_scale": 16}
    axes.annotate("", xy=ends[0], xytext=ends[1], xycoords="axes fraction", arrowprops=arrow, zorder=8)
    said = f"wind {wind.speed / KNOT:.0f} kt"
    axes.annotate(
        said, xy=corner, xytext=(0.0, -36.0), ha="center", va="center", color=BLUE, fontsize=9, bbox=LEGIBLE, **within
    )
