"""No change that was accepted is lost, wherever the designer is killed and whatever the disk refuses."""

import errno
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from three_gates import COURSE

from airrace.design import track_file, unsaved
from airrace.design.designer import Designer
from airrace.errors import AirraceError, StorageError, UsageError

CORNER = ["gates", "corner"]


def move(designer: Designer, north: float, **message: object) -> dict[str, object]:
    place = {"path": CORNER, "north": north, "east": 60.0}
    return designer.do("move", {"revision": designer.track.revision, "places": [place], "turns": [], **message})


def corner(designer: Designer) -> float:
    return designer.track.layout.piece(tuple(CORNER)).spots[0].north


@contextmanager
def restarted(killed: Designer) -> Iterator[Designer]:
    """A designer of the same file after one that was killed: of which only its files are left."""
    file = killed.address_file._file
    if file is not None:
        file.close()  # as the system does at a process's end
    designer = Designer(killed.track.path)
    yield designer
    designer.close()


@pytest.fixture
def full(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """A disk that takes nothing more into the folders that the list holds."""
    folders = list[Path]()
    replace_file = unsaved.replace_file

    def replace_if_there_is_room(path: Path, content: bytes) -> None:
        if any(path.is_relative_to(folder) for folder in folders):
            raise StorageError(f"cannot write {path}: {os.strerror(errno.ENOSPC)}")
        replace_file(path, content)

    for module in (unsaved, track_file):
        monkeypatch.setattr(module, "replace_file", replace_if_there_is_room)
    return folders


def test_every_change_is_on_the_disk_and_offered_after_a_kill(still: Designer) -> None:
    beside = still.track.unsaved_copy.beside
    for north in (430.0, 440.0):
        move(still, north)
        assert beside.read_text() == still.track.document.text
    still.do("undo", {"revision": 2})
    assert beside.read_text() == still.track.document.text
    with restarted(still) as designer:
        assert designer.track.document.text == COURSE
        offer: Any = designer.state()["offer"]
        assert [line.split("north_m: ")[1][:3] for line in offer["differences"]] == ["420", "430"]
        designer.do("take", {})
        assert corner(designer) == 430.0
        designer.do("undo", {"revision": 1})
        assert designer.track.document.text == COURSE
        assert not beside.exists()


def test_nothing_is_changed_before_the_offer_is_answered(still: Designer) -> None:
    move(still, 430.0)
    text = still.track.document.text
    with restarted(still) as designer:
        for action, message in (("undo", {}), ("save", {}), ("reload", {}), ("restore", {"text": COURSE})):
            with pytest.raises(UsageError, match="take or discard it first"):
                designer.do(action, {"revision": 0, **message})
        with pytest.raises(UsageError, match="take or discard it first"):
            move(designer, 450.0)
        end = designer.close()
        assert end is not None
        assert end.path is not None
        assert end.path.read_text() == text
        designer.do("discard", {})
        assert not designer.track.unsaved_copy.beside.exists()
        move(designer, 450.0)


def test_a_kill_between_the_saved_file_and_its_copy_leaves_nothing_to_be_asked(still: Designer) -> None:
    move(still, 430.0)
    still.track.path.write_text(still.track.document.text)
    with restarted(still) as designer:
        assert designer.state()["offer"] is None
        assert not designer.track.unsaved_copy.beside.exists()


def test_saving_writes_the_file_before_the_copy_goes(still: Designer, full: list[Path]) -> None:
    move(still, 430.0)
    full.append(still.track.path.parent)
    with pytest.raises(StorageError):
        still.do("save", {"revision": 1})
    assert still.track.unsaved_copy.beside.read_text() == still.track.document.text
    full.clear()
    still.do("save", {"revision": 1})
    assert not still.track.unsaved_copy.beside.exists()


def test_what_a_full_disk_refuses_lies_in_a_temporary_folder_until_there_is_room(
    still: Designer, full: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(unsaved.tempfile, "tempdir", str(tmp_path))
    full.append(still.track.path.parent)
    move(still, 430.0)
    elsewhere = still.track.unsaved_copy.path
    assert elsewhere is not None
    assert elsewhere.read_text() == still.track.document.text == still.state()["text"]
    assert str(elsewhere) in str(still.state()["problem"])
    full.clear()
    move(still, 440.0)
    assert not elsewhere.exists()
    assert still.state()["problem"] == ""
    full.append(tmp_path)
    move(still, 450.0)
    end = still.close()
    assert end is not None
    assert (end.path, end.text) == (None, still.track.document.text)  # whoever ends it prints the text


@pytest.mark.parametrize("kind", ["folder", "pipe", "not text"])
def test_what_lies_in_the_place_of_the_copy_is_not_overwritten(still: Designer, kind: str) -> None:
    beside = still.track.unsaved_copy.beside
    match kind:
        case "folder":
            beside.mkdir()
        case "pipe":
            os.mkfifo(beside)
        case _:
            beside.write_bytes(b"\xff")
    before = beside.lstat()
    with restarted(still) as designer:
        move(designer, 430.0)
        path = designer.track.unsaved_copy.path
        assert path not in (None, beside)
        assert beside.name in str(designer.state()["problem"])
        assert (beside.lstat().st_ino, beside.lstat().st_mode) == (before.st_ino, before.st_mode)
        move(designer, 420.0)


@pytest.mark.parametrize("kind", ["folder", "pipe", "nothing"])
def test_saving_where_the_file_was_is_refused_or_done_but_never_hangs(still: Designer, kind: str) -> None:
    path = still.track.path
    move(still, 430.0)
    path.unlink()
    match kind:
        case "folder":
            path.mkdir()
        case "pipe":
            os.mkfifo(path)
        case _:
            pass
    with pytest.raises(AirraceError) as refused:
        still.do("save", {"revision": 1})
    if kind == "nothing":
        still.do("save", {"revision": 1, "overwrite": refused.value.digest})  # type: ignore[attr-defined]
        assert path.read_text() == still.track.document.text
    else:
        assert "no regular file" in str(refused.value)


def test_a_refused_drag_goes_back_to_where_the_gate_stood_before_it(still: Designer) -> None:
    move(still, 430.0)
    move(still, 450.0, gesture="drag")
    with pytest.raises(AirraceError):
        move(still, 1e9, gesture="drag")
    assert corner(still) == 430.0
    assert still.track.unsaved_copy.beside.read_text() == still.track.document.text
    still.do("undo", {"revision": still.track.revision})
    assert still.track.document.text == COURSE


def test_a_track_file_has_one_designer_whose_address_a_second_one_names(still: Designer) -> None:
    still.address_file.write(1234, "t" * 32)
    with pytest.raises(UsageError, match=f"127.0.0.1:1234/{'t' * 32}/"):
        Designer(still.track.path)


@pytest.mark.parametrize("ended", [True, False])
def test_a_designer_takes_the_address_of_one_that_was_killed(still: Designer, ended: bool) -> None:
    still.address_file.write(1234, "t" * 32)
    if ended:
        still.close()
    with restarted(still) as designer:
        file = designer.address_file
        assert (file.port, file.token) == ((0, "") if ended else (1234, "t" * 32))


NUMBERS = (int("9" * 400), 1e308, -1, 0, True)
TEXTS = ("", "n" * 5000, "\0", "\ud800", "../" * 1000, "course.yaml", "pipe.png")
NASTY: tuple[object, ...] = (*NUMBERS, *TEXTS, None, [], [None], {})


def test_no_message_fails_but_with_a_reason_or_makes_the_state_unreadable(still: Designer, track: Path) -> None:
    os.mkfifo(track.parent / "pipe.png")
    actions: dict[str, dict[str, object]] = {
        "move": {"places": [{"path": CORNER, "north": 430.0, "east": 60.0}], "turns": [{"path": CORNER, "degrees": 1}]},
        "set": {"path": [*CORNER, "height_m"], "value": 30},
        "add": {"kind": "pylon", "north": 300, "east": 0},
        "remove": {"path": CORNER},
        "values": {"values": {"rules.n_z_max": 9}},
        "aircraft": {"names": [None]},
        "background": {"file": "map.png", "placed": [1, 0, 0, 0]},
        "six-dof": {"session": 0},
        "restore": {"text": COURSE},
        "save": {"overwrite": ""},
    }
    reasons = list[str]()
    for action, message in actions.items():
        for key, value in message.items():
            variants: list[object] = list(NASTY)
            if isinstance(value, dict):
                variants += [{name: nasty} for name in value for nasty in NASTY]
            if isinstance(value, list) and value and isinstance(value[0], dict):
                variants += [[{**value[0], name: nasty}] for name in value[0] for nasty in NASTY]
            for variant in variants:
                try:
                    still.do(action, {"revision": still.track.revision, **message, key: variant})
                except AirraceError as error:
                    reasons.append(str(error))
                json.dumps(still.state(), allow_nan=False, ensure_ascii=False).encode()
    assert len(reasons) > len(NASTY)
    assert all(reasons)


def test_a_page_is_told_whether_the_file_was_edited_while_there_was_no_designer(still: Designer) -> None:
    read = still.state()["digest_of_file"]
    move(still, 430.0)
    assert still.state()["digest_of_file"] == read
    with restarted(still) as designer:
        assert designer.state()["digest_of_file"] == read
    path = still.track.path
    path.write_text(path.read_text().replace("north_m: 420", "north_m: 425"))
    with restarted(still) as designer:
        assert designer.state()["digest_of_file"] != read
        assert designer.state()["offer"] is not None
