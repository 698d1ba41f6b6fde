"""Measure what a pilot's limits cost on shipped courses: every preset, and every limit of `race` alone.

    python scripts/measure_pilot_limits.py [COURSE ...] [--until point-mass] [--presets-only]

Each flight is searched for and certified by itself. What two certified flights differ by below some milliseconds is
their meshes' and the search's, and no cost. The table is printed row by row.
"""

import argparse
import math

import airrace

NONE: dict[str, float | str] = {"rules.pilot.preset": "none"}
COLUMNS: dict[str, dict[str, float | str]] = {
    "race": {"rules.pilot": "race"},
    "display": {"rules.pilot": "display"},
    "least load factor": {**NONE, "rules.pilot.n_z_min": -1.0},
    "load factor near the ground": {**NONE, "rules.pilot.n_z_min_low": 0.0},
    "load factor at the ends": {**NONE, "rules.pilot.n_z_min_ends": 0.25},
    "onset at gates": {**NONE, "rules.pilot.gate_onset_max_g_s": 10.0},
    "roll rate at gates": {**NONE, "rules.pilot.gate_roll_rate_max_deg_s": 90.0},
    "sideslip at gates": {**NONE, "rules.pilot.gate_sideslip_max_deg": 2.0, "rules.pilot.gate_n_y_max": 0.1},
    "settled finish": {**NONE, "rules.pilot.settled": "finish"},
    "steady turn at the start": {**NONE, "rules.pilot.steady_turn": "start"},
}


def measured(course: str, until: str, values: dict[str, float | str]) -> tuple[float, bool]:
    """Return the race time of a course with some keys set, s, and whether it is certified; NaN without a flight."""
    run = airrace.optimize(course, until=until, set=values, threads=1)
    last = run.stages[-1]
    return (last.race_time if last.name == until else math.nan), last.certified


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("courses", nargs="*", default=[one.name for one in airrace.tracks()])
    parser.add_argument("--until", default="point-mass")
    parser.add_argument("--presets-only", action="store_true")
    chosen = parser.parse_args()
    columns = {name: COLUMNS[name] for name in (list(COLUMNS)[:2] if chosen.presets_only else COLUMNS)}
    if chosen.until == "point-mass":
        columns.pop("onset at gates", None)  # it has none
    print(f"| course, {chosen.until} | none | {' | '.join(columns)} |", flush=True)
    print("|---" * (len(columns) + 2) + "|", flush=True)
    for course in chosen.courses:
        free, certified = measured(course, chosen.until, NONE)
        cells = [f"{free:.3f} s{'' if certified else ' (not certified)'}"]
        for values in columns.values():
            seconds, certified = measured(course, chosen.until, values)
            cells.append(f"{1000.0 * (seconds - free):+.0f} ms{'' if certified else ' (not certified)'}")
        print(f"| {course} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
