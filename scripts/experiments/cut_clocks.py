"""Record known flights with times cut to whole seconds, import them, and print how true the repaired times are.

    python scripts/experiments/cut_clocks.py RUN.h5 [RUN.h5 ...] [--logs 12] [--noise 0.3]

Each run is a checkpoint whose last stage found a legal flight. The first table holds, by course and sampling, the errors
of the times within the race: root mean square, the median of the standard deviations that are told, and the greatest
error in terms of its own; then how many logs were not seen to be cut, or not repaired; of logs that are imported, the
greatest error of a race time in terms of the deviation that is told, the greatest load factor beyond the true one, and
the certain violations, which are all false. The second one counts logs of exact whole seconds at steps of 1 to 3 s that
are taken for cut.
"""

import argparse
import math
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import airrace
from airrace.api.run import Run
from airrace.errors import InputError
from airrace.flights.logs.clocks import cut_step, repair_cut, spread_repeated
from airrace.flights.logs.log_flight import flight_from_log
from airrace.flights.logs.reading import read_log
from airrace.flights.results import Flight
from airrace.optimal_control.trajectory import Array

LEAD = 5.0
"""The time before the start and behind the finish that is recorded, s."""
STEPS = {
    "20.5 Hz": (1 / 20.5, 1 / 20.5),
    "5.5 Hz": (1 / 5.5, 1 / 5.5),
    "5 Hz, jittering": (0.16, 0.24),
    "1.1 to 2.1 s": (1.1, 2.1),
}
"""Between which the step from one sample to the next is drawn, s."""
EXACT_LOGS = 20


@dataclass
class Count:
    """What is counted over the logs of one course and sampling."""

    errors: list[Array] = field(default_factory=list[Array])
    told: list[Array] = field(default_factory=list[Array])
    unseen: int = 0
    race_times: list[float] = field(default_factory=list[float])
    loads: list[float] = field(default_factory=list[float])
    false: int = 0
    refused: int = 0


def places_at(flight: Flight, times: Array) -> Array:
    """Return north, east and up, m, shape (3, n), straight on before the start and behind the finish."""
    places: list[Array] = []
    for name in ("x", "y", "height"):
        values, clock = flight[name], flight.time
        slopes = (values[1] - values[0]) / (clock[1] - clock[0]), (values[-1] - values[-2]) / (clock[-1] - clock[-2])
        outside = slopes[0] * np.minimum(times, 0.0) + slopes[1] * np.maximum(times - clock[-1], 0.0)
        places.append(np.interp(times, clock, values) + outside)
    return np.stack(places)


def sampling(random: np.random.Generator, flight: Flight, draw: Callable[[int], Array]) -> Array:
    """Return the times of samples, s."""
    times = -LEAD + random.uniform() + np.cumsum(draw(int(40 * flight.race_time)))
    return times[times < flight.race_time + LEAD]


def take(count: Count, run: Run, flight: Flight, times: Array, noise: float, random: np.random.Generator) -> None:
    """Record, repair and import one log."""
    places = places_at(flight, times) + noise * random.standard_normal((3, len(times)))
    late = 100.0 + random.uniform()
    cut = np.floor(times + late)
    if not cut_step(cut, places):
        count.unseen += 1
    else:
        inside = (times > 0.0) & (times < flight.race_time)
        repaired, told, _ = repair_cut(spread_repeated(cut, 1.0)[0], places, 1.0)
        count.errors.append((repaired - times - late)[inside])
        count.told.append(told[inside])
    rows = (",".join(f"{value:.2f}" for value in row) for row in np.stack([cut, *places]).T)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        path.write_text("\n".join(["time [s],north [m],east [m],height [m]", *rows]))
        try:
            flown = flight_from_log(read_log(path), run.inputs.race, label="log", penalties=run.inputs.penalties)
        except InputError:
            count.refused += 1
            return
    first, last = flown.flight.crossings[0], flown.flight.crossings[-1]
    if first.name in flown.known and last.name in flown.known:
        deviation = math.hypot(flown.known[first.name].time, flown.known[last.name].time)
        count.race_times.append((flown.flight.race_time - flight.race_time) / deviation)
    count.loads.append(float(flown.flight["n_z"].max() - flight["n_z"].max()))
    count.false += sum(violation.certain for violation in flown.violations)


def main() -> None:
    """Record, import, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN.h5")
    parser.add_argument("--logs", type=int, default=12)
    parser.add_argument("--noise", type=float, default=0.3)
    arguments = parser.parse_args()
    flights = {run: run.stages[-1].flight() for run in map(airrace.open, arguments.runs)}
    print("| course | sampling | error [s] | told [s] | greatest | not seen | refused | race time | n_z | false |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for run, flight in flights.items():
        for name, (low, high) in STEPS.items():
            count = Count()
            for seed in range(arguments.logs):
                random = np.random.default_rng(seed)
                times = sampling(random, flight, lambda n, r=random, a=low, b=high: r.uniform(a, b, n))
                take(count, run, flight, times, arguments.noise, random)
            errors, told = np.concatenate(count.errors), np.concatenate(count.told)
            race_time = f"{np.abs(count.race_times).max():.1f}" if count.race_times else "-"
            load = f"{max(count.loads):.1f}" if count.loads else "-"
            print(
                f"| {run.name} | {name} | {np.sqrt(np.mean(errors**2)):.3f} | {np.median(told):.3f} | "
                f"{np.abs(errors / told).max():.1f} | {count.unseen} | {count.refused} | "
                f"{race_time} | {load} | {count.false} |",
                flush=True,
            )
    print("\n| course | exact seconds taken for cut |\n|---|---|")
    for run, flight in flights.items():
        taken = 0
        for seed in range(EXACT_LOGS):
            random = np.random.default_rng(seed)
            times = sampling(random, flight, lambda n, r=random: r.choice([1.0, 2.0, 3.0], n))
            places = places_at(flight, times) + arguments.noise * random.standard_normal((3, len(times)))
            taken += cut_step(np.round(times - times[0]), places) > 0.0
        print(f"| {run.name} | {taken} of {EXACT_LOGS} |")


if __name__ == "__main__":
    main()
