"""The Monte Carlo simulation of closed-loop flights along an optimum, batch by batch on threads.

Its results are counts with confidence intervals, and the scatter at every gate and on every leg.
"""

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from scipy.special import betaincinv

from airrace.errors import OutOfTime, UsageError
from airrace.flights.results.penalties import NONE_KNOWN, Penalties
from airrace.flights.safety.closed_loop import UNDISTURBED_ERROR_MAX, ClosedLoop, batches, fly
from airrace.flights.safety.covariance import covariance
from airrace.flights.safety.disturbances import UNDISTURBED, Scatter
from airrace.flights.safety.impacts import Fallen, Stretches, fall, fallen_together, targets_of
from airrace.flights.safety.judge import (
    LENGTH_ALLOWED,
    Booleans,
    FlightMeasurements,
    Judge,
    Thing,
    axis_of,
    grid_of,
    measure,
    onto_plane,
    together,
)
from airrace.flights.safety.nominal import ERRORS, NominalFlight, gradients
from airrace.flights.safety.over_g import LoadRule
from airrace.flights.safety.pilot import PilotModel
from airrace.flights.safety.plant import CONTROLS, DisturbedPlant
from airrace.flights.safety.replanning import JOBS, Replanning
from airrace.model.frames import rotation
from airrace.optimal_control.trajectory import Array
from airrace.procedure.result import StageResult
from airrace.procedure.stage import Stage
from airrace.race import Race
from airrace.runtime.process import available_cores

Watch = Callable[[int, int, int], None]
"""Is told how many flights are flown, of how many, and how many of these break a rule."""


def unwatched(done: int, total: int, broken: int) -> None:
    """Tell nobody."""


CONFIDENCE = 0.95
"""The confidence of intervals of counts."""
SHARES = (0.95, 0.997)
"""The shares of flights whose deviations are reported."""


def fewest(share: float) -> int:
    """Return the smallest number of flights of which one is expected beyond a quantile: fewer give no estimate."""
    return math.ceil(1.0 / min(share, 1.0 - share) - 1e-6)


QUANTITIES = ("lateral", "height", "bank", "load_factor")
"""The deviations that are reported; m, m, rad, g."""
CONTACT = ("pylon", "ground", "missed", "lost")
"""The kinds of breaches that end a race and may hurt people."""
LOAD = "load factor"
"""The kind of breach that is counted apart: beyond the limit for however short a time."""
OVER_G = "over-g"
"""The kind of breach of pulls that count by the rules; see `airrace.flights.safety.over_g`."""


@dataclass(frozen=True)
class Count:
    """How many flights of all did something, and between which shares their probability lies.

    Attributes:
        flights, of: the flights that did, and all.
        lower, upper: the interval of Clopper & Pearson (1934) with a confidence of 95 %.
    """

    flights: int
    of: int
    lower: float
    upper: float

    @classmethod
    def with_interval(cls, flights: int, of: int) -> "Count":
        """Return a count with its interval."""
        tail = 0.5 * (1.0 - CONFIDENCE)
        lower = float(betaincinv(flights, of - flights + 1, tail)) if flights else 0.0
        upper = float(betaincinv(flights + 1, of - flights, 1.0 - tail)) if flights < of else 1.0
        return cls(flights, of, lower, upper)

    @property
    def share(self) -> float:
        """The share of the flights."""
        return self.flights / self.of


@dataclass(frozen=True)
class Nearness:
    """How near flights come to one thing.

    Attributes:
        thing: from which the distance is measured.
        least: that of all flights, m.
        kept: the distance that 99.7 % of them keep, m; NaN of too few flights, see `fewest`.
        nearer: the flights that come too near.
    """

    thing: Thing
    least: float
    kept: float
    nearer: Count

    @classmethod
    def from_distances(cls, thing: Thing, distances: Array, nearer: Booleans) -> "Nearness":
        """Return that of the least distances of all flights, m, and of those that come too near, each of shape (n,)."""
        count, kept = len(distances), np.nan
        if count >= fewest(SHARES[1]):
            kept = float(np.sort(distances)[math.floor((1.0 - SHARES[1]) * count + 1e-9)])
        return cls(thing, float(distances.min()), kept, Count.with_interval(int(nearer.sum()), count))


@dataclass(frozen=True)
class Deviation:
    """How far one quantity deviates from the optimum.

    Attributes:
        mean: of all flights.
        quantiles: of the absolute deviation, for `SHARES`; NaN of too few flights, see `fewest`.
        linear: standard deviation by the linear covariance; NaN where it is not known, as of replanned lines.
    """

    mean: float
    quantiles: tuple[float, ...]
    linear: float = np.nan


@dataclass(frozen=True)
class Stretch:
    """A gate, or a leg.

    Attributes:
        name: of the passage, or of that in which the leg ends.
        deviations: by the names in `QUANTITIES`, and `time` (s) at gates; the largest of a leg.
        breaches: counts by kind, at gates; only kinds that occur.
    """

    name: str
    deviations: Mapping[str, Deviation]
    breaches: Mapping[str, Count]


@dataclass(frozen=True, eq=False)
class SafetyResult:
    """Closed-loop flights along one optimum.

    Attributes:
        scatter, pilot, seed, flights: what was simulated, and how often.
        asked: how many flights were asked for; more than `flights` where the time was over before.
        race_time: of the optimum, s.
        counts: by kind: `pylon` (the wing touches one), `ground` (a wing tip does), `missed`, `clearance`, `height`,
            `bank`, `course`, `climb`, `speed`, `tolerance` at gates; `flight clearance` (of the wing at any time),
            `floor`, `ceiling`, `crowd`, `safety line`, `airspace`; `lost`; `load factor`, beyond its limit however
            short; `over-g`, by the rules.
        contact: flights that touch a pylon or the ground, miss a gate or are lost.
        outside: flights that break anything but the load factor.
        broken: flights that break anything, over-g included.
        load_rule: the pulls that count as over-g; `pulls`, how many there are in all flights together.
        gates, legs: the scatter; over-g is among the breaches of legs.
        distances: from people, lines, border, obstacles and the ground; too near is nearer than the course allows, by
            more than what is not counted.
        impacts: distances of falls from people, lines and border, half the span taken off; too near is on people, and
            beyond a line or the border. Empty where flights were not let fall.
        stretches: what these falls sweep over, flight by flight.
        pylons: flights that touch each pylon, and the least distance of any, m, by its name.
        race_times: of the flights, s, NaN where one does not finish; shape (n,).
        clock, envelope: the grid of the clock, s, shape (m,), and on it the quantiles 0.0015, 0.025, 0.5, 0.975 and
            0.9985 of lateral (m), height (m), bank (rad) and load factor (g), shape (5, 4, m); NaN of too few flights.
    """

    scatter: Scatter
    pilot: PilotModel
    seed: int
    flights: int
    asked: int
    race_time: float
    counts: Mapping[str, Count]
    contact: Count
    outside: Count
    broken: Count
    load_rule: LoadRule
    pulls: int
    distances: tuple[Nearness, ...]
    gates: tuple[Stretch, ...]
    legs: tuple[Stretch, ...]
    pylons: Mapping[str, tuple[Count, float]]
    race_times: Array
    clock: Array
    envelope: Array
    impacts: tuple[Nearness, ...] = ()
    stretches: tuple[Stretches, ...] = ()

    @property
    def note(self) -> str:
        """A sentence where the pilot cannot hold the optimum; else empty."""
        lost = self.counts["lost"]
        if lost.share <= 0.5:
            return ""
        return (
            f"a pilot with a delay of {self.pilot.delay:g} s cannot hold this optimum: {lost.flights} of {lost.of} "
            "flights lose the line; a shorter delay, milder gusts or a line with more reserve would help"
        )


ENVELOPE = (0.0015, 0.025, 0.5, 0.975, 0.9985)


def gate_stretches(names: Sequence[str], measured: FlightMeasurements, linear: Array) -> Iterator[Stretch]:
    """Yield the scatter at every passage.

    Args:
        names: of the passages.
        measured: of all flights.
        linear: standard deviations by the linear covariance, shape (passages, 5).
    """
    count = len(measured.lost)
    for number, name in enumerate(names):
        rows = dict(zip((*QUANTITIES, "time"), zip(measured.crossed[number], linear[number], strict=True), strict=True))
        broken = {kind: int(breach[number].sum()) for kind, breach in measured.breaches.items()}
        yield Stretch(
            name,
            {key: _deviation(values, float(sigma)) for key, (values, sigma) in rows.items()},
            {kind: Count.with_interval(breaches, count) for kind, breaches in broken.items() if breaches},
        )


def leg_stretches(
    names: Sequence[str], passing_times: Array, clock: Array, measured: FlightMeasurements
) -> Iterator[Stretch]:
    """Yield the largest scatter on every leg: of each quantity that at the worst place of the grid."""
    for number, name in enumerate(names[1:]):
        inside = (clock >= passing_times[number]) & (clock <= passing_times[number + 1])
        rows = measured.deviations[:, inside]
        pulled = measured.pulls[number + 1] > 0
        breaches = {OVER_G: Count.with_interval(int(pulled.sum()), len(pulled))} if pulled.any() else {}
        yield Stretch(name, {key: _worst(values) for key, values in zip(QUANTITIES, rows, strict=True)}, breaches)


def _deviation(values: Array, linear: float) -> Deviation:
    finite = values[np.isfinite(values)]
    if not len(finite):
        return Deviation(np.nan, (np.nan,) * len(SHARES), linear)
    return Deviation(float(finite.mean()), tuple(float(_quantile(np.abs(finite), share)) for share in SHARES), linear)


def _worst(values: Array) -> Deviation:
    """Return the deviation at the place where most flights are farthest off; values of shape (m, n)."""
    widest = [_quantile(np.abs(values), share) for share in SHARES]
    if not np.isfinite(widest[0]).any():
        return Deviation(np.nan, (np.nan,) * len(SHARES))
    row = int(np.nanargmax(widest[0]))
    finite = values[row][np.isfinite(values[row])]
    return Deviation(float(finite.mean()), tuple(_largest(quantile) for quantile in widest))


def _largest(values: Array) -> float:
    return float(np.max(values, initial=-np.inf, where=np.isfinite(values))) if np.isfinite(values).any() else np.nan


def _quantile(values: Array, share: float) -> Array:
    """Return a quantile over the flights, the last axis; those that are lost do not count, and too few are NaN."""
    count = np.isfinite(values).sum(axis=-1)
    ordered = np.sort(values, axis=-1)  # NaN last
    place = share * np.maximum(count - 1, 0)
    low = np.floor(place).astype(np.int64)
    high = np.minimum(low + 1, np.maximum(count - 1, 0))
    first, last = (np.take_along_axis(ordered, index[..., None], axis=-1)[..., 0] for index in (low, high))
    return np.where(count < fewest(share), np.nan, first + (place - low) * (last - first))


MOST_FLIGHTS = 1_000_000
"""The largest number of flights; more take hours, and the error of the model exceeds their interval."""


def closed_loop_of(race: Race, result: StageResult, pilot: PilotModel) -> ClosedLoop:
    """Train a pilot for the optimum of a stage.

    Raises:
        UsageError: the stage is not six-dof or found no flight, the delay is none, or the pilot cannot hold the optimum
            even undisturbed.
    """
    if result.stage is not Stage.SIX_DOF or not result.is_flight:
        raise UsageError(
            f"closed-loop flights follow an optimum of six-dof; this is {result.stage.value}, {result.status.value}: "
            "airrace resume goes on to six-dof"
        )
    if not 0.0 <= pilot.delay <= 1.0:
        raise UsageError(
            f"a delay of {pilot.delay:g} s is out of range: it must lie between 0 and 1 s; people have 0.1 to 0.3"
        )
    if abs(pilot.delay - pilot.waiting * pilot.sample) > 1e-9:
        below = math.floor(pilot.delay / pilot.sample)
        raise UsageError(
            f"a delay of {pilot.delay:g} s cannot be simulated: the pilot decides every {pilot.sample:g} s, so it must "
            f"be {below * pilot.sample:g} or {(below + 1) * pilot.sample:g} s"
        )
    plant = DisturbedPlant.from_race(race)
    loop = ClosedLoop.of(plant, NominalFlight.from_optimum(race, result, plant), pilot)
    undisturbed = fly(loop, UNDISTURBED, 0, [0])
    distances = np.linalg.norm(undisturbed.error[:, :3, 0], axis=1)
    beyond = np.flatnonzero(distances > UNDISTURBED_ERROR_MAX)
    if not len(beyond) and undisturbed.lost[0] < len(undisturbed.clock):
        raise UsageError(
            "this optimum cannot be followed in closed loop: even undisturbed the flight has no finite state at "
            f"{undisturbed.sample * undisturbed.lost[0]:.1f} s"
        )
    if len(beyond):
        when = float(undisturbed.clock[beyond[0], 0])
        raise UsageError(
            f"a pilot with a delay of {pilot.delay:g} s cannot hold this optimum: even undisturbed the flight is more "
            f"than {UNDISTURBED_ERROR_MAX:g} m off it at {when:.1f} s"
        )
    return loop


def fly_closed_loop(
    race: Race,
    result: StageResult,
    *,
    flights: int = 1000,
    scatter: Scatter | None = None,
    pilot: PilotModel | None = None,
    seed: int = 0,
    threads: int | None = None,
    replanning: Replanning | None = None,
    penalties: Penalties = NONE_KNOWN,
    falls: bool = False,
    watch: Watch = unwatched,
    until: float = math.inf,
) -> SafetyResult:
    """Fly a stage's optimum many times; measure how far the flights deviate and what they break.

    Args:
        race: course, aircraft and air.
        result: its stage six-dof.
        flights: how many.
        scatter: the disturbances; None for the defaults.
        pilot: the model of the pilot; None for the defaults.
        seed: of all flights; flight k is the same for any number of flights.
        threads: None for one per processor.
        replanning: of the line that is followed, by threads of its own; None where it is the optimum all along.
        penalties: of the season, by which over-g is counted.
        falls: whether all flights are let fall, too.
        watch: is told how far it is, batch by batch.
        until: the time of the monotonic clock, s, after which no further batch begins; the first one always does.
            Batches of replanned lines take long: these are small, and end with the time of `replanning`.

    Raises:
        OutOfTime: lines are replanned, and the time was over before any flight was at its end.
        UsageError: the stage is not six-dof or found no flight, or an argument is out of range.
        SolverCrash: a solver process died.
    """
    if not 1 <= flights <= MOST_FLIGHTS:
        raise UsageError(f"{flights} flights are out of range: it must be 1 to {MOST_FLIGHTS}")
    race, scatter = race.by_rules, scatter or Scatter()
    loop = closed_loop_of(race, result, pilot or PilotModel())
    judge = Judge.from_optimum(race, result, loop, penalties)

    def run_batch(numbers: range) -> tuple[FlightMeasurements, Fallen | None] | None:
        if numbers.start and time.monotonic() > until:
            return None
        try:
            flown = fly(loop, scatter, seed, numbers, replanning)
        except OutOfTime:
            return None
        return measure(judge, loop, flown), fall(race, loop, flown) if falls else None

    parts: list[tuple[FlightMeasurements, Fallen | None]] = []
    asked, failed = flights, 0
    all_numbers = batches(asked, JOBS) if replanning else batches(asked)
    with ThreadPoolExecutor(1 if replanning else threads or available_cores()) as pool:
        watch(0, asked, 0)
        try:
            for numbers, part in zip(all_numbers, pool.map(run_batch, all_numbers), strict=True):
                if part is None:
                    break
                parts.append(part)
                flights, failed = numbers.stop, failed + int(_broken(_breaches(part[0])).sum())
                watch(flights, asked, failed)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)  # nobody waits for what is left
            raise
    if not parts:
        raise OutOfTime("the time was over before any flight was at its end")
    measured = together([part for part, _ in parts])
    fallen = fallen_together([part for _, part in parts if part is not None])
    names = [passage.name for passage in race.course.passages]
    breaches = _breaches(measured)
    contact = np.logical_or.reduce([breaches[kind] for kind in CONTACT])
    outside = np.logical_or.reduce([breach for kind, breach in breaches.items() if kind not in (LOAD, OVER_G)])
    clock, passing_times = grid_of(loop.nominal), loop.nominal.passing_times
    linear = np.full((len(names), 5), np.nan) if replanning else linear_at_passings(loop, judge, scatter)
    with np.errstate(all="ignore"):
        envelope = np.stack([_quantile(measured.deviations, share) for share in ENVELOPE])
    return SafetyResult(
        scatter=scatter,
        pilot=loop.pilot,
        seed=seed,
        flights=flights,
        asked=asked,
        race_time=result.trajectory.race_time,
        counts={kind: Count.with_interval(int(breach.sum()), flights) for kind, breach in breaches.items()},
        contact=Count.with_interval(int(contact.sum()), flights),
        outside=Count.with_interval(int(outside.sum()), flights),
        broken=Count.with_interval(int(_broken(breaches).sum()), flights),
        load_rule=judge.load_rule,
        pulls=int(measured.pulls.sum()),
        distances=tuple(
            Nearness.from_distances(thing, distances, distances < thing.required - LENGTH_ALLOWED)
            for thing, distances in zip(judge.things, measured.distances, strict=True)
        ),
        impacts=tuple(
            Nearness.from_distances(thing, distances, distances <= 0.0 if thing.kind == "crowd" else distances < 0.0)
            for thing, distances in zip(targets_of(race) if falls else (), fallen.distances, strict=True)
        ),
        stretches=fallen.stretches,
        gates=tuple(gate_stretches(names, measured, linear)),
        legs=tuple(leg_stretches(names, passing_times, clock, measured)),
        pylons={
            f"{pylon.text}, {pylon.post + 1}": (Count.with_interval(int(touched.sum()), flights), float(nearest.min()))
            for pylon, touched, nearest in zip(judge.pylons, measured.touched, measured.nearest, strict=True)
        },
        race_times=passing_times[-1] + measured.crossed[-1, -1],
        clock=clock,
        envelope=envelope,
    )


def _breaches(measured: FlightMeasurements) -> dict[str, Booleans]:
    """Return which flights break what, by kind, each of shape (n,)."""
    return {
        "pylon": np.asarray(measured.touched.any(axis=0)),
        **{kind: np.asarray(breach.any(axis=0)) for kind, breach in measured.breaches.items()},
        **measured.along,
        "lost": measured.lost,
        OVER_G: np.asarray(measured.pulls.any(axis=0)),
    }


def _broken(breaches: Mapping[str, Booleans]) -> Booleans:
    """Return which flights break anything; a load factor beyond its limit is over-g where it counts."""
    return np.asarray(np.logical_or.reduce([breach for kind, breach in breaches.items() if kind != LOAD]))


def linear_at_passings(loop: ClosedLoop, judge: Judge, scatter: Scatter) -> Array:
    """Return standard deviations of lateral, height, bank, load factor and time at every passage, shape (n, 5).

    An error at the clock of the passage is carried along the flow to the plane of the gate; where none stands it is
    measured at that clock, and so are flights.
    """
    P, nominal, plant = covariance(loop, scatter), loop.nominal, loop.plant
    size, count, row = P.shape[1], len(ERRORS), plant.path_row("n_z")
    clock = np.minimum(np.rint(nominal.passing_times / loop.pilot.sample).astype(np.int64), len(P) - 1)
    sigma = np.zeros((len(clock), 5))

    def load(x: Array, d: Array) -> Array:
        return plant.path_of(np.concatenate([np.zeros((CONTROLS, x.shape[1])), d]))(x)[[row]]

    for number, (boundary, k) in enumerate(zip(judge.boundaries, clock.tolist(), strict=True)):
        line = nominal.at(nominal.passing_times[number : number + 1])
        line[4:8] /= np.linalg.norm(line[4:8], axis=0)
        onto, sooner = onto_plane(nominal, boundary, number, line)
        away = np.array(
            rotation([float(component) for component in line[4:8, 0]])
        )  # north, east, down per error of position
        axis = axis_of(boundary, line)
        J = np.zeros((5, size))
        J[0, :count] = (axis[0] * away[1] - axis[1] * away[0]) @ onto[:3]
        J[1, :count] = -away[2] @ onto[:3]
        J[2, :count] = onto[4]
        J[3, :-1] = gradients(load, line)[0, 0]
        J[3, :count] = J[3, :count] @ onto
        J[4, -1] = 1.0
        J[4, :3] -= sooner
        sigma[number] = np.sqrt(np.maximum(np.diag(J @ P[k] @ J.T), 0.0))
    return sigma
