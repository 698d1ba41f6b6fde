"""The problem of a stage, stated for inputs that differ in a number: same plan, same mesh."""

import dataclasses
from collections.abc import Sequence
from typing import Self

from airrace.optimal_control.problem import Problem
from airrace.planning.plan import Plan
from airrace.planning.race import Race
from airrace.planning.waypoints import Waypoint
from airrace.procedure.path_constraints import leg_watches
from airrace.procedure.result import StageResult
from airrace.procedure.settings import Settings
from airrace.procedure.stage_problem import Flight, mesh_of, stage_flight
from airrace.track.course import Course, Passage


class PerturbedProblem:
    """The problem of one stage, stated anew for races that differ from the one flown in numbers alone.

    Plan, mesh and the weights of the regularisation stay those of the race that was flown, and so do the functions of
    its model, for in a race that differs in numbers only parameters and limits differ.
    """

    def __init__(self, race: Race, flight: Flight, mesh: Sequence[tuple[float, ...]]) -> None:
        """Begin with a race as its flight states it on a mesh.

        Args:
            race: the race that was flown.
            flight: its flight.
            mesh: the fractions of each phase.
        """
        self.race = race
        self.flight = flight
        self._mesh = mesh

    @classmethod
    def of_result(cls, race: Race, settings: Settings, result: StageResult) -> Self:
        """Begin with a stage that was solved: with its route, and on its mesh."""
        flight = stage_flight(result.stage, race, settings, result.trajectory)
        return cls(race, flight, mesh_of(result.trajectory))

    def problem(self, race: Race) -> Problem:
        """Return the problem of a race.

        Raises:
            InputError: aircraft and rules leave no allowed value of some quantity.
        """
        return self.varied(race).problem(self._mesh)

    def varied(self, race: Race) -> Flight:
        """Return the flight of a race along the plan of the race that was flown."""
        flight, course, flown = self.flight, race.course, self.race.course
        model, watches = flight.model, flight.watches
        if (race.aircraft, race.air, course.rules) != (self.race.aircraft, self.race.air, flown.rules):
            built = flight.fidelity.build(race.aircraft, course.rules, race.air, counting=course.has_rolls)
            system = dataclasses.replace(
                model.system, states=built.system.states, controls=built.system.controls, path=built.system.path
            )
            model = dataclasses.replace(built, system=system)
        if _watched(course) != _watched(flown):
            watches = leg_watches(course, model.system.states)
        return dataclasses.replace(
            flight, plan=with_passages(flight.plan, course), model=model, watches=watches, aircraft=race.aircraft
        )


def _watched(course: Course) -> tuple[object, ...]:
    """Return all of a course that watches are made of."""
    own = tuple((passage.safety_lines, passage.roll) for passage in course.passages)
    return course.airspace, course.crowd, own


def with_passages(plan: Plan, course: Course) -> Plan:
    """Return a plan for a course whose passages differ from the planned ones in numbers alone, flown the same way
    round.

    Axes and prescribed banks turn with their elements; sides, directions and planned durations stay.
    """
    waypoints = (_moved(waypoint, passage) for waypoint, passage in zip(plan.waypoints, course.passages, strict=True))
    return dataclasses.replace(plan, waypoints=tuple(waypoints))


def _moved(waypoint: Waypoint, passage: Passage) -> Waypoint:
    before, after = waypoint.passage.element, passage.element
    bank = waypoint.bank
    if bank is not None:
        bank += (after.prescribed_bank or 0.0) - (before.prescribed_bank or 0.0)
    return dataclasses.replace(
        waypoint, passage=passage, axis=waypoint.axis + (after.axis or 0.0) - (before.axis or 0.0), bank=bank
    )
