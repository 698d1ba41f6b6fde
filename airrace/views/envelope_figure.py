"""The drawing of an envelope: the map with how far closed-loop flights stray, and their deviations over time."""

import math
from typing import Any

import numpy as np

from airrace.records import record
from airrace.results import Flight
from airrace.safety.result import SafetyResult
from airrace.trajectory import Array
from airrace.views.course_figure import draw_map, frame_of, map_size, write_labels
from airrace.views.drawing import BLACK, COLOURS, GREY, Axes, Figure, new_figure, without_formulas
from airrace.views.map_model import map_model

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


@record
class EnvelopeSettings:
    """Sizes of the drawing.

    Attributes:
        wide: the share of the map's longer edge that half of the band's half widths should not exceed: a dense line
            is as wide.
        apart: the share of a strip by which the numbers of passings stand apart at least; of those nearer to one
            another one is written.
    """

    wide: float = 0.006
    apart: float = 0.014


ENVELOPE = EnvelopeSettings()
MAP_MAX, STRIP_HEIGHT = 6.4, 1.1  # inches; a page of A4 holds all of it


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
    width, height = map_size(frame, MAP_MAX)
    figure = new_figure(width, height + len(DEVIATIONS) * STRIP_HEIGHT + 1.8)
    above, below = figure.add_gridspec(2, 1, height_ratios=(height, len(DEVIATIONS) * STRIP_HEIGHT))
    axes = figure.add_subplot(above)
    half = np.fmax.reduce(np.abs(result.envelope[:, 0]))  # NaN where no quantile is known
    usual = float(np.median(half[np.isfinite(half)])) if np.isfinite(half).any() else 0.0
    share = ENVELOPE.wide * max(frame.width, frame.height) / max(usual, 1e-9)
    widening = next((one for one in WIDENINGS if one <= share), 1.0)
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
        known = np.isfinite(pieces).all(axis=(1, 2))
        if known.any():
            style: dict[str, Any] = {
                "facecolor": colour,
                "edgecolor": colour,
                "linewidth": 0.4,
                "zorder": 3 + 0.1 * order,
            }
            axes.add_collection(PolyCollection(list(pieces[known]), **style))
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
    written = -math.inf
    for number, one in enumerate(flight.crossings):
        if not one.found:
            continue
        axes.axvline(one.time, color="#c8c8c8", linewidth=0.6, zorder=0)
        if axes.get_subplotspec().is_first_row() and one.time - written > ENVELOPE.apart * (
            result.clock[-1] - result.clock[0]
        ):
            above: dict[str, Any] = {"xycoords": ("data", "axes fraction"), "xytext": (0.0, 2.0), "ha": "center"}
            axes.annotate(str(number), (one.time, 1.0), textcoords="offset points", fontsize=7, color=GREY, **above)
            written = one.time
