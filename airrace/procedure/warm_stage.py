"""A stage ready to be solved again under other numbers: no model is built, no process started, no mesh looked for.

The optimum of the changed race is solved from a known one with its multipliers, on its mesh and under its conditions on
pylons. Conditions are placed again where a wing comes too near, and intervals are halved where the replay asks for it:
what comes out is measured like any stage that is solved on one mesh. Its route is that of the known optimum.
"""

from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import replace
from functools import cached_property

from airrace.optimal_control.layout import Layout
from airrace.optimal_control.solvers.interface import Multipliers
from airrace.optimal_control.solvers.service import SolverService
from airrace.procedure.cost_to_go import Continuation, CostToGo
from airrace.procedure.fidelity import iterate_of
from airrace.procedure.formulation import ensure_same_passings, passings_of
from airrace.procedure.mesh_check import solve_on_second_mesh
from airrace.procedure.mesh_loop import carry_multipliers, solve_from_starts
from airrace.procedure.planning.plan import plan_race
from airrace.procedure.result import Silent, StageProvenance, StageResult
from airrace.procedure.settings import Settings
from airrace.procedure.single_mesh import solve_single_mesh
from airrace.procedure.solver_session import Budget, SolverSession
from airrace.procedure.stage_problem import (
    OtherStructureError,
    PerturbedProblem,
    StageProblem,
    coarse_mesh,
    formulate,
    mesh_of,
    regularisation_weights,
)
from airrace.procedure.warm_start import InitialBarrier, Start
from airrace.race import Race

SPARE_SHARE = 0.6
"""Share of the certificate's limits on errors of the mesh up to which the mesh of the known optimum is refined; races
that differ a little then rarely need another one."""
ITERATIONS_MAX = 60
"""The iterations of a solve. Races that differ by what a hand moves at a time take 4 to 12; what takes more than 60 is
another route or no flight, and ends at once."""
STALL_SECONDS = 5.0
"""The longest wait for an iteration, which takes 5 to 50 ms."""
PREPARED_INTERVALS = 2500
"""The intervals that the solver process keeps ready. Conditions on pylons come and go as a gate moves, and each set of
them is another problem; 200 MB at most."""


class WarmStage:
    """A stage of one race, its optimum, and a solver process that knows its equations, until it is closed.

    Args:
        race: the race that the optimum flies.
        settings: by which it is solved.
        optimum: the stage, certified or solved on one mesh.
        threads: threads that evaluate derivatives.

    Raises:
        SolverCrash: the solver process died.
    """

    def __init__(self, race: Race, settings: Settings, optimum: StageResult, *, threads: int = 1) -> None:
        solver = replace(settings.solver, iterations_max=ITERATIONS_MAX, fallback=settings.solver.primary)
        self._settings, self._threads = replace(settings, solver=solver), threads
        self._perturbed = PerturbedProblem.of_result(race, settings, optimum)
        self._budget = Budget.from_plan(plan_race(race), settings.mesh)
        self._services: list[SolverService] = []
        self._service = self._new_service(threads)
        spare, limits = SPARE_SHARE, settings.certificate
        limits = replace(limits, replay=spare * limits.replay, hamiltonian=spare * limits.hamiltonian)
        self._stage_problem = stage_problem = self._perturbed.stage_problem
        try:
            resolved = self._solve(
                stage_problem, stage_problem, optimum, replace(self._settings, certificate=limits), coarse=True
            )
        except BaseException:
            self.close()
            raise
        self.optimum = resolved if resolved.holds else optimum

    def close(self) -> None:
        """End the solver processes; what is solved meanwhile fails."""
        for service in self._services:
            service.end()

    def solve(self, race: Race, start: StageResult | None = None) -> StageResult:
        """Return the optimum of a race on the route of the known one, measured but for mesh convergence.

        Args:
            race: with the same passings.
            start: a nearer optimum of this stage, solved from here; None for the one that this began with.

        Raises:
            InputError: aircraft and rules leave no allowed value of some quantity.
            UsageError: the race has other passings.
            SolverCrash: the solver process died.
        """
        optimum, before = start or self.optimum, self._perturbed.stage_problem
        return self._solve(before, self._formulation(race, optimum), optimum, self._settings)

    def from_state(
        self,
        state: Mapping[str, float],
        leg: int,
        *,
        deviations: Mapping[str, float] | None = None,
        gates: int | None = None,
    ) -> Continuation:
        """Return the fastest flight of the known race from a state on; see `CostToGo.solve`."""
        with closing(self._session(self._settings, self._service)) as session:
            return self._rest.solve(session, state, leg, deviations=deviations, gates=gates)

    def mesh_check(self, race: Race, solved: StageResult) -> Callable[[], StageResult]:
        """Return the check of an optimum's mesh, in a solver process of its own, beside which others can be solved.

        It returns the optimum certified, and as it was where that fails.
        """
        stage_problem = self._formulation(race, solved).with_conditions(solved.pylon_conditions)

        def check() -> StageResult:
            with closing(self._session(self._settings, self._checker)) as session:
                checked = solve_on_second_mesh(stage_problem, solved, session)
            return checked if isinstance(checked, StageResult) else solved

        return check

    @cached_property
    def _rest(self) -> CostToGo:
        return CostToGo(self._stage_problem, self.optimum)

    @cached_property
    def _checker(self) -> SolverService:
        return self._new_service(1)

    def _new_service(self, threads: int) -> SolverService:
        service = SolverService(
            threads=threads,
            stall_seconds=min(STALL_SECONDS, self._settings.solver.stall_seconds),
            prepared_intervals=PREPARED_INTERVALS,
        )
        self._services.append(service)
        return service

    def _formulation(self, race: Race, optimum: StageResult) -> StageProblem:
        """Return the flight of a race; where it differs in more than numbers, its equations are used from now on."""
        ensure_same_passings(passings_of(race.course), passings_of(self._perturbed.race.course), "the known optimum")
        try:
            stage_problem = self._perturbed.formulation(race)
            return replace(
                stage_problem, weights=regularisation_weights(stage_problem.model, self._settings.regularisation)
            )
        except OtherStructureError:
            stage_problem = formulate(optimum.stage, race, self._settings, optimum.trajectory, optimum.pylon_conditions)
            self._perturbed = PerturbedProblem(race, stage_problem, mesh_of(optimum.trajectory))
            return stage_problem

    def _solve(
        self,
        before: StageProblem,
        after: StageProblem,
        optimum: StageResult,
        settings: Settings,
        *,
        coarse: bool = False,
    ) -> StageResult:
        """Solve a flight from the optimum of another one, by choice on the mesh from which its own was divided."""
        source, target = (problem.with_conditions(optimum.pylon_conditions) for problem in (before, after))
        mesh, guess = coarse_mesh(optimum) if coarse else (mesh_of(optimum.trajectory), iterate_of(optimum.trajectory))
        multipliers = Multipliers(optimum.constraint_multipliers, optimum.bound_multipliers)
        whole = source.problem(mesh_of(optimum.trajectory))
        layout, start_multipliers = Layout(whole), None  # multipliers of another shape belong to other limits
        if multipliers.constraints.shape == (layout.constraints,) and multipliers.bounds.shape == (layout.unknowns,):
            start_multipliers = carry_multipliers(multipliers, whole, target.problem(mesh))
        provenance = StageProvenance(source_stage=optimum.stage.value)
        start = Start(target, target.problem(mesh), guess, InitialBarrier.OTHER_MESH, provenance, start_multipliers)
        with closing(self._session(settings, self._service)) as session:
            return solve_from_starts(session, [lambda: start], solve_single_mesh)

    def _session(self, settings: Settings, service: SolverService) -> SolverSession:
        return SolverSession(service, settings, Silent(), self._threads, budget=replace(self._budget))
