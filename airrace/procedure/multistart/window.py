"""The windows of a flight: a few legs, flown another way, while the rest stays as it is.

A window begins and ends in the states of the flight around it; only the speed at its end is free, at the price that
the costates put on it. So a way is priced in tenths of a second, and what wins fits into the flight.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from airrace.optimal_control.problem import Boundary, Iterate, Problem
from airrace.optimal_control.solvers.process.service import SolverService
from airrace.procedure.attitudes import ROWS as ATTITUDE
from airrace.procedure.homotopy import held
from airrace.procedure.multistart.coarse_solution import (
    CoarseSolution,
    InitialGuess,
    objective_error,
    solve_coarse,
    try_solve,
)
from airrace.procedure.multistart.segments import Segment
from airrace.procedure.phase_segments import joined, phase_piece
from airrace.procedure.stage_problem import Flight
from airrace.procedure.start import InitialBarrier
from airrace.quantities import Interval

ITERATIONS = 70
"""The largest number of iterations of a window.

On Rovinj windows took 18 to 57; on Air Race X those that were lost took half of the time of exploring.
"""
END_SPEED_TRUST = 10.0
"""The largest difference of the speed at the end of a window, m/s; the price of the speed holds nearby."""
COUNTERS = ("Phi", "gain")
"""The states that count rolls; they begin anew where they matter."""
SPEED = "V_K"


@dataclass(frozen=True, eq=False)
class Window:
    """The phases `first ... last - 1` of a flight, to be flown another way.

    Attributes:
        base: the flight.
        flight: with the plan of the other way.
        pieces: a guess, one piece per phase of the window.
    """

    base: CoarseSolution
    first: int
    last: int
    flight: Flight
    pieces: Sequence[Iterate]

    @property
    def phases(self) -> range:
        """The indices of the phases."""
        return range(self.first, self.last)


@dataclass(frozen=True, eq=False)
class EvaluatedMove:
    """A solved window: the flight's way through it, and the time that it saves, s, its errors of integration aside."""

    window: Window
    iterate: Iterate
    problem: Problem
    saved: float

    @property
    def shown(self) -> CoarseSolution:
        """The window as a flight of its own."""
        return replace(self.window.base, problem=self.problem, iterate=self.iterate)

    def inside(self, places: Sequence[Segment]) -> list[tuple[Segment, Segment]]:
        """Return the stretches that lie in the window, as they are numbered in it and in the race."""
        first, last = self.window.first, self.window.last
        within = [one for one in places if first <= one.first and one.last <= last]
        return [(replace(one, first=one.first - first, last=one.last - first), one) for one in within]


def priced(service: SolverService, window: Window, barrier: float = InitialBarrier.COLD) -> EvaluatedMove | None:
    """Return the fastest flight through a window near its guess; None if there is none within the budget.

    Args:
        service: what solves.
        window: the window.
        barrier: the first value of the barrier parameter.
    """
    problem, start, weight = _problem(window)
    solution = try_solve(service, problem, start, barrier, ITERATIONS)
    if solution is None or not solution.success:
        return None
    base, found = window.base, solution.iterate
    speed = [one.name for one in problem.system.states].index(SPEED)
    before = (base.iterate.durations + base.error_penalty)[window.first : window.last].sum()
    after = found.durations.sum() + objective_error(problem, solution).sum()
    last = base.problem.first_node[window.last]
    saved = before - after + weight * (base.iterate.state[speed, last] - found.state[speed, -1])
    return EvaluatedMove(window, found, problem, float(saved)) if math.isfinite(saved) else None


def apply_moves(
    service: SolverService, flight: Flight, base: CoarseSolution, wins: Sequence[EvaluatedMove]
) -> CoarseSolution | None:
    """Optimise the whole flight jointly, with the ways of some windows, which do not overlap.

    Args:
        service: what solves.
        flight: with the plan of all these ways.
        base: the flight into which they are put.
        wins: the windows.
    """
    pieces = [phase_piece(base.iterate, base.problem, index) for index in range(len(base.problem.phases))]
    mesh = base.problem.mesh
    for win in wins:
        for place, index in enumerate(win.window.phases):
            pieces[index] = phase_piece(win.iterate, win.problem, place)
            mesh[index] = win.problem.phases[place].fractions
    return solve_coarse(service, InitialGuess(flight, mesh, joined(pieces), InitialBarrier.COARSE))


def _problem(window: Window) -> tuple[Problem, Iterate, float]:
    """Return the window as a problem of its own, its guess, and the price of the speed at its end, s per m/s."""
    base, first, last = window.base, window.first, window.last
    mesh = base.problem.mesh
    for index, piece in zip(window.phases, window.pieces, strict=True):
        count = piece.control.shape[1]
        mesh[index] = mesh[index] if len(mesh[index]) == count else (1.0 / count,) * count
    whole = window.flight.problem(mesh)
    start = joined(window.pieces)
    begin = whole.start if first == 0 else held(window.flight, base.iterate.state[:, base.problem.first_node[first]])
    phases = whole.phases[first:last]
    if last == len(whole.phases):
        return replace(whole, start=begin, phases=phases), start, 0.0
    node = base.problem.first_node[last]
    names = [one.name for one in whole.system.states]
    weight = float(base.costates[names.index(SPEED), node - 1])
    end = _held_end(names, base.iterate.state[:, node], start)
    objective = replace(whole.objective, terminal={SPEED: weight})
    phases = (*phases[:-1], replace(phases[-1], end=end))
    return replace(whole, start=begin, phases=phases, objective=objective), start, weight


def _held_end(names: Sequence[str], state: np.ndarray, start: Iterate) -> Boundary:
    """Return the boundary that holds the state in which the flight continues behind a window.

    Its quaternion is on the side on which the guess ends. The largest entry of the quaternion follows from the others:
    held as well it would be one condition too many.
    """
    state = state.copy()
    if state[ATTITUDE] @ start.state[ATTITUDE, -1] < 0.0:
        state[ATTITUDE] *= -1.0
    largest = ATTITUDE[int(np.abs(state[ATTITUDE]).argmax())]
    bounds: dict[str, Interval] = {}
    for row, (name, value) in enumerate(zip(names, state.tolist(), strict=True)):
        if name in COUNTERS:
            continue
        if row == largest:
            bounds[name] = Interval(lower=0.0) if value > 0.0 else Interval(upper=0.0)
        elif name == SPEED:
            bounds[name] = Interval(value - END_SPEED_TRUST, value + END_SPEED_TRUST)
        else:
            bounds[name] = Interval.exactly(value)
    return Boundary("", bounds)
