"""The pace at which a race is planned: a typical speed and load factor of the aircraft, from its own numbers."""

import math

from airrace.aircraft.aircraft import Aircraft
from airrace.dynamics.performance import top_speed
from airrace.environment.atmosphere import g0
from airrace.records import record
from airrace.track.course import Rules


@record
class PlanningAssumptions:
    """The numbers by which speed and turns are planned.

    Attributes:
        air_density: the density of the air in plans, kg/m3, ISA at sea level; a plan need not know the day.
        share_of_top_speed: the planning speed as a share of the top speed of level flight.
        load_factor: the load factor of planned turns, g, where limits and lift allow it.
        share_of_limit: the load factor of planned turns as a share of the allowed one, at most.
        least_load_factor: the least load factor of planned turns, g; below it they become so wide that the plan
            misses the point.
    """

    air_density: float = 1.225
    share_of_top_speed: float = 0.77
    load_factor: float = 6.0
    share_of_limit: float = 0.6
    least_load_factor: float = 2.5


ASSUMED = PlanningAssumptions()


@record
class PlanningModel:
    """The planning speed `V` (m/s), load factor `n` in turns (g) and roll rate `p` (rad/s)."""

    V: float
    n: float
    p: float

    @property
    def radius(self) -> float:
        """The radius of a level turn, m."""
        return self.V**2 / (g0 * math.sqrt(self.n**2 - 1.0))


def cruise(aircraft: Aircraft, rules: Rules) -> PlanningModel:
    """Return three quarters of the top speed, and a load factor that lift and limits leave with a margin."""
    envelope = aircraft.envelope.V
    V = min(max(ASSUMED.share_of_top_speed * top_speed(aircraft), 1.1 * envelope.lower), 0.95 * envelope.upper)
    lift = 0.5 * ASSUMED.air_density * V**2 * aircraft.airframe.S * min(aircraft.lift.C_L_max, rules.C_L.upper)
    n_lift = lift / (aircraft.airframe.m * g0)
    n_limit = min(aircraft.envelope.n_z.upper, rules.n_z.upper)
    n = max(min(ASSUMED.load_factor, ASSUMED.share_of_limit * n_limit, 0.8 * n_lift), ASSUMED.least_load_factor)
    return PlanningModel(V, n, 0.5 * min(aircraft.point_mass.p, rules.p))
