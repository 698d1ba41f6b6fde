"""Draw the figures of the documents, from what the command itself finds. Needs matplotlib (the extra `plot`).

    python scripts/figures.py [--output docs/figures]

Every flight is a run of `airrace optimize` in a temporary folder, read back through `airrace export csv`. A run that is
not certified ends the script.
"""

import argparse
import csv
import json
import math
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from airrace.documents import load_inputs
from airrace.track.course import Course
from airrace.track.gates import Gate, Pylon
from airrace.track.limits import SafetyLine

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "docs" / "figures"
COMMAND = (sys.executable, "-c", "from airrace.cli.main import main; main()")
RATE = 25  # rows per second
DOTS_PER_INCH = 110
LABEL_POINTS = 17.0  # from a gate to its name
BLUE, ORANGE, AMBER, BLACK, GREY = "#0072b2", "#d55e00", "#b8860b", "#222222", "#777777"

LEVEL_GATES = (
    "gate_defaults.climb_min_deg=-5",
    "gate_defaults.climb_max_deg=10",
)
"""Climb angles at all gates and pylons as the rules of Air Race X have them."""


@dataclass(frozen=True)
class Flight:
    """A certified optimum.

    Attributes:
        race: race time, s.
        time, north, east, height, speed: samples, shape (n,); s, m, m/s.
        passages: when each passage was flown (s), by name.
    """

    race: float
    time: np.ndarray
    north: np.ndarray
    east: np.ndarray
    height: np.ndarray
    speed: np.ndarray
    passages: dict[str, float]


def flown(track: Path, overrides: Sequence[str] = ()) -> Flight:
    """The optimum of a course, from the plan.

    Raises:
        RuntimeError: no certified flight was found.
    """
    with tempfile.TemporaryDirectory() as folder:
        run, table = Path(folder) / "run.h5", Path(folder) / "flight.csv"
        changes = [part for one in overrides for part in ("--set", one)]
        options = [*changes, "--guess", "plan", "--json", "--quiet", "--out", str(run)]
        command = [*COMMAND, "optimize", str(track), *options]
        answer = json.loads(subprocess.run(command, capture_output=True, text=True, check=False).stdout)
        if not answer.get("certified"):
            raise RuntimeError(f"no certified flight through {track.name}: {answer.get('error')}")
        export = [*COMMAND, "export", "csv", str(run), "--rate", str(RATE), "--output", str(table)]
        subprocess.run(export, check=True)
        rows, splits = table_of(table), table_of(table.with_suffix(".splits.csv"))
    names = ("time_s", "x_m", "y_m", "height_m", "V_K_m_s")
    columns = (np.array([float(row[name]) for row in rows]) for name in names)
    return Flight(answer["race_time_s"], *columns, {row["passage"]: float(row["time_s"]) for row in splits})


def table_of(path: Path) -> list[dict[str, str]]:
    """The rows of an exported table, without its comments."""
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(line for line in stream if not line.startswith("#")))


def abu_dhabi(path: Path) -> None:
    """The turn at the safety line of Abu Dhabi: on the course as it is, and with nearly level flight at the gates."""
    track = ROOT / "tracks" / "abu_dhabi_2016.yaml"
    course = load_inputs(track).race.course
    flights = (
        (flown(track), BLUE, "-", "the course as it is"),
        (flown(track, LEVEL_GATES), ORANGE, "--", "with climb angles of $-5$ to $10$ deg at the gates"),
    )
    figure, axes = plt.subplot_mosaic(
        [["plan", "height"], ["plan", "speed"]], figsize=(12.5, 6.2), layout="constrained", width_ratios=[1.0, 1.15]
    )
    draw_course(axes["plan"], course)
    for flight, colour, style, text in flights:
        label = f"{text}: {flight.race:.2f} s"
        axes["plan"].plot(flight.east, flight.north, style, color=colour, linewidth=1.4)
        axes["height"].plot(flight.time, flight.height, style, color=colour, linewidth=1.4, label=label)
        axes["speed"].plot(flight.time, flight.speed, style, color=colour, linewidth=1.4)
    for name in ("height", "speed"):
        shade_turns(axes[name], flights[0][0], course)
    axes["height"].set(ylabel="height, m", title="shaded: from gate 4 to gate 5 of the first flight")
    axes["height"].legend(loc="upper center", frameon=False)
    axes["height"].set_ylim(0.0, 1.35 * max(flight.height.max() for flight, *_ in flights))
    axes["speed"].set(xlabel="time, s", ylabel="speed, m/s")
    axes["plan"].set(xlabel="east, m", ylabel="north, m", aspect="equal", title=course.name)
    handles = [Line2D([], [], color=AMBER, label="safety line, hatched where forbidden between gates 4 and 5")]
    axes["plan"].legend(handles=handles, loc="lower right", frameon=False, fontsize=8)
    for one in axes.values():
        one.grid(color="#e6e6e6", linewidth=0.6)
        one.set_axisbelow(True)
    figure.savefig(path, dpi=DOTS_PER_INCH, metadata={"Software": None})
    plt.close(figure)


def draw_course(axes: Axes, course: Course) -> None:
    """Gates across their axes, pylons, names on the inside of the course, and the safety lines."""
    elements = {one.element.name: one.element for one in course.passages}
    standing = [one for one in elements.values() if isinstance(one, Gate | Pylon)]
    middle = np.mean([[one.east, one.north] for one in standing], axis=0)
    for element in standing:
        where = np.array([element.east, element.north])
        inward = (middle - where) / np.hypot(*(middle - where))
        style = {"fontsize": 9, "color": GREY, "ha": "center", "va": "center"}
        axes.annotate(element.name, where, xytext=LABEL_POINTS * inward, textcoords="offset points", **style)
        if isinstance(element, Gate):
            half = max(0.5 * element.width, 12.0)  # wide enough to be seen
            north, east = -half * math.sin(element.heading), half * math.cos(element.heading)
            ends = np.array([[-1.0], [1.0]]) * (east, north) + (element.east, element.north)
            axes.plot(*ends.T, color=BLACK, linewidth=2.5, zorder=4)
        else:
            axes.plot(element.east, element.north, "o", color=BLACK, markersize=4, zorder=4)
    for line in {one.name: one for passage in course.passages for one in passage.safety_lines}.values():
        draw_line(axes, line)


def draw_line(axes: Axes, line: SafetyLine) -> None:
    """A stretch of a safety line, hatched on its forbidden side."""
    start, end = (np.array([one.east, one.north]) for one in (line.start, line.end))
    along = (end - start) / np.hypot(*(end - start))
    right = np.array([along[1], -along[0]])
    forbidden = -right if line.keep_right else right
    ends = np.array([start - 100.0 * along, end + 150.0 * along])
    band = np.concatenate([ends, ends[::-1] + 22.0 * forbidden])
    axes.plot(*ends.T, color=AMBER, linewidth=1.8, zorder=3)
    axes.fill(*band.T, facecolor="none", edgecolor=AMBER, hatch="////", linewidth=0.0, zorder=1)


def shade_turns(axes: Axes, flight: Flight, course: Course) -> None:
    """The times at which a safety line holds."""
    names = [passage.name for passage in course.passages]
    for number, passage in enumerate(course.passages):
        if passage.safety_lines:
            begin, end = flight.passages[names[number - 1]], flight.passages[passage.name]
            axes.axvspan(begin, end, color=AMBER, alpha=0.15, linewidth=0.0)


FIGURES = {"abu_dhabi_2016.png": abu_dhabi}


def main() -> None:
    parser = argparse.ArgumentParser(description="Draw the figures of the documents.")
    parser.add_argument("--output", type=Path, default=FOLDER, metavar="FOLDER", help="where to; docs/figures")
    folder: Path = parser.parse_args().output
    folder.mkdir(parents=True, exist_ok=True)
    for name, draw in FIGURES.items():
        draw(folder / name)
        print(folder / name)


if __name__ == "__main__":
    main()
