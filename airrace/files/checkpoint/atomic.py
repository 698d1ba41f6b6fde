"""Atomic replacement of files.

Whatever happens, the name leads to the old content or to the new, never to a mixture. The new content is written beside
the file, as `.NAME.XXXXXXXX.partial`, which its writer holds locked. What a killed writer leaves there is removed when
the file is next replaced. Who may read and write the file stays as it was.
"""

import contextlib
import errno
import logging
import os
import re
import secrets
import stat
import time
from collections.abc import Generator
from pathlib import Path
from typing import IO, BinaryIO, cast

from airrace.errors import StorageError
from airrace.runtime.standard_streams import STANDARD, write_stdout

logger = logging.getLogger(__name__)

try:
    import fcntl
except ModuleNotFoundError:  # Windows, which removes no file that a writer has open
    fcntl = None


def replace_file(path: Path, content: bytes) -> None:
    """Replace a file as a whole, see `replacing`; `-` is stdout."""
    if path == STANDARD:
        write_stdout(content)
        return
    with replacing(path) as file:
        file.write(content)


@contextlib.contextmanager
def replacing(path: Path) -> Generator[BinaryIO]:
    """Give a file to write the new content of `path` to, which is brought to the disk and renamed over `path`.

    Args:
        path: a regular file or a free name; a symbolic link is followed.

    Raises:
        StorageError: the system refused (disk full, no permission, not a regular file, ...). The old file is
            untouched and nothing is left beside it, as after any other error of the writer.
    """
    try:
        target = Path(os.path.realpath(path))  # resolve() raises an error of its own for a loop of links
        if target.is_symlink():
            raise OSError(errno.ELOOP, os.strerror(errno.ELOOP).lower())
        if target.exists() and not target.is_file():
            raise StorageError(f"cannot write {path}: it exists and is not a regular file")
        with contextlib.suppress(OSError):
            _remove_left_behind(target)
        partial, file = _opened_beside(target)
        try:
            with file:
                yield file
                file.flush()
                os.fsync(file.fileno())
                if fcntl:  # locked until it has its name
                    _rename(partial, target)
            if not fcntl:  # where no open file can be renamed
                _rename(partial, target)
        finally:
            with contextlib.suppress(OSError):  # after the rename there is nothing left to remove
                partial.unlink()
        _flush_folder(target.parent)
        logger.info("%s is written, %d bytes", path, target.stat().st_size)
    except OSError as error:
        raise StorageError(f"cannot write {path}: {error.strerror or error}") from error


def _opened_beside(target: Path) -> tuple[Path, BinaryIO]:
    """Return a new file beside another one, open and, where the file system has locks, locked.

    If the other one exists, the new one has its mode, before it has any content.
    """
    mode = stat.S_IMODE(target.stat().st_mode) & 0o777 if target.exists() else None

    def open_new(path: str, flags: int) -> int:
        return os.open(path, flags, 0o666 if mode is None else mode)

    while True:
        # Shortened, so that it stays a valid name where the target's is one.
        partial = target.with_name(f".{target.name[:40]}.{secrets.token_hex(4)}.partial")
        file = cast(BinaryIO, open(partial, "xb", opener=open_new))  # noqa: SIM115  # the caller closes it
        if mode is not None:
            with contextlib.suppress(OSError):  # on a file system without modes
                partial.chmod(mode)  # which the mask of this process may have narrowed
        try:
            _lock(file)
        except BlockingIOError:  # another process takes it for an orphan
            file.close()
            continue
        except OSError:  # no locks on this file system
            pass
        if partial.exists():  # it was not removed as an orphan before it was locked
            return partial, file
        file.close()


def _remove_left_behind(target: Path) -> None:
    """Remove what killed writers of a file have left beside it."""
    named = re.compile(rf"\.{re.escape(target.name[:40])}\.[0-9a-f]{{8}}\.partial")
    for partial in [target.with_name(name) for name in os.listdir(target.parent) if named.fullmatch(name)]:
        with contextlib.suppress(OSError):  # its writer lives, it is another user's, or it has got its name meanwhile
            with partial.open("rb") as file:
                _lock(file)
                if fcntl:
                    partial.unlink()
            if not fcntl:
                partial.unlink()


def _lock(file: IO[bytes]) -> None:
    """Lock a file until it is closed; nothing is done on Windows.

    Raises:
        OSError: another process has locked it, or there are no locks on this file system.
    """
    if fcntl:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _rename(partial: Path, target: Path) -> None:
    """Rename a file over another one; Windows refuses while that is being read, which takes a moment."""
    for pause in (0.01, 0.05, 0.2):  # s, after which a refused rename is tried again
        try:
            os.replace(partial, target)
        except PermissionError:
            time.sleep(pause)
        else:
            return
    os.replace(partial, target)


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
