"""The kneeboard: pages for the pilot's knee, lap by lap, with a map, what to fly at every gate, and the cues between.

A page is A5, upright; two of them share a sheet of A4 that is folded. Nothing is smaller than nine points, and nothing
is told by a colour alone. The map of a lap is turned so that the lap fills its place; arrows tell north and the wind.
"""

import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from airrace.errors import UsageError
from airrace.flights.results import Flight, TimedCrossing
from airrace.flights.results.cues import VERTICAL, Cue, cues_of
from airrace.flights.results.flight import Lap, laps_of
from airrace.flights.sensitivity import LatenessPrice
from airrace.optimal_control.trajectory import Array
from airrace.pages.views.course_figure import draw_map
from airrace.pages.views.cue_tables import bank_text, course_text, gate_text, knee_texts, price_texts
from airrace.pages.views.drawing import (
    BLACK,
    GREY,
    Axes,
    Box,
    Figure,
    new_figure,
    place_labels,
    save_sheets,
    without_formulas,
)
from airrace.pages.views.flight_figures import race_time_text
from airrace.pages.views.map_model import map_model, round_length
from airrace.pages.views.tables import RACE, Units

PAGE_WIDTH, PAGE_HEIGHT = 5.83, 8.27  # inches: A5
POINTS = 72.0  # per inch
PAPERS = {"a5": 1, "a4": 2}
"""The papers by name, with the number of pages side by side on a sheet."""
MARGIN = 14.0
"""Around everything, points."""
SIZE = 9.0
"""Of all letters, points: a pilot reads no less on the knee in a turn."""
TITLE_SIZE = 12.0
"""Of the name of the course, points."""
PITCH = 12.0
"""Of lines, points."""
TITLE_PITCH = 20.0
"""The height of the first line of a page, points."""
LETTER_WIDTH = 0.52
"""On average, as a multiple of the size, measured on sentences in the figure's font."""
MAP_SHARE = 0.42
"""Of the page's height for the map of a lap."""
TURN_STEP = 3
"""Step between the angles to which the map is turned, deg."""
TURNING_GAIN = 1.08
"""Gain of scale for which the map is turned away from north at all: north up is easier to read."""
PAD = 0.09
"""Around the lap, as a share of the map's place: room for numbers."""
KEY = (96.0, 44.0)
"""Width and height of the key, points: north, wind and grid."""
COLUMNS = (
    ("#", 18.0, "right"),
    ("s", 54.0, "right"),
    ("where", 60.0, "left"),
    ("bank", 140.0, "left"),
    ("pull, g (mean)", 234.0, "left"),
    ("hgt", 340.0, "right"),
    ("out", 365.0, "right"),
    ("late", 392.0, "right"),
)
"""The columns of cues: heads, places from the left margin, points, and the side that is set there."""


@dataclass(frozen=True)
class KneeRow:
    """A line of the tables of a page.

    Attributes:
        texts: by column; a single one is a line of its own.
        is_gate: whether it tells of a passing rather than of a cue.
    """

    texts: tuple[str, ...]
    is_gate: bool = False


@dataclass(frozen=True)
class _Page:
    """What stands on a page: lines at its head, the map of a lap or None, and rows."""

    lap: Lap
    head: tuple[str, ...]
    has_map: bool
    rows: tuple[KneeRow, ...]


@without_formulas
def kneeboard_figures(
    flight: Flight,
    units: Units = RACE,
    *,
    per_sheet: int | None = 1,
    prices: Sequence[LatenessPrice] = (),
) -> list[Figure]:
    """Return the sheets of a kneeboard. Every lap begins a page.

    Gates have the names of the course, cues the numbers of `airrace brief`.

    Args:
        flight: the flight.
        units: of speeds, heights and distances.
        per_sheet: the number of pages side by side on a sheet, as of `PAPERS`; None for one sheet with all pages.
        prices: of lateness, one per cue; none where they were not asked for.
    """
    cues, pages = cues_of(flight), list[_Page]()
    head = _facts(flight, units, prices)
    for lap in laps_of(flight):
        pages += _pages_of_lap(flight, lap, cues, units, prices, () if pages else head)
    per_sheet = per_sheet or len(pages)
    sheets: list[Figure] = []
    for first in range(0, len(pages), per_sheet):
        sheet = new_figure(PAGE_WIDTH * per_sheet, PAGE_HEIGHT, layout=None)
        parts = np.atleast_1d(sheet.subfigures(1, per_sheet, wspace=0.0))
        for number, (part, page) in enumerate(zip(parts, pages[first : first + per_sheet], strict=False), first + 1):
            _draw_page(part, page, flight, cues, units, f"{number}/{len(pages)}")
        sheets.append(sheet)
    return sheets


def save_kneeboard(
    flight: Flight, path: Path, units: Units = RACE, *, paper: str = "a5", prices: Sequence[LatenessPrice] = ()
) -> None:
    """Write a kneeboard: as PDF on a paper of `PAPERS`, as a picture with all pages beside one another.

    Raises:
        UsageError: there is no such paper.
        StorageError: the system refused.
    """
    if paper not in PAPERS:
        raise UsageError(f"there is no paper {paper}; there are {' and '.join(PAPERS)}")
    per_sheet = PAPERS[paper] if path.suffix.lower() == ".pdf" else None
    save_sheets(kneeboard_figures(flight, units, per_sheet=per_sheet, prices=prices), path)


def _facts(flight: Flight, units: Units, prices: Sequence[LatenessPrice]) -> tuple[str, ...]:
    """Return what the flight is, the wind, and the limits, in lines."""
    wind, limit, rules = flight.air.wind, flight.limit("n_z"), flight.course.rules
    words = [f"{race_time_text(flight)}, {flight.label}"]
    if wind is not None and wind.speed != 0.0:
        origin = math.degrees(wind.origin) % 360.0
        words.append(f"wind from {origin:03.0f} with {wind.speed * units.per_m_s:.0f} {units.speed}")
    limits = [f"{limit.lower:g} g"] if math.isfinite(limit.lower) else []
    limits += [f"{limit.upper:g} g"] if math.isfinite(limit.upper) else []
    words += [f"limits {' to '.join(limits)}"] if limits else []
    for name, height in (("floor", rules.height.lower), ("ceiling", rules.height.upper)):
        if math.isfinite(height):
            words.append(f"{name} {height * units.per_m:.0f} {units.length}")
    legend = "hgt above the origin at the begin of a cue, out: track at its end, from true north"
    if prices:
        legend += f"; late: seconds lost by a cue {prices[0].delay:g} s late, MISS: no flight was found from there"
    return tuple(_wrap(f"{'; '.join(words)}; {flight.stamp.text}") + _wrap(legend))


def _wrap(text: str) -> list[str]:
    return textwrap.wrap(text, int((POINTS * PAGE_WIDTH - 2.0 * MARGIN) / (LETTER_WIDTH * SIZE)))


def _pages_of_lap(
    flight: Flight, lap: Lap, cues: Sequence[Cue], units: Units, prices: Sequence[LatenessPrice], head: tuple[str, ...]
) -> list[_Page]:
    """Return the pages of a lap: as many as its rows need, the map on the first.

    A passing and its first cue, a cue and its apex stay on one page.
    """
    rows: list[KneeRow] = []
    for leg in lap.legs:
        rows.append(KneeRow((_gate_words(leg.before, units),), is_gate=True))
        for cue in cues:
            if cue.leg.number == leg.number:
                price = price_texts(cue, prices[cue.number - 1])[0] if prices else ""
                rows.append(KneeRow((*knee_texts(cue, units), price)))
                if cue.apex is not None:
                    top = "over the top, " if cue.apex.over_the_top else ""
                    height = f"{cue.apex.height * units.per_m:.0f} {units.length}"
                    rows.append(KneeRow(("", "", f"{top}apex {height} at {cue.apex.time:.2f} s")))
    rows.append(KneeRow((_gate_words(lap.legs[-1].after, units),), is_gate=True))
    has_map = flight.has("x", "y")
    pages: list[_Page] = []
    while rows:
        room = POINTS * PAGE_HEIGHT - 2.0 * MARGIN - TITLE_PITCH - PITCH * (len(head) + 1)
        count = int((room - (MAP_SHARE * POINTS * PAGE_HEIGHT if has_map else 0.0)) / PITCH)
        count = rows_on_page(rows, count)
        pages.append(_Page(lap, head, has_map, tuple(rows[:count])))
        rows, head, has_map = rows[count:], (), False
    return pages


def rows_on_page(rows: Sequence[KneeRow], most: int) -> int:
    """Return how many of these rows stand on a page that takes at most so many, and one at least.

    A gate stands above its leg and an apex below its cue, unless there is nothing else on the page.
    """
    most = max(most, 1)
    count = min(most, len(rows))
    while count > 0 and count < len(rows) and (rows[count - 1].is_gate or not rows[count].texts[0]):
        count -= 1
    return count or min(most, len(rows))


def _gate_words(crossing: TimedCrossing, units: Units) -> str:
    """Return what to fly at a passing, e.g. `g4  12.27 s  195 kt  15 m  track 287  L10  climb 0  2.6 g`."""
    name = gate_text(crossing.name)[:16]
    if not crossing.found:
        return f"{name}  - missed"
    words = [name, f"{crossing.time:.2f} s"]
    speed, height, n_z = (crossing.value(quantity) for quantity in ("V_I", "height", "n_z"))
    course, bank, climb = (crossing.value(quantity) for quantity in ("chi", "mu", "gamma"))
    if math.isfinite(speed):
        words.append(f"IAS {speed * units.per_m_s:.0f} {units.speed}")
    if math.isfinite(height):
        words.append(f"{height * units.per_m:.0f} {units.length}")
    if not abs(climb) > VERTICAL:  # where neither has a meaning
        words += [f"track {course_text(course)}"] if math.isfinite(course) else []
        words += [bank_text(bank)] if math.isfinite(bank) else []
    words += [f"climb {math.degrees(climb):z.0f}"] if math.isfinite(climb) else []
    words += [f"{n_z:z.1f} g"] if math.isfinite(n_z) else []
    return "  ".join(words)


def _draw_page(figure: Figure, page: _Page, flight: Flight, cues: Sequence[Cue], units: Units, number: str) -> None:
    """Draw a page from its top to its bottom."""
    width, height = POINTS * PAGE_WIDTH, POINTS * PAGE_HEIGHT
    inner, top = width - 2.0 * MARGIN, height - MARGIN

    def text(across: float, up: float, words: str, size: float = SIZE, **style: Any) -> None:
        figure.text((MARGIN + across) / width, up / height, words, fontsize=size, va="center", **style)

    lap = f"LAP {page.lap.number}" if len(laps_of(flight)) > 1 else ""
    top -= 0.5 * TITLE_PITCH
    text(0.0, top, flight.course.name[:36], TITLE_SIZE, fontweight="bold")
    bar = {"facecolor": BLACK, "edgecolor": "none", "pad": 2.0}
    if lap:
        text(inner - 40.0, top, lap, TITLE_SIZE, fontweight="bold", color="white", ha="right", bbox=bar)
    text(inner, top, number, ha="right")
    top -= 0.5 * TITLE_PITCH
    for line in page.head:
        top -= PITCH
        text(0.0, top + 0.5 * PITCH, line)
    if page.has_map:
        bottom = top - MAP_SHARE * height
        plan = figure.add_axes((MARGIN / width, (bottom + 4.0) / height, inner / width, (top - bottom - 8.0) / height))
        _draw_plan(figure, plan, flight, page.lap, cues, units)
        top = bottom
    heads = [name if name != "hgt" else f"hgt {units.length}" for name, _, _ in COLUMNS]
    has_prices = any(len(row.texts) == len(COLUMNS) and row.texts[-1] for row in page.rows)
    rows = [KneeRow(tuple(heads if has_prices else heads[:-1])), *page.rows]
    for row in rows:
        top -= PITCH
        middle = top + 0.5 * PITCH
        if row.is_gate:
            band = {"facecolor": "#dddddd", "edgecolor": "none"}
            figure.add_artist(_rectangle(figure, (MARGIN / width, top / height), (inner / width, PITCH / height), band))
            text(2.0, middle, row.texts[0], fontweight="bold")
            continue
        for (name, across, side), words in zip(COLUMNS, row.texts, strict=False):
            weight = "bold" if name == "#" else "normal"
            text(across, middle, words, ha=side, fontweight=weight, color=GREY if row is rows[0] else BLACK)


def _rectangle(figure: Figure, corner: tuple[float, float], size: tuple[float, float], style: dict[str, Any]) -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle(corner, *size, transform=figure.transSubfigure, zorder=-1, **style)


def _draw_plan(figure: Figure, axes: Axes, flight: Flight, lap: Lap, cues: Sequence[Cue], units: Units) -> None:
    """Draw the map of a lap with its line, its gates, and the numbers of its cues."""
    from matplotlib.transforms import Affine2D

    map_ = map_model(flight.race)
    begin, end = lap.legs[0].before.time, lap.legs[-1].after.time
    inside = (flight.time >= begin) & (flight.time <= end) if math.isfinite(begin + end) else flight.time >= -math.inf
    track = np.stack([flight["y"], flight["x"]], axis=1)[inside]
    track = track[np.isfinite(track).all(axis=1)]
    edge = axes.get_window_extent()
    shape = edge.width / edge.height
    points = np.concatenate([track, np.array([(mark.east, mark.north) for mark in map_.marks]).reshape(-1, 2)])
    turn = fitting_turn(points, shape)
    frame = _turned_frame(points, turn, shape)
    axes.transData = Affine2D().rotate(turn) + axes.transData  # what is drawn from now on is turned
    draw_map(axes, map_, _frame_around(frame, turn))
    axes.plot(*track.T, color=BLACK, linewidth=1.5, zorder=5)
    axes.grid(visible=False)
    axes.set(xticks=[], yticks=[], aspect="auto")
    axes.set(xlim=(frame.left, frame.left + frame.width), ylim=(frame.bottom, frame.bottom + frame.height))
    step = _draw_grid(axes, frame, turn, units)
    for spine in axes.spines.values():
        spine.set(color="#c8c8c8", linewidth=0.6)
    box = _draw_keys(figure, axes, flight, track, turn, f"grid {step}")
    _draw_labels(axes, flight, lap, cues, track, box)


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


def _draw_keys(figure: Figure, axes: Axes, flight: Flight, track: Array, turn: float, grid: str) -> Box:
    """Draw north, wind and the grid's width in the emptiest corner; return where, in pixels."""
    edge, pixel = axes.get_window_extent(), figure.dpi / POINTS
    width, height = KEY[0] * pixel, KEY[1] * pixel
    seen = axes.transData.transform(track)
    corners = [
        Box(left, bottom, width, height)
        for left in (edge.x0, edge.x1 - width)
        for bottom in (edge.y1 - height, edge.y0)
    ]
    corner = min(corners, key=lambda corner: corner.count_inside(seen))
    whole = figure.bbox
    place = ((corner.left - whole.x0) / whole.width, (corner.bottom - whole.y0) / whole.height)
    key = figure.add_axes((*place, width / whole.width, height / whole.height), zorder=8)
    key.set(xlim=(0.0, KEY[0]), ylim=(0.0, KEY[1]), xticks=[], yticks=[])
    key.patch.set(alpha=0.8)
    for spine in key.spines.values():
        spine.set_visible(False)
    wind = flight.air.wind
    _draw_arrow(key, (22.0, 27.0), turn + 0.5 * math.pi, "N")
    if wind is not None and wind.speed != 0.0:
        towards = turn - 0.5 * math.pi - wind.origin  # it blows from its origin, which counts clockwise from north
        _draw_arrow(key, (68.0, 27.0), towards, "wind")
    key.text(4.0, 6.0, grid, fontsize=SIZE, va="center")
    return corner


def _draw_arrow(axes: Axes, middle: tuple[float, float], direction: float, name: str) -> None:
    """Draw an arrow through a point with its name before the head, so that neither touches the other."""
    step = 12.0 * np.array([math.cos(direction), math.sin(direction)])
    arrow = {"arrowstyle": "-|>", "color": BLACK, "linewidth": 1.0, "mutation_scale": 8, "shrinkA": 0, "shrinkB": 0}
    tail, head = np.array(middle) - step, np.array(middle) + 0.5 * step
    axes.annotate("", xy=head, xytext=tail, arrowprops=arrow)
    beyond = 0.4 if len(name) == 1 else 0.4 + 0.35 * abs(math.cos(direction))
    axes.text(*(head + beyond * step), name, fontsize=SIZE, ha="center", va="center")


def _draw_labels(axes: Axes, flight: Flight, lap: Lap, cues: Sequence[Cue], track: Array, key: Box) -> None:
    """Write the names of the gates and, at marks on the line, the numbers of the cues, off one another and the line."""
    gates: dict[tuple[float, float], list[str]] = {}
    for crossing in (lap.legs[0].before, *(leg.after for leg in lap.legs)):
        if crossing.found:
            where = crossing.passage.element.place or (crossing.value("x"), crossing.value("y"))
            names = gates.setdefault((round(where[0], 1), round(where[1], 1)), [])
            names += [gate_text(crossing.name)] if gate_text(crossing.name) not in names else []
    legs = {leg.number for leg in lap.legs}
    marks = [cue for cue in cues if cue.leg.number in legs]
    places = [np.interp([cue.time for cue in marks], flight.time, flight[name]) for name in ("y", "x")]
    axes.plot(*places, color=BLACK, marker="o", markersize=4.0, linestyle="none", zorder=6)
    texts = [",".join(names) for names in gates.values()] + [str(cue.number) for cue in marks]
    where = [(east, north) for north, east in gates] + list(zip(*(place.tolist() for place in places), strict=True))
    pixel, window = axes.figure.dpi / POINTS, axes.get_window_extent()
    sizes = [((0.66 * SIZE * len(text) + 2.0) * pixel, (SIZE + 1.0) * pixel) for text in texts]
    anchors = axes.transData.transform(np.array(where).reshape(-1, 2))
    hidden = np.concatenate([axes.transData.transform(track), np.repeat(_raster(key), 20, axis=0)])
    frame = Box(window.x0, window.y0, window.width, window.height)
    spots = [(float(across), float(up)) for across, up in anchors]
    boxes = place_labels(spots, sizes, hidden, frame, gap=3.0 * pixel)
    style: dict[str, Any] = {"fontsize": SIZE, "ha": "center", "va": "center", "zorder": 9, "color": BLACK}
    for number, (text, box) in enumerate(zip(texts, boxes, strict=True)):
        middle = axes.transData.inverted().transform((box.left + 0.5 * box.width, box.bottom + 0.5 * box.height))
        frame_style = {"facecolor": "white", "edgecolor": "none", "pad": 0.3, "alpha": 0.75}
        if number < len(gates):
            frame_style = {"facecolor": "white", "edgecolor": BLACK, "linewidth": 0.6, "pad": 0.8}
        axes.text(*middle, text, bbox=frame_style, fontweight="bold" if number < len(gates) else "normal", **style)


def _raster(box: Box) -> Array:
    """Return points all over a rectangle, shape (n, 2), which keep labels away from it."""
    across, up = np.linspace(box.left, box.left + box.width, 40), np.linspace(box.bottom, box.bottom + box.height, 40)
    return np.stack(np.meshgrid(across, up), axis=-1).reshape(-1, 2).astype(np.float64)
