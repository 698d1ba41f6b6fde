"""Print tables of the documentation as Markdown from runs of the command.

    airrace batch tracks/*.yaml --set settings.guess=plan --set settings.mesh_check=all --output RUNS
    python scripts/tables.py stages RUNS       docs/evidence/races.md: what every stage found
    python scripts/tables.py courses RUNS      docs/evidence/races.md: optima and winners
    python scripts/tables.py evidence RUNS     the largest value of every item of the certificates, by stage
    python scripts/tables.py published RUNS    docs/evidence/aircraft.md: figures of the aircraft beside published ones
    python scripts/tables.py aircraft RUNS     docs/evidence/aircraft.md: optima of runs called AIRCRAFT_TRACK.h5

A run that is missing, or a stage that is not certified, ends the script.
"""

import argparse
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import airrace
from airrace.files.inputs.document import AIRCRAFT

ROOT = Path(__file__).resolve().parents[1]
STAGES = ("point-mass", "transfer-function", "state-space-inversion", "state-space", "six-dof")
REAL = ("rovinj_2014", "gdynia_2014", "chiba_2015", "abu_dhabi_2016", "san_diego_2017", "air_race_x_2024")
COURSES = (*REAL, "sixteen_phases", "half_cuban_eight")
FLOWN = tuple(name for name in AIRCRAFT.names if name not in ("edge540", "pc9"))
"""The aircraft that are estimated from published figures."""
Row = tuple[str, ...]
Answer = dict[str, Any]  # Any: a stage as `--json` prints it


def stages(runs: Path, course: str) -> dict[str, Answer]:
    """The stages of a course from the point mass on, by name.

    Raises:
        SystemExit: a stage is missing or not certified.
    """
    found = {one["stage"]: one for one in airrace.open(runs / f"{course}.h5").as_object()["stages"]}
    bad = [name for name in STAGES if not found.get(name, {}).get("certified")]
    if bad:
        raise SystemExit(f"{course}: not certified: {', '.join(bad)}; fly it with --mesh-check all")
    return {name: found[name] for name in STAGES}


def stage_table(runs: Path) -> Iterator[Row]:
    """One row per course: race time by stage, what fidelity costs, largest tracking error."""
    yield ("course", *(f"`{stage}`" for stage in STAGES), "last - first", "tracking error at most, m")
    for course in COURSES:
        found = stages(runs, course).values()
        times = [one["race_time_s"] for one in found]
        error = max(one["tracking_error_m"] or 0.0 for one in found)
        yield (f"`{course}`", *(f"{one:.3f}" for one in times), f"{times[-1] - times[0]:+.3f}", f"{error:.1f}")


def course_table(runs: Path) -> Iterator[Row]:
    """One row per real course: the optimum of the point mass against the winner's official time."""
    yield ("course", "year", "passages", "optimum s", "winner's official time s", "difference")
    for course in REAL:
        time = stages(runs, course)["point-mass"]["race_time_s"]
        text = (ROOT / "tracks" / f"{course}.yaml").read_text(encoding="utf-8")
        winner = re.search(r"^source:(?:.|\n  )*official time ([\d.]+) s", text, re.MULTILINE)
        against = (winner[1], f"{time / float(winner[1]) - 1.0:+.1%}".replace("%", " %")) if winner else ("", "")
        passages = len(airrace.load_inputs(course).race.course.passages)
        yield (f"`{course}`", course.rpartition("_")[2], str(passages), f"{time:.3f}", *against)


def evidence_table(runs: Path) -> Iterator[Row]:
    """One row per item of the certificate: its limit, and the largest value by stage over all courses."""
    yield ("item", "limit", "unit", *(f"`{stage}`" for stage in STAGES))
    worst: dict[tuple[str, str, str], dict[str, float]] = {}
    for course in COURSES:
        for name, stage in stages(runs, course).items():
            for item in stage["certificate"]["items"]:
                values = worst.setdefault((f"`{item['name']}`", f"{item['limit']:g}", item["unit"]), {})
                values[name] = max(item["value"], values.get(name, item["value"]))
    for about, values in worst.items():
        yield (*about, *(f"{values[one]:.2g}" if one in values else "" for one in STAGES))


def published_table(_: Path) -> Iterator[Row]:
    """One row per aircraft and figure that is published of it."""
    yield ("aircraft", "figure", "published", "computed", "difference")
    for name in AIRCRAFT.names:
        for row in airrace.estimate_aircraft(name).table.objects():
            if row["published"] is not None:
                figures = (f"{row[key]:.1f} {row['unit']}" for key in ("published", "computed"))
                yield (f"`{name}`", str(row["figure"]), *figures, f"{row['difference_percent']:+z.1f} %")


def aircraft_table(runs: Path) -> Iterator[Row]:
    """One row per course: the race time at the last stage of every aircraft that was flown."""
    yield ("course", *(f"`{name}`" for name in FLOWN))
    for course in COURSES:
        yield (f"`{course}`", *(_last_stage(runs / f"{name}_{course}.h5") for name in FLOWN))


def _last_stage(path: Path) -> str:
    """The race time of a run, or how far it came."""
    last = airrace.open(path).as_object()["stages"][-1] if path.exists() else {"stage": "none", "certified": False}
    if last["certified"] and last["stage"] == STAGES[-1]:
        return f"{last['race_time_s']:.3f}"
    return f"not certified: `{last['stage']}`"


def main() -> None:
    tables = {"stages": stage_table, "courses": course_table, "evidence": evidence_table}
    tables |= {"published": published_table, "aircraft": aircraft_table}
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", choices=tables)
    parser.add_argument("runs", type=Path, metavar="RUNS", help="folder of checkpoints")
    chosen = parser.parse_args()
    headings, *rows = tables[chosen.table](chosen.runs)
    for row in (headings, ("---",) * len(headings), *rows):
        print("| " + " | ".join(row) + " |")


if __name__ == "__main__":
    main()
