"""Print the tables of the documents as Markdown from runs of the command, or write them where they stand.

    airrace batch tracks/*.yaml --set settings.guess=plan --set settings.mesh_check=all --output RUNS
    python scripts/tables.py ladder RUNS [--write]              docs/ladder.md: what every stage found
    python scripts/tables.py courses RUNS [--write]             docs/courses.md: optima and winners
    python scripts/tables.py evidence RUNS                      the worst of every item, by stage, for docs/evidence.md
    python scripts/tables.py abu-dhabi RUNS [--write]           docs/courses.md: Abu Dhabi with other rules

RUNS is a folder of checkpoints. The first three read what a batch has left there, `TRACK.h5` for every shipped course;
`abu-dhabi` flies what is missing there, point mass from the plan, as `abu_dhabi_N.h5` (a few minutes in all). A run
that is missing, or a stage that is not certified, is told on stderr; the script then ends with 1 and writes nothing.
"""

import argparse
import json
import re
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from airrace.inputs import load_inputs

ROOT = Path(__file__).resolve().parent.parent
COMMAND = (sys.executable, "-P", "-m", "airrace")
STAGES = ("point-mass", "transfer-function", "state-space-inversion", "state-space", "six-dof")
REAL = ("rovinj_2014", "gdynia_2014", "chiba_2015", "abu_dhabi_2016", "san_diego_2017", "air_race_x_2024")
COURSES = (*REAL, "sixteen_phases", "half_cuban_eight")
UNKNOWN = {"air_race_x_2024": "none known; about 50 s were expected"}

STEEP = ("climb_min_deg=-45", "climb_max_deg=45")
NO_LINE = ("course.lap.4.safety_lines=null", "safety_lines=null")
VARIANTS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("nothing", ()),
    ("wings level within 2° at the gates instead of 10°", ("gate_defaults.bank_tolerance_deg=2",)),
    (
        "gates 4 and 5 crossed within 20° of their axes instead of 60°",
        tuple(f"gates.{gate}.crossing_max_deg=20" for gate in ("g4", "g5")),
    ),
    ("gates 4 and 5 crossed within 10°", tuple(f"gates.{gate}.crossing_max_deg=10" for gate in ("g4", "g5"))),
    ("all gates crossed within 10°", ("gate_defaults.crossing_max_deg=10",)),
    ("climb of -45° to 45° at gate 4", tuple(f"gates.g4.{one}" for one in STEEP)),
    ("climb of -45° to 45° at gates 4 and 5", tuple(f"gates.{gate}.{one}" for gate in ("g4", "g5") for one in STEEP)),
    ("climb of -45° to 45° at all gates and pylons", tuple(f"gate_defaults.{one}" for one in STEEP)),
    ("9 g instead of 10 g", ("rules.n_z_max=9",)),
    ("8 g", ("rules.n_z_max=8",)),
    ("roll rate of 200 °/s", ("rules.roll_rate_max_deg_s=200",)),
    ("10 m of margin from the safety line", ("safety_lines.shore.margin_m=10",)),
    ("no safety line", NO_LINE),
    ("no safety line, climb of -45° to 45° everywhere", (*NO_LINE, *(f"gate_defaults.{one}" for one in STEEP))),
)
"""What is changed at Abu Dhabi: in words, and as values of `--set`."""

Answer = dict[str, Any]  # Any: as read from JSON
Rows = list[tuple[str, ...]]


class MissingRun(Exception):
    """A run that a table needs is not there, or is not certified."""


@dataclass(frozen=True)
class Table:
    """A table, and the document and the mark above it where it stands; no document for one that is only printed."""

    rows: Callable[[Path], Rows]
    document: str = ""
    mark: str = ""


def shown(run: Path) -> Answer:
    """What `airrace show --json` says of a run.

    Raises:
        MissingRun: there is none, or not all of its stages are certified.
    """
    if not run.exists():
        raise MissingRun(f"{run}: there is no such run")
    ran = subprocess.run([*COMMAND, "show", str(run), "--json"], capture_output=True, text=True, check=False)
    if ran.returncode:
        raise MissingRun(f"{run}: {ran.stderr.strip()}")
    answer: Answer = json.loads(ran.stdout)
    unproved = [stage["stage"] for stage in answer["stages"] if stage["certificate"] and not stage["certified"]]
    if unproved or not answer["certified"]:
        told = ", ".join(unproved)
        raise MissingRun(f"{run}: not certified{told and f': {told}'}; fly it with --mesh-check all")
    return answer


def stages(runs: Path, course: str) -> dict[str, Answer]:
    """The stages of a course from the point mass on, by name; all of them are certified."""
    return {one["stage"]: one for one in shown(runs / f"{course}.h5")["stages"] if one["stage"] in STAGES}


def whole_ladder(runs: Path, course: str) -> dict[str, Answer]:
    """All stages of a course.

    Raises:
        MissingRun: the run does not have all of them.
    """
    found = stages(runs, course)
    if tuple(found) != STAGES:
        raise MissingRun(f"{runs / course}.h5: it has not all stages, but {', '.join(found) or 'none'}")
    return found


def ladder(runs: Path) -> Rows:
    """One line per course: race time by stage, what all stages cost, largest tracking error, iterations."""
    names = tuple(f"`{stage}`" for stage in STAGES)
    rows: Rows = [("course", *names, "last - first", "tracking error at most, m", "iterations")]
    for course in COURSES:
        found = whole_ladder(runs, course)
        times = [one["race_time_s"] for one in found.values()]
        error = max(one["tracking_error_m"] for one in found.values() if one["tracking_error_m"] is not None)
        iterations = sum(one["iterations"] for one in found.values())
        cells = (*(f"{time:.3f}" for time in times), f"{times[-1] - times[0]:+.3f}", f"{error:.1f}", str(iterations))
        rows.append((f"`{course}`", *cells))
    return rows


def courses(runs: Path) -> Rows:
    """One line per real course: the optimum of the point mass against the winner."""
    rows: Rows = [("course", "year", "passages", "optimum s", "winner's official time s", "difference")]
    for course in REAL:
        time = stages(runs, course)["point-mass"]["race_time_s"]
        passages = len(load_inputs(track(course)).race.course.passages)
        winner = winners_time(course)
        against = (UNKNOWN[course], "") if winner is None else (f"{winner:.3f}", share(time, winner))
        rows.append((f"`{course}`", course.rpartition("_")[2], str(passages), f"{time:.3f}", *against))
    return rows


def evidence(runs: Path) -> Rows:
    """One line per item of the certificate: its limit, and the largest value by stage over all courses."""
    worst: dict[str, dict[str, float]] = {}
    about: dict[str, tuple[str, str]] = {}
    for course in COURSES:
        for stage, found in whole_ladder(runs, course).items():
            for item in found["certificate"]["items"]:
                values = worst.setdefault(item["name"], {})
                values[stage] = max(item["value"], values.get(stage, item["value"]))
                about[item["name"]] = (f"{item['limit']:g}", item["unit"])
    rows: Rows = [("item", "limit", "unit", *(f"`{stage}`" for stage in STAGES))]
    for name, values in worst.items():
        rows.append((f"`{name}`", *about[name], *(f"{values[one]:.2g}" if one in values else "" for one in STAGES)))
    return rows


def abu_dhabi(runs: Path) -> Rows:
    """One line per change of the rules: the optimum of the point mass, and how far it is below the winner."""
    winner = winners_time("abu_dhabi_2016")
    assert winner is not None
    rows: Rows = [("changed", "`--set`", "s", "below the winner")]
    for number, (text, overrides) in enumerate(VARIANTS):
        run = runs / f"abu_dhabi_{number}.h5"
        if not run.exists():
            fly(run, track("abu_dhabi_2016"), overrides)
        time = stages(runs, run.stem)["point-mass"]["race_time_s"]
        told = ", ".join(f"`{one}`" for one in overrides)
        rows.append((text, told, f"{time:.3f}", share(time, winner).removeprefix("-")))
    return rows


def fly(run: Path, course: Path, overrides: Sequence[str]) -> None:
    """The point mass, from the plan; whether a flight was found is seen by whoever reads the run."""
    options = [part for one in overrides for part in ("--set", one)]
    options += ["--guess", "plan", "--until", "point-mass", "--quiet", "--output", str(run)]
    run.parent.mkdir(parents=True, exist_ok=True)
    subprocess.run([*COMMAND, "optimize", str(course), *options], check=False)


def track(course: str) -> Path:
    return ROOT / "tracks" / f"{course}.yaml"


def winners_time(course: str) -> float | None:
    """The winner's official time (s), as the source of the track has it; None where it has none."""
    found = re.search(r"^source:(?:.|\n  )*official time ([\d.]+) s", track(course).read_text(encoding="utf-8"), re.M)
    return float(found[1]) if found else None


def share(time: float, winner: float) -> str:
    """By how much of the winner's time an optimum differs from it."""
    return f"{time / winner - 1.0:+.1%}".replace("%", " %")


def markdown(rows: Rows) -> str:
    """The rows as a table, the first of them as its headings."""
    headings, *rest = rows
    lines = (headings, ("---",) * len(headings), *rest)
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)


def put(text: str, path: Path, mark: str) -> None:
    """Replace the table below a mark of a document.

    Raises:
        ValueError: the document does not have the mark, with a table below it, exactly once.
    """
    before = path.read_text(encoding="utf-8")
    after, count = re.subn(rf"(<!-- {mark} -->\n)(?:\|.*\n)+", lambda found: found[1] + text, before)
    if count != 1:
        raise ValueError(f"{path}: {count} tables below <!-- {mark} -->")
    path.write_text(after, encoding="utf-8")


TABLES = {
    "ladder": Table(ladder, "docs/ladder.md", "ladder"),
    "courses": Table(courses, "docs/courses.md", "courses"),
    "evidence": Table(evidence),
    "abu-dhabi": Table(abu_dhabi, "docs/courses.md", "abu dhabi"),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Print or write a table; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", choices=TABLES)
    parser.add_argument("runs", type=Path, metavar="RUNS", help="folder of checkpoints")
    parser.add_argument("--write", action="store_true", help="write it into its document, too")
    chosen = parser.parse_args(arguments)
    table = TABLES[chosen.table]
    if chosen.write and not table.document:
        parser.error(f"no document has the table `{chosen.table}` as it is")
    try:
        text = markdown(table.rows(chosen.runs))
    except MissingRun as error:
        print(error, file=sys.stderr)
        return 1
    print(text, end="")
    if chosen.write:
        put(text, ROOT / table.document, table.mark)
    return 0


if __name__ == "__main__":
    sys.exit(main())
