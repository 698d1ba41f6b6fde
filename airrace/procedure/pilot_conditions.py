"""The limits of a pilot and of the start as parts of the problem: at gates, start and finish, and near the ground."""

import dataclasses
import math
from typing import Self

from airrace.dynamics.flight_model import FlightModel
from airrace.dynamics.limits import symmetric
from airrace.dynamics.observations import AIRSPEED, airspeed_observation, airspeed_values
from airrace.dynamics.pilot_observation import (
    LOAD_FACTOR,
    LOW_LOAD_FACTOR,
    ONSET,
    ROLL_RATE,
    TURN_EXCESS,
    TURN_LACK,
    crossing_observation_of_pilot,
    low_flight_observation,
)
from airrace.environment import Air, WindField
from airrace.optimal_control.problem import Boundary, PathConstraint
from airrace.planning.route_decisions import Waypoint
from airrace.quantities import Interval
from airrace.records import record
from airrace.system import Observation, side_by_side
from airrace.track.course import PilotLimits, Rules, StartSpeed
from airrace.track.gates import NOT_POSITIVE, ZERO

LEAST_COSINE = 0.1
"""The least cosine of a prescribed bank at which a steady turn is asked for (1): it takes 10 g there, none beyond."""
NAMES = frozenset(one.name for one in (LOAD_FACTOR, ONSET, ROLL_RATE, TURN_EXCESS, TURN_LACK))
"""The quantities by which a pilot's limits hold at passages."""
NEAR_GROUND = "load factor near the ground"


@record
class PilotConditions:
    """The limits of a pilot as a model observes them, see `airrace.dynamics.pilot_observation`.

    Attributes:
        limits: the limits.
        crossing: what is observed at passages.
        low: what holds all along; None where no least load factor is asked for near the ground.
        values: the numbers of aircraft and air.
    """

    limits: PilotLimits
    crossing: Observation
    low: PathConstraint | None
    values: tuple[float, ...]

    @classmethod
    def of(cls, model: FlightModel, rules: Rules) -> Self | None:
        """Return the conditions of a model under rules; None where they ask for nothing."""
        limits = rules.pilot
        if limits == PilotLimits():
            return None
        values = tuple(float(value) for value in model.parameter_values)
        low = None
        if math.isfinite(limits.n_z_low):
            smooth, exact = (low_flight_observation(model, exact=one) for one in (False, True))
            low = _near_ground(limits, smooth, exact, values)
        return cls(limits, crossing_observation_of_pilot(model), low, values)

    def of_other_numbers(self, model: FlightModel, rules: Rules) -> Self:
        """Return the conditions of a model and rules that differ in numbers alone."""
        values, low = tuple(float(value) for value in model.parameter_values), self.low
        if (values, rules.pilot) == (self.values, self.limits):
            return self
        if low is not None:
            low = _near_ground(rules.pilot, low.observation, low.exact, values)
        return dataclasses.replace(self, limits=rules.pilot, low=low, values=values)

    @property
    def along(self) -> tuple[PathConstraint, ...]:
        """What holds along every leg."""
        return () if self.low is None else (self.low,)

    def at(self, boundary: Boundary, waypoint: Waypoint, *, start: bool = False, finish: bool = False) -> Boundary:
        """Return the boundary of a passage with what the pilot keeps to there."""
        limits, element = self.limits, waypoint.passage.element
        bounds: dict[str, Interval] = {}
        if element.stands:
            rates = {ROLL_RATE.name: limits.roll_rate}
            if any(one == ONSET for one in self.crossing.quantities):
                rates[ONSET.name] = limits.onset
            bounds = {name: symmetric(most) for name, most in rates.items() if math.isfinite(most)}
        if (start or finish) and math.isfinite(limits.n_z_ends):
            bounds[LOAD_FACTOR.name] = Interval(lower=limits.n_z_ends)
        if (start and limits.steady_start) or (finish and limits.steady_finish):
            bounds[ROLL_RATE.name] = ZERO
            if math.cos(element.prescribed_bank or 0.0) > LEAST_COSINE:
                bounds |= {TURN_EXCESS.name: NOT_POSITIVE, TURN_LACK.name: NOT_POSITIVE}
        seen = boundary.observation
        if not bounds or seen is None:
            return boundary
        return dataclasses.replace(
            boundary,
            bounds={**boundary.bounds, **bounds},
            observation=side_by_side(seen, self.crossing),
            values=(*boundary.values, limits.turn_tolerance, *self.values),
        )


def without_pilot(boundary: Boundary) -> Boundary:
    """Return the boundary of a passage without what `PilotConditions` has added to it."""
    return dataclasses.replace(boundary, bounds={name: at for name, at in boundary.bounds.items() if name not in NAMES})


def _near_ground(
    limits: PilotLimits, smooth: Observation, exact: Observation | None, values: tuple[float, ...]
) -> PathConstraint:
    bounds = {LOW_LOAD_FACTOR.name: Interval(lower=limits.n_z_low)}
    return PathConstraint(NEAR_GROUND, bounds, smooth, (limits.low_height, *values), exact)


@record
class StartAirspeed:
    """What the boundary of a start observes in the place of its speed over ground.

    Attributes:
        airspeed: see `airrace.dynamics.observations`.
        values: the numbers of the air.
    """

    airspeed: Observation
    values: tuple[float, ...]

    @classmethod
    def of(cls, model: FlightModel, rules: Rules, air: Air) -> Self | None:
        """Return it for a model under rules in the air of the day; None where the limit is of the speed over ground."""
        if rules.start_speed is StartSpeed.GROUND:
            return None
        indicated = rules.start_speed is StartSpeed.INDICATED
        observed = airspeed_observation(model.system.states, WindField.of(air), indicated=indicated)
        return cls(observed, airspeed_values(air))

    def of_other_numbers(self, air: Air) -> Self:
        """Return it for an air that differs in numbers alone."""
        return dataclasses.replace(self, values=airspeed_values(air))

    def at(self, boundary: Boundary, speed: Interval) -> Boundary:
        """Return the boundary of a start that is passed at a speed within a range (m/s)."""
        seen = boundary.observation
        if not speed.bounded or seen is None:
            return boundary
        bounds = {name: at for name, at in boundary.bounds.items() if name != "V_K"}
        return dataclasses.replace(
            boundary,
            bounds={**bounds, AIRSPEED.name: speed},
            observation=side_by_side(seen, self.airspeed),
            values=(*boundary.values, *self.values),
        )
