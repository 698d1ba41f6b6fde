"""Changed courses flown from a stored run, held against the same from scratch: time taken, and race time.

    python scripts/experiments/what_ifs.py [COURSE...] [--changes 10] [--until six-dof] [--folder DIR] [--fresh what-if]

A change is drawn by its number and the course's name, from the table `KINDS`. Both sides run on one thread; counted are
the seconds of processor time of this process and its solvers, and the work: iterations times intervals. With a folder
runs and rows are kept in it; `--fresh` says which of `base`, `scratch` and `what-if` are flown again.
"""

import argparse
import json
import logging
import math
import random
import resource
import statistics
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import airrace
from airrace.files.inputs import load_inputs
from airrace.optimal_control.solvers.service import SolverService
from airrace.optimal_control.solvers.solver import ProgramSolution

COURSES = ("rovinj_2014", "half_cuban_eight", "abu_dhabi_2016", "chiba_2015", "san_diego_2017", "gdynia_2014")
Change = dict[str, float]


def moved_gate(rng: random.Random, course: str) -> Change:
    elements = {one.element.name: one.element.place for one in load_inputs(course).race.course.passages}
    name, (north, east) = rng.choice([(name, place) for name, place in sorted(elements.items()) if place is not None])
    distance, direction = rng.uniform(5.0, 30.0), rng.uniform(0.0, math.tau)
    return {
        f"gates.{name}.north_m": round(north + distance * math.cos(direction), 1),
        f"gates.{name}.east_m": round(east + distance * math.sin(direction), 1),
    }


KINDS: dict[str, Callable[[random.Random, str], Change]] = {
    "gate moved": moved_gate,
    "load factor": lambda rng, _: {"rules.n_z_max": round(rng.uniform(8.5, 11.5), 2)},
    "mass": lambda rng, _: {"aircraft.airframe.mass_kg": 698.0 + rng.choice((-20.0, 20.0))},
    "wind": lambda rng, _: {
        "environment.wind.speed_kt": round(rng.uniform(3.0, 12.0), 1),
        "environment.wind.from_deg": float(rng.randrange(0, 360, 10)),
    },
    "width": lambda rng, _: {"gate_defaults.width_m": round(rng.uniform(11.0, 15.0), 1)},
    "floor": lambda rng, _: {"rules.floor_m": round(rng.uniform(6.0, 14.0), 1)},
    "start speed": lambda rng, _: {"rules.start_speed_max_kt": round(rng.uniform(180.0, 205.0), 1)},
}


class Counted:
    """What a block takes: s of processor time, iterations times intervals."""

    solve = SolverService.solve

    def __enter__(self) -> "Counted":
        self.work, self._before = 0, self._seconds()

        def solve(service: SolverService, problem: Any, *arguments: Any, **options: Any) -> ProgramSolution:
            solution = Counted.solve(service, problem, *arguments, **options)
            self.work += solution.iterations * problem.intervals
            return solution

        SolverService.solve = solve  # type: ignore[method-assign]
        return self

    def __exit__(self, *_: object) -> None:
        SolverService.solve = Counted.solve  # type: ignore[method-assign]
        self.seconds = self._seconds() - self._before

    @staticmethod
    def _seconds() -> float:
        used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        return sum(one.ru_utime + one.ru_stime for one in used)


def fly(course: str, until: str, changes: Change, start: "airrace.Run | None") -> dict[str, Any]:
    with Counted() as counted:
        try:
            if start is None:
                run = airrace.optimize(course, set=changes, until=until, threads=1)
            else:
                run = airrace.resume(start, set=changes, until=until, threads=1)
        except airrace.InputError as error:
            return {"refused": str(error)}
    last = run.results[-1]
    return {
        "race_time": run.race_time if run.certified else math.nan,
        "stage": last.stage.value,
        "seconds": round(counted.seconds, 2),
        "work": counted.work,
        "remarks": run.results[0].remarks,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("courses", nargs="*", default=COURSES)
    parser.add_argument("--changes", type=int, default=10)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--until", default="six-dof")
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--fresh", action="append", default=[], choices=("base", "scratch", "what-if"))
    arguments = parser.parse_args()
    logging.disable(logging.WARNING)
    folder, until, rows = arguments.folder, arguments.until, list[tuple[float, float, float]]()
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    airrace.optimize("half_cuban_eight", until=until, threads=1)  # what is loaded once is not counted
    print("| course | change | scratch s | what-if s | time | work | difference ms | |\n|---|---|---|---|---|---|---|---|")
    for course in arguments.courses:
        stored = folder and folder / f"{course}_{until}.h5"
        if stored and stored.exists() and "base" not in arguments.fresh:
            base = airrace.open(stored)
        else:
            base = airrace.optimize(course, until=until, threads=1, output=stored, force=True)
        for number in range(arguments.first, arguments.changes):
            rng = random.Random(f"{course} {number}")
            kinds = list(KINDS)
            kind = kinds[number % len(kinds)]
            changes = KINDS[kind](rng, course)
            flown: dict[str, dict[str, Any]] = {}
            for side, start in (("scratch", None), ("what-if", base)):
                kept = folder and folder / f"{course}_{until}_{number}_{side}.json"
                if kept and kept.exists() and side not in arguments.fresh:
                    flown[side] = json.loads(kept.read_text())
                else:
                    flown[side] = fly(course, until, changes, start)
                    if kept:
                        kept.write_text(json.dumps(flown[side]))
            scratch, changed = flown["scratch"], flown["what-if"]
            told = ", ".join(f"{key.split('.', 1)[1]} {value:g}" for key, value in changes.items())
            if "refused" in scratch or "refused" in changed:
                print(f"| {course} | {told} | | | | | | {scratch.get('refused', '')[:80]} |", flush=True)
                continue
            ratio, work = changed["seconds"] / scratch["seconds"], changed["work"] / scratch["work"]
            difference = 1e3 * (changed["race_time"] - scratch["race_time"])
            rows.append((ratio, work, difference))
            print(
                f"| {course} | {told} | {scratch['seconds']:.2f} | {changed['seconds']:.2f} | {ratio:.2f} | {work:.2f} "
                f"| {difference:+.1f} | {changed['remarks']} |",
                flush=True,
            )
    summarise(rows)


def summarise(rows: Sequence[tuple[float, float, float]]) -> None:
    for name, values in zip(("time", "work"), list(zip(*rows, strict=True))[:2], strict=True):
        print(f"{name}: median {statistics.median(values):.2f}, largest {max(values):.2f} of that from scratch")
    differences = [one[2] for one in rows]
    beyond = sum(not abs(one) <= 3.0 for one in differences)
    print(f"difference: {min(differences):+.1f} to {max(differences):+.1f} ms, {beyond} of {len(rows)} beyond 3 ms")


if __name__ == "__main__":
    main()
