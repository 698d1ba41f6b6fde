"""How hard a flight is to fly beside its race time: its circles, its pushes and its rolls through inverted flight."""

import itertools
import math
from dataclasses import dataclass

import numpy as np

from airrace.model.frames import QUATERNION
from airrace.optimal_control.trajectory import Trajectory
from airrace.procedure.multistart.rolls import pushes, reversals
from airrace.procedure.planning.plan import POSITION, track_turn
from airrace.procedure.stage_problem import StageProblem, load_factors_along

CIRCLE = math.radians(300.0)
"""The turn to one side on one leg from which on it is a circle, rad: no gate asks for as much."""


@dataclass(frozen=True)
class FlightComplexity:
    """What makes a flight hard to fly, the hardest first.

    Attributes:
        circles: full circles of its track, leg by leg.
        pushes: stretches under negative load factors that last and go below -0.5 g.
        inverted_rolls: rolls from one side to the other through inverted flight.
    """

    circles: int
    pushes: int
    inverted_rolls: int

    @property
    def rank(self) -> tuple[int, int, int]:
        """The order of flights, the simplest first."""
        return self.circles, self.pushes, self.inverted_rolls

    def describe(self) -> str:
        """Return the counts in words, e.g. `no circle, 2 pushes, 1 roll through inverted flight`."""
        return ", ".join(
            [
                _counted(self.circles, "circle", "circles"),
                _counted(self.pushes, "push", "pushes"),
                _counted(self.inverted_rolls, "roll through inverted flight", "rolls through inverted flight"),
            ]
        )


def complexity_of(stage_problem: StageProblem, trajectory: Trajectory) -> FlightComplexity:
    """Return what makes a flight hard to fly.

    Args:
        stage_problem: the problem of the stage that found it.
        trajectory: on its mesh.
    """
    rows = {state.name: row for state, row in zip(trajectory.states, trajectory.state, strict=True)}
    r, q = (np.stack([rows[name] for name in names]) for names in (POSITION, QUATERNION))
    turns = (track_turn(r[:, first : last + 1]).lateral for first, last in itertools.pairwise(trajectory.first_node))
    return FlightComplexity(
        circles=sum(int(abs(turn) // CIRCLE) for turn in turns),
        pushes=len(pushes(trajectory.time, load_factors_along(stage_problem, trajectory).n_z)),
        inverted_rolls=sum(reversal.inverted for reversal in reversals(q)),
    )


def _counted(number: int, singular: str, plural: str) -> str:
    return f"{number or 'no'} {singular if number < 2 else plural}"
