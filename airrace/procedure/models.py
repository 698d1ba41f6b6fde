"""Which equations fly which stage, and what of their controls is regularised."""

from collections.abc import Mapping
from typing import Protocol

from airrace.aircraft.aircraft import Aircraft
from airrace.dynamics.flight_model import FlightModel
from airrace.dynamics.point_mass import build_point_mass
from airrace.dynamics.roll_counter import RollReset
from airrace.dynamics.six_dof import build_six_dof
from airrace.dynamics.state_space import build_state_space
from airrace.dynamics.state_space_inversion import build_state_space_inversion
from airrace.dynamics.transfer_functions import build_transfer_functions
from airrace.environment.air import Air
from airrace.procedure.result import Stage
from airrace.quantities import Quantity
from airrace.track.course import Rules

RATE = "_dot"
"""What the names of controls end with that move a command or a surface."""

RESET_WEIGHT = 1e-7
"""Of the controls that wind back the counter of rolls: they matter only where a roll begins; enough to be unique."""


class Builder(Protocol):
    """Builds the model of an aircraft under rules in an air, with a counter of rolls or without."""

    def __call__(self, aircraft: Aircraft, rules: Rules, air: Air, *, counting: bool = False) -> FlightModel: ...


BUILDERS: Mapping[Stage, Builder] = {
    Stage.HOMOTOPY: build_point_mass,
    Stage.POINT_MASS: build_point_mass,
    Stage.TRANSFER_FUNCTION: build_transfer_functions,
    Stage.STATE_SPACE_INVERSION: build_state_space_inversion,
    Stage.STATE_SPACE: build_state_space,
    Stage.SIX_DOF: build_six_dof,
}


def regularised(controls: tuple[Quantity, ...], weight: float) -> dict[str, float]:
    """Weights of the squared, scaled controls by name."""
    weights = {one.name: weight for one in controls if one.name.endswith(RATE)}
    resets = {name: RESET_WEIGHT for name in RollReset.names() if any(one.name == name for one in controls)}
    return weights | resets
