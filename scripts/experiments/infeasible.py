"""Infeasible courses: limit and place are named, and flying again with the suggestion ends with a certificate.

    python scripts/experiments/infeasible.py [--count N] [--seed SEED] [--log FILE]

Each course is spoilt by one limit, which is known, as is the place where it hurts. The distribution is the table
`KINDS`, all of them alike.
"""

import json
import random
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robustness import COMMAND, Ran, Record, choice_of, environment, outcome, play_study

FLY = (
    "--until",
    "point-mass",
    "--guess",
    "plan",
    "--search",
    "off",
    "--json",
    "--set",
    "settings.solver.fallback=interior-point",
)
LONGEST = 30.0  # s of processor time
Conflict = dict[str, Any]  # Any: JSON
CALM = 60.0  # m, half the width of the corridor


@dataclass(frozen=True)
class Spoilt:
    """A course with one limit too tight.

    Attributes:
        track: its text, or the name of one that comes along.
        changed: what is set to spoil it.
        keys: of the limit; any of them names it.
        places: elements at which it hurts; a told place that has one of them in it names it.
    """

    track: str
    changed: tuple[str, ...]
    keys: tuple[str, ...]
    places: tuple[str, ...]


def corridor(gates: Sequence[str], rules: str = "", rest: str = "", ceiling: float = 80.0, wide: float = CALM) -> str:
    """A course of named elements northward through a corridor in which nobody can turn around."""
    names = [gate.partition(":")[0].strip() for gate in gates]
    corners = ", ".join(
        f"{{north_m: {north:g}, east_m: {east:g}}}"
        for north, east in ((-200, -wide), (4000, -wide), (4000, wide), (-200, wide))
    )
    lines = "".join(f"  {gate}\n" for gate in gates)
    return (
        f"schema: airrace/track/1\nname: spoilt\naircraft: edge540\n"
        f"rules: {{n_z_max: 10, start_speed_max_kt: 200, ceiling_m: {ceiling:g}{rules}}}\n"
        f"airspace: [{corners}]\n{rest}gates:\n{lines}"
        f"course: {{start: {names[0]}, lap: [{', '.join(names[1:-1])}], finish: {names[-1]}}}\n"
    )


def gate(name: str, north: float, east: float = 0.0, more: str = "") -> str:
    return f"{name}: {{type: level, north_m: {north:g}, east_m: {east:g}, heading_deg: 0{more}}}"


def row(near: str, distance: float) -> list[str]:
    """Three quiet gates, one drawn at a distance (m) behind them, and two more."""
    return [gate("a", 0), gate("b", 250), gate("c", 500), near, gate("e", 750 + distance), gate("f", 1000 + distance)]


def low_ceiling(rng: random.Random) -> Spoilt:
    changed = f"rules.ceiling_m={rng.uniform(95, 170):.0f}"
    return Spoilt("half_cuban_eight", (changed,), ("rules.ceiling_m",), ("entry", "vertical", "down_line"))


def weak_loop(rng: random.Random) -> Spoilt:
    changed = (f"rules.n_z_max={rng.uniform(1.8, 2.3):.1f}", f"rules.ceiling_m={rng.choice((220, 240))}")
    return Spoilt(
        "half_cuban_eight", changed, ("rules.n_z_max",), ("entry", "vertical", "down_line", "upright", "exit")
    )


def slow_start(rng: random.Random) -> Spoilt:
    changed = ("aircraft.propulsion.power_max_kW=57", f"rules.start_speed_max_kt={rng.uniform(69, 77):.0f}")
    return Spoilt(uphill(), changed, ("rules.start_speed_max_kt",), ("b", "c", "d"))


def slow_roll(rng: random.Random) -> Spoilt:
    distance = rng.uniform(50, 80)
    knife = f"d: {{type: knife-edge, north_m: {500 + distance:.1f}, east_m: 0, heading_deg: 0, bank: right}}"
    changed = f"rules.roll_rate_max_deg_s={rng.uniform(12, 25):.0f}"
    return Spoilt(corridor(row(knife, distance)), (changed,), ("rules.roll_rate_max_deg_s",), ("c", "d", "e"))


def strict_bank(rng: random.Random) -> Spoilt:
    """A roll of 80 deg between two gates that 60 m/s and 200 deg/s leave 60 deg for."""
    distance = rng.uniform(12, 15)
    knife = f"d: {{type: knife-edge, north_m: {500 + distance:.1f}, east_m: 0, heading_deg: 0, bank: right}}"
    gates = row(knife, distance)
    gates[2] = gate("c", 500, 0.0, ", bank_tolerance_deg: 30")
    track = corridor(gates, rules=", roll_rate_max_deg_s: 200")
    changed = ("aircraft.envelope.speed_min_m_s=60", f"gates.c.bank_tolerance_deg={rng.uniform(1, 4):.0f}")
    return Spoilt(track, changed, ("gates.c.bank_tolerance_deg",), ("c", "d"))


def high_gate(rng: random.Random) -> Spoilt:
    distance = rng.uniform(36, 45)
    track = corridor(row(gate("d", 500 + distance), distance), ceiling=100)
    low = rng.uniform(75, 85)
    changed = tuple(
        f"gates.d.height{key}_m={value:.0f}" for key, value in (("", low + 5), ("_min", low), ("_max", low + 10))
    )
    return Spoilt(track, changed, ("gates.d.height_min_m",), ("c", "d"))


def flat_climb(rng: random.Random) -> Spoilt:
    distance = rng.uniform(60, 76)
    band = ", height_m: 70, height_min_m: 65, height_max_m: 75, crossing_max_deg: 20"
    between = gate("m", 500 + distance / 2, 0.0, ", height_m: 45, height_min_m: 43, height_max_m: 47")
    gates = row(gate("d", 500 + distance, 0.0, band), distance)
    track = corridor([*gates[:3], between, *gates[3:]], ceiling=120)
    changed = f"gates.m.climb_max_deg={rng.uniform(3, 12):.0f}"
    return Spoilt(track, (changed,), ("gates.m.climb_max_deg",), ("c", "m", "d"))


def wide_berth(rng: random.Random) -> Spoilt:
    pylon = "d: {type: pylon, north_m: 620, east_m: -10, pass_side_deg: 90, reach_m: 150}"
    track = corridor(row(pylon, 120.0), wide=30.0)
    changed = f"gates.d.clearance_m={rng.uniform(42, 50):.0f}"
    return Spoilt(track, (changed,), ("gates.d.clearance_m",), ("c", "d", "e"))


def near_line(rng: random.Random) -> Spoilt:
    """Around a turning point by the shore, with a line that leaves too little room for the turn."""
    room = rng.uniform(120, 160)
    text = (
        "schema: airrace/track/1\nname: spoilt\naircraft: edge540\nrules: {n_z_max: 4, ceiling_m: 40}\n"
        f"safety_lines:\n  shore: {{from: {{north_m: {room:.0f}, east_m: 500}}, to: {{north_m: {room:.0f}, "
        "east_m: -500}, keep: left, margin_m: 0}\n"
        "gates:\n"
        f"  a: {{type: level, north_m: -600, east_m: 0, heading_deg: 0}}\n"
        "  b: {type: level, north_m: 0, east_m: 0, heading_deg: 0}\n"
        "  c: {type: level, north_m: 0, east_m: -120, heading_deg: 180}\n"
        "  d: {type: level, north_m: -600, east_m: -120, heading_deg: 180}\n"
        "course: {start: a, lap: [b, {gate: c, safety_lines: [shore]}], finish: d}\n"
    )
    changed = f"safety_lines.shore.margin_m={room - rng.uniform(2, 12):.0f}"
    return Spoilt(text, (changed,), ("safety_lines.shore.margin_m",), ("b", "c"))


def near_crowd(rng: random.Random) -> Spoilt:
    rest = "crowd:\n  stands: {point: {north_m: 620, east_m: 40}, measured: over-ground, distance_m: 20}\n"
    track = corridor([gate("a", 0), gate("b", 250), gate("c", 500), gate("d", 740), gate("e", 990)], rest=rest)
    return Spoilt(
        track, (f"crowd.stands.distance_m={rng.uniform(102, 120):.0f}",), ("crowd.stands.distance_m",), ("c", "d")
    )


def uphill() -> str:
    gates = [gate("a", 0), gate("b", 400), gate("c", 900), gate("d", 1700, 0.0, ", height_m: 220")]
    return corridor(gates, ceiling=400)


def little_power(rng: random.Random) -> Spoilt:
    changed = ("rules.start_speed_max_kt=100", f"aircraft.propulsion.power_max_kW={rng.uniform(40, 50):.0f}")
    return Spoilt(uphill(), changed, ("aircraft.propulsion.power_max_kW",), ("b", "c", "d"))


def much_mass(rng: random.Random) -> Spoilt:
    changed = ("rules.ceiling_m=230", f"aircraft.airframe.mass_kg={rng.uniform(1300, 2000):.0f}")
    keys = ("aircraft.airframe.mass_kg",)
    return Spoilt("half_cuban_eight", changed, keys, ("entry", "vertical", "down_line", "upright", "exit"))


KINDS: dict[str, Callable[[random.Random], Spoilt]] = {
    "a ceiling": low_ceiling,
    "a climb angle": flat_climb,
    "a clearance": wide_berth,
    "a crowd": near_crowd,
    "a gate's height": high_gate,
    "a load factor in a loop": weak_loop,
    "a mass": much_mass,
    "a power": little_power,
    "a roll rate": slow_roll,
    "a safety line": near_line,
    "a start speed": slow_start,
    "a tolerance of bank": strict_bank,
}


def fly(folder: Path, track: str, settings: Sequence[str]) -> tuple[Ran, list[Conflict]]:
    """Fly a course in a process of its own; return what it said and took, and its conflicts."""
    named = track
    if "\n" in track:
        named = "spoilt.yaml"
        (folder / named).write_text(track, encoding="utf-8")
    changed = [text for one in settings for text in ("--set", one)]
    began = processor_time()
    ended = subprocess.run(
        [*COMMAND, "optimize", named, *FLY, *changed, "--output", "run.h5", "--force"],
        cwd=folder,
        env=environment(),
        capture_output=True,
        text=True,
        timeout=1200.0,
        check=False,
    )
    return Ran(ended.returncode, ended.stdout, ended.stderr, processor_time() - began), conflicts_of(ended.stdout)


def processor_time() -> float:
    """The processor time of all processes that this one has started and that have ended, s."""
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


def conflicts_of(out: str) -> list[Conflict]:
    """The conflicts that an answer tells; none where there is no answer."""
    try:
        return [one for stage in json.loads(out).get("stages", ()) for one in stage["conflicts"]]
    except ValueError:
        return []


def trial(rng: random.Random, number: int) -> Record:
    kind, drawn = choice_of(rng, KINDS)
    spoilt: Spoilt = drawn(rng)
    with tempfile.TemporaryDirectory() as name:
        ran, conflicts = fly(Path(name), spoilt.track, spoilt.changed)
        first = [one["suggested_changes"][0] for one in conflicts if one["suggested_changes"]]
        suggested = [f"{one['key']}={one['needed']:g}" for one in first if one["key"]]
        flown = fly(Path(name), spoilt.track, [*spoilt.changed, *suggested])[0] if suggested else None
    again = None if flown is None else flown.code
    keys = {way["key"] for one in conflicts for way in one["suggested_changes"]}
    places = {at.partition(":")[2] for one in conflicts for at in one["where"].split(" -> ")}
    faults = ran.faults(LONGEST)
    if ran.code == 0:
        faults.append("is not infeasible")
    else:
        faults += [] if keys.intersection(spoilt.keys) else ["limit not named"]
        faults += [] if places.intersection(spoilt.places) else ["place not named"]
        faults += [] if again == 0 else ["suggestion does not fly"]
    return {
        "kind": kind,
        "outcome": "works" if again == 0 else outcome(ran.code),
        "seconds": ran.seconds,
        "again_seconds": None if flown is None else flown.seconds,
        "faults": faults,
        "changed": list(spoilt.changed),
        "suggested": suggested,
        "reason": ran.err.strip().splitlines()[-1][:800] if ran.code and ran.err.strip() else "",
    }


if __name__ == "__main__":
    sys.exit(play_study(__doc__ or "", 50, trial))
