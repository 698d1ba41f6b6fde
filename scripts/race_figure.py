"""Draw one race: its way from above, coloured by the load factor, and its height, speed and load factor over time.

    python scripts/race_figure.py RUN.h5 TRACK.yaml docs/figures/rovinj_2014.png

The picture of the README is the last stage of Rovinj 2014. Needs matplotlib (the extra `plot`).
"""

import argparse
import json
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from figures import BLACK, BLUE, COMMAND, RATE, draw_course, finish, table_of
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from airrace.inputs import load_inputs

PANELS = {"height_m": "height, m", "V_K_kt": "speed, kt", "n_z": "load factor, g"}


def exported(run: Path) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    """The columns of a flight that are drawn, and the time of every passage by name."""
    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder) / "flight.csv"
        subprocess.run([*COMMAND, "export", "csv", str(run), "--rate", str(RATE), "--output", str(table)], check=True)
        rows, splits = table_of(table), table_of(table.with_suffix(".splits.csv"))
    columns = {name: np.array([float(row[name]) for row in rows]) for name in ("time_s", "x_m", "y_m", *PANELS)}
    return columns, {row["passage"]: float(row["time_s"]) for row in splits}


def race_figure(run: Path, track: Path, path: Path) -> None:
    """Draw the last stage of a run.

    Raises:
        RuntimeError: that stage is not certified.
    """
    shown = subprocess.run([*COMMAND, "show", str(run), "--json"], capture_output=True, text=True, check=True)
    last = json.loads(shown.stdout)["stages"][-1]
    if not last["certified"]:
        raise RuntimeError(f"{run}: {last['stage']} is not certified")
    columns, passages = exported(run)
    course = load_inputs(track).race.course
    mosaic = [["plan", name] for name in PANELS]
    figure, axes = plt.subplot_mosaic(mosaic, figsize=(10.5, 5.8), layout="constrained", width_ratios=[1.0, 1.6])
    draw_way(figure, axes["plan"], columns)
    draw_course(axes["plan"], course)
    title = f"{course.name}: {last['race_time_s']:.2f} s, {last['stage']}"
    axes["plan"].set(xlabel="east, m", ylabel="north, m", aspect="equal", title=title)
    draw_histories(axes, columns, passages)
    finish(figure, list(axes.values()), path)


def draw_way(figure: Figure, axes: Axes, columns: Mapping[str, np.ndarray]) -> None:
    """The flight from above, coloured by its load factor."""
    points = np.column_stack([columns["y_m"], columns["x_m"]])
    pieces = np.stack([points[:-1], points[1:]], axis=1)
    way = LineCollection(list(pieces), cmap="plasma", linewidths=2.2, capstyle="round", zorder=3)
    way.set_array(columns["n_z"][:-1])
    axes.add_collection(way)
    scale = axes.inset_axes((0.06, 0.92, 0.36, 0.022))
    figure.colorbar(way, cax=scale, orientation="horizontal").set_label("load factor, g", fontsize=9)


def draw_histories(axes: Mapping[str, Axes], columns: Mapping[str, np.ndarray], passages: Mapping[str, float]) -> None:
    """Height, speed and load factor over time, with a line at every passage."""
    for name, label in PANELS.items():
        axes[name].plot(columns["time_s"], columns[name], color=BLUE, linewidth=1.4)
        axes[name].set(ylabel=label, xlim=(0.0, columns["time_s"][-1]))
        for time in passages.values():
            axes[name].axvline(time, color=BLACK, linewidth=0.5, alpha=0.35)
    first, *_, last = PANELS
    axes[first].set_title("thin lines: gates and pylons passed")
    axes[last].set_xlabel("time, s")


def main() -> None:
    parser = argparse.ArgumentParser(description="Draw one race.")
    parser.add_argument("run", type=Path, metavar="RUN.h5")
    parser.add_argument("track", type=Path, metavar="TRACK.yaml")
    parser.add_argument("figure", type=Path, metavar="FILE.png")
    arguments = parser.parse_args()
    race_figure(arguments.run, arguments.track, arguments.figure)


if __name__ == "__main__":
    main()
