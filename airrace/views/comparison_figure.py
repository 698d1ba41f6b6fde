"""Flights held against one of them, as a drawing: what they lose along the course, and what they fly meanwhile."""

import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from airrace.quantities import KNOT
from airrace.results.comparison import Comparison
from airrace.results.flight import Flight
from airrace.results.legs import legs_of, way
from airrace.trajectory import Array
from airrace.views.drawing import BLACK, COLOURS, GREY, Axes, Figure, names_as_they_are, new_figure, save_figure
from airrace.views.flight_figure import without_jumps

WIDTH, STRIP, LOSS = 11.0, 1.45, 2.3  # inches: of the drawing, heights of a strip and of the strip of time lost
NAMES_MAX = 40  # passings; of longer courses none are named
STRIPS = (
    ("V_K", "speed\nkt", 1.0 / KNOT),
    ("height", "height\nm", 1.0),
    ("n_z", "load\ng", 1.0),
    ("mu", "bank\ndeg", 180.0 / math.pi),
)
"""Histories that are shown, their labels, and factors from SI."""


def draw_comparison(comparisons: Sequence[Comparison], path: Path) -> None:
    """Draw flights that are compared with one reference into a file, replacing it as a whole.

    Raises:
        StorageError: the system refused.
    """
    save_figure(comparison_figure(comparisons), path)


@names_as_they_are
def comparison_figure(comparisons: Sequence[Comparison]) -> Figure:
    """Return the time lost along the course on top, then strips of histories; all over the way of the reference."""
    reference = comparisons[0].reference
    figure = new_figure(WIDTH, LOSS + STRIP * len(STRIPS) + 1.0)
    heights = [LOSS, *(STRIP for _ in STRIPS)]
    loss, *strips = figure.subplots(len(heights), 1, sharex=True, gridspec_kw={"height_ratios": heights})
    figure.suptitle(f"{reference.course.name}: time lost against {reference.label}", x=0.01, ha="left", fontsize=13)
    passings = comparisons[0].progress.passings
    for axes in (loss, *strips):
        axes.grid(axis="y", color="#e6e6e6", linewidth=0.6)
        for place in passings.tolist():
            axes.axvline(place, color="#c8c8c8", linewidth=0.6, zorder=0)
    _draw_loss(loss, comparisons)
    flights = [(reference, passings), *((one.other, one.progress.passings) for one in comparisons)]
    for axes, (name, label, factor) in zip(strips, STRIPS, strict=True):
        axes.set_ylabel(label)
        for number, (flight, places) in enumerate(flights):
            _draw_strip(axes, flight, places, name, factor, _colour(number))
    strips[-1].set_xlabel(f"way of {reference.label}, m; the others leg by leg at the same share of their own")
    _name_passings(loss, reference, passings)
    return figure


def _draw_loss(axes: Axes, comparisons: Sequence[Comparison]) -> None:
    axes.set_ylabel("time lost\ns")
    axes.axhline(0.0, color=BLACK, linewidth=1.0, label=comparisons[0].reference.label)
    for number, one in enumerate(comparisons, start=1):
        label = f"{one.other.label}: {one.difference:+.3f} s"
        axes.plot(one.progress.distance, one.progress.difference, color=_colour(number), linewidth=1.8, label=label)
    axes.legend(loc="best", fontsize=9, frameon=True, framealpha=0.85)


def _draw_strip(axes: Axes, flight: Flight, passings: Array, name: str, factor: float, colour: str) -> None:
    """Draw one history over the way of the reference; a bank that jumps by a full turn is left open there."""
    for leg, (first, last) in zip(legs_of(flight), pairwise(passings.tolist()), strict=True):
        if not leg.flown:
            continue
        flown = way(flight, leg)
        values = factor * flight.values(name)[leg.rows]
        if name == "mu":
            values = without_jumps(values)
        axes.plot(first + (last - first) * flown / flown[-1], values, color=colour, linewidth=1.1)


def _name_passings(axes: Axes, reference: Flight, passings: Array) -> None:
    if len(passings) > NAMES_MAX:
        return
    style: dict[str, Any] = {"rotation": 60, "fontsize": 7, "color": GREY, "ha": "left", "va": "bottom"}
    above: dict[str, Any] = {"xycoords": ("data", "axes fraction"), "xytext": (0.0, 3.0)}
    for crossing, place in zip(reference.crossings, passings.tolist(), strict=True):
        axes.annotate(crossing.name, (place, 1.0), textcoords="offset points", **above, **style)


def _colour(number: int) -> str:
    return BLACK if number == 0 else COLOURS[(number - 1) % len(COLOURS)]
