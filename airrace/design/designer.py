"""The state behind the page, the same in all windows: track file with undo and redo, aircraft, what-ifs, a picture."""

import math
import os
import reprlib
import secrets
import threading
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from airrace.design.address import AddressFile
from airrace.design.course_form import DIRECTIONS, direct_passing, fields_of, move_passing, passing_items, set_field
from airrace.design.pieces import KINDS, Spot
from airrace.design.solving import SLIDERS, WIND, AircraftSession, LayoutRequest
from airrace.design.track_file import TrackFile
from airrace.errors import AirraceError, UsageError
from airrace.files.checkpoint.atomic import replace_file
from airrace.files.inputs.document import AIRCRAFT, TRACKS
from airrace.files.inputs.nodes import KeyPath
from airrace.files.inputs.placemarks import PlacemarkShape, read_placemarks
from airrace.model.track.course import Origin, metres
from airrace.model.track.polygons import Point
from airrace.runtime.standard_streams import STANDARD

SESSIONS_MAX = 2
"""The aircraft that fly side by side."""
PICTURES = {".png": "image/png", ".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".webp": "image/webp"}
PICTURE_MAX = 30 * 1024 * 1024
"""The largest picture below the course, bytes."""
PLACEMARKS = (".kml", ".kmz", ".gpx", ".geojson")
FILES_MAX = 200
"""The files of the folder that are named for a choice."""

Message = Mapping[str, Any]  # what a page sends; every value is checked where it is taken


@dataclass(frozen=True)
class Unsaved:
    """A text that is not saved when a designer ends, and where it lies; None where the disk would not take it."""

    path: Path | None
    text: str


class Designer:
    """A layout that is being worked on. It may be called from any thread.

    Attributes:
        track: the track file.
        address_file: which keeps other designers from the same track file.

    Raises:
        InputError: the track file is not valid.
        UsageError: it is no file of the user's own, or another designer has it open.
    """

    def __init__(self, path: Path, aircraft: str | None = None) -> None:
        if path == STANDARD:
            raise UsageError("the designer edits a file, which stdin is not")
        if not path.is_file() and TRACKS.finds(path):
            raise UsageError(f"{path} comes with airrace; copy it first: airrace init my_course --like {path}")
        self.address_file = AddressFile(path)
        try:
            self.track = TrackFile(path, aircraft)
        except BaseException:
            self.address_file.close()
            raise
        self._name = secrets.token_hex(4)  # by which a page sees that it has come to another designer
        self._lock = threading.Lock()  # of all but the version
        self._version, self._version_lock = 1, threading.Lock()  # sessions raise it while the other lock is held
        self._request = 0  # the number of the latest one: other values are another layout, too
        self._values: dict[str, float] = {}
        self._background: dict[str, Any] | None = None
        self._sessions = [AircraftSession(aircraft, self._raise_version)]
        self._submit()

    @property
    def version(self) -> int:
        """A number that rises whenever there is something new to see."""
        with self._version_lock:
            return self._version

    def close(self) -> Unsaved | None:
        """End the solvers; return the text that is not saved, None if all is."""
        with self._lock:
            for session in self._sessions:
                session.close()
            self.address_file.close()
            track = self.track
            if track.offer is not None:
                return Unsaved(track.unsaved_copy.beside, track.offer)
            return Unsaved(track.unsaved_copy.path, track.document.text) if track.unsaved else None

    def state(self) -> dict[str, object]:
        """Return all that a window shows, for JSON."""
        with self._lock:
            track = self.track
            return {
                "version": self.version,
                "designer": self._name,
                "revision": track.revision,
                "digest": track.digest,
                "digest_of_file": track.digest_of_file,
                "request": self._request,
                "name": track.layout.inputs.race.course.name,
                "file": track.path.name,
                "unsaved": track.unsaved,
                "offer": None
                if track.offer is None
                else {"file": track.unsaved_copy.beside.name, "differences": track.differences()},
                "problem": self._problem(),
                # A page keeps the text that the disk does not.
                "text": track.document.text if track.unsaved_copy.problem else None,
                "undo": len(track.undo_stack),
                "redo": len(track.redo_stack),
                "pieces": [asdict(piece) for piece in track.layout.pieces],
                "kinds": KINDS,
                "form": [asdict(field) for field in fields_of(track.layout.plain)],
                "passings": [asdict(item) for item in passing_items(track.layout)],
                "directions": DIRECTIONS,
                "values": self._values,
                "sessions": [session.result() for session in self._sessions],
                "aircraft": AIRCRAFT.names,
                "background": self._background,
                "files": self._files(),
            }

    def do(self, action: str, message: Message) -> dict[str, object]:
        """Do what a window asks for; return the revision and its digest, for JSON.

        Raises:
            UsageError: the message is not valid, or was sent for another revision.
            InputError: the course would no longer be valid.
            StorageError: the system refused to write the file.
        """
        with self._lock:
            before = self.track.revision
            try:
                self._do(action, message)
            except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError) as error:
                raise UsageError(f"{action}: not a message that the page sends: {reprlib.repr(error)}") from error
            finally:
                if self.track.revision != before or action in ("values", "aircraft"):
                    self._submit()
                self._raise_version()
            return {"version": self.version, "revision": self.track.revision, "digest": self.track.digest}

    def _problem(self) -> str:
        """Return what the disk does not take, and where else the text lies."""
        copy = self.track.unsaved_copy
        if not copy.problem or not self.track.unsaved:
            return copy.problem
        place = f"it lies in {copy.path}" if copy.path else "it lies nowhere but in this page and in memory"
        return f"What is not saved is not beside the track file ({copy.problem}); {place}."

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
                path, value = _path(message["path"]), message["value"]
                if value is not None:
                    _text(value, str, int, float, bool)
                if isinstance(value, int | float) and not isinstance(value, bool):
                    _number(value)
                if path[0] in ("course", "rules"):
                    edits = set_field(track.layout.plain, path, value)
                else:
                    edits = track.layout.setting(path, value)
                track.edit(message["revision"], edits)
            case "passing":
                path = _path(message["path"])
                if "direction" in message:
                    edits = direct_passing(track.layout, path, _text(message["direction"]))
                else:
                    edits = move_passing(track.layout, path, _text(message["later"], bool))
                track.edit(message["revision"], edits)
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
            case "restore":
                track.restore(message["revision"], _text(message["text"]))
            case "take":
                track.take_offer()
            case "discard":
                track.discard_offer()
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

    def add_file(self, name: str, content: bytes) -> None:
        """Put a picture or placemarks beside the track file and lay them below the course.

        Raises:
            UsageError: it is neither, or another file has this name.
            StorageError: the system refused.
        """
        if Path(name).name != name or Path(name).suffix.lower() not in (*PICTURES, *PLACEMARKS):
            raise UsageError(f"{name:.100} is neither a picture nor placemarks: {', '.join((*PICTURES, *PLACEMARKS))}")
        with self._lock:
            try:
                path = self.track.path.with_name(name)
                is_new = not path.exists()
                if not is_new and not (path.is_file() and path.read_bytes() == content):
                    raise UsageError(f"there is another {name} beside the track file: rename yours")
                if is_new:
                    replace_file(path, content)
            except (OSError, ValueError) as error:  # of a name that is too long, or has a null character
                raise UsageError(f"{name:.100} cannot be the name of a file here") from error
            try:
                self._set_background(name, None)
            except AirraceError:
                if is_new:
                    path.unlink(missing_ok=True)
                raise
        self._raise_version()

    def _files(self) -> list[str]:
        """Return the names of what can be laid below the course, of the folder of the track file."""
        try:
            names = os.listdir(self.track.path.parent)
        except OSError:
            return []
        return sorted(name for name in names if Path(name).suffix.lower() in (*PICTURES, *PLACEMARKS))[:FILES_MAX]

    def _raise_version(self) -> None:
        with self._version_lock:
            self._version += 1

    def _submit(self) -> None:
        self._request += 1
        values = tuple(f"{key}={value:g}" for key, value in self._values.items())
        for session in self._sessions:
            session.submit(LayoutRequest(self._request, self.track.document, values))

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
        try:
            is_file = path.is_relative_to(folder) and path.is_file()
        except OSError:  # as of a name that is too long
            is_file = False
        if not is_file:
            raise UsageError(f"there is no file {name:.100} in the folder of {self.track.path.name}")
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
        raise UsageError(f"{reprlib.repr(value)} is not of the kind that is needed here")
    return value


def _path(value: object) -> KeyPath:
    return tuple(_text(part, str, int) for part in cast(list[object], _text(value, list)))
