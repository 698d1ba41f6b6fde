"""How long all stages take, from the point mass to six degrees of freedom, measured on the real command.

    python scripts/benchmark_stages.py [COURSE ...] [--repeats 3] [--threads 2] [--mesh-check last] [--search off]
                                       [--until STAGE] [--beside PYTHON] [--shares] [--what-if KEY=VALUE]

COURSE is a shipped course or a track file; by default rovinj_2014. Every run is `airrace optimize` from the plan, in a
process of its own; the runs of several courses take turns, so that a busy minute of the machine meets all of them. Of
each course the run with the median wall time is printed. Processor seconds, of all cores together, show how much of the
wall time was waiting for other work.

- `--beside PYTHON` flies each course as often with the airrace that this Python has installed, and prints the ratios.
- `--shares` flies each course once more with clocks around its parts, see `profile_stages.py`.
- `--what-if KEY=VALUE` (again for more) changes the run as well, as `airrace resume --set` does.

Nothing else should run on the machine meanwhile. Ends with 1 if a run is not certified.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
Row = tuple[str, ...]
Answer = dict[str, Any]  # Any: as read from JSON


@dataclass(frozen=True)
class Measurement:
    """One command: seconds with all its loading, memory of its largest process, and the object that it printed."""

    wall: float
    processor: float
    megabytes: float
    answer: Answer

    @property
    def race(self) -> float:
        """Race time of the last stage, s."""
        return self.answer["race_time_s"]

    def headline(self, name: str) -> Row:
        """A line of the table of runs."""
        search = sum(stage["search"]["seconds"] for stage in self.answer["stages"] if stage["search"])
        seconds = (f"{self.race:.3f}", f"{self.wall:.1f}", f"{self.processor:.1f}", f"{search:.1f}")
        shares = (f"{self.wall / self.race:.2f}", f"{self.processor / self.race:.2f}")
        return (name, *seconds, *shares, f"{self.megabytes:.0f}")

    def stage_rows(self) -> list[Row]:
        """One row per stage, and one for what lies between the stages."""
        rows: list[Row] = []
        for one in self.answer["stages"]:
            items = {item["name"]: item["value"] for item in (one["certificate"] or {"items": []})["items"]}
            accuracy = (f"{items.get('replay_defect', 0.0):.1e}", f"{items.get('race_time_change', 0.0):.4f}")
            seconds = (f"{one[key]:.2f}" for key in ("solve_s", "derivatives_s", "wall_s"))
            intervals = str(one["mesh"]["intervals"]) if one["mesh"] else ""
            found = (one["status"], f"{one['race_time_s']:.3f}", str(one["iterations"]), intervals)
            rows.append((f"`{one['stage']}`", *found, *seconds, f"{one['wall_s'] / self.wall:.0%}", *accuracy))
        rest = self.wall - sum(one["wall_s"] for one in self.answer["stages"])
        return [*rows, ("loading and writing", *[""] * 6, f"{rest:.2f}", f"{rest / self.wall:.0%}", "", "")]


RUNS: Row = ("run", "race time s", "wall s", "processor s", "search s", "wall / race", "processor / race", "memory MB")
STAGES: Row = (
    *("stage", "state", "race time s", "iterations", "intervals", "solver s", "derivatives s", "stage s"),
    *("share", "replay defect", "change s"),
)
RATIOS: Row = ("course", "wall s", "beside", "ratio", "processor s", "beside", "ratio", "race time, ms")


def measure(*arguments: str, folder: Path, python: str = sys.executable) -> Measurement:
    """Run one command of an installed airrace to its end, in a folder.

    Raises:
        SystemExit: it did not end with a certified flight.
    """
    command, started = [python, "-P", "-m", "airrace", *arguments, "--json", "--quiet"], time.perf_counter()
    environment = dict(os.environ)
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # an installed package has its modules compiled
    running = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment, cwd=folder)
    assert running.stdout is not None  # it is a pipe
    printed = running.stdout.read()
    _, status, used = os.wait4(running.pid, 0)
    if status:
        raise SystemExit(f"{' '.join(command)} ended with {os.waitstatus_to_exitcode(status)}")
    seconds = time.perf_counter() - started
    return Measurement(seconds, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024.0, json.loads(printed))


def ratio_row(name: str, own: Sequence[Measurement], other: Sequence[Measurement]) -> Row:
    """The least seconds of this version over those of the other."""
    row: list[str] = []
    for key in ("wall", "processor"):
        mine, theirs = (min(getattr(one, key) for one in runs) for runs in (own, other))
        row += [f"{mine:.2f}", f"{theirs:.2f}", f"{mine / theirs:.2f}"]
    return (name, *row, f"{1000.0 * (own[0].race - other[0].race):+.3f}")


def share_rows(clocks: Mapping[str, Any]) -> list[Row]:  # Any: as read from JSON
    """One row per stage and one for all, with the parts as shares of its wall time."""
    parts = next(iter(clocks.values()))["parts"]
    rows: list[Row] = [("stage", "wall s", "processor s", *parts)]
    total = {
        "wall": sum(one["wall"] for one in clocks.values()),
        "processor": sum(one["processor"] for one in clocks.values()),
        "parts": {part: sum(one["parts"][part] for one in clocks.values()) for part in parts},
    }
    for name, one in {**clocks, "all": total}.items():
        shares = (f"{one['parts'][part] / one['wall']:.0%}" for part in parts)
        rows.append((name, f"{one['wall']:.2f}", f"{one['processor']:.2f}", *shares))
    return rows


def print_rows(*rows: Row) -> None:
    """As a Markdown table, the first row as its headings."""
    for row in (rows[0], ("---",) * len(rows[0]), *rows[1:]):
        print("| " + " | ".join(row) + " |")
    print()


def main() -> None:
    """Run the benchmark and print its tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("courses", nargs="*", default=["rovinj_2014"], metavar="COURSE")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--threads", default="2")
    parser.add_argument("--mesh-check", choices=("last", "all"), default="last")
    parser.add_argument("--search", choices=("off", "quick", "thorough"), default="off")
    parser.add_argument("--until", default="six-dof", metavar="STAGE")
    parser.add_argument("--beside", metavar="PYTHON", help="fly with the airrace of this Python, too, in turn")
    parser.add_argument("--shares", action="store_true", help="once more with clocks around its parts")
    parser.add_argument("--what-if", action="append", default=[], metavar="KEY=VALUE", help="change the run, too")
    asked = parser.parse_args()
    common = ("--until", asked.until, "--threads", asked.threads, "--force")
    options = ("--guess", "plan", "--mesh-check", asked.mesh_check, "--search", asked.search, *common)
    courses = {Path(one).stem: str(Path(one).resolve()) if Path(one).exists() else one for one in asked.courses}
    own: dict[str, list[Measurement]] = {name: [] for name in courses}
    other: dict[str, list[Measurement]] = {name: [] for name in courses}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for _ in range(asked.repeats):
            for course, path in courses.items():
                if asked.beside:
                    other[course].append(measure("optimize", path, *options, folder=folder, python=asked.beside))
                own[course].append(measure("optimize", path, *options, folder=folder))
        medians = {one: sorted(runs, key=lambda run: run.wall)[len(runs) // 2] for one, runs in own.items()}
        if asked.what_if:
            sets = [part for change in asked.what_if for part in ("--set", change)]
            for course in courses:
                changed = measure("resume", f"{course}.h5", *sets, "--output", "new.h5", *common, folder=folder)
                medians[f"{course}, {', '.join(asked.what_if)}"] = changed
        print_rows(RUNS, *(run.headline(one) for one, run in medians.items()))
        if asked.beside:
            print_rows(RATIOS, *(ratio_row(one, own[one], other[one]) for one in courses))
        for one, run in medians.items():
            print(f"**{one}**\n")
            print_rows(STAGES, *run.stage_rows())
        for course, path in courses.items() if asked.shares else ():
            clocks = folder / "clocks.json"
            profiler = [sys.executable, str(ROOT / "scripts" / "profile_stages.py"), str(clocks)]
            command = [*profiler, "optimize", path, "--output", "shares.h5", "--quiet", *options, "--search", "off"]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL, cwd=folder)
            print(f"**{course}, shares of the time**\n")
            print_rows(*share_rows(json.loads(clocks.read_text())))


if __name__ == "__main__":
    main()
