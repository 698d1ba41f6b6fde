"""How long a warm session takes for a changed number: the median of many changes of a gate and of the wind.

    python scripts/benchmark_session.py [COURSE] [--changes 50] [--sweep 1000]

The run is flown first, to six degrees of freedom. Then gates are moved by 5 m in turn, or the wind is turned and
changed by up to 3 kt; each is solved from the run's optimum. Solved means measured in all but mesh convergence; the
check that certifies is timed by itself. Nothing else should run on the machine meanwhile.
"""

import argparse
import math
import statistics
import sys
import time

import airrace


def changes(run: airrace.Run, number: int) -> list[dict[str, float]]:
    """Return changes in turn: a gate by 5 m towards one of eight directions, or the wind by up to 3 kt."""
    gates = sorted({passage.element.name: passage.element for passage in run.race.course.passages}.items())
    found: list[dict[str, float]] = []
    for count in range(number):
        name, element = gates[count // 2 % len(gates)]
        angle = math.tau * (count % 8) / 8
        if count % 2 or element.place is None:
            found.append({"environment.wind.speed_kt": 1 + count % 3, "environment.wind.from_deg": 45 * (count % 8)})
        else:
            north, east = element.place[0] + 5 * math.cos(angle), element.place[1] + 5 * math.sin(angle)
            found.append({f"gates.{name}.north_m": north, f"gates.{name}.east_m": east})
    return found


def main() -> int:
    """Measure, print a line per stage, and return 1 if an answer is not solved."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("course", nargs="?", default="rovinj_2014")
    parser.add_argument("--changes", type=int, default=50)
    parser.add_argument("--sweep", type=int, default=1000)
    chosen = parser.parse_args()
    wind = {"environment.wind.speed_kt": 1, "environment.wind.from_deg": 0}
    run, unsolved = airrace.optimize(chosen.course, set=wind), 0
    for stage in ("point-mass", "six-dof"):
        with airrace.Session(run, stage) as session:
            seconds = list[float]()
            for change in changes(run, chosen.changes):
                begun = time.perf_counter()
                answer = session.solve(change)
                seconds.append(time.perf_counter() - begun)
                unsolved += answer.status != "solved"
            begun = time.perf_counter()
            session.certify(answer).result()
            checked = time.perf_counter() - begun
        worst, median = max(seconds), statistics.median(seconds)
        print(f"{stage}: median {median:.3f} s, at most {worst:.3f} s; mesh check {checked:.2f} s", flush=True)
    if chosen.sweep:
        last = 8 + 2 * (chosen.sweep - 1) / chosen.sweep
        begun = time.perf_counter()
        found = airrace.sweep(run, {"rules.n_z_max": f"8:{last}:{2 / chosen.sweep}"})
        unsolved += len(found.points) - found.solved
        print(f"sweep of {len(found.points)}: {time.perf_counter() - begun:.0f} s")
    print(f"not solved: {unsolved}")
    return int(unsolved > 0)


if __name__ == "__main__":
    sys.exit(main())
