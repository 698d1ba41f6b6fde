"""Extreme courses: each is certified, or refused or given up with a reason, in the time that it deserves.

    python scripts/experiments/extremes.py [--count N] [--seed SEED] [--log FILE]

The distribution is the table `KINDS`, all of them alike; a course that fails is a find and no reason to narrow it.
"""

import json
import random
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from robustness import COMMAND, Ran, Record, choice_of, environment, outcome, play_study

from airrace.errors import InputError
from airrace.files.inputs import load_inputs

WAIT = 30.0  # s, which any course may take
TIMES = 1.5  # as many seconds as this times the race time (without one, the planned time) may be taken as well
LONGEST = 900.0  # s, after which nobody waits any more
FLY = ("--until", "point-mass", "--guess", "plan", "--search", "off", "--json")


def course(places: list[tuple[float, float, float]], rules: str = "", rest: str = "", height: str = "") -> str:
    """A course through gates at places: north (m), east (m), heading (deg); a single one is flown twice."""
    gates = "".join(
        f"  g{number}: {{type: level, north_m: {north:.3f}, east_m: {east:.3f}, heading_deg: {heading:.1f}{height}}}\n"
        for number, (north, east, heading) in enumerate(places)
    )
    names = [f"g{number}" for number in range(len(places))]
    return (
        f"schema: airrace/track/1\nname: extreme\naircraft: edge540\nrules: {{n_z_max: 10{rules}}}\n{rest}"
        f"gates:\n{gates}course: {{start: {names[0]}, lap: [{', '.join(names[1:] or names)}]}}\n"
    )


def row(count: int, spacing: float) -> list[tuple[float, float, float]]:
    return [(spacing * number, 0.0, 0.0) for number in range(count)]


def climbs(rng: random.Random) -> str:
    text = course(row(3, rng.uniform(100.0, 1500.0)))
    return text.replace("north_m: 0.000,", "north_m: 0.000, height_m: 20,", 1).replace(
        "g2: {type: level,", "g2: {type: level, height_m: 920,"
    )


def wind(rng: random.Random) -> str:
    speed, direction = rng.choice((60, 80, 100, 250)), rng.uniform(0, 359)
    told = f"environment: {{wind: {{speed_kt: {speed}, from_deg: {direction:.0f}}}}}\n"
    return course(row(4, 300.0), rest=told)


KINDS: dict[str, Callable[[random.Random], str | tuple[str, str, float]]] = {
    "gates at one place": lambda rng: course(
        [*row(2, 300.0), (300.0, 0.0, rng.uniform(0.0, 359.0)), (600.0, 0.0, 0.0)]
    ),
    "gates 5 cm apart": lambda rng: course([*row(2, 300.0), (300.05, 0.0, 0.0), (600.0, 0.0, 0.0)]),
    "gates 1 m apart": lambda rng: course([*row(2, 300.0), (301.0, 0.0, rng.choice((0.0, 5.0))), (600.0, 0.0, 0.0)]),
    "floor and ceiling alike": lambda rng: course(
        row(4, 300.0), f", floor_m: 20, ceiling_m: {rng.choice((20, 20.1, 21))}"
    ),
    "a climb of 900 m": climbs,
    "little mass": lambda rng: ("aircraft.airframe.mass_kg", course(row(4, 300.0)), rng.choice((0.001, 1.0, 50.0))),
    "much mass": lambda rng: ("aircraft.airframe.mass_kg", course(row(4, 300.0)), rng.choice((3e3, 1e5, 1e9))),
    "little power": lambda rng: (
        "aircraft.propulsion.power_max_kW",
        course(row(4, 300.0)),
        rng.choice((1e-6, 1.0, 20.0)),
    ),
    "much power": lambda rng: ("aircraft.propulsion.power_max_kW", course(row(4, 300.0)), rng.choice((1e3, 1e5, 1e9))),
    "absurd wind": wind,
    "one gate": lambda rng: course(row(1, 0.0)),
    "two gates": lambda rng: course(row(2, rng.choice((1.0, 50.0, 20_000.0)))),
    "200 gates": lambda rng: course([(200.0 * number, rng.uniform(-20.0, 20.0), 0.0) for number in range(200)]),
    "a turn on the spot": lambda rng: course([(0, 0, 0), (rng.uniform(1.0, 60.0), 0.0, 180.0), (0, 400, 180)]),
}


def trial(rng: random.Random, number: int) -> Record:
    kind, drawn = choice_of(rng, KINDS)
    told = drawn(rng)
    key, text, value = ("", told, 0.0) if isinstance(told, str) else told
    with tempfile.TemporaryDirectory() as name:
        file = Path(name) / "a.yaml"
        file.write_text(text, encoding="utf-8")
        changed = ("--set", f"{key}={value:g}") if key else ()
        planned = planned_time(file, changed[1:])
        began, worked = time.monotonic(), processor_time()
        ended = subprocess.run(
            [*COMMAND, "optimize", "a.yaml", *FLY, *changed],
            cwd=name,
            env=environment(),
            capture_output=True,
            text=True,
            timeout=LONGEST,
            check=False,
        )
        ran = Ran(ended.returncode, ended.stdout, ended.stderr, time.monotonic() - began)
        worked = processor_time() - worked
    race_time = race_time_of(ran.out)
    faults = ran.faults(max(WAIT, TIMES * (race_time or planned)))
    if ran.code not in (0, 3, 4, 5):
        faults.append(f"ends with code {ran.code}: {ran.err.strip()[-160:]}")
    if ran.code != 0 and "airrace: " not in ran.err:
        faults.append("gives no reason")
    reason = "; ".join(line for line in ran.err.splitlines() if line and not line.startswith("[")) if ran.code else ""
    record: Record = {"kind": kind, "outcome": outcome(ran.code), "seconds": ran.seconds, "faults": faults}
    return {
        **record,
        "processor": worked,
        "race_time": race_time,
        "planned": planned,
        "changed": [*changed],
        "reason": reason[:600],
    }


def processor_time() -> float:
    """The processor time of all processes that were begun here and have ended, s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def planned_time(track: Path, overrides: Sequence[str]) -> float:
    """The planned time of a race, s; 0 if it is refused."""
    try:
        return plan_race(load_inputs(track, overrides=overrides).race).seconds
    except InputError:
        return 0.0


def race_time_of(out: str) -> float:
    """The race time in an answer, s; 0 without one."""
    try:
        return float(json.loads(out).get("race_time_s") or 0.0)
    except ValueError:
        return 0.0


if __name__ == "__main__":
    sys.exit(play_study(__doc__ or "", 60, trial))
