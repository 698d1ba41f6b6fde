"""How long the whole ladder takes, from the point mass to six degrees of freedom, measured on the real command.

    python scripts/benchmark_ladder.py [TRACK.yaml] [--repeats 3] [--threads 2] [--markdown]

Runs `airrace optimize` from the plan with a warm kernel cache. Of the run with the median wall time it prints, per
stage, race time, iterations and seconds, and what the whole command takes against the race time. Processor seconds, of
all cores together, tell how much of the wall time was waiting for other work on the machine. Ends with 1 if a run is
not certified or the command takes longer than the race.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
COMMAND = (sys.executable, "-m", "airrace")


@dataclass(frozen=True)
class Measurement:
    """One run: `wall` and `processor` seconds of the whole command with all its loading, and the object it printed."""

    wall: float
    processor: float
    answer: dict[str, Any]  # Any: as read from JSON

    @property
    def race(self) -> float:
        """Race time of the last stage, s."""
        return self.answer["race_time_s"]


def measure(track: Path, threads: int) -> Measurement:
    """Run `airrace optimize` once in a temporary folder.

    Raises:
        SystemExit: the run is not certified.
    """
    with tempfile.TemporaryDirectory() as folder:
        options = ["--guess", "plan", "--json", "--quiet", "--threads", str(threads), "--out", f"{folder}/run.h5"]
        command = [*COMMAND, "optimize", str(track), *options]
        before, started = processor_seconds(), time.perf_counter()
        process = subprocess.run(command, capture_output=True, text=True, check=False)
        wall, processor = time.perf_counter() - started, processor_seconds() - before
    if process.returncode:
        ended = f"{' '.join(command)}\nended with {process.returncode}:"
        print(ended, process.stderr, process.stdout, sep="\n", file=sys.stderr)
        raise SystemExit(1)
    return Measurement(wall, processor, json.loads(process.stdout))


def processor_seconds() -> float:
    """Of all processes that this one has started, and those that they have, as far as they have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


Row = tuple[str, ...]


def stage_rows(run: Measurement) -> list[Row]:
    """Headings, one row per stage, one for what lies between them, one for the whole command."""
    rows: list[Row] = [("stage", "race time s", "iterations", "solver s", "stage s", "share")]
    stages = run.answer["stages"]
    for stage in stages:
        seconds = (f"{stage['solve_s']:.1f}", f"{stage['wall_s']:.1f}", share(stage["wall_s"] / run.wall))
        rows.append((f"`{stage['stage']}`", f"{stage['race_time_s']:.3f}", str(stage["iterations"]), *seconds))
    rest = run.wall - sum(stage["wall_s"] for stage in stages)
    iterations, solve = (sum(stage[key] for stage in stages) for key in ("iterations", "solve_s"))
    rows.append(("loading and writing", "", "", "", f"{rest:.1f}", share(rest / run.wall)))
    rows.append(("the whole command", f"{run.race:.3f}", str(iterations), f"{solve:.1f}", f"{run.wall:.1f}", ""))
    return rows


def share(part: float) -> str:
    """A part as per cent."""
    return f"{100.0 * part:.0f} %"


def print_rows(rows: list[Row], *, markdown: bool) -> None:
    """In columns, or as Markdown."""
    if markdown:
        headings, *rest = rows
        for row in (headings, ("---",) * len(headings), *rest):
            print("| " + " | ".join(row) + " |")
        return
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    for first, *others in rows:
        cells = (cell.rjust(width) for cell, width in zip(others, widths[1:], strict=True))
        print("  ".join((first.ljust(widths[0]), *cells)).rstrip())


def main() -> None:
    """Run the benchmark and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("track", type=Path, nargs="?", default=ROOT / "tracks" / "rovinj_2014.yaml")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--markdown", action="store_true", help="the table as Markdown")
    arguments = parser.parse_args()
    measure(arguments.track, arguments.threads)  # fills the cache: kernels are compiled once per model and machine
    runs = sorted((measure(arguments.track, arguments.threads) for _ in range(arguments.repeats)), key=lambda r: r.wall)
    median = runs[len(runs) // 2]
    print(f"{arguments.track.stem}, from the plan, {arguments.threads} threads: median of {len(runs)} runs\n")
    print_rows(stage_rows(median), markdown=arguments.markdown)
    walls = ", ".join(f"{run.wall:.1f}" for run in runs)
    verdict = "less" if median.wall < median.race else "MORE"
    print(f"\ncommand: {walls} s; processors: {median.processor:.1f} s")
    print(f"the median is {median.wall / median.race:.2f} of the race time: {verdict} than the race itself")
    raise SystemExit(0 if median.wall < median.race else 1)


if __name__ == "__main__":
    main()
