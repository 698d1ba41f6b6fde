"""The homotopy: a first flight through the race, phase by phase (section 4 of the paper).

Each phase begins where the one before ended. First both gates stand in line and are passed straight and level; then the
second gate's position and attitude move along the planned turn, its curvature growing with `part` from 0 to 1, until
the gate is where it belongs. The whole way is tried first; where a step fails, it is halved.

A phase solved for itself leaves its gate without regard for the next. So a short horizon of phases is solved together
and only the first of them stays when the next one joins. The pieces together are the guess of the joint problem.
"""

import dataclasses
import math
from collections.abc import Callable, Sequence

import numpy as np

from airrace.model.dynamics.point_mass import PointMassState
from airrace.model.frames import angles, rotation
from airrace.model.track.course import Passage
from airrace.model.track.dubins import DubinsPath
from airrace.optimal_control.problem import Boundary, Iterate, Phase, Problem
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.solvers.interface import SolverOptions
from airrace.optimal_control.trajectory import Array
from airrace.procedure.certification import conclude
from airrace.procedure.formulation import piece_boundary
from airrace.procedure.guess import concatenate, first_mesh, guess, phase_piece, shift
from airrace.procedure.infeasibility.local_infeasibility import LocalInfeasibility
from airrace.procedure.planning.plan import Plan, PlannedLeg
from airrace.procedure.planning.planning_model import PlanningModel, rotation_time, rotation_vector, turn_by
from airrace.procedure.planning.route_decisions import Waypoint
from airrace.procedure.result import Note, NoteKind, StageResult, Status
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage import Stage
from airrace.procedure.stage_problem import StageProblem
from airrace.procedure.warm_start import InitialBarrier

HORIZON, LONGEST_HORIZON = 2, 8
"""The number of phases that are solved together; the largest one, where fewer fail."""
SMALLEST_STEP = 1.0 / 16.0
"""The smallest step of `part` that is tried (1)."""
DETOUR, DETOUR_SECONDS = 1.25, 1.0
"""The longest duration of a horizon: a factor on the plan (1), and a time on top (s)."""
TOLERANCE, ITERATIONS_MAX = 1e-2, 100
"""The tolerance (1) and the number of iterations of a piece's solve, which yields only a guess."""
INFEASIBILITY_TESTS_MAX = 2
"""The largest number of infeasibility tests."""

InfeasibilityTest = Callable[[Problem, int, Sequence[Iterate]], LocalInfeasibility | None]
"""(problem, phase, guesses) -> the infeasibility of the legs around the phase; None where it is not confirmed."""


@dataclasses.dataclass(frozen=True)
class HomotopyOutcome:
    """The pieces as one flight, and the infeasibility that ended the homotopy; None where nothing did."""

    result: StageResult
    infeasibility: LocalInfeasibility | None = None


@dataclasses.dataclass(frozen=True)
class PhaseHomotopy:
    """The family of one phase: from straight and level to the planned turn.

    A member is named by its `part` in [0, 1]: the curvature of the planned path (or the rotation between two attitudes)
    is multiplied by it, and so is the prescribed bank. Part 0 has both gates in line; part 1 is the real phase.

    Attributes:
        begin: where the phase begins: its waypoint, moved to where the phase before really ended.
        end: its last waypoint as planned.
        path: the planned path of a level leg, else None.
        pace: planning pace at the speed with which the phase begins.
        counting: see `Plan`.
    """

    begin: Waypoint
    end: Waypoint
    path: DubinsPath | None
    pace: PlanningModel
    counting: bool

    @property
    def first(self) -> float:
        """The first member; between attitudes at free positions there is no straight flight to begin with."""
        return 0.0 if self.path is not None else 1.0

    def target(self, part: float) -> Waypoint:
        """Return where and how the phase ends."""
        if part == 1.0:
            return self.end
        begin, end = self.begin.position, self.end.position
        if self.path is not None:
            assert begin is not None  # a level leg's ends have positions
            assert end is not None
            bent = self.path.bend(part)
            north, east, heading = (float(values[0]) for values in bent.points(np.array([self.path.length])))
            position, climb = (north, east, begin[2] + part * (end[2] - begin[2])), 0.0
            bank = None if self.end.bank is None else part * self.end.bank
        else:
            vector = rotation_vector(self.begin.q, self.end.q)
            heading, climb, bank = angles(rotation(turn_by(self.begin.q, vector, part)))
            bank, position = (None if self.end.bank is None else bank), end
            if begin is not None and end is not None:
                north, east, height = (a + part * (b - a) for a, b in zip(self._ahead(begin), end, strict=True))
                position = north, east, height
        return dataclasses.replace(self.end, position=position, heading=heading, climb=climb, bank=bank, axis=heading)

    def _ahead(self, position: tuple[float, float, float]) -> tuple[float, float, float]:
        """Return the position to which flight straight on would lead in the time of the whole rotation, m."""
        reach = self.pace.V * rotation_time(self.begin.q, self.end.q, self.pace)
        level = reach * math.cos(self.begin.climb)
        return (
            position[0] + level * math.cos(self.begin.heading),
            position[1] + level * math.sin(self.begin.heading),
            position[2] + reach * math.sin(self.begin.climb),
        )

    def guess(self, part: float, fractions: Sequence[float]) -> Iterate:
        """Return the member as planned, on a mesh."""
        path = None if self.path is None else self.path.bend(part)
        member = Plan((self.begin, self.target(part)), (PlannedLeg(path),), self.pace, 0.0, self.counting)
        return guess(member, [tuple(fractions)])


def phase_homotopy(plan: Plan, index: int, state: Array | None) -> PhaseHomotopy:
    """Return the family of one phase.

    Args:
        plan: of the race.
        index: of the phase.
        state: point-mass state in which the phase begins, shape (n_x,); None for the start as planned.
    """
    begin, end, pace = plan.waypoints[index], plan.waypoints[index + 1], plan.cruise
    if state is not None:
        now = PointMassState[float].split(state)
        heading, climb, bank = angles(rotation(now.q))
        begin = dataclasses.replace(
            begin, position=(now.x, now.y, -now.z), heading=heading, climb=climb, bank=bank, axis=heading
        )
        pace = dataclasses.replace(pace, V=now.V_K)
    # The planned path counts although the phase begins a little beside it: from there the shortest path to the gate
    # may be another one, with a full circle more.
    return PhaseHomotopy(begin, end, plan.legs[index].path, pace, plan.counting)


def solve_homotopy(
    stage_problem: StageProblem, session: SolverSession, test_infeasibility: InfeasibilityTest | None = None
) -> HomotopyOutcome:
    """Solve all phases one after the other; a phase for which that fails is left as planned, on later laps at once.

    Args:
        stage_problem: the point mass.
        session: what solves.
        test_infeasibility: asked about the first phases that fail; where the legs around one are infeasible, all that
            follows is left as planned. None to ask nobody.
    """
    return _Homotopy(stage_problem, session, test_infeasibility).solve()


class _Homotopy:
    """The pieces so far: `pieces[i]` is phase i, the last `HORIZON - 1` of them still open to change."""

    def __init__(
        self, stage_problem: StageProblem, session: SolverSession, test_infeasibility: InfeasibilityTest | None
    ) -> None:
        self.stage_problem = stage_problem
        self.session = session
        self.test_infeasibility = test_infeasibility
        self.tested_phases: set[int] = set()
        self.infeasibility: LocalInfeasibility | None = None
        self.mesh = first_mesh(stage_problem.plan, session.settings.mesh)
        self.race = stage_problem.problem(self.mesh)
        self.planned = guess(stage_problem.plan, self.mesh)
        self.pieces: list[Iterate] = []

    def solve(self) -> HomotopyOutcome:
        skipped, failed = list[str](), list[Sequence[Passage]]()
        total = len(self.mesh)
        for group in self._groups():
            *open_ended, index = group
            name = self.race.phases[index].name
            self.session.progress.activity(f"phase {index + 1} of {total}: {name}", index, total)
            self.pieces += [phase_piece(self.planned, self.race, phase) for phase in open_ended]
            place = self._place(group)
            if place in failed or not self._add_phase(index, HORIZON + len(open_ended)):
                failed.append(place)
                skipped += [self.race.phases[phase].name for phase in group]
                self.pieces.append(phase_piece(self.planned, self.race, index))
        result = conclude(
            self.stage_problem,
            self.session,
            self.race,
            concatenate(self.pieces),
            stage=Stage.HOMOTOPY,
            outcome=Status.SOLVED,
            notes=(Note(NoteKind.PLANNED_PHASES, f"left as planned: {', '.join(skipped)}"),) if skipped else (),
        )
        return HomotopyOutcome(result, self.infeasibility)

    def _place(self, group: Sequence[int]) -> Sequence[Passage]:
        """Return the passages of some phases, which are equal on all laps."""
        waypoints = self.stage_problem.plan.waypoints[group[0] : group[-1] + 2]
        return [dataclasses.replace(waypoint.passage, name="", lap=0) for waypoint in waypoints]

    def _groups(self) -> list[list[int]]:
        """Return the phases to be added together: each alone, but those that end anywhere with the next fixed one.

        The fastest way to a bare attitude is to take it at once, wherever; that says nothing of a good flight.
        """
        groups: list[list[int]] = [[]]
        for index in range(len(self.mesh)):
            groups[-1].append(index)
            if not self.stage_problem.plan.waypoints[index + 1].free:
                groups.append([])
        return [group for group in groups if group]

    def _add_phase(self, index: int, horizon: int) -> bool:
        """Add a phase; where that fails with the pieces before it, more of them are opened to change."""
        while self.infeasibility is None and not self._follow(index, max(0, index - horizon + 1)):
            self._test_phase(index)
            if horizon > min(index, LONGEST_HORIZON - 1):
                return False
            horizon *= 2
        return self.infeasibility is None

    def _test_phase(self, index: int) -> None:
        """Ask whether a phase that could not be added is infeasible; once, and of the first such phases only."""
        tested = self.tested_phases
        if self.test_infeasibility is None or index in tested or len(tested) == INFEASIBILITY_TESTS_MAX:
            return
        tested.add(index)
        rest = [phase_piece(self.planned, self.race, phase) for phase in range(len(self.pieces), len(self.mesh))]
        guesses = [self.planned, concatenate([*self.pieces, *rest])]
        self.infeasibility = self.test_infeasibility(self.race, index, guesses)

    def _follow(self, index: int, first: int) -> bool:
        """Follow the family of a phase from its first member to the real gate; return whether that was reached.

        A step that gets too small ends the attempt.
        """
        family = phase_homotopy(self.stage_problem.plan, index, self.pieces[-1].state[:, -1] if self.pieces else None)
        fractions = self.mesh[index]
        part, step = family.first, 1.0
        reached = self._member(first, index, family, part, family.guess(part, fractions))
        while reached is not None and part < 1.0:
            trial = min(1.0, part + step)
            shifted = shift(reached[-1], family.guess(part, fractions), family.guess(trial, fractions))
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
        """Solve phases `first ... index`, the last of them at `part`; return the pieces, or None where that fails.

        It fails, too, where the solution has left the family: it takes much longer than planned, for a needless loop.
        """
        target = piece_boundary(family.target(part), self.stage_problem.observation)
        end = dataclasses.replace(self.race.phases[index], end=target)
        # On the way to the real phase its lines and its crowd stand at places that mean nothing yet, and its end is a
        # place and an attitude of the plan, whatever pylons stand there.
        phases: list[Phase] = [
            *self.race.phases[first:index],
            dataclasses.replace(
                end, path_constraints=tuple(c for c in end.path_constraints if part == 1.0 and c.at is None)
            ),
        ]
        begin = self.race.start if first == 0 else fixed_state(self.stage_problem, self.pieces[first].state[:, 0])
        problem = dataclasses.replace(self.race, start=begin, phases=tuple(phases))
        start = concatenate([*(self.pieces[first:] if before is None else before), last])
        purpose = f"{self.race.phases[index].name}, part {part:g}"
        barrier = InitialBarrier.COLD if before is None else InitialBarrier.PIECES
        # A first guess may end on a detour, too: it is refused below.
        options = SolverOptions(TOLERANCE, ITERATIONS_MAX, barrier.value, curvature=False)
        solution = self.session.attempt(problem, start, purpose, self.session.settings.solver.primary, options)
        if solution is None or not solution.success:
            return None
        planned = np.maximum(start.durations, self.planned.durations[first : first + len(start.durations)])
        if solution.iterate.durations.sum() > DETOUR * planned.sum() + DETOUR_SECONDS:
            return None
        return [phase_piece(solution.iterate, problem, phase) for phase in range(len(problem.phases))]


def fixed_state(stage_problem: StageProblem, state: Array) -> Boundary:
    """Return the boundary that is met in exactly one state, shape (n_x,)."""
    names = [quantity.name for quantity in stage_problem.model.system.states]
    return Boundary("", {name: Interval.exactly(float(value)) for name, value in zip(names, state, strict=True)})
