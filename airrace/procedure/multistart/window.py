"""The moves of a search: a few legs of a flight on another route, while the rest stays as it is.

A window around them begins and ends in the states of the flight around it; only the speed at its end is free, weighted
by its costate. So a move is evaluated in tenths of a second, and what is faster fits into the flight.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from airrace.optimal_control.problem import Boundary, Iterate, Problem
from airrace.optimal_control.solvers.process.service import SolverService
from airrace.procedure.homotopy import fixed_state
from airrace.procedure.multistart.coarse_solution import (
    CoarseSolution,
    InitialGuess,
    objective_error,
    solve_coarse,
    try_solve,
)
from airrace.procedure.multistart.segments import Segment
from airrace.procedure.phase_segments import QUATERNION, concatenate, phase_piece
from airrace.procedure.stage_problem import StageProblem
from airrace.procedure.start import InitialBarrier
from airrace.quantities import Interval

ITERATIONS_MAX = 70
"""The largest number of iterations of a window.

On Rovinj windows took 18 to 57; on Air Race X those that failed took half of the time of the search.
"""
END_SPEED_TRUST = 10.0
"""The largest difference of the speed at the end of a window, m/s; its costate holds nearby."""
COUNTERS = ("Phi", "gain")
"""The states that count rolls; they begin anew where they matter."""
SPEED = "V_K"


@dataclass(frozen=True, eq=False)
class Move:
    """Another way to fly the phases `first ... last - 1` of a flight.

    Attributes:
        base: the flight.
        flight: with the plan of the other route.
        pieces: a guess, one piece per phase of the window.
        segment: whose route changes.
        kind: what is different.
        plan_penalty: by how much its plan takes longer than the flight's own, s.
    """

    base: CoarseSolution
    first: int
    last: int
    flight: StageProblem
    pieces: Sequence[Iterate]
    segment: Segment
    kind: str
    plan_penalty: float = 0.0

    @property
    def phases(self) -> range:
        """The indices of the phases."""
        return range(self.first, self.last)


@dataclass(frozen=True, eq=False)
class EvaluatedMove:
    """A solved window: the flight through it, and the time that it saves, s, its errors of integration aside."""

    move: Move
    iterate: Iterate
    problem: Problem
    saved: float

    @property
    def as_solution(self) -> CoarseSolution:
        """The window as a flight of its own."""
        return replace(self.move.base, problem=self.problem, iterate=self.iterate)

    def inside(self, segments: Sequence[Segment]) -> list[tuple[Segment, Segment]]:
        """Return the segments that lie in the window, as they are numbered in it and in the race."""
        first, last = self.move.first, self.move.last
        within = [one for one in segments if first <= one.first and one.last <= last]
        return [(replace(one, first=one.first - first, last=one.last - first), one) for one in within]


def evaluate(service: SolverService, move: Move, barrier: InitialBarrier = InitialBarrier.COLD) -> EvaluatedMove | None:
    """Return the fastest flight through a window near its guess; None if there is none within the budget.

    Args:
        service: what solves.
        move: the window.
        barrier: the first value of the barrier parameter.
    """
    problem, start, speed_costate = _problem(move)
    solution = try_solve(service, problem, start, barrier, ITERATIONS_MAX)
    if solution is None or not solution.success:
        return None
    base, found = move.base, solution.iterate
    speed = [one.name for one in problem.system.states].index(SPEED)
    before = (base.iterate.durations + base.error_penalty)[move.first : move.last].sum()
    after = found.durations.sum() + objective_error(problem, solution).sum()
    last = base.problem.first_node[move.last]
    saved = before - after + speed_costate * (base.iterate.state[speed, last] - found.state[speed, -1])
    return EvaluatedMove(move, found, problem, float(saved)) if math.isfinite(saved) else None


def apply_moves(
    service: SolverService, flight: StageProblem, base: CoarseSolution, moves: Sequence[EvaluatedMove]
) -> CoarseSolution | None:
    """Optimise the whole flight jointly, with some moves made that do not overlap.

    Args:
        service: what solves.
        flight: with the plan of all these moves.
        base: the flight into which they are put.
        moves: solved in their windows.
    """
    pieces = [phase_piece(base.iterate, base.problem, index) for index in range(len(base.problem.phases))]
    mesh = base.problem.mesh
    for one in moves:
        for place, index in enumerate(one.move.phases):
            pieces[index] = phase_piece(one.iterate, one.problem, place)
            mesh[index] = one.problem.phases[place].fractions
    return solve_coarse(service, InitialGuess(flight, mesh, concatenate(pieces), InitialBarrier.COARSE))


def _problem(move: Move) -> tuple[Problem, Iterate, float]:
    """Return the window as a problem of its own, its guess, and the costate of the speed at its end, s per m/s."""
    base, first, last = move.base, move.first, move.last
    mesh, nodes = base.problem.mesh, base.problem.first_node
    for index, piece in zip(move.phases, move.pieces, strict=True):
        count = piece.control.shape[1]
        mesh[index] = mesh[index] if len(mesh[index]) == count else (1.0 / count,) * count
    whole = move.flight.problem(mesh)
    start = concatenate(move.pieces)
    begin = whole.start if first == 0 else fixed_state(move.flight, base.iterate.state[:, nodes[first]])
    phases = whole.phases[first:last]
    if last == len(whole.phases):
        return replace(whole, start=begin, phases=phases), start, 0.0
    names = [one.name for one in whole.system.states]
    costate = float(base.costates[names.index(SPEED), nodes[last] - 1])
    end = _continuation(names, base.iterate.state[:, nodes[last]], start)
    objective = replace(whole.objective, terminal={SPEED: costate})
    phases = (*phases[:-1], replace(phases[-1], end=end))
    return replace(whole, start=begin, phases=phases, objective=objective), start, costate


def _continuation(names: Sequence[str], state: np.ndarray, start: Iterate) -> Boundary:
    """Return the boundary that fixes the state in which the flight continues behind a window.

    Its quaternion is on the side on which the guess ends. The largest entry of the quaternion follows from the others:
    fixed as well it would be one condition too many.
    """
    state = state.copy()
    if state[QUATERNION] @ start.state[QUATERNION, -1] < 0.0:
        state[QUATERNION] *= -1.0
    largest = QUATERNION[int(np.abs(state[QUATERNION]).argmax())]
    bounds: dict[str, Interval] = {}
    for row, (name, value) in enumerate(zip(names, state.tolist(), strict=True)):
        if row == largest:
            bounds[name] = Interval(lower=0.0) if value > 0.0 else Interval(upper=0.0)
        elif name == SPEED:
            bounds[name] = Interval(value - END_SPEED_TRUST, value + END_SPEED_TRUST)
        elif name not in COUNTERS:
            bounds[name] = Interval.exactly(value)
    return Boundary("", bounds)
