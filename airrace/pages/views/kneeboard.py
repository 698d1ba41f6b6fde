"""The kneeboard: one page for the pilot's hand with map, table of the gates, and cues.

The map is turned so that the flight fills its place; arrows tell north and the wind. What the table and the cues
leave of the page is the map's.
"""

import itertools
import math
import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np

from airrace.flights.results import Flight
from airrace.flights.results.cues import Cue, cues_of
from airrace.flights.results.flight_facts import leg_facts
from airrace.optimal_control.trajectory import Array
from airrace.pages.views.course_figure import draw_map
from airrace.pages.views.cue_tables import cue_text, place_text
from airrace.pages.views.drawing import BLACK, BLUE, GREY, Axes, Box, Figure, new_figure, place_labels, without_formulas
from airrace.pages.views.flight_figures import draw_coloured, race_time_text
from airrace.pages.views.map_model import MapModel, map_model, round_length
from airrace.pages.views.tables import RACE, Column, Table, Units

PAGE_WIDTH, PAGE_HEIGHT = 5.83, 8.27  # inches: A5
POINTS = 72.0  # per inch


MARGIN = 14.0
"""Around everything."""
HEAD = 36.0
"""Heights of what stands above and below, without the lines that say what the flight is."""
FOOT = 11.0
"""Heights of what stands above and below, without the lines that say what the flight is."""
SMALL = 5.5
"""The size of the letters below, and of their lines."""
SMALL_PITCH = 7.0
"""The size of the letters below, and of their lines."""
ROW = 10.0
"""The height of a row of the table, at most."""
ROWS_MAX = 44
"""Of the table; of longer courses the middle is left out."""
TABLE_SHARE = 0.5
"""Of the page's height that the table may take."""
CUE_SIZES = (7.0, 6.5, 6.0, 5.5, 5.0)
"""Of the letters of the cues, the largest that fits is taken; a pilot reads 6 points on the knee."""
CUE_PITCH = 1.25
"""Of their lines, as a multiple of the size."""
LETTER_WIDTH = 0.53
"""On average, as a multiple of the size, measured on cues in the figure's font."""
MAP_SHARE = 0.28
"""Of the page's height for the map."""
TURN_STEP = 3
"""Step between the angles to which the map is turned, deg."""
TURNING_GAIN = 1.08
"""Gain of scale for which the map is turned away from north at all: north up is easier to read."""
PAD = 0.05
"""Around the flight, as a share of the map's place."""


def table_columns(units: Units) -> tuple[tuple[float, Column], ...]:
    """Return the table's columns and where they end, as shares of its width; of the second, which is set to the left,
    where it begins."""
    return (
        (0.03, Column("", form="d")),
        (0.055, Column("gate")),
        (0.255, Column("time s", form=".2f")),
        (0.355, Column(f"IAS {units.speed}", form=".0f")),
        (0.45, Column("track°", form="03.0f")),
        (0.54, Column(f"hgt {units.length}", form=".0f")),
        (0.63, Column("bank°", form="z.0f")),
        (0.73, Column("climb°", form="z.0f")),
        (0.80, Column("g at", form=".1f")),
        (0.89, Column("g most", form=".1f")),
        (1.0, Column("roll °/s", form=".0f")),
    )


@without_formulas
def kneeboard_figure(flight: Flight, units: Units = RACE) -> Figure:
    """Return a page, A5, upright, with the map, what to fly at every gate, and the cues on the way to it.

    Gates are numbered in the order of their passing; the map's labels are these numbers.

    Args:
        flight: the flight.
        units: of speeds, heights and distances.
    """
    width, height = POINTS * PAGE_WIDTH, POINTS * PAGE_HEIGHT
    limit, inner = flight.limit("n_z"), width - 2.0 * MARGIN
    footnote = "bank + right wing down; track over ground, from true north; heights above the track's origin"
    footnote += f"; at most {limit.upper:g} g" if math.isfinite(limit.upper) else ""
    stamp = textwrap.wrap(flight.stamp.text, int(inner / (LETTER_WIDTH * SMALL)))
    foot = FOOT + SMALL_PITCH * len(stamp)
    figure = new_figure(PAGE_WIDTH, PAGE_HEIGHT, layout=None)

    def text(across: float, up: float, words: str, size: float, **style: object) -> None:
        figure.text(across / width, up / height, words, fontsize=size, va="center", **style)

    def place(bottom: float, top: float) -> Axes:
        axes = figure.add_axes((MARGIN / width, bottom / height, inner / width, (top - bottom) / height))
        axes.set(xlim=(0.0, inner), ylim=(0.0, top - bottom))
        return axes

    text(MARGIN, height - 15.0, flight.course.name[:60], 12.0, fontweight="bold")
    text(MARGIN, height - 28.0, _subtitle(flight, units), 7.5, color=GREY)
    for row, line in enumerate([footnote, *stamp]):
        text(MARGIN, foot - 4.0 - SMALL_PITCH * row, line, SMALL, color=BLACK if row else GREY)
    rows = min(len(flight.crossings), ROWS_MAX) + 1
    table_height = min(ROW * rows, TABLE_SHARE * height)
    room = height - HEAD - foot - table_height - MAP_SHARE * height
    columns, size = _fit(cues_of(flight), units, inner, room)
    pitch = CUE_PITCH * size
    cues_height = pitch * max((len(lines) for lines in columns), default=0)
    for number, lines in enumerate(columns):
        for row, (words, weight) in enumerate(lines):
            across = MARGIN + number * 0.5 * (inner + 6.0)
            text(across, foot + cues_height - (row + 0.5) * pitch, words, size, fontweight=weight)
    table_bottom = foot + cues_height + (4.0 if cues_height else 0.0)
    table = place(table_bottom, table_bottom + table_height)
    table.axis("off")
    _draw_table(table, flight, units, inner, table_height)
    plan = place(table_bottom + table_height + 6.0, height - HEAD)
    _draw_plan(figure, plan, flight, units)
    return figure


def _subtitle(flight: Flight, units: Units) -> str:
    wind = flight.air.wind
    air = "still air"
    if wind is not None and wind.speed != 0.0:
        air = f"wind {math.degrees(wind.origin) % 360:.0f}° {wind.speed * units.per_m_s:.0f} {units.speed}"
    return f"{flight.aircraft.name}, {race_time_text(flight)}, {air}; {flight.label}"[:100]


def _fit(
    cues: Sequence[Cue], units: Units, inner: float, room: float
) -> tuple[tuple[list[tuple[str, str]], list[tuple[str, str]]], float]:
    """Return the lines of the cues in two columns, each with its weight, and the size of their letters.

    The largest that fits is taken; where none does, what does not fit is left out, and the last line says so.

    Args:
        cues: of the flight.
        units: of distances.
        inner: width of both columns, points.
        room: their height, points.
    """
    lines: list[tuple[str, str]] = []
    for size in CUE_SIZES:
        letters = int(0.5 * (inner - 6.0) / (LETTER_WIDTH * size))
        lines = list(itertools.chain.from_iterable(_lines(cue, units, letters) for cue in cues))
        rows = int(room / (CUE_PITCH * size))
        if len(lines) <= 2 * rows:
            begins = [row for row, (_, weight) in enumerate(lines) if weight == "bold"]  # a cue stays in one column
            breaks = [row for row in (*begins, len(lines)) if max(row, len(lines) - row) <= rows]
            if breaks:
                half = min(breaks, key=lambda row: abs(2 * row - len(lines)))
                return (lines[:half], lines[half:]), size
    rows = int(room / (CUE_PITCH * CUE_SIZES[-1]))
    return (lines[:rows], [*lines[rows : 2 * rows - 1], ("... and more: airrace brief", "bold")]), CUE_SIZES[-1]


def _lines(cue: Cue, units: Units, letters: int) -> list[tuple[str, str]]:
    """Return the lines of one cue: when and where, then what is done."""
    where = ", ".join(filter(None, (f"{cue.time:.2f} s", place_text(cue, units))))
    done = [
        line
        for action in cue_text(cue, units).replace(" -> ", "→").split("; ")
        for line in textwrap.wrap(action, letters - 2, initial_indent="  ", subsequent_indent="    ")
    ]
    return [(where[:letters], "bold"), *((line, "normal") for line in done)]


def _draw_plan(figure: Figure, axes: Axes, flight: Flight, units: Units) -> None:
    """Draw the map with the flight in the colours of the load factor, turned to fill its place."""
    from matplotlib.transforms import Affine2D

    map_ = map_model(flight.race).with_track(np.stack([flight["x"], flight["y"]], axis=1))
    edge = axes.get_window_extent()
    shape = edge.width / edge.height
    points = _points(map_, flight)
    turn = fitting_turn(points, shape)
    frame = _turned_frame(points, turn, shape)
    axes.transData = Affine2D().rotate(turn) + axes.transData  # what is drawn from now on is turned
    draw_map(axes, map_, _frame_around(frame, turn))
    line = draw_coloured(axes, flight["y"], flight["x"], flight, width=2.2)
    axes.grid(visible=False)
    axes.set(xticks=[], yticks=[], aspect="auto")
    axes.set(xlim=(frame.left, frame.left + frame.width), ylim=(frame.bottom, frame.bottom + frame.height))
    step = _draw_grid(axes, frame, turn, units)
    for spine in axes.spines.values():
        spine.set(color="#c8c8c8", linewidth=0.6)
    boxes = _draw_keys(figure, axes, flight, line, turn, f"grid {step}")
    _number_gates(axes, flight, points, boxes)


def _points(map_: MapModel, flight: Flight) -> Array:
    """Return what has to be seen, east and north, m, shape (n, 2)."""
    marks = [(mark.east, mark.north) for mark in map_.marks]
    is_finite = np.isfinite(flight["x"]) & np.isfinite(flight["y"])
    track = np.stack([flight["y"][is_finite], flight["x"][is_finite]], axis=1)
    return np.concatenate([track, np.array(marks).reshape(-1, 2)])


def _rotate(points: Array, turn: float) -> Array:
    """Return points turned counterclockwise, shape (n, 2)."""
    cos, sin = math.cos(turn), math.sin(turn)
    return points @ np.array([[cos, sin], [-sin, cos]])


def fitting_turn(points: Array, shape: float) -> float:
    """Return the angle by which to turn a map counterclockwise so that it fills a rectangle, rad, within a right angle
    of north; 0 where hardly anything is gained.

    Args:
        points: to be seen, east and north, m, shape (n, 2).
        shape: width over height of the rectangle.
    """

    def height(turn: float) -> float:
        across, up = np.ptp(_rotate(points, turn), axis=0).tolist()
        return max(across / shape, up)

    angles = [math.radians(angle) for angle in range(-90, 91, TURN_STEP)]
    best = min(angles, key=lambda angle: (round(height(angle), 6), abs(angle)))
    return best if height(0.0) > TURNING_GAIN * height(best) else 0.0


def _turned_frame(points: Array, turn: float, shape: float) -> Box:
    """Return the rectangle of the given shape around turned points, with some room, m."""
    turned = _rotate(points, turn)
    middle = 0.5 * (turned.min(axis=0) + turned.max(axis=0))
    across, up = np.ptp(turned, axis=0).tolist()
    height = max(across / shape, up, 1.0) / (1.0 - 2.0 * PAD)
    width = shape * height
    return Box(float(middle[0]) - 0.5 * width, float(middle[1]) - 0.5 * height, width, height)


def _frame_around(frame: Box, turn: float) -> Box:
    """Return the rectangle, east and north, m, that a turned frame lies in."""
    across, up = (frame.left, frame.left + frame.width), (frame.bottom, frame.bottom + frame.height)
    corners = _rotate(np.array([(x, y) for x in across for y in up]), -turn)
    (left, bottom), (right, top) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    return Box(left, bottom, right - left, top - bottom)


def _draw_grid(axes: Axes, frame: Box, turn: float, units: Units) -> str:
    """Draw lines to the north and east in a round distance; return that in words."""
    # At least four lines along the longer edge.
    round_step = round_length(units.per_m * max(frame.width, frame.height) / 4)
    step, whole = round_step / units.per_m, _frame_around(frame, turn)
    style: dict[str, Any] = {"color": "#e6e6e6", "linewidth": 0.6, "zorder": 0}
    bottom, top, left, right = whole.bottom, whole.bottom + whole.height, whole.left, whole.left + whole.width
    for east in np.arange(math.ceil(left / step) * step, right, step).tolist():
        axes.plot([east, east], [bottom, top], **style)
    for north in np.arange(math.ceil(bottom / step) * step, top, step).tolist():
        axes.plot([left, right], [north, north], **style)
    return f"{round_step:g} {units.length}"


KEY = (78.0, 62.0)
"""Width and height of the key, points: north, wind, grid, and the colours of the load factor."""


def _draw_keys(figure: Figure, axes: Axes, flight: Flight, line: Any, turn: float, grid: str) -> list[Box]:
    """Draw north, wind, the grid's width and the colours in the emptiest corner; return where, in pixels."""
    edge, pixel = axes.get_window_extent(), figure.dpi / POINTS
    width, height = KEY[0] * pixel, KEY[1] * pixel
    track = axes.transData.transform(np.stack([flight["y"], flight["x"]], axis=1))
    corners = [
        Box(left, bottom, width, height)
        for left in (edge.x0, edge.x1 - width)
        for bottom in (edge.y1 - height, edge.y0)
    ]
    corner = min(corners, key=lambda corner: corner.count_inside(track))
    across, up = figure.bbox.width, figure.bbox.height
    key = figure.add_axes((corner.left / across, corner.bottom / up, width / across, height / up), zorder=8)
    key.set(xlim=(0.0, KEY[0]), ylim=(0.0, KEY[1]), xticks=[], yticks=[])
    key.patch.set(alpha=0.8)
    for spine in key.spines.values():
        spine.set_visible(False)
    wind = flight.air.wind
    _draw_arrow(key, (18.0, 42.0), turn + 0.5 * math.pi, BLACK, "N")
    if wind is not None and wind.speed != 0.0:
        towards = turn - 0.5 * math.pi - wind.origin  # it blows from its origin, which counts clockwise from north
        _draw_arrow(key, (54.0, 42.0), towards, BLUE, "wind")
    key.text(4.0, 20.0, grid, fontsize=5.5, color=GREY, va="center")
    bar = figure.colorbar(line, cax=key.inset_axes((0.05, 0.17, 0.62, 0.06)), orientation="horizontal")
    bar.ax.tick_params(labelsize=5.5, length=1.5, pad=1.0)
    bar.outline.set_linewidth(0.3)
    key.text(KEY[0] - 21.0, 12.0, "g", fontsize=6.5, va="center")
    return [corner]


def _draw_arrow(axes: Axes, middle: tuple[float, float], direction: float, colour: str, name: str) -> None:
    """Draw an arrow through a point with its name before the head, so that neither touches the other."""
    step = 12.0 * np.array([math.cos(direction), math.sin(direction)])
    arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.0, "mutation_scale": 8, "shrinkA": 0, "shrinkB": 0}
    tail, head = np.array(middle) - step, np.array(middle) + 0.5 * step
    axes.annotate("", xy=head, xytext=tail, arrowprops=arrow)
    beyond = 0.4 if len(name) == 1 else 0.4 + 0.35 * abs(math.cos(direction))
    axes.text(*(head + beyond * step), name, fontsize=6.0, color=colour, ha="center", va="center")


def _number_gates(axes: Axes, flight: Flight, points: Array, taken: Sequence[Box]) -> None:
    """Write the numbers of the passings beside each place, off one another and off the line; a place that is passed
    several times has all of them."""
    places: dict[tuple[float, float], list[int]] = {}
    for number, crossing in enumerate(flight.crossings):
        if crossing.found:
            where = crossing.passage.element.place or (crossing.value("x"), crossing.value("y"))
            places.setdefault((round(where[0], 1), round(where[1], 1)), []).append(number)
    pixel, window = axes.figure.dpi / POINTS, axes.get_window_extent()
    texts = [",".join(map(str, numbers)) for numbers in places.values()]
    sizes = [((4.9 * len(text) + 3.0) * pixel, 9.5 * pixel) for text in texts]
    anchors = axes.transData.transform(np.array([(east, north) for north, east in places]).reshape(-1, 2))
    # The key is a label that has its place already.
    keys = [(box.left + 0.5 * box.width, box.bottom + 0.5 * box.height) for box in taken]
    hidden = np.concatenate([axes.transData.transform(points), np.repeat(np.array(keys).reshape(-1, 2), 400, axis=0)])
    hidden = np.concatenate([hidden, *(_raster(box) for box in taken)])
    boxes = place_labels(
        [(float(across), float(up)) for across, up in anchors],
        sizes,
        hidden,
        Box(window.x0, window.y0, window.width, window.height),
        gap=5.0 * pixel,
    )
    style: dict[str, Any] = {"fontsize": 7, "fontweight": "bold", "ha": "center", "va": "center", "zorder": 9}
    background = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.4}
    for text, box in zip(texts, boxes, strict=True):
        middle = axes.transData.inverted().transform((box.left + 0.5 * box.width, box.bottom + 0.5 * box.height))
        axes.text(*middle, text, color=BLACK, bbox=background, **style)


def _raster(box: Box) -> Array:
    """Return points all over a rectangle, shape (n, 2), which keep labels away from it."""
    across, up = np.linspace(box.left, box.left + box.width, 40), np.linspace(box.bottom, box.bottom + box.height, 40)
    return np.stack(np.meshgrid(across, up), axis=-1).reshape(-1, 2).astype(np.float64)


def _draw_table(axes: Axes, flight: Flight, units: Units, width: float, height: float) -> None:
    """Draw when and how every passing is made, and what the leg that leads to it asks for."""
    columns = table_columns(units)
    rows: list[tuple[str | float, ...]] = []
    for number, (crossing, leg) in enumerate(zip(flight.crossings, (None, *leg_facts(flight)), strict=True)):
        course, bank, climb = (math.degrees(crossing.value(name)) for name in ("chi", "mu", "gamma"))
        speed, above = crossing.value("V_I") * units.per_m_s, crossing.value("height") * units.per_m
        load = crossing.value("n_z")
        most = ("", "") if leg is None else (leg.n_z.greatest, math.degrees(leg.roll_rate))
        rows.append((number, crossing.name[:16], crossing.time, speed, course % 360.0, above, bank, climb, load, *most))
    heads, *texts = Table("", [column for _, column in columns], rows).texts()
    if len(texts) > ROWS_MAX:
        texts = [*texts[: ROWS_MAX - 2], ["", "...", *[""] * (len(columns) - 2)], texts[-1]]
    step = height / (len(texts) + 1)
    size = min(8.0, 0.76 * step)
    for row, line in enumerate((heads, *texts)):
        middle = height - step * (row + 0.5)
        if row % 2 == 0 and row:
            axes.axhspan(middle - 0.5 * step, middle + 0.5 * step, color="#f1f1f1", zorder=0)
        for column, ((share, _), text) in enumerate(zip(columns, line, strict=True)):
            weight = "bold" if column == 0 or row == 0 else "normal"
            side = "left" if column == 1 else "right"
            colour, across = GREY if row == 0 else BLACK, share * width
            axes.text(across, middle, text, fontsize=size, ha=side, va="center", color=colour, fontweight=weight)
