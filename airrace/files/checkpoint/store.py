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
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from airrace.errors import CheckpointError
from airrace.files.checkpoint.atomic import replace_file
from airrace.files.checkpoint.checkpoint import Checkpoint
from airrace.files.checkpoint.codec import Codec
from airrace.files.checkpoint.hdf5 import Attribute, open_image
from airrace.files.checkpoint.log_layout import FLIGHT_LOG, LOG_LAYOUTS, LOG_SCHEMA, LogCheckpoint
from airrace.files.checkpoint.run_layout import LAYOUTS, OTHER_SCHEMA, SCHEMA
from airrace.runtime.standard_streams import STANDARD, name_of, read_bytes

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

CODEC = Codec(LAYOUTS | LOG_LAYOUTS)
CONTENT = "content"
"""The attribute of flight logs that runs do not have."""
SIZE_MAX = 256 * 1024 * 1024
"""The size of the largest checkpoint that is written or read, bytes."""


def write_checkpoint(path: Path, checkpoint: Checkpoint, before: Checkpoint | None = None) -> None:
    """Replace the file at `path`, at once and as a whole.

    What is about to be written is read back first: a good checkpoint never gives way to an unreadable one.

    Args:
        path: the file.
        checkpoint: its new contents.
        before: what it holds already, if that is known: stages of this are not read back a second time.

    Raises:
        StorageError: the system refused; the old checkpoint survives.
        CheckpointError: these contents cannot be stored (a text with NUL, a trajectory that contradicts itself, or
            more than 256 MiB); the old checkpoint survives.
    """
    attributes: Mapping[str, Attribute] = {"schema": SCHEMA}
    image = CODEC.image_of(checkpoint, attributes)
    new = image
    if before is not None:  # reading takes longer than writing, and every stage is written again after each stage
        readable = {id(stored) for stored in before.stages}
        stages = tuple(stored for stored in checkpoint.stages if id(stored) not in readable)
        new = CODEC.image_of(replace(checkpoint, stages=stages), attributes)
    _write(path, image, read_back=new)


def write_log(path: Path, recorded: LogCheckpoint) -> None:
    """Replace the file at `path` by a flight log, at once and as a whole; errors as of `write_checkpoint`."""
    image = CODEC.image_of(recorded, {CONTENT: FLIGHT_LOG, "schema": LOG_SCHEMA})
    _write(path, image, read_back=image)


def read_checkpoint(path: Path) -> Checkpoint:
    """Return the checkpoint at `path`.

    Raises:
        CheckpointError: there is no such file, or it is not a whole, undamaged checkpoint of this schema.
    """
    stored = read_stored(path)
    if isinstance(stored, LogCheckpoint):
        words = "this is a flight log, not a run; show, report, compare, plot and export take it"
        raise CheckpointError(f"{name_of(path)}: {words}")
    return stored


def read_stored(path: Path) -> Checkpoint | LogCheckpoint:
    """Return the run or the flight log at `path`; errors as of `read_checkpoint`."""
    try:
        image = unseal(_content(path))
        logger.info("%s is read", name_of(path))
        return _decode(image)
    except FileNotFoundError as error:
        raise CheckpointError(f"there is no checkpoint {path}") from error
    except OSError as error:
        reason = error.strerror or str(error)
        raise CheckpointError(f"the checkpoint {path} cannot be read: {reason[:1].lower()}{reason[1:]}") from error
    except CheckpointError as error:
        raise CheckpointError(f"{name_of(path)}: {error}") from error


def _write(path: Path, image: bytes, *, read_back: bytes) -> None:
    if BLOCK_SIZE + len(image) > SIZE_MAX:
        raise CheckpointError(f"the checkpoint would be larger than {SIZE_MAX // 2**20} MiB: it cannot be stored")
    _decode(read_back)
    replace_file(path, seal(image))


def _decode(image: bytes) -> Checkpoint | LogCheckpoint:
    with open_image(image) as root:
        attributes = root.attributes({CONTENT: str, "schema": int})
        is_log, schema = CONTENT in attributes, attributes.get("schema")
        if is_log and attributes != {CONTENT: FLIGHT_LOG, "schema": LOG_SCHEMA}:
            content = f"a {attributes[CONTENT]} of schema {schema}"
            raise CheckpointError(
                f"the file holds {content[:80]}; this airrace reads schema {LOG_SCHEMA} of a {FLIGHT_LOG}"
            )
        if not is_log and schema != SCHEMA:
            raise CheckpointError(
                f"the checkpoint's schema is {schema}; this airrace reads schema {SCHEMA} alone. {OTHER_SCHEMA}"
            )
        return CODEC.read(root, LogCheckpoint if is_log else Checkpoint)


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
