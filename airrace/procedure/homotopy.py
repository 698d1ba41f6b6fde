"""The homotopy: a first flight through the race, phase by phase (section 4 of the paper).

Each phase begins where the one before ended. First both gates stand in line and are passed straight and level; then the
second gate's position and attitude move along the planned turn, its curvature growing with `part` from 0 to 1, until the
gate is where it belongs. The whole way is tried first; where a step fails, it is halved. The pieces together are the
guess of the joint problem.
"""

import dataclasses
from dataclasses import dataclass

import numpy as np

from airrace.optimal_control.problem import Boundary, Iterate, Phase, Problem
from airrace.procedure.conclusion import conclude
from airrace.procedure.flight import PointMassFlight
from airrace.procedure.guess import Fractions, first_mesh, guess
from airrace.procedure.phase_family import PhaseFamily, phase_family
from airrace.procedure.point_mass import COLD_BARRIER
from airrace.procedure.result import Outcome, Stage, StageResult
from airrace.procedure.solving import Workbench
from airrace.procedure.statement import DURATION, piece_boundary
from airrace.quantities import Interval
from airrace.trajectory import Array

SMALLEST_STEP = 1.0 / 32.0
STEP_BARRIER = 1e-2  # of a solve that starts from the neighbouring solution


@dataclass(frozen=True)
class _Solved:
    """The solution at one member of the family."""

    part: float
    iterate: Iterate


def fly_homotopy(flight: PointMassFlight, bench: Workbench) -> StageResult:
    """Fly all phases one after the other; a phase that cannot be flown is left as planned."""
    mesh = first_mesh(flight.plan, bench.settings.mesh)
    planned = guess(flight.plan, mesh)
    problem = flight.problem(mesh)
    state: Array | None = None
    pieces: list[Iterate] = []
    skipped: list[str] = []
    for index, (phase, fractions) in enumerate(zip(problem.phases, mesh, strict=True)):
        bench.progress.activity(f"phase {index + 1} of {len(mesh)}: {phase.name}", index, len(mesh))
        family = phase_family(flight.plan, index, state)
        piece = _fly_phase(flight, bench, family, fractions, state, phase.name)
        if piece is None:
            skipped.append(phase.name)
            piece = _piece_of(planned, problem, index)
        state = piece.state[:, -1]
        pieces.append(piece)
    message = f"left as planned: {', '.join(skipped)}" if skipped else ""
    assembled = _assembled(pieces)
    return conclude(flight, bench, problem, assembled, stage=Stage.HOMOTOPY, outcome=Outcome.SOLVED, message=message)


def _fly_phase(
    flight: PointMassFlight,
    bench: Workbench,
    family: PhaseFamily,
    fractions: Fractions,
    state: Array | None,
    name: str,
) -> Iterate | None:
    """Follow the family from the straight flight to the real gate with an adaptive step; None if a step gets too small."""
    last = _solve_member(flight, bench, family, fractions, state, _Solved(0.0, family.guess(0.0, fractions)), name)
    if last is None:
        return None
    step = 1.0
    while last.part < 1.0:
        part = min(1.0, last.part + step)
        shifted = _shifted(last.iterate, family.guess(last.part, fractions), family.guess(part, fractions))
        reached = _solve_member(flight, bench, family, fractions, state, _Solved(part, shifted), name)
        if reached is not None:
            last, step = reached, 2.0 * step
        else:
            step = 0.5 * min(step, 1.0 - last.part)
            if step < SMALLEST_STEP:
                return None
    return last.iterate


def _solve_member(
    flight: PointMassFlight,
    bench: Workbench,
    family: PhaseFamily,
    fractions: Fractions,
    state: Array | None,
    start: _Solved,
    name: str,
) -> _Solved | None:
    target = family.target(start.part)
    whole = flight.problem([])
    problem = Problem(
        system=whole.system,
        parameters=whole.parameters,
        start=_begin(flight, family, state),
        phases=(Phase(name, fractions, DURATION, piece_boundary(target, flight.observation)),),
        objective=whole.objective,
        time_scale=whole.time_scale,
    )
    barrier = COLD_BARRIER if start.part == 0.0 else STEP_BARRIER
    solution = bench.solve(problem, start.iterate, f"{name}, part {start.part:g}", barrier=barrier, fallback=False)
    if solution is None or not solution.success:
        return None
    return _Solved(start.part, solution.iterate)


def _begin(flight: PointMassFlight, family: PhaseFamily, state: Array | None) -> Boundary:
    """The first phase begins at the start, every other one in the state in which the one before ended."""
    if state is None:
        start = piece_boundary(family.begin, flight.observation)
        return dataclasses.replace(start, bounds={**start.bounds, "attitude_norm": Interval.exactly(1.0)})
    names = [quantity.name for quantity in flight.model.system.states]
    return Boundary("", {name: Interval.exactly(float(value)) for name, value in zip(names, state, strict=True)})


def _shifted(iterate: Iterate, before: Iterate, after: Iterate) -> Iterate:
    """A solution moved by the difference between two planned flights."""
    return Iterate(
        np.maximum(iterate.durations + after.durations - before.durations, 0.2 * after.durations),
        iterate.state + after.state - before.state,
        iterate.control + after.control - before.control,
    )


def _piece_of(planned: Iterate, problem: Problem, index: int) -> Iterate:
    first, last = problem.first_node[index], problem.first_node[index + 1]
    return Iterate(
        planned.durations[index : index + 1], planned.state[:, first : last + 1], planned.control[:, first:last]
    )


def _assembled(pieces: list[Iterate]) -> Iterate:
    """The pieces as one flight; of two states at a gate the later is kept."""
    state = np.hstack([*(piece.state[:, :-1] for piece in pieces), pieces[-1].state[:, -1:]])
    durations = np.concatenate([piece.durations for piece in pieces])
    return Iterate(durations, state, np.hstack([piece.control for piece in pieces]))
