"""The problems of all stages of a race, made beside what is solved, and the starts from one to the next."""

import dataclasses
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from typing import Self

from airrace.optimal_control.solvers.service import SolverService
from airrace.optimal_control.system import SYMBOLS
from airrace.procedure.control.simulation import TrackingSimulator, tracking_simulator
from airrace.procedure.fidelity import Fidelity, fidelity_of
from airrace.procedure.planning.plan import Plan, plan_from_solution
from airrace.procedure.result import PylonCondition, StageResult
from airrace.procedure.settings import Settings
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage import Stage
from airrace.procedure.stage_problem import StageProblem, formulate, without_pilot_limits
from airrace.procedure.warm_start import Start, map_controls, track, trimmed_start
from airrace.race import Race
from airrace.runtime.interrupts import defer_signals


@dataclass(frozen=True)
class StageModels:
    """The problems of the stages of a race and the simulators of their models, as futures.

    Attributes:
        race: the course, the aircraft and the air.
        plan: the race's own plan.
        problems: by stage.
        simulators: by stage, where a flight of the stage below is followed by simulation.
    """

    race: Race
    plan: Plan
    problems: Mapping[Stage, Future[StageProblem]]
    simulators: Mapping[Stage, Future[TrackingSimulator]]

    @classmethod
    def request(cls, maker: Executor, race: Race, settings: Settings, plan: Plan, stages: Sequence[Stage]) -> Self:
        """Request the models of stages.

        Args:
            maker: makes one after the other.
            race: the course, the aircraft and the air.
            settings: how the race is solved.
            plan: the race's own plan.
            stages: in the order in which they are needed. The point mass and the homotopy are always made: where a
                start fails, they are another one.
        """
        problems: dict[Stage, Future[StageProblem]] = {}
        simulators: dict[Stage, Future[TrackingSimulator]] = {}
        for stage in dict.fromkeys((*stages, Stage.POINT_MASS, Stage.HOMOTOPY)):
            fidelity = fidelity_of(stage)
            if fidelity.is_guess and Stage.POINT_MASS not in problems:
                problems[Stage.POINT_MASS] = maker.submit(_formulate, Stage.POINT_MASS, race, settings, plan)
            if fidelity.is_guess:
                problems[stage] = maker.submit(_as_guess, problems[Stage.POINT_MASS], fidelity, race)
            elif stage not in problems:
                problems[stage] = maker.submit(_formulate, stage, race, settings, plan)
            if fidelity.inner_controller is not None and fidelity.warm_start.same_dynamics_as is None:
                simulators[stage] = maker.submit(_simulator, problems[stage])
        return cls(race, plan, problems, simulators)

    def problem(self, stage: Stage) -> StageProblem:
        """Return the problem of a stage, along the race's own plan.

        A thread that holds `SYMBOLS` must not ask: the thread that makes the models may need it.

        Raises:
            InputError: aircraft and rules leave no allowed value of some quantity.
        """
        return self.problems[stage].result()

    def problem_along(self, stage: Stage, optimum: StageResult) -> StageProblem:
        """Return the problem of a stage, planned as an optimum goes round."""
        stage_problem = self.problem(stage)
        route = plan_from_solution(self.race.course, stage_problem.plan.cruise, optimum.trajectory)
        return dataclasses.replace(stage_problem, plan=route).with_conditions(optimum.pylon_conditions)

    def preload(self, stage: Stage, service: SolverService, conditions: Sequence[PylonCondition] = ()) -> None:
        """Let a solver process load the equations of a stage, the scheme that integrates them, and what is observed.

        Args:
            conditions: on pylons, of the stages that are solved already.
        """
        stage_problem = self.problem(stage).with_conditions(conditions)
        problem = stage_problem.problem([(1.0,)] * (len(stage_problem.plan.waypoints) - 1))
        service.preload(problem.system, problem.scheme, problem.observations)


def start_along(models: StageModels, session: SolverSession, stage: Stage, below: StageResult) -> Start:
    """Return the start of a stage along the optimum of a lower one."""
    stage_problem, source = models.problem_along(stage, below), models.problem_along(below.stage, below)
    if stage_problem.fidelity.warm_start.same_dynamics_as is below.stage:
        return map_controls(stage_problem, source, below)
    session.progress.activity(f"flying along the optimum of {below.stage.value} by error feedback", 0, 0)
    with defer_signals():
        return track(stage_problem, models.simulators[stage].result(), source, below)


def start_trimmed(models: StageModels, stage: Stage, optimum: StageResult) -> Start:
    """Return the start of a stage trimmed, node by node, in the optimum of a lower one."""
    stage_problem, source = models.problem_along(stage, optimum), models.problem_along(optimum.stage, optimum)
    with SYMBOLS, defer_signals():
        return trimmed_start(stage_problem, source, optimum)


def _formulate(stage: Stage, race: Race, settings: Settings, plan: Plan) -> StageProblem:
    with SYMBOLS:
        return formulate(stage, race, settings, plan=plan)


def _as_guess(point_mass: Future[StageProblem], fidelity: Fidelity, race: Race) -> StageProblem:
    """Return the point mass as the stage that only guesses its flight: without the limits of a pilot."""
    stage_problem = point_mass.result()
    with SYMBOLS:
        return dataclasses.replace(without_pilot_limits(stage_problem, race), fidelity=fidelity)


def _simulator(problem: Future[StageProblem]) -> TrackingSimulator:
    stage_problem = problem.result()
    with SYMBOLS:
        return tracking_simulator(stage_problem.model, stage_problem.fidelity.controller())
