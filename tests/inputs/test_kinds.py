"""The list of kinds of elements."""

from typing import Literal

import pytest

from airrace.inputs.features import Feature
from airrace.inputs.kinds.all_kinds import kinds, register
from airrace.inputs.kinds.defaults import GateDefaultsEntry
from airrace.inputs.kinds.entry import KindEntry
from airrace.inputs.places import Places
from airrace.inputs.schema import tags_of
from airrace.inputs.track_schema import track_language

TYPES = ["level", "knife-edge", "quad", "pylon", "manoeuvre", "high-turn", "vertical-roll"]


class Nothing(KindEntry):
    def feature(self, name: str, defaults: GateDefaultsEntry, places: Places) -> Feature:
        return Feature(name, ())


def test_the_track_language_knows_every_kind() -> None:
    element = track_language().model_fields["gates"].annotation
    assert element is not None
    assert tags_of(element.__args__[1]) == TYPES
    assert len(kinds()) == len(TYPES)


def test_the_track_language_is_made_once() -> None:
    assert track_language() is track_language()


def test_a_kind_needs_a_type_by_which_files_name_it() -> None:
    with pytest.raises(ValueError, match="Nothing declares no `type"):
        register(Nothing)


def test_a_type_belongs_to_one_kind() -> None:
    class Level(Nothing):
        type: Literal["level"]

    with pytest.raises(ValueError, match="a kind of element of the type level already"):
        register(Level)
    assert len(kinds()) == len(TYPES)
