"""The race: all that defines one optimisation besides the settings, i.e. course, aircraft and air, and its plan."""

from functools import cached_property

from airrace.aircraft.aircraft import Aircraft
from airrace.environment.air import Air
from airrace.planning.plan import Plan, plan
from airrace.planning.planning_model import PlanningModel, cruise
from airrace.records import record
from airrace.track.course import Course


@record
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

    @cached_property
    def pace(self) -> PlanningModel:
        """The pace at which the race is planned: how fast, and how tightly."""
        return cruise(self.aircraft, self.course.rules)

    @cached_property
    def plan(self) -> Plan:
        """The plan with which an optimisation begins, made when it is first asked for and then handed on."""
        return plan(self.course, self.pace)
