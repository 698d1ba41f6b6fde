"""Which equations fly which stage, and what of their controls is regularised."""

import math
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

RESET_WEIGHT = 1e-7
"""Of the controls that wind back the counter of rolls: they matter only where a roll begins; enough to be unique."""

LONGEST_INTERVAL: Mapping[Stage, float] = {
    Stage.HOMOTOPY: math.inf,
    Stage.POINT_MASS: math.inf,
    Stage.TRANSFER_FUNCTION: 0.1,
    Stage.STATE_SPACE_INVERSION: 0.1,
    Stage.STATE_SPACE: 0.07,
    Stage.SIX_DOF: 0.07,
}
"""s, of a mesh before it is halved. The roll mode's time constant is 0.08 s: where the surfaces themselves are
optimised, steps of 0.1 s are so far from the equations that optima are found which nothing could fly."""


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


def regularised(model: FlightModel, weight: float) -> dict[str, float]:
    """Weights of the squared, scaled controls by name: a rate counts `weight` where it is brisk."""
    controls = model.system.controls
    weights = {one.name: weight * (one.scale / _brisk(model, one)) ** 2 for one in controls if one.rate_of}
    resets = {name: RESET_WEIGHT for name in RollReset.names() if any(one.name == name for one in controls)}
    return weights | resets


def _brisk(model: FlightModel, rate: Quantity) -> float:
    """A brisk rate: the model's own measure, else half of the fastest."""
    return model.brisk.get(rate.name, 0.5 * max(-rate.lower, rate.upper))
