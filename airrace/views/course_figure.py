"""A course as a drawing in a file. It needs matplotlib, which comes with the extra `plot`."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from airrace.environment.air import StaticWind
from airrace.planning.clearances import ground_distance
from airrace.planning.race import Race
from airrace.quantities import KNOT
from airrace.track.course import Crowd, CrowdShape, SafetyLine
from airrace.track.element import Drawing
from airrace.track.polygons import Point
from airrace.trajectory import Array
from airrace.views.drawing import (
    AMBER,
    BLACK,
    BLUE,
    COLOURS,
    GREY,
    RED,
    Axes,
    Figure,
    names_as_they_are,
    new_figure,
    save_figure,
)
from airrace.views.labels import Box, placed
from airrace.views.map_model import MapModel, Mark

LEGIBLE = {"facecolor": "white", "edgecolor": "none", "alpha": 0.7, "pad": 0.8}
ARROW = 0.045  # of the extent, through gates
RASTER = 300  # points along an edge, for the distance from people


def draw_surroundings(axes: Axes, seen: MapModel, frame: Box) -> None:
    for crowd in seen.course.crowd:
        _draw_crowd(axes, crowd, frame)
    if seen.course.crowd:
        axes.plot([], [], color=RED, linewidth=3.0, label="crowd, shaded within its distance")
    for line in seen.lines:
        held = [passage.element.name for passage in seen.course.passages if line in passage.safety_lines]
        names = list(dict.fromkeys(held))
        legs = ", ".join(names[:3]) + (", ..." if len(names) > 3 else "")
        _draw_safety_line(axes, line, frame, f"{line.name}: hatched side forbidden\non the way to {legs}")
    corners = seen.course.airspace
    if corners:
        north, east = ([getattr(corner, name) for corner in (*corners, corners[0])] for name in ("north", "east"))
        axes.plot(east, north, color=BLUE, linewidth=1.2, linestyle=(0, (8, 3, 2, 3)), label="airspace", zorder=2)


def _draw_crowd(axes: Axes, crowd: Crowd, frame: Box) -> None:
    """Draw the people, and as a shade the ground within their distance."""
    east = np.linspace(frame.left, frame.left + frame.width, RASTER)
    north = np.linspace(frame.bottom, frame.bottom + frame.height, RASTER)
    away = ground_distance(np.stack(np.meshgrid(north, east, indexing="ij"), axis=-1).astype(np.float64), crowd)
    axes.contourf(east, north, away, levels=[0.0, crowd.distance], colors=[RED], alpha=0.12, zorder=1)
    if away.min() < crowd.distance < away.max():
        axes.contour(east, north, away, levels=[crowd.distance], colors=[RED], linewidths=0.8, linestyles="dashed")
    places = np.array([[corner.east, corner.north] for corner in crowd.corners])
    if crowd.shape is CrowdShape.AREA:
        axes.fill(*places.T, facecolor=RED, edgecolor=RED, alpha=0.6, zorder=2)
    elif crowd.shape is CrowdShape.LINE:
        axes.plot(*places.T, color=RED, linewidth=3.0, solid_capstyle="round", zorder=2)
    else:
        axes.plot(*places.T, color=RED, marker="o", markersize=7, linestyle="none", zorder=2)


def _draw_safety_line(axes: Axes, line: SafetyLine, frame: Box, label: str) -> None:
    """Draw a safety line from border to border: hatched on the forbidden side, dashed where its margin ends."""
    start = np.array([line.start.east, line.start.north])
    along = np.array([line.end.east - line.start.east, line.end.north - line.start.north])
    along /= np.hypot(*along)
    right = np.array([along[1], -along[0]])
    forbidden = -right if line.keep_right else right
    reach = math.hypot(frame.width, frame.height) + math.dist(start, (frame.left, frame.bottom))
    ends = np.array([start - reach * along, start + reach * along])
    band = np.concatenate([ends, ends[::-1] + 0.025 * reach * forbidden])
    axes.fill(*band.T, facecolor="none", edgecolor=AMBER, hatch="////", linewidth=0.0, zorder=1)
    axes.plot(*ends.T, color=AMBER, linewidth=1.8, zorder=2, label=label)
    if line.margin:
        axes.plot(*(ends - line.margin * forbidden).T, color=AMBER, linewidth=0.9, linestyle="dashed", zorder=2)


def joined(lines: list[Array]) -> Array:
    """Return some lines as one, with gaps between, shape (n, 2)."""
    gap = np.full((1, 2), np.nan)
    return np.concatenate([piece for line in lines for piece in (line, gap)])


def draw_elements(axes: Axes, seen: MapModel, frame: Box) -> None:
    """Draw to scale what is flown through, with an arrow for every course; then what is flown past and mere places."""
    groups: dict[str, list[tuple[Mark, Drawing]]] = {}
    for mark in seen.marks:
        drawing = mark.element.drawing()
        groups.setdefault(drawing.legend, []).append((mark, drawing))
    for legend, group in sorted(groups.items(), key=lambda entry: _rank(entry[1][0][1])):
        if any(drawing.window for _, drawing in group):
            _draw_courses(axes, [mark for mark, _ in group], ARROW * max(frame.width, frame.height))
        _draw_group(axes, group, legend)


def _rank(drawing: Drawing) -> int:
    return 0 if drawing.window else 1 if drawing.posts else 2


def _draw_group(axes: Axes, group: list[tuple[Mark, Drawing]], legend: str) -> None:
    """Draw elements that look alike, with their entry in the legend."""
    drawings = [drawing for _, drawing in group]
    windows = [_places(one.window) for one in drawings if one.window]
    reaches = [_places(one.reach) for one in drawings if one.reach]
    posts = [_places(one.posts) for one in drawings if one.posts]
    size = 3.5 if windows else 6
    marker = "o" if posts else "none"
    entry: dict[str, Any] = {"color": BLACK, "marker": marker, "markersize": size, "linestyle": "none"}
    if windows:
        north, east = joined(windows).T
        axes.plot(east, north, color=BLACK, linewidth=2.0, zorder=5, solid_capstyle="butt")
        entry |= {"linewidth": 2.0, "linestyle": "solid"}
    if reaches:
        north, east = joined(reaches).T
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


def _places(points: Sequence[Point]) -> Array:
    """Return north and east of some points, shape (n, 2), m."""
    return np.array([[point.north, point.east] for point in points])


def _draw_courses(axes: Axes, marks: Sequence[Mark], length: float) -> None:
    """Draw an arrow for every course flown through an element."""
    arrows = np.array([(mark.east, mark.north, heading) for mark in marks for heading in mark.headings]).reshape(-1, 3)
    axes.quiver(
        arrows[:, 0],
        arrows[:, 1],
        length * np.sin(arrows[:, 2]),
        length * np.cos(arrows[:, 2]),
        angles="xy",
        scale_units="xy",
        scale=1.0,
        color=BLACK,
        width=0.0025,
        headwidth=5.0,
        zorder=5,
    )


def write_labels(figure: Figure, axes: Axes, seen: MapModel, frame: Box) -> None:
    """Write names with the numbers of their passings, and names of crowds, where they hide least."""
    named = [
        (f"{mark.label}  {_numbers(mark, seen)}", (mark.east, mark.north), BLACK) for mark in seen.marks if mark.label
    ]
    for crowd in seen.course.crowd:
        middle = np.mean([[corner.east, corner.north] for corner in crowd.corners], axis=0)
        named.append((f"{crowd.name}, {crowd.distance:g} m", (float(middle[0]), float(middle[1])), RED))
    pixel = figure.dpi / 72.0
    to_pixels = axes.transData.transform
    places = [to_pixels(place) for _, place, _ in named]
    lines = [
        *(way.line for way in seen.ways),
        *(_span(mark, ARROW * max(frame.width, frame.height)) for mark in seen.marks),
    ]
    window = axes.get_window_extent()
    boxes = placed(
        [(float(across), float(up)) for across, up in places],
        [(5.4 * pixel * len(text), 12.0 * pixel) for text, _, _ in named],
        np.asarray(to_pixels(np.concatenate(lines)[:, ::-1])),
        Box(window.x0, window.y0, window.width, window.height),
        gap=7.0 * pixel,
    )
    for (text, _, colour), box in zip(named, boxes, strict=True):
        east, north = axes.transData.inverted().transform((box.left + 0.5 * box.width, box.bottom + 0.5 * box.height))
        axes.text(east, north, text, fontsize=9, ha="center", va="center", color=colour, zorder=9, bbox=LEGIBLE)


def _span(mark: Mark, arrow: float) -> Array:
    """Return points of what is drawn of a mark, north and east, shape (n, 2), m."""
    centre, reach = np.array([mark.north, mark.east]), mark.element.drawing().reach
    tips = [arrow * np.array([math.cos(heading), math.sin(heading)]) for heading in mark.headings]
    if reach is not None:
        tips = [_places(reach)[1] - centre]
    points = [np.outer(np.linspace(0.0, 1.0, 12), tip) for tip in tips]
    return centre + np.concatenate([np.zeros((1, 2)), *points])


def _numbers(mark: Mark, seen: MapModel) -> str:
    """Return the numbers of all passings of what stands on a spot, the second half of a quad among them."""
    here = [one for one in seen.marks if one is mark or (not one.label and _same_spot(one, mark))]
    return ", ".join(str(number) for number in sorted(number for one in here for number, _ in one.passings))


def _same_spot(one: Mark, other: Mark) -> bool:
    return (one.north, one.east) == (other.north, other.east)


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
