"""Record known flights as recorders do, import them, and print how well the import knows what it says.

    python scripts/experiments/noisy_logs.py RUN.h5 [RUN.h5 ...] [--logs 2000] [--seed 1] [--errors common]

Each run is a checkpoint whose last stage found a flight. A log of one of them is drawn at random: 1 to 50 Hz, numbers
written in steps, positions held over several rows, gaps, heights that are missing, a clock of its own, angles of the
body or none. An optimum breaks no rule, so no violation may be certain. In every second log a gate is passed too high,
too low or aside on purpose: where that is more than five deviations it has to be certain, as a breach of whatever rule
at that passing or at one that belongs to the same manoeuvre.

`--errors` says how positions are off:

- `white`: 0 to 3 m from sample to sample; the accuracy is stated.
- `receiver`: by first-order Gauss-Markov errors of 20 s of a receiver of 0.02, 1, 3 or 8 m, which the log states.
- `common`: all heights by up to 12 m and all places by up to 10 m, and by Gauss-Markov errors of 1.5 m over 20 s;
  nothing is stated.

The first table counts; its last column is the most deviations by which something legal seems to be a breach: with a
lower threshold that would be a false one. The second table holds the errors at all passings, each divided by the standard deviation that the
import tells of it: the shares within one and two of them, and the greatest.
"""

import argparse
import math
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import airrace
from airrace.api.run import Run
from airrace.errors import InputError
from airrace.flights.logs.csv_log import ColumnLayout
from airrace.flights.logs.log_flight import LogFlight, flight_from_log
from airrace.flights.logs.reading import read_log
from airrace.flights.logs.violations import Violation, as_judged, beyond, height_window
from airrace.flights.results import Flight, TimedCrossing
from airrace.optimal_control.quantities import Interval
from airrace.procedure.stored_stages import sampler

LEAD = 4.0
"""The time of straight flight before the start and behind the finish, s."""
EDGE = 1e-3
"""The time within which the speed at an end of the flight is measured, s."""
WANDER = 20.0
"""The time constant of an error that wanders, s."""
VERTICAL = 1.6
"""The ratio of errors of heights to those over ground."""
PULL = 40.0
"""The acceleration with which a gate is passed otherwise, m/s^2."""
STATED = 0.01
"""The accuracy that is stated where all errors are white, m."""
RECEIVERS = (0.02, 1.0, 3.0, 8.0)
"""The standard deviations of receivers, m."""
ANGLES = ("phi", "theta", "psi")
QUANTITIES = ("time", "aside", "height", "path", "speed", "bank")
ERRORS = ("white", "receiver", "common")


@dataclass(frozen=True, repr=False)
class Detour:
    """A passing that is made otherwise: by so many metres upwards or to the right."""

    crossing: TimedCrossing
    up: float = 0.0
    right: float = 0.0

    def __repr__(self) -> str:
        return f"{self.crossing.name} at {self.crossing.time:.1f} s {self.up:+.1f} m up {self.right:+.1f} m right"

    @property
    def size(self) -> float:
        """Its size, m."""
        return abs(self.up) + abs(self.right)

    @property
    def lasting(self) -> float:
        """The time from its begin to the passing, s."""
        return math.pi * math.sqrt(self.size / (2.0 * PULL))


@dataclass(frozen=True, eq=False)
class Optimum:
    """What logs are drawn from: an optimum, read once.

    Attributes:
        run: whose last stage it is.
        flight: its histories and crossings.
        at: its states at times, s.
    """

    run: Run
    flight: Flight
    at: Callable[[np.ndarray], Mapping[str, np.ndarray]]

    @property
    def gates(self) -> list[TimedCrossing]:
        """The passings of what stands and has heights."""
        return [
            crossing
            for crossing in self.flight.crossings
            if crossing.passage.element.stands and math.isfinite(height_window(crossing.passage.element, 0.0).upper)
        ]

    @classmethod
    def of(cls, run: Run) -> "Optimum":
        """Return the optimum of a run."""
        return cls(run, run.stages[-1].flight(), sampler(run.inputs.race, run.results[-1]))


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
        detour: the passing that is made otherwise.
        offset_m: by which all positions are off together, north, east and up, m.
        wander: standard deviation of an error that wanders, m.
        quality: whether the log states that.
        stuck: from when on a recorded load factor stands still, s after the start; infinite without one.
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
    detour: Detour | None
    offset_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    wander: float = 0.0
    quality: bool = False
    stuck: float = math.inf


def drawn(random: np.random.Generator, optimum: Optimum, errors: str) -> LogDraw:
    """Return one way to record a flight."""
    flight, gates = optimum.flight, optimum.gates
    detour = None
    if gates and random.random() < 0.5:
        crossing, size = gates[int(random.integers(len(gates)))], float(random.uniform(1.0, 30.0))
        ways = [{"up": size}, {"up": -0.5 * size}, {"right": size}, {"right": -size}]
        detour = Detour(crossing, **ways[int(random.integers(4))])
    wander = {"white": 0.0, "receiver": float(random.choice(RECEIVERS)), "common": 1.5}[errors]
    offset = tuple(float(random.uniform(-most, most)) for most in (10.0, 10.0, 12.0))
    gap, mute = (float(random.uniform(0.0, flight.race_time)) for _ in range(2))
    hz = float(np.exp(random.uniform(0.0, math.log(50.0))))
    return LogDraw(
        begin=-LEAD + float(random.uniform(0.0, 1.0)) / hz,
        hz=hz,
        noise=float(random.choice([0.0, 0.02, 0.1, 0.3, 1.0, 3.0] if errors == "white" else [0.0, 0.02, 0.1])),
        step=float(random.choice([0.0, 0.0, 0.01, 0.1, 1.0])),
        held=int(random.choice([1, 1, 1, 3, 4])),
        gap=(gap, gap + float(random.choice([0.0, 0.0, 0.3, 1.0, 2.0]))),
        mute=(mute, mute + float(random.choice([0.0, 0.0, 1.0, 5.0]))),
        angles=[(), (), ANGLES, ("phi",)][int(random.integers(4))],
        angle_step=float(random.choice([0.0, 0.1, 1.0])),
        offset=float(random.choice([0.0, 40.0, 50_000.0])),
        detour=detour,
        offset_m=offset if errors == "common" else (0.0, 0.0, 0.0),
        wander=wander,
        quality=errors == "receiver",
        stuck=float(random.uniform(0.0, flight.race_time)) if errors != "white" else math.inf,
    )


def wandering_error(deviation: float, time: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return a Gauss-Markov error over time, m."""
    error = deviation * random.standard_normal(len(time))
    for row, share in enumerate(np.exp(-np.diff(time) / WANDER).tolist(), start=1):
        error[row] = share * error[row - 1] + math.sqrt(1.0 - share**2) * error[row]
    return error


def log_text(optimum: Optimum, draw: LogDraw, random: np.random.Generator) -> str:
    """Return the log as comma-separated values."""
    at, flight, last = optimum.at, optimum.flight, optimum.flight.race_time
    rows = np.arange(draw.begin, last + LEAD, 1.0 / (draw.hz * draw.held))
    fresh = rows[:: draw.held]
    inside, ends = at(np.clip(fresh, 0.0, last)), at(np.array([0.0, EDGE, last - EDGE, last]))
    before, behind = np.minimum(fresh, 0.0), np.maximum(fresh - last, 0.0)
    columns = [np.array([f"{one + draw.offset:.4f}" for one in rows])]
    silent = (rows > draw.gap[0]) & (rows < draw.gap[1])
    for number, (name, sign) in enumerate((("x", 1.0), ("y", 1.0), ("z", -1.0))):
        first, final = np.diff(ends[name])[[0, -1]] / EDGE
        place = sign * (inside[name] + first * before + final * behind)
        if draw.detour is not None:
            chi = draw.detour.crossing.value("chi")
            size = (-draw.detour.right * math.sin(chi), draw.detour.right * math.cos(chi), draw.detour.up)[number]
            off = np.minimum(np.abs(fresh - draw.detour.crossing.time) / draw.detour.lasting, 1.0)
            place = place + size * np.cos(0.5 * math.pi * off) ** 2
        place = place + draw.noise * random.standard_normal(len(fresh)) + draw.offset_m[number]
        place = place + (VERTICAL if name == "z" else 1.0) * wandering_error(draw.wander, fresh, random)
        whole = np.floor if draw.wander else np.round
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
    if draw.quality:
        for title, accuracy in (("hAcc [m]", draw.wander), ("vAcc [m]", VERTICAL * draw.wander)):
            columns.append(np.full(len(rows), f"{accuracy:.3f}"))
            titles.append(title)
    head = ",".join(titles)
    return "\n".join([head, *(",".join(row) for row in np.stack(columns)[:, ~silent].T)]) + "\n"


def imported(run: Run, text: str, accuracy: float | None) -> LogFlight:
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
    breaches: list[tuple[float, bool]] = field(default_factory=list[tuple[float, bool]])
    lost: list[str] = field(default_factory=list[str])
    certain: int = 0
    passings: list[Mapping[str, float]] = field(default_factory=list[Mapping[str, float]])
    nearest: float = 0.0

    def take(self, flown: LogFlight, known: Flight, draw: LogDraw, label: str) -> None:
        """Count one log."""
        self.logs += 1
        if draw.detour is None:
            self._take_legal(flown.violations, label)
            self.passings += errors(flown, known, draw)
            return
        crossing, lasting = draw.detour.crossing, draw.detour.lasting
        times = {passing.name: passing.time for passing in known.crossings}
        at_passings = [violation for violation in flown.violations if violation.passing]
        event = [v for v in at_passings if abs(times[v.passing] - crossing.time) <= lasting + 0.5]
        self._take_legal([violation for violation in at_passings if violation not in event], label)
        breach = true_excess(crossing, draw.detour)
        rules = ("too-high", "too-low") if draw.detour.up else ("pylon", "missed")
        own = [v for v in flown.violations if v.passing == crossing.name and v.rule in rules]
        if not breach or crossing.name not in flown.known:
            return
        judged = [v.deviation for v in own if math.isfinite(v.deviation)]
        told = flown.known[crossing.name].up if draw.detour.up else flown.known[crossing.name].tip
        deviation = min(judged, default=told)
        found = any(v.certain for v in event)
        self.certain += found
        if breach > 5.0 * deviation:
            self.breaches.append((breach / deviation, found))
            if not found:
                values = ", ".join(f"{v.rule} {v.value:.2f} of {v.limit:.2f}, +- {v.deviation:.2f} m" for v in own)
                self.lost.append(f"{label}: {breach:.2f} m, told {told:.2f} m; {values}")

    def _take_legal(self, violations: Sequence[Violation], label: str) -> None:
        """Count what seems to break a rule and does not."""
        self.false += [f"{label} {violation}" for violation in violations if violation.certain]
        self.nearest = max([self.nearest, *(violation.deviations for violation in violations)])


def true_excess(crossing: TimedCrossing, detour: Detour) -> float:
    """Return by how much a passing is beyond its limits with a detour, m."""
    element = crossing.passage.element
    if detour.up:
        return abs(beyond(crossing.value("height") + detour.up, height_window(element, 0.0)))
    chi, half = crossing.value("chi"), 0.5 * getattr(element, "width", math.inf)
    axes = {candidate.axis for candidate in element.crossings(crossing.passage.direction, 0.0, rolling=False)}
    axis = min(axes, key=lambda axis: abs(math.remainder(axis - chi, math.tau)))
    north, east = (crossing.value(name) - place for name, place in zip("xy", element.place or (0.0, 0.0), strict=True))
    right = east * math.cos(axis) - north * math.sin(axis) + detour.right * math.cos(chi - axis)  # nearly
    return abs(beyond(right, as_judged(element).conditions(axis).get("right", Interval(-half, half))))


def main() -> None:
    """Record, import, print."""
    arguments = _arguments()
    optima = [Optimum.of(run) for run in map(airrace.open, arguments.runs)]
    optima = [optimum for optimum in optima if optimum.gates]  # no log shows which course it is of otherwise
    count = Count()
    for number in range(arguments.logs):
        random = np.random.default_rng((arguments.seed, number))
        optimum = optima[int(random.integers(len(optima)))]
        draw = drawn(random, optimum, arguments.errors)
        label = f"{number}: {optimum.run.name} {draw}"
        try:
            flown = imported(
                optimum.run, log_text(optimum, draw, random), STATED if arguments.errors == "white" else None
            )
        except InputError as error:
            count.refused += 1
            print(f"{label}: {error}", file=sys.stderr, flush=True)
            continue
        before = len(count.false), len(count.lost)
        count.take(flown, optimum.flight, draw, label)
        for line in (*count.false[before[0] :], *count.lost[before[1] :]):
            print(line, file=sys.stderr, flush=True)
    print("| logs | refused | false certain violations | certain breaches | breaches by 5 deviations | found |", end="")
    print(" legal at most |\n|---|---|---|---|---|---|---|")
    found = sum(certain for _, certain in count.breaches)
    print(f"| {count.logs} | {count.refused} | {len(count.false)} | {count.certain} | ", end="")
    print(f"{len(count.breaches)} | {found} | {count.nearest:.1f} deviations |\n")
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
    parser.add_argument("--errors", choices=ERRORS, default="white")
    return parser.parse_args()


if __name__ == "__main__":
    main()
