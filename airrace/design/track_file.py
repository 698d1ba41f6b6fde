"""The track file under the hand: its text with all steps back, by revisions, and what lies on the disk."""

import hashlib
import threading
from collections.abc import Sequence
from pathlib import Path

from airrace.checkpoint.atomic import replace_file
from airrace.design.edits import Edit, edit_document
from airrace.design.pieces import EditableCourse, layout_of
from airrace.errors import UsageError
from airrace.inputs import Document, load_inputs
from airrace.records import record

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


@record
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
