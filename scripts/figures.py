"""Draw the figures of the documents, from what the command itself finds. Needs matplotlib (the extra `plot`).

    python scripts/figures.py [--output docs/figures] [--runs FOLDER] [--only half_cuban_eight.png ...]

Every flight is a run of `airrace optimize`, read back through `airrace export csv`; only those around the oval are
flown as the tests do it, for the command matches no ends. A run that is not certified ends the script. Checkpoints are
kept in the folder of `--runs`, and those that lie there already are not flown again.
"""

import argparse
import csv
import json
import math
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests" / "procedure")]

from matched_laps import PLAN, laps, matched_laps, optimum  # noqa: E402  (the folders above must be on the path first)

from airrace.inputs import load_inputs  # noqa: E402
from airrace.track.course import Course  # noqa: E402
from airrace.track.limits import SafetyLine  # noqa: E402
from airrace.trajectory import Trajectory  # noqa: E402

FOLDER = ROOT / "docs" / "figures"
COMMAND = (sys.executable, "-P", "-m", "airrace")
RATE = 25  # rows per second
DOTS_PER_INCH = 110
LABEL_POINTS = 17.0  # from a gate to its name
BLUE, ORANGE, AMBER, BLACK, GREY = "#0072b2", "#d55e00", "#b8860b", "#222222", "#777777"

STEEP_GATES = (
    "gate_defaults.climb_min_deg=-45",
    "gate_defaults.climb_max_deg=45",
)
"""Climb angles at all gates and pylons as the language has them where no season says otherwise."""

CROSSWIND = ("environment.wind.from_deg=90", "environment.wind.speed_m_s=10")
"""From the right of the flight's beginning."""

FLAT = ("rules.ceiling_m=30",)
"""10 m above the gates."""


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


def flown(runs: Path, name: str, track: Path, *, until: str, overrides: Sequence[str] = ()) -> Flight:
    """The optimum of a course at one stage, from the plan.

    Args:
        runs: folder of the checkpoints.
        name: of the checkpoint; if there is one, nothing is flown.
        track: the course.
        until: the stage.
        overrides: what is changed, `key=value`.

    Raises:
        RuntimeError: no certified flight was found.
    """
    run, table = runs / f"{name}.h5", runs / f"{name}.csv"
    if not run.exists():
        changes = [part for one in overrides for part in ("--set", one)]
        options = [*changes, "--guess", "plan", "--until", until, "--quiet", "--output", str(run)]
        subprocess.run([*COMMAND, "optimize", str(track), *options], check=False)
    shown = subprocess.run([*COMMAND, "show", str(run), "--json"], capture_output=True, text=True, check=True)
    last = json.loads(shown.stdout)["stages"][-1]
    if last["stage"] != until or not last["certified"]:
        raise RuntimeError(f"no certified flight through {track.name}: {last['stage']}: {last['message']}")
    export = [*COMMAND, "export", "csv", str(run), "--rate", str(RATE), "--output", str(table), "--force"]
    subprocess.run(export, check=True)
    rows, splits = table_of(table), table_of(table.with_suffix(".splits.csv"))
    names = ("time_s", "x_m", "y_m", "height_m", "V_K_m_s")
    columns = (np.array([float(row[one]) for row in rows]) for one in names)
    return Flight(last["race_time_s"], *columns, {row["passage"]: float(row["time_s"]) for row in splits})


def table_of(path: Path) -> list[dict[str, str]]:
    """The rows of an exported table, without its comments."""
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(line for line in stream if not line.startswith("#")))


def abu_dhabi(path: Path, runs: Path) -> None:
    """The turn at the safety line of Abu Dhabi: with nearly level flight at the gates, as it is flown, and without."""
    track = ROOT / "tracks" / "abu_dhabi_2016.yaml"
    course = load_inputs(track).race.course
    flights = (
        (flown(runs, "abu_dhabi", track, until="point-mass"), BLUE, "-", "the course as it is"),
        (
            flown(runs, "abu_dhabi_steep", track, until="point-mass", overrides=STEEP_GATES),
            ORANGE,
            "--",
            "with climb angles of $-45$ to $45$ deg at the gates",
        ),
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
    finish(figure, list(axes.values()), path)


def draw_course(axes: Axes, course: Course) -> None:
    """Gates across their axes, pylons, names on the inside of the course, and the safety lines."""
    elements = {one.element.name: one.element for one in course.passages}
    placed = [(one, one.place) for one in elements.values() if one.stands and one.place is not None]
    middle = np.mean([[east, north] for _, (north, east) in placed], axis=0)
    for element, (north, east) in placed:
        name = element.name.split("/")[0]  # both gates of a quad have one
        where = np.array([east, north])
        inward = (middle - where) / np.hypot(*(middle - where))
        style = {"fontsize": 9, "color": GREY, "ha": "center", "va": "center"}
        axes.annotate(name, where, xytext=LABEL_POINTS * inward, textcoords="offset points", **style)
        across = element.drawing().across
        if across is None:
            axes.plot(*where, "o", color=BLACK, markersize=4, zorder=4)
            continue
        ends = np.array([[end.east, end.north] for end in across])
        half = 0.5 * (ends[1] - ends[0])
        half *= max(1.0, 12.0 / np.hypot(*half))  # wide enough to be seen
        axes.plot(*np.array([where - half, where + half]).T, color=BLACK, linewidth=2.5, zorder=4)
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


def half_cuban_eight(path: Path, runs: Path) -> None:
    """The Half Cuban Eight with six degrees of freedom, in still air and in a crosswind: from three sides."""
    track = ROOT / "tracks" / "half_cuban_eight.yaml"
    flights = (
        (flown(runs, "cuban", track, until="six-dof"), BLUE, "-", "still air"),
        (
            flown(runs, "cuban_wind", track, until="six-dof", overrides=CROSSWIND),
            ORANGE,
            "--",
            "10 m/s of wind from the east, its plane leans by {lean:.1f} deg into it",
        ),
    )
    figure, axes = plt.subplots(1, 3, figsize=(12.5, 5.0), layout="constrained")
    views = (
        ("north", "height", "from the east"),
        ("east", "height", "from the south"),
        ("east", "north", "from above"),
    )
    for one, (across, up, title) in zip(axes, views, strict=True):
        for flight, colour, style, text in flights:
            label = f"{text.format(lean=lean_to_east(flight))}: {flight.race:.2f} s"
            one.plot(getattr(flight, across), getattr(flight, up), style, color=colour, linewidth=1.5, label=label)
        one.set(xlabel=f"{across}, m", ylabel=f"{up}, m", title=title, aspect="equal", adjustable="datalim")
    arrow = {"arrowstyle": "->", "color": GREY, "linewidth": 1.5}
    for one in axes[1:]:
        one.annotate(
            "wind", (0.70, 0.06), (0.86, 0.06), xycoords="axes fraction", color=GREY, va="center", arrowprops=arrow
        )
    finish(figure, axes, path, legend=True)


def lean_to_east(flight: Flight) -> float:
    """How far the plane that fits a flight best leans from the vertical, its upper side to the east; degrees."""
    places = np.stack([flight.north, flight.east, flight.height], axis=1)
    _, _, axes = np.linalg.svd(places - places.mean(axis=0), full_matrices=False)
    normal = axes[2] * np.sign(axes[2][1])
    return -math.degrees(math.asin(normal[2]))


def sixteen_phases(path: Path, runs: Path) -> None:
    """The 270 degree turn between the two passings of the quad, six degrees of freedom: free, and held flat."""
    track = ROOT / "tracks" / "sixteen_phases.yaml"
    flights = (
        (flown(runs, "sixteen", track, until="six-dof"), BLUE, "free"),
        (flown(runs, "sixteen_flat", track, until="six-dof", overrides=FLAT), ORANGE, "below 30 m"),
    )
    figure, axes = plt.subplot_mosaic(
        [["plan", "height"], ["plan", "speed"]], figsize=(12.5, 6.2), layout="constrained", width_ratios=[1.25, 1.0]
    )
    draw_course(axes["plan"], load_inputs(track).race.course)
    for flight, colour, text in flights:
        label = f"{text}: two laps in {flight.race:.2f} s"
        axes["plan"].plot(flight.east, flight.north, "-", color=colour, linewidth=0.7, alpha=0.6)
        for lap, style in (("1", "-"), ("2", "--")):
            begin, end = (flight.passages[f"{lap}:quad/{passing}"] for passing in "12")
            turn = (flight.time >= begin) & (flight.time <= end)
            line = {"linestyle": style, "color": colour, "linewidth": 1.8, "label": f"{text}, lap {lap}"}
            axes["plan"].plot(
                flight.east[turn], flight.north[turn], **(line | {"label": label if lap == "1" else None})
            )
            axes["height"].plot(flight.time[turn] - begin, flight.height[turn], **line)
            line["label"] = f"{text}, lap {lap}: {end - begin:.2f} s"
            axes["speed"].plot(flight.time[turn] - begin, flight.speed[turn], **line)
    axes["plan"].set(xlabel="east, m", ylabel="north, m", aspect="equal", xlim=(-90.0, 890.0), ylim=(-90.0, 590.0))
    axes["plan"].legend(loc="upper left", frameon=False)
    axes["height"].set(ylabel="height, m", title="the turn between the two passings of the quad")
    axes["height"].set_ylim(bottom=0.0)
    axes["speed"].set(xlabel="time since the first passing of the quad, s", ylabel="speed, m/s")
    axes["speed"].legend(loc="upper center", frameon=False, ncols=2, fontsize=8)
    axes["speed"].set_ylim(50.0, 110.0)
    finish(figure, list(axes.values()), path)


def two_laps(path: Path, _: Path) -> None:
    """Two laps around an oval, point mass: flown jointly, and one lap twice, all with the same state at both ends."""
    lap, both, race = matched_laps(1), matched_laps(2), optimum(laps(2), PLAN)
    if not race.certified:
        raise RuntimeError(f"no certified race around the oval: {race.message}")
    flights = (
        (race.trajectory, 1, GREY, ":", "a race of two laps"),
        (lap, 2, ORANGE, "--", "one lap with matched ends, twice"),
        (both, 1, BLUE, "-", "two laps with the same ends, jointly"),
    )
    figure, axes = plt.subplots(1, 3, figsize=(12.5, 4.6), layout="constrained")
    for flight, times, colour, style, text in flights:
        done, speed, height, _ = repeated(flight, times)
        label = f"{text}: {times * flight.race_time:.2f} s"
        for one, history in ((axes[0], speed), (axes[1], height)):
            one.plot(done, history, linestyle=style, color=colour, linewidth=1.5, label=label)
    twice, jointly = ((done, time) for done, _, _, time in (repeated(lap, 2), repeated(both, 1)))
    gates = np.linspace(0.0, 2.0, 5)
    axes[2].plot(gates, 1e3 * (np.interp(gates, *twice) - np.interp(gates, *jointly)), "o:", color=BLUE, linewidth=1.0)
    axes[0].set(ylabel="speed, m/s")
    axes[1].set(ylabel="height, m", ylim=(0.0, 50.0))
    axes[2].set(ylabel="two laps jointly: gain up to a gate, ms")
    for one in axes:
        one.set(xlabel="laps flown; a gate at every half", xticks=[0.0, 0.5, 1.0, 1.5, 2.0])
    finish(figure, axes, path, legend=True)


def repeated(flight: Trajectory, times: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Laps flown, speed, height and time of a flight around the oval, flown so many times in a row.

    Half a lap, from gate to gate, is divided by its time, so that gates lie at the same places whoever flies.
    """
    done = np.interp(flight.time, flight.time[flight.first_node], 0.5 * np.arange(len(flight.first_node)))
    onward = [np.concatenate([one + number * one[-1] for number in range(times)]) for one in (done, flight.time)]
    return onward[0], np.tile(flight.of("V_K"), times), np.tile(-flight.of("z"), times), onward[1]


def finish(figure: Figure, axes: Sequence[Axes], path: Path, *, legend: bool = False) -> None:
    """Grids, one legend for all views if wanted, and the file."""
    for one in axes:
        one.grid(color="#e6e6e6", linewidth=0.6)
        one.set_axisbelow(True)
    if legend:
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False)
    figure.savefig(path, dpi=DOTS_PER_INCH, metadata={"Software": None})
    plt.close(figure)


Draw = Callable[[Path, Path], None]
FIGURES: dict[str, Draw] = {
    "abu_dhabi_2016.png": abu_dhabi,
    "half_cuban_eight.png": half_cuban_eight,
    "sixteen_phases.png": sixteen_phases,
    "two_laps.png": two_laps,
}


def draw_figures(description: str, figures: Mapping[str, Draw]) -> None:
    """Draw those figures that the command line asks for, each under its name, and print where they are."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--output", type=Path, default=FOLDER, metavar="FOLDER", help="where to; docs/figures")
    parser.add_argument("--runs", type=Path, metavar="FOLDER", help="where checkpoints are kept; by default nowhere")
    parser.add_argument("--only", nargs="+", choices=figures, default=list(figures), metavar="NAME", help="which ones")
    arguments = parser.parse_args()
    folder: Path = arguments.output
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as temporary:
        runs: Path = arguments.runs or Path(temporary)
        runs.mkdir(parents=True, exist_ok=True)
        for name in arguments.only:
            figures[name](folder / name, runs)
            print(folder / name)


if __name__ == "__main__":
    draw_figures("Draw the figures of the documents.", FIGURES)
