"""The state behind the page, the same in all windows: track file with undo and redo, aircraft, what-ifs, a picture."""

import hashlib
import math
import os
import threading
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from airrace.design.edits import Edit, Put, edit_document
from airrace.design.pieces import KINDS, EditableCourse, Spot, layout_of
from airrace.design.solving import SLIDERS, WIND, AircraftSession, LayoutRequest
from airrace.errors import UsageError
from airrace.files.checkpoint.atomic import replace_file
from airrace.files.inputs import Document, load_inputs
from airrace.files.inputs.document import AIRCRAFT, TRACKS
from airrace.files.inputs.nodes import KeyPath
from airrace.files.inputs.placemarks import PlacemarkShape, read_placemarks
from airrace.model.track.course import Origin, metres
from airrace.model.track.polygons import Point

UNDO_MAX = 500
"""The steps that can be undone; each holds the text of the file."""
BYTE_ORDER_MARK = b"\xef\xbb\xbf"


class StaleRevision(UsageError):
    """An edit of a revision that is not the latest."""


class ChangedOnDisk(UsageError):
    """A file that another program has written since it was read; naming its digest overwrites it all the same."""

    def __init__(self, path: Path, digest: str) -> None:
        super().__init__(f"{path.name} has changed on the disk meanwhile: take that, or overwrite it")
        self.digest = digest


@dataclass(frozen=True)
class _Step:
    layout: EditableCourse
    gesture: str = ""

    @property
    def document(self) -> Document:
        return self.layout.inputs.track


class TrackFile:
    """A track file that is being edited, with its undo and redo stacks; one thread at a time may use it.

    Args:
        path: of the file.
        aircraft: that flies it instead of the one that it names; None for that.

    Attributes:
        revision: the number of the text; it rises with every change, with undo and redo too.
        undo_stack, redo_stack: the steps before the present one, and those undone.

    Raises:
        InputError: the file cannot be read or is not valid.
    """

    def __init__(self, path: Path, aircraft: str | None = None) -> None:
        self.path, self.aircraft = path, aircraft
        self.revision = 0
        self.undo_stack: list[_Step] = []
        self.redo_stack: list[_Step] = []
        self._step = self._read()

    @property
    def layout(self) -> EditableCourse:
        """The pieces as they stand."""
        return self._step.layout

    @property
    def document(self) -> Document:
        """The text as it stands."""
        return self._step.document

    @property
    def unsaved(self) -> bool:
        """Whether the text differs from the one last read or written."""
        return self.document.text != self._saved

    def edit(self, revision: int, edits: Sequence[Edit], gesture: str = "") -> None:
        """Make edits as one step; those of the same gesture of the mouse continue the last step.

        Raises:
            StaleRevision: the revision is not the latest.
            InputError: the file would no longer be valid; nothing is changed.
            UsageError: the file cannot be edited in this way.
        """
        self._ensure_latest(revision)
        document = edit_document(self.document, edits)
        if document != self.document:
            step = _Step(layout_of(load_inputs(document, aircraft=self.aircraft)), gesture)
            self._push(step, continues=bool(gesture) and gesture == self._step.gesture)

    def undo(self, revision: int) -> None:
        """Take the last step back, if there is one; errors as of `edit`."""
        self._swap(revision, self.undo_stack, self.redo_stack)

    def redo(self, revision: int) -> None:
        """Make the step that was undone last again, if there is one; errors as of `edit`."""
        self._swap(revision, self.redo_stack, self.undo_stack)

    def save(self, revision: int, overwrite: str = "") -> None:
        """Write the text to its file.

        Args:
            revision: to be saved.
            overwrite: the digest of what another program has written there, to overwrite it.

        Raises:
            StaleRevision: the revision is not the latest.
            ChangedOnDisk: the file is not what was read or written last.
            StorageError: the system refused.
        """
        self._ensure_latest(revision)
        on_disk = self.path.read_bytes() if self.path.exists() else b""
        if _digest(on_disk) not in (self._digest, overwrite):
            raise ChangedOnDisk(self.path, _digest(on_disk))
        mark = BYTE_ORDER_MARK if on_disk.startswith(BYTE_ORDER_MARK) else b""
        content = mark + self.document.text.encode()
        replace_file(self.path, content)
        self._saved, self._digest = self.document.text, _digest(content)

    def reload(self, revision: int) -> None:
        """Read the file again, as a step that can be undone; errors as of `edit`."""
        self._ensure_latest(revision)
        self._push(self._read())

    def keep_unsaved(self) -> Path | None:
        """Write a text that is not saved beside the file, and return where; None if all is saved."""
        if not self.unsaved:
            return None
        beside = self.path.with_name(f"{self.path.stem}.unsaved{self.path.suffix}")
        replace_file(beside, self.document.text.encode())
        return beside

    def _push(self, step: _Step, *, continues: bool = False) -> None:
        if not continues:
            self.undo_stack = [*self.undo_stack, self._step][-UNDO_MAX:]
        self.redo_stack.clear()
        self._step, self.revision = step, self.revision + 1

    def _swap(self, revision: int, source: list[_Step], target: list[_Step]) -> None:
        self._ensure_latest(revision)
        if source:
            target.append(self._step)
            self._step, self.revision = source.pop(), self.revision + 1

    def _ensure_latest(self, revision: int) -> None:
        if revision != self.revision:
            raise StaleRevision("another window has changed the course meanwhile; this one shows it now")

    def _read(self) -> _Step:
        inputs = load_inputs(self.path, aircraft=self.aircraft)
        self._saved, self._digest = inputs.track.text, _digest(self.path.read_bytes())
        return _Step(layout_of(inputs))


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


SESSIONS_MAX = 2
"""The aircraft that fly side by side."""
PICTURES = {".png": "image/png", ".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".webp": "image/webp"}
PICTURE_MAX = 30 * 1024 * 1024
"""The largest picture below the course, bytes."""

Message = Mapping[str, Any]  # what a page sends; every value is checked where it is taken


class Designer:
    """A layout that is being worked on. It may be called from any thread.

    Attributes:
        track: the track file.

    Raises:
        InputError: the track file is not valid.
        UsageError: it is no file of the user's own.
    """

    def __init__(self, path: Path, aircraft: str | None = None) -> None:
        if not path.is_file() and TRACKS.finds(path):
            raise UsageError(f"{path} comes with airrace; copy it first: airrace init my_course --like {path}")
        self.track = TrackFile(path, aircraft)
        self._lock = threading.Lock()  # of all but the version
        self._version, self._version_lock = 1, threading.Lock()  # sessions raise it while the other lock is held
        self._values: dict[str, float] = {}
        self._background: dict[str, Any] | None = None
        self._sessions = [AircraftSession(aircraft, self._raise_version)]
        self._submit()

    @property
    def version(self) -> int:
        """A number that rises whenever there is something new to see."""
        with self._version_lock:
            return self._version

    def close(self) -> Path | None:
        """End the solvers; return where a text that is not saved was written, None if all is saved."""
        with self._lock:
            for session in self._sessions:
                session.close()
            return self.track.keep_unsaved()

    def state(self) -> dict[str, object]:
        """Return all that a window shows, for JSON."""
        with self._lock:
            track = self.track
            return {
                "version": self.version,
                "revision": track.revision,
                "name": track.layout.inputs.race.course.name,
                "file": track.path.name,
                "unsaved": track.unsaved,
                "undo": len(track.undo_stack),
                "redo": len(track.redo_stack),
                "pieces": [asdict(piece) for piece in track.layout.pieces],
                "kinds": KINDS,
                "values": self._values,
                "sessions": [session.result() for session in self._sessions],
                "aircraft": AIRCRAFT.names,
                "background": self._background,
            }

    def do(self, action: str, message: Message) -> None:
        """Do what a window asks for.

        Raises:
            UsageError: the message is not valid, or was sent for another revision.
            InputError: the course would no longer be valid.
            StorageError: the system refused to write the file.
        """
        with self._lock:
            before = self.track.revision
            try:
                self._do(action, message)
            except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
                raise UsageError(f"{action}: not a message that the page sends: {error!r}") from error
            if self.track.revision != before or action in ("values", "aircraft"):
                self._submit()
        self._raise_version()

    def _do(self, action: str, message: Message) -> None:
        track = self.track
        match action:
            case "move":
                places = [
                    Spot(_path(place["path"]), _number(place["north"]), _number(place["east"]))
                    for place in message["places"]
                ]
                turns = {_path(turn["path"]): _number(turn["degrees"]) for turn in message["turns"]}
                track.edit(message["revision"], track.layout.moved(places, turns), _text(message.get("gesture", "")))
            case "set":
                path, value = _path(message["path"]), _text(message["value"], str, int, float, bool)
                piece = track.layout.piece(path[:-1])
                track.edit(message["revision"], [Put((*piece.path, path[-1]), value)])
            case "add":
                at = Point(_number(message["north"]), _number(message["east"]))
                track.edit(message["revision"], track.layout.addition(_text(message["kind"]), at))
            case "remove":
                track.edit(message["revision"], track.layout.removal(_path(message["path"])))
            case "undo":
                track.undo(message["revision"])
            case "redo":
                track.redo(message["revision"])
            case "reload":
                track.reload(message["revision"])
            case "save":
                track.save(message["revision"], _text(message.get("overwrite", "")))
            case "values":
                self._set_values(message["values"])
            case "aircraft":
                self._set_aircraft(message["names"])
            case "background":
                self._set_background(message.get("file"), message.get("placed"))
            case "six-dof":
                self._sessions[int(_number(message["session"]))].submit_six_dof()
            case _:
                raise KeyError(action)

    def scene(self) -> str:
        """Return the page of the first aircraft's scene; `UsageError` if there is no flight yet."""
        return self._sessions[0].scene()

    def picture(self) -> tuple[bytes, str]:
        """Return the picture below the course and its kind; `UsageError` if there is none."""
        background = self._background
        if background is None or background["lines"]:
            raise UsageError("there is no picture")
        path = self._within(background["file"])
        return path.read_bytes(), PICTURES[path.suffix.lower()]

    def _raise_version(self) -> None:
        with self._version_lock:
            self._version += 1

    def _submit(self) -> None:
        values = tuple(f"{key}={value:g}" for key, value in self._values.items())
        for session in self._sessions:
            session.submit(LayoutRequest(self.track.revision, self.track.document, values))

    def _set_values(self, changes: Message) -> None:
        """Set what-ifs; None takes one back. A wind has a direction and a speed."""
        values = dict(self._values)
        for key, value in changes.items():
            if key not in SLIDERS:
                raise UsageError(f"no slider changes {key}")
            values.pop(key, None)
            if value is not None:
                values[key] = _number(value)
        if any(key in values for key in WIND) and self.track.layout.inputs.race.air.wind is None:
            values = dict.fromkeys(WIND[:2], 0.0) | values
        self._values = values

    def _set_aircraft(self, chosen: list[object]) -> None:
        """Fly one or two aircraft side by side; None is that of the track."""
        names = [None if name is None else _text(name) for name in chosen]
        if not 1 <= len(names) <= SESSIONS_MAX or not set(names) <= {None, self.track.aircraft, *AIRCRAFT.names}:
            raise UsageError(f"one or two aircraft fly, of {', '.join(AIRCRAFT.names)}")
        open_sessions = {session.aircraft: session for session in reversed(self._sessions)}
        sessions = [open_sessions.pop(name, None) or AircraftSession(name, self._raise_version) for name in names]
        for session in self._sessions:
            if session not in sessions:
                session.close()
        self._sessions = sessions

    def _set_background(self, name: object, placed: list[object] | None) -> None:
        """Lay a picture or placemarks below the course, or place what lies there.

        A point (x, y), to the right and down in pixels or east and south in m, comes to lie at north - b x - a y and
        east + a x - b y, where `placed` is a, b, north, east.
        """
        if not name:
            self._background = None
            return
        a, b, north, east = map(_number, placed or (1.0, 0.0, 0.0, 0.0))
        path = self._within(_text(name))
        picture = path.suffix.lower() in PICTURES
        if picture and path.stat().st_size > PICTURE_MAX:
            raise UsageError(f"{path.name} is larger than {PICTURE_MAX >> 20} MB")
        lines = [] if picture else self._placemarks(path)
        self._background = {"file": name, "lines": lines, "placed": (a, b, north, east) if placed or lines else None}

    def _within(self, name: str) -> Path:
        """Return a file in the folder of the track file; `UsageError` if it lies elsewhere or is none."""
        folder = Path(os.path.realpath(self.track.path.parent))
        path = Path(os.path.realpath(folder / name))
        if not path.is_relative_to(folder) or not path.is_file():
            raise UsageError(f"there is no file {name} in the folder of {self.track.path.name}")
        return path

    def _placemarks(self, path: Path) -> list[tuple[str, list[list[float]]]]:
        """Return lines and points with their names, m north and east of the origin, or of the first of them."""
        marks = [mark for mark in read_placemarks(path) if mark.places]
        origin = self.track.layout.inputs.race.course.origin
        if origin.latitude is None or origin.longitude is None:
            origin = Origin(*np.radians(marks[0].places[0]).tolist())
        lines = list[tuple[str, list[list[float]]]]()
        for mark in marks:
            places = [*mark.places, mark.places[0]] if mark.shape is PlacemarkShape.AREA else mark.places
            corners = np.radians(places)
            north, east, _ = metres(corners[:, 0], corners[:, 1], origin)
            lines.append((mark.name, np.stack([north, east], axis=1).round(2).tolist()))
        return lines


def _number(value: object) -> float:
    number = float(_text(value, int, float))
    if not math.isfinite(number):
        raise UsageError("a finite number is needed")
    return number


def _text(value: object, *kinds: type) -> Any:
    """Return a value of one of the kinds, by default text; a truth value is no number."""
    if not isinstance(value, kinds or str) or (isinstance(value, bool) and bool not in kinds):
        raise UsageError(f"{value!r} is not of the kind that is needed here")
    return value


def _path(value: object) -> KeyPath:
    return tuple(_text(part, str, int) for part in cast(list[object], _text(value, list)))
