"""The problem of a stage: a race's plan and the equations of the aircraft, discretised on any mesh."""

import dataclasses
import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Self

import numpy as np

from airrace.model.aircraft import Aircraft
from airrace.model.dynamics.flight_model import COUNTING, FlightModel, RollReset
from airrace.model.dynamics.observations import crossing_observation
from airrace.model.dynamics.outer_loop import LoadFactors, load_factors
from airrace.model.frames import QUATERNION, angles, rotation
from airrace.model.track.course import ClearanceRule, Course, Passage, PilotLimits
from airrace.optimal_control.mesh_refinement import Mesh, restrict
from airrace.optimal_control.problem import Iterate, Objective, PathConstraint, Phase, Problem
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.replay import interval_durations
from airrace.optimal_control.system import Observation, System, at_points
from airrace.optimal_control.trajectory import Array, Trajectory
from airrace.procedure.fidelity import Fidelity, fidelity_of, iterate_of, stage_model
from airrace.procedure.formulation import (
    PilotConditions,
    StartAirspeed,
    Trim,
    boundaries,
    passings_of,
    path_constraints,
)
from airrace.procedure.guess import leg_seconds
from airrace.procedure.planning.plan import Plan, plan_from_solution, plan_race
from airrace.procedure.planning.planning_model import cruise
from airrace.procedure.planning.route_decisions import Waypoint
from airrace.procedure.pylon_conditions import ClearanceConstraints
from airrace.procedure.result import GateSplit, PylonCondition, StageResult
from airrace.procedure.settings import Settings
from airrace.procedure.stage import Stage
from airrace.race import Race

RESET_WEIGHT = 1e-7
"""The weight of the squared, scaled controls that wind back the counter of rolls, 1/s.

They matter only where a roll begins; this is enough to make them unique, and too little to be seen in a race time.
"""
FULL_THROTTLE = 1e-4
"""The reward for full throttle at the finish, s.

Over the last interval, some milliseconds, the commanded throttle changes the race time by 1e-9 s, less than the barrier
parameter lets a solver see, and it ended anywhere. This keeps it where it is, and is too little to be seen in a race
time.
"""
DETOUR, DETOUR_SECONDS = 3.0, 10.0
"""The longest duration of a phase: a factor on the plan (1), and a time on top (s)."""
SHORTEST_SHARE, SHORTEST_SECONDS = 1.0 / 3.0, 0.1
"""The shortest duration of a phase: a share of the plan (1), and a time (s) of which no more is asked."""


@dataclasses.dataclass(frozen=True)
class StageProblem:
    """The model of one stage flying a planned race.

    Attributes:
        observation: the crossing of a passage, seen from the model's states.
        trim: the condition on a settled start or finish; None where the course has none.
        path_constraints: along each leg, besides the aircraft's limits.
        weights: of the squared, scaled controls, by name.
        clearance: the conditions that the wing keeps clear of pylons; None where the rules ask for none.
        pilot: the limits of the pilot; None likewise.
        start_airspeed: what the speed at the start is; None where it is that over ground.
    """

    fidelity: Fidelity
    plan: Plan
    model: FlightModel
    course: Course
    observation: Observation
    trim: Trim | None
    path_constraints: tuple[tuple[PathConstraint, ...], ...]
    aircraft: Aircraft
    weights: Mapping[str, float]
    clearance: ClearanceConstraints | None = None
    pilot: PilotConditions | None = None
    start_airspeed: StartAirspeed | None = None

    @property
    def stage(self) -> Stage:
        """The stage that flies."""
        return self.fidelity.stage

    @property
    def longest_interval(self) -> float:
        """The longest interval of a mesh before it is halved, s; infinite where any length will do."""
        return self.fidelity.longest_interval

    @property
    def pylon_conditions(self) -> tuple[PylonCondition, ...]:
        """The conditions that the wing keeps clear of pylons."""
        return () if self.clearance is None else self.clearance.conditions_on(self.plan)

    def with_conditions(self, conditions: Sequence[PylonCondition]) -> Self:
        """Return the problem with other conditions on pylons, as far as the rules ask for any."""
        return dataclasses.replace(self, clearance=self.clearance and self.clearance.with_conditions(conditions))

    @property
    def _rewards(self) -> dict[str, float]:
        """The weights of the final state by name; a fidelity of an extension may have no throttle."""
        return {state.name: -FULL_THROTTLE for state in self.model.system.states if state.name == "delta_T"}

    def problem(self, mesh: Sequence[tuple[float, ...]]) -> Problem:
        """Return the joint problem over all phases; `mesh` holds the fractions of each."""
        conditions = self.observation, self.trim, self.aircraft.airframe.b, self.pilot, self.start_airspeed
        start, *ends = boundaries(self.plan, self.course, *conditions)
        pilot = () if self.pilot is None else self.pilot.along
        clearances = [()] * len(ends) if self.clearance is None else self.clearance.path_constraints(self.plan)
        legs = zip(
            *(
                itertools.pairwise(self.plan.waypoints),
                leg_seconds(self.plan),
                mesh,
                ends,
                self.path_constraints,
                clearances,
            ),
            strict=True,
        )
        phases: list[Phase] = []
        for (begin, finish), seconds, fractions, end, own, clearance in legs:
            shortest = min(SHORTEST_SHARE * seconds, SHORTEST_SECONDS)
            phases.append(
                Phase(
                    name=f"{begin.passage.name} -> {finish.passage.name}",
                    fractions=fractions,
                    duration=Interval(shortest, DETOUR * seconds + DETOUR_SECONDS),
                    end=end,
                    bounds=COUNTING if finish.passage.roll is not None else {},
                    path_constraints=(*own, *pilot, *clearance),
                )
            )
        return Problem(
            system=self.model.system,
            parameters=tuple(float(value) for value in self.model.parameter_values),
            # Intervals end with a unit quaternion; the first one must begin with one, or its length is arbitrary.
            start=dataclasses.replace(start, bounds={**start.bounds, "attitude_norm": Interval.exactly(1.0)}),
            phases=tuple(phases),
            objective=Objective(time=1.0, terminal=self._rewards, regularisation=self.weights),
            scheme=self.fidelity.scheme,
            time_scale=3.0,  # s, the scale of the phases' durations
        )


def formulate(
    stage: Stage,
    race: Race,
    settings: Settings,
    route: Trajectory | None = None,
    conditions: Sequence[PylonCondition] = (),
    *,
    plan: Plan | None = None,
) -> StageProblem:
    """Return the problem of a stage: the race as planned, in the equations of that stage.

    Args:
        route: a flight whose decisions the plan makes, too; without one it is the race's own plan.
        conditions: on pylons; without any, those of the passings hold.
        plan: the race's own plan, where it is known; else it is made.

    Raises:
        InputError: aircraft and rules leave no allowed value of some quantity.
    """
    course, model = race.course, stage_model(stage, race)
    if route is not None:
        plan = plan_from_solution(course, cruise(race.aircraft, course.rules), route)
    elif plan is None:
        plan = plan_race(race)
    crossing, clearance = crossing_observation(model.system.states), None
    if course.rules.clearance is ClearanceRule.FLIGHT or course.obstacles:
        clearance = ClearanceConstraints.of(model, course, race.aircraft.airframe.b).with_conditions(conditions)
    return StageProblem(
        fidelity=fidelity_of(stage),
        plan=plan,
        model=model,
        course=course,
        observation=crossing,
        trim=Trim.of(model, crossing) if any(course.settled_ends) else None,
        path_constraints=path_constraints(course, model.system.states),
        aircraft=race.aircraft,
        weights=regularisation_weights(model, settings.regularisation),
        clearance=clearance,
        pilot=PilotConditions.of(model, course.rules),
        start_airspeed=StartAirspeed.of(model, course.rules, race.air),
    )


def without_pilot_limits(stage_problem: StageProblem, race: Race) -> StageProblem:
    """Return a problem of a race as if its rules had no limits of a pilot.

    A guess need not keep them: with them the homotopy of a shipped course takes 673 iterations, without 245.
    """
    rules = dataclasses.replace(race.course.rules, pilot=PilotLimits())
    course = dataclasses.replace(race.course, rules=rules)
    model = stage_model(stage_problem.stage, dataclasses.replace(race, course=course))
    return dataclasses.replace(stage_problem, model=model, course=course, pilot=None)


def regularisation_share(problem: Problem, iterate: Iterate, objective: float) -> float:
    """Return what the regularisation is of the objective, s: all but the race time and the cost of the final state.

    Args:
        problem: of a stage.
        iterate: its optimum.
        objective: the value of the objective there, s.
    """
    names = [state.name for state in problem.system.states]
    final = 0.0
    for name, weight in problem.objective.terminal.items():
        final += weight * float(iterate.state[names.index(name), -1])
    return objective - float(iterate.durations.sum()) - final


def trajectory_of(problem: Problem, iterate: Iterate) -> Trajectory:
    """Return the named histories of an iterate."""
    steps = interval_durations(problem, iterate.durations)
    return Trajectory(
        phases=tuple(phase.name for phase in problem.phases),
        first_node=np.array(problem.first_node, dtype=np.int64),
        durations=iterate.durations,
        time=np.concatenate([[0.0], np.cumsum(steps)]),
        states=problem.system.states,
        state=iterate.state,
        controls=problem.system.controls,
        control=iterate.control,
    )


def mesh_of(trajectory: Trajectory) -> list[tuple[float, ...]]:
    """Return the fractions of every phase's intervals of a flight."""
    return fractions_of(trajectory.time, trajectory.first_node.tolist())


def coarse_mesh(optimum: StageResult) -> tuple[Mesh, Iterate]:
    """Return an optimum on the mesh from which its own was divided, on its own where there is none."""
    mesh, iterate, nodes = mesh_of(optimum.trajectory), iterate_of(optimum.trajectory), optimum.coarser_nodes
    if nodes.all() or not nodes[optimum.trajectory.first_node].all():
        return mesh, iterate
    return restrict(mesh, iterate, nodes)


def fractions_of(time: Array, first_node: Sequence[int]) -> list[tuple[float, ...]]:
    """Return the fractions of every phase's intervals.

    Args:
        time: of the nodes, s; shape (N + 1,).
        first_node: the node at which each phase begins and, last, the end.
    """
    steps = np.split(np.diff(time), first_node[1:-1])
    return [tuple((phase_steps / phase_steps.sum()).tolist()) for phase_steps in steps]


def gate_splits(stage_problem: StageProblem, trajectory: Trajectory) -> tuple[GateSplit, ...]:
    """Return one row per passage."""
    q = [trajectory[name] for name in QUATERNION]
    V_K, z, n_z = trajectory["V_K"], trajectory["z"], history(stage_problem, trajectory, "n_z")
    splits: list[GateSplit] = []
    for waypoint, node in zip(stage_problem.plan.waypoints, trajectory.first_node.tolist(), strict=True):
        heading, climb, bank = angles(rotation([float(component[node]) for component in q]))
        splits.append(
            GateSplit(
                name=waypoint.passage.name,
                time=float(trajectory.time[node]),
                V_K=float(V_K[node]),
                height=-float(z[node]),
                n_z=float(n_z[node]),
                bank=bank,
                climb=climb,
                heading=heading,
            )
        )
    return tuple(splits)


def history(stage_problem: StageProblem, trajectory: Trajectory, name: str) -> Array:
    """Return a state or a path quantity at the nodes, shape (N + 1,).

    The last node has the controls of the last interval.
    """
    system = stage_problem.model.system
    names = [quantity.name for quantity in system.path]
    if name not in names:
        return trajectory[name]
    assert system.path_values is not None  # it has path quantities
    control = np.hstack([trajectory.control, trajectory.control[:, -1:]])
    values = at_points(system.path_values, trajectory.state, control, stage_problem.model.parameter_values)
    return values[names.index(name)]


def regularisation_weights(model: FlightModel, weight: float) -> dict[str, float]:
    """Return the weights of the squared, scaled states and controls by name.

    A rate counts `weight` where it is brisk, the attitude where the aircraft is upside down: `q1^2 + q2^2` is
    `(1 - cos(bank) cos(climb)) / 2`. Without the latter it hardly matters where on a long leg the aircraft rolls over,
    and solvers are slow to find the best place: on a generated course state space took 3,110 iterations, with it 259.
    """
    controls = model.system.controls
    # Half of the fastest rate, where the model has none of its own.
    half = {control.name: 0.5 * max(-control.lower, control.upper) for control in controls}
    brisk = {**half, **model.brisk}
    weights = {
        control.name: weight * (control.scale / brisk[control.name]) ** 2 for control in controls if control.rate_of
    }
    resets = {name: RESET_WEIGHT for name in RollReset.names() if any(control.name == name for control in controls)}
    return weights | dict.fromkeys(QUATERNION[1:3], weight) | resets


class OtherStructureError(Exception):
    """An error of a problem that differs from the one that was solved in more than numbers."""


class PerturbedProblem:
    """The problem of one stage, stated anew for races that differ from the solved one in numbers alone.

    Plan, mesh and the weights of the regularisation stay those of the solved race, and so do the functions of
    its model, for in a race that differs in numbers only parameters and limits differ.
    """

    def __init__(self, race: Race, stage_problem: StageProblem, mesh: Sequence[tuple[float, ...]]) -> None:
        """Begin with a race as its problem states it on a mesh.

        Args:
            race: the solved race.
            stage_problem: its problem.
            mesh: the fractions of each phase.
        """
        self.race = race
        self.stage_problem = stage_problem
        self._mesh = mesh

    @classmethod
    def of_result(cls, race: Race, settings: Settings, result: StageResult) -> Self:
        """Begin with a stage that was solved: with its route, and on its mesh."""
        stage_problem = formulate(result.stage, race, settings, result.trajectory, result.pylon_conditions)
        return cls(race, stage_problem, mesh_of(result.trajectory))

    def problem(self, race: Race) -> Problem:
        """Return the problem of a race; see `formulation` for the errors."""
        return self.formulation(race).problem(self._mesh)

    def formulation(self, race: Race) -> StageProblem:
        """Return the problem of a race along the plan of the solved race.

        Raises:
            InputError: aircraft and rules leave no allowed value of some quantity.
            OtherStructureError: the race differs in more than numbers.
        """
        solved, course, original = self.stage_problem, race.course, self.race.course
        model, constraints = solved.model, solved.path_constraints
        if _kinds_of_conditions(course) != _kinds_of_conditions(original):
            raise OtherStructureError
        if (race.aircraft, race.air, course.rules) != (self.race.aircraft, self.race.air, original.rules):
            built = solved.fidelity.build(race.aircraft, course.rules, race.air, counting=course.has_rolls)
            if _equations(built.system) != _equations(model.system):
                raise OtherStructureError
            system = dataclasses.replace(
                model.system, states=built.system.states, controls=built.system.controls, path=built.system.path
            )
            model = dataclasses.replace(built, system=system)
        if _surroundings(course) != _surroundings(original):
            constraints = path_constraints(course, model.system.states)
        span = race.aircraft.airframe.b
        return dataclasses.replace(
            solved,
            plan=with_passages(solved.plan, course),
            model=model,
            course=course,
            trim=solved.trim and solved.trim.of_other_numbers(model),
            path_constraints=constraints,
            aircraft=race.aircraft,
            clearance=solved.clearance and solved.clearance.of_other_numbers(model, course, span, solved.plan),
            pilot=solved.pilot and solved.pilot.of_other_numbers(model, course.rules),
            start_airspeed=solved.start_airspeed and solved.start_airspeed.of_other_numbers(race.air),
        )


def _equations(system: System) -> object:
    """Return what decides which equations a model has: the name says the kind of wind."""
    return system.name, [parameter.name for parameter in system.parameters]


def _kinds_of_conditions(course: Course) -> object:
    """Return what decides of which kinds the conditions of a course are, whatever their numbers."""
    rules = course.rules
    clearance = rules.clearance, bool(course.obstacles)
    limits = dataclasses.astuple(rules.pilot)
    pilot = [math.isfinite(limit) if isinstance(limit, float) else limit for limit in limits]
    ends = course.settled_ends, rules.start_speed
    # Where another choice is allowed at a passing, its axis and bank do not follow from those of the known plan.
    choices = [
        (
            passage.direction,
            passage.roll and passage.roll.turning,
            passage.element.two_edged,
            passage.element.prescribed_bank is None,
        )
        for passage in course.passages
    ]
    return passings_of(course), choices, clearance, pilot, ends


def _surroundings(course: Course) -> tuple[object, ...]:
    """Return all of a course on which path constraints depend."""
    own = tuple((passage.safety_lines, passage.roll) for passage in course.passages)
    return course.airspace, course.crowd, own


def with_passages(plan: Plan, course: Course) -> Plan:
    """Return a plan for a course whose passages differ from the planned ones in numbers alone, on the same route
    round.

    Axes and prescribed banks turn with their elements; sides, directions and planned durations stay.
    """
    waypoints = (
        _at_new_place(waypoint, passage) for waypoint, passage in zip(plan.waypoints, course.passages, strict=True)
    )
    return dataclasses.replace(plan, waypoints=tuple(waypoints))


def _at_new_place(waypoint: Waypoint, passage: Passage) -> Waypoint:
    before, after = waypoint.passage.element, passage.element
    bank = waypoint.bank
    if bank is not None:
        bank += (after.prescribed_bank or 0.0) - (before.prescribed_bank or 0.0)
    return dataclasses.replace(
        waypoint, passage=passage, axis=waypoint.axis + (after.axis or 0.0) - (before.axis or 0.0), bank=bank
    )


def load_factors_along(stage_problem: StageProblem, trajectory: Trajectory) -> LoadFactors[Array]:
    """Return load factors (g) and roll rate (rad/s) at the nodes of a stage's flight, each of shape (N + 1,)."""
    control = np.hstack([trajectory.control, trajectory.control[:, -1:]])
    values = at_points(
        load_factors(stage_problem.model.system), trajectory.state, control, stage_problem.model.parameter_values
    )
    return LoadFactors[Array].split(values)
