"""Closed-loop flights: a pilot flies the aircraft along its optimum, many flights at once, each disturbed otherwise.

Every sample, for all flights of a batch: the clock at which each is abeam of the line, its error there, the decision
of the pilot, and the stick that was decided `delay` before, within its travel and its rate; gusts are held meanwhile,
and one step of the classical scheme advances the aircraft. The stick of the optimum is part of what is decided, for the
place where the pilot will be then, so what the rates do not allow never happens.

What the pilot follows is the optimum, or, where lines are replanned, a line of the flight's own, see `replanning.py`.
What is recorded refers to the optimum in either case.

Flight k draws from a generator of its own, seeded by (seed, k), and no arithmetic mixes flights: it is the same bit by
bit for any number of flights, batches and threads.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airrace.flights.safety.disturbances import Gusts, Scatter
from airrace.flights.safety.nominal import PATH, NominalFlight, abeam, entries, errors, instants
from airrace.flights.safety.pilot import LinearFlight, PilotGains, PilotModel, linearise, train
from airrace.flights.safety.plant import CONTROLS, DISTURBANCES, STATE, DisturbedPlant, GustFilter, advance
from airrace.flights.safety.replanning import ReplannedLines, Replanning
from airrace.optimal_control.trajectory import Array

BATCH = 125
"""Flights at once. With fewer the overhead of Python counts, with more the memory for their histories."""
LATE = 1.15
"""The time after which a flight must have come in, as a share of the optimum's."""
LOST = 100.0
"""The distance from the line beyond which a flight is lost, m: no pilot comes back to a gate from there."""
UNDISTURBED_ERROR_MAX = 1.0
"""The largest distance of the undisturbed flight from the line of a pilot who holds it, m."""
KEPT = STATE["beta_K"] + 1
"""The number of the first states of a flight that are recorded: those that place its wing."""
SURFACES = slice(STATE["eta"], STATE["zeta"] + 1)
"""The rows of the deflections, whose rates are the first controls in this order."""
AILERONS = 1
"""The control that is the rate of the ailerons."""


@dataclass(frozen=True)
class ClosedLoop:
    """All that closed-loop flights along one optimum need.

    Attributes:
        plant: the aircraft.
        nominal: the optimum.
        linear: the aircraft linearised along it.
        pilot, gains: the controller.
    """

    plant: DisturbedPlant
    nominal: NominalFlight
    linear: LinearFlight
    pilot: PilotModel
    gains: PilotGains

    @classmethod
    def of(cls, plant: DisturbedPlant, nominal: NominalFlight, pilot: PilotModel) -> "ClosedLoop":
        """Train a pilot for an optimum."""
        linear = linearise(plant, nominal, pilot.sample)
        return cls(plant, nominal, linear, pilot, train(pilot, linear))

    @property
    def leg_middles(self) -> Array:
        """The clock in the middle of every leg, s."""
        return 0.5 * (self.nominal.passing_times[1:] + self.nominal.passing_times[:-1])

    @property
    def samples(self) -> int:
        """The number of samples after which flights are ended."""
        return int(LATE * self.nominal.end / self.pilot.sample) + 1

    def gust_filter(self, gusts: Gusts, samples: int) -> GustFilter:
        """Return the gusts along the optimum; behind its end they go on as there."""
        line = self.nominal.at(instants(self.pilot.sample, samples))
        return GustFilter.of(gusts, -line[STATE["z"]], self.plant.airspeed_of(line), self.pilot.sample)


@dataclass(frozen=True, eq=False)
class Flights:
    """Closed-loop flights, sample by sample; n flights of up to K samples.

    Attributes:
        sample: time between samples, s.
        state: the first states, down to the sideslip, shape (K, 11, n); a lost flight rests on the line.
        clock: of the line, s; shape (K, n).
        error: those of the path, shape (K, 7, n).
        load: load factor, g; shape (K, n).
        lost: first sample at which a flight was lost, or had no finite state, K where it never was; shape (n,).
    """

    sample: float
    state: Array
    clock: Array
    error: Array
    load: Array
    lost: NDArray[np.int64]


def batches(count: int, size: int = BATCH) -> list[range]:
    """Return the numbers of so many flights, batch by batch of a size."""
    return [range(first, min(first + size, count)) for first in range(0, count, size)]


def fly(
    loop: ClosedLoop, scatter: Scatter, seed: int, numbers: Sequence[int], replanning: Replanning | None = None
) -> Flights:
    """Fly the flights of these numbers.

    Args:
        loop: aircraft, line and pilot.
        scatter: how they are disturbed.
        seed: of all flights.
        numbers: of the flights; the same number is the same flight in every batch.
        replanning: of the line; None where it is the optimum all along.

    Raises:
        OutOfTime: lines are replanned, and their time was over.
        SolverCrash: a solver process died.
    """
    return _Batch(loop, scatter, seed, numbers).fly(replanning)


@dataclass(frozen=True, eq=False)
class _Reference:
    """What pilots follow at a sample; n flights.

    Attributes:
        line, feedback: one for all flights, or one for each.
        clock: of the line, s; shape (n,).
        state: of the line there, shape (17, n).
        error: of the flights, shape (16, n).
    """

    line: NominalFlight
    feedback: Array
    clock: Array
    state: Array
    error: Array


class _Batch:
    """Some flights, side by side."""

    def __init__(self, loop: ClosedLoop, scatter: Scatter, seed: int, numbers: Sequence[int]) -> None:
        self.loop, self.count = loop, len(numbers)
        generators = [np.random.default_rng([seed, number]) for number in numbers]
        middles = loop.leg_middles
        samples = np.stack([generator.standard_normal(DISTURBANCES + len(middles)) for generator in generators], axis=1)
        self.constant = np.array(scatter.constant)[:, None] * samples[:DISTURBANCES]
        lateness = scatter.timing * samples[DISTURBANCES:]
        grid = instants(loop.pilot.sample, loop.linear.count + 2)
        self.late = np.stack(
            [np.asarray(np.interp(grid, middles, leg_lateness), np.float64) for leg_lateness in lateness.T], axis=1
        )
        """By how much ailerons are late on the samples of the clock, shape (N + 2, n), s."""
        self.gusts = None
        if scatter.gusts is not Gusts.NONE:
            self.gusts = loop.gust_filter(scatter.gusts, loop.samples).draw(generators)
        self.inputs = np.zeros((CONTROLS + DISTURBANCES, self.count))
        self.rates, self.path = loop.plant.rates_of(self.inputs), loop.plant.path_of(self.inputs)
        bounds = loop.plant.system
        self.lower, self.upper = (
            np.array([[getattr(control, end)] for control in bounds.controls]) for end in ("lower", "upper")
        )
        self.travel = tuple(
            np.array([[getattr(surface, end)] for surface in bounds.states[SURFACES]]) for end in ("lower", "upper")
        )
        self.alpha = bounds.path[loop.plant.path_row("alpha_A")]
        self.alpha_row, self.load_row = loop.plant.path_row("alpha_A"), loop.plant.path_row("n_z")

    def fly(self, replanning: Replanning | None) -> Flights:
        loop, pilot, nominal = self.loop, self.loop.pilot, self.loop.nominal
        waiting, n, samples = pilot.waiting, self.count, loop.samples
        x = np.repeat(nominal.at(np.zeros(1)), n, axis=1)
        clock, lost = np.zeros(n), np.full(n, samples)
        ahead = instants(pilot.sample, waiting)
        stick = np.repeat(np.moveaxis(nominal.stick(ahead, pilot.sample), 1, 0)[:, :, None], n, axis=2)
        corrections = np.zeros((waiting, CONTROLS, n))
        replanned = None
        if replanning is not None:
            replanned = ReplannedLines(replanning, loop.plant, nominal, pilot, loop.gains.feedback, n)
        states, path_errors = np.empty((samples, KEPT, n)), np.empty((samples, PATH, n))
        clocks, loads = np.empty((samples, n)), np.empty((samples, n))
        for k in range(samples):
            clock = abeam(nominal, x, clock)
            line = nominal.at(clock)
            e = errors(x, line)
            away = np.sqrt(np.sum(e[:3] * e[:3], axis=0))
            gone = ~(away < LOST)
            finished = clock >= nominal.end
            lost[gone & ~finished] = np.minimum(lost[gone & ~finished], k)
            if (gone | finished).any():
                x, e = np.where(gone | finished, line, x), np.where(gone | finished, 0.0, e)
            self._disturb(k, line)
            path = self.path(x)
            states[k], path_errors[k], clocks[k], loads[k] = x[:KEPT], e[:PATH], clock, path[self.load_row]
            if finished.all():
                samples = k + 1
                break
            reference = _Reference(nominal, loop.gains.feedback, clock, line, e)
            if replanned is not None:
                anew = replanned.replan(k, x, clock, stick, ~(gone | finished) & (lost == len(states)))
                if anew.any():
                    corrections = np.where(anew, stick - replanned.sticks_ahead(), corrections)
                reference = _reference(replanned, x)
            decided, correction = self._decide(reference, x, corrections, path)
            stick, corrections = np.concatenate([stick, decided[None]]), np.concatenate([corrections, correction[None]])
            self._move(stick[0], clock, reference, x)
            x = advance(self.rates, x, pilot.sample)
            broken = ~np.isfinite(x).all(axis=0)
            if broken.any():
                lost[broken], x = np.minimum(lost[broken], k + 1), np.where(broken, line, x)
            clock = clock + pilot.sample * x[3] / line[3]
            if replanned is not None:
                replanned.clock = reference.clock + pilot.sample * x[3] / reference.state[3]
            stick, corrections = stick[1:], corrections[1:]
        cut = slice(samples)
        return Flights(pilot.sample, states[cut], clocks[cut], path_errors[cut], loads[cut], np.minimum(lost, samples))

    def _disturb(self, k: int, line: Array) -> None:
        """Set the disturbances of a sample: what lasts, and the gusts, turned into the course of the line."""
        self.inputs[CONTROLS:] = self.constant
        if self.gusts is not None:
            east, north = course(line)
            u, v, w = self.gusts[min(k, len(self.gusts) - 1)]
            self.inputs[CONTROLS] += north * u - east * v
            self.inputs[CONTROLS + 1] += east * u + north * v
            self.inputs[CONTROLS + 2] += w

    def _decide(self, reference: _Reference, x: Array, corrections: Array, path: Array) -> tuple[Array, Array]:
        """Return the stick decided now, within its limits, and its difference from that of the line."""
        pilot, nominal, clock, e = self.loop.pilot, reference.line, reference.clock, reference.error
        row = np.minimum(np.rint(clock / pilot.sample).astype(np.int64), reference.feedback.shape[-3] - 1)
        feedback = entries(reference.feedback, row, 2)
        limited_error = e.copy()
        limited_error[:3] = np.minimum(np.maximum(e[:3], -pilot.urgent), pilot.urgent)
        observed = np.concatenate([limited_error, corrections.reshape(-1, self.count)])
        *decision, alpha = np.einsum("nij,nj->in", feedback, np.ascontiguousarray(observed.T))
        decision = np.array(decision)
        place_ahead = clock + pilot.delay * x[3] / reference.state[3]
        optimum = nominal.stick(place_ahead, pilot.sample)
        # near the stall the path error commands no further pull; the line's own pull stays, and so does damping
        expected = nominal.at(place_ahead, slice(STATE["alpha_K"], STATE["alpha_K"] + 1))[0]
        turned = path[self.alpha_row] - x[STATE["alpha_K"]]  # by gusts and wind
        alpha = alpha + expected + turned
        commanded = np.sum(
            feedback[:, 0, :PATH] * limited_error[:PATH].T, axis=1
        )  # of the elevator; nose up where negative
        above, below = np.maximum(self.alpha.upper, expected) - alpha, alpha - np.minimum(self.alpha.lower, expected)
        room = np.asarray(np.where(commanded < 0.0, above, below), np.float64)
        decision[0] -= commanded * (1.0 - np.minimum(np.maximum(room / pilot.stall_margin, 0.0), 1.0))
        limited = np.minimum(np.maximum(optimum + decision, self.lower), self.upper)
        return limited, limited - optimum

    def _move(self, stick: Array, clock: Array, reference: _Reference, x: Array) -> None:
        """Set the stick of a sample: ailerons late or early, and nothing beyond the travel of the surfaces."""
        pilot, line = self.loop.pilot, reference.line
        u = self.inputs[:CONTROLS]
        u[:] = stick
        if self.late.any():
            row = np.minimum(np.rint(clock / pilot.sample).astype(np.int64), self.loop.linear.count)
            flight, own = np.arange(self.count), slice(AILERONS, AILERONS + 1)
            end = reference.clock + pilot.sample - self.late[row + 1, flight]
            begin = reference.clock - self.late[row, flight]
            moved = line.moved_to(end, own) - line.moved_to(begin, own)
            u[own] += moved / pilot.sample - line.stick(reference.clock, pilot.sample, own)
        u[:] = np.minimum(np.maximum(u, self.lower), self.upper)
        lower, upper = ((end - x[SURFACES]) / pilot.sample for end in self.travel)
        u[: CONTROLS - 1] = np.minimum(np.maximum(u[: CONTROLS - 1], lower), upper)


def _reference(replanned: ReplannedLines, x: Array) -> _Reference:
    """Return what pilots with lines of their own follow in states (17, n)."""
    clock = abeam(replanned.line, x, replanned.clock)
    state = replanned.line.at(clock)
    return _Reference(replanned.line, replanned.feedback, clock, state, errors(x, state))


def course(line: Array) -> tuple[Array, Array]:
    """Return sine and cosine of the course over ground on the line; north where it is vertical."""
    a, b, c, d = line[4:8]
    north, east = a * a + b * b - c * c - d * d, 2.0 * (b * c + a * d)
    level = np.sqrt(north * north + east * east)
    safe = np.where(level > 1e-9, level, 1.0)
    return np.where(level > 1e-9, east / safe, 0.0), np.where(level > 1e-9, north / safe, 1.0)
