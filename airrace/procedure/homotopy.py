"""The homotopy: a first flight through the race, phase by phase (section 4 of the paper).

Each phase begins where the one before ended. First both gates stand in line and are passed straight and level; then the
second gate's position and attitude move along the planned turn, its curvature growing with `part` from 0 to 1, until
the gate is where it belongs. The whole way is tried first; where a step fails, it is halved.

A phase flown for itself leaves its gate without a thought for the next. So a short horizon of phases is solved together
and only the first of them is kept when the next one joins. The pieces together are the guess of the joint problem.
"""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from airrace.optimal_control.problem import Boundary, Iterate, Phase, Problem
from airrace.optimal_control.solvers.interface import SolverOptions
from airrace.procedure.conclusion import conclude
from airrace.procedure.formulation import piece_boundary
from airrace.procedure.guess import first_mesh, guess
from airrace.procedure.phase_homotopy import PhaseHomotopy, phase_homotopy
from airrace.procedure.phase_segments import joined, moved, phase_piece
from airrace.procedure.result import Note, NoteKind, Stage, StageResult, Status
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_problem import Flight
from airrace.procedure.start import InitialBarrier
from airrace.quantities import Interval
from airrace.trajectory import Array

HORIZON = 2
"""The number of phases that are solved together."""
LONGEST_HORIZON = 8
"""The largest number of phases that are solved together where fewer fail."""
SMALLEST_STEP = 1.0 / 16.0
"""The smallest step of `part` that is tried (1)."""
DETOUR, DETOUR_SECONDS = 1.25, 1.0
"""The longest duration of a window: a factor on the plan (1), and a time on top (s)."""
TOLERANCE, ITERATIONS_MAX = 1e-2, 100
"""The tolerance (1) and the number of iterations of a piece's solve, which yields only a guess."""
INFEASIBILITY_TESTS_MAX = 2
"""The number of phases that cannot be added of which it is asked whether they can be flown at all."""

InfeasibilityTest = Callable[[Problem, int, Sequence[Iterate]], bool]
"""Tells of a race, a phase of it and some guesses of the race whether there is no flight around that phase."""


def fly_homotopy(
    flight: Flight, session: SolverSession, window_is_infeasible: InfeasibilityTest | None = None
) -> StageResult:
    """Fly all phases one after the other; a phase that cannot be flown is left as planned.

    Args:
        flight: the point mass.
        bench: what solves.
        hopeless: asked about the first phases that cannot be flown; where it says so, all that follows is left as
            planned. None to ask nobody.
    """
    return _Homotopy(flight, session, window_is_infeasible).fly()


class _Homotopy:
    """The pieces flown so far: `pieces[i]` is phase i, the last `HORIZON - 1` of them still open to change."""

    def __init__(self, flight: Flight, session: SolverSession, window_is_infeasible: InfeasibilityTest | None) -> None:
        self.flight = flight
        self.session = session
        self.window_is_infeasible = window_is_infeasible
        self.tested_phases: set[int] = set()
        self.is_infeasible = False
        self.mesh = first_mesh(flight.plan, session.settings.mesh)
        self.race = flight.problem(self.mesh)
        self.planned = guess(flight.plan, self.mesh)
        self.pieces: list[Iterate] = []

    def fly(self) -> StageResult:
        skipped: list[str] = []
        total = len(self.mesh)
        for group in self._groups():
            *open_ended, index = group
            name = self.race.phases[index].name
            self.session.progress.activity(f"phase {index + 1} of {total}: {name}", index, total)
            self.pieces += [phase_piece(self.planned, self.race, one) for one in open_ended]
            if not self._add_phase(index, HORIZON + len(open_ended)):
                skipped += [self.race.phases[one].name for one in group]
                self.pieces.append(phase_piece(self.planned, self.race, index))
        return conclude(
            self.flight,
            self.session,
            self.race,
            joined(self.pieces),
            stage=Stage.HOMOTOPY,
            outcome=Status.SOLVED,
            notes=(Note(NoteKind.PLANNED_PHASES, f"left as planned: {', '.join(skipped)}"),) if skipped else (),
        )

    def _so_far(self) -> Iterate:
        """Return a flight of the pieces, and of what is planned of the rest."""
        rest = range(len(self.pieces), len(self.mesh))
        return joined([*self.pieces, *(phase_piece(self.planned, self.race, one) for one in rest)])

    def _groups(self) -> list[list[int]]:
        """Return the phases to be added together.

        They are added one by one, but those that end anywhere together with the next that ends at a given place.

        The fastest way to a bare attitude is to take it at once, wherever; that tells nothing of a good flight.
        """
        groups: list[list[int]] = [[]]
        for index in range(len(self.mesh)):
            groups[-1].append(index)
            if not self.flight.plan.waypoints[index + 1].free:
                groups.append([])
        return [group for group in groups if group]

    def _add_phase(self, index: int, horizon: int) -> bool:
        """Add a phase; where it cannot be flown from what is kept before it, more of that is opened to change."""
        while not self.is_infeasible and not self._follow(index, max(0, index - horizon + 1)):
            self._test_infeasibility(index)
            if horizon > min(index, LONGEST_HORIZON - 1):
                return False
            horizon *= 2
        return not self.is_infeasible

    def _test_infeasibility(self, index: int) -> None:
        """Ask whether a phase that could not be added can be flown at all; once, and of the first such phases only."""
        if (
            self.window_is_infeasible is None
            or index in self.tested_phases
            or len(self.tested_phases) == INFEASIBILITY_TESTS_MAX
        ):
            return
        self.tested_phases.add(index)
        self.is_infeasible = self.window_is_infeasible(self.race, index, [self.planned, self._so_far()])

    def _follow(self, index: int, first: int) -> bool:
        """Follow the family of a phase from its first member to the real gate; return whether that was reached.

        A step that gets too small ends the attempt.
        """
        family = phase_homotopy(self.flight.plan, index, self.pieces[-1].state[:, -1] if self.pieces else None)
        fractions = self.mesh[index]
        part, step = family.first, 1.0
        reached = self._member(first, index, family, part, family.guess(part, fractions))
        while reached is not None and part < 1.0:
            trial = min(1.0, part + step)
            shifted = moved(reached[-1], family.guess(part, fractions), family.guess(trial, fractions))
            solved = self._member(first, index, family, trial, shifted, reached[:-1])
            if solved is not None:
                reached, part, step = solved, trial, 2.0 * step
            elif (step := 0.5 * (trial - part)) < SMALLEST_STEP:
                return False
        if reached is None:
            return False
        self.pieces[first:] = reached
        return True

    def _member(
        self,
        first: int,
        index: int,
        family: PhaseHomotopy,
        part: float,
        last: Iterate,
        before: Sequence[Iterate] | None = None,
    ) -> list[Iterate] | None:
        """Solve phases `first ... index`, the last of them at `part`; return the pieces, or None where that fails."""
        problem = self._problem(first, index, family, part)
        start = joined([*(self.pieces[first:] if before is None else before), last])
        purpose = f"{self.race.phases[index].name}, part {part:g}"
        barrier = InitialBarrier.COLD if before is None else InitialBarrier.PIECES
        options = SolverOptions(TOLERANCE, ITERATIONS_MAX, barrier)
        solution = self.session.attempt(problem, start, purpose, self.session.settings.solver.primary, options)
        if solution is None or not solution.success or self._astray(solution.iterate, first, start):
            return None
        return [phase_piece(solution.iterate, problem, one) for one in range(len(problem.phases))]

    def _astray(self, found: Iterate, first: int, start: Iterate) -> bool:
        """Return whether a solution has left the family: it takes much longer than planned, for a needless loop."""
        planned = np.maximum(start.durations, self.planned.durations[first : first + len(start.durations)])
        return bool(found.durations.sum() > DETOUR * planned.sum() + DETOUR_SECONDS)

    def _problem(self, first: int, index: int, family: PhaseHomotopy, part: float) -> Problem:
        target = piece_boundary(family.target(part), self.flight.observation)
        phases: list[Phase] = list(self.race.phases[first:index])
        last = dataclasses.replace(self.race.phases[index], end=target)
        # On the way to the real phase its lines and its crowd stand at places that mean nothing yet.
        phases.append(last if part == 1.0 else dataclasses.replace(last, watches=()))
        return dataclasses.replace(self.race, start=self._begin(first), phases=tuple(phases))

    def _begin(self, first: int) -> Boundary:
        """Return the race's own start, or the state in which the last piece that is kept ended."""
        if first == 0:
            return self.race.start
        return held(self.flight, self.pieces[first].state[:, 0])


def held(flight: Flight, state: Array) -> Boundary:
    """Return the boundary that is met in exactly one state, shape (n_x,)."""
    names = [quantity.name for quantity in flight.model.system.states]
    return Boundary("", {name: Interval.exactly(float(value)) for name, value in zip(names, state, strict=True)})
