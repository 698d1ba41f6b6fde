"""How long the point-mass optimum takes, measured on the real command, side by side in one run.

    python scripts/benchmark_point_mass.py [--repeats 5] [--tracks tracks/rovinj_2014.yaml ...] [--laps 1 2 4 8 16]
        [--search off] [--markdown]

For every track and both guesses: the median wall time of `airrace optimize` as a share of the race time, the shares of
derivatives, solver and everything else, the peak memory of all processes. Last, the wall time over the number of laps
and the exponent of its growth. Other routes are not explored, unless `--search` asks for it.
"""

import argparse
import json
import math
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TRACKS = ("rovinj_2014", "sixteen_phases", "half_cuban_eight")
COMMAND = (sys.executable, "-P", "-m", "airrace")
GOALS = {"plan": 1 / 20, "homotopy": 1 / 10}


@dataclass(frozen=True)
class Measurement:
    """One run of the command.

    Seconds: `wall` of the whole command with all its loading, `run` of what the command reports (from inputs read to
    the checkpoint written), `solve` inside the solver, `derivatives` of that in functions. `memory` is the peak in MB.
    """

    race: float
    wall: float
    run: float
    solve: float
    derivatives: float
    memory: float
    iterations: int


def measure(track: Path, guess: str, *, search: str, overrides: tuple[str, ...] = ()) -> Measurement:
    """Run `airrace optimize` once in a temporary folder."""
    with tempfile.TemporaryDirectory() as folder:
        command = [*COMMAND, "optimize", str(track), "--guess", guess, "--json", "--quiet"]
        command += ["--until", "point-mass", "--search", search, "--output", f"{folder}/run.h5"]
        command += [part for one in overrides for part in ("--set", one)]
        started = time.perf_counter()
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        peak = PeakMemory(process.pid)
        output, errors = process.communicate()
        wall = time.perf_counter() - started
        memory = peak.stop()
    if process.returncode:
        raise SystemExit(f"{' '.join(command)}\nended with {process.returncode}:\n{errors.decode()}{output.decode()}")
    answer = json.loads(output)
    stages = answer["stages"]
    return Measurement(
        race=answer["race_time_s"],
        wall=wall,
        run=answer["wall_s"],
        solve=sum(stage["solve_s"] for stage in stages),
        derivatives=sum(stage["derivatives_s"] for stage in stages),
        memory=memory,
        iterations=sum(stage["iterations"] for stage in stages),
    )


class PeakMemory:
    """Watches the resident memory of a process and its children (Linux; NaN elsewhere)."""

    def __init__(self, pid: int) -> None:
        self._pid = pid
        self._peak = math.nan
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()

    def stop(self) -> float:
        """The largest sum seen, MB."""
        self._done.set()
        self._thread.join()
        return self._peak

    def _watch(self) -> None:
        while not self._done.wait(0.05):
            total = sum(resident(pid) for pid in (self._pid, *children(self._pid)))
            if total and not self._peak >= total:
                self._peak = total


def children(pid: int) -> list[int]:
    """Direct children of a process."""
    try:
        text = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    except OSError:
        return []
    return [int(child) for child in text.split()]


def resident(pid: int) -> float:
    """Resident memory of a process, pages shared with others counted in part (PSS), MB; 0 where unknown."""
    try:
        lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    except OSError:
        return 0.0
    return sum(int(line.split()[1]) / 1024 for line in lines if line.startswith("Pss:"))


Fly = Callable[..., Measurement]
"""`measure`, with or without exploring."""


def measured(fly: Fly, tracks: list[Path], repeats: int) -> Iterator[tuple[Path, str, Measurement]]:
    """The median of several runs per track and guess; its memory is a median by itself."""
    for track in tracks:
        for guess in GOALS:
            runs = sorted((fly(track, guess) for _ in range(repeats)), key=lambda run: run.wall)
            memory = statistics.median(run.memory for run in runs)
            yield track, guess, replace(runs[len(runs) // 2], memory=memory)


def warm_table(fly: Fly, tracks: list[Path], repeats: int) -> None:
    """What was measured, with goals and all parts."""
    print(
        f"{'track':<18}{'guess':<10}{'race s':>8}{'run s':>7}{'share':>8}{'command s':>11}{'share':>8}{'goal':>7}",
        end="",
    )
    print(f"{'deriv.':>8}{'solver':>8}{'other':>7}{'MB':>6}{'iter.':>7}")
    for track, guess, median in measured(fly, tracks, repeats):
        print(f"{track.stem:<18}{guess:<10}{median.race:>8.3f}{median.run:>7.2f}", end="")
        print(f"{fraction(median.run / median.race):>8}{median.wall:>11.2f}", end="")
        print(f"{fraction(median.wall / median.race):>8}{fraction(GOALS[guess]):>7}", end="")
        print(f"{median.derivatives:>8.2f}{median.solve - median.derivatives:>8.2f}", end="")
        print(f"{median.run - median.solve:>7.2f}{median.memory:>6.0f}{median.iterations:>7}", flush=True)


def warm_markdown(fly: Fly, tracks: list[Path], repeats: int) -> None:
    """What was measured, as the documents show it."""
    headings = (
        "course",
        "guess",
        "race time s",
        "run s",
        "command s",
        "race time / command",
        "derivatives s",
        "solver s",
        "memory MB",
    )
    print("| " + " | ".join(headings) + " |")
    print("| " + " | ".join(("---",) * len(headings)) + " |")
    for track, guess, median in measured(fly, tracks, repeats):
        seconds = (median.run, median.wall, median.derivatives, median.solve - median.derivatives)
        run, wall, derivatives, solver = (f"{one:.2f}" for one in seconds)
        cells = (f"`{track.stem}`", guess, f"{median.race:.3f}", run, wall, f"{median.race / median.wall:.0f}")
        print("| " + " | ".join((*cells, derivatives, solver, f"{median.memory:.0f}")) + " |", flush=True)


def fraction(share: float) -> str:
    """A share as one over a number."""
    return f"1/{1 / share:.1f}"


def laps_table(fly: Fly, track: Path, laps: list[int]) -> None:
    """Wall time over the number of laps, and the exponent between the fewest and the most."""
    for guess in GOALS:
        walls: list[float] = []
        print(f"\nlaps of {track.stem}, {guess}")
        for count in laps:
            run = fly(track, guess, overrides=(f"course.laps={count}",))
            walls.append(run.wall)
            print(
                f"  {count:>3} laps: wall {run.wall:>7.2f} s, race {run.race:>8.2f} s, {run.memory:>5.0f} MB",
                flush=True,
            )
        if len(laps) > 1:
            exponent = math.log(walls[-1] / walls[0]) / math.log(laps[-1] / laps[0])
            print(f"  wall time grows with the power {exponent:.2f} of the laps")


def main() -> None:
    """Run the benchmark and print its tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--tracks", type=Path, nargs="+", default=[ROOT / "tracks" / f"{name}.yaml" for name in TRACKS])
    parser.add_argument("--laps", type=int, nargs="*", default=[1, 2, 4, 8, 16])
    parser.add_argument("--markdown", action="store_true", help="the first table as Markdown")
    parser.add_argument("--search", choices=("off", "quick", "thorough"), default="off")
    arguments = parser.parse_args()
    fly = partial(measure, search=arguments.search)
    (warm_markdown if arguments.markdown else warm_table)(fly, arguments.tracks, arguments.repeats)
    if arguments.laps:
        laps_table(fly, ROOT / "tracks" / "sixteen_phases.yaml", arguments.laps)


if __name__ == "__main__":
    main()
