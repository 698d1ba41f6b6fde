"""How many iterations the stages take on courses that nobody tuned on: random ones by their seeds, or track files.

    python scripts/experiments/iterations.py [COURSE ...] [--seeds 0-199] [--log FILE] [--report] [-- OPTION ...]

Each course is flown by `airrace optimize --guess plan` through all five stages, one thread, in a process of its own;
what follows `--` are further options of that command. The log has a JSON line per course, and what is in it is not
flown again; `--report` only prints the tables of a log. Counted are all meshes of a stage and all its solver calls,
those of alternatives and of failed attempts included, but not the search's. Seconds are those of the processor.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from random_courses import random_course
from robustness import COMMAND, environment, outcome

import airrace
from airrace.errors import AirraceError

ROOT = Path(__file__).resolve().parents[2]
MANY = 120
"""The number of iterations that no stage should exceed."""
Record = dict[str, Any]  # Any: JSON


def fly(name: str, track: Path, folder: Path, options: Sequence[str]) -> Record:
    """Fly a course and return what came of it."""
    run = folder / "run.h5"
    run.unlink(missing_ok=True)
    command = [*COMMAND, "optimize", str(track), "--guess", "plan", "--threads", "1", "--quiet", "--json"]
    started = time.perf_counter()
    with subprocess.Popen(
        [*command, "--output", str(run), *options], stdout=subprocess.PIPE, text=True, env=environment()
    ) as running:
        assert running.stdout is not None  # it is a pipe
        printed = json.loads(running.stdout.read() or "{}")
        _, status, used = os.wait4(running.pid, 0)
        running.returncode = os.waitstatus_to_exitcode(status)
    stages: list[Record] = []
    for one in printed.get("stages", []):
        kept = {key: one[key] for key in ("stage", "status", "message", "race_time_s", "iterations", "wall_s")}
        kept["search_s"] = one["search"]["seconds"] if one["search"] else 0.0
        kept["intervals"] = one["mesh"]["intervals"] if one["mesh"] else 0
        stages.append(kept | {"attempts": list(_attempts(run, one["stage"]))})
    return {
        "name": name,
        "outcome": outcome(running.returncode),
        "error": printed.get("error", ""),
        "processor_s": used.ru_utime + used.ru_stime,
        "wall_s": time.perf_counter() - started,
        "race_time_s": printed.get("race_time_s"),
        "stages": stages,
    }


def _attempts(run: Path, stage: str) -> Iterator[tuple[str, str, str, int]]:
    """Yield purpose, solver, status and iterations of the solver calls of a stage."""
    try:
        for one in airrace.open(run)[stage].result.attempts:
            yield one.purpose, one.solver, one.status, one.iterations
    except (AirraceError, KeyError):
        return


def report(records: Sequence[Record]) -> None:
    """Print distributions of iterations and processor time, stages beyond `MANY`, and what was not certified."""
    counts: dict[str, list[int]] = {}
    for record in records:
        for one in record["stages"]:
            counts.setdefault(one["stage"], []).append(one["iterations"])
    print(f"| stage | flown | median | 90 % | worst | more than {MANY} |\n|---|---:|---:|---:|---:|---:|")
    for stage, found in counts.items():
        tenth = sorted(found)[min(len(found) - 1, int(0.9 * len(found)))]
        many = sum(one > MANY for one in found)
        print(f"| `{stage}` | {len(found)} | {statistics.median(found):.0f} | {tenth} | {max(found)} | {many} |")
    done = [one for one in records if one["outcome"] == "done"]
    ratios = sorted(one["processor_s"] / one["race_time_s"] for one in done)
    if ratios:
        ninth = ratios[min(len(ratios) - 1, int(0.9 * len(ratios)))]
        print(
            f"\ncertified {len(done)} of {len(records)}; processor seconds per second of race: median "
            f"{statistics.median(ratios):.2f}, 90 % {ninth:.2f}, worst {ratios[-1]:.2f}\n"
        )
    for record in records:
        many = [f"{one['stage']} {one['iterations']}" for one in record["stages"] if one["iterations"] > MANY]
        if many:
            print(f"- {record['name']}: {', '.join(many)}")
        if record["outcome"] != "done":
            told = next((one["message"] for one in record["stages"][::-1] if one["message"]), record["error"])
            seconds = f"{record['processor_s']:.0f} s"
            last = record["stages"][-1]["stage"] if record["stages"] else "nothing flown"
            print(f"- {record['name']}: {record['outcome']}, {last}, {seconds}: {told}")


def main() -> None:
    """Fly what is asked for and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("courses", nargs="*", metavar="COURSE")
    parser.add_argument("--seeds", default="", metavar="FIRST-LAST")
    parser.add_argument("--log", type=Path)
    parser.add_argument("--report", action="store_true")
    given, options = sys.argv[1:], list[str]()
    if "--" in given:
        given, options = given[: given.index("--")], given[given.index("--") + 1 :]
    asked = parser.parse_args(given)
    log: Path | None = asked.log
    lines = log.read_text(encoding="utf-8").splitlines() if log and log.exists() else []
    records: dict[str, Record] = {one["name"]: one for one in map(json.loads, lines)}
    first, _, last = asked.seeds.partition("-")
    seeds = range(int(first), int(last or first) + 1) if first and not asked.report else range(0)
    with tempfile.TemporaryDirectory() as folder:
        tracks = {Path(one).stem: Path(one) for one in ([] if asked.report else asked.courses)}
        for seed in seeds:
            tracks[str(seed)] = Path(folder) / f"{seed}.yaml"
            tracks[str(seed)].write_text(random_course(seed, str(ROOT / "configs")), encoding="utf-8")
        for name, track in tracks.items():
            if name in records:
                continue
            records[name] = fly(name, track, Path(folder), options)
            if log:
                with log.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(records[name]) + "\n")
            print(name, records[name]["outcome"], *(one["iterations"] for one in records[name]["stages"]), flush=True)
    report(list(records.values()))


if __name__ == "__main__":
    main()
