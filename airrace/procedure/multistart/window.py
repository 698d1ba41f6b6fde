"""The moves of a search: a few legs of a flight on another route, while the rest stays as it is.

A window around them begins and ends in the states of the flight around it; only the speed at its end is free, weighted
by its costate. So a move is evaluated in tenths of a second, and what is faster fits into the flight.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from airrace.model.dynamics.flight_model import RollCounter
from airrace.optimal_control.problem import Boundary, Iterate, Problem
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.replay import interval_durations
from airrace.optimal_control.solvers.service import SolverService
from airrace.procedure.guess import QUATERNION_ROWS, align_quaternions, concatenate, phase_piece
from airrace.procedure.homotopy import fixed_state
from airrace.procedure.multistart.coarse_solution import (
    CoarseSolution,
    InitialGuess,
    coarse_options,
    objective_error,
    solve_coarse,
    try_solve,
)
from airrace.procedure.multistart.segments import Segment, inside_window
from airrace.procedure.stage_problem import StageProblem
from airrace.procedure.warm_start import InitialBarrier

ITERATIONS_MAX = 100
"""The largest number of iterations of a window.

Of 376 on 17 courses that were solved without a line search, half took at most 13, nine in ten 29. With 60 one search of
42 missed a faster roll; with 120 none ended at another flight.
"""
END_SPEED_TRUST = 10.0
"""The largest difference of the speed at the end of a window, m/s; its costate holds nearby."""
SPEED = "V_K"


@dataclass(frozen=True, eq=False)
class Move:
    """Another way to fly the phases `first ... last - 1` of a flight.

    Attributes:
        base: the flight.
        stage_problem: with the plan of the other route.
        pieces: a guess, one piece per phase of the window.
        segment: whose route changes.
        kind: what is different.
        plan_penalty: by how much its plan takes longer than the flight's own, s.
        spare: numbers of intervals at the start of the first phase and at the end of the last that stay as they are.
        own: the phases that are put into the flight; None for all of the window. Others only give way.
    """

    base: CoarseSolution
    first: int
    last: int
    stage_problem: StageProblem
    pieces: Sequence[Iterate]
    segment: Segment
    kind: str
    plan_penalty: float = 0.0
    spare: tuple[int, int] = (0, 0)
    own: range | None = None

    @property
    def mesh(self) -> list[tuple[float, ...]]:
        """The mesh of the flight, with equal intervals in phases whose guess has another number of them."""
        mesh = self.base.problem.mesh
        for index, piece in zip(self.phases, self.pieces, strict=True):
            count = piece.control.shape[1]
            if len(mesh[index]) != count:
                mesh[index] = (1.0 / count,) * count
        return mesh

    @property
    def changed(self) -> range:
        """The indices of the phases that are put into the flight."""
        return self.phases if self.own is None else self.own

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
        return inside_window(segments, self.move.first, self.move.last)


def evaluate(service: SolverService, move: Move) -> EvaluatedMove | None:
    """Return the fastest flight through a window near its guess; None if there is none within the budget.

    Args:
        service: what solves.
        move: the window.
    """
    window = _Window.of(move)
    options = coarse_options(InitialBarrier.PIECES, ITERATIONS_MAX, gives_up_early=True)
    solution = try_solve(service, window.problem, window.guess, options)
    if solution is None or not solution.success:
        return None
    base, iterate, problem = move.base, solution.iterate, window.problem
    speed = [state.name for state in problem.system.states].index(SPEED)
    before = window.seconds + base.error_penalty[move.first : move.last].sum()
    after = iterate.durations.sum() + objective_error(problem, solution).sum()
    saved = before - after + window.speed_costate * (base.iterate.state[speed, window.last] - iterate.state[speed, -1])
    return EvaluatedMove(move, *window.whole(iterate), float(saved)) if math.isfinite(saved) else None


def apply_moves(
    service: SolverService, stage_problem: StageProblem, base: CoarseSolution, moves: Sequence[EvaluatedMove]
) -> CoarseSolution | None:
    """Optimise the whole flight jointly, with some moves made that do not overlap.

    Args:
        service: what solves.
        stage_problem: with the plan of all these moves.
        base: the flight into which they are put.
        moves: solved in their windows.
    """
    pieces = [phase_piece(base.iterate, base.problem, index) for index in range(len(base.problem.phases))]
    mesh = base.problem.mesh
    for move in moves:
        for index in move.move.changed:
            place = index - move.move.first
            pieces[index] = phase_piece(move.iterate, move.problem, place)
            mesh[index] = move.problem.phases[place].fractions
    return solve_coarse(service, InitialGuess(stage_problem, mesh, concatenate(pieces), InitialBarrier.COARSE))


@dataclass(frozen=True, eq=False)
class _Window:
    """The part of a flight that is solved for a move, from node `first` to node `last`, as a problem of its own.

    It has a guess, the costate of the speed at its end, s per m/s, and what the flight takes for it, s.
    """

    move: Move
    phases: Problem
    problem: Problem
    guess: Iterate
    first: int
    last: int
    speed_costate: float
    seconds: float

    @classmethod
    def of(cls, move: Move) -> Self:
        """Return the window of a move."""
        base, first, last = move.base, move.first, move.last
        nodes, whole = base.problem.first_node, move.stage_problem.problem(move.mesh)
        phases, guess = list(whole.phases[first:last]), concatenate(move.pieces)
        head, tail = move.spare
        begin, end = nodes[first] + head, nodes[last] - tail
        seconds = float(base.iterate.durations[first:last].sum())
        steps = interval_durations(base.problem, base.iterate.durations)
        durations = guess.durations.copy()
        for place, rest in ((0, slice(head, None)), (-1, slice(None, -tail or None))):
            durations[place] *= np.array(phases[place].fractions)[rest].sum()
            phases[place] = phases[place].part(rest)
        if head or tail:
            seconds -= float(steps[nodes[first] : begin].sum() + steps[end : nodes[last]].sum())
            columns = guess.control.shape[1]
            guess = Iterate(
                durations, guess.state[:, head : columns - tail + 1], guess.control[:, head : columns - tail]
            )
        start = whole.start
        if begin > 0:
            start = fixed_state(move.stage_problem, base.iterate.state[:, begin])
            phases[0] = phases[0].without_path_constraints_at(0)
        whole = replace(whole, start=start)
        objective, costate = whole.objective, 0.0
        if end < nodes[-1]:
            names = [state.name for state in whole.system.states]
            costate = float(base.costates[names.index(SPEED), end - 1])
            objective = replace(objective, terminal={SPEED: costate})
            continuation = _continuation(names, base.iterate.state[:, end], guess)
            phases[-1] = replace(phases[-1].without_path_constraints_at(len(phases[-1].fractions)), end=continuation)
        problem = replace(whole, phases=tuple(phases), objective=objective)
        full = replace(whole, phases=whole.phases[first:last])
        return cls(move, full, problem, guess, begin, end, costate, seconds)

    def whole(self, iterate: Iterate) -> tuple[Iterate, Problem]:
        """Return a solution of the window, completed by the unchanged parts of its phases."""
        if self.move.spare == (0, 0):
            return iterate, self.problem
        base, (head, tail) = self.move.base, self.move.spare
        before, behind = self.first - head, self.last + tail
        whole, steps = base.iterate, interval_durations(base.problem, base.iterate.durations)
        own = interval_durations(self.problem, iterate.durations)
        state = np.hstack(
            [whole.state[:, before : self.first], iterate.state, whole.state[:, self.last + 1 : behind + 1]]
        )
        align_quaternions(state)
        control = np.hstack(
            [whole.control[:, before : self.first], iterate.control, whole.control[:, self.last : behind]]
        )
        steps = np.concatenate([steps[before : self.first], own, steps[self.last : behind]])
        pieces = np.split(steps, self.phases.first_node[1:-1])
        phases = tuple(
            replace(phase, fractions=tuple((piece / piece.sum()).tolist()))
            for phase, piece in zip(self.phases.phases, pieces, strict=True)
        )
        durations = np.array([piece.sum() for piece in pieces])
        return Iterate(durations, state, control), replace(self.phases, phases=phases)


def _continuation(names: Sequence[str], state: np.ndarray, start: Iterate) -> Boundary:
    """Return the boundary that fixes the state in which the flight continues behind a window.

    Its quaternion is on the side on which the guess ends. The largest entry of the quaternion follows from the others:
    fixed as well it would be one condition too many.
    """
    state = state.copy()
    if state[QUATERNION_ROWS] @ start.state[QUATERNION_ROWS, -1] < 0.0:
        state[QUATERNION_ROWS] *= -1.0
    largest = QUATERNION_ROWS[int(np.abs(state[QUATERNION_ROWS]).argmax())]
    bounds: dict[str, Interval] = {}
    for row, (name, value) in enumerate(zip(names, state.tolist(), strict=True)):
        if row == largest:
            bounds[name] = Interval(lower=0.0) if value > 0.0 else Interval(upper=0.0)
        elif name == SPEED:
            bounds[name] = Interval(value - END_SPEED_TRUST, value + END_SPEED_TRUST)
        elif name not in RollCounter.names():  # these begin anew where they matter
            bounds[name] = Interval.exactly(value)
    return Boundary("", bounds)
