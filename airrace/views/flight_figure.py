"""A flight as a drawing in a file: plan and profile in the colours of the load factor, histories with their limits."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from airrace.quantities import KNOT
from airrace.records import record
from airrace.results import Flight
from airrace.trajectory import Array
from airrace.views.course_figure import draw_map, frame_of, write_labels
from airrace.views.drawing import COLOURS, GREY, RED, Axes, Figure, names_as_they_are, new_figure, save_figure
from airrace.views.map_model import MapModel, map_model

WIDTH, HEIGHT = 15.0, 9.6  # inches
NAMES_MAX = 40  # passings; likewise
LOAD = "n_z"
DEGREES = 180.0 / math.pi


@record
class Strip:
    """Histories that share a pair of axes: names, words, and the factor from SI to the unit of the label.

    `whole` is the range that is shown; None for what the histories take.
    """

    label: str
    factor: float
    histories: tuple[tuple[str, str], ...]
    whole: tuple[float, float] | None = None


STRIPS = (
    Strip("speed, kt", 1.0 / KNOT, (("V_K", "over ground"), ("V_A", "true"), ("V_I", "indicated"))),
    Strip("load, g", 1.0, (("n_z", "n_z"), ("n_y", "n_y"))),
    Strip("bank, deg", DEGREES, (("mu", "bank"),)),
    Strip("roll rate, deg/s", DEGREES, (("p_Kbar", "about the path"),)),
    Strip("angles, deg", DEGREES, (("alpha_A", "attack"), ("beta_A", "sideslip"))),
    Strip("surfaces, deg", DEGREES, (("eta", "elevator"), ("xi", "aileron"), ("zeta", "rudder"))),
    Strip("lever", 1.0, (("delta_T", "lever"),), whole=(-0.05, 1.1)),
)
"""The strips from top to bottom; those of which a flight has no history are left out."""


def draw_flight(flight: Flight, path: Path) -> None:
    """Draw a flight into a file, replacing it as a whole.

    Raises:
        StorageError: the system refused.
    """
    save_figure(flight_figure(flight), path)


@names_as_they_are
def flight_figure(flight: Flight) -> Figure:
    """Return the drawing: plan and profile on the left, histories on the right."""
    strips = [strip for strip in STRIPS if any(name in flight for name, _ in strip.histories)]
    figure = new_figure(WIDTH, HEIGHT)
    figure.suptitle(_title(flight), x=0.01, ha="left", fontsize=13, fontweight="bold")
    left, right = figure.add_gridspec(1, 2, width_ratios=(1.15, 1.0))
    plan_place, profile_place = left.subgridspec(2, 1, height_ratios=(3.2, 1.0))
    plan, profile = figure.add_subplot(plan_place), figure.add_subplot(profile_place)
    map_ = flight_map(flight)
    draw_map(plan, map_, frame_of(map_))
    line = draw_coloured(plan, flight["y"], flight["x"], flight.values(LOAD), width=2.4)
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


def flight_map(flight: Flight) -> MapModel:
    """Return the map with the line flown in the place of the planned tracks."""
    return map_model(flight.race).with_track(np.stack([flight["x"], flight["y"]], axis=1))


def draw_coloured(axes: Axes, across: Array, up: Array, values: Array, *, width: float) -> Any:
    """Return a line in the colours of some values at its points, each of shape (n,)."""
    from matplotlib.collections import LineCollection

    points = np.stack([across, up], axis=1)
    pieces = LineCollection(np.stack([points[:-1], points[1:]], axis=1).tolist(), cmap="viridis", linewidths=width)
    pieces.set_array(0.5 * (values[1:] + values[:-1]))
    pieces.set_capstyle("round")
    pieces.set_zorder(3)
    return axes.add_collection(pieces)


def _title(flight: Flight) -> str:
    verdict = f", {flight.source.verdict}" if flight.source.verdict else ""
    time = f"{flight.race_time:.3f} s" if math.isfinite(flight.race_time) else "not finished"
    return f"{flight.course.name}: {flight.label}, {flight.aircraft.name}, {time}{verdict}"


def _draw_profile(axes: Axes, flight: Flight) -> None:
    """Draw the height over the time, with floor, ceiling and passings."""
    draw_coloured(axes, flight.time, flight["height"], flight.values(LOAD), width=2.2)
    axes.set(xlabel="time, s", ylabel="height, m", xlim=(flight.time[0], flight.time[-1]))
    axes.autoscale_view(scalex=False)
    _draw_limits(axes, flight, "height", 1.0)
    _draw_passings(axes, flight, named=True)


def _draw_strip(axes: Axes, flight: Flight, strip: Strip) -> None:
    known = [(name, words) for name, words in strip.histories if name in flight]
    for number, (name, words) in enumerate(known):
        values = strip.factor * flight[name]
        if name == "mu":
            values = without_jumps(values)
        axes.plot(flight.time, values, color=COLOURS[number], linewidth=2.2 - 0.6 * number, label=words)
    axes.set_ylabel(strip.label, fontsize=8)
    axes.tick_params(labelsize=8)
    axes.set_xlim(flight.time[0], flight.time[-1])
    axes.margins(y=0.08)
    if strip.whole is not None:
        axes.set_ylim(*strip.whole)
    if len(known) > 1:
        axes.legend(fontsize=7, loc="upper right", ncols=len(known), framealpha=0.7, borderpad=0.2)
    _draw_limits(axes, flight, known[0][0], strip.factor)
    _draw_passings(axes, flight, named=False)
    if axes.get_subplotspec().is_last_row():
        axes.set_xlabel("time, s")


def _draw_limits(axes: Axes, flight: Flight, name: str, factor: float) -> None:
    """Draw the bounds that applied, where the flight comes near enough to them that they are worth the room."""
    bounds, values = flight.limit(name), flight[name]
    room = 0.6 * max(float(np.ptp(values)), 1e-9)
    for bound in (bounds.lower, bounds.upper):
        if math.isfinite(bound) and values.min() - room <= bound <= values.max() + room:
            axes.axhline(factor * bound, color=RED, linewidth=0.9, linestyle="dashed", zorder=1)


def _draw_passings(axes: Axes, flight: Flight, *, named: bool) -> None:
    found = [one for one in flight.crossings if one.found]
    for crossing in found:
        axes.axvline(crossing.time, color="#c8c8c8", linewidth=0.6, zorder=0)
    if named and len(found) <= NAMES_MAX:
        above: dict[str, Any] = {"xycoords": ("data", "axes fraction"), "xytext": (0.0, 2.0), "ha": "center"}
        for one in found:
            name, place = one.passage.element.name, (one.time, 1.0)
            axes.annotate(name, place, textcoords="offset points", fontsize=7, color=GREY, **above)


def without_jumps(values: Array) -> Array:
    """Return a bank in degrees with gaps where it jumps by a full turn."""
    return np.where(np.abs(np.diff(values, append=values[-1:])) > 180.0, np.nan, values)
