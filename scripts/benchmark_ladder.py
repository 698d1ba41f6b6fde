"""How long the whole ladder takes, from the point mass to six degrees of freedom, measured on the real command.

    python scripts/benchmark_ladder.py [COURSE ...] [--repeats 3] [--threads 2] [--mesh-check last] [--search off]
                                       [--until STAGE] [--beside PYTHON] [--shares] [--what-if KEY=VALUE] [--json FILE]
                                       [--against FILE]

COURSE is a shipped course or a track file; by default rovinj_2014. Every run is `airrace optimize` from the plan, in a
process of its own; the runs of several courses take turns, so that a busy minute of the
machine meets all of them. Of each course the run with the median wall time is told: the headline with wall and
processor time over race time, then per stage race time, iterations, intervals, seconds and accuracy. Processor seconds,
of all cores together, tell how much of the wall time was waiting for other work on the machine.

- `--beside PYTHON` flies each course as often with the airrace that this Python has installed, in turn, and tells the
  ratios: another version, or one without the native library.
- `--shares` flies each course once more with clocks around its parts, see `ladder_shares.py`: which shares of each
  stage's seconds went into derivatives, linear algebra, putting together, replay, simulation, and input and output.
- `--what-if KEY=VALUE` (again for more) changes the flown run, too, as `airrace resume --set` does.
- `--json FILE` keeps all figures; `--against FILE` compares with those that were kept. Seconds are compared only where
  both stages ended in the same state: a run that proves less is not a faster one.

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
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ladder_shares import BETWEEN

ROOT = Path(__file__).resolve().parent.parent
BESIDE = ", beside"
"""What is added to the name of a course that the other version flew."""
ACCURACY = ("replay_defect", "race_time_change", "hamiltonian_drift")
"""The items of the certificate that tell how accurate a stage is."""


@dataclass(frozen=True)
class Stage:
    """One stage of a run: what it found, and what that took (s)."""

    name: str
    state: str
    race_time: float
    iterations: int
    intervals: int
    wall: float
    solver: float
    derivatives: float
    accuracy: Mapping[str, float]


@dataclass(frozen=True)
class Measurement:
    """One command: `wall` and `processor` seconds with all its loading, memory of its largest process, its stages."""

    wall: float
    processor: float
    megabytes: float
    explored: float
    stages: tuple[Stage, ...]

    @property
    def race(self) -> float:
        """Race time of the last stage, s."""
        return self.stages[-1].race_time


class Uncertified(Exception):
    """A command that did not end with a certified flight."""


def measured(*arguments: str, folder: Path, python: str = sys.executable) -> Measurement:
    """Run one command of an installed airrace to its end, in a folder.

    Raises:
        Uncertified: it ended otherwise.
    """
    command, started = [python, "-P", "-m", "airrace", *arguments, "--json", "--quiet"], time.perf_counter()
    environment = dict(os.environ)
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # an installed package has its modules compiled
    with tempfile.TemporaryFile("w+") as told:
        running = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=told, text=True, env=environment, cwd=folder)
        assert running.stdout is not None  # it is a pipe
        said = running.stdout.read()
        _, status, used = os.wait4(running.pid, 0)
        told.seek(0)
        if status:
            raise Uncertified(f"{' '.join(command)} ended with {os.waitstatus_to_exitcode(status)}:\n{told.read()}")
    answer = json.loads(said)
    explored = [stage["search"]["seconds"] for stage in answer["stages"] if stage["search"]]
    return Measurement(
        wall=time.perf_counter() - started,
        processor=used.ru_utime + used.ru_stime,
        megabytes=used.ru_maxrss / 1024.0,
        explored=sum(explored),
        stages=tuple(stage_of(one) for one in answer["stages"]),
    )


def stage_of(told: Mapping[str, Any]) -> Stage:  # Any: as read from JSON
    """A stage as the command tells it."""
    items = (
        {} if told["certificate"] is None else {item["name"]: item["value"] for item in told["certificate"]["items"]}
    )
    return Stage(
        name=told["stage"],
        state=told["state"],
        race_time=told["race_time_s"],
        iterations=told["iterations"],
        intervals=0 if told["mesh"] is None else told["mesh"]["intervals"],
        wall=told["wall_s"],
        solver=told["solve_s"],
        derivatives=told["derivatives_s"],
        accuracy={name: items[name] for name in ACCURACY if name in items},
    )


def median(runs: Sequence[Measurement]) -> Measurement:
    """The run with the median wall time."""
    return sorted(runs, key=lambda run: run.wall)[len(runs) // 2]


Row = tuple[str, ...]


def headline(name: str, run: Measurement) -> Row:
    """A line of the table of runs."""
    over = (f"{run.wall / run.race:.2f}", f"{run.processor / run.race:.2f}")
    seconds = (f"{run.race:.3f}", f"{run.wall:.1f}", f"{run.processor:.1f}", f"{run.explored:.1f}")
    return (name, *seconds, *over, f"{run.megabytes:.0f}")


HEADLINES: Row = (
    *("run", "race time s", "wall s", "processor s", "of it exploring s"),
    *("wall / race", "processor / race", "memory MB"),
)


def stage_rows(run: Measurement) -> list[Row]:
    """Headings, one row per stage, and one for what lies between the stages."""
    rows: list[Row] = [
        (
            *("stage", "state", "race time s", "iterations", "intervals", "solver s", "derivatives s", "stage s"),
            *("share", "replay defect", "change s"),
        )
    ]
    for one in run.stages:
        seconds = (f"{one.solver:.2f}", f"{one.derivatives:.2f}", f"{one.wall:.2f}", f"{one.wall / run.wall:.0%}")
        accuracy = (form(one.accuracy.get("replay_defect"), ".1e"), form(one.accuracy.get("race_time_change"), ".4f"))
        counts = (f"{one.race_time:.3f}", str(one.iterations), str(one.intervals))
        rows.append((f"`{one.name}`", one.state, *counts, *seconds, *accuracy))
    rest = run.wall - sum(one.wall for one in run.stages)
    rows.append(("loading and writing", *[""] * 6, f"{rest:.2f}", f"{rest / run.wall:.0%}", "", ""))
    return rows


def form(value: float | None, how: str) -> str:
    """A number, or nothing."""
    return "" if value is None else format(value, how)


def compared_rows(now: Measurement, before: Mapping[str, Any]) -> list[Row]:  # Any: as read from JSON
    """Stages beside those that were kept; ratios only where both ended in the same state."""
    rows: list[Row] = [
        ("stage", "state", "before", "race time, ms", "iterations", "before", "stage s", "before", "ratio")
    ]
    kept = {one["name"]: one for one in before["stages"]}
    for one in now.stages:
        if one.name not in kept:
            continue
        then = kept[one.name]
        ratio = f"{one.wall / then['wall']:.2f}" if one.state == then["state"] else "-"
        moved = f"{1000.0 * (one.race_time - then['race_time']):+.3f}"
        counts = (str(one.iterations), str(then["iterations"]), f"{one.wall:.2f}", f"{then['wall']:.2f}", ratio)
        rows.append((f"`{one.name}`", one.state, then["state"], moved, *counts))
    return rows


def ratio_rows(runs: Mapping[str, Sequence[Measurement]]) -> list[Row]:
    """One row per course that was flown by both versions: the least seconds of this one over those of the other."""
    rows: list[Row] = [("course", "wall s", "beside", "ratio", "processor s", "beside", "ratio", "race time, ms")]
    for name, own in runs.items():
        if (other := runs.get(f"{name}{BESIDE}")) is not None:
            row = [name]
            for mine, theirs in (
                (min(one.wall for one in own), min(one.wall for one in other)),
                (min(one.processor for one in own), min(one.processor for one in other)),
            ):
                row += [f"{mine:.2f}", f"{theirs:.2f}", f"{mine / theirs:.2f}"]
            rows.append((*row, f"{1000.0 * (own[0].race - other[0].race):+.3f}"))
    return rows


def share_rows(told: Mapping[str, Any]) -> list[Row]:  # Any: as read from JSON
    """One row per stage and one for all, with the parts as shares of its wall time."""
    parts = next(iter(told.values()))["parts"]
    rows: list[Row] = [("stage", "wall s", "processor s", *parts)]
    between = told[BETWEEN]
    stages = {f"`{name}`": one for name, one in told.items() if one is not between}
    whole = {
        "wall": sum(one["wall"] for one in told.values()),
        "processor": sum(one["processor"] for one in told.values()),
        "parts": {part: sum(one["parts"][part] for one in told.values()) for part in parts},
    }
    for name, one in {**stages, "between them": between, "all": whole}.items():
        shares = (f"{one['parts'][part] / one['wall']:.0%}" for part in parts)
        rows.append((name, f"{one['wall']:.2f}", f"{one['processor']:.2f}", *shares))
    return rows


def print_rows(rows: Sequence[Row]) -> None:
    """As a Markdown table."""
    headings, *rest = rows
    for row in (headings, ("---",) * len(headings), *rest):
        print("| " + " | ".join(row) + " |")
    print()


def runs_of(courses: Sequence[str], asked: argparse.Namespace, folder: Path) -> dict[str, list[Measurement]]:
    """Fly all courses, as it is asked for beside another version and changed; the runs by what they are called."""
    options = (
        "--guess",
        "plan",
        "--threads",
        str(asked.threads),
        "--mesh-check",
        asked.mesh_check,
        "--until",
        asked.until,
    )

    def fly(course: str, python: str) -> Measurement:
        path = str(Path(course).resolve()) if Path(course).exists() else course
        return measured("optimize", path, "--force", *options, "--search", asked.search, folder=folder, python=python)

    runs: dict[str, list[Measurement]] = {}
    for _ in range(asked.repeats):
        for course in courses:
            if asked.beside:
                runs.setdefault(f"{Path(course).stem}{BESIDE}", []).append(fly(course, asked.beside))
            runs.setdefault(Path(course).stem, []).append(fly(course, sys.executable))
    for course in courses if asked.what_if else ():
        stored, new = (str(folder / f"{name}.h5") for name in (Path(course).stem, "changed"))
        sets = [part for change in asked.what_if for part in ("--set", change)]
        chosen = ("--until", asked.until, "--threads", str(asked.threads))
        changed = measured("resume", stored, *sets, "--output", new, "--force", *chosen, folder=folder)
        runs[f"{Path(course).stem}, {', '.join(asked.what_if)}"] = [changed]
    return runs


def shares_of(course: str, asked: argparse.Namespace, folder: Path) -> dict[str, Any]:  # Any: as read from JSON
    """Fly a course once with clocks around its parts."""
    told, out = folder / "shares.json", str(folder / "shares.h5")
    timed = (sys.executable, str(ROOT / "scripts" / "ladder_shares.py"), str(told), "optimize", course)
    chosen = (
        "--guess",
        "plan",
        "--threads",
        str(asked.threads),
        "--mesh-check",
        asked.mesh_check,
        "--until",
        asked.until,
    )
    command = (*timed, "--output", out, "--force", "--search", "off", "--quiet", *chosen)
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, cwd=ROOT)
    found: dict[str, Any] = json.loads(told.read_text())
    return found


def main() -> int:
    """Run the benchmark and print its tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("courses", nargs="*", default=["rovinj_2014"], metavar="COURSE")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--mesh-check", choices=("last", "all"), default="last")
    parser.add_argument("--search", choices=("off", "quick", "thorough"), default="off")
    parser.add_argument("--until", default="six-dof", metavar="STAGE")
    parser.add_argument("--beside", metavar="PYTHON", help="fly with the airrace of this Python, too, in turn")
    parser.add_argument("--shares", action="store_true", help="once more with clocks around its parts")
    parser.add_argument("--what-if", action="append", default=[], metavar="KEY=VALUE", help="change the run, too")
    parser.add_argument("--json", type=Path, metavar="FILE", help="keep all figures")
    parser.add_argument("--against", type=Path, metavar="FILE", help="compare with figures that were kept")
    asked = parser.parse_args()
    before = json.loads(asked.against.read_text()) if asked.against else {}
    try:
        with tempfile.TemporaryDirectory() as folder:
            runs = runs_of(asked.courses, asked, Path(folder))
            shares = {one: shares_of(one, asked, Path(folder)) for one in asked.courses if asked.shares}
    except Uncertified as error:
        print(error, file=sys.stderr)
        return 1
    found = {name: median(several) for name, several in runs.items()}
    print(f"{asked.threads} threads, search {asked.search}, mesh check {asked.mesh_check}, {asked.repeats} runs each\n")
    print_rows([HEADLINES, *(headline(name, run) for name, run in found.items())])
    if asked.beside:
        print_rows(ratio_rows(runs))
    for name, run in found.items():
        print(f"**{name}**\n")
        print_rows(stage_rows(run))
        if name in before:
            print("and before\n")
            print_rows(compared_rows(run, before[name]))
    for course, told in shares.items():
        print(f"**{Path(course).stem}, shares of the time**\n")
        print_rows(share_rows(told))
    if asked.json:
        asked.json.write_text(json.dumps({name: asdict(run) for name, run in found.items()}, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
