"""Measure whether optima are flown as a pilot flies, from nothing but the CSV export, as a Markdown table.

    python scripts/measure_flyability.py RUN.h5 ... [--stage STAGE] [--details]
    python scripts/measure_flyability.py --compare BEFORE AFTER [--stage STAGE]

Independent of the package: histories come from `airrace export csv` (nodes of the mesh and 100 rows per second), times
of the passings from the table of gate splits beside it, the kinds of the elements from `airrace export geojson`, the
names of the stages from `airrace show --json`; the rest is numpy. For each stage of each run the first table holds

- the race time;
- largest roll rate about the velocity (column `p_Kbar`, deg/s), largest |n_y| (g) and |beta_A| (deg) at the start, over
  all gates and pylons (not manoeuvres, high turns and rolls), and at the finish, whatever that is;
- the least load factor below 30 m of height, outside manoeuvres: legs from one manoeuvre to another are left out;
- the longest time without a break below -1 g;
- extra circles: legs, other than from one manoeuvre to another, that turn the course by 330 degrees more than the leg
  needs. It needs the difference of the courses at both its ends, or where that is more, what the shortest path of two
  arcs and a line between them turns on the whole, at the radius of the largest load factor on the leg.

The second table says how many of these flights keep each limit. Values beyond a limit by less than `TOLERANCES` keep
it. As a check of the columns the attitude's quaternion is differentiated; where that disagrees with `p_Kbar` at a
passing, a remark on stderr says so. `--details` adds a row per passing. The exit code is 1 where a limit does not hold.

`--compare` prints the race times of the runs that two folders share, by name and stage.
"""

import argparse
import csv
import itertools
import json
import math
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Row = tuple[str, ...]

G_0 = 9.80665
RATE_HZ = 100
LOW_HEIGHT_M = 30.0
PUSH_G = -1.0
CIRCLE_DEG = 330.0
STEEP_DEG = 75.0
"""From this climb angle on the course says nothing of a turn: it jumps by half a turn over the vertical."""
LIMITS = {"roll rate": 90.0, "|n_y|": 0.1, "|beta|": 2.0, "n_z below 30 m": 0.0, "time below -1 g": 0.0}
TOLERANCES = {"roll rate": 0.1, "|n_y|": 0.002, "|beta|": 0.1, "n_z below 30 m": 0.02, "time below -1 g": 0.0}
"""In deg/s, g, deg, g, s. The load factor that counts as a push is lower than `PUSH_G` by that of the load factor."""
APART_S = 1e-3
"""Rows of later tables that are nearer to a row of the first are left out: differences over less would be rounding."""


@dataclass(frozen=True)
class Recording:
    """A flight as exported: columns over time, and its passings.

    Attributes:
        columns: `time_s` and all histories by the header of their column; each of shape (n,), by increasing time.
        certified: whether the export says so.
        passings: names and times, s, of the passings in the order flown.
        gates: which of the passings are of gates and pylons.
    """

    columns: Mapping[str, Array]
    certified: bool
    passings: tuple[tuple[str, float], ...]
    gates: tuple[bool, ...]

    def at(self, header: str, time: float) -> float:
        """Return the value of a column at a time, interpolated linearly; NaN where there is no such column."""
        if header not in self.columns:
            return math.nan
        return float(np.interp(time, self.columns["time_s"], self.columns[header]))

    def during(self, start: float, end: float) -> NDArray[np.intp]:
        """Return the rows from one time to another, both included."""
        time = self.columns["time_s"]
        return np.flatnonzero((time >= start - 1e-9) & (time <= end + 1e-9))


@dataclass(frozen=True)
class Passing:
    """What is flown at one passing: roll rates in deg/s, n_y in g, beta_A in deg; the check is of the roll rate."""

    name: str
    place: str  # "start", "gates", "finish" or "manoeuvre"
    roll_rate: float
    body_roll_rate: float
    n_y: float
    beta: float
    differentiated: float


@dataclass(frozen=True)
class Measured:
    """What is measured of one flight.

    Attributes:
        race_time: s.
        certified: whether the export says so.
        passings: one for each passing.
        low_load: the least load factor below 30 m outside manoeuvres, g; NaN if it never is there.
        push: the longest time below -1 g, s.
        circles: the legs with an extra circle, and by how many degrees they turn more than they need.
    """

    race_time: float
    certified: bool
    passings: tuple[Passing, ...]
    low_load: float
    push: float
    circles: Mapping[str, float]

    def largest(self, place: str, value: str) -> float:
        """Return the largest magnitude of a value at passings of a place; NaN if there is none."""
        sizes = [abs(getattr(passing, value)) for passing in self.passings if passing.place == place]
        return max(sizes, default=math.nan)

    def verdicts(self) -> dict[str, bool]:
        """Return which limits hold."""
        values = {
            "roll rate": max(0.0, *(self._finite(place, "roll_rate") for place in ("start", "gates", "finish"))),
            "|n_y|": max(0.0, *(self._finite(place, "n_y") for place in ("start", "gates", "finish"))),
            "|beta|": max(0.0, *(self._finite(place, "beta") for place in ("start", "gates", "finish"))),
            "n_z below 30 m": 0.0 if math.isnan(self.low_load) else -self.low_load,
            "time below -1 g": self.push,
        }
        held = {name: value <= LIMITS[name] + TOLERANCES[name] for name, value in values.items()}
        return {**held, "no extra circle": not self.circles}

    def _finite(self, place: str, value: str) -> float:
        largest = self.largest(place, value)
        return 0.0 if math.isnan(largest) else largest


def recording(tables: Sequence[Path], splits: Path, kinds: Mapping[str, str]) -> Recording:
    """Read a flight.

    Args:
        tables: exports of one flight, at different times; together they are one table, each time once.
        splits: the table of gate splits.
        kinds: `gate` or `pylon` by the name of an element; all others are manoeuvres.
    """
    headers, rows, certified = _columns(tables[0])
    time = headers.index("time_s")
    for path in tables[1:]:
        _, more, _ = _columns(path)
        gaps = np.abs(more[:, time, None] - rows[None, :, time]).min(axis=1)
        rows = np.vstack([rows, more[gaps > APART_S]])
    rows = rows[np.argsort(rows[:, time])]
    columns = {header: rows[:, place] for place, header in enumerate(headers)}
    with splits.open(newline="", encoding="utf-8") as stream:
        passings = tuple((row["passage"], float(row["time_s"])) for row in csv.DictReader(stream))
    gates = tuple(_is_gate(name, kinds) for name, _ in passings)
    return Recording(columns, certified, passings, gates)


def _columns(path: Path) -> tuple[list[str], Array, bool]:
    """Return the headers of the columns of numbers, the rows, and whether the comments say that it is certified."""
    with path.open(newline="", encoding="utf-8") as stream:
        lines = list(stream)
    table = csv.reader(line for line in lines if not line.startswith("#"))
    headers = next(table)
    numbers = [place for place, header in enumerate(headers) if header != "phase"]
    rows = [[float(row[place]) for place in numbers] for row in table]
    return (
        [headers[place] for place in numbers],
        np.array(rows),
        any(line.startswith("# certified: yes") for line in lines),
    )


def _is_gate(passing: str, kinds: Mapping[str, str]) -> bool:
    """Tell whether a passing, `LAP:ELEMENT`, with `/PART` and `#NUMBER` behind it, is one of a gate or a pylon."""
    name = passing.partition(":")[2].partition("#")[0]
    return kinds.get(name, kinds.get(name.partition("/")[0])) in ("gate", "pylon")


def measure(flight: Recording) -> Measured:
    """Measure a flight; see the head of this file."""
    rolling = differentiated_roll_rate(flight)
    passings: list[Passing] = []
    last = len(flight.passings) - 1
    for number, ((name, time), gate) in enumerate(zip(flight.passings, flight.gates, strict=True)):
        place = "start" if number == 0 else "finish" if number == last else "gates" if gate else "manoeuvre"
        roll_rate = flight.at("p_Kbar_deg_s", time)
        differentiated = float(np.interp(time, flight.columns["time_s"], rolling))
        if math.isnan(roll_rate):
            roll_rate = differentiated
        body_roll_rate = flight.at("p_K_deg_s", time)
        values = (flight.at("n_y", time), flight.at("beta_A_deg", time))
        passings.append(Passing(name, place, roll_rate, body_roll_rate, *values, differentiated))
    low_loads: list[float] = []
    circles: dict[str, float] = {}
    for number, ((start_name, start), (end_name, end)) in enumerate(itertools.pairwise(flight.passings)):
        if flight.gates[number] or flight.gates[number + 1]:
            low_loads.append(_least_load_below(flight, flight.during(start, end), LOW_HEIGHT_M))
            excess = needless_turn(flight, start, end)
            if excess > CIRCLE_DEG:
                circles[f"{start_name} -> {end_name}"] = excess
    finite = [load for load in low_loads if not math.isnan(load)]
    push = longest_time_below(flight.columns["time_s"], flight.columns["n_z"], PUSH_G - TOLERANCES["n_z below 30 m"])
    race_time = flight.passings[-1][1] - flight.passings[0][1]
    return Measured(race_time, flight.certified, tuple(passings), min(finite, default=math.nan), push, circles)


def _least_load_below(flight: Recording, rows: NDArray[np.intp], height: float) -> float:
    loads = flight.columns["n_z"][rows][flight.columns["height_m"][rows] < height]
    return float(loads.min()) if len(loads) else math.nan


def longest_time_below(time: Array, values: Array, limit: float) -> float:
    """Return the longest time, s, without a break in which a history, linear between its rows, is below a limit."""
    longest, since = 0.0, None
    for row in range(len(time)):
        below = values[row] < limit
        if below and since is None:
            since = time[0] if row == 0 else _crossing(time, values, row, limit)
        if since is not None and (not below or row == len(time) - 1):
            until = time[row] if below else _crossing(time, values, row, limit)
            longest = max(longest, float(until - since))
            since = None if not below else since
    return longest


def _crossing(time: Array, values: Array, row: int, limit: float) -> float:
    """Return when a history crosses a limit between the row before and this one, s."""
    before, after = values[row - 1], values[row]
    return float(time[row - 1] + (time[row] - time[row - 1]) * (limit - before) / (after - before))


def differentiated_roll_rate(flight: Recording) -> Array:
    """Return the roll rate about the velocity, deg/s, from differences of the attitude: of `q_dot = 1/2 q o (0, p)`."""
    time = flight.columns["time_s"]
    q = np.array([flight.columns[f"q{part}"] for part in range(4)])
    q = q * np.where(np.concatenate(([False], np.cumsum(np.sum(q[:, 1:] * q[:, :-1], axis=0) < 0) % 2 == 1)), -1, 1)
    q_dot = np.gradient(q, time, axis=1)
    p = 2.0 * (q[0] * q_dot[1] - q[1] * q_dot[0] - q[2] * q_dot[3] + q[3] * q_dot[2]) / np.sum(q * q, axis=0)
    return np.degrees(p)


def needless_turn(flight: Recording, start: float, end: float) -> float:
    """Return by how many degrees the course turns on a leg more than the leg needs, at least zero."""
    rows = flight.during(start, end)
    chi, gamma = flight.columns["chi_deg"][rows], flight.columns["gamma_deg"][rows]
    turned = abs(_turned(chi, gamma))
    direct = abs(math.remainder(chi[-1] - chi[0], 360.0))
    radius = turn_radius(flight.columns["V_K_m_s"][rows], flight.columns["n_z"][rows])
    x, y = flight.columns["x_m"][rows], flight.columns["y_m"][rows]
    ends = ((x[0], y[0], math.radians(chi[0])), (x[-1], y[-1], math.radians(chi[-1])))
    return max(0.0, turned - max(direct, shortest_path_turn(*ends, radius)))


def _turned(chi: Array, gamma: Array) -> float:
    """Return the whole turn of the course, degrees; over the vertical, to the side with the lesser sum."""
    shallow = np.flatnonzero(np.abs(gamma) < STEEP_DEG)
    if len(shallow) < 2:
        return 0.0
    steps = np.array([math.remainder(step, 360.0) for step in np.diff(chi[shallow])])
    over = np.diff(shallow) > 1
    sides = [(step, step - math.copysign(360.0, step)) if abs(step) > 120.0 else (step,) for step in steps[over]]
    sums = [float(steps[~over].sum() + sum(chosen)) for chosen in itertools.product(*sides)]
    return min(sums, key=abs)


def turn_radius(V_K: Array, n_z: Array) -> float:
    """Return the radius of a level turn at the mean speed, m/s, with the largest of some load factors, m."""
    n = max(1.1, float(np.abs(n_z).max()))
    return float(V_K.mean()) ** 2 / (G_0 * math.sqrt(n * n - 1.0))


def shortest_path_turn(start: tuple[float, float, float], end: tuple[float, float, float], radius: float) -> float:
    """Return the magnitude of the whole turn, degrees, along the shortest path of an arc, a line and an arc.

    Args:
        start, end: metres north and east, and course from north to east, rad.
        radius: of both arcs, m.
    """
    length, turn = math.inf, 0.0
    for first, second in itertools.product((1.0, -1.0), repeat=2):  # +1 turns right
        centres = [(x - side * radius * math.sin(chi), y + side * radius * math.cos(chi)) for (x, y, chi), side in
                   ((start, first), (end, second))]  # fmt: skip
        north, east = centres[1][0] - centres[0][0], centres[1][1] - centres[0][1]
        distance = math.hypot(north, east)
        if first == second:
            line, course = distance, math.atan2(east, north) if distance else start[2]
        elif distance >= 2.0 * radius:
            line = math.sqrt(distance**2 - 4.0 * radius**2)
            course = math.atan2(east, north) + first * math.atan2(2.0 * radius, line)
        else:
            continue
        arcs = [
            (first * (course - start[2])) % (2.0 * math.pi),
            (second * (end[2] - course)) % (2.0 * math.pi),
        ]
        arcs = [0.0 if 2.0 * math.pi - arc < 1e-9 else arc for arc in arcs]
        whole = line + radius * sum(arcs)
        if whole < length:
            length, turn = whole, abs(math.degrees(first * arcs[0] + second * arcs[1]))
    return turn


def airrace(*arguments: object) -> str:
    """Return what a command of airrace prints."""
    command = [sys.executable, "-m", "airrace", *map(str, arguments)]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def stages_of(run: Path) -> list[str]:
    """The stages of a run that found a flight, without the homotopy, which is only a guess."""
    stages = json.loads(airrace("show", run, "--no-verify", "--json"))["stages"]
    return [stage["stage"] for stage in stages if stage["race_time_s"] is not None and stage["stage"] != "homotopy"]


def kinds_of(run: Path, stage: str, folder: Path) -> dict[str, str]:
    """Return `gate` or `pylon` by the name of each such element of the course of a run."""
    features = folder / "course.geojson"
    airrace("export", "geojson", f"{run}:{stage}", "--origin", "0,0,0", "--output", features)
    entries = [feature["properties"] for feature in json.loads(features.read_text(encoding="utf-8"))["features"]]
    return {entry["name"]: entry["kind"] for entry in entries if entry["kind"] in ("gate", "pylon")}


def exported(run: Path, stage: str, kinds: Mapping[str, str], folder: Path) -> Recording:
    """Export one stage of a run into a folder, and read it."""
    nodes, fine = folder / f"{stage}.csv", folder / f"{stage}_fine.csv"
    airrace("export", "csv", run, "--stage", stage, "--output", nodes)
    airrace("export", "csv", run, "--stage", stage, "--rate", RATE_HZ, "--output", fine)
    return recording([nodes, fine], folder / f"{stage}.splits.csv", kinds)


HEADINGS = (
    "flight",
    "race time s",
    "certified",
    "roll rate °/s: start, gates, finish",
    "n_y g",
    "β_A °",
    "least n_z below 30 m",
    "s below -1 g",
    "extra circles",
    "beyond a limit",
)


def table_row(name: str, measured: Measured) -> Row:
    """Return the row of a flight in the first table."""
    values = [
        ", ".join(_number(measured.largest(place, value), digits) for place in ("start", "gates", "finish"))
        for value, digits in (("roll_rate", 1), ("n_y", 3), ("beta", 2))
    ]
    broken = [limit for limit, held in measured.verdicts().items() if not held]
    circles = "; ".join(f"{leg} {excess:.0f}°" for leg, excess in measured.circles.items()) or "0"
    told = (name, f"{measured.race_time:.3f}", "yes" if measured.certified else "no")
    low, push = _number(measured.low_load, 2), f"{measured.push:.2f}"
    return (*told, *values, low, push, circles, ", ".join(broken) or "-")


def detail_rows(name: str, measured: Measured) -> Iterator[Row]:
    """Yield a row for each passing of a flight."""
    for passing in measured.passings:
        rates = (passing.roll_rate, passing.differentiated, passing.body_roll_rate)
        loads = (_number(passing.n_y, 3), _number(passing.beta, 2))
        yield (name, passing.name, passing.place, *(_number(rate, 1) for rate in rates), *loads)


def _number(value: float, digits: int) -> str:
    return "-" if math.isnan(value) else f"{value + 0.0:.{digits}f}"


def summary_rows(flights: Iterable[Measured]) -> Iterator[Row]:
    """Yield for every limit how many flights keep it."""
    verdicts = [flight.verdicts() for flight in flights]
    for limit in verdicts[0] if verdicts else ():
        kept = sum(verdict[limit] for verdict in verdicts)
        yield (limit, f"{kept} of {len(verdicts)}", "holds" if kept == len(verdicts) else "**does not hold**")


def print_table(headings: Row, rows: Iterable[Row]) -> None:
    for row in (headings, ("---",) * len(headings), *rows):
        print("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |")
    print(flush=True)


def remark(name: str, measured: Measured) -> None:
    """Say on stderr where the attitude disagrees with the roll rate of its own column."""
    for passing in measured.passings:
        if abs(passing.differentiated - passing.roll_rate) > 5.0 + 0.05 * abs(passing.roll_rate):
            rates = f"{passing.roll_rate:.1f} °/s, by its attitude {passing.differentiated:.1f} °/s"
            print(f"{name}, {passing.name}: the roll rate is {rates}", file=sys.stderr)


def measure_runs(runs: Sequence[Path], stage: str | None, details: bool) -> bool:
    """Print the tables of some runs, and return whether all limits hold."""
    flights: dict[str, Measured] = {}
    for run in runs:
        stages = [name for name in stages_of(run) if stage in (None, name)]
        if not stages:
            print(f"{run.stem}: no flight", file=sys.stderr)
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            kinds = kinds_of(run, stages[0], folder) if stages else {}
            for found in stages:
                flight = measure(exported(run, found, kinds, folder))
                flights[f"{run.stem}, {found}"] = flight
                remark(f"{run.stem}, {found}", flight)
    print_table(HEADINGS, (table_row(*item) for item in flights.items()))
    if details:
        headings = (
            "flight",
            "passing",
            "place",
            "roll rate °/s",
            "by attitude °/s",
            "of the body",
            "n_y g",
            "β_A °",
        )
        print_table(headings, (row for item in flights.items() for row in detail_rows(*item)))
    print_table(("limit", "kept by", ""), summary_rows(flights.values()))
    return bool(flights) and all(all(flight.verdicts().values()) for flight in flights.values())


def compare_folders(before: Path, after: Path, stage: str | None) -> None:
    """Print the race times of two folders of runs side by side."""
    folders = [{run.stem: run for run in folder.glob("*.h5")} for folder in (before, after)]
    rows: list[Row] = []
    for name in sorted(folders[0].keys() | folders[1].keys()):
        times = [race_times(folder[name]) if name in folder else {} for folder in folders]
        for found in dict.fromkeys((*times[0], *times[1])):
            if stage in (None, found):
                earlier, later = (side.get(found, math.nan) for side in times)
                difference = _number(1000.0 * (later - earlier), 1)
                rows.append((name, found, _number(earlier, 3), _number(later, 3), difference))
    print_table(("run", "stage", "before s", "after s", "difference ms"), rows)


def race_times(run: Path) -> dict[str, float]:
    """Return the race times of the stages of a run by the splits of their exports, s."""
    times: dict[str, float] = {}
    for stage in stages_of(run):
        with tempfile.TemporaryDirectory() as folder:
            table = Path(folder, "flight.csv")
            airrace("export", "csv", run, "--stage", stage, "--output", table)
            passings = recording([table], table.with_name("flight.splits.csv"), {}).passings
            times[stage] = passings[-1][1] - passings[0][1]
    return times


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="*", type=Path, metavar="RUN.h5")
    parser.add_argument("--stage", help="only this stage; by default all but the homotopy")
    parser.add_argument("--details", action="store_true", help="print a row for each passing, too")
    parser.add_argument("--compare", nargs=2, type=Path, metavar=("BEFORE", "AFTER"), help="folders of runs")
    chosen = parser.parse_args()
    if bool(chosen.runs) == bool(chosen.compare):
        parser.error("give either runs or --compare BEFORE AFTER")
    if chosen.compare:
        compare_folders(*chosen.compare, chosen.stage)
    elif not measure_runs(chosen.runs, chosen.stage, chosen.details):
        sys.exit(1)


if __name__ == "__main__":
    main()
