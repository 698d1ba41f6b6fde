"""Fly other aircraft than the start's, fit the start to their logs, and print how well that tells the truth.

    python scripts/experiments/fit_calibration.py FOLDER [--truths 12] [--first 0] [--n-z 8] [--course rovinj_2014 ...]

True aircraft differ from the Edge 540 at random: C_D0 and roll (ailerons and the limit of the roll rate) by up to 15 %,
k and power by up to 10 %, and 2 kt of wind blow from anywhere, of which the fit knows nothing. Their six-dof optima are
recorded at 5 and at 20 Hz with 1.5 m of white noise, the roll with 1 degree. Optima start from that of the Edge 540,
here and within the fit, which saves time and changes nothing else. Results go to FOLDER, one line per log; lines that are there are not computed
again. The tables hold, for every number, the shares of errors within one and two of the standard deviations that the
fit tells, and the errors of the race time with which the fitted aircraft flies the course in the true wind.
"""

import argparse
import dataclasses
import json
from pathlib import Path

import numpy as np

import airrace
import airrace.runs.fit as fitting
from airrace.model.aircraft import Aircraft
from airrace.api.run import Run
from airrace.procedure.stored_stages import sampler
from airrace.runs.aircraft_file import read_aircraft_file

COURSES = ("rovinj_2014", "chiba_2015")
SPREAD = {"C_D0": 0.15, "k": 0.10, "power": 0.10, "roll": 0.15}
RATES = (5.0, 20.0)
NOISE = 1.5
ROLL_NOISE = 1.0
"""deg."""
LEAD = 4.0
"""Straight flight before the start and behind the finish, s."""


def true_aircraft(start: Aircraft, factors: dict[str, float]) -> Aircraft:
    """Return the start with its numbers multiplied by factors."""
    of, roll = dataclasses.replace, factors["roll"]
    return of(
        start,
        drag=of(start.drag, C_D0=start.drag.C_D0 * factors["C_D0"], k=start.drag.k * factors["k"]),
        propulsion=of(start.propulsion, P_max=start.propulsion.P_max * factors["power"]),
        roll=of(start.roll, C_lxi=start.roll.C_lxi * roll),
        yaw=of(start.yaw, C_nxi=start.yaw.C_nxi * roll),
        point_mass=of(start.point_mass, p=start.point_mass.p * roll),
    )


def log_text(run: Run, hz: float, random: np.random.Generator) -> str:
    """Return the log of an optimum as comma-separated values."""
    at, last = sampler(run.inputs.race, run.results[-1]), run.race_time
    time = np.arange(random.uniform(0.0, 1.0 / hz) - LEAD, last + LEAD, 1.0 / hz)
    inside, ends = at(np.clip(time, 0.0, last)), at(np.array([0.0, 1e-3, last - 1e-3, last]))
    columns = [time + LEAD]
    for name, sign in (("x", 1.0), ("y", 1.0), ("z", -1.0)):
        first, final = np.diff(ends[name])[[0, -1]] / 1e-3
        place = inside[name] + first * np.minimum(time, 0.0) + final * np.maximum(time - last, 0.0)
        columns.append(sign * place + NOISE * random.standard_normal(len(time)))
    roll = np.degrees(run.stages[-1].flight().at(np.clip(time, 0.0, last))["phi"])
    columns.append(roll + ROLL_NOISE * random.spawn(1)[0].standard_normal(len(time)))
    rows = [",".join(f"{value:.4f}" for value in row) for row in zip(*columns, strict=True)]
    return "\n".join(["time [s],north [m],east [m],height [m],roll [deg]", *rows]) + "\n"


def measure(folder: Path, course: str, number: int, n_z: float | None) -> None:
    """Fly one aircraft, and fit its logs; `n_z` is the greatest load factor that is flown, None for that of the rules."""
    start, random = read_aircraft_file("edge540").aircraft, np.random.default_rng((number, len(course)))
    factors = {name: float(1.0 + most * random.uniform(-1.0, 1.0)) for name, most in SPREAD.items()}
    wind = {"environment.wind.from_deg": float(random.uniform(0.0, 360.0)), "environment.wind.speed_kt": 2.0}
    wind |= {} if n_z is None else {"rules.n_z_max": n_z}
    base = folder / f"{course}.h5"
    if not base.exists():
        airrace.optimize(course, aircraft="edge540", search="off", output=base)
    first = airrace.open(base)
    fitting._optimum = lambda race, progress: airrace.resume(first, track=race)
    run = airrace.resume(first, aircraft=true_aircraft(start, factors), set=wind)
    for hz in RATES:
        log = folder / f"{course}-{number}-{hz:g}.csv"
        log.write_text(log_text(run, hz, random))
        line = {"course": course, "number": number, "hz": hz, "certified": run.certified}
        try:
            fitted = airrace.fit(log, course, aircraft="edge540")
        except airrace.AirraceError as error:
            print(log, error, flush=True)
            continue
        again = airrace.resume(run, aircraft=fitted.aircraft)
        truth = np.log([factors[name] for name in ("C_D0", "k", "power")])
        blows = run.inputs.race.air.wind
        assert blows is not None
        line |= {
            "errors": (fitted.estimate.factors - truth).tolist(),
            "wind_errors": (fitted.estimate.winds[0] - [blows.north, blows.east]).tolist(),
            "deviations": fitted.estimate.deviations.tolist(),
            "bias": fitted.bias.tolist(),
            "roll": fitted.roll and [fitted.roll.factor - np.log(factors["roll"]), fitted.roll.deviation],
            "race_time_error": again.race_time - run.race_time,
            "again": again.certified,
        }
        with (folder / "results.jsonl").open("a") as file:
            file.write(json.dumps(line) + "\n")


def tables(folder: Path) -> None:
    """Print the table."""
    lines = [json.loads(line) for line in (folder / "results.jsonl").read_text().splitlines()]
    print("| Hz | logs | number | error | deviation told | within 1 | within 2 |\n|---|---|---|---|---|---|---|")
    for hz in RATES:
        those = [one for one in lines if one["hz"] == hz]
        errors = np.array([one["errors"] + one["wind_errors"] for one in those])
        told = np.array([one["deviations"] for one in those])
        for index, name in enumerate(("`C_D0`", "`k`", "power", "wind, north", "wind, east")):
            e, d = errors[:, index], told[:, index]
            counts = " | ".join(str(np.sum(np.abs(e) <= most * d)) for most in (1.0, 2.0))
            sizes = [np.sqrt(np.mean(one**2)) for one in (e, d)]
            shown = " | ".join(f"{one:.2f} m/s" if index > 2 else f"{100.0 * one:.1f} %" for one in sizes)
            print(f"| {hz:g} | {len(those)} | {name} | {shown} | {counts} |")
        if rolls := [one["roll"] for one in those if one.get("roll")]:
            e, d = np.array(rolls).T
            counts = " | ".join(str(np.sum(np.abs(e) <= most * d)) for most in (1.0, 2.0))
            shown = " | ".join(f"{100.0 * np.sqrt(np.mean(one**2)):.1f} %" for one in (e, d))
            print(f"| {hz:g} | {len(rolls)} | roll rate | {shown} | {counts} |")
    late = np.abs([one["race_time_error"] for one in lines])
    print(f"\nrace time, {len(late)} logs: {np.sqrt(np.mean(late**2)):.3f} s (rms), at most {late.max():.3f} s")


def main() -> None:
    """Measure what is missing, and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--truths", type=int, default=12)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--n-z", type=float, help="of pilots who pull less than the rules allow")
    parser.add_argument("--course", nargs="*", default=COURSES)
    arguments = parser.parse_args()
    arguments.folder.mkdir(exist_ok=True)
    results = arguments.folder / "results.jsonl"
    done = [json.loads(line) for line in results.read_text().splitlines()] if results.exists() else []
    for number in range(arguments.first, arguments.first + arguments.truths):
        for course in arguments.course:
            if not any((one["course"], one["number"]) == (course, number) for one in done):
                measure(arguments.folder, course, number, arguments.n_z)
    tables(arguments.folder)


if __name__ == "__main__":
    main()
