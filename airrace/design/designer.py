"""The state behind the page, which all windows see alike: track file and its steps, aircraft, what-ifs, a picture."""

import hashlib
import math
import os
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from airrace.checkpoint.atomic import replace_file
from airrace.design.edits import Edit, Put, edit_document
from airrace.design.pieces import KINDS, EditableCourse, Spot, layout_of
from airrace.design.solving import SLIDERS, WIND, Lane, Question
from airrace.errors import UsageError
from airrace.inputs import Document, load_inputs
from airrace.inputs.document import AIRCRAFT, TRACKS
from airrace.inputs.nodes import KeyPath
from airrace.inputs.placemarks import PlacemarkShape, read_placemarks
from airrace.track.course import Origin, metres
from airrace.track.polygons import Point

STEPS_MAX = 500
"""The number of steps back; each holds the text of the file."""
BYTE_ORDER_MARK = b"\xef\xbb\xbf"


class StaleRevision(UsageError):
    """An edit that was made on another revision than the one there is."""


class ChangedOnDisk(UsageError):
    """A file that somebody else has written meanwhile; by its digest it can be overwritten all the same."""

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
    """A track file that is being edited; it may be called from any thread.

    Args:
        path: of the file.
        aircraft: that flies it instead of the one that it names; None for that.

    Attributes:
        revision: the number of the text; it rises with every change, back and forth alike.
        layout: the pieces as they stand now.
        back, forth: the steps that can be taken.

    Raises:
        InputError: the file cannot be read or is not valid.
    """

    def __init__(self, path: Path, aircraft: str | None = None) -> None:
        self.path, self.aircraft = path, aircraft
        self._lock = threading.RLock()
        self.revision = 0
        self.back: list[_Step] = []
        self.forth: list[_Step] = []
        self._now = self._read()

    @property
    def layout(self) -> EditableCourse:
        return self._now.layout

    @property
    def document(self) -> Document:
        """The text as it is now."""
        return self._now.document

    @property
    def unsaved(self) -> bool:
        """Whether the text is another one than was read or written last."""
        return self.document.text != self._saved

    def edit(self, revision: int, edits: Sequence[Edit], gesture: str = "") -> None:
        """Make edits as one step; those of the same movement of a hand, a gesture, continue the last step.

        Raises:
            StaleRevision: there is another revision meanwhile.
            InputError: the file would no longer be valid; nothing is changed.
            UsageError: the file cannot be edited in this way.
        """
        with self._lock:
            self._ensure(revision)
            document = edit_document(self.document, edits)
            if document != self.document:
                step = _Step(layout_of(load_inputs(document, aircraft=self.aircraft)), gesture)
                self._become(step, [] if gesture and gesture == self._now.gesture else [self._now])

    def go(self, revision: int, *, back: bool) -> None:
        """Take a step back, or forth again; errors as of `edit`."""
        with self._lock:
            self._ensure(revision)
            from_, to = (self.back, self.forth) if back else (self.forth, self.back)
            if from_:
                to.append(self._now)
                self._now, self.revision = from_.pop(), self.revision + 1

    def save(self, revision: int, overwrite: str = "") -> None:
        """Write the text to its file.

        Args:
            revision: which is to be saved.
            overwrite: the digest of what somebody else has written there, to overwrite it.

        Raises:
            StaleRevision: there is another revision meanwhile.
            ChangedOnDisk: what lies there is not what was read or written last.
            StorageError: the system refused.
        """
        with self._lock:
            self._ensure(revision)
            there = self.path.read_bytes() if self.path.exists() else b""
            if _digest(there) not in (self._digest, overwrite):
                raise ChangedOnDisk(self.path, _digest(there))
            mark = BYTE_ORDER_MARK if there.startswith(BYTE_ORDER_MARK) else b""
            content = mark + self.document.text.encode()
            replace_file(self.path, content)
            self._saved, self._digest = self.document.text, _digest(content)

    def reload(self, revision: int) -> None:
        """Take what lies on the disk, as a step that can be undone; errors as of `edit`."""
        with self._lock:
            self._ensure(revision)
            self._become(self._read(), [self._now])

    def keep_unsaved(self) -> Path | None:
        """Write a text that is not saved beside the file, and return where; None if all is saved."""
        if not self.unsaved:
            return None
        beside = self.path.with_name(f"{self.path.stem}.unsaved{self.path.suffix}")
        replace_file(beside, self.document.text.encode())
        return beside

    def _become(self, step: _Step, before: list[_Step]) -> None:
        self.back = [*self.back, *before][-STEPS_MAX:]
        self.forth.clear()
        self._now, self.revision = step, self.revision + 1

    def _ensure(self, revision: int) -> None:
        if revision != self.revision:
            raise StaleRevision("another window has changed the course meanwhile; this one shows it now")

    def _read(self) -> _Step:
        inputs = load_inputs(self.path, aircraft=self.aircraft)
        self._saved, self._digest = inputs.track.text, _digest(self.path.read_bytes())
        return _Step(layout_of(inputs))


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


LANES_MAX = 2
"""The number of aircraft that fly side by side."""
PICTURES = {".png": "image/png", ".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".webp": "image/webp"}
PICTURE_MAX = 30 * 1024 * 1024
"""The largest picture below the course, bytes."""

Message = Mapping[str, Any]  # what a page sends; every value is checked where it is taken


class Designer:
    """A layout that is being worked on.

    Attributes:
        track: the track file.
        version: a number that rises with whatever there is to see.

    Raises:
        InputError: the track file is not valid.
        UsageError: it is no file of the user's own.
    """

    def __init__(self, path: Path, aircraft: str | None = None) -> None:
        if not path.is_file() and TRACKS.finds(path):
            raise UsageError(f"{path} comes with airrace; copy it first: airrace init my_course --like {path}")
        self.track = TrackFile(path, aircraft)
        self.version = 1
        self._lock = threading.Lock()
        self._values: dict[str, float] = {}
        self._background: dict[str, Any] | None = None
        self._lanes: list[Lane] = [Lane(aircraft, self._tell)]
        self._ask()

    def close(self) -> Path | None:
        """End the solvers; return where a text lies that nobody has saved, None if all is saved."""
        for lane in self._lanes:
            lane.close()
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
                "back": len(track.back),
                "forth": len(track.forth),
                "pieces": [asdict(piece) for piece in track.layout.pieces],
                "kinds": KINDS,
                "values": self._values,
                "lanes": [lane.shown for lane in self._lanes],
                "aircraft": AIRCRAFT.names,
                "background": self._background,
            }

    def do(self, what: str, said: Message) -> None:
        """Do what a window asks for.

        Raises:
            UsageError: it makes no sense, or was asked of another revision.
            InputError: the course would no longer be valid.
            StorageError: the system refused to write the file.
        """
        actions: dict[str, Callable[[], object]] = {
            "move": lambda: self._move(said),
            "set": lambda: self._set(said),
            "add": lambda: self.track.edit(
                said["revision"],
                self.track.layout.addition(_text(said["kind"]), Point(_number(said["north"]), _number(said["east"]))),
            ),
            "remove": lambda: self.track.edit(said["revision"], self.track.layout.removal(_path(said["path"]))),
            "undo": lambda: self.track.go(said["revision"], back=True),
            "redo": lambda: self.track.go(said["revision"], back=False),
            "reload": lambda: self.track.reload(said["revision"]),
            "save": lambda: self.track.save(said["revision"], _text(said.get("overwrite", ""))),
            "values": lambda: self._set_values(said["values"]),
            "aircraft": lambda: self._set_aircraft(said["names"]),
            "background": lambda: self._set_background(said.get("file"), said.get("placed")),
            "six-dof": lambda: self._lanes[int(_number(said["lane"]))].fly_six_dof(),
        }
        with self._lock:
            before = self.track.revision
            try:
                actions[what]()
            except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
                raise UsageError(f"{what}: not a message that the page sends: {error!r}") from error
            if self.track.revision != before or what in ("values", "aircraft"):
                self._ask()
        self._tell()

    def scene(self) -> str:
        """Return the page of the first aircraft's scene; `UsageError` if there is no flight yet."""
        return self._lanes[0].scene()

    def picture(self) -> tuple[bytes, str]:
        """Return the picture below the course and its kind; `UsageError` if there is none."""
        if self._background is None or self._background["lines"]:
            raise UsageError("there is no picture")
        path = self._within(self._background["file"])
        return path.read_bytes(), PICTURES[path.suffix.lower()]

    def _tell(self) -> None:
        self.version += 1

    def _ask(self) -> None:
        values = tuple(f"{key}={value:g}" for key, value in self._values.items())
        for lane in self._lanes:
            lane.ask(Question(self.track.revision, self.track.document, values))

    def _move(self, said: Message) -> None:
        places = [Spot(_path(one["path"]), _number(one["north"]), _number(one["east"])) for one in said["places"]]
        turns = {_path(one["path"]): _number(one["degrees"]) for one in said["turns"]}
        self.track.edit(said["revision"], self.track.layout.moved(places, turns), _text(said.get("gesture", "")))

    def _set(self, said: Message) -> None:
        path, value = _path(said["path"]), said["value"]
        piece = self.track.layout.piece(path[:-1])
        self.track.edit(said["revision"], [Put((*piece.path, path[-1]), _text(value, str, int, float, bool))])

    def _set_values(self, given: Message) -> None:
        """Set what-ifs; None takes one back. A wind has a direction and a speed."""
        values = dict(self._values)
        for key, value in given.items():
            if key not in SLIDERS:
                raise UsageError(f"no slider changes {key}")
            values.pop(key, None)
            if value is not None:
                values[key] = _number(value)
        if any(key in values for key in WIND) and self.track.layout.inputs.race.air.wind is None:
            values = dict.fromkeys(WIND[:2], 0.0) | values
        self._values = values

    def _set_aircraft(self, given: list[object]) -> None:
        """Fly one or two aircraft side by side; None is that of the track."""
        names = [None if one is None else _text(one) for one in given]
        if not 1 <= len(names) <= LANES_MAX or not set(names) <= {None, self.track.aircraft, *AIRCRAFT.names}:
            raise UsageError(f"one or two aircraft fly, of {', '.join(AIRCRAFT.names)}")
        known = {lane.aircraft: lane for lane in reversed(self._lanes)}
        lanes = [known.pop(name, None) or Lane(name, self._tell) for name in names]
        for lane in self._lanes:
            if lane not in lanes:
                lane.close()
        self._lanes = lanes

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
        marks = [one for one in read_placemarks(path) if one.places]
        origin = self.track.layout.inputs.race.course.origin
        if origin.latitude is None or origin.longitude is None:
            origin = Origin(*np.radians(marks[0].places[0]).tolist())
        found = list[tuple[str, list[list[float]]]]()
        for one in marks:
            corners = np.radians([*one.places, *([one.places[0]] * (one.shape is PlacemarkShape.AREA))])
            north, east, _ = metres(corners[:, 0], corners[:, 1], origin)
            found.append((one.name, np.stack([north, east], axis=1).round(2).tolist()))
        return found


def _number(value: object) -> float:
    number = float(_text(value, int, float))
    if not math.isfinite(number):
        raise UsageError("a finite number is needed")
    return number


def _text(value: object, *kinds: type) -> Any:
    if not isinstance(value, kinds or str) or (isinstance(value, bool) and bool not in kinds):
        raise UsageError(f"{value!r} is not what is needed here")
    return value


def _path(value: object) -> KeyPath:
    return tuple(_text(one, str, int) for one in cast(list[object], _text(value, list)))
