"""Atomic replacement of files.

Whatever happens, the name leads to the old content or to the new, never to a mixture.
"""

import contextlib
import errno
import logging
import os
import secrets
from pathlib import Path

from airrace.errors import StorageError
from airrace.standard_streams import STANDARD, write_stdout

logger = logging.getLogger(__name__)


def replace_file(path: Path, content: bytes) -> None:
    """Write `content` beside `path`, bring it to the disk, and rename it over `path`.

    A process killed in between leaves the old file and, beside it, `.NAME.XXXXXXXX.partial`, which nothing reads.

    Args:
        path: a regular file or a free name; a symbolic link is followed. `-` is stdout, which is only written to.
        content: the new content.

    Raises:
        StorageError: the system refused (disk full, no permission, not a regular file, ...). The old file is
            untouched and nothing is left beside it.
    """
    if path == STANDARD:
        return write_stdout(content)
    try:
        target = Path(os.path.realpath(path))  # resolve() raises an error of its own for a loop of links
        if target.is_symlink():
            raise OSError(errno.ELOOP, os.strerror(errno.ELOOP).lower())
        if target.exists() and not target.is_file():
            raise StorageError(f"cannot write {path}: it exists and is not a regular file")
        # Shortened, so that it stays a valid name where the target's is one.
        partial = target.with_name(f".{target.name[:40]}.{secrets.token_hex(4)}.partial")
        try:
            _write_durably(partial, content)
            os.replace(partial, target)
        finally:
            with contextlib.suppress(OSError):  # after the rename there is nothing left to remove
                partial.unlink()
        _flush_folder(target.parent)
        logger.info("%s is written, %d bytes", path, len(content))
    except OSError as error:
        raise StorageError(f"cannot write {path}: {error.strerror or error}") from error


def _write_durably(path: Path, content: bytes) -> None:
    with path.open("xb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def _flush_folder(folder: Path) -> None:
    """Flush the rename itself to the disk, where the system can do that for folders."""
    if os.name != "posix":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno != errno.EINVAL:  # some network file systems cannot; the rename stands nevertheless
            raise
    finally:
        os.close(descriptor)
