"""The user block in front of the HDF5 image: it proves that the image is whole before anything interprets it.

HDF5's own reader can crash or hang on damaged bytes, so they never reach it. The block takes 512 bytes, the
smallest size HDF5 skips while it looks for its signature; any HDF5 program still opens the file.

    bytes    0-15  magic
            16-19  version of this block, unsigned
            20-27  length of the image in bytes, unsigned
            28-59  sha256 of the image, followed by bytes 60-155 where it is signed
            60-91  public key of the signature; zero where there is none
            92-155 signature of `signed_text(image)`; zero where there is none
           156-511 zero

Anyone can compute a checksum. Who has signed an image, with a key that nobody else has, is told by the signature; this
module only carries it.
"""

import hashlib
import struct
from collections.abc import Callable

from airrace.errors import CheckpointError
from airrace.records import record

BLOCK_SIZE = 512
"""The size of the user block, bytes."""
# As in PNG, a byte above 127, both line ends and an end-of-file reveal a file that was transferred as text.
MAGIC = b"\x8bairrace\r\n\x1a\nrun\n"
VERSION = 1
"""The version of the user block."""
KEY_SIZE, SIGNATURE_SIZE = 32, 64
"""The sizes of a public key and of a signature of Ed25519 [RFC 8032], bytes."""
_HEADER = struct.Struct("<16sIQ32s")
_SIGNED = struct.Struct(f"{KEY_SIZE}s{SIGNATURE_SIZE}s")


@record
class Signature:
    """A signature: the public key of whoever claims to have signed, what was signed, and the signature itself."""

    key: bytes
    text: bytes
    signature: bytes


Sign = Callable[[bytes], Signature]
"""A way to sign a text."""


def signed_text(image: bytes) -> bytes:
    """Return what is signed of an image: its sha256, after words that no other signature begins with."""
    return b"airrace checkpoint\0" + hashlib.sha256(image).digest()


def seal(image: bytes, sign: Sign | None = None) -> bytes:
    """Return the image behind its user block, signed if somebody signs."""
    signed = b""
    if sign is not None:
        signature = sign(signed_text(image))
        signed = _SIGNED.pack(signature.key, signature.signature)
    header = _HEADER.pack(MAGIC, VERSION, len(image), hashlib.sha256(image + signed).digest())
    return (header + signed).ljust(BLOCK_SIZE, b"\0") + image


def unseal(content: bytes) -> bytes:
    """Return the image of a sealed file; errors as of `unsealed`."""
    return unsealed(content)[0]


def unsealed(content: bytes) -> tuple[bytes, Signature | None]:
    """Return the image of a sealed file, and the signature that it carries, which is not examined.

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
    signed, rest = block[_HEADER.size : _HEADER.size + _SIGNED.size], block[_HEADER.size + _SIGNED.size :]
    signed = signed if any(signed) else b""
    if any(rest) or checksum != hashlib.sha256(image + signed).digest():
        raise CheckpointError("the checkpoint is damaged: its checksum does not match its content")
    if not signed:
        return image, None
    key, signature = _SIGNED.unpack(signed)
    return image, Signature(key, signed_text(image), signature)
