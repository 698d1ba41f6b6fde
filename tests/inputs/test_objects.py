"""Courses and aircraft that were built in Python are stored and read back exactly as they are."""

import dataclasses
import json
import math

import numpy as np
import pytest

from airrace.aircraft.aircraft import Aircraft
from airrace.environment.air import Air
from airrace.errors import InputError, UsageError
from airrace.inputs import Document, Inputs, inputs_from_documents, load_inputs
from airrace.inputs.objects import Scene, aircraft_of, document_of_objects, is_of_objects, scene_of
from airrace.inputs.shipped import TRACKS
from airrace.inputs.variation import Variation
from airrace.track.course import Course, Passage

ROVINJ = load_inputs("rovinj_2014").race


def read_back(scene: Scene, aircraft: Aircraft = ROVINJ.aircraft) -> Inputs:
    return inputs_from_documents(
        document_of_objects(scene, "mine"), document_of_objects(aircraft, "my aircraft"), None, ()
    )


@pytest.mark.parametrize("name", TRACKS.names)
def test_every_shipped_race_survives_the_round_trip(name: str) -> None:
    by_file = load_inputs(name)
    race = by_file.race
    inputs = read_back(Scene(race.course, race.air), race.aircraft)
    assert inputs.race == race
    assert inputs.resolved == by_file.resolved


def test_infinities_numbers_of_numpy_and_whole_numbers_survive() -> None:
    passages = [dataclasses.replace(one, lap=np.int64(one.lap)) for one in ROVINJ.course.passages]
    course = dataclasses.replace(ROVINJ.course, passages=tuple(passages))
    air = Air(elevation=np.float32(12.5), pressure_offset=3)
    scene = read_back(Scene(course, air)).race
    assert scene.course == ROVINJ.course
    assert scene.air == Air(elevation=12.5, pressure_offset=3.0)
    assert isinstance(scene.air.pressure_offset, float)
    assert math.isinf(scene.course.rules.alpha_A.upper)


def course_of(*passages: Passage) -> Course:
    return dataclasses.replace(ROVINJ.course, passages=passages)


FIRST, SECOND, *_ = ROVINJ.course.passages


@pytest.mark.parametrize(
    ("course", "message"),
    [(course_of(FIRST), "at least two passages"), (course_of(FIRST, FIRST), "two passages are called `0:g0`")],
)
def test_a_course_that_is_none_is_refused(course: Course, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_back(Scene(course, Air()))


def test_what_a_course_cannot_hold_is_refused_when_it_is_written() -> None:
    with pytest.raises(InputError, match="cannot hold a list"):
        document_of_objects(Scene(dataclasses.replace(ROVINJ.course, passages=[FIRST, SECOND]), Air()), "mine")  # type: ignore[arg-type]


def test_course_and_aircraft_must_fit_together_as_those_of_files_must() -> None:
    slow = dataclasses.replace(ROVINJ.aircraft, airframe=dataclasses.replace(ROVINJ.aircraft.airframe, b=30.0))
    with pytest.raises(InputError, match="wing"):
        read_back(Scene(ROVINJ.course, ROVINJ.air), slow)


def test_the_keys_of_files_reach_no_objects() -> None:
    track = document_of_objects(Scene(ROVINJ.course, ROVINJ.air), "mine")
    with pytest.raises(InputError, match=r"rules\.n_z_max: cannot be set here"):
        load_inputs(track, aircraft="edge540", overrides=["rules.n_z_max=9"])
    inputs = load_inputs(track, aircraft="edge540", overrides=["aircraft.airframe.mass_kg=650"])
    assert inputs.race.aircraft.airframe.m == 650.0
    with pytest.raises(UsageError, match="built in Python"):
        Variation(inputs)


def test_a_course_built_in_python_needs_an_aircraft() -> None:
    with pytest.raises(InputError, match="names no aircraft"):
        load_inputs(document_of_objects(Scene(ROVINJ.course, ROVINJ.air), "mine"))


FORGED = [
    {"Course": {}},
    {"Scene": {"course": None}},
    {"Scene": []},
    {"Path": {"a": 1}},
    [],
    {"Scene": {"course": {"Air": {}}, "air": {"Air": {}}}},
    {"Scene": {"course": {"Course": {"name": 3}}, "air": {"Air": {}}}},
    {"Scene": {"course": {"Course": {"unknown": 3}}, "air": {"Air": {}}}},
]


@pytest.mark.parametrize("objects", FORGED, ids=json.dumps)
def test_forged_objects_are_refused_with_a_sentence(objects: object) -> None:
    text = document_of_objects(ROVINJ.aircraft, "mine").text
    forged = Document("mine", json.dumps({**json.loads(text), "objects": objects}))
    assert is_of_objects(forged)
    for read in (scene_of, aircraft_of):
        with pytest.raises(InputError, match="does not hold"):
            read(forged)
