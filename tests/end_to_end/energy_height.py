"""A limit from outside the package: the height that an aircraft's energy amounts to."""

from airrace.model.dynamics.own_limits import Instant, Limit, register
from airrace.model.environment import g0
from airrace.optimal_control.quantities import Quantity, Scalar


def energy_height(instant: Instant) -> Scalar:
    """Height and speed as one height, m."""
    return instant.height + instant.V_K**2 / (2.0 * g0)


register(Limit(Quantity("energy_height", "m", 100.0, upper=560.0, text="energy height"), energy_height))
