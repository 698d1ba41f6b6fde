"""The track file that is being laid out: its text with undo and redo, kept on the disk after every change."""

import difflib
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from airrace.design.edits import Edit, edit_document
from airrace.design.pieces import EditableCourse, layout_of
from airrace.design.unsaved import UnsavedCopy
from airrace.errors import AirraceError, StorageError, UsageError
from airrace.files.checkpoint.atomic import replace_file
from airrace.files.inputs import Document, load_inputs
from airrace.files.inputs.nodes import SIZE_MAX
from airrace.runtime.standard_streams import read_bytes

UNDO_MAX = 500
"""The steps that can be undone; each holds the text of the file."""
DIFFERENCES_MAX = 200
"""The lines of differences that are shown of a text that is offered."""
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

    A text that is not saved is on the disk before a change of it counts. What an earlier designer has left there is
    offered, and nothing is changed before it is taken or discarded.

    Args:
        path: of the file.
        aircraft: that flies it instead of the one that it names; None for that.

    Attributes:
        revision: the number of the text; it rises with every change, with undo and redo too.
        undo_stack, redo_stack: the steps before the present one, and those undone.
        unsaved_copy: the text on the disk while it is not saved.

    Raises:
        InputError: the file cannot be read or is not valid.
    """

    def __init__(self, path: Path, aircraft: str | None = None) -> None:
        self.path, self.aircraft = path, aircraft
        self.revision = 0
        self.undo_stack: list[_Step] = []
        self.redo_stack: list[_Step] = []
        self._step = self._read()
        self.unsaved_copy = UnsavedCopy(path)
        if self.offer == self.document.text:  # it was saved, and its writer killed before it could remove the copy
            self.unsaved_copy.remove()

    @property
    def layout(self) -> EditableCourse:
        """The pieces as they stand."""
        return self._step.layout

    @property
    def document(self) -> Document:
        """The text as it stands."""
        return self._step.document

    @property
    def digest(self) -> str:
        """The digest of the text as it stands."""
        return _digest(self.document.text.encode())

    @property
    def digest_of_file(self) -> str:
        """The digest of the file as it was last read or written."""
        return self._digest

    @property
    def unsaved(self) -> bool:
        """Whether the text differs from the one last read or written."""
        return self.document.text != self._saved

    @property
    def offer(self) -> str | None:
        """The text that an earlier designer has left unsaved; None if there is none, or it was answered."""
        return self.unsaved_copy.left

    def differences(self) -> list[str]:
        """Return the lines in which the text that is offered differs from the file, marked by `-` and `+`."""
        compared = difflib.unified_diff(self.document.text.splitlines(), (self.offer or "").splitlines(), n=0)
        lines = [line for line in compared if not line.startswith(("---", "+++", "@@"))]
        more = len(lines) - DIFFERENCES_MAX
        return [*lines[:DIFFERENCES_MAX], f"… and {more} lines more"] if more > 0 else lines

    def edit(self, revision: int, edits: Sequence[Edit], gesture: str = "") -> None:
        """Make edits as one step; those of the same gesture of the mouse continue the last step.

        Where an edit is refused, the steps of its gesture are taken back: all stands where it stood before.

        Raises:
            StaleRevision: the revision is not the latest.
            InputError: the file would no longer be valid; nothing is changed.
            UsageError: the file cannot be edited in this way.
        """
        self._ensure_latest(revision)
        continues = bool(gesture) and gesture == self._step.gesture
        try:
            document = edit_document(self.document, edits)
            changes = document != self.document
            step = _Step(layout_of(load_inputs(document, aircraft=self.aircraft)), gesture) if changes else self._step
        except AirraceError:
            if continues and self.undo_stack:
                self._show(self.undo_stack.pop())
            raise
        if changes:
            self._push(step, continues=continues)

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
            StorageError: the system refused, or the file is no file any more.
        """
        self._ensure_latest(revision)
        on_disk = self._content()
        if _digest(on_disk) not in (self._digest, overwrite):
            raise ChangedOnDisk(self.path, _digest(on_disk))
        mark = BYTE_ORDER_MARK if on_disk.startswith(BYTE_ORDER_MARK) else b""
        content = mark + self.document.text.encode()
        replace_file(self.path, content)
        self._saved, self._digest = self.document.text, _digest(content)
        self.unsaved_copy.remove()

    def reload(self, revision: int) -> None:
        """Read the file again, as a step that can be undone; errors as of `edit`."""
        self._ensure_latest(revision)
        self._push(self._read())

    def restore(self, revision: int, text: str) -> None:
        """Put a text in the place of the present one, as a step that can be undone; errors as of `edit`."""
        self._ensure_latest(revision)
        self._put(text)

    def take_offer(self) -> None:
        """Go on with the text that is offered, as a step that can be undone; nothing if there is none.

        Raises:
            InputError: it is not valid; it stays on the disk.
        """
        if self.offer is not None:
            self._put(self.offer)  # which writes it again, so that it is no offer any more

    def discard_offer(self) -> None:
        """Remove the text that is offered."""
        if self.offer is not None:
            self.unsaved_copy.remove()

    def _put(self, text: str) -> None:
        document = Document(self.document.path, text)
        if document != self.document:
            self._push(_Step(layout_of(load_inputs(document, aircraft=self.aircraft))))

    def _push(self, step: _Step, *, continues: bool = False) -> None:
        before = self._step
        self._show(step)
        if not continues:
            self.undo_stack = [*self.undo_stack, before][-UNDO_MAX:]
        self.redo_stack.clear()

    def _swap(self, revision: int, source: list[_Step], target: list[_Step]) -> None:
        self._ensure_latest(revision)
        if source:
            target.append(self._step)
            self._show(source.pop())

    def _show(self, step: _Step) -> None:
        """Make a step the present one, as soon as it is on the disk."""
        if step.document.text == self._saved:
            self.unsaved_copy.remove()
        else:
            self.unsaved_copy.write(step.document.text)
        self._step, self.revision = step, self.revision + 1

    def _ensure_latest(self, revision: int) -> None:
        if self.offer is not None:
            raise UsageError(f"{self.unsaved_copy.beside.name} holds work that is not saved: take or discard it first")
        if revision != self.revision:
            raise StaleRevision("another window has changed the course meanwhile; this one shows it now")

    def _read(self) -> _Step:
        inputs = load_inputs(self.path, aircraft=self.aircraft)
        self._saved, self._digest = inputs.track.text, _digest(inputs.track.text.encode())
        return _Step(layout_of(inputs))

    def _content(self) -> bytes:
        """Return what lies in the place of the file, nothing where it was removed."""
        try:
            if not self.path.exists():
                return b""
            if not self.path.is_file():  # which might be read for ever
                raise StorageError(f"cannot write {self.path}: it is no regular file any more")
            return read_bytes(self.path, SIZE_MAX + 1)
        except OSError as error:
            raise StorageError(f"cannot read {self.path}: {error.strerror or error}") from error


def _digest(content: bytes) -> str:
    return hashlib.sha256(content.removeprefix(BYTE_ORDER_MARK)).hexdigest()
