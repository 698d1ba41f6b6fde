"""The conclusion of a stage, which puts its findings together for the next stage and for the checkpoint."""

import numpy as np

from airrace.optimal_control.certificate import Certificate
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.solvers.interface import Multipliers
from airrace.procedure.result import (
    NO_PROVENANCE,
    NO_RECORD,
    MeshRecord,
    Note,
    Stage,
    StageProvenance,
    StageResult,
    Status,
)
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_problem import Flight, gate_splits, trajectory


def conclude(
    flight: Flight,
    session: SolverSession,
    problem: Problem,
    iterate: Iterate,
    *,
    outcome: Status,
    stage: Stage | None = None,
    message: str = "",
    multipliers: Multipliers | None = None,
    certificate: Certificate | None = None,
    provenance: StageProvenance = NO_PROVENANCE,
    mesh: MeshRecord = NO_RECORD,
    notes: tuple[Note, ...] = (),
) -> StageResult:
    """Return the result of a stage, by default the flight's own; without multipliers theirs are empty."""
    flown = trajectory(problem, iterate)
    return StageResult(
        stage=stage or flight.stage,
        outcome=outcome,
        message=message,
        trajectory=flown,
        constraint_multipliers=np.zeros(0) if multipliers is None else multipliers.constraints,
        bound_multipliers=np.zeros(0) if multipliers is None else multipliers.bounds,
        certificate=certificate,
        splits=gate_splits(flight, flown),
        attempts=tuple(session.attempts),
        timings=session.timings(),
        provenance=provenance,
        mesh=mesh,
        notes=notes,
    )
