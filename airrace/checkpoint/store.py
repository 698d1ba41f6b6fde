"""Checkpoints and flown logs on the disk: the only functions that read and write them."""

import logging
import os
import stat
from collections.abc import Callable, Collection
from pathlib import Path
from typing import TypeVar

from airrace.checkpoint.atomic import replace_file
from airrace.checkpoint.checkpoint import Checkpoint
from airrace.checkpoint.decode import decode
from airrace.checkpoint.encode import encode
from airrace.checkpoint.envelope import BLOCK_SIZE, Sign, Signature, seal, unsealed
from airrace.checkpoint.hdf5_reader import tree_of
from airrace.checkpoint.hdf5_writer import image_of
from airrace.checkpoint.log_checkpoint import Recorded
from airrace.checkpoint.log_tree import decode_recorded, encode_recorded, is_recorded
from airrace.checkpoint.tree import Group
from airrace.errors import CheckpointError
from airrace.procedure.stage import Stage
from airrace.standard_streams import STANDARD, name_of, read_bytes

logger = logging.getLogger(__name__)

T = TypeVar("T")
SIZE_MAX = 256 * 1024 * 1024
"""The size of the largest checkpoint that is written or read, bytes."""


def write_checkpoint(
    path: Path, checkpoint: Checkpoint, sign: Sign | None = None, unchanged: Collection[Stage] = ()
) -> None:
    """Replace the file at `path`, at once and as a whole.

    What is about to be written is read back first: a good checkpoint never gives way to an unreadable one.

    Args:
        path: the file.
        checkpoint: its contents.
        sign: signs them; None for a file without a signature.
        unchanged: stages that are as they were last written or read; they are not read back.

    Raises:
        StorageError: the system refused; the old checkpoint survives.
        CheckpointError: these contents cannot be stored (a text with NUL, a trajectory that contradicts itself, or
            more than 256 MiB); the old checkpoint survives.
    """
    _write(path, encode(checkpoint), decode, sign, [f"/stages/{one.value}" for one in unchanged])


def write_recorded(path: Path, recorded: Recorded) -> None:
    """Replace the file at `path` by a flown log, at once and as a whole; errors as of `write_checkpoint`."""
    _write(path, encode_recorded(recorded), decode_recorded, None)


def read_checkpoint(path: Path) -> Checkpoint:
    """Return the checkpoint at `path`, verified; errors as of `read_sealed`."""
    return read_sealed(path)[0]


def read_sealed(path: Path) -> tuple[Checkpoint, Signature | None]:
    """Return the checkpoint at `path`, and the signature that the file carries, which is not examined.

    Raises:
        CheckpointError: there is no such file, or it is not a whole, undamaged checkpoint of this schema.
    """
    return _read(path, decode)


def read_stored(path: Path) -> Checkpoint | Recorded:
    """Return the run or the flown log at `path`, verified; errors as of `read_checkpoint`."""
    return _read(path, lambda root: decode_recorded(root) if is_recorded(root) else decode(root))[0]


def _write(
    path: Path,
    root: Group,
    understood: Callable[[Group], object],
    sign: Sign | None,
    without: Collection[str] = (),
) -> None:
    image = image_of(root)
    if BLOCK_SIZE + len(image) > SIZE_MAX:
        raise CheckpointError(f"the checkpoint would be larger than {SIZE_MAX // 2**20} MiB: it cannot be stored")
    understood(tree_of(image, without))
    replace_file(path, seal(image, sign))


def _read(path: Path, understood: Callable[[Group], T]) -> tuple[T, Signature | None]:
    try:
        image, signature = unsealed(_content(path))
        logger.info("%s is read", name_of(path))
        return understood(tree_of(image)), signature
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
