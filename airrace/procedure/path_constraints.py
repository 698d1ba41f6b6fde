"""The conditions along each leg of a race besides the aircraft's limits: lines, crowd, the climb angle of a roll."""

from collections.abc import Sequence

from airrace.dynamics.surroundings import (
    CrowdKind,
    climb_observation,
    crowd_observation,
    crowd_values,
    line_observation,
    line_values,
    safety_line_values,
)
from airrace.optimal_control.problem import PathConstraint
from airrace.quantities import Interval, Quantity
from airrace.system import Observation
from airrace.track.course import Course, Crowd, Passage
from airrace.track.polygons import Point, area, edges


def leg_watches(course: Course, states: Sequence[Quantity]) -> tuple[tuple[PathConstraint, ...], ...]:
    """Return the watches of every leg; there is one leg less than there are passages."""
    return _Watches(course, states).legs()


class _Watches:
    """A maker of watches, which makes every kind of observation once, however many legs it is seen on."""

    def __init__(self, course: Course, states: Sequence[Quantity]) -> None:
        self._course = course
        self._states = states
        self._line: Observation = line_observation(states)
        self._climb = climb_observation(states, exact=False), climb_observation(states, exact=True)
        self._crowds: dict[CrowdKind, tuple[Observation, Observation]] = {}

    def legs(self) -> tuple[tuple[PathConstraint, ...], ...]:
        everywhere = (*self._borders(self._course.airspace), *(self._crowd(one) for one in self._course.crowd))
        return tuple((*everywhere, *self._own(passage)) for passage in self._course.passages[1:])

    def _own(self, passage: Passage) -> list[PathConstraint]:
        """Return the watches of the leg that ends with this passage alone."""
        watches = [
            self._beside(f"safety line {line.name}", safety_line_values(line), line.margin)
            for line in passage.safety_lines
        ]
        if passage.roll is not None:
            smooth, exact = self._climb
            watches.append(PathConstraint("roll", {"climb": passage.roll.climb}, smooth, (), exact))
        return watches

    def _borders(self, corners: Sequence[Point]) -> list[PathConstraint]:
        """Return a watch per side of the airspace."""
        if not corners:
            return []
        right = area(corners) > 0.0
        return [
            self._beside(f"airspace, side {number}", line_values(a, b, right=right), 0.0)
            for number, (a, b) in enumerate(edges(corners, closed=True), start=1)
        ]

    def _beside(self, name: str, values: tuple[float, ...], margin: float) -> PathConstraint:
        return PathConstraint(name, {"beside": Interval(lower=margin)}, self._line, values)

    def _crowd(self, crowd: Crowd) -> PathConstraint:
        kind = CrowdKind.of(crowd)
        if kind not in self._crowds:
            made = (crowd_observation(self._states, kind, exact=exact) for exact in (False, True))
            self._crowds[kind] = (next(made), next(made))
        smooth, exact = self._crowds[kind]
        return PathConstraint(
            f"crowd {crowd.name}", {"distance": Interval(lower=crowd.distance)}, smooth, crowd_values(crowd), exact
        )
