"""A race made ready for optimisation: its plan, the equations of the aircraft and the problem on any mesh."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from airrace.aircraft.aircraft import Aircraft
from airrace.dynamics.crossing import crossing_observation
from airrace.dynamics.flight_model import FlightModel
from airrace.dynamics.point_mass import build_point_mass
from airrace.frames import angles, rotation
from airrace.optimal_control.problem import Iterate, Problem, Watch
from airrace.optimal_control.replay import interval_durations
from airrace.procedure.cruise import cruise
from airrace.procedure.plan import Plan, plan
from airrace.procedure.race import Race
from airrace.procedure.result import GateSplit
from airrace.procedure.settings import Settings
from airrace.procedure.statement import race_problem
from airrace.procedure.watches import leg_watches
from airrace.system import Observation
from airrace.trajectory import Trajectory

REGULARISED = ("n_z_dot", "n_y_dot", "p_Kbar_dot")
DETERMINED = {"Phi_reset": 1e-7, "gain_reset": 1e-7}
"""Weights of controls that matter nowhere but where a roll begins: just enough to make them unique."""


@dataclass(frozen=True)
class PointMassFlight:
    """The point mass flying a planned race."""

    plan: Plan
    model: FlightModel
    observation: Observation
    watches: tuple[tuple[Watch, ...], ...]
    aircraft: Aircraft
    regularisation: float

    def problem(self, mesh: Sequence[tuple[float, ...]]) -> Problem:
        """The joint problem over all phases; `mesh` holds the fractions of each."""
        return race_problem(
            self.plan,
            mesh,
            watches=self.watches,
            model=self.model,
            observation=self.observation,
            aircraft=self.aircraft,
            regularised=dict.fromkeys(REGULARISED, self.regularisation) | (DETERMINED if self.plan.counting else {}),
        )


def point_mass_flight(race: Race, settings: Settings) -> PointMassFlight:
    """Plan the race and build the point mass's equations.

    Raises:
        InputError: aircraft and rules leave no allowed value of some quantity.
    """
    model = build_point_mass(race.aircraft, race.course.rules, race.air, counting=race.course.has_rolls)
    return PointMassFlight(
        plan=plan(race.course, cruise(race.aircraft, race.course.rules)),
        model=model,
        observation=crossing_observation(model.system.states),
        watches=leg_watches(race.course, model.system.states),
        aircraft=race.aircraft,
        regularisation=settings.regularisation,
    )


def trajectory(problem: Problem, iterate: Iterate) -> Trajectory:
    """The histories of an iterate, named."""
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
    """The fractions of every phase's intervals."""
    meshes: list[tuple[float, ...]] = []
    for first, last in itertools.pairwise(flown.first_node.tolist()):
        steps = np.diff(flown.time[first : last + 1])
        meshes.append(tuple((steps / steps.sum()).tolist()))
    return meshes


def iterate_of(flown: Trajectory) -> Iterate:
    """The unknowns of a stored flight."""
    return Iterate(flown.durations, flown.state, flown.control)


def gate_splits(course_plan: Plan, flown: Trajectory) -> tuple[GateSplit, ...]:
    """One row per passage."""
    q = [flown.of(name) for name in ("q0", "q1", "q2", "q3")]
    V_K, z, n_z = flown.of("V_K"), flown.of("z"), flown.of("n_z")
    splits: list[GateSplit] = []
    for waypoint, node in zip(course_plan.waypoints, flown.first_node.tolist(), strict=True):
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
