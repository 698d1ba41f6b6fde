"""A run: the stages in order, each started from the one before. The edges consume the results as they come."""

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from airrace.errors import CheckpointError
from airrace.optimal_control.audit import audit
from airrace.optimal_control.certificate import Certificate, Item
from airrace.optimal_control.integration import load_in_background
from airrace.optimal_control.kernels import build_kernels
from airrace.optimal_control.kkt import kkt_error
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.replay import replay
from airrace.optimal_control.sampling import sample
from airrace.optimal_control.service import SolverService
from airrace.optimal_control.transcription import transcribe
from airrace.procedure.flight import PointMassFlight, iterate_of, mesh_of, point_mass_flight
from airrace.procedure.guess import first_mesh, guess
from airrace.procedure.homotopy import fly_homotopy
from airrace.procedure.point_mass import COLD_BARRIER, WARM_BARRIER, Start, optimise_point_mass, tolerances
from airrace.procedure.progress import Progress
from airrace.procedure.race import Race
from airrace.procedure.result import Outcome, Stage, StageResult
from airrace.procedure.settings import GuessKind, Settings
from airrace.procedure.solving import Workbench
from airrace.trajectory import Array

STAGES = (Stage.HOMOTOPY, Stage.POINT_MASS)
"""The stages that can be run, in order."""


def optimise(
    race: Race,
    settings: Settings,
    *,
    until: Stage,
    threads: int,
    finished: Sequence[StageResult] = (),
    progress: Progress,
) -> Iterator[StageResult]:
    """Run the stages up to `until` that are not in `finished`; yield each result as it is finished.

    A stage that fails is yielded, too, and is the last.

    Raises:
        InputError: aircraft and rules contradict each other.
        SolverCrash: the solver process died.
    """
    done = {result.stage: result for result in finished}
    flight = point_mass_flight(race, settings)
    wanted = [stage for stage in _stages(settings) if STAGES.index(stage) <= STAGES.index(until)]
    if all(stage in done for stage in wanted):
        return
    solver = settings.solver
    with SolverService(
        threads=threads,
        compiled=solver.compile_kernels,
        stall_seconds=solver.stall_seconds,
        on_notice=lambda text: progress.activity(text, 0, 0),
    ) as service:
        load_in_background()
        bench = Workbench(service, settings, progress)
        for stage in wanted:
            if stage in done:
                continue
            progress.stage_started(stage)
            bench.begin()
            result = _run_stage(stage, flight, bench, done)
            progress.stage_finished(result)
            done[stage] = result
            yield result
            if result.outcome is not Outcome.SOLVED:
                return


def _stages(settings: Settings) -> tuple[Stage, ...]:
    """The stages of a run: with a guess from the plan there is no homotopy."""
    return STAGES if settings.guess is GuessKind.HOMOTOPY else (Stage.POINT_MASS,)


def _run_stage(
    stage: Stage, flight: PointMassFlight, bench: Workbench, done: Mapping[Stage, StageResult]
) -> StageResult:
    if stage is Stage.HOMOTOPY:
        return fly_homotopy(flight, bench)
    flown = done.get(Stage.HOMOTOPY)

    def planned() -> Start:
        mesh = first_mesh(flight.plan, bench.settings.mesh)
        return Start(flight.problem(mesh), guess(flight.plan, mesh), COLD_BARRIER)

    def pieced() -> Start:
        pieces = (flown or fly_homotopy(flight, bench)).trajectory
        return Start(flight.problem(mesh_of(pieces)), iterate_of(pieces), WARM_BARRIER)

    return optimise_point_mass(flight, bench, (pieced, planned) if flown else (planned, pieced))


def recertify(race: Race, settings: Settings, result: StageResult) -> Certificate:
    """Measure a stored result again, from its histories and multipliers alone; nothing is solved.

    Raises:
        CheckpointError: the stored multipliers do not belong to a flight of this race.
    """
    flight = point_mass_flight(race, settings)
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
    return Certificate("" if stored is None else stored.solver_status, (*claimed, kkt, *measured.items))


def sampler(race: Race, settings: Settings, result: StageResult) -> Callable[[Array], Mapping[str, Array]]:
    """Histories at any time, integrated from the node before; a function of times in s, shape (n,)."""
    flight = point_mass_flight(race, settings)
    problem, iterate = flight.problem(mesh_of(result.trajectory)), iterate_of(result.trajectory)
    names = [quantity.name for quantity in problem.system.states]
    time = result.trajectory.time

    def at(times: Array) -> Mapping[str, Array]:
        values = sample(problem, iterate, time, times)
        return dict(zip(names, np.asarray(values), strict=True))

    return at
