"""Work that is not saved, on the disk beside its track file after every change, and offered at the next start."""

import tempfile
from contextlib import suppress
from pathlib import Path

from airrace.errors import Finding, StorageError
from airrace.files.checkpoint.atomic import replace_file
from airrace.files.inputs.document import read_document


class UnsavedCopy:
    """The text that is not saved, in `NAME.unsaved.yaml` beside the track file.

    What the system does not take there lies in a temporary folder instead. No call raises an error: an edit must not
    fail because its copy does.

    Attributes:
        beside: where it lies beside the track file.
        left: the text that an earlier designer has left there, until it is written or removed; None if there is none.
        path: where the latest text lies; None if there is none, or no place for it.
        problem: why the latest text does not lie beside the track file; empty if it does.
    """

    def __init__(self, track: Path) -> None:
        self.beside = track.with_name(f"{track.stem}.unsaved{track.suffix}")
        self.path: Path | None = None
        self.problem = ""
        self._elsewhere: Path | None = None
        self._obstacle = ""  # what lies in its place and cannot be read, and so must not be overwritten
        findings = list[Finding]()
        document = read_document(self.beside, findings) if self._is_taken() else None
        self.left = None if document is None else document.text
        if findings:
            self._obstacle = f"{self.beside.name} {findings[0].message}"

    def write(self, text: str) -> None:
        """Bring a text to the disk, in the place of the one before."""
        self.path, self.problem, self.left = None, self._obstacle, None
        if not self._obstacle:
            try:
                replace_file(self.beside, text.encode())
            except StorageError as error:
                self.problem = str(error)
            else:
                self.path = self.beside
                self._remove_elsewhere()
                return
        try:
            if self._elsewhere is None:
                self._elsewhere = Path(tempfile.mkdtemp(prefix="airrace-")) / "unsaved.yaml"
            replace_file(self._elsewhere, text.encode())
            self.path = self._elsewhere
        except (OSError, StorageError) as error:
            self.problem += f"; {error}"

    def remove(self) -> None:
        """Remove the text: it is saved, or discarded."""
        self.path, self.problem, self.left = None, "", None
        self._remove_elsewhere()
        if self._obstacle:
            return
        try:
            self.beside.unlink(missing_ok=True)
        except OSError as error:
            if self._is_taken():
                self.problem = f"cannot remove {self.beside}: {error.strerror}"

    def _is_taken(self) -> bool:
        try:
            return self.beside.is_symlink() or self.beside.exists()
        except OSError:  # a name that is too long, a folder that cannot be searched
            return False

    def _remove_elsewhere(self) -> None:
        if self._elsewhere is not None:
            with suppress(OSError):
                self._elsewhere.unlink(missing_ok=True)
                self._elsewhere.parent.rmdir()
                self._elsewhere = None
