"""A short run and few closed-loop flights of it, for tests of what is told of them."""

from functools import cache

from safety_courses import COURSE, inputs, optimum
from short_course import AIRCRAFT, FROM_PLAN

from airrace.files.inputs import Document, inputs_from_documents
from airrace.runs.run_state import RunState, new_run
from airrace.runs.safety_case import SafetyCase

CROWD = "crowd: {stands: {polygon: [{north_m: 500, east_m: 400}, {north_m: 600, east_m: 400}, \
{north_m: 600, east_m: 450}], distance_m: 100}}\n"
FLIGHTS = 40
"""The fewest of an envelope of 95 %."""


@cache
def flown(crowd: str = "") -> RunState:
    """A run with the six-dof optimum, with people beside the course or without."""
    given = inputs_from_documents(Document("folder/course.yaml", COURSE + crowd), AIRCRAFT, FROM_PLAN, ())
    return new_run(given if crowd else inputs(), None).with_stage(optimum())


@cache
def case(crowd: str = "") -> SafetyCase:
    """Few closed-loop flights of it."""
    return flown(crowd).stage().safety(flights=FLIGHTS, threads=1, label="course.h5", falls=True)
