"""The user block in front of the HDF5 image: it proves that the image is whole before anything interprets it.

HDF5's own reader can crash or hang on damaged bytes, so they never reach it. The block takes 512 bytes, the
smallest size HDF5 skips while it looks for its signature; any HDF5 program still opens the file.

    bytes    0-15  magic
            16-19  version of this block, unsigned
            20-27  length of the image in bytes, unsigned
            28-59  sha256 of the image
            60-511 zero
"""

import hashlib
import struct

from airrace.errors import CheckpointError

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
