"""The regularisation of a model's controls: which are weighed, and how much."""

from airrace.dynamics.flight_model import FlightModel
from airrace.dynamics.roll_counter import RollReset
from airrace.quantities import Quantity

RESET_WEIGHT = 1e-7
"""The weight of the squared, scaled controls that wind back the counter of rolls, 1/s.

They matter only where a roll begins; this is enough to make them unique, and too little to be seen in a race time.
"""


def regularised(model: FlightModel, weight: float) -> dict[str, float]:
    """Return the weights of the squared, scaled controls by name: a rate counts `weight` where it is brisk."""
    controls = model.system.controls
    weights = {one.name: weight * (one.scale / _brisk(model, one)) ** 2 for one in controls if one.rate_of}
    resets = {name: RESET_WEIGHT for name in RollReset.names() if any(one.name == name for one in controls)}
    return weights | resets


def _brisk(model: FlightModel, rate: Quantity) -> float:
    """Return a brisk rate: the model's own measure, else half of the fastest."""
    return model.brisk.get(rate.name, 0.5 * max(-rate.lower, rate.upper))
