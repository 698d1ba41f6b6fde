"""Edits of a text in place: nothing but what is asked for changes, and what comes out says exactly that."""

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from airrace.design.edits import Edit, Insert, Put, Remove, edit_document
from airrace.errors import UsageError
from airrace.files.inputs import Document
from airrace.files.inputs.yaml_reader import read_yaml

TEXT = """\
# A course.
name: "Three: gates"   # quoted
gates:  # all of them
  a: {type: level, north_m: 0.0, east_m: 10, heading_deg: 20}  # the first
  # b is a block.
  b:
    type: pylon
    north_m: 200      # measured
    pylons: [{north_m: 1, east_m: 2}, {north_m: 3, east_m: 4}]
    notes: |
      text
  c: {type: level, north_m: 5}

  # The end of the gates.
order:
  lap:
    - b
    - {gate: c, direction: reverse} # back
  flow: [a, b]
obstacles:
"""


def lines(edit: Edit, text: str = TEXT) -> tuple[list[str], list[str]]:
    """The lines that an edit removes, and those that it adds."""
    old, new = text.splitlines(), edit_document(Document("t.yaml", text), [edit]).text.splitlines()
    return [one for one in old if one not in new], [one for one in new if one not in old]


@pytest.mark.parametrize(
    ("edit", "removed", "added"),
    [
        (
            Put(("gates", "a", "north_m"), 12.5),
            ["  a: {type: level, north_m: 0.0, east_m: 10, heading_deg: 20}  # the first"],
            ["  a: {type: level, north_m: 12.5, east_m: 10, heading_deg: 20}  # the first"],
        ),
        (
            Put(("gates", "b", "north_m"), -1234.5),
            ["    north_m: 200      # measured"],
            ["    north_m: -1234.5  # measured"],
        ),
        (
            Put(("gates", "b", "pylons", 1, "east_m"), 7),
            ["    pylons: [{north_m: 1, east_m: 2}, {north_m: 3, east_m: 4}]"],
            ["    pylons: [{north_m: 1, east_m: 2}, {north_m: 3, east_m: 7}]"],
        ),
        (
            Put(("gates", "c", "east_m"), 6),
            ["  c: {type: level, north_m: 5}"],
            ["  c: {type: level, north_m: 5, east_m: 6}"],
        ),
        (Put(("gates", "b", "reach_m"), 90), [], ["    reach_m: 90"]),
        (Put(("gates", "d"), {"type": "level", "note": "a: b"}), [], ['  d: {type: level, note: "a: b"}']),
        (Put(("crowd", "pier"), {"point": {"north_m": 1}}), [], ["crowd: {pier: {point: {north_m: 1}}}"]),
        (Put(("obstacles", "mast"), {"height_m": 30}), ["obstacles:"], ["obstacles: {mast: {height_m: 30}}"]),
        (Insert(("order", "lap", 1), "a"), [], ["    - a"]),
        (Insert(("order", "lap", 2), {"gate": "a"}), [], ["    - {gate: a}"]),
        (Insert(("order", "flow", 1), "c"), ["  flow: [a, b]"], ["  flow: [a, c, b]"]),
        (Remove(("order", "flow", 1)), ["  flow: [a, b]"], ["  flow: [a]"]),
        (Remove(("order", "lap", 1)), ["    - {gate: c, direction: reverse} # back"], []),
        (Remove(("gates", "c")), ["  c: {type: level, north_m: 5}"], []),
    ],
    ids=lambda one: ".".join(map(str, one.path)) if isinstance(one, Edit) else "",
)
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_an_edit_touches_the_lines_that_it_names_alone(
    edit: Edit, removed: list[str], added: list[str], newline: str
) -> None:
    text = TEXT.replace("\n", newline)
    assert lines(edit, text) == (removed, added)
    assert edit_document(Document("t.yaml", text), [edit]).text.count(newline) == TEXT.count("\n") + len(added) - len(
        removed
    )


@pytest.mark.parametrize("text", ["012", "1e999", "-.inf", ".nan", "99999999999999999999", "yes", "~", "1_0", "0x1f"])
def test_a_text_stays_a_text_whatever_it_looks_like(text: str) -> None:
    edited = edit_document(Document("t.yaml", TEXT), [Put(("name",), text)])
    assert read_yaml("t.yaml", edited.text).plain()["name"] == text


@given(st.text(max_size=30))
@example("\N{CHEQUERED FLAG} \x7f")
def test_any_text_is_read_back(text: str) -> None:
    edited = edit_document(Document("t.yaml", TEXT), [Put(("name",), text)])
    assert read_yaml("t.yaml", edited.text).plain()["name"] == text


def test_the_last_entry_is_removed_with_what_holds_it() -> None:
    text = "a: 1\ncrowd:\n  pier:\n    point: {north_m: 1}\nb: 2\n"
    assert edit_document(Document("t.yaml", text), [Remove(("crowd", "pier"))]).text == "a: 1\nb: 2\n"


def test_what_is_put_in_and_removed_again_leaves_the_text_as_it_was() -> None:
    put, remove = Put(("gates", "d"), {"type": "level"}), Remove(("gates", "d"))
    assert edit_document(Document("t.yaml", TEXT), [put, remove]).text == TEXT


@pytest.mark.parametrize(
    ("text", "edit"),
    [
        ("a:\n  - - b\n    - c\n", Insert(("a", 0, 0), "d")),
        ("a: {b: 1}\n", Remove(("a", "c"))),
        ("a: 1\n", Put(("a", "b"), 1)),
        ("a: [1]\n", Put(("a", 4), 1)),
    ],
)
def test_what_cannot_be_edited_in_place_is_refused(text: str, edit: Edit) -> None:
    with pytest.raises(UsageError):
        edit_document(Document("t.yaml", text), [edit])
