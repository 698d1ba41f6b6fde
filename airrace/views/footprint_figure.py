"""The drawing of a footprint: the map with the ground that falls meet, the flights, and the reach without power."""

from typing import Any

import numpy as np

from airrace.results import Flight
from airrace.safety.footprint import Footprint
from airrace.safety.outlines import Outline
from airrace.views.course_figure import draw_map, frame_of, map_size, write_labels
from airrace.views.drawing import BLUE, COLOURS, GREY, Axes, Figure, new_figure, without_formulas
from airrace.views.map_model import map_model

DISCLAIMER = "mechanics, not the scatter formula of an authority, and no prediction"
MAP_MAX = 9.0  # inches


@without_formulas
def footprint_figure(footprint: Footprint, flight: Flight) -> Figure:
    """Return the map of the race with a flight of it and what falls where."""
    line = np.stack([flight["x"], flight["y"]], axis=1)
    corners = np.concatenate([line, *(one.border for one in footprint.falls)])
    map_ = map_model(flight.race).with_track(corners)  # the frame holds all falls
    frame = frame_of(map_)
    width, height = map_size(frame, MAP_MAX)
    figure = new_figure(width, height + 2.2, layout="compressed")
    axes = figure.add_subplot()
    figure.suptitle(f"{map_.name}: what falls where", x=0.02, ha="left", fontweight="bold", fontsize=14)
    numbers = f"C_D A {footprint.drag_area:.3g} m², glide {footprint.glide.ratio:.1f} to 1"
    axes.set_title(
        f"{flight.label}, {flight.aircraft.name}, {numbers}\n{DISCLAIMER}", loc="left", fontsize=9, color=GREY
    )
    map_ = map_.with_track(line)
    draw_map(axes, map_, frame)
    _draw_outlines(axes, footprint.falls, COLOURS[1], "impacts after free fall,\nhalf the span around them")
    axes.plot(line[:, 1], line[:, 0], color=COLOURS[0], linewidth=1.6, label="the flight", zorder=4)
    hull, ways = footprint.glides.border, footprint.reach.distance
    east, north = frame.left + frame.width, frame.bottom + frame.height
    on_map = (hull > (frame.bottom, frame.left)) & (hull < (north, east))
    reaches = f"without power: glides straight\non of {ways.min():.0f} to {ways.max():.0f} m,"
    within = "or within this line" if on_map.all(axis=1).any() else "or anywhere on this map"
    style: dict[str, Any] = {"color": BLUE, "linewidth": 1.0, "linestyle": (0, (4, 3))}
    axes.plot(*np.vstack([hull, hull[:1]])[:, ::-1].T, **style, zorder=2)
    axes.plot([], [], **style, label=f"{reaches}\n{within}")
    axes.set(xlabel="east, m", ylabel="north, m")
    figure.legend(loc="outside lower center", frameon=False, fontsize=9, ncols=3)
    figure.draw_without_rendering()  # the positions of the axes are known only afterwards
    write_labels(figure, axes, map_, frame)
    return figure


def _draw_outlines(axes: Axes, outlines: tuple[Outline, ...], colour: str, label: str) -> None:
    """Draw pieces of ground with their holes."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    style: dict[str, Any] = {"facecolor": colour, "edgecolor": colour, "alpha": 0.45, "linewidth": 0.6, "zorder": 3}
    for number, one in enumerate(outlines):
        paths = [Path(np.vstack([ring, ring[:1]])[:, ::-1], closed=True) for ring in (one.border, *one.holes)]
        axes.add_patch(PathPatch(Path.make_compound_path(*paths), label=label if number == 0 else None, **style))
