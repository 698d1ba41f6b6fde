"""What the hand does with the pieces of a course, as edits of its file."""

import difflib
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from three_gates import COURSE

from airrace.design.designer import Designer
from airrace.design.pieces import layout_of
from airrace.design.track_file import TrackFile
from airrace.errors import InputError, UsageError
from airrace.files.inputs import load_inputs


def does(designer: Designer, what: str, **said: object) -> list[str]:
    """Do something; return the lines of the file that are gone, and those that came."""
    before = designer.track.document.text
    designer.do(what, {"revision": designer.track.revision, **said})
    after = designer.track.document.text
    compared = difflib.ndiff(before.splitlines(), after.splitlines())
    return [line for line in compared if line[0] in "+-"]


def test_a_gate_that_is_moved_and_turned_changes_its_own_line_alone(still: Designer) -> None:
    moved = [{"path": ["gates", "corner"], "north": 425.004, "east": 57.0}]
    turned = [{"path": ["gates", "corner"], "degrees": -80.0}]
    assert does(still, "move", places=moved, turns=turned) == [
        "-   corner: {type: pylon, north_m: 420, east_m: 60, pass_side_deg: 270}   # the western side",
        "+   corner: {type: pylon, north_m: 425, east_m: 57, pass_side_deg: 280}   # the western side",
    ]


def test_a_gate_given_by_its_pylons_is_moved_pylon_by_pylon(still: Designer) -> None:
    spots = still.track.layout.piece(("gates", "last")).spots
    does(
        still,
        "move",
        turns=[],
        places=[{"path": list(one.path), "north": one.north + 10.0, "east": one.east - 5.0} for one in spots],
    )
    after = still.track.layout.piece(("gates", "last")).spots
    assert [(one.north, one.east) for one in after] == [(one.north + 10.0, one.east - 5.0) for one in spots]


def test_a_new_gate_is_passed_where_it_makes_the_least_detour_and_removed_with_its_passing(still: Designer) -> None:
    lines = does(still, "add", kind="level", north=560.0, east=190.0)
    assert [line[2:].split(" {")[0] for line in lines] == ["  g1:", "    - g1"]
    names = [passage.name for passage in still.track.layout.inputs.race.course.passages]
    assert names == ["0:start", "1:corner", "1:g1", "1:last"]
    does(still, "remove", path=["gates", "g1"])
    assert still.track.document.text == COURSE


def test_a_pylon_of_a_gate_that_came_as_two_is_set_by_its_number(still: Designer) -> None:
    does(still, "set", path=["gates", "last", "pylons", 1, "east_m"], value=320)
    assert still.track.layout.piece(("gates", "last")).spots[1].east == 320.0


@pytest.mark.parametrize(
    ("path", "value"),
    [("rules.floor_m", 12), ("rules.ceiling_m", 90), ("rules.pilot", "display"), ("course.laps", 2)],
)
def test_an_entry_of_the_form_is_set_and_taken_out_again(still: Designer, path: str, value: object) -> None:
    keys = path.split(".")
    before = still.track.layout.plain[keys[0]].get(keys[1])
    does(still, "set", path=keys, value=value)
    form: Any = still.state()["form"]
    assert [field["value"] for field in form if list(field["path"]) == keys] == [value]
    does(still, "set", path=keys, value=before)
    assert still.track.layout.plain[keys[0]].get(keys[1]) == before


def test_a_passing_is_moved_and_moved_back_and_directed(still: Designer) -> None:
    def order() -> list[str]:
        return [passage.name for passage in still.track.layout.inputs.race.course.passages]

    before = order()
    does(still, "passing", path=["course", "lap", 0], later=True)
    assert order() == [before[0], "1:last", "1:corner"]
    does(still, "passing", path=["course", "lap", 1], later=False)
    assert order() == before
    for direction in ("reverse", "planned", ""):
        does(still, "passing", path=["course", "lap", 1], direction=direction)
        passings: Any = still.state()["passings"]
        assert passings[-1]["direction"] == direction
        does(still, "passing", path=["course", "start"], direction=direction)


@pytest.mark.parametrize("kind", ["level", "knife-edge", "pylon", "obstacle", "crowd", "safety line", "airspace"])
def test_all_kinds_of_pieces_are_added_moved_removed_and_undone(still: Designer, kind: str) -> None:
    does(still, "add", kind=kind, north=300.0, east=-400.0)
    (new,) = {piece.path for piece in still.track.layout.pieces} - {
        ("gates", name) for name in ("start", "corner", "last")
    }
    spots = still.track.layout.piece(new).spots
    does(
        still,
        "move",
        turns=[],
        places=[{"path": list(one.path), "north": one.north - 20.0, "east": one.east} for one in spots],
    )
    after = still.track.layout.piece(new).spots
    assert all(math.isclose(a.north, b.north - 20.0, abs_tol=0.02) for a, b in zip(after, spots, strict=True))
    does(still, "remove", path=list(new))
    assert still.track.document.text == COURSE
    for what in ("undo", "undo", "undo"):
        does(still, what)
    assert (still.track.document.text, len(still.track.undo_stack), len(still.track.redo_stack)) == (COURSE, 0, 3)


def test_movements_of_one_hand_are_one_step(still: Designer) -> None:
    for north in (421.0, 422.0, 423.0):
        does(
            still, "move", gesture="one", turns=[], places=[{"path": ["gates", "corner"], "north": north, "east": 60.0}]
        )
    does(still, "undo")
    assert still.track.document.text == COURSE


def test_places_given_by_latitude_and_longitude_stay_so(track: Path) -> None:
    text = COURSE.replace("gate_defaults", "origin: {latitude_deg: 45, longitude_deg: 13}\ngate_defaults")
    track.write_text(text.replace("north_m: 420, east_m: 60", "latitude_deg: 45.004, longitude_deg: 13.001"))
    file = TrackFile(track)
    (spot,) = file.layout.piece(("gates", "corner")).spots
    file.edit(0, file.layout.moved([replace(spot, north=spot.north + 10.0)], {}))
    (after,) = layout_of(load_inputs(file.document)).piece(("gates", "corner")).spots
    assert math.isclose(after.north, spot.north + 10.0, abs_tol=0.02)
    assert math.isclose(after.east, spot.east, abs_tol=0.02)
    assert "latitude_deg: 45.00409" in file.document.text


@pytest.mark.parametrize(
    ("what", "said", "error"),
    [
        ("remove", {"path": ["gates", "start"]}, UsageError),
        ("remove", {"path": ["gates", "nobody"]}, UsageError),
        ("remove", {"path": ["rules"]}, UsageError),
        ("move", {"places": [{"path": ["rules"], "north": 1, "east": 2}], "turns": []}, UsageError),
        ("move", {"places": [{"path": ["gates", "corner"], "north": 1e9, "east": 2}], "turns": []}, InputError),
        ("move", {"places": [{"path": ["gates", "corner"], "north": "x", "east": 2}], "turns": []}, UsageError),
        ("set", {"path": ["gates", "corner", "height_m"], "value": -3}, InputError),
        ("set", {"path": ["rules", "n_z_max"], "value": -3}, InputError),
        ("set", {"path": ["rules", "alpha_max_deg"], "value": 3}, UsageError),
        ("set", {"path": ["aircraft"], "value": "edge540"}, UsageError),
        ("set", {"path": ["gates", "last", "pylons", 0, "height_m"], "value": 3}, UsageError),
        ("set", {"path": ["gates", "last", "pylons", 0], "value": 3}, UsageError),
        ("set", {"path": [], "value": 3}, UsageError),
        ("passing", {"path": ["course", "start"], "later": True}, UsageError),
        ("passing", {"path": ["course", "lap", 1], "later": True}, UsageError),
        ("passing", {"path": ["course", "lap", 0], "direction": "up"}, UsageError),
        ("add", {"kind": "tree", "north": 1, "east": 2}, UsageError),
        ("values", {"values": {"rules.floor_m": 1}}, UsageError),
        ("aircraft", {"names": ["/etc/passwd"]}, UsageError),
        ("undo", {"revision": "x"}, UsageError),
        ("fly", {}, UsageError),
        ("six-dof", {"session": 7}, UsageError),
    ],
)
def test_an_invalid_message_is_refused_and_changes_nothing(
    still: Designer, track: Path, what: str, said: dict[str, object], error: type[Exception]
) -> None:
    with pytest.raises(error):
        still.do(what, {"revision": 0, **said})
    assert (still.track.document.text, still.track.revision, track.read_text()) == (COURSE, 0, COURSE)


def test_the_sliders_leave_the_file_as_it_is_and_fly_what_they_say(still: Designer) -> None:
    still.do("values", {"values": {"environment.wind.speed_kt": 5, "rules.n_z_max": 8}})
    request = still._sessions[0].requests[-1]
    assert request.values == (
        "environment.wind.speed_kt=5",
        "environment.wind.from_deg=0",
        "rules.n_z_max=8",
    )
    assert request.number == still.state()["request"]
    load_inputs(request.track, overrides=request.values)
    assert not still.track.unsaved
