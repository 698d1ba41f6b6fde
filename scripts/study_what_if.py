"""What a changed number costs, from the last optimum and from scratch: race times and seconds, by the real command.

    python scripts/study_what_if.py [--courses rovinj_2014 abu_dhabi_2016] [--until six-dof] [--threads 2]
                                    [--cases NAME ...] [--rounds 3] [--without-scratch]

Flies each course once as it is, then each case in turn with `airrace resume RUN.h5 --set ... --output NEW.h5` and with
`airrace optimize --set ...` from the plan, several times, so that a machine that becomes slower or faster meanwhile
does so for both; medians are told, and all rounds have to end alike. Prints a Markdown table, row by row as it is
finished. Wall seconds are of the whole command with all its loading; processor seconds, of all cores together, tell
how much of them was waiting for other work on the machine. Ends with 1 if a run is not certified, if the start from
the last optimum ends more than 5 ms behind, or if it takes more than a quarter of the wall seconds from scratch; so
nothing else should run meanwhile.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
COMMAND = (sys.executable, "-P", "-m", "airrace")
CLOSE = 0.005  # s, by which the start from the last optimum may be behind
SHARE = 0.25  # of the wall seconds from scratch
MOVED = {"rovinj_2014": "gates.g5.north_m=719.0", "abu_dhabi_2016": "gates.g5.north_m=-423.2"}
"""A gate moved 10 m north, by course."""

CASES = {
    "5 kt from the north": ("environment.wind.from_deg=0", "environment.wind.speed_kt=5"),
    "5 kt from the south": ("environment.wind.from_deg=180", "environment.wind.speed_kt=5"),
    "n_z +0.5 g": ("rules.n_z_max=10.5",),
    "n_z -0.5 g": ("rules.n_z_max=9.5",),
    "gate 10 m north": (),
    "20 kg more": ("aircraft.airframe.mass_kg=718",),
}


@dataclass(frozen=True)
class Flown:
    """One command: `wall` and `processor` seconds with all its loading, and the object it printed."""

    wall: float
    processor: float
    answer: dict[str, Any]  # Any: as read from JSON

    @property
    def race(self) -> float | None:
        """Race time of the last stage, s."""
        return self.answer["race_time_s"]

    @property
    def start(self) -> str:
        """What the first stage was started from, or the remark on why it was not."""
        first = self.answer["stages"][0]
        return first["message"] or first["started_from"] or "scratch"


def fly(*arguments: str) -> Flown:
    """Run one command to its end."""
    began, command = time.perf_counter(), [*COMMAND, *arguments, "--json", "--quiet"]
    environment = {**os.environ}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # an installed package has its modules compiled
    running = subprocess.Popen(command, stdout=subprocess.PIPE, cwd=ROOT, text=True, env=environment)
    assert running.stdout is not None  # it is a pipe
    said = running.stdout.read()
    _, _, used = os.wait4(running.pid, 0)
    return Flown(time.perf_counter() - began, used.ru_utime + used.ru_stime, json.loads(said))


def median(runs: Sequence[Flown]) -> Flown:
    """Return a run that was made several times, with the medians of its seconds."""
    answers = {(one.race, bool(one.answer["certified"])) for one in runs}
    assert len(answers) == 1, f"the same run ended differently: {answers}"
    wall, processor = (statistics.median(getattr(one, kind) for one in runs) for kind in ("wall", "processor"))
    return Flown(wall, processor, runs[0].answer)


def shown(seconds: float | None, form: str = ".3f") -> str:
    return "-" if seconds is None else format(seconds, form)


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--courses", nargs="+", default=list(MOVED), choices=list(MOVED))
    options.add_argument("--until", default="six-dof")
    options.add_argument("--threads", type=int, default=2)
    options.add_argument("--cases", nargs="+", default=list(CASES), choices=list(CASES))
    options.add_argument("--rounds", type=int, default=3, help="how often each run is made; medians are told")
    options.add_argument("--without-scratch", action="store_true", help="only the starts from the last optimum")
    options.add_argument("--folder", type=Path, help="keep checkpoints here, and use those of the courses")
    asked = options.parse_args()
    common = ("--until", asked.until, "--threads", str(asked.threads))
    seconds = "what-if | scratch | share"
    print(f"| course | change | race time | scratch | diff. | {seconds} | {seconds} | started |")
    print("|---|---|---|---|---|---|---|---|---|---|---|---|")
    print("| | | s | s | ms | wall s | wall s | | proc. s | proc. s | | from |")
    good = True
    with tempfile.TemporaryDirectory() as temporary:
        folder = asked.folder or Path(temporary)
        for course in asked.courses:
            track, run = str(ROOT / "tracks" / f"{course}.yaml"), folder / f"{course}.h5"
            if not run.exists():
                fly("optimize", track, "--guess", "plan", "--output", str(run), *common)
            for case in asked.cases:
                changes = CASES[case] or (MOVED[course],)
                sets = [part for change in changes for part in ("--set", change)]
                new, again = (str(folder / f"{kind}.h5") for kind in ("what_if", "scratch"))
                resumed = ("resume", str(run), *sets, "--output", new, "--force", *common)
                anew = ("optimize", track, "--guess", "plan", *sets, "--output", again, "--force", *common)
                quick, slow = list[Flown](), list[Flown]()
                for _ in range(asked.rounds):
                    quick.append(fly(*resumed))
                    slow += [] if asked.without_scratch else [fly(*anew)]
                good &= report(course, case, median(quick), median(slow) if slow else None)
    return 0 if good else 1


def report(course: str, case: str, quick: Flown, slow: Flown | None) -> bool:
    """Print one row; whether it is as it should be."""
    good = bool(quick.answer["certified"]) and (slow is None or bool(slow.answer["certified"]))
    difference = share = used = race = wall = processor = None
    if slow is not None:
        race, wall, processor = slow.race, slow.wall, slow.processor
        share, used = quick.wall / slow.wall, quick.processor / slow.processor
        if quick.race is not None and race is not None:
            difference = 1000.0 * (quick.race - race)
        good &= difference is not None and difference <= 1000.0 * CLOSE and share <= SHARE
    cells = [
        *(course, case, shown(quick.race), shown(race), shown(difference, "+.2f")),
        *(shown(quick.wall, ".1f"), shown(wall, ".1f"), shown(share, ".2f")),
        *(shown(quick.processor, ".1f"), shown(processor, ".1f"), shown(used, ".2f")),
        quick.start + ("" if good else " **!**"),
    ]
    print(f"| {' | '.join(cells)} |", flush=True)
    return good


if __name__ == "__main__":
    sys.exit(main())
