"""The race: all that defines one optimisation besides its settings."""

from dataclasses import dataclass

from airrace.model.aircraft import Aircraft
from airrace.model.environment import Air
from airrace.model.track.course import Course


@dataclass(frozen=True)
class Race:
    """A course, the aircraft that flies it and the air of the day.

    Attributes:
        rules_course: the course by its rules, where `course` is tightened by margins; None where it is that.
    """

    course: Course
    aircraft: Aircraft
    air: Air
    rules_course: Course | None = None

    @property
    def by_rules(self) -> "Race":
        """The race without margins, as a flight is judged."""
        return self if self.rules_course is None else Race(self.rules_course, self.aircraft, self.air)
