"""The family of phases that a homotopy follows: from straight and level to the planned turn.

A member is named by its `part` in [0, 1]: the curvature of the planned path (or the rotation between two attitudes) is
multiplied by it, and so is the prescribed bank. Part 0 has both gates in line; part 1 is the real phase.
"""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from airrace.dynamics.point_mass import PointMassState
from airrace.frames import angles, rotation
from airrace.optimal_control.problem import Iterate
from airrace.planning.plan import Leg, Plan
from airrace.planning.planning_model import PlanningModel
from airrace.planning.rotation_time import rotated, rotation_time
from airrace.planning.waypoints import Waypoint
from airrace.procedure.guess import guess
from airrace.records import record
from airrace.track.dubins import DubinsPath
from airrace.trajectory import Array


@record
class PhaseHomotopy:
    """The members of one phase's family.

    Attributes:
        begin: where the phase begins: its waypoint, moved to where the phase before really ended.
        end: its last waypoint as planned.
        path: the planned path of a level leg, else None.
        pace: planning pace at the speed with which the phase begins.
        counting: see `Plan`.
    """

    begin: Waypoint
    end: Waypoint
    path: DubinsPath | None
    pace: PlanningModel
    counting: bool

    @property
    def first(self) -> float:
        """The member to begin with.

        Between attitudes at free positions there is no straight flight to begin with.
        """
        return 0.0 if self.path is not None else 1.0

    def target(self, part: float) -> Waypoint:
        """Return where and how the phase ends."""
        if part == 1.0:
            return self.end
        return self._bent(self.path, part) if self.path is not None else self._turned(part)

    def _bent(self, path: DubinsPath, part: float) -> Waypoint:
        assert self.begin.position is not None
        assert self.end.position is not None
        bent = path.bent(part)
        north, east, heading = (float(values[0]) for values in bent.points(np.array([path.length])))
        height = self.begin.position[2] + part * (self.end.position[2] - self.begin.position[2])
        bank = None if self.end.bank is None else part * self.end.bank
        return dataclasses.replace(
            self.end, position=(north, east, height), heading=heading, climb=0.0, bank=bank, axis=heading
        )

    def _turned(self, part: float) -> Waypoint:
        heading, climb, bank = angles(rotation(rotated(self.begin.q, self.end.q, part)))
        position = self.end.position
        if position is not None and self.begin.position is not None:
            ahead = self._ahead(self.begin.position)
            position = (
                ahead[0] + part * (position[0] - ahead[0]),
                ahead[1] + part * (position[1] - ahead[1]),
                ahead[2] + part * (position[2] - ahead[2]),
            )
        bank_there = None if self.end.bank is None else bank
        return dataclasses.replace(
            self.end, position=position, heading=heading, climb=climb, bank=bank_there, axis=heading
        )

    def _ahead(self, position: tuple[float, float, float]) -> tuple[float, float, float]:
        """Return the position to which flight straight on would lead in the time of the whole rotation, m."""
        reach = self.pace.V * rotation_time(self.begin.q, self.end.q, self.pace)
        level = reach * math.cos(self.begin.climb)
        return (
            position[0] + level * math.cos(self.begin.heading),
            position[1] + level * math.sin(self.begin.heading),
            position[2] + reach * math.sin(self.begin.climb),
        )

    def guess(self, part: float, fractions: Sequence[float]) -> Iterate:
        """Return the member as planned, on a mesh."""
        path = None if self.path is None else self.path.bent(part)
        member = Plan((self.begin, self.target(part)), (Leg(path),), self.pace, 0.0, self.counting)
        return guess(member, [tuple(fractions)])


def phase_homotopy(plan: Plan, index: int, state: Array | None) -> PhaseHomotopy:
    """Return the family of one phase.

    Args:
        plan: of the race.
        index: of the phase.
        state: point-mass state in which the phase begins, shape (n_x,); None for the start as planned.
    """
    begin, end, pace = plan.waypoints[index], plan.waypoints[index + 1], plan.cruise
    if state is not None:
        now = PointMassState[float].split(state)
        heading, climb, bank = angles(rotation(now.q))
        begin = dataclasses.replace(
            begin, position=(now.x, now.y, -now.z), heading=heading, climb=climb, bank=bank, axis=heading
        )
        pace = dataclasses.replace(pace, V=now.V_K)
    # The planned path is kept although the phase begins a little beside it: from there the shortest path to the gate
    # may be another one, with a full circle more.
    return PhaseHomotopy(begin, end, plan.legs[index].path, pace, plan.counting)
