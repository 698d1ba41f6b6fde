"""Stored results computed again from what is trusted of them: histories, multipliers and the coarser mesh.

All else of a stage follows from these and from the race, so it can be compared with what is stored. How the flight was
found (solver calls, seconds, routes that were tried) leaves no trace in it; such records are taken over as they are,
and `UNVERIFIABLE` of `result.py` names them.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from airrace.errors import CheckpointError
from airrace.optimal_control.assembly import Assembly
from airrace.optimal_control.certificate import Certificate, Item, SecondOrder
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.kernels import build_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.mesh_refinement import Marks
from airrace.optimal_control.optimality import kkt_error
from airrace.optimal_control.problem import Problem
from airrace.optimal_control.second_order import judge
from airrace.optimal_control.solvers.interface import Multipliers
from airrace.optimal_control.solvers.service import SolverService
from airrace.optimal_control.trajectory import Array, Trajectory
from airrace.procedure.certification import approaches, certify, certify_rough, clearance_item, examine, rough_limits
from airrace.procedure.fidelity import ensure_matches_model, fidelity_of, iterate_of
from airrace.procedure.mesh_loop import race_time_on_coarser_mesh
from airrace.procedure.result import Attempt, GateSplit, PylonCondition, Silent, StageResult
from airrace.procedure.settings import Settings
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage import Stage
from airrace.procedure.stage_problem import (
    StageProblem,
    formulate,
    gate_splits,
    mesh_of,
    regularisation_share,
    trajectory_of,
    without_pilot_limits,
)
from airrace.race import Race


@dataclass(frozen=True, eq=False)
class TrustedData:
    """All that is trusted of a stored stage.

    Attributes:
        stage: which one.
        trajectory: of this nothing counts but the declared histories, the durations and the mesh.
        multipliers: of the constraints, shape (n_g,).
        coarser: which nodes belong to the mesh that its race time was compared with; None where it does not claim such
            a comparison.
        pylon_conditions: that it was solved with.
        is_rough: whether it claims no more than that the next stage can start from it.
    """

    stage: Stage
    trajectory: Trajectory
    multipliers: Array
    coarser: Marks | None
    pylon_conditions: tuple[PylonCondition, ...] = ()
    is_rough: bool = False

    @classmethod
    def of(cls, result: StageResult) -> "TrustedData":
        """Return what is trusted of a stored stage."""
        claims = result.certificate is None or result.certificate.compares_meshes
        coarser = result.mesh.coarser if claims else None
        conditions = result.pylon_conditions
        return cls(result.stage, result.trajectory, result.constraint_multipliers, coarser, conditions, result.is_rough)


@dataclass(frozen=True, eq=False)
class Measured:
    """All that follows from what is trusted of a stage.

    Attributes:
        trajectory: the flight as the race's own problem declares and names it, on its time axis.
        splits: one row per passage.
        bound_multipliers: of the simple bounds, shape (n_w,).
        regularisation: its share of the objective, s.
        defect, drift: of every interval, see `MeshRecord`; shape (N,).
        items: of the certificate, but for what the solver says.
        second_order: what the curvature tells; None where it is not finite.
    """

    trajectory: Trajectory
    splits: tuple[GateSplit, ...]
    bound_multipliers: Array
    regularisation: float
    defect: Array
    drift: Array
    items: tuple[Item, ...]
    second_order: SecondOrder | None


def recompute(
    race: Race, settings: Settings, results: Sequence[StageResult]
) -> Iterator[tuple[StageResult, StageResult]]:
    """Compute stored results again, each from its histories and multipliers alone.

    One thing is solved for: the optimum on the coarser mesh that the result's was divided from, whose race time is
    compared, unless the stage does not claim that comparison.

    Yields:
        Every result as it is stored, and as it has to be stored if what is trusted of it is true. One that found no
        flight is yielded twice as it is.

    Raises:
        CheckpointError: the stored histories or multipliers do not belong to a flight of this race.
        SolverCrash: the solver process died.
    """
    if not results:
        return
    with SolverService(stall_seconds=settings.solver.stall_seconds) as service:
        for result in results:
            if not result.is_flight:
                yield result, result
                continue
            ensure_matches_model(race, result)
            alternatives = [_recompute_one(race, settings, alternative, service) for alternative in result.alternatives]
            yield result, replace(_recompute_one(race, settings, result, service), alternatives=tuple(alternatives))


def recertify(race: Race, settings: Settings, result: StageResult) -> Certificate:
    """Measure the certificate of one stored result again, as `recompute` does."""
    ((_, again),) = recompute(race, settings, [replace(result, alternatives=())])
    assert again.certificate is not None  # of an optimum
    return again.certificate


def _recompute_one(race: Race, settings: Settings, result: StageResult, service: SolverService) -> StageResult:
    if fidelity_of(result.stage).is_guess:
        stage_problem = without_pilot_limits(formulate(Stage.POINT_MASS, race, settings), race)
        trajectory = trajectory_of(stage_problem.problem(mesh_of(result.trajectory)), iterate_of(result.trajectory))
        return replace(result, trajectory=trajectory, splits=gate_splits(stage_problem, trajectory), certificate=None)
    measured = measure(race, settings, TrustedData.of(result), service)
    status = "" if result.certificate is None else result.certificate.solver_status
    return replace(
        result,
        trajectory=measured.trajectory,
        splits=measured.splits,
        bound_multipliers=measured.bound_multipliers,
        certificate=Certificate(status, (_claim(result.attempts, status), *measured.items), measured.second_order),
        provenance=replace(result.provenance, regularisation=measured.regularisation),
        mesh=replace(result.mesh, defect=measured.defect, drift=measured.drift),
    )


def _claim(attempts: Sequence[Attempt], status: str) -> Item:
    """Return what the solver says: an optimum, if that is on record with these words."""
    claims = (
        attempt.status for attempt in attempts if attempt.success and f"{attempt.solver}: {attempt.status}" == status
    )
    words = next(claims, None)
    return Item("solver", math.nan, 0.0, "", "says nothing") if words is None else Item("solver", 0.0, 0.0, "", words)


def measure(race: Race, settings: Settings, trusted: TrustedData, service: SolverService) -> Measured:
    """Measure what follows from a flight and its multipliers, and from nothing else.

    Raises:
        CheckpointError: the multipliers do not belong to a flight of this race.
        SolverCrash: the solver process died.
    """
    stage_problem = formulate(trusted.stage, race, settings, trusted.trajectory, trusted.pylon_conditions)
    problem, iterate = stage_problem.problem(mesh_of(trusted.trajectory)), iterate_of(trusted.trajectory)
    layout = Layout(problem)
    if trusted.multipliers.shape != (layout.constraints,):
        raise CheckpointError(
            f"{trusted.stage.value}: {trusted.multipliers.size} multipliers are stored, "
            f"but the race has {layout.constraints} constraints on this mesh"
        )
    kernels = build_kernels(problem.system, problem.scheme)
    functions, w, p = Evaluation(Assembly(layout, kernels)), layout.pack(iterate), layout.parameter_values()
    error, bound_multipliers, _ = kkt_error(functions, layout, w, p, trusted.multipliers)
    evidence = examine(problem, iterate, trusted.multipliers, settings.certificate)
    claim = Item("solver", math.nan, 0.0)
    if trusted.is_rough:
        certificate = certify_rough(
            problem,
            iterate,
            evidence.check.items[0],
            rough_limits(settings.certificate),
            claim=claim,
            status="",
            kkt_error=error.largest,
        )
    else:
        judged = judge(functions, layout, w, p, trusted.multipliers)
        certificate = certify(
            problem,
            iterate,
            evidence,
            settings.certificate,
            claim=claim,
            status="",
            kkt_error=error.largest,
            second_order=None if judged is None else judged[0],
            coarser_race_time=_coarser_race_time(
                SolverSession(service, settings, Silent()),
                stage_problem,
                trusted,
                problem,
                Multipliers(trusted.multipliers, bound_multipliers),
            ),
            clearance=clearance_item(
                stage_problem,
                problem,
                approaches(stage_problem, problem, iterate, evidence.replay),
                settings.certificate,
            ),
        )
    trajectory = trajectory_of(problem, iterate)
    return Measured(
        trajectory=trajectory,
        splits=gate_splits(stage_problem, trajectory),
        bound_multipliers=bound_multipliers,
        regularisation=regularisation_share(problem, iterate, functions.f),
        defect=evidence.check.defect,
        drift=evidence.drift,
        items=certificate.items[1:],
        second_order=certificate.second_order,
    )


def _coarser_race_time(
    session: SolverSession,
    stage_problem: StageProblem,
    trusted: TrustedData,
    problem: Problem,
    multipliers: Multipliers,
) -> float | None:
    """Return the race time of the optimum on the mesh that the result's was divided from, s.

    NaN if there is no such mesh, if it is not everywhere coarser by half, or if no optimum is found on it; None where
    that is not claimed.
    """
    coarser, trajectory = trusted.coarser, trusted.trajectory
    if coarser is None:
        return None
    whole = coarser.shape == trajectory.time.shape and bool(coarser[trajectory.first_node].all())
    if not whole or np.diff(np.flatnonzero(coarser)).min(initial=2) < 2:
        return math.nan
    return race_time_on_coarser_mesh(session, stage_problem, problem, iterate_of(trajectory), multipliers, coarser)
