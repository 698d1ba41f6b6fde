"""Moves to other routes that prices of the state at gates promise to be faster.

The race is cut into windows. With the costates of a flight as prices at the gates between them (`gate_prices`) each
window is solved apart from the rest, from pieces of other guesses. A route whose priced time is below that of the
flight itself is proposed as a move like any other.
"""

import itertools
from collections.abc import Sequence, Set
from dataclasses import replace

from airrace.model.track.course import Course
from airrace.optimal_control.solvers.service import SolverPool, SolverService
from airrace.procedure.guess import concatenate
from airrace.procedure.multistart.coarse_solution import CoarseSolution
from airrace.procedure.multistart.moves import MoveGenerator
from airrace.procedure.multistart.priced_window import (
    LEGS_MAX,
    PricedWindow,
    Prices,
    RaceGuess,
    Window,
    WindowFlight,
    WindowGuess,
    gates_between_windows,
)
from airrace.procedure.multistart.search import SAVED_MIN
from airrace.procedure.multistart.segments import differing
from airrace.procedure.multistart.window import Move


def priced_moves(
    generator: MoveGenerator, changed: Set[int], guesses: Sequence[RaceGuess], course: Course, pool: SolverPool
) -> list[Move]:
    """Return a move for each window through which prices promise another route to be faster.

    Args:
        generator: of moves around the flight.
        changed: numbers of the phases that have changed; windows without any are left out.
        guesses: of the whole race, from which windows are solved.
        course: that is flown.
        pool: what solves.
    """
    base = generator.base
    base_guess, phase_seconds = RaceGuess.of(base), base.iterate.durations + base.error_penalty
    windows: list[PricedWindow] = []
    for priced in _even_windows(base, course):
        if not changed.isdisjoint(range(*priced.window)):
            windows.append(priced)
    jobs = [(priced, guess.within(priced.window)) for guess in guesses for priced in windows]
    promising: dict[Window, tuple[PricedWindow, WindowFlight]] = {}  # the flight of least priced time
    for (priced, _), flight in zip(jobs, pool.work(jobs, _solve_window), strict=True):
        if flight is None:
            continue
        if priced.window in promising:
            least = priced.time_of(promising[priced.window][1])
        else:
            own, seconds = base_guess.within(priced.window), float(phase_seconds[slice(*priced.window)].sum())
            least = priced.time_of(priced.flight(own, own.iterate, seconds)) - SAVED_MIN
        if priced.time_of(flight) < least:
            promising[priced.window] = priced, flight
    # Prices that are linear in the state promise too much, but to the flight's own piece as well: what is not below
    # that, solved at the same prices, is no other route.
    jobs = [(priced, base_guess.within(priced.window)) for priced, _ in promising.values()]
    moves: list[Move] = []
    for (priced, flight), own_flight in zip(promising.values(), pool.work(jobs, _solve_window), strict=True):
        if own_flight is not None and priced.time_of(flight) >= priced.time_of(own_flight) - SAVED_MIN:
            continue
        through_window = _through_window(base, base_guess, flight, priced.window)
        segments = differing(base, through_window, generator.segments)
        if segments:
            group = generator.segments[segments[0].number : segments[-1].number + 1]
            moves.append(generator.from_flight(through_window, group, "priced window"))
    return moves


def _even_windows(base: CoarseSolution, course: Course) -> list[PricedWindow]:
    """Return windows of as many legs as they may have, end to end; none that would be the whole race."""
    gates = gates_between_windows(course)
    ends = [*gates[:-1:LEGS_MAX], gates[-1]]
    prices = Prices.of(base, gates)
    return [prices.window(window) for window in itertools.pairwise(ends)] if len(ends) > 2 else []


def _solve_window(service: SolverService, job: tuple[PricedWindow, WindowGuess]) -> WindowFlight | None:
    priced, guess = job
    return priced.solve(service, guess, gives_up_early=True)


def _through_window(
    base: CoarseSolution, base_guess: RaceGuess, flight: WindowFlight, window: Window
) -> CoarseSolution:
    """Return a flight that goes through a window as another one does; it jumps at both ends and is no optimum."""
    first, last = window
    mesh, pieces = base.problem.mesh, list(base_guess.pieces)
    mesh[first:last] = flight.race.mesh[first:last]
    if last < len(pieces):  # the state at the end is that in which the gate is crossed now
        state = pieces[last].state.copy()
        state[:, 0] = flight.iterate.state[:, -1]
        pieces[last] = replace(pieces[last], state=state)
    iterate = concatenate([*pieces[:first], flight.iterate, *pieces[last:]])
    return replace(base, problem=base.stage_problem.problem(mesh), iterate=iterate)
