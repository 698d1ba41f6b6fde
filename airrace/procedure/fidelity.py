"""The fidelities, one object each with everything that belongs to one stage alone; `register` adds a further one.

With them the equations of a stage, and a stored flight checked against them. Nothing here loads a solver.
"""

import dataclasses
import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from typing import Protocol

from airrace.errors import CheckpointError
from airrace.model.aircraft import Aircraft
from airrace.model.dynamics.flight_model import FlightModel
from airrace.model.dynamics.point_mass import build_point_mass
from airrace.model.dynamics.six_dof import build_six_dof
from airrace.model.dynamics.state_space import build_state_space
from airrace.model.dynamics.state_space_inversion import build_state_space_inversion
from airrace.model.dynamics.transfer_functions import build_transfer_functions
from airrace.model.environment import Air
from airrace.model.track.course import Rules
from airrace.optimal_control.problem import Iterate
from airrace.optimal_control.quantities import Quantity
from airrace.optimal_control.runge_kutta import DORMAND_PRINCE_5, VERNER_7, RungeKutta
from airrace.optimal_control.trajectory import Array, Trajectory
from airrace.procedure.control.dynamic_inversion import (
    SIX_DOF,
    STATE_SPACE,
    STATE_SPACE_INVERSION,
    InnerLoopInverse,
    invert_body_motion,
    invert_transfer_functions,
)
from airrace.procedure.result import StageResult
from airrace.procedure.stage import Stage
from airrace.race import Race
from airrace.runtime.extensions import load_extensions

LONGEST_INTERVAL = 0.13
"""The longest interval of the models with an inner loop, s.

Their roll mode's time constant is 0.08 s. In a step of 0.13 s the scheme of order 7 errs by 3e-5 of it; one of order 5
errs by 1e-2, so much that optima are found which nothing could fly. With order 7 and 0.13 s all stages take three
quarters of the time that they take with order 5 and 0.07 to 0.1 s, with 0.16 s no less.
"""

Histories = Mapping[str, Array]
"""Named histories, each of shape (n,)."""


class Builder(Protocol):
    """A function that builds the model of an aircraft under rules in an air, with a counter of rolls or without."""

    def __call__(self, aircraft: Aircraft, rules: Rules, air: Air, *, counting: bool = False) -> FlightModel: ...


@dataclasses.dataclass(frozen=True)
class WarmStart:
    """The way in which a stage is started from the optimum of the stage below it.

    Attributes:
        max_tracking_error: a simulation of this model along that optimum is taken for a start where it keeps so near
            (m); else the model is trimmed in the optimum, node by node. On the shipped courses simulations with larger
            errors were worse starts than the trimmed model.
        same_dynamics_as: a stage with the same equations that differs in its controls alone; its optimum is not
            followed but expressed in the controls of this one. None where the equations are this stage's own.
    """

    max_tracking_error: float = 25.0
    same_dynamics_as: Stage | None = None


@dataclasses.dataclass(frozen=True, eq=False)
class Fidelity:
    """A model of the aircraft as a stage of rising fidelity.

    Attributes:
        stage: its name and its place among the stages.
        build: builds its model.
        inner_controller: builds the controller that makes the model fly load factors and roll rates as commanded. None
            for a model without an inner loop, which is started from the plan and not from another stage.
        scheme: integrates the model over an interval.
        longest_interval: the longest interval of its meshes before these are halved, s. Infinite where any length will
            do that keeps the limits.
        warm_start: how it is started from the stage below.
        columns: further columns of its tables, each a function of the named histories of all states and controls, of
            shape (n,) -> (n,).
        is_guess: whether its flight only serves as a guess for the next stage: it is assembled from pieces, never
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
    is_guess: bool = False

    def controller(self) -> InnerLoopInverse:
        """Return the builder of the model's inner controller.

        Raises:
            ValueError: the model has no inner loop.
        """
        if self.inner_controller is None:
            raise ValueError(f"{self.stage.value} has no inner loop that could be commanded")
        return self.inner_controller


_point_mass = Fidelity(Stage.POINT_MASS, build_point_mass)

_fidelities: dict[Stage, Fidelity] = {
    fidelity.stage: fidelity
    for fidelity in (
        dataclasses.replace(_point_mass, stage=Stage.HOMOTOPY, is_guess=True),
        _point_mass,
        Fidelity(
            Stage.TRANSFER_FUNCTION,
            build_transfer_functions,
            inner_controller=invert_transfer_functions,
            scheme=VERNER_7,
            longest_interval=LONGEST_INTERVAL,
        ),
        Fidelity(
            Stage.STATE_SPACE_INVERSION,
            build_state_space_inversion,
            inner_controller=functools.partial(invert_body_motion, chain=STATE_SPACE_INVERSION),
            scheme=VERNER_7,
            longest_interval=LONGEST_INTERVAL,
        ),
        Fidelity(
            Stage.STATE_SPACE,
            build_state_space,
            inner_controller=functools.partial(invert_body_motion, chain=STATE_SPACE),
            scheme=VERNER_7,
            longest_interval=LONGEST_INTERVAL,
            warm_start=WarmStart(same_dynamics_as=Stage.STATE_SPACE_INVERSION),
        ),
        Fidelity(
            Stage.SIX_DOF,
            build_six_dof,
            inner_controller=functools.partial(invert_body_motion, chain=SIX_DOF),
            scheme=VERNER_7,
            longest_interval=LONGEST_INTERVAL,
        ),
    )
}


def register(fidelity: Fidelity) -> Fidelity:
    """Add a fidelity, at the place of its stage, and return it.

    A file that calls this is all that a fidelity of one's own takes: import it, or name it in `AIRRACE_EXTENSIONS`.

    Raises:
        ValueError: the stage has another fidelity already, or the model has no inner controller by which it
            could be started from the stage below.
    """
    if fidelity.stage in _fidelities:
        raise ValueError(f"there is a fidelity for the stage {fidelity.stage.value} already")
    fidelity.controller()
    _fidelities[fidelity.stage] = fidelity
    return fidelity


def fidelity_of(stage: Stage) -> Fidelity:
    """Return the fidelity of a stage.

    Raises:
        KeyError: the stage was declared, but no fidelity was registered for it.
    """
    load_extensions()
    return _fidelities[stage]


def stage_model(stage: Stage, race: Race) -> FlightModel:
    """Return the equations of a stage, with the numbers and limits of a race.

    Raises:
        InputError: aircraft and rules leave no allowed value of some quantity.
    """
    course = race.course
    return fidelity_of(stage).build(race.aircraft, course.rules, race.air, counting=course.has_rolls)


def iterate_of(trajectory: Trajectory) -> Iterate:
    """Return the unknowns of a stored flight."""
    return Iterate(trajectory.durations, trajectory.state, trajectory.control)


def ensure_matches_model(race: Race, result: StageResult) -> None:
    """Refuse a stored stage whose histories are not those of its model, and its alternatives likewise.

    Names, their order and units decide, for whatever reads a flight goes by them. How a history is described, and
    which values are allowed, may differ.

    Args:
        result: a stage as it was read from a file.

    Raises:
        CheckpointError: a state or a control is missing, unknown, in another place or in another unit; or the flight
            has another number of legs than the course.
        InputError: aircraft and rules leave no allowed value of some quantity.
    """
    system, legs = stage_model(result.stage, race).system, len(race.course.passages) - 1
    for stage_result in (result, *result.alternatives):
        trajectory, name = stage_result.trajectory, stage_result.stage.value
        _ensure_same(name, "state", trajectory.states, system.states)
        _ensure_same(name, "control", trajectory.controls, system.controls)
        if len(trajectory.phases) != legs:
            raise CheckpointError(f"{name}: its flight has {len(trajectory.phases)} legs, and the course has {legs}")


def _ensure_same(stage: str, kind: str, stored: Sequence[Quantity], declared: Sequence[Quantity]) -> None:
    names, expected = [quantity.name for quantity in stored], [quantity.name for quantity in declared]
    missing = [name for name in expected if name not in names]
    unknown = [name for name in names if name not in expected]
    if missing:
        raise CheckpointError(f"{stage}: the {kind} {missing[0]} is missing")
    if unknown:
        raise CheckpointError(f"{stage}: its model has no {kind} {unknown[0]}")
    if names != expected:
        raise CheckpointError(f"{stage}: its {kind}s are {', '.join(names)}, in another order than its model's")
    for quantity, declaration in zip(stored, declared, strict=True):
        if (quantity.unit, quantity.rate_of) != (declaration.unit, declaration.rate_of):
            raise CheckpointError(
                f"{stage}: the {kind} {quantity.name} is declared as another quantity than its model's"
            )
