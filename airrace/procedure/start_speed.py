"""The limit of the speed at the start where that is an airspeed."""

import dataclasses
from typing import Self

from airrace.dynamics.airspeed import AIRSPEED, airspeed_observation, airspeed_values
from airrace.dynamics.flight_model import FlightModel
from airrace.environment.air import Air
from airrace.environment.wind import WindField
from airrace.optimal_control.problem import Boundary
from airrace.quantities import Interval
from airrace.records import record
from airrace.system import Observation, side_by_side
from airrace.track.course import Rules, StartSpeed


@record
class StartAirspeed:
    """What the boundary of a start observes in the place of its speed over ground.

    Attributes:
        airspeed: see `airrace.dynamics.airspeed`.
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
