"""What can be told of a stored result: its certificate measured again, its histories at any time."""

from collections.abc import Callable, Mapping

import numpy as np

from airrace.errors import CheckpointError
from airrace.optimal_control.audit import audit
from airrace.optimal_control.certificate import Certificate, Item
from airrace.optimal_control.kernels import build_kernels
from airrace.optimal_control.kkt import kkt_error
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.replay import replay
from airrace.optimal_control.sampling import sample
from airrace.optimal_control.transcription import transcribe
from airrace.procedure.flight import iterate_of, mesh_of, stage_flight
from airrace.procedure.joint import tolerances, variations
from airrace.procedure.race import Race
from airrace.procedure.result import StageResult
from airrace.procedure.settings import Settings
from airrace.trajectory import Array


def recertify(race: Race, settings: Settings, result: StageResult) -> Certificate:
    """Measure a stored result again, from its histories and multipliers alone; nothing is solved.

    Raises:
        CheckpointError: the stored multipliers do not belong to a flight of this race.
    """
    flight = stage_flight(result.stage, race, settings)
    problem, iterate = flight.problem(mesh_of(result.trajectory)), iterate_of(result.trajectory)
    limits = settings.certificate
    layout = Layout(problem)
    if result.constraint_multipliers.shape != (layout.constraints,):
        raise CheckpointError(
            f"{result.stage.value}: {result.constraint_multipliers.size} multipliers are stored, "
            f"but the race has {layout.constraints} constraints on this mesh"
        )
    kernels = build_kernels(problem.system, problem.scheme, compiled=settings.solver.compile_kernels)
    program = transcribe(layout, kernels)
    w, p = layout.pack(iterate), layout.parameter_values()
    error, _, _ = kkt_error(program, layout, w, p, result.constraint_multipliers)
    flown = replay(problem, iterate)
    measured = audit(problem, iterate, flown, tolerances=tolerances(limits), defect_limit=limits.replay)
    stored = result.certificate
    claimed = () if stored is None else tuple(item for item in stored.items if item.name == "solver")
    kkt = Item("kkt_error", error.largest, limits.kkt_error, "scaled", "")
    return Certificate(
        "" if stored is None else stored.solver_status,
        (*claimed, kkt, *measured.items, *variations(problem, iterate, limits)),
    )


def sampler(race: Race, settings: Settings, result: StageResult) -> Callable[[Array], Mapping[str, Array]]:
    """Histories at any time, integrated from the node before; a function of times in s, shape (n,)."""
    flight = stage_flight(result.stage, race, settings)
    problem, iterate = flight.problem(mesh_of(result.trajectory)), iterate_of(result.trajectory)
    names = [quantity.name for quantity in problem.system.states]
    time = result.trajectory.time

    def at(times: Array) -> Mapping[str, Array]:
        values = sample(problem, iterate, time, times)
        return dict(zip(names, np.asarray(values), strict=True))

    return at
