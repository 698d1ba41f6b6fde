"""Record optima with their roll, and print how well logs show the roll rate of the aircraft that flew them.

    python scripts/experiments/roll_rates.py RUN.h5 ...

Positions have 1.5 m of white noise; the roll is recorded in whole degrees, or with 1 or 2 degrees of white noise.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import airrace
from airrace.api.run import Run
from airrace.flights.logs.log_flight import flight_from_log
from airrace.flights.logs.identification import RollRate, measure_roll_rate
from airrace.flights.logs.reading import read_log

NOISE = 1.5
ROLL_NOISES = (0.0, 1.0, 2.0)
RATES = (5.0, 10.0, 20.0, 50.0)
HEADER = "time [s],north [m],east [m],height [m],roll [deg]"


def measured(run: Run, path: Path, hz: float, noise: float, random: np.random.Generator) -> RollRate | None:
    """Return the roll rate that a log shows, as a factor of the true one."""
    time = np.arange(random.uniform(0.0, 1.0 / hz), run.race_time, 1.0 / hz)
    flown = run.stages[-1].flight().at(time)
    places = [flown[name] + NOISE * random.standard_normal(len(time)) for name in ("x", "y", "height")]
    roll = np.degrees(flown["phi"]) + noise * random.standard_normal(len(time))
    table = np.stack([time, *places, roll if noise else np.round(roll)], axis=1)
    np.savetxt(path, table, "%.4f", ",", header=HEADER, comments="")
    race = run.inputs.race
    return measure_roll_rate(race.aircraft, [flight_from_log(read_log(path), race, label="log")])


def main() -> None:
    """Record, measure, print."""
    courses: dict[str, list[Run]] = {}
    for path in sys.argv[1:]:
        run = airrace.open(path)
        courses.setdefault(run.inputs.race.course.name, []).append(run)
    print(
        "| course | Hz | roll | logs | visible | error | deviation told | within 2 |\n|---|---|---|---|---|---|---|---|"
    )
    with tempfile.TemporaryDirectory() as folder:
        for course, runs in courses.items():
            for hz in RATES:
                for noise in ROLL_NOISES:
                    random = np.random.default_rng((int(hz), int(noise)))
                    found = [measured(run, Path(folder) / "log.csv", hz, noise, random) for run in runs]
                    seen = np.array([(one.factor, one.deviation) for one in found if one is not None]).reshape(-1, 2)
                    e, d = np.abs(seen.T)
                    sizes = [f"{100.0 * np.sqrt(np.mean(one**2)):.1f} %" if len(seen) else "" for one in (e, d)]
                    recorded = f"+-{noise:g} deg" if noise else "whole degrees"
                    shares = f"{len(seen)} | {' | '.join(sizes)} | {np.sum(e <= 2.0 * d)}"
                    print(f"| {course} | {hz:g} | {recorded} | {len(runs)} | {shares} |", flush=True)


if __name__ == "__main__":
    main()
