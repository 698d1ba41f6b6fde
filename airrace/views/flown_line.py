"""The line flown over a map of its course, coloured by a history."""

from dataclasses import replace
from typing import Any

import numpy as np

from airrace.results import Flight
from airrace.trajectory import Array
from airrace.views.course_figure import draw_elements, draw_surroundings
from airrace.views.drawing import Axes
from airrace.views.labels import Box
from airrace.views.map_model import MapModel, Way, map_model

COLOURS = "viridis"
PAD = 0.06  # of the extent, around what is drawn


def flight_map(flight: Flight) -> tuple[MapModel, Box]:
    """Return the course from above with the line flown in the place of the planned ways, and the frame that holds
    both.
    """
    seen = map_model(flight.race)
    line = np.stack([flight["x"], flight["y"]], axis=1)
    (south, west), (north, east) = line.min(axis=0).tolist(), line.max(axis=0).tolist()
    south, west = min(south, seen.south), min(west, seen.west)
    north, east = max(north, seen.north), max(east, seen.east)
    pad = PAD * max(north - south, east - west)
    frame = Box(west - pad, south - pad, east - west + 2 * pad, north - south + 2 * pad)
    seen = replace(seen, ways=(Way(1, line, planned=True),), south=south, north=north, west=west, east=east)
    return seen, frame


def draw_map(axes: Axes, flight: Flight, seen: MapModel, frame: Box, colour: str) -> Any:
    """Draw course and line on axes of equal scale, north up.

    Args:
        axes: to be drawn on.
        flight: whose line it is.
        seen, frame: of `flight_map`.
        colour: the history that colours the line.

    Returns:
        The coloured line, for a colour bar.
    """
    axes.set(
        xlim=(frame.left, frame.left + frame.width),
        ylim=(frame.bottom, frame.bottom + frame.height),
        aspect="equal",
    )
    axes.grid(color="#e6e6e6", linewidth=0.6)
    axes.set_axisbelow(True)
    draw_surroundings(axes, seen, frame)
    draw_elements(axes, seen, frame)
    return draw_coloured(axes, flight["y"], flight["x"], flight.values(colour), width=2.4)


def draw_coloured(axes: Axes, across: Array, up: Array, values: Array, *, width: float) -> Any:
    """Return a line in the colours of some values at its points, each of shape (n,)."""
    from matplotlib.collections import LineCollection

    points = np.stack([across, up], axis=1)
    pieces = LineCollection(np.stack([points[:-1], points[1:]], axis=1).tolist(), cmap=COLOURS, linewidths=width)
    pieces.set_array(0.5 * (values[1:] + values[:-1]))
    pieces.set_capstyle("round")
    pieces.set_zorder(3)
    return axes.add_collection(pieces)
