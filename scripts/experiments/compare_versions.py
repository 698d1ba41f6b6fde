"""Fly courses with two versions of airrace in turn, and print what each costs and finds.

    python scripts/experiments/compare_versions.py BEFORE AFTER [COURSE ...] [--seeds 0-39] [--repeats 1]
        [--log FILE] [-- OPTION ...]

BEFORE and AFTER are the `airrace` commands of two environments; courses are track files and, by their seeds, those of
`random_courses.py`. Each course is flown by the default command with both, one after the other, `--repeats` times; what
follows `--` are further options. A row tells of a course: outcome and race time of both, iterations of all stages, and
the ratios of processor seconds and of seconds by the clock (medians). The last lines sum it up. The log has a JSON line
per course. Only a machine that does nothing else tells seconds.
"""

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from random_courses import random_course

MANY = 120
"""The number of iterations that no stage should exceed."""
SAME = 1e-3
"""The difference of two race times that counts as none, s."""
Record = dict[str, Any]  # Any: JSON


def fly(command: str, track: Path, options: Sequence[str]) -> Record:
    """Fly a course with a version and return its answer, and the seconds that it took."""
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run.h5"
        before, started = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        ended = subprocess.run(
            [command, "optimize", str(track), "-o", str(run), "--quiet", *options],
            capture_output=True,
            text=True,
            check=False,
            env={**os.environ, "OMP_NUM_THREADS": "1"},
        )
        wall, after = time.perf_counter() - started, resource.getrusage(resource.RUSAGE_CHILDREN)
        shown = subprocess.run([command, "show", str(run), "--json"], capture_output=True, text=True, check=False)
        answer: Record = json.loads(shown.stdout) if shown.stdout.startswith("{") else {"stages": []}
    stages = answer["stages"]
    return {
        "code": ended.returncode,
        "race_time_s": stages[-1]["race_time_s"] if ended.returncode == 0 else None,
        "message": stages[-1]["message"] if stages else ended.stderr.strip()[-200:],
        "iterations": {stage["stage"]: stage["iterations"] for stage in stages},
        "wall_s": wall,
        "processor_s": after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime,
    }


def compare(commands: Sequence[str], track: Path, repeats: int, options: Sequence[str]) -> list[Record]:
    """Fly a course with both versions in turn; return a record of each, with medians of seconds."""
    flights: list[list[Record]] = [[], []]
    for _ in range(repeats):
        for version, command in enumerate(commands):
            flights[version].append(fly(command, track, options))
    medians = [
        {key: statistics.median(flight[key] for flight in version) for key in ("wall_s", "processor_s")}
        for version in flights
    ]
    return [{**version[0], **seconds} for version, seconds in zip(flights, medians, strict=True)]


def row(name: str, before: Record, after: Record) -> str:
    """Return the line of a course."""
    times = ["no flight" if one["race_time_s"] is None else f"{one['race_time_s']:.3f}" for one in (before, after)]
    iterations = [sum(one["iterations"].values()) for one in (before, after)]
    ratios = [after[key] / before[key] for key in ("processor_s", "wall_s")]
    return (
        f"{name:24} {before['code']} {after['code']}  {times[0]:>10} {times[1]:>10}  "
        f"{iterations[0]:5} {iterations[1]:5}  {ratios[0]:5.2f} {ratios[1]:5.2f}"
    )


def summary(records: Sequence[list[Record]]) -> list[str]:
    """Return what all courses say together."""
    lines: list[str] = []
    for name, version in (("before", 0), ("after", 1)):
        stages = [count for pair in records for count in pair[version]["iterations"].values()]
        lines.append(
            f"{name}: {sum(pair[version]['code'] == 0 for pair in records)} of {len(records)} certified; iterations "
            f"of a stage: median {statistics.median(stages):.0f}, {sum(count > MANY for count in stages)} of "
            f"{len(stages)} above {MANY}, most {max(stages)}"
        )
    both = [pair for pair in records if pair[0]["race_time_s"] and pair[1]["race_time_s"]]
    changes = [pair[1]["race_time_s"] - pair[0]["race_time_s"] for pair in both]
    lines.append(
        f"race times: {sum(change < -SAME for change in changes)} faster, {sum(change > SAME for change in changes)} "
        f"slower, of {len(changes)}; from {min(changes, default=0.0):+.3f} to {max(changes, default=0.0):+.3f} s"
    )
    for key in ("processor_s", "wall_s"):
        ratios = [pair[1][key] / pair[0][key] for pair in records]
        lines.append(f"{key}: ratio {statistics.median(ratios):.2f} (median), {max(ratios):.2f} (worst)")
    return lines


def main() -> None:
    """Compare two versions as the command line says."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before")
    parser.add_argument("after")
    parser.add_argument("courses", nargs="*", type=Path)
    parser.add_argument("--seeds", default="", help="such as 0-39 or 3,7")
    parser.add_argument("--repeats", type=int, default=1)
    parser.add_argument("--log", type=Path)
    own, options = sys.argv[1:], list[str]()
    if "--" in own:
        own, options = own[: own.index("--")], own[own.index("--") + 1 :]
    asked = parser.parse_args(own)
    records: list[list[Record]] = []
    configs = Path(__file__).resolve().parents[2] / "configs"
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "configs").symlink_to(configs)
        tracks = Path(folder) / "tracks"
        tracks.mkdir()
        courses = [(course.stem, course) for course in asked.courses]
        for part in filter(None, asked.seeds.split(",")):
            first, _, last = part.partition("-")
            for seed in range(int(first), int(last or first) + 1):
                track = tracks / f"seed{seed}.yaml"
                track.write_text(random_course(seed), encoding="utf-8")
                courses.append((f"seed {seed}", track))
        print(f"{'course':24} exit  race time, s          iterations   processor, clock (after / before)")
        for name, track in courses:
            pair = compare((asked.before, asked.after), track, asked.repeats, options)
            records.append(pair)
            print(row(name, *pair), flush=True)
            if asked.log:
                with asked.log.open("a", encoding="utf-8") as log:
                    log.write(json.dumps({"course": name, "before": pair[0], "after": pair[1]}) + "\n")
    print("\n".join(summary(records)))


if __name__ == "__main__":
    main()
