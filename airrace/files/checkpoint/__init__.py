"""Checkpoints: all of a run in one HDF5 file, which is replaced atomically and read by a validating reader."""

from airrace.files.checkpoint.checkpoint import (
    Checkpoint,
    ReserveAttempt,
    StoredAttempt,
    StoredDocument,
    StoredInputs,
    StoredStage,
    inputs_hash,
    stale_stages,
)
from airrace.files.checkpoint.log_layout import LogCheckpoint, RawLog, StoredPassing, StoredReceiver
from airrace.files.checkpoint.run_layout import StoredHistory
from airrace.files.checkpoint.store import (
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
