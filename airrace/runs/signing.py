"""Signatures of checkpoints with a key of the user's own: Ed25519 [RFC 8032], by the package `cryptography`.

A signature tells that the very bytes of a file are as the owner of a key has written them. Keys are those of OpenSSH
(`ssh-keygen -t ed25519`) or in PEM, as OpenSSL writes them. The package is imported only where a signature is asked
for.
"""

import base64
import functools
import hashlib
import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from airrace.checkpoint import Signature, read_sealed
from airrace.errors import CheckpointError, UsageError
from airrace.resources import extra

logger = logging.getLogger(__name__)

LARGEST = 1 << 16
"""The size of the largest file that is taken for a key, bytes."""


@dataclass(frozen=True)
class Signer:
    """A private key that signs.

    Attributes:
        key: the public key that belongs to it.
        sign: the signature of a text.
    """

    key: bytes
    sign: Callable[[bytes], bytes]

    @property
    def fingerprint(self) -> str:
        """The fingerprint of the key, as OpenSSH prints it."""
        return fingerprint(self.key)

    def __call__(self, text: bytes) -> Signature:
        """Return the signature of a text."""
        return Signature(self.key, text, self.sign(text))


def signer_of(path: Path) -> Signer:
    """Return the signer with the private key in a file.

    Raises:
        UsageError: `cryptography` is not installed, or the file holds no private key of Ed25519 without a passphrase.
    """
    keys, kinds = _package("serialization"), _package("asymmetric.ed25519")
    loaders = (keys.load_ssh_private_key, keys.load_pem_private_key)
    key = _load_key(path, "private", [functools.partial(load, password=None) for load in loaders])
    if not isinstance(key, kinds.Ed25519PrivateKey):
        raise UsageError(f"the key {path} is of another kind than Ed25519: make one with ssh-keygen -t ed25519")
    return Signer(key.public_key().public_bytes_raw(), key.sign)


def ensure_signed(run_file: Path, signature: Signature | None, trusted: Path) -> str:
    """Refuse a file that is not signed with a key that is trusted.

    Args:
        run_file: the checkpoint, for the message.
        signature: what it carries; None without one.
        trusted: the file of the public key.

    Returns:
        The fingerprint of the key.

    Raises:
        UsageError: `cryptography` is not installed, or the file holds no public key of Ed25519.
        CheckpointError: there is no signature, it is another key's, or it does not belong to the content.
    """
    keys, kinds = _package("serialization"), _package("asymmetric.ed25519")
    key = _load_key(trusted, "public", [keys.load_ssh_public_key, keys.load_pem_public_key])
    if not isinstance(key, kinds.Ed25519PublicKey):
        raise UsageError(f"the key {trusted} is of another kind than Ed25519: make one with ssh-keygen -t ed25519")
    if signature is None:
        raise CheckpointError(f"{run_file} is not signed")
    if signature.key != key.public_bytes_raw():
        raise CheckpointError(f"{run_file} is signed with another key, {fingerprint(signature.key)}")
    return _ensure_whole(run_file, signature)


def signed_by(run_file: Path) -> str:
    """Return the fingerprint of the key with which a checkpoint is signed; empty where it is not.

    Raises:
        UsageError: it is, and `cryptography` is not installed.
        CheckpointError: the signature does not belong to its content.
    """
    signature = read_sealed(run_file)[1]
    return "" if signature is None else _ensure_whole(run_file, signature)


def _ensure_whole(run_file: Path, signature: Signature) -> str:
    """Return the fingerprint of the key of a signature that belongs to the content of the file; else refuse it."""
    kinds = _package("asymmetric.ed25519")
    try:
        kinds.Ed25519PublicKey.from_public_bytes(signature.key).verify(signature.signature, signature.text)
    except extra("cryptography.exceptions", "a signature", "sign").InvalidSignature as error:
        raise CheckpointError(f"{run_file}: the signature does not belong to the content of the file") from error
    return fingerprint(signature.key)


def ensure_own(run_file: Path, signer: Signer | None) -> None:
    """Refuse to sign what somebody else has written, and warn where a signature will be gone.

    Args:
        run_file: the checkpoint that is to be continued.
        signer: signs what it becomes; None if nobody does.

    Raises:
        CheckpointError: its stages were not signed with the same key.
    """
    signature = read_sealed(run_file)[1]
    if signer is None:
        if signature is not None:
            logger.warning("%s was signed; without --sign what it becomes is not", run_file)
        return
    if signature is None or signature.key != signer.key or signer.sign(signature.text) != signature.signature:
        raise CheckpointError(
            f"{run_file} is not signed with this key, so it is not signed when it is continued: "
            f"`airrace verify {run_file} --sign KEY` signs it if it is verified"
        )


def fingerprint(key: bytes) -> str:
    """Return the fingerprint of a public key of Ed25519, as `ssh-keygen -l` prints it."""
    kind = b"ssh-ed25519"
    blob = b"".join(len(part).to_bytes(4, "big") + part for part in (kind, key))
    return "SHA256:" + base64.b64encode(hashlib.sha256(blob).digest()).decode().rstrip("=")


def _package(name: str) -> Any:  # Any: without the package there are no types
    return extra(f"cryptography.hazmat.primitives.{name}", "a signature", "sign")


def _load_key(path: Path, kind: str, loaders: Sequence[Callable[[bytes], Any]]) -> Any:  # Any: a key, of no known type
    """Return the key in a file, by the first loader that understands it.

    Raises:
        UsageError: the file cannot be read, or no loader understands it.
    """
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST)
    except OSError as error:
        raise UsageError(f"the {kind} key {path} cannot be read: {error.strerror or error}") from error
    refused = extra("cryptography.exceptions", "a signature", "sign").UnsupportedAlgorithm
    for load in loaders:
        try:
            return load(content)
        except TypeError as error:  # a password is needed
            raise UsageError(f"the {kind} key {path} has a passphrase, which airrace does not ask for") from error
        except (ValueError, refused):
            continue
    raise UsageError(f"{path} holds no {kind} key that can be read: expected one of Ed25519, of OpenSSH or in PEM")
