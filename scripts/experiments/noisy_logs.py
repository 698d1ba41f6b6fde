"""Record known flights with noise, import them, and print as Markdown tables how well their passings are known.

    python scripts/experiments/noisy_logs.py RUN.h5 [RUN.h5 ...] [--rates 5 20 50 200] [--noises 0.02 0.1 0.3 1.5] [--seeds 4]

Each run is a checkpoint whose last stage found a flight. It is sampled at every rate, with a straight lead-in and
lead-out and white noise of every size (m), as many times as there are seeds, and imported as a log of its course. The
first table holds the errors at all passings, each divided by the standard deviation that the import tells of it: their
root mean square, which should be near to 1 and hardly above it, and the greatest. The second one counts violations that
the import takes for certain: an optimum breaks no rule, so there should be none.
"""

import argparse
import itertools
import math
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import airrace
from airrace.api import Run
from airrace.logs.log_flight import LogFlight, flight_from_log
from airrace.logs.reading import read_log
from airrace.procedure.results_api import sampler
from airrace.results import Flight, TimedCrossing
from airrace.trajectory import Array

LEAD = 4.0
"""The time of straight flight before the start and behind the finish, s."""
EDGE = 1e-3
"""The time within which the speed at an end of the flight is measured, s."""
QUANTITIES = ("aside", "height", "path", "speed", "bank")


@dataclass(frozen=True)
class Recorded:
    """A flight that is known, recorded at a rate (Hz) with noise (m)."""

    run: Run
    hz: float
    noise: float
    seed: int

    def imported(self) -> LogFlight:
        """Return what the import makes of the log."""
        run = self.run
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "log.csv"
            with path.open("w") as file:
                file.write("time [s],north [m],east [m],height [m]\n")
                np.savetxt(file, np.column_stack(self._samples()), fmt="%.4f", delimiter=",")
            return flight_from_log(read_log(path), run.inputs.race, label="log", penalties=run.inputs.penalties)

    def _samples(self) -> list[Array]:
        at, last = sampler(self.run.inputs.race, self.run.results[-1]), self.run.race_time
        time = np.arange(-LEAD + 0.013 * (self.seed % 7), last + LEAD, 1.0 / self.hz)
        inside, ends = at(np.clip(time, 0.0, last)), at(np.array([0.0, EDGE, last - EDGE, last]))
        before, behind = np.minimum(time, 0.0), np.maximum(time - last, 0.0)
        random = np.random.default_rng(self.seed)
        samples = [time]
        for name, sign in (("x", 1.0), ("y", 1.0), ("z", -1.0)):
            first, final = np.diff(ends[name])[[0, -1]] / EDGE
            place = sign * (inside[name] + first * before + final * behind)
            samples.append(place + self.noise * random.standard_normal(len(time)))
        return samples


def errors(flown: LogFlight, known: Flight) -> Iterator[Mapping[str, float]]:
    """Yield the errors at every passing, in standard deviations, by `QUANTITIES`."""
    for seen, true in zip(flown.flight.crossings, known.crossings, strict=True):
        if seen.found and seen.name in flown.known:
            deviations = flown.known[seen.name]
            off = _off(seen, true)
            scales = (deviations.across, deviations.up, deviations.path, deviations.speed, deviations.bank)
            yield {name: off[name] / scale for name, scale in zip(QUANTITIES, scales, strict=True)}


def _off(seen: TimedCrossing, true: TimedCrossing) -> Mapping[str, float]:
    chi = true.value("chi")
    north, east = (seen.value(name) - true.value(name) for name in ("x", "y"))
    return {
        "aside": east * math.cos(chi) - north * math.sin(chi),
        "height": seen.value("height") - true.value("height"),
        "path": max(abs(_turned(seen, true, "chi")), abs(_turned(seen, true, "gamma"))),
        "speed": seen.value("V_K") - true.value("V_K"),
        "bank": _turned(seen, true, "mu"),
    }


def _turned(seen: TimedCrossing, true: TimedCrossing, name: str) -> float:
    return math.remainder(seen.value(name) - true.value(name), math.tau)


def main() -> None:
    """Record, import, print."""
    arguments = _arguments()
    runs = [airrace.open(path) for path in arguments.runs]
    flights = [run.stages[-1].flight() for run in runs]
    found: dict[tuple[float, float], list[Mapping[str, float]]] = {}
    certain: list[tuple[str, ...]] = []
    for hz, noise in itertools.product(arguments.rates, arguments.noises):
        found[hz, noise] = []
        for (run, known), seed in itertools.product(zip(runs, flights, strict=True), range(arguments.seeds)):
            flown = Recorded(run, hz, noise, seed).imported()
            found[hz, noise] += errors(flown, known)
            certain += [
                (run.name, f"{hz:g}", f"{noise:g}", str(seed), one.passing, one.rule)
                for one in flown.violations
                if one.certain
            ]
        print(f"{hz:g} Hz, {noise:g} m", file=sys.stderr, flush=True)
    _print(("rate, Hz", "noise, m", *QUANTITIES), [_row(*key, passings) for key, passings in found.items()])
    print(f"\nbreaches that were taken for certain: {len(certain)}\n")
    if certain:
        _print(("course", "rate, Hz", "noise, m", "seed", "passing", "rule"), certain)


def _row(hz: float, noise: float, passings: Sequence[Mapping[str, float]]) -> tuple[str, ...]:
    cells = [f"{hz:g}", f"{noise:g}"]
    for name in QUANTITIES:
        values = np.abs([one[name] for one in passings])
        cells.append(f"{math.sqrt(np.mean(values**2)):.2f}, {values.max():.1f}")
    return tuple(cells)


def _print(header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    for cells in (header, ["---"] * len(header), *rows):
        print("| " + " | ".join(cells) + " |")


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN.h5")
    parser.add_argument("--rates", nargs="+", type=float, default=[5.0, 20.0, 50.0, 200.0], metavar="HZ")
    parser.add_argument("--noises", nargs="+", type=float, default=[0.02, 0.1, 0.3, 1.5], metavar="M")
    parser.add_argument("--seeds", type=int, default=4)
    return parser.parse_args()


if __name__ == "__main__":
    main()
