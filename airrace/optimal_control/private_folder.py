"""A folder whose files are loaded as code, so that nobody but the user may have put them there."""

import os
import stat
from pathlib import Path

PRIVATE = 0o700
"""The mode of the folder: its owner reads, writes and enters it, and nobody else does."""

OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def is_private(path: Path) -> bool:
    """Return whether a file or folder exists, belongs to the user or to root, and nobody else may write to it.

    A file is asked for itself and for the folder that it lies in.
    """
    try:
        return _is_private(path) and (path.is_dir() or _is_private(path.parent))
    except OSError:
        return False


def make_private(folder: Path) -> None:
    """Make a folder, or take the right to write from all others if it exists and is the user's.

    Raises:
        OSError: the folder cannot be made or changed, or belongs to somebody else.
    """
    folder.mkdir(mode=PRIVATE, parents=True, exist_ok=True)
    if os.name != "posix" or _is_private(folder):
        return
    status = folder.stat()
    if status.st_uid != os.geteuid():
        raise PermissionError("it belongs to another user, who could put code there")
    folder.chmod(stat.S_IMODE(status.st_mode) & ~OTHERS_WRITE)


def _is_private(path: Path) -> bool:
    """Return whether one path is; on systems without owners and modes everything counts as private."""
    if os.name != "posix":
        return path.exists()
    status = path.stat()
    return status.st_uid in (0, os.geteuid()) and not status.st_mode & OTHERS_WRITE
