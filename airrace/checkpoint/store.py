"""Files of runs and logs, written and read: an HDF5 image, and a user block in front that proves that it is whole.

HDF5's own reader can crash or hang on damaged bytes, so they never reach it. The block takes 512 bytes, the
smallest size HDF5 skips while it looks for its signature; any HDF5 program still opens the file.

    bytes    0-15  magic
            16-19  version of this block, unsigned
            20-27  length of the image in bytes, unsigned
            28-59  sha256 of the image
            60-511 zero
"""

import hashlib
import logging
import os
import stat
import struct
from collections.abc import Callable, Collection
from pathlib import Path
from typing import TypeVar

from airrace.checkpoint.atomic import replace_file
from airrace.checkpoint.checkpoint import Checkpoint
from airrace.checkpoint.hdf5 import Group, image_of, tree_of
from airrace.checkpoint.log_layout import LogCheckpoint, decode_log, encode_log, is_log_checkpoint
from airrace.checkpoint.run_layout import decode, encode
from airrace.errors import CheckpointError
from airrace.procedure.stage import Stage
from airrace.standard_streams import STANDARD, name_of, read_bytes

BLOCK_SIZE = 512
"""The size of the user block, bytes."""
# As in PNG, a byte above 127, both line ends and an end-of-file reveal a file that was transferred as text.
MAGIC = b"\x8bairrace\r\n\x1a\nrun\n"
VERSION = 1
"""The version of the user block."""
_HEADER = struct.Struct("<16sIQ32s")


def seal(image: bytes) -> bytes:
    """Return the image behind its user block."""
    header = _HEADER.pack(MAGIC, VERSION, len(image), hashlib.sha256(image).digest())
    return header.ljust(BLOCK_SIZE, b"\0") + image


def unseal(content: bytes) -> bytes:
    """Return the image of a sealed file.

    Raises:
        CheckpointError: the content is no checkpoint, of another version, truncated, too long, or altered.
    """
    if len(content) < BLOCK_SIZE:
        raise CheckpointError(f"not a whole airrace checkpoint: only {len(content)} bytes long")
    block, image = content[:BLOCK_SIZE], content[BLOCK_SIZE:]
    magic, version, length, checksum = _HEADER.unpack_from(block)
    if magic != MAGIC:
        raise CheckpointError("not an airrace checkpoint: the first bytes are not those of one")
    if version != VERSION:
        raise CheckpointError(f"the checkpoint's format is {version}; this airrace reads format {VERSION}")
    if length != len(image):
        raise CheckpointError(f"the checkpoint is damaged: {len(image)} bytes where {length} were written")
    if any(block[_HEADER.size :]) or checksum != hashlib.sha256(image).digest():
        raise CheckpointError("the checkpoint is damaged: its checksum does not match its content")
    return image


logger = logging.getLogger(__name__)

T = TypeVar("T")
SIZE_MAX = 256 * 1024 * 1024
"""The size of the largest checkpoint that is written or read, bytes."""


def write_checkpoint(path: Path, checkpoint: Checkpoint, unchanged: Collection[Stage] = ()) -> None:
    """Replace the file at `path`, at once and as a whole.

    What is about to be written is read back first: a good checkpoint never gives way to an unreadable one.

    Args:
        path: the file.
        checkpoint: its contents.
        unchanged: stages that are as they were last written or read; they are not read back.

    Raises:
        StorageError: the system refused; the old checkpoint survives.
        CheckpointError: these contents cannot be stored (a text with NUL, a trajectory that contradicts itself, or
            more than 256 MiB); the old checkpoint survives.
    """
    _write(path, encode(checkpoint), decode, [f"/stages/{one.value}" for one in unchanged])


def write_log(path: Path, recorded: LogCheckpoint) -> None:
    """Replace the file at `path` by a flight log, at once and as a whole; errors as of `write_checkpoint`."""
    _write(path, encode_log(recorded), decode_log)


def read_checkpoint(path: Path) -> Checkpoint:
    """Return the checkpoint at `path`.

    Raises:
        CheckpointError: there is no such file, or it is not a whole, undamaged checkpoint of this schema.
    """
    return _read(path, decode)


def read_stored(path: Path) -> Checkpoint | LogCheckpoint:
    """Return the run or the flight log at `path`; errors as of `read_checkpoint`."""
    return _read(path, lambda root: decode_log(root) if is_log_checkpoint(root) else decode(root))


def _write(
    path: Path,
    root: Group,
    understood: Callable[[Group], object],
    without: Collection[str] = (),
) -> None:
    image = image_of(root)
    if BLOCK_SIZE + len(image) > SIZE_MAX:
        raise CheckpointError(f"the checkpoint would be larger than {SIZE_MAX // 2**20} MiB: it cannot be stored")
    understood(tree_of(image, without))
    replace_file(path, seal(image))


def _read(path: Path, understood: Callable[[Group], T]) -> T:
    try:
        image = unseal(_content(path))
        logger.info("%s is read", name_of(path))
        return understood(tree_of(image))
    except FileNotFoundError as error:
        raise CheckpointError(f"there is no checkpoint {path}") from error
    except OSError as error:
        reason = error.strerror or str(error)
        raise CheckpointError(f"the checkpoint {path} cannot be read: {reason[:1].lower()}{reason[1:]}") from error
    except CheckpointError as error:
        raise CheckpointError(f"{name_of(path)}: {error}") from error


def _content(path: Path) -> bytes:
    if path == STANDARD:
        return read_bytes(path, SIZE_MAX)
    # A named pipe without a writer would block a plain open.
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    with open(descriptor, "rb") as file:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode):
            raise CheckpointError("not a regular file")
        if status.st_size > SIZE_MAX:
            raise CheckpointError(f"larger than {SIZE_MAX // 2**20} MiB: not a checkpoint")
        return file.read(SIZE_MAX)
