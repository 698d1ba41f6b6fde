"""Windows between two gates a few legs apart, flown for the least time with the states at both gates priced."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from airrace.model.frames import product
from airrace.model.track.course import Course
from airrace.optimal_control.problem import Iterate, Problem, StartCost
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.solvers.service import SolverService
from airrace.optimal_control.trajectory import Array
from airrace.procedure.guess import QUATERNION_ROWS, align_quaternions, concatenate, phase_piece
from airrace.procedure.multistart.coarse_solution import (
    CoarseSolution,
    InitialGuess,
    coarse_options,
    finer_guess,
    objective_error,
    try_solve,
)
from airrace.procedure.multistart.gate_prices import PRICE, GatePrice
from airrace.procedure.multistart.moves import MoveGenerator
from airrace.procedure.multistart.search import QUICK
from airrace.procedure.multistart.window import ITERATIONS_MAX
from airrace.procedure.planning.planning_model import PlanningModel
from airrace.procedure.settings import MeshSettings
from airrace.procedure.stage_problem import StageProblem
from airrace.procedure.warm_start import InitialBarrier

Window = tuple[int, int]
"""The passages at which a window begins and ends."""
LEGS_MAX = 3
"""The largest number of legs of a window, from one gate that stands to the next."""


@dataclass(frozen=True, eq=False)
class WindowGuess:
    """Where the solution of a window starts from.

    Attributes:
        stage_problem: with the plan that it follows.
        race: the problem of the whole race, on the mesh that the guess is on within the window.
        iterate: the guess, of the window alone.
        barrier: the first value of the barrier parameter.
    """

    stage_problem: StageProblem
    race: Problem
    iterate: Iterate
    barrier: InitialBarrier


@dataclass(frozen=True, eq=False)
class WindowFlight:
    """A flight through a window.

    Attributes:
        stage_problem, race, iterate: as of a guess.
        seconds: its duration, corrected by its errors of integration, s.
        at_start, at_end: the features of its first and last state, (n_f,); empty at an end of the race.
    """

    stage_problem: StageProblem
    race: Problem
    iterate: Iterate
    seconds: float
    at_start: Array
    at_end: Array

    @property
    def guess(self) -> WindowGuess:
        """The flight as a guess."""
        return WindowGuess(self.stage_problem, self.race, self.iterate, InitialBarrier.PIECES)

    def resembles(self, flight: "WindowFlight", tolerance: float) -> bool:
        """Return whether the features of both flights, and their durations, differ by no more than a tolerance."""
        differences = [self.at_start - flight.at_start, self.at_end - flight.at_end]
        return max(abs(self.seconds - flight.seconds), *(np.abs(d).max(initial=0.0) for d in differences)) <= tolerance


@dataclass(frozen=True, eq=False)
class PricedWindow:
    """A window with the prices at its ends; None at an end of the race."""

    window: Window
    start: GatePrice | None
    end: GatePrice | None

    def time_of(self, flight: WindowFlight) -> float:
        """Return the priced time of a flight, s: its duration, what it pays at its end, less what it is paid before."""
        paid = 0.0 if self.end is None else float(self.end.weights @ flight.at_end)
        return flight.seconds + paid - (0.0 if self.start is None else float(self.start.weights @ flight.at_start))

    def problem(self, race: Problem) -> Problem:
        """Return the window of a race as a problem of its own."""
        first, last = self.window
        start, objective = race.start, replace(race.objective, regularisation={})
        if self.start is not None:
            before, features = race.phases[first - 1].end, self.start.features
            start = replace(before, bounds={**before.bounds, "attitude_norm": Interval.exactly(1.0)})
            cost = StartCost({PRICE: -1.0}, features.observation, tuple(self.start.weights))
            objective = replace(objective, start=cost)
        if self.end is not None:
            observation, weights = self.end.features.observation, tuple(self.end.weights)
            objective = replace(objective, terminal={PRICE: 1.0}, observation=observation, values=weights)
        return replace(race, start=start, phases=race.phases[first:last], objective=objective)

    def flight(self, guess: WindowGuess, iterate: Iterate, seconds: float) -> WindowFlight:
        """Return a flight of a duration (s) that a guess has led to."""
        ends = (self.start, iterate.state[:, 0]), (self.end, iterate.state[:, -1])
        at_start, at_end = (np.zeros(0) if price is None else price.features.at(state) for price, state in ends)
        return WindowFlight(guess.stage_problem, guess.race, iterate, seconds, at_start, at_end)

    def solve(self, service: SolverService, guess: WindowGuess, *, gives_up_early: bool = False) -> WindowFlight | None:
        """Return the flight of least priced time near a guess; None if there is none within the budget."""
        problem = self.problem(guess.race)
        options = coarse_options(guess.barrier, ITERATIONS_MAX, gives_up_early=gives_up_early)
        solution = try_solve(service, problem, guess.iterate, options)
        if solution is None or not solution.success:
            return None
        seconds = float(solution.iterate.durations.sum() + objective_error(problem, solution).sum())
        return self.flight(guess, solution.iterate, seconds) if np.isfinite(seconds) else None


@dataclass(frozen=True, eq=False)
class Prices:
    """The prices at all gates between windows, by passage."""

    at: dict[int, GatePrice]

    @classmethod
    def of(cls, flight: CoarseSolution, gates: Sequence[int]) -> Self:
        """Return the costates of a flight at gates as prices; none at both ends of the race."""
        states, nodes = flight.problem.system.states, flight.problem.first_node
        state, costates = flight.iterate.state, flight.costates
        return cls(
            {
                gate: GatePrice.from_costate(states, state[:, nodes[gate]], costates[:, nodes[gate] - 1])
                for gate in gates[1:-1]
            }
        )

    def window(self, window: Window) -> PricedWindow:
        """Return a window with the prices at its ends."""
        return PricedWindow(window, self.at.get(window[0]), self.at.get(window[1]))

    def with_weights(self, weights: Mapping[int, Array]) -> "Prices":
        """Return the prices with other weights at some gates."""
        changed = {gate: replace(self.at[gate], weights=values) for gate, values in weights.items()}
        return Prices({**self.at, **changed})


def gates_between_windows(course: Course) -> list[int]:
    """Return the passages at which windows may begin and end: those that stand, and both ends of the race."""
    passages, ends = course.passages, (0, len(course.passages) - 1)
    return [index for index, passage in enumerate(passages) if passage.element.stands or index in ends]


def rolled_guesses(guess: WindowGuess) -> list[WindowGuess]:
    """Return guesses that enter a window, leave it or fly all of it rolled by half a turn to either side."""
    share = np.linspace(0.0, 1.0, guess.iterate.state.shape[1])
    angles = [np.full_like(share, np.pi)]
    for ramp in (share, 1.0 - share):
        angles += [np.pi * ramp, -np.pi * ramp]
    guesses: list[WindowGuess] = []
    for angle in angles:
        state = guess.iterate.state.copy()
        none = np.zeros_like(angle)
        turn = [np.cos(angle / 2), np.sin(angle / 2), none, none]
        state[QUATERNION_ROWS] = product(list(state[QUATERNION_ROWS]), turn)
        align_quaternions(state)
        guesses.append(replace(guess, iterate=replace(guess.iterate, state=state), barrier=InitialBarrier.COLD))
    return guesses


@dataclass(frozen=True, eq=False)
class RaceGuess:
    """A flight of the whole race, of which windows are guessed: one piece for each of its phases."""

    stage_problem: StageProblem
    race: Problem
    pieces: Sequence[Iterate]
    barrier: InitialBarrier

    @classmethod
    def of(cls, flight: CoarseSolution | InitialGuess) -> Self:
        """Return what is guessed of a flight, or of a plan."""
        barrier = InitialBarrier.PIECES  # the race with prices is a neighbouring problem
        if isinstance(flight, CoarseSolution):
            race, iterate = flight.problem, flight.iterate
        else:
            race, iterate = flight.stage_problem.problem(flight.mesh), flight.guess
            if flight.barrier is InitialBarrier.COLD:
                barrier = InitialBarrier.COLD
        pieces = [phase_piece(iterate, race, index) for index in range(len(race.phases))]
        return cls(flight.stage_problem, race, pieces, barrier)

    def within(self, window: Window) -> WindowGuess:
        """Return the guess of a window."""
        first, last = window
        return WindowGuess(self.stage_problem, self.race, concatenate(self.pieces[first:last]), self.barrier)


def moved_guesses(
    best: CoarseSolution, course: Course, cruise: PlanningModel, mesh: MeshSettings
) -> list[tuple[int, int, RaceGuess]]:
    """Return a flight with each of the moves around it made, alone, and the passages between which that changes it."""
    generator = MoveGenerator(best, course, QUICK.planning_radius.scale(cruise))
    everywhere = set(range(len(best.problem.phases)))
    counts = [len(phase) for phase in best.problem.mesh]
    guesses: list[tuple[int, int, RaceGuess]] = []
    for move in (*generator.moves(everywhere), *generator.rolls(everywhere)):
        pieces = [phase_piece(best.iterate, best.problem, index) for index in range(len(best.problem.phases))]
        pieces[move.first : move.last] = move.pieces
        start = InitialGuess(move.stage_problem, move.mesh, concatenate(pieces), InitialBarrier.PIECES)
        first, last = move.segment.first, move.segment.last
        if move.own is not None:
            first, last = move.own.start, move.own.stop
        guesses.append((first, last, RaceGuess.of(finer_guess(start, mesh, counts))))
    return guesses
