"""Safety as people see it: what falls where, on the map and in tables, and the envelope of disturbed flights."""

import math
from typing import Any

import numpy as np

from airrace.flights.results import Flight
from airrace.flights.results.flight import passings_around
from airrace.flights.results.stamp import wind_text
from airrace.flights.safety.footprint import NOT_AN_AUTHORITYS, Footprint
from airrace.flights.safety.monte_carlo import SafetyResult
from airrace.flights.safety.outlines import Outline
from airrace.optimal_control.quantities import KNOT
from airrace.optimal_control.trajectory import Array
from airrace.pages.views.course_figure import draw_map, draw_scale, frame_of, map_size, write_labels
from airrace.pages.views.drawing import BLACK, BLUE, COLOURS, GREY, Axes, Figure, new_figure, without_formulas
from airrace.pages.views.map_model import map_model
from airrace.pages.views.tables import Column, Table

DISCLAIMER = "mechanics, not the scatter formula of an authority, and no prediction"
FOOTPRINT_MAX = 9.0  # inches, the height of the map


@without_formulas
def case_map(flight: Flight) -> Figure:
    """Return the map of the course with the line that is flown, a scale and north."""
    line = np.stack([flight["x"], flight["y"]], axis=1)
    map_ = map_model(flight.race).with_track(line)
    frame = frame_of(map_)
    width, height = map_size(frame, FOOTPRINT_MAX)
    figure = new_figure(width, height + 1.2, layout="compressed")
    axes = figure.add_subplot()
    draw_map(axes, map_, frame)
    axes.plot(line[:, 1], line[:, 0], color=COLOURS[0], linewidth=1.6, label="the line flown", zorder=4)
    draw_scale(axes, frame)
    axes.set(xlabel="east, m", ylabel="north, m")
    figure.legend(loc="outside lower center", frameon=False, fontsize=11, ncols=2)
    figure.draw_without_rendering()  # the positions of the axes are known only afterwards
    write_labels(figure, axes, map_, frame)
    return figure


@without_formulas
def footprint_figure(footprint: Footprint, flight: Flight, everywhere: tuple[Outline, ...] = ()) -> Figure:
    """Return the map of the race with a flight of it and what falls where.

    Args:
        footprint: of the flight.
        flight: the optimum.
        everywhere: the ground that falls of all closed-loop flights along it meet.
    """
    line = np.stack([flight["x"], flight["y"]], axis=1)
    corners = np.concatenate([line, *(fall.border for fall in (*footprint.falls, *everywhere))])
    map_ = map_model(flight.race).with_track(corners)  # the frame holds all falls
    frame = frame_of(map_)
    width, height = map_size(frame, FOOTPRINT_MAX)
    figure = new_figure(width, height + 2.2, layout="compressed")
    axes = figure.add_subplot()
    figure.suptitle(f"{map_.name}: what falls where", x=0.02, ha="left", fontweight="bold", fontsize=14)
    numbers = f"C_D A {footprint.drag_area:.3g} m², glide {footprint.glide.ratio:.1f} to 1"
    axes.set_title(
        f"{flight.label}, {flight.aircraft.name}, {numbers}\n{DISCLAIMER}", loc="left", fontsize=9, color=GREY
    )
    map_ = map_.with_track(line)
    draw_map(axes, map_, frame)
    _draw_outlines(axes, everywhere, COLOURS[4 % len(COLOURS)], "the same of all closed-loop flights")
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
    draw_scale(axes, frame)
    figure.legend(loc="outside lower center", frameon=False, fontsize=9, ncols=3)
    figure.draw_without_rendering()  # the positions of the axes are known only afterwards
    write_labels(figure, axes, map_, frame)
    return figure


def _draw_outlines(axes: Axes, outlines: tuple[Outline, ...], colour: str, label: str) -> None:
    """Draw pieces of ground with their holes."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    style: dict[str, Any] = {"facecolor": colour, "edgecolor": colour, "alpha": 0.45, "linewidth": 0.6, "zorder": 3}
    for number, outline in enumerate(outlines):
        paths = [Path(np.vstack([ring, ring[:1]])[:, ::-1], closed=True) for ring in (outline.border, *outline.holes)]
        axes.add_patch(PathPatch(Path.make_compound_path(*paths), label=label if number == 0 else None, **style))


_FALLS = (
    *(Column("free fall"), Column("way", "m", ".0f"), Column("from", "s", ".2f"), Column("speed", "kt", ".0f")),
    *(Column("height", "m", ".0f"), Column("leg", wraps=True)),
)
_FALL_NAMES = {"vacuum": "in vacuum", "drag": "with drag", "level": "V sqrt(2h/g)"}
_PEOPLE = (
    *(Column("people", wraps=True), Column("rule", "m", ".0f"), Column("least", "m", ".0f")),
    *(Column("from", "s", ".2f"), Column("leg", wraps=True), Column("hit", "s", ".2f")),
    *(Column("area", "m2", ".0f"), Column("glide", "s", ".1f"), Column("turn", "s", ".1f")),
)
_BORDERS = (
    *(Column("line or border", wraps=True), Column("least", "m", "z.0f"), Column("from", "s", ".2f")),
    *(Column("leg", wraps=True), Column("beyond", "s", ".2f")),
)
_HOW_TO_READ = (
    "least: distance of the nearest impact, half the span taken off. hit: for how long a fall that begins meanwhile "
    "hits people; area: of theirs under the footprint. glide: for how long a glide straight on leads over them; turn: "
    "for how long they lie within reach of a glide behind a turn."
)
NO_PEOPLE = "the course names no people (key `crowd`): no distance from them was measured"


def falls_table(footprint: Footprint, flight: Flight) -> Table:
    """Return the longest way over ground of every kind of fall."""
    rows: list[tuple[str | float, ...]] = []
    for key, way in footprint.lengths.items():
        row = int(way.argmax())
        state = (float(footprint.states.speed[row]) / KNOT, float(footprint.states.place[row, 2]))
        rows.append(
            (_FALL_NAMES[key], float(way[row]), float(footprint.time[row]), *state, leg_at(flight, footprint.time[row]))
        )
    return Table(f"{flight.label}: the longest ways over ground", _FALLS, rows)


def people_table(footprint: Footprint, flight: Flight) -> Table:
    """Return how near to people impacts and glides come; no row, and a note that says so, where there are none."""
    rows = [
        (
            *(crowd.crowd.name, crowd.crowd.distance, crowd.distance, crowd.time, leg_at(flight, crowd.time)),
            *(crowd.seconds, crowd.overlap, crowd.straight_seconds, crowd.turned_seconds),
        )
        for crowd in footprint.crowds
    ]
    return Table("impacts and people", _PEOPLE, rows, [_HOW_TO_READ if rows else NO_PEOPLE])


def borders_table(footprint: Footprint, flight: Flight) -> Table:
    """Return how near to safety lines and the border impacts come; no row where the course names none."""
    rows = [
        (border.name, border.distance, border.time, leg_at(flight, border.time), border.seconds)
        for border in footprint.borders
    ]
    note = "least: that of the nearest impact on the allowed side, half the span taken off; negative: beyond. beyond: "
    note += "for how long a fall that begins meanwhile ends beyond."
    return Table("impacts, lines and border", _BORDERS, rows, [note] if rows else [])


def footprint_facts(footprint: Footprint, flight: Flight) -> list[str]:
    """Return the numbers that a footprint rests on, and what it is not, a sentence each."""
    shortest, longest = footprint.reach.distance.min(), footprint.reach.distance.max()
    glide = f"without power: {footprint.glide.ratio:.1f} to 1 at {footprint.glide.speed / KNOT:.0f} kt"
    return [
        f"{glide} ({footprint.glide_source}), {shortest:.0f} to {longest:.0f} m straight on",
        f"drag area: {footprint.drag_area:.3g} m2 ({footprint.drag_source})",
        f"ground: flat, at the height of the course's origin; {wind_text(flight.air.wind)}",
        NOT_AN_AUTHORITYS,
    ]


def leg_at(flight: Flight, time: float) -> str:
    """Return the leg on which a time lies, e.g. `1:g3 -> 1:g4`; empty where a passing is missing or none is near."""
    if not all(crossing.found for crossing in flight.crossings) or not math.isfinite(time):
        return ""
    before, after = passings_around(flight, time)
    return f"{before.name} -> {after.name}"


BANDS = ((0, 4, "99.7 %", "#f6cfae"), (1, 3, "95 %", "#e08b3c"))
"""The quantiles of `SafetyResult.envelope` between which so many flights lie, and the colour of what is between."""
DEVIATIONS = (
    ("to the right, m", 0, 1.0),
    ("upwards, m", 1, 1.0),
    ("bank, deg", 2, 180.0 / math.pi),
    ("load, g", 3, 1.0),
)
"""Label, row of the envelope, and factor from SI."""
WIDENINGS = (50.0, 20.0, 10.0, 5.0, 2.0, 1.0)


BAND_WIDTH = 0.006
"""The share of the map's longer edge that half of the band's half widths should not exceed: a dense line is as wide."""
NUMBERS_APART = 0.014
"""The share of a strip by which the numbers of passings stand apart at least; of those nearer to one another one is
written.
"""
ENVELOPE_MAX, STRIP_HEIGHT = 6.4, 1.1  # inches: of the map and of a strip; a page of A4 holds all of it


@without_formulas
def envelope_figure(result: SafetyResult, flight: Flight) -> Figure:
    """Return the map of the race with the envelope of its flights, drawn wider than it is, over their deviations.

    Args:
        result: of closed-loop flights; enough of them that 95 % are known.
        flight: the optimum that they follow.
    """
    line = np.stack([np.interp(result.clock, flight.time, flight[name]) for name in ("x", "y")], axis=1)
    map_ = map_model(flight.race).with_track(line)
    frame = frame_of(map_)
    width, height = map_size(frame, ENVELOPE_MAX)
    figure = new_figure(width, height + len(DEVIATIONS) * STRIP_HEIGHT + 1.8)
    above, below = figure.add_gridspec(2, 1, height_ratios=(height, len(DEVIATIONS) * STRIP_HEIGHT))
    axes = figure.add_subplot(above)
    half = np.fmax.reduce(np.abs(result.envelope[:, 0]))  # NaN where no quantile is known
    usual = float(np.median(half[np.isfinite(half)])) if np.isfinite(half).any() else 0.0
    share = BAND_WIDTH * max(frame.width, frame.height) / max(usual, 1e-9)
    widening = next((widening for widening in WIDENINGS if widening <= share), 1.0)
    title = f"{map_.name}: envelope of {result.flights} flights"
    figure.suptitle(title, x=0.02, ha="left", fontweight="bold", fontsize=14)
    axes.set_title(
        f"{flight.label}, {flight.aircraft.name}\nto either side drawn {widening:g} times as far off as it is\n"
        "below: deviations from the optimum; numbers count the passings",
        loc="left",
        fontsize=9,
        color=GREY,
    )
    draw_map(axes, map_, frame)
    _draw_bands(axes, result, flight, line, widening)
    axes.plot(line[:, 1], line[:, 0], color=BLACK, linewidth=0.9, label="the optimum", zorder=4)
    axes.set(xlabel="east, m", ylabel="north, m")
    figure.legend(loc="outside lower center", frameon=False, fontsize=9, ncols=3)
    strips = below.subgridspec(len(DEVIATIONS), 1, hspace=0.05).subplots(sharex=True)
    for place, (label, row, factor) in zip(strips.tolist(), DEVIATIONS, strict=True):
        _draw_strip(place, result, flight, factor * result.envelope[:, row], label)
    strips[-1].set_xlabel("time of the optimum, s")
    figure.draw_without_rendering()  # the positions of the axes are known only afterwards
    write_labels(figure, axes, map_, frame)
    return figure


def _draw_bands(axes: Axes, result: SafetyResult, flight: Flight, line: Array, widening: float) -> None:
    """Draw the bands piece by piece, without transparency, so that none looks darker where the line crosses itself."""
    from matplotlib.collections import PolyCollection

    chi = flight["chi"]
    north, east = (
        -np.interp(result.clock, flight.time, np.sin(chi)),
        np.interp(result.clock, flight.time, np.cos(chi)),
    )
    right = np.stack([east, north], axis=1) / np.maximum(np.hypot(north, east), 1e-9)[:, None]
    for order, (low, high, label, colour) in enumerate(BANDS):
        edges = [line[:, ::-1] + widening * result.envelope[row, 0][:, None] * right for row in (low, high)]
        pieces = np.stack([edges[0][:-1], edges[0][1:], edges[1][1:], edges[1][:-1]], axis=1)
        is_finite = np.isfinite(pieces).all(axis=(1, 2))
        if is_finite.any():
            style: dict[str, Any] = {
                "facecolor": colour,
                "edgecolor": colour,
                "linewidth": 0.4,
                "zorder": 3 + 0.1 * order,
            }
            axes.add_collection(PolyCollection(list(pieces[is_finite]), **style))
            axes.fill([], [], color=colour, label=f"{label} of the flights")


def _draw_strip(axes: Axes, result: SafetyResult, flight: Flight, quantiles: Array, label: str) -> None:
    """Draw a deviation over the time of the optimum: its bands and its median, with the passings."""
    for low, high, _, colour in BANDS:
        axes.fill_between(result.clock, quantiles[low], quantiles[high], color=colour, linewidth=0.0)
    axes.plot(result.clock, quantiles[2], color=COLOURS[0], linewidth=0.8)
    axes.axhline(0.0, color=BLACK, linewidth=0.5)
    axes.set_ylabel(label, fontsize=8)
    axes.tick_params(labelsize=8)
    axes.set_xlim(result.clock[0], result.clock[-1])
    last_label_time, spacing = -math.inf, NUMBERS_APART * (result.clock[-1] - result.clock[0])
    for number, crossing in enumerate(flight.crossings):
        if not crossing.found:
            continue
        axes.axvline(crossing.time, color="#c8c8c8", linewidth=0.6, zorder=0)
        if axes.get_subplotspec().is_first_row() and crossing.time - last_label_time > spacing:
            above: dict[str, Any] = {"xycoords": ("data", "axes fraction"), "xytext": (0.0, 2.0), "ha": "center"}
            axes.annotate(
                str(number), (crossing.time, 1.0), textcoords="offset points", fontsize=7, color=GREY, **above
            )
            last_label_time = crossing.time
