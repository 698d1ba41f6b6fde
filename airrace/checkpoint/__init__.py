"""Checkpoints: all that a run was given and found, in one HDF5 file, replaced atomically and read with distrust."""

from airrace.checkpoint.checkpoint import (
    Checkpoint,
    ReserveAttempt,
    StoredAttempt,
    StoredDocument,
    StoredInputs,
    StoredStage,
    inputs_hash,
    stale_stages,
)
from airrace.checkpoint.log_layout import LogCheckpoint, RawLog, StoredHistory, StoredPassing, StoredReceiver
from airrace.checkpoint.store import (
    read_checkpoint,
    read_stored,
    write_checkpoint,
    write_log,
)

__all__ = [
    "Checkpoint",
    "LogCheckpoint",
    "RawLog",
    "ReserveAttempt",
    "StoredAttempt",
    "StoredDocument",
    "StoredHistory",
    "StoredInputs",
    "StoredPassing",
    "StoredReceiver",
    "StoredStage",
    "inputs_hash",
    "read_checkpoint",
    "read_stored",
    "stale_stages",
    "write_checkpoint",
    "write_log",
]
