"""How long the whole ladder takes, from the point mass to six degrees of freedom, measured on the real command.

    python scripts/benchmark_ladder.py [TRACK.yaml] [--repeats 3] [--threads 2]

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
COMMAND = (sys.executable, "-c", "from airrace.cli.main import main; main()")


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


def print_stages(run: Measurement) -> None:
    """One line per stage, one for what lies between them, one for the whole command."""
    print(f"{'stage':<23}{'race s':>8}{'iter.':>7}{'solve s':>9}{'wall s':>8}{'share':>8}")
    stages = run.answer["stages"]
    for stage in stages:
        seconds = f"{stage['solve_s']:>9.2f}{stage['wall_s']:>8.2f}{stage['wall_s'] / run.wall:>8.1%}"
        print(f"{stage['stage']:<23}{stage['race_time_s']:>8.3f}{stage['iterations']:>7}{seconds}")
    rest = run.wall - sum(stage["wall_s"] for stage in stages)
    iterations, solve = (sum(stage[key] for stage in stages) for key in ("iterations", "solve_s"))
    print(f"{'loading and writing':<38}{rest:>17.2f}{rest / run.wall:>8.1%}")
    print(f"{'the whole command':<23}{run.race:>8.3f}{iterations:>7}{solve:>9.2f}{run.wall:>8.2f}{1:>8.1%}")


def main() -> None:
    """Run the benchmark and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("track", type=Path, nargs="?", default=ROOT / "tracks" / "rovinj_2014.yaml")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--threads", type=int, default=2)
    arguments = parser.parse_args()
    measure(arguments.track, arguments.threads)  # fills the cache: kernels are compiled once per model and machine
    runs = sorted((measure(arguments.track, arguments.threads) for _ in range(arguments.repeats)), key=lambda r: r.wall)
    median = runs[len(runs) // 2]
    print(f"{arguments.track.stem}, from the plan, {arguments.threads} threads: median of {len(runs)} runs\n")
    print_stages(median)
    walls = ", ".join(f"{run.wall:.1f}" for run in runs)
    verdict = "less" if median.wall < median.race else "MORE"
    print(f"\ncommand: {walls} s; processors: {median.processor:.1f} s")
    print(f"the median is {median.wall / median.race:.2f} of the race time: {verdict} than the race itself")
    raise SystemExit(0 if median.wall < median.race else 1)


if __name__ == "__main__":
    main()
