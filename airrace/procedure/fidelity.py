"""A fidelity: everything that belongs to one stage alone."""

import math
from collections.abc import Callable, Mapping
from dataclasses import field
from typing import Protocol

from airrace.aircraft.aircraft import Aircraft
from airrace.control.inner_controller import InnerLoopInverse
from airrace.dynamics.flight_model import FlightModel
from airrace.environment.air import Air
from airrace.optimal_control.runge_kutta import DORMAND_PRINCE_5, RungeKutta
from airrace.procedure.stage import Stage
from airrace.quantities import Quantity
from airrace.records import record
from airrace.track.course import Rules
from airrace.trajectory import Array

Histories = Mapping[str, Array]
"""Named histories, each of shape (n,)."""


class Builder(Protocol):
    """A function that builds the model of an aircraft under rules in an air, with a counter of rolls or without."""

    def __call__(self, aircraft: Aircraft, rules: Rules, air: Air, *, counting: bool = False) -> FlightModel: ...


@record
class WarmStart:
    """The way in which a stage is started from the optimum of the stage below it.

    Attributes:
        farthest: a flight of this model along that optimum is taken for a start where it strays no further than this
            (m); else the model is put at rest in the optimum, node by node. On the shipped courses flights that strayed
            further were worse starts than the model at rest.
        retold: a stage that flies the same equations and differs in its controls alone; its optimum is not flown along
            but told in the controls of this one. None where the equations are this stage's own.
    """

    farthest: float = 25.0
    same_dynamics_as: Stage | None = None


@record
class Fidelity:
    """A model of the aircraft as a stage of the ladder.

    Attributes:
        stage: its name and its place among the stages.
        build: builds its model.
        inner_controller: builds the controller that makes the model fly load factors and roll rates as commanded. None
            for a model without an inner loop, which is started from the plan and not from another stage.
        scheme: integrates the model over an interval.
        longest_interval: the longest interval of its meshes before these are halved, s. Infinite where any length will
            do that keeps the limits.
        handover: how it is started from the stage below.
        columns: further columns of its tables, each a function of the named histories of all states and controls, of
            shape (n,) -> (n,).
        guess: whether its flight only serves as a guess for the next stage: it is assembled from pieces, never
            optimised as a whole and never certified.
    """

    stage: Stage
    build: Builder
    inner_controller: InnerLoopInverse | None = None
    scheme: RungeKutta = DORMAND_PRINCE_5
    longest_interval: float = math.inf
    warm_start: WarmStart = WarmStart()
    columns: Mapping[Quantity, Callable[[Histories], Array]] = field(
        default_factory=dict[Quantity, Callable[[Histories], Array]]
    )
    guess: bool = False

    def controller(self) -> InnerLoopInverse:
        """Return the builder of the model's inner controller.

        Raises:
            ValueError: the model has no inner loop.
        """
        if self.inner_controller is None:
            raise ValueError(f"{self.stage.value} has no inner loop that could be commanded")
        return self.inner_controller
