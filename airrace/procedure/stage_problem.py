"""A race made ready for optimisation: its plan, the equations of the aircraft and the problem on any mesh."""

from collections.abc import Mapping, Sequence

import numpy as np

from airrace.aircraft.aircraft import Aircraft
from airrace.dynamics.crossing import crossing_observation
from airrace.dynamics.flight_model import FlightModel, RollReset
from airrace.frames import angles, rotation
from airrace.optimal_control.problem import Iterate, PathConstraint, Problem
from airrace.optimal_control.replay import interval_durations
from airrace.planning.decisions_from_solution import plan_from_solution
from airrace.planning.plan import Plan
from airrace.planning.race import Race
from airrace.points import at_points
from airrace.procedure.boundary_conditions import Ends, course_ends
from airrace.procedure.fidelities import fidelity_of
from airrace.procedure.fidelity import Fidelity
from airrace.procedure.formulation import race_problem
from airrace.procedure.models import stage_model
from airrace.procedure.path_constraints import leg_watches
from airrace.procedure.result import GateSplit, Stage
from airrace.procedure.settings import Settings
from airrace.quantities import Quantity
from airrace.records import record
from airrace.system import Observation
from airrace.trajectory import Array, Trajectory

RESET_WEIGHT = 1e-7
"""The weight of the squared, scaled controls that wind back the counter of rolls, 1/s.

They matter only where a roll begins; this is enough to make them unique, and too little to be seen in a race time.
"""


@record
class Flight:
    """The model of one stage flying a planned race; `weights` of its squared, scaled controls, by name."""

    fidelity: Fidelity
    plan: Plan
    model: FlightModel
    observation: Observation
    ends: Ends
    watches: tuple[tuple[PathConstraint, ...], ...]
    aircraft: Aircraft
    weights: Mapping[str, float]

    @property
    def stage(self) -> Stage:
        """The stage that flies."""
        return self.fidelity.stage

    @property
    def longest_interval(self) -> float:
        """The longest interval of a mesh before it is halved, s; infinite where any length will do."""
        return self.fidelity.longest_interval

    def problem(self, mesh: Sequence[tuple[float, ...]]) -> Problem:
        """Return the joint problem over all phases; `mesh` holds the fractions of each."""
        return race_problem(
            self.plan,
            mesh,
            watches=self.watches,
            model=self.model,
            observation=self.observation,
            ends=self.ends,
            aircraft=self.aircraft,
            regularised=self.weights,
            scheme=self.fidelity.scheme,
        )


def stage_flight(stage: Stage, race: Race, settings: Settings, flown: Trajectory | None = None) -> Flight:
    """Return the flight of a stage: the race as planned, in the equations of that stage.

    Args:
        stage: which one.
        race: what is flown.
        settings: of the run.
        flown: a flight whose choices the plan makes, too; without one it is the race's own plan.

    Raises:
        InputError: aircraft and rules leave no allowed value of some quantity.
    """
    course, model = race.course, stage_model(stage, race)
    crossing = crossing_observation(model.system.states)
    return Flight(
        fidelity=fidelity_of(stage),
        plan=race.plan if flown is None else plan_from_solution(course, race.pace, flown),
        model=model,
        observation=crossing,
        ends=course_ends(course, model, crossing),
        watches=leg_watches(course, model.system.states),
        aircraft=race.aircraft,
        weights=regularised(model, settings.regularisation),
    )


def trajectory(problem: Problem, iterate: Iterate) -> Trajectory:
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


def mesh_of(flown: Trajectory) -> list[tuple[float, ...]]:
    """Return the fractions of every phase's intervals of a flight."""
    return fractions_of(flown.time, flown.first_node.tolist())


def fractions_of(time: Array, first_node: Sequence[int]) -> list[tuple[float, ...]]:
    """Return the fractions of every phase's intervals.

    Args:
        time: of the nodes, s; shape (N + 1,).
        first_node: the node at which each phase begins and, last, the end.
    """
    steps = np.split(np.diff(time), first_node[1:-1])
    return [tuple((one / one.sum()).tolist()) for one in steps]


def gate_splits(flight: Flight, flown: Trajectory) -> tuple[GateSplit, ...]:
    """Return one row per passage."""
    q = [flown.of(name) for name in ("q0", "q1", "q2", "q3")]
    V_K, z, n_z = flown.of("V_K"), flown.of("z"), history(flight, flown, "n_z")
    splits: list[GateSplit] = []
    for waypoint, node in zip(flight.plan.waypoints, flown.first_node.tolist(), strict=True):
        heading, climb, bank = angles(rotation([float(one[node]) for one in q]))
        splits.append(
            GateSplit(
                name=waypoint.passage.name,
                time=float(flown.time[node]),
                V_K=float(V_K[node]),
                height=-float(z[node]),
                n_z=float(n_z[node]),
                bank=bank,
                climb=climb,
                heading=heading,
            )
        )
    return tuple(splits)


def history(flight: Flight, flown: Trajectory, name: str) -> Array:
    """Return a state or a path quantity at the nodes, shape (N + 1,).

    The last node has the controls of the last interval.
    """
    system = flight.model.system
    names = [quantity.name for quantity in system.path]
    if name not in names:
        return flown.of(name)
    assert system.path_values is not None  # it has path quantities
    control = np.hstack([flown.control, flown.control[:, -1:]])
    values = at_points(system.path_values, flown.state, control, flight.model.parameter_values)
    return values[names.index(name)]


def regularised(model: FlightModel, weight: float) -> dict[str, float]:
    """Return the weights of the squared, scaled controls by name: a rate counts `weight` where it is brisk."""
    controls = model.system.controls
    weights = {one.name: weight * (one.scale / _brisk(model, one)) ** 2 for one in controls if one.rate_of}
    resets = {name: RESET_WEIGHT for name in RollReset.names() if any(one.name == name for one in controls)}
    return weights | resets


def _brisk(model: FlightModel, rate: Quantity) -> float:
    """Return a brisk rate: the model's own measure, else half of the fastest."""
    return model.brisk.get(rate.name, 0.5 * max(-rate.lower, rate.upper))
