"""Checkpoints: all that a run was given and found, in one HDF5 file, replaced atomically and read with distrust."""

from airrace.checkpoint.checkpoint import (
    Checkpoint,
    StoredDocument,
    StoredInputs,
    StoredStage,
    inputs_hash,
    stale_stages,
)
from airrace.checkpoint.envelope import Sign, Signature
from airrace.checkpoint.store import read_checkpoint, read_sealed, write_checkpoint

__all__ = [
    "Checkpoint",
    "Sign",
    "Signature",
    "StoredDocument",
    "StoredInputs",
    "StoredStage",
    "inputs_hash",
    "read_checkpoint",
    "read_sealed",
    "stale_stages",
    "write_checkpoint",
]
