"""The ends of the race: the conditions on the inner loop at the first and at the last passage."""

import dataclasses
from collections.abc import Callable

from airrace.dynamics.flight_model import FlightModel
from airrace.dynamics.settled import SIDE_ACCELERATION, settled_observation
from airrace.optimal_control.problem import Boundary
from airrace.quantities import Interval
from airrace.records import record
from airrace.system import Observation, side_by_side
from airrace.track.course import Course, EndState

EndCondition = Callable[[Boundary], Boundary]
"""A function that adds the conditions of an end of the race to those of the passage that it is."""


@record
class Ends:
    """The additions to the conditions of the first passage and to those of the last."""

    start: EndCondition
    finish: EndCondition


@record
class Trimmed:
    """The condition that the inner loop is settled, see `airrace.dynamics.settled`.

    Attributes:
        crossing: what the boundaries of passages observe.
        settled: what is zero in a settled flight.
        both: the two of them, side by side.
        bounds: zero for each of the latter.
        values: its parameters, the numbers of aircraft and air.
    """

    crossing: Observation
    settled: Observation
    both: Observation
    bounds: dict[str, Interval]
    values: tuple[float, ...]

    @classmethod
    def of(cls, model: FlightModel, crossing: Observation) -> "Trimmed":
        """Return the condition for a model."""
        settled = settled_observation(model)
        return cls(
            crossing=crossing,
            settled=settled,
            both=side_by_side(crossing, settled),
            bounds={one.name: Interval.exactly(0.0) for one in settled.quantities},
            values=tuple(float(value) for value in model.parameter_values),
        )

    def __call__(self, boundary: Boundary) -> Boundary:
        """Return the boundary of a passage that is to be met in settled flight."""
        seen = boundary.observation
        assert seen is not None  # it is the boundary of a passage
        return dataclasses.replace(
            boundary,
            bounds={**boundary.bounds, **self.bounds},
            observation=self.both if seen is self.crossing else side_by_side(seen, self.settled),
            values=(*boundary.values, *self.values),
        )


def free(boundary: Boundary) -> Boundary:
    """Return the boundary of a passage that may be met in any way within the limits of the flight."""
    return boundary


def unsettled(boundary: Boundary) -> Boundary:
    """Return the boundary of a passage without what `Trimmed` has added to it."""
    seen = () if boundary.observation is None else boundary.observation.quantities
    added = {one.name for one in seen if one.rate_of or one == SIDE_ACCELERATION}
    return dataclasses.replace(boundary, bounds={name: at for name, at in boundary.bounds.items() if name not in added})


def course_ends(course: Course, model: FlightModel, crossing: Observation) -> Ends:
    """Return the end conditions of a course, for a model that sees its passages as `crossing`."""
    conditions: dict[EndState, EndCondition] = {EndState.FREE: free}
    if EndState.SETTLED in (course.start_state, course.finish_state):
        conditions[EndState.SETTLED] = Trimmed.of(model, crossing)
    return Ends(conditions[course.start_state], conditions[course.finish_state])
