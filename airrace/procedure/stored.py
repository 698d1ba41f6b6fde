"""The evaluation of a stored result: its certificate measured again, its histories at any time."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from airrace.errors import CheckpointError
from airrace.optimal_control.assembly import Assembly
from airrace.optimal_control.certificate import Certificate, Item
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.kernels import build_kernels
from airrace.optimal_control.kkt import kkt_error
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.refinement import restrict
from airrace.optimal_control.sampling import sample
from airrace.optimal_control.service import SolverService
from airrace.planning.race import Race
from airrace.procedure.certification import certify, examine
from airrace.procedure.flight import Flight, iterate_of, mesh_of, stage_flight, stage_model
from airrace.procedure.joint import REFINED_BARRIER
from airrace.procedure.progress import Silent
from airrace.procedure.result import StageResult
from airrace.procedure.settings import Settings
from airrace.procedure.solving import Workbench
from airrace.trajectory import Array


def recertified(
    race: Race, settings: Settings, results: Sequence[StageResult]
) -> Iterator[tuple[StageResult, Certificate]]:
    """Measure stored results again, each from its histories and multipliers alone.

    One thing is solved for: the optimum on the coarser mesh that the result's was divided from, whose race time is
    compared. Of a stage that does not claim that comparison it is not made.

    Raises:
        CheckpointError: the stored multipliers do not belong to a flight of this race.
        SolverCrash: the solver process died.
    """
    if not results:
        return
    solver = settings.solver
    with SolverService(compiled=solver.compile_kernels, stall_seconds=solver.stall_seconds) as service:
        for result in results:
            yield result, _recertify(race, settings, result, service)


def recertify(race: Race, settings: Settings, result: StageResult) -> Certificate:
    """Measure one stored result again, as `recertified` does."""
    ((_, certificate),) = recertified(race, settings, [result])
    return certificate


def _recertify(race: Race, settings: Settings, result: StageResult, service: SolverService) -> Certificate:
    flight = stage_flight(result.stage, race, settings, result.trajectory)
    problem, iterate = flight.problem(mesh_of(result.trajectory)), iterate_of(result.trajectory)
    multipliers = result.constraint_multipliers
    layout = Layout(problem)
    if multipliers.shape != (layout.constraints,):
        raise CheckpointError(
            f"{result.stage.value}: {multipliers.size} multipliers are stored, "
            f"but the race has {layout.constraints} constraints on this mesh"
        )
    kernels = build_kernels(problem.system, problem.scheme, compiled=settings.solver.compile_kernels)
    w, p = layout.pack(iterate), layout.parameter_values()
    error, _, _ = kkt_error(Evaluation(Assembly(layout, kernels)), layout, w, p, multipliers)
    stored = result.certificate
    claims_proof = stored is None or stored.compares_meshes
    claims = () if stored is None else tuple(item for item in stored.items if item.name == "solver")
    return certify(
        problem,
        iterate,
        examine(problem, iterate, multipliers, settings.certificate),
        settings.certificate,
        claim=claims[0] if claims else Item("solver", math.nan, 0.0, "", "says nothing"),
        status="" if stored is None else stored.solver_status,
        kkt_error=error.largest,
        coarser_race_time=_coarser_race_time(flight, settings, result, service) if claims_proof else None,
    )


def _coarser_race_time(flight: Flight, settings: Settings, result: StageResult, service: SolverService) -> float:
    """Return the race time of the optimum on the mesh that the result's was divided from, s.

    NaN if there is no such mesh, if it is not everywhere coarser by half, or if no optimum is found on it.
    """
    kept = result.mesh.coarser
    nodes = np.flatnonzero(kept)
    whole = kept.shape == result.trajectory.time.shape and bool(kept[result.trajectory.first_node].all())
    if not whole or np.diff(nodes).min(initial=2) < 2:
        return math.nan
    mesh, guess = restrict(mesh_of(result.trajectory), iterate_of(result.trajectory), kept)
    bench = Workbench(service, settings, Silent())
    solution = bench.solve(flight.problem(mesh), guess, "half of the intervals", barrier=REFINED_BARRIER)
    return float(solution.iterate.durations.sum()) if solution is not None and solution.success else math.nan


def sampler(race: Race, result: StageResult) -> Callable[[Array], Mapping[str, Array]]:
    """Return the function that gives the states at any times: from times in s, shape (n,), to histories by name.

    They are integrated from the node before.
    """
    model, iterate = stage_model(result.stage, race), iterate_of(result.trajectory)
    names = [quantity.name for quantity in model.system.states]
    time = result.trajectory.time

    def at(times: Array) -> Mapping[str, Array]:
        values = sample(model.system, model.parameter_values, iterate, time=time, times=times)
        return dict(zip(names, np.asarray(values), strict=True))

    return at
