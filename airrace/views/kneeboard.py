"""A flight on one page that a pilot can hold in the hand: the line on a map, and what to fly at every gate."""

import math
from pathlib import Path

import numpy as np

from airrace.quantities import KNOT
from airrace.results import Flight
from airrace.results.leg_facts import leg_facts
from airrace.views.course_figure import draw_map, frame_of
from airrace.views.drawing import BLACK, GREY, Axes, Figure, names_as_they_are, new_figure, save_figure
from airrace.views.flight_figure import draw_coloured, flight_map
from airrace.views.labels import Box
from airrace.views.map_model import round_length
from airrace.views.tables import Column, Table

WIDTH, HEIGHT = 5.83, 8.27  # inches: A5
ROWS_MAX = 44  # in one column of the table
COLUMNS = (
    Column("", form="d"),
    Column("gate"),
    Column("time s", form=".2f"),
    Column("IAS kt", form=".0f"),
    Column("track°", form="03.0f"),
    Column("hgt m", form=".0f"),
    Column("bank°", form="z.0f"),
    Column("climb°", form="z.0f"),
    Column("g at", form=".1f"),
    Column("g most", form=".1f"),
    Column("roll °/s", form=".0f"),
)
PLACES = (0.03, 0.055, 0.255, 0.355, 0.45, 0.54, 0.63, 0.73, 0.80, 0.89, 1.0)
"""The ends of the columns of the table, as shares of its width; of the second, left-aligned one the beginning."""
GRID_LINES = 4
"""The number of lines of the grid along the longer edge of the map, at least."""


def draw_kneeboard(flight: Flight, path: Path) -> None:
    """Draw the page into a file, replacing it as a whole.

    Raises:
        StorageError: the system refused.
    """
    save_figure(kneeboard_figure(flight), path)


@names_as_they_are
def kneeboard_figure(flight: Flight) -> Figure:
    """Return the page: A5, upright. Gates are numbered as they are flown; the map's labels are these numbers."""
    figure = new_figure(WIDTH, HEIGHT, layout=None)
    figure.text(0.04, 0.972, flight.course.name[:60], fontsize=12, fontweight="bold", va="center")
    figure.text(0.04, 0.951, _subtitle(flight), fontsize=7.5, color=GREY, va="center")
    rows = min(len(flight.crossings), ROWS_MAX)
    table_height = min(0.6, 0.0185 * (rows + 2))
    plan = figure.add_axes((0.04, 0.05 + table_height, 0.92, 0.88 - table_height))
    plan.set_anchor("C")
    map_ = flight_map(flight)
    draw_map(plan, map_, frame_of(map_))
    line = draw_coloured(plan, flight["y"], flight["x"], flight.values("n_z"), width=2.4)
    _draw_grid(plan, frame_of(map_))
    bar = figure.colorbar(line, ax=plan, shrink=0.5, pad=0.01, aspect=30)
    bar.set_label("g", fontsize=7)
    bar.ax.tick_params(labelsize=6)
    _number_gates(plan, flight)
    table = figure.add_axes((0.04, 0.03, 0.92, table_height))
    table.axis("off")
    _draw_table(table, flight)
    figure.text(0.04, 0.014, _footnote(flight), fontsize=5.5, color=GREY, va="center")
    return figure


def _subtitle(flight: Flight) -> str:
    wind = flight.air.wind
    air = "still air" if wind is None else f"wind {math.degrees(wind.origin) % 360:.0f}° {wind.speed / KNOT:.0f} kt"
    time = f"{flight.race_time:.3f} s" if math.isfinite(flight.race_time) else "not finished"
    return f"{flight.aircraft.name}, {time}, {air}; {flight.label}"[:100]


def _footnote(flight: Flight) -> str:
    limit = flight.limit("n_z")
    bound = f"; at most {limit.upper:g} g" if math.isfinite(limit.upper) else ""
    verdict = f"; {flight.source.verdict}" if flight.source.certified is False else ""
    signs = "bank + right wing down; track over ground, from true north; heights above the track's origin"
    return f"{signs}{bound}{verdict}"


def _draw_grid(axes: Axes, frame: Box) -> None:
    """Draw a grid of round width over the map, and tell that width and where north is."""
    step = round_length(max(frame.width, frame.height) / GRID_LINES)
    axes.set_xticks(np.arange(math.ceil(frame.left / step), (frame.left + frame.width) / step) * step)
    axes.set_yticks(np.arange(math.ceil(frame.bottom / step), (frame.bottom + frame.height) / step) * step)
    axes.tick_params(labelbottom=False, labelleft=False, length=0)
    axes.annotate(
        f"north is up, grid {step:g} m",
        (0.0, 0.0),
        xycoords="axes fraction",
        xytext=(0.0, -6.0),
        textcoords="offset points",
        fontsize=5.5,
        color=GREY,
        va="center",
    )


def _number_gates(axes: Axes, flight: Flight) -> None:
    """Write the numbers of the passings beside each place; a place that is passed several times has all of them."""
    places: dict[tuple[float, float], list[int]] = {}
    for number, crossing in enumerate(flight.crossings):
        if crossing.found:
            where = crossing.passage.element.place or (crossing.value("x"), crossing.value("y"))
            places.setdefault((round(where[0], 1), round(where[1], 1)), []).append(number)
    for (north, east), numbers in places.items():
        axes.annotate(
            ",".join(map(str, numbers)),
            (east, north),
            xytext=(5.0, 4.0),
            textcoords="offset points",
            fontsize=7,
            fontweight="bold",
            color=BLACK,
            zorder=9,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.6},
        )


def _draw_table(axes: Axes, flight: Flight) -> None:
    heads, *texts = _table(flight).texts()
    if len(texts) > ROWS_MAX:
        texts = [*texts[: ROWS_MAX - 2], ["", "...", *[""] * (len(COLUMNS) - 2)], texts[-1]]
    step = 1.0 / (len(texts) + 1.5)
    size = min(8.0, 560.0 * step * axes.get_position().height)
    for row, line in enumerate((heads, *texts)):
        height = 1.0 - step * (row + 0.5)
        if row % 2 == 0 and row:
            axes.axhspan(height - 0.5 * step, height + 0.5 * step, color="#f1f1f1", zorder=0)
        for column, (place, text) in enumerate(zip(PLACES, line, strict=True)):
            weight = "bold" if column == 0 or row == 0 else "normal"
            side = "left" if column == 1 else "right"
            colour = GREY if row == 0 else BLACK
            axes.text(place, height, text, fontsize=size, ha=side, va="center", color=colour, fontweight=weight)
    axes.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0))


def _table(flight: Flight) -> Table:
    """Return a table of when and how every passing is made, and of what the leg that leads to it asks for."""
    rows: list[tuple[str | float, ...]] = []
    for number, (one, leg) in enumerate(zip(flight.crossings, (None, *leg_facts(flight)), strict=True)):
        angles = [math.degrees(one.value(name)) for name in ("chi", "mu", "gamma")]
        asked = ("", "") if leg is None else (leg.n_z.greatest, math.degrees(leg.roll_rate))
        speed, height = one.value("V_I") / KNOT, one.value("height")
        rows.append(
            (number, one.name[:16], one.time, speed, angles[0] % 360.0, height, *angles[1:], one.value("n_z"), *asked)
        )
    return Table("", COLUMNS, rows)
