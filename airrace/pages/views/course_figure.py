"""A course as a drawing in a file. It needs matplotlib, which comes with the extra `plot`."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from airrace.model.environment import StaticWind
from airrace.model.track.course import Crowd, CrowdShape
from airrace.model.track.element import Drawing
from airrace.optimal_control.quantities import KNOT
from airrace.optimal_control.trajectory import Array
from airrace.pages.views.drawing import (
    AMBER,
    BLACK,
    BLUE,
    COLOURS,
    GREY,
    RED,
    Axes,
    Box,
    Figure,
    new_figure,
    place_labels,
    without_formulas,
)
from airrace.pages.views.map_model import MapLine, MapModel, Mark, coordinates, round_length
from airrace.procedure.planning.clearance import ground_distance

LEGIBLE = {"facecolor": "white", "edgecolor": "none", "alpha": 0.7, "pad": 0.8}


ARROW = 0.045  # of the extent, through gates
RASTER = 300  # points along an edge, for the distance from people
LONGER_EDGE = 9.0  # of the map, inches
SHORTER_EDGE_MIN = 4.0  # inches
LEGEND_WIDTH = 2.4  # inches
LABELS_MAX = 60  # elements; of longer courses no names are written
ARROWS_MAX = 120  # ways
LAPS_MAX = 6  # with an entry of their own in the legend
PAD = 0.06  # of the extent, around what is drawn


def frame_of(map_: MapModel) -> Box:
    """Return the rectangle to be drawn, east and north, m: the map's frame with some room around it."""
    pad = PAD * max(map_.north - map_.south, map_.east - map_.west)
    width, height = map_.east - map_.west + 2 * pad, map_.north - map_.south + 2 * pad
    return Box(map_.west - pad, map_.south - pad, width, height)


def map_size(frame: Box, height_max: float) -> tuple[float, float]:
    """Return the size of a map above its legend, inches: wide enough for that."""
    return LONGER_EDGE, min(LONGER_EDGE * frame.height / frame.width, height_max)


def draw_map(axes: Axes, map_: MapModel, frame: Box, *, tracks: bool = False) -> None:
    """Draw the map on axes of equal scale, north up, with its tracks or without."""
    axes.set(
        xlim=(frame.left, frame.left + frame.width), ylim=(frame.bottom, frame.bottom + frame.height), aspect="equal"
    )
    axes.grid(color="#e6e6e6", linewidth=0.6)
    axes.set_axisbelow(True)
    for crowd in map_.crowd:
        _draw_crowd(axes, crowd, frame)
    if map_.crowd:
        axes.plot([], [], color=RED, linewidth=3.0, label="crowd, shaded within its distance")
    for number, (_, outline) in enumerate(map_.obstacles):
        label = "" if number else "obstacle"
        axes.fill(*outline[:, ::-1].T, facecolor=GREY, edgecolor=BLACK, linewidth=0.8, label=label, zorder=3)
    for line in map_.lines:
        _draw_safety_line(axes, line, frame)
    if map_.airspace is not None:
        north, east = map_.airspace.T
        axes.plot(east, north, color=BLUE, linewidth=1.2, linestyle=(0, (8, 3, 2, 3)), label="airspace", zorder=2)
    if tracks:
        _draw_ways(axes, map_)
    _draw_elements(axes, map_, frame)


def draw_scale(axes: Axes, frame: Box) -> None:
    """Draw a bar of a round length and an arrow to the north into the lower left corner."""
    length = round_length(0.25 * frame.width)
    left, bottom = frame.left + 0.03 * frame.width, frame.bottom + 0.03 * frame.height
    axes.plot([left, left + length], [bottom, bottom], color=BLACK, linewidth=3.0, solid_capstyle="butt", zorder=6)
    axes.text(left, bottom + 0.012 * frame.height, f"{length:g} m", fontsize=9, bbox=LEGIBLE, zorder=6)
    top = frame.bottom + 0.18 * frame.height
    style = {"arrowstyle": "-|>", "color": BLACK, "linewidth": 1.2}
    axes.annotate("", (left, top), (left, bottom + 0.07 * frame.height), arrowprops=style, zorder=6)
    axes.text(left, top, "N", fontsize=10, fontweight="bold", ha="center", va="bottom", zorder=6)


def _draw_crowd(axes: Axes, crowd: Crowd, frame: Box) -> None:
    """Draw the people, and as a shade the ground within their distance."""
    east = np.linspace(frame.left, frame.left + frame.width, RASTER)
    north = np.linspace(frame.bottom, frame.bottom + frame.height, RASTER)
    away = ground_distance(np.stack(np.meshgrid(north, east, indexing="ij"), axis=-1).astype(np.float64), crowd)
    axes.contourf(east, north, away, levels=[0.0, crowd.distance], colors=[RED], alpha=0.12, zorder=1)
    if away.min() < crowd.distance < away.max():
        axes.contour(east, north, away, levels=[crowd.distance], colors=[RED], linewidths=0.8, linestyles="dashed")
    north, east = coordinates(crowd.corners).T
    if crowd.shape is CrowdShape.AREA:
        axes.fill(east, north, facecolor=RED, edgecolor=RED, alpha=0.6, zorder=2)
    elif crowd.shape is CrowdShape.LINE:
        axes.plot(east, north, color=RED, linewidth=3.0, solid_capstyle="round", zorder=2)
    else:
        axes.plot(east, north, color=RED, marker="o", markersize=7, linestyle="none", zorder=2)


def _draw_safety_line(axes: Axes, line: MapLine, frame: Box) -> None:
    """Draw a safety line from border to border: hatched on the forbidden side, dashed where its margin ends."""
    legs = ", ".join(line.legs[:3]) + (", ..." if len(line.legs) > 3 else "")
    label = f"{line.line.name}: hatched side forbidden\non the way to {legs}"
    start, along, forbidden = line.ends[0, ::-1], line.along[::-1], line.forbidden[::-1]
    reach = math.hypot(frame.width, frame.height) + math.dist(start, (frame.left, frame.bottom))
    ends = np.array([start - reach * along, start + reach * along])
    band = np.concatenate([ends, ends[::-1] + 0.025 * reach * forbidden])
    axes.fill(*band.T, facecolor="none", edgecolor=AMBER, hatch="////", linewidth=0.0, zorder=1)
    axes.plot(*ends.T, color=AMBER, linewidth=1.8, zorder=2, label=label)
    if line.line.margin:
        margin = (ends - line.line.margin * forbidden).T
        axes.plot(*margin, color=AMBER, linewidth=0.9, linestyle="dashed", zorder=2)


def _joint(lines: Iterable[Array]) -> Array:
    """Return north and east of some lines as one with gaps between, shape (2, n)."""
    gap = np.full((1, 2), np.nan)
    return np.concatenate([piece for line in lines for piece in (line, gap)]).T


def _draw_elements(axes: Axes, map_: MapModel, frame: Box) -> None:
    """Draw to scale gates, with an arrow for every course; then pylons and mere places.

    Elements that look alike share an entry of the legend.
    """
    arrow = ARROW * max(frame.width, frame.height)
    groups: dict[str, list[tuple[Mark, Drawing]]] = {}
    for mark in map_.marks:
        drawing = mark.element.drawing()
        groups.setdefault(drawing.legend, []).append((mark, drawing))

    def rank(legend: str) -> int:
        drawing = groups[legend][0][1]
        if drawing.window:
            return 0
        return 1 if drawing.posts else 2

    for legend in sorted(groups, key=rank):
        group = groups[legend]
        windows = [coordinates(mark.window) for _, mark in group if mark.window]
        reaches = [coordinates(mark.reach) for _, mark in group if mark.reach]
        posts = [coordinates(mark.posts) for _, mark in group if mark.posts]
        size = 3.5 if windows else 6
        marker = "o" if posts else "none"
        entry: dict[str, Any] = {"color": BLACK, "marker": marker, "markersize": size, "linestyle": "none"}
        if windows:
            courses = [(mark.east, mark.north, heading) for mark, _ in group for heading in mark.headings]
            east, north, heading = np.array(courses).reshape(-1, 3).T
            style: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "width": 0.0025, "headwidth": 5}
            axes.quiver(east, north, arrow * np.sin(heading), arrow * np.cos(heading), color=BLACK, zorder=5, **style)
            north, east = _joint(windows)
            axes.plot(east, north, color=BLACK, linewidth=2.0, zorder=5, solid_capstyle="butt")
            entry |= {"linewidth": 2.0, "linestyle": "solid"}
        if reaches:
            north, east = _joint(reaches)
            axes.plot(east, north, color=GREY, linewidth=0.9, linestyle=(0, (1, 1.5)), zorder=4)
            entry |= {"color": GREY, "mec": BLACK, "mfc": BLACK, "linestyle": ":"}
        if posts:
            north, east = np.concatenate(posts).T
            axes.plot(east, north, color=BLACK, marker="o", markersize=size, linestyle="none", zorder=6)
        if not (windows or reaches or posts):
            north, east = [mark.north for mark, _ in group], [mark.east for mark, _ in group]
            axes.plot(east, north, color=BLACK, marker="+", markersize=10, linestyle="none", zorder=6)
            entry |= {"marker": "+", "markersize": 10}
        axes.plot([], [], label=legend, **entry)


def write_labels(figure: Figure, axes: Axes, map_: MapModel, frame: Box) -> None:
    """Write names with the numbers of their passings, and names of crowds, where they hide least; none if too many."""
    if len(map_.marks) > LABELS_MAX:
        return
    labels = [
        (f"{mark.label}  {_numbers(mark, map_)}", (mark.east, mark.north), BLACK) for mark in map_.marks if mark.label
    ]
    for crowd in map_.crowd:
        north, east = coordinates(crowd.corners).mean(axis=0).tolist()
        labels.append((f"{crowd.name}, {crowd.distance:g} m", (east, north), RED))
    for obstacle, outline in map_.obstacles:
        north, east = outline[:-1].mean(axis=0).tolist()
        labels.append((f"{obstacle.name}, {obstacle.height:g} m high", (east, north), GREY))
    pixel = figure.dpi / 72.0
    to_pixels, from_pixels = axes.transData.transform, axes.transData.inverted().transform
    arrow = ARROW * max(frame.width, frame.height)
    lines = [*(way.line for way in map_.ways), *(_points(mark, arrow) for mark in map_.marks)]
    window = axes.get_window_extent()
    boxes = place_labels(
        [(float(across), float(up)) for across, up in (to_pixels(place) for _, place, _ in labels)],
        [(5.4 * pixel * len(text), 12.0 * pixel) for text, _, _ in labels],
        np.asarray(to_pixels(np.concatenate(lines)[:, ::-1])),
        Box(window.x0, window.y0, window.width, window.height),
        gap=7.0 * pixel,
    )
    for (text, _, colour), box in zip(labels, boxes, strict=True):
        east, north = from_pixels((box.left + 0.5 * box.width, box.bottom + 0.5 * box.height))
        axes.text(east, north, text, fontsize=9, ha="center", va="center", color=colour, zorder=9, bbox=LEGIBLE)


def _points(mark: Mark, arrow: float) -> Array:
    """Return points of what is drawn of a mark, north and east, shape (n, 2), m."""
    centre, reach = np.array([mark.north, mark.east]), mark.element.drawing().reach
    tips = [arrow * np.array([math.cos(heading), math.sin(heading)]) for heading in mark.headings]
    if reach is not None:
        tips = [coordinates(reach)[1] - centre]
    points = [np.outer(np.linspace(0.0, 1.0, 12), tip) for tip in tips]
    return centre + np.concatenate([np.zeros((1, 2)), *points])


def _numbers(mark: Mark, map_: MapModel) -> str:
    """Return the numbers of all passings of what stands on a spot, the second half of a quad among them."""
    numbers = [number for number, _ in mark.passings]
    for second in map_.marks:
        if second is not mark and not second.label and (second.north, second.east) == (mark.north, mark.east):
            numbers += [number for number, _ in second.passings]
    return ", ".join(map(str, sorted(numbers)))


@without_formulas
def course_figure(map_: MapModel) -> Figure:
    """Return the drawing of a race from above: equal axes in metres, north up."""
    race, frame = map_.race, frame_of(map_)
    scale = LONGER_EDGE / max(frame.width, frame.height)
    size = (max(scale * frame.width, SHORTER_EDGE_MIN), max(scale * frame.height, SHORTER_EDGE_MIN))
    figure = new_figure(size[0] + LEGEND_WIDTH + 1.0, size[1] + 1.0, layout="compressed")
    axes = figure.add_subplot()
    figure.suptitle(map_.name, x=0.02, ha="left", fontweight="bold", fontsize=14)
    n_z = min(race.course.rules.n_z.upper, race.aircraft.envelope.n_z.upper)
    subtitle = f"{race.aircraft.name}, at most {n_z:g} g\nnumbers count the passings; 0 is the start"
    axes.set_title(subtitle, loc="left", fontsize=9, color=GREY)
    draw_map(axes, map_, frame, tracks=True)
    axes.set(xlabel="east, m", ylabel="north, m")
    figure.legend(loc="outside right upper", frameon=False, fontsize=9)
    figure.draw_without_rendering()  # the positions of the axes are known only afterwards
    if map_.wind is not None:
        _draw_wind(axes, map_, map_.wind)
    write_labels(figure, axes, map_, frame)
    return figure


def _draw_ways(axes: Axes, map_: MapModel) -> None:
    """Draw one colour per lap, with an arrowhead in the middle of every way.

    Earlier laps are wider, so that all are seen where they coincide.
    """
    if not all(way.planned for way in map_.ways):
        axes.plot([], [], color=GREY, linewidth=1.4, linestyle=(0, (2, 2)), label="straight, turns not planned")
    laps = sorted({max(way.lap, 1) for way in map_.ways})
    for number, lap in enumerate(laps):
        ways = [way for way in map_.ways if max(way.lap, 1) == lap]
        colour = COLOURS[number % len(COLOURS)]
        width = 1.4 + 1.6 * (min(len(laps), 4) - 1 - min(number, 3))
        for planned, style in ((True, "solid"), (False, (0, (2, 2)))):
            lines = [way.line for way in ways if way.planned is planned]
            if lines:
                north, east = _joint(lines)
                axes.plot(east, north, color=colour, linewidth=width, linestyle=style, alpha=0.85, zorder=3)
        if number < LAPS_MAX:
            axes.plot([], [], color=colour, linewidth=width, label=f"lap {lap}, as planned")
        for way in ways if len(map_.ways) <= ARROWS_MAX else ():
            head, tail = (tuple(way.line[len(way.line) // 2 - back, ::-1].tolist()) for back in (0, 1))
            if head != tail:
                arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": 0.0, "mutation_scale": 15}
                axes.annotate("", xy=head, xytext=tail, arrowprops=arrow, zorder=4)


def _draw_wind(axes: Axes, map_: MapModel, wind: StaticWind) -> None:
    """Draw an arrow of the wind in the corner that has least in it."""
    lines = [way.line for way in map_.ways] or [np.array([[mark.north, mark.east]]) for mark in map_.marks]
    points = np.concatenate(lines)[:, ::-1]
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    share = (points - (left, bottom)) / (right - left, top - bottom)
    corners = ((0.12, 0.9), (0.88, 0.9), (0.12, 0.12), (0.88, 0.12))
    corner = max(corners, key=lambda corner: float(np.hypot(*(share - corner).T).min()))
    step = 22.0 * np.array([math.sin(wind.origin + math.pi), math.cos(wind.origin + math.pi)])  # points
    middle, tail = axes.transAxes.transform(corner), axes.figure.dpi / 72.0 * step
    ends = [tuple(axes.transAxes.inverted().transform(middle + sign * tail)) for sign in (1.0, -1.0)]
    place: dict[str, Any] = {"xycoords": "axes fraction", "zorder": 8}
    arrow = {"arrowstyle": "-|>", "color": BLUE, "linewidth": 2.0, "mutation_scale": 16}
    axes.annotate("", xy=ends[0], xytext=ends[1], arrowprops=arrow, **place)
    place |= {"xytext": (0.0, -36.0), "textcoords": "offset points", "ha": "center", "va": "center"}
    axes.annotate(f"wind {wind.speed / KNOT:.0f} kt", xy=corner, color=BLUE, fontsize=9, bbox=LEGIBLE, **place)
