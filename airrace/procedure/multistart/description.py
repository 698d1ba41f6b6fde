"""The description of ways in words: how a flight takes its turns, and where two flights differ."""

import math
from collections.abc import Sequence

from airrace.procedure.multistart.coarse_solution import CoarseSolution
from airrace.procedure.multistart.segments import Segment, Shape, shape
from airrace.track.course import Course

NAMED = math.radians(100.0)
"""The turn from which on a stretch is named in the description of a whole flight, rad."""
STRAIGHT = math.radians(15.0)
"""The largest turn that is called straight, rad."""
UPRIGHT = math.radians(5.0)
"""The largest turn aside with which a loop leans to no side, rad."""
FLAT = 15.0
"""The largest rise above both ends, or between them, that is called flat, m."""
STEEP = math.radians(60.0)
"""The climb angle from which on a turn leads over the top, rad."""


def describe_route(course: Course, coarse: CoarseSolution, stretches: Sequence[Segment]) -> str:
    """Return the long turns of a flight, one after another."""
    turns = [stretch for stretch in stretches if abs(shape(coarse, stretch).turn) >= NAMED]
    return way_in_words(course, coarse, turns) if turns else "no long turns"


def way_in_words(course: Course, coarse: CoarseSolution, stretches: Sequence[Segment]) -> str:
    """Describe how a flight takes some stretches.

    An example is "1:g4 -> 1:g5: over the top to the right, 140 m high".
    """
    return "; ".join(f"{named(course, one)}: {shape_in_words(shape(coarse, one))}" for one in stretches)


def named(course: Course, stretch: Segment) -> str:
    """Return a stretch by the names of the passages at its ends."""
    return f"{course.passages[stretch.first].name} -> {course.passages[stretch.last].name}"


def shape_in_words(one: Shape) -> str:
    """Describe how a stretch is taken."""
    side = f"to the {'right' if one.turn > 0.0 else 'left'}"
    degrees = f"{round(abs(math.degrees(one.turn)), -1):.0f} degrees "
    if one.rise > FLAT and one.steepest > STEEP and one.overhead:
        leaning = f" {side}" if abs(one.aside) > UPRIGHT else ""
        return f"over the top{leaning}, {round(one.height, -1):.0f} m high"
    turned = "straight" if abs(one.turn) < STRAIGHT else f"{degrees}{side}"
    if one.rise > FLAT:
        return f"{turned}, {round(one.height, -1):.0f} m high"
    if abs(one.gain) <= FLAT:
        return f"{turned}, flat"
    return f"{turned}, {'climbing' if one.gain > 0.0 else 'descending'} {round(abs(one.gain), -1):.0f} m"
