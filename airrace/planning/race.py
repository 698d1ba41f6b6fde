"""All that defines one optimisation besides the settings: course, aircraft, air."""

from dataclasses import dataclass

from airrace.aircraft.aircraft import Aircraft
from airrace.environment.air import Air
from airrace.track.course import Course


@dataclass(frozen=True)
class Race:
    """A course, the aircraft that flies it and the air of the day."""

    course: Course
    aircraft: Aircraft
    air: Air
