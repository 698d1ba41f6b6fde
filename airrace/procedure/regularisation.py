"""What of a model's controls is regularised, and how much it weighs."""

from airrace.dynamics.flight_model import FlightModel
from airrace.dynamics.roll_counter import RollReset
from airrace.quantities import Quantity

RESET_WEIGHT = 1e-7
"""Weight of the squared, scaled controls that wind back the counter of rolls. They matter only where a roll begins;
this is enough to make them unique, and too little to be seen in a race time."""


def regularised(model: FlightModel, weight: float) -> dict[str, float]:
    """Weights of the squared, scaled controls by name: a rate counts `weight` where it is brisk."""
    controls = model.system.controls
    weights = {one.name: weight * (one.scale / _brisk(model, one)) ** 2 for one in controls if one.rate_of}
    resets = {name: RESET_WEIGHT for name in RollReset.names() if any(one.name == name for one in controls)}
    return weights | resets


def _brisk(model: FlightModel, rate: Quantity) -> float:
    """A brisk rate: the model's own measure, else half of the fastest."""
    return model.brisk.get(rate.name, 0.5 * max(-rate.lower, rate.upper))
