"""A stored result measured again, from what is believed of it: its histories, its multipliers and its coarser mesh.

All else that a stage tells follows from these and from the race, so it is computed anew and can be compared with what
is stored. What was done to find the flight (solver calls, seconds, routes that were tried) leaves no trace in it; such
records are taken over as they are, and `UNVERIFIABLE` of `result.py` names them.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from airrace.errors import CheckpointError
from airrace.optimal_control.assembly import Assembly
from airrace.optimal_control.certificate import Certificate, Item
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.kernels import build_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.optimality import kkt_error
from airrace.optimal_control.refinement import Marks, restrict
from airrace.optimal_control.solvers.process.service import SolverService
from airrace.planning.race import Race
from airrace.procedure.certification import certify, examine
from airrace.procedure.fidelity import ensure_matches_model, fidelity_of, iterate_of
from airrace.procedure.progress import Silent
from airrace.procedure.result import Attempt, GateSplit, StageResult
from airrace.procedure.settings import Settings
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage import Stage
from airrace.procedure.stage_problem import StageProblem, formulate, gate_splits, mesh_of, trajectory_of
from airrace.procedure.start import InitialBarrier
from airrace.records import record
from airrace.trajectory import Array, Trajectory


@record
class TrustedData:
    """All that is believed of a stored stage.

    Attributes:
        stage: which one.
        flown: its flight; of this nothing counts but the declared histories, the durations and the mesh.
        multipliers: of the constraints, shape (n_g,).
        coarser: which nodes belong to the mesh that its race time was compared with; None where it does not claim such
            a comparison.
    """

    stage: Stage
    flown: Trajectory
    multipliers: Array
    coarser: Marks | None

    @classmethod
    def of(cls, result: StageResult) -> "TrustedData":
        """Return what is believed of a stored stage."""
        certificate = result.certificate
        claims = certificate is None or certificate.compares_meshes
        coarser = result.mesh.coarser if claims else None
        return cls(result.stage, result.trajectory, result.constraint_multipliers, coarser)


@record
class Measured:
    """All that follows from what is believed of a stage.

    Attributes:
        trajectory: the flight as the race's own problem declares and names it, on its time axis.
        splits: one row per passage.
        bound_multipliers: of the simple bounds, shape (n_w,).
        regularisation: its share of the objective, s.
        defect, drift: of every interval, see `MeshRecord`; shape (N,).
        items: of the certificate, but for what the solver says.
    """

    trajectory: Trajectory
    splits: tuple[GateSplit, ...]
    bound_multipliers: Array
    regularisation: float
    defect: Array
    drift: Array
    items: tuple[Item, ...]


def remeasured(
    race: Race, settings: Settings, results: Sequence[StageResult]
) -> Iterator[tuple[StageResult, StageResult]]:
    """Measure stored results again, each from its histories and multipliers alone.

    One thing is solved for: the optimum on the coarser mesh that the result's was divided from, whose race time is
    compared. Of a stage that does not claim that comparison it is not made.

    Yields:
        Every result as it is stored, and as it has to be stored if what is believed of it is true. One that found no
        flight is yielded twice as it is.

    Raises:
        CheckpointError: the stored histories or multipliers do not belong to a flight of this race.
        SolverCrash: the solver process died.
    """
    if not results:
        return
    solver = settings.solver
    with SolverService(stall_seconds=solver.stall_seconds) as service:
        for result in results:
            if result.is_flight:
                ensure_matches_model(race, result)
                alternatives = tuple(
                    _again(race, settings, alternative, service) for alternative in result.alternatives
                )
                yield result, replace(_again(race, settings, result, service), alternatives=alternatives)
            else:
                yield result, result


def recertify(race: Race, settings: Settings, result: StageResult) -> Certificate:
    """Measure the certificate of one stored result again, as `remeasured` does."""
    ((_, again),) = remeasured(race, settings, [replace(result, alternatives=())])
    assert again.certificate is not None  # of an optimum
    return again.certificate


def _again(race: Race, settings: Settings, result: StageResult, service: SolverService) -> StageResult:
    if fidelity_of(result.stage).guess:
        flight = formulate(Stage.POINT_MASS, race, settings)
        flown = trajectory_of(flight.problem(mesh_of(result.trajectory)), iterate_of(result.trajectory))
        return replace(result, trajectory=flown, splits=gate_splits(flight, flown), certificate=None)
    found = measured(race, settings, TrustedData.of(result), service)
    stored = result.certificate
    status = "" if stored is None else stored.solver_status
    return replace(
        result,
        trajectory=found.trajectory,
        splits=found.splits,
        bound_multipliers=found.bound_multipliers,
        certificate=Certificate(status, (_claim(result.attempts, status), *found.items)),
        provenance=replace(result.provenance, regularisation=found.regularisation),
        mesh=replace(result.mesh, defect=found.defect, drift=found.drift),
    )


def _claim(attempts: Sequence[Attempt], status: str) -> Item:
    """Return what the solver says: an optimum, if that is on record with these words."""
    claims = (one.status for one in attempts if one.success and f"{one.solver}: {one.status}" == status)
    words = next(claims, None)
    return Item("solver", math.nan, 0.0, "", "says nothing") if words is None else Item("solver", 0.0, 0.0, "", words)


def measured(race: Race, settings: Settings, trusted: TrustedData, service: SolverService) -> Measured:
    """Measure what follows from a flight and its multipliers, and from nothing else.

    Raises:
        CheckpointError: the multipliers do not belong to a flight of this race.
        SolverCrash: the solver process died.
    """
    flight = formulate(trusted.stage, race, settings, trusted.flown)
    problem, iterate = flight.problem(mesh_of(trusted.flown)), iterate_of(trusted.flown)
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
    certificate = certify(
        problem,
        iterate,
        evidence,
        settings.certificate,
        claim=Item("solver", math.nan, 0.0),
        status="",
        kkt_error=error.largest,
        coarser_race_time=_coarser_race_time(flight, settings, trusted, service),
    )
    flown = trajectory_of(problem, iterate)
    return Measured(
        trajectory=flown,
        splits=gate_splits(flight, flown),
        bound_multipliers=bound_multipliers,
        regularisation=functions.f - flown.race_time,
        defect=evidence.check.defect,
        drift=evidence.drift,
        items=certificate.items[1:],
    )


def _coarser_race_time(
    flight: StageProblem, settings: Settings, trusted: TrustedData, service: SolverService
) -> float | None:
    """Return the race time of the optimum on the mesh that the result's was divided from, s.

    NaN if there is no such mesh, if it is not everywhere coarser by half, or if no optimum is found on it; None where
    that is not claimed.
    """
    kept, flown = trusted.coarser, trusted.flown
    if kept is None:
        return None
    nodes = np.flatnonzero(kept)
    whole = kept.shape == flown.time.shape and bool(kept[flown.first_node].all())
    if not whole or np.diff(nodes).min(initial=2) < 2:
        return math.nan
    mesh, guess = restrict(mesh_of(flown), iterate_of(flown), kept)
    session = SolverSession(service, settings, Silent())
    solution = session.solve(
        flight.problem(mesh), guess, "half of the intervals", barrier=InitialBarrier.COARSER_MESH, passing=True
    )
    return float(solution.iterate.durations.sum()) if solution is not None and solution.success else math.nan
