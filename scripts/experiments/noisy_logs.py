"""Record known flights as recorders do, import them, and print how well the import knows what it says.

    python scripts/experiments/noisy_logs.py RUN.h5 [RUN.h5 ...] [--logs 300] [--seed 1] [--bias M]

Each run is a checkpoint whose last stage found a flight. A log of one of them is drawn at random: 1 to 50 Hz, 0 to 3 m
of white noise, numbers written in steps, positions held over several rows, gaps, heights that are missing, a clock of
its own, angles of the body or none. An optimum breaks no rule, so no violation may be certain. In every second log a
gate is passed too high on purpose, by up to 30 m: where that is more than eight deviations it has to be certain.

With `--bias 3` all positions of a log are off together by a normal error of 3 m, in every second log by one that wanders
with a time constant of 10 s (first-order Gauss-Markov), heights by 1.5 times as much; numbers are cut off instead of
rounded; the load factor is recorded and stands still from some time on; and the import is told an accuracy of 3 m.

The first table counts; the second one holds the errors at all passings, each divided by the standard deviation that the
import tells of it: the shares within one and two of them, and the greatest.
"""

import argparse
import math
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import airrace
from airrace.api.run import Run
from airrace.errors import InputError
from airrace.flights.logs.csv_log import ColumnLayout
from airrace.flights.logs.log_flight import LogFlight, flight_from_log
from airrace.flights.logs.reading import read_log
from airrace.flights.logs.violations import height_window
from airrace.procedure.stored_stages import sampler
from airrace.flights.results import Flight, TimedCrossing

LEAD = 4.0
"""The time of straight flight before the start and behind the finish, s."""
EDGE = 1e-3
"""The time within which the speed at an end of the flight is measured, s."""
WANDER = 10.0
"""The time constant of an error that wanders, s."""
PULL = 40.0
"""The acceleration with which a gate is passed too high, m/s^2."""
ANGLES = ("phi", "theta", "psi")
QUANTITIES = ("time", "aside", "height", "path", "speed", "bank")


@dataclass(frozen=True)
class LogDraw:
    """How a flight is recorded.

    Attributes:
        begin: of the recording, s after the start.
        hz: positions per second.
        noise: of them, m.
        step: in which they are written, m; 0 for all digits.
        held: rows that each position fills.
        gap: begin and end of a gap, s after the start.
        mute: likewise of a time without heights.
        angles: of the body that are recorded.
        angle_step: in which they are written, deg.
        offset: of the clock, s.
        bias: standard deviation of an error that all positions share, m.
        wandering: whether that wanders.
        stuck: from when on a recorded load factor stands still, s after the start; infinite without one.
        raised: the passing that is passed too high, and by how much, m.
    """

    begin: float
    hz: float
    noise: float
    step: float
    held: int
    gap: tuple[float, float]
    mute: tuple[float, float]
    angles: tuple[str, ...]
    angle_step: float
    offset: float
    raised: tuple[TimedCrossing, float] | None
    bias: float = 0.0
    wandering: bool = False
    stuck: float = math.inf


def drawn(random: np.random.Generator, flight: Flight, bias: float) -> LogDraw:
    """Return one way to record a flight."""
    gates = [
        one
        for one in flight.crossings
        if one.passage.element.stands and math.isfinite(height_window(one.passage.element, 0.0).upper)
    ]
    raised = None
    if gates and random.random() < 0.5:
        raised = gates[int(random.integers(len(gates)))], float(random.uniform(2.0, 30.0))
    gap, mute = (float(random.uniform(0.0, flight.race_time)) for _ in range(2))
    hz = float(np.exp(random.uniform(0.0, math.log(50.0))))
    return LogDraw(
        begin=-LEAD + float(random.uniform(0.0, 1.0)) / hz,
        hz=hz,
        noise=float(random.choice([0.0, 0.02, 0.1, 0.3, 1.0, 3.0])),
        step=float(random.choice([0.0, 0.0, 0.01, 0.1, 1.0])),
        held=int(random.choice([1, 1, 1, 3, 4])),
        gap=(gap, gap + float(random.choice([0.0, 0.0, 0.3, 1.0, 2.0]))),
        mute=(mute, mute + float(random.choice([0.0, 0.0, 1.0, 5.0]))),
        angles=[(), (), ANGLES, ("phi",)][int(random.integers(4))],
        angle_step=float(random.choice([0.0, 0.1, 1.0])),
        offset=float(random.choice([0.0, 40.0, 50_000.0])),
        raised=raised,
        bias=bias,
        wandering=bias > 0.0 and random.random() < 0.5,
        stuck=float(random.uniform(0.0, flight.race_time)) if bias > 0.0 else math.inf,
    )


def shared_error(draw: LogDraw, time: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return the error of one axis over time that white noise is no model of, m."""
    error = draw.bias * random.standard_normal(len(time))
    kept = np.exp(-np.diff(time) / WANDER) if draw.wandering else np.ones(len(time) - 1)
    for row, share in enumerate(kept.tolist(), start=1):
        error[row] = share * error[row - 1] + math.sqrt(1.0 - share**2) * error[row]
    return error


def log_text(run: Run, draw: LogDraw, random: np.random.Generator) -> str:
    """Return the log as comma-separated values."""
    at, last = sampler(run.inputs.race, run.results[-1]), run.race_time
    flight = run.stages[-1].flight()
    rows = np.arange(draw.begin, last + LEAD, 1.0 / (draw.hz * draw.held))
    fresh = rows[:: draw.held]
    inside, ends = at(np.clip(fresh, 0.0, last)), at(np.array([0.0, EDGE, last - EDGE, last]))
    before, behind = np.minimum(fresh, 0.0), np.maximum(fresh - last, 0.0)
    columns = [np.array([f"{one + draw.offset:.4f}" for one in rows])]
    silent = (rows > draw.gap[0]) & (rows < draw.gap[1])
    for name, sign in (("x", 1.0), ("y", 1.0), ("z", -1.0)):
        first, final = np.diff(ends[name])[[0, -1]] / EDGE
        place = sign * (inside[name] + first * before + final * behind)
        if name == "z" and draw.raised is not None:
            lasting = math.pi * math.sqrt(draw.raised[1] / (2.0 * PULL))
            off = np.minimum(np.abs(fresh - draw.raised[0].time) / lasting, 1.0)
            place = place + draw.raised[1] * np.cos(0.5 * math.pi * off) ** 2
        place = place + draw.noise * random.standard_normal(len(fresh))
        if draw.bias:
            place = place + (1.5 if name == "z" else 1.0) * shared_error(draw, fresh, random)
        whole = np.floor if draw.bias else np.round
        place = whole(place / draw.step) * draw.step if draw.step else place
        written = np.array([f"{one:.4f}" for one in np.repeat(place, draw.held)[: len(rows)]])
        mute = (name == "z") & (rows > draw.mute[0]) & (rows < draw.mute[1])
        columns.append(np.where(mute, "", written))
    recorded = flight.at(np.clip(rows, 0.0, last))
    for name in draw.angles:
        angle = np.degrees(recorded[name])
        angle = np.round(angle / draw.angle_step) * draw.angle_step if draw.angle_step else angle
        columns.append(np.array([f"{one:.4f}" for one in angle]))
    titles = ["time [s]", "north [m]", "east [m]", "height [m]", *(f"{one} [deg]" for one in draw.angles)]
    if math.isfinite(draw.stuck):
        columns.append(
            np.array([f"{one:.3f}" for one in np.interp(np.minimum(rows, draw.stuck), rows, recorded["n_z"])])
        )
        titles.append("load factor [g]")
    head = ",".join(titles)
    return "\n".join([head, *(",".join(row) for row in np.stack(columns)[:, ~silent].T)]) + "\n"


def imported(run: Run, text: str, accuracy: float) -> LogFlight:
    """Return what the import makes of a log."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        path.write_text(text)
        return flight_from_log(
            read_log(path, ColumnLayout(accuracy=accuracy)),
            run.inputs.race,
            label="log",
            penalties=run.inputs.penalties,
        )


def errors(flown: LogFlight, known: Flight, draw: LogDraw) -> Iterator[Mapping[str, float]]:
    """Yield the errors at every passing, in standard deviations, by `QUANTITIES`."""
    lead = draw.begin + flown.offset
    for seen, true in zip(flown.flight.crossings, known.crossings, strict=True):
        if seen.found and seen.name in flown.known and true.passage.element.stands:
            deviations = flown.known[seen.name]
            off = {**_off(seen, true), "time": lead + seen.time - true.time}
            scales = (
                *(deviations.time, deviations.across, deviations.up),
                *(deviations.path, deviations.speed, deviations.bank),
            )
            yield {name: off[name] / scale for name, scale in zip(QUANTITIES, scales, strict=True)}


def _off(seen: TimedCrossing, true: TimedCrossing) -> dict[str, float]:
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


@dataclass
class Count:
    """What is counted over all logs."""

    logs: int = 0
    refused: int = 0
    false: list[str] = field(default_factory=list[str])
    raised: int = 0
    lost: list[str] = field(default_factory=list[str])
    passings: list[Mapping[str, float]] = field(default_factory=list[Mapping[str, float]])

    def take(self, flown: LogFlight, known: Flight, draw: LogDraw, label: str) -> None:
        """Count one log."""
        self.logs += 1
        certain = [one for one in flown.violations if one.certain]
        if draw.raised is None:
            self.false += [f"{label} {one}" for one in certain]
            self.passings += errors(flown, known, draw)
            return
        crossing, by = draw.raised
        window = height_window(crossing.passage.element, 0.0)
        excess = crossing.value("height") + by - window.upper
        if crossing.name in flown.known and excess > 8.0 * flown.known[crossing.name].up:
            self.raised += 1
            if not any((one.passing, one.rule) == (crossing.name, "too-high") for one in certain):
                seen = next(one.value("height") for one in flown.flight.crossings if one.name == crossing.name)
                self.lost.append(f"{label}: seen {seen:.2f} m, +- {flown.known[crossing.name].up:.2f} m")


def main() -> None:
    """Record, import, print."""
    arguments = _arguments()
    runs = [airrace.open(path) for path in arguments.runs]
    flights = [run.stages[-1].flight() for run in runs]
    count = Count()
    for number in range(arguments.logs):
        random = np.random.default_rng((arguments.seed, number))
        which = int(random.integers(len(runs)))
        draw = drawn(random, flights[which], arguments.bias)
        label = f"{number}: {runs[which].name} {draw}"
        try:
            flown = imported(runs[which], log_text(runs[which], draw, random), arguments.bias)
        except InputError as error:
            count.refused += 1
            print(f"{label}: {error}", file=sys.stderr, flush=True)
            continue
        count.take(flown, flights[which], draw, label)
    print("| logs | refused | false certain violations | gates passed too high by 8 deviations | found |")
    print("|---|---|---|---|---|")
    print(
        f"| {count.logs} | {count.refused} | {len(count.false)} | {count.raised} | {count.raised - len(count.lost)} |\n"
    )
    print("| errors, in deviations | within 1 | within 2 | within 5 | greatest |\n|---|---|---|---|---|")
    for name in QUANTITIES:
        values = np.abs([one[name] for one in count.passings])
        shares = " | ".join(f"{100.0 * np.mean(values <= most):.2f} %" for most in (1.0, 2.0, 5.0))
        print(f"| {name} | {shares} | {values.max():.1f} |")
    print("\n".join(["", "false:", *count.false, "", "not found:", *count.lost]))


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN.h5")
    parser.add_argument("--logs", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--bias", type=float, default=0.0, metavar="M")
    return parser.parse_args()


if __name__ == "__main__":
    main()
