"""Ways in words: how a flight takes its turns, and where two flights differ."""

import math
from collections.abc import Sequence

from airrace.procedure.ways.sketch import Sketch
from airrace.procedure.ways.stretches import Shape, Stretch, shape
from airrace.track.course import Course

NAMED = math.radians(100.0)  # a turn that is named in the description of a whole flight
STRAIGHT = math.radians(15.0)
UPRIGHT = math.radians(5.0)  # a loop that turns no further aside leans to no side
FLAT = 15.0  # m above both ends, or between them
STEEP = math.radians(60.0)


def flight_in_words(course: Course, sketch: Sketch, stretches: Sequence[Stretch]) -> str:
    """The long turns of a flight, one after another."""
    turns = [stretch for stretch in stretches if abs(shape(sketch, stretch).turn) >= NAMED]
    return way_in_words(course, sketch, turns) if turns else "no long turns"


def way_in_words(course: Course, sketch: Sketch, stretches: Sequence[Stretch]) -> str:
    """How a flight takes some stretches, such as "1:g4 -> 1:g5: over the top to the right, 140 m high"."""
    return "; ".join(f"{named(course, one)}: {shape_in_words(shape(sketch, one))}" for one in stretches)


def named(course: Course, stretch: Stretch) -> str:
    """A stretch by the names of the passages at its ends."""
    return f"{course.passages[stretch.first].name} -> {course.passages[stretch.last].name}"


def shape_in_words(one: Shape) -> str:
    """How a stretch is taken."""
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
