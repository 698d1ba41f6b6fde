"""Flights as drawings: one with its histories, some held against a reference."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from airrace.flights.results import Flight
from airrace.flights.results.comparison import Comparison
from airrace.flights.results.flight import legs_of, way
from airrace.optimal_control.quantities import KNOT
from airrace.optimal_control.trajectory import Array
from airrace.pages.views.course_figure import draw_map, frame_of, write_labels
from airrace.pages.views.drawing import BLACK, COLOURS, GREY, RED, Axes, Figure, new_figure, without_formulas
from airrace.pages.views.map_model import LOSS_COLOURS, MapModel, by_loss, map_model

WIDTH, HEIGHT = 15.0, 9.6  # inches


NAMES_MAX = 40
"""Passings; of longer courses none are named."""
MAP_WIDTH = 8.0
"""Inches."""
DEGREES = 180.0 / math.pi


@dataclass(frozen=True)
class StripChart:
    """Histories that share a pair of axes: names, words, and the factor from SI to the unit of the label.

    `whole` is the range that is shown; None for what the histories take.
    """

    label: str
    factor: float
    lines: tuple[tuple[str, str], ...]
    whole: tuple[float, float] | None = None


STRIPS = (
    StripChart("speed, kt", 1.0 / KNOT, (("V_K", "over ground"), ("V_A", "true"), ("V_I", "indicated"))),
    StripChart("load, g", 1.0, (("n_z", "n_z"), ("n_y", "n_y"))),
    StripChart("bank, deg", DEGREES, (("mu", "bank"),)),
    StripChart("roll rate, deg/s", DEGREES, (("p_Kbar", "about the path"),)),
    StripChart("angles, deg", DEGREES, (("alpha_A", "attack"), ("beta_A", "sideslip"))),
    StripChart("surfaces, deg", DEGREES, (("eta", "elevator"), ("xi", "aileron"), ("zeta", "rudder"))),
    StripChart("lever", 1.0, (("delta_T", "lever"),), whole=(-0.05, 1.1)),
)
"""The strips from top to bottom; those of which a flight has no history are left out."""


@without_formulas
def flight_figure(flight: Flight) -> Figure:
    """Return plan and profile in the colours of the load factor, and histories with their limits."""
    strips = [strip for strip in STRIPS if any(name in flight for name, _ in strip.lines)]
    figure = new_figure(WIDTH, HEIGHT)
    verdict = f", {flight.source.verdict}" if flight.source.verdict else ""
    title = f"{flight.course.name}: {flight.label}, {flight.aircraft.name}, {race_time_text(flight)}{verdict}"
    figure.suptitle(title, x=0.01, ha="left", fontsize=13, fontweight="bold")
    left, right = figure.add_gridspec(1, 2, width_ratios=(1.15, 1.0))
    plan_place, profile_place = left.subgridspec(2, 1, height_ratios=(3.2, 1.0))
    plan, profile = figure.add_subplot(plan_place), figure.add_subplot(profile_place)
    map_, line = _draw_plan(plan, flight)
    plan.set(xlabel="east, m", ylabel="north, m")
    figure.colorbar(line, ax=plan, label="load, g", shrink=0.6, pad=0.01)
    _draw_profile(profile, flight)
    if strips:
        places = right.subgridspec(len(strips), 1, hspace=0.04).subplots(sharex=True, squeeze=False)
        for axes, strip in zip(places[:, 0].tolist(), strips, strict=True):
            _draw_strip(axes, flight, strip)
    figure.draw_without_rendering()  # only then is it known where the axes lie
    write_labels(figure, plan, map_, frame_of(map_))
    return figure


def race_time_text(flight: Flight) -> str:
    """Return the race time in words."""
    return f"{flight.race_time:.3f} s" if math.isfinite(flight.race_time) else "not finished"


def _draw_plan(axes: Axes, flight: Flight) -> tuple[MapModel, Any]:
    """Draw the map with the flight path in the place of the planned tracks; return both."""
    map_ = map_model(flight.race).with_track(np.stack([flight["x"], flight["y"]], axis=1))
    draw_map(axes, map_, frame_of(map_))
    return map_, draw_coloured(axes, flight["y"], flight["x"], flight, width=2.4)


def draw_coloured(axes: Axes, across: Array, up: Array, flight: Flight, *, width: float) -> Any:
    """Draw a line in the colours of the load factor; return it."""
    from matplotlib.collections import LineCollection

    points, load = np.stack([across, up], axis=1), flight.values("n_z")
    pieces = LineCollection(np.stack([points[:-1], points[1:]], axis=1).tolist(), cmap="viridis", linewidths=width)
    pieces.set_array(0.5 * (load[1:] + load[:-1]))
    pieces.set_capstyle("round")
    pieces.set_zorder(3)
    return axes.add_collection(pieces)


def _draw_profile(axes: Axes, flight: Flight) -> None:
    """Draw the height over the time, with floor, ceiling and passings by name."""
    draw_coloured(axes, flight.time, flight["height"], flight, width=2.2)
    axes.set(xlabel="time, s", ylabel="height, m", xlim=(flight.time[0], flight.time[-1]))
    axes.autoscale_view(scalex=False)
    _draw_limits_and_passings(axes, flight, "height", 1.0)
    crossings = [crossing for crossing in flight.crossings if crossing.found]
    if len(crossings) <= NAMES_MAX:
        above: dict[str, Any] = {"xycoords": ("data", "axes fraction"), "xytext": (0.0, 2.0), "ha": "center"}
        for crossing in crossings:
            name, place = crossing.passage.element.name, (crossing.time, 1.0)
            axes.annotate(name, place, textcoords="offset points", fontsize=7, color=GREY, **above)


def _draw_strip(axes: Axes, flight: Flight, strip: StripChart) -> None:
    lines = [(name, words) for name, words in strip.lines if name in flight]
    for number, (name, words) in enumerate(lines):
        values = _without_jumps(name, strip.factor * flight[name])
        axes.plot(flight.time, values, color=COLOURS[number], linewidth=2.2 - 0.6 * number, label=words)
    axes.set_ylabel(strip.label, fontsize=8)
    axes.tick_params(labelsize=8)
    axes.set_xlim(flight.time[0], flight.time[-1])
    axes.margins(y=0.08)
    if strip.whole is not None:
        axes.set_ylim(*strip.whole)
    if len(lines) > 1:
        axes.legend(fontsize=7, loc="upper right", ncols=len(lines), framealpha=0.7, borderpad=0.2)
    _draw_limits_and_passings(axes, flight, lines[0][0], strip.factor)
    if axes.get_subplotspec().is_last_row():
        axes.set_xlabel("time, s")


def _draw_limits_and_passings(axes: Axes, flight: Flight, name: str, factor: float) -> None:
    """Draw the bounds that applied, where the flight comes near enough to them that they matter."""
    bounds, values = flight.limit(name), flight[name]
    room = 0.6 * max(float(np.ptp(values)), 1e-9)
    for bound in (bounds.lower, bounds.upper):
        if math.isfinite(bound) and values.min() - room <= bound <= values.max() + room:
            axes.axhline(factor * bound, color=RED, linewidth=0.9, linestyle="dashed", zorder=1)
    for crossing in flight.crossings:
        if crossing.found:
            axes.axvline(crossing.time, color="#c8c8c8", linewidth=0.6, zorder=0)


def _without_jumps(name: str, values: Array) -> Array:
    """Return a history, a bank in degrees with gaps where it jumps by a full turn."""
    return np.where(np.abs(np.diff(values, append=values[-1:])) > 180.0, np.nan, values) if name == "mu" else values


@without_formulas
def loss_figure(comparisons: Sequence[Comparison]) -> Figure:
    """Return maps side by side: every other flight in the colours of the time it loses, the reference dashed."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    reference = comparisons[0].reference
    line = np.stack([reference["y"], reference["x"]], axis=1)
    maps = [map_model(reference.race).with_track(line[:, ::-1])]
    for comparison in comparisons:
        maps.append(maps[-1].with_track(np.stack([comparison.flight["x"], comparison.flight["y"]], axis=1)))
    map_, frame = maps[-1], frame_of(maps[-1])
    height = min(MAP_WIDTH * frame.height / frame.width, 1.5 * MAP_WIDTH)
    figure = new_figure(MAP_WIDTH * len(comparisons), height + 1.2, layout="compressed")
    figure.suptitle(f"{map_.name}: time lost against {reference.label}", x=0.01, ha="left", fontsize=13)
    panels = figure.subplots(1, len(comparisons), squeeze=False)[0]
    tracks = [by_loss(comparison) for comparison in comparisons]
    most = max(track.greatest for track in tracks)
    for axes, comparison, track in zip(panels, comparisons, tracks, strict=True):
        draw_map(axes, map_, frame)
        axes.plot(*line.T, color=GREY, linewidth=1.0, linestyle="dashed", zorder=2)
        for places, colour in replace(track, least=-most, greatest=most).pieces():
            axes.plot(places[:, 1], places[:, 0], color=colour, linewidth=3.0, solid_capstyle="round", zorder=3)
        axes.set_title(f"{comparison.flight.label}: {comparison.difference:+.3f} s", loc="left", fontsize=10)
        axes.set(xlabel="east, m", ylabel="north, m")
    scale = ScalarMappable(Normalize(-100.0 * most, 100.0 * most), ListedColormap(LOSS_COLOURS))
    figure.colorbar(scale, ax=panels.tolist(), label="time lost, s in 100 m", shrink=0.6, pad=0.01)
    figure.draw_without_rendering()  # only then is it known where the axes lie
    for axes in panels:
        write_labels(figure, axes, map_, frame)
    return figure


STRIP_HEIGHT, LOSS_HEIGHT, COMPARISON_WIDTH = 1.45, 2.3, 11.0  # inches
COMPARED = (
    ("V_K", "speed\nkt", 1.0 / KNOT),
    ("height", "height\nm", 1.0),
    ("n_z", "load\ng", 1.0),
    ("mu", "bank\ndeg", DEGREES),
)
"""Histories that are compared, their labels, and factors from SI."""


@without_formulas
def comparison_figure(comparisons: Sequence[Comparison]) -> Figure:
    """Return the time lost along the course on top, then strips of histories; all over the way of the reference."""
    reference, passings = comparisons[0].reference, comparisons[0].progress.passings
    heights = [LOSS_HEIGHT, *(STRIP_HEIGHT for _ in COMPARED)]
    figure = new_figure(COMPARISON_WIDTH, sum(heights) + 1.0)
    loss, *strips = figure.subplots(len(heights), 1, sharex=True, gridspec_kw={"height_ratios": heights})
    figure.suptitle(f"{reference.course.name}: time lost against {reference.label}", x=0.01, ha="left", fontsize=13)
    for axes in (loss, *strips):
        axes.grid(axis="y", color="#e6e6e6", linewidth=0.6)
        for place in passings.tolist():
            axes.axvline(place, color="#c8c8c8", linewidth=0.6, zorder=0)
    loss.set_ylabel("time lost\ns")
    loss.axhline(0.0, color=BLACK, linewidth=1.0, label=reference.label)
    flights = [(reference, passings, BLACK)]
    for number, comparison in enumerate(comparisons):
        colour, label = COLOURS[number % len(COLOURS)], f"{comparison.flight.label}: {comparison.difference:+.3f} s"
        loss.plot(
            comparison.progress.distance, comparison.progress.difference, color=colour, linewidth=1.8, label=label
        )
        flights.append((comparison.flight, comparison.progress.passings, colour))
    loss.legend(loc="best", fontsize=9, frameon=True, framealpha=0.85)
    for axes, (name, label, factor) in zip(strips, COMPARED, strict=True):
        axes.set_ylabel(label)
        for flight, places, colour in flights:
            for leg, (first, last) in zip(legs_of(flight), pairwise(places.tolist()), strict=True):
                if leg.is_complete:
                    distance = way(flight, leg)
                    values = _without_jumps(name, factor * flight.values(name)[leg.rows])
                    across = first + (last - first) * distance / distance[-1]
                    axes.plot(across, values, color=colour, linewidth=1.1)
    strips[-1].set_xlabel(f"way of {reference.label}, m; the others leg by leg at the same share of their own")
    if len(passings) <= NAMES_MAX:
        style: dict[str, Any] = {"rotation": 60, "fontsize": 7, "color": GREY, "ha": "left", "va": "bottom"}
        above: dict[str, Any] = {"xycoords": ("data", "axes fraction"), "xytext": (0.0, 3.0)}
        for crossing, place in zip(reference.crossings, passings.tolist(), strict=True):
            loss.annotate(crossing.name, (place, 1.0), textcoords="offset points", **above, **style)
    return figure
