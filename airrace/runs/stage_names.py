"""Stages by the names that users give them."""

from airrace.checkpoint import Checkpoint
from airrace.errors import UsageError
from airrace.procedure import run as procedure
from airrace.procedure.result import Stage, StageResult


def stage_named(text: str | None) -> Stage:
    """The stage a user names, the last available one by default.

    Raises:
        UsageError: no such stage, or not one that can be run.
    """
    stages = tuple(procedure.STAGES)
    if text is None:
        return stages[-1]
    for stage in stages:
        if stage.value == text:
            return stage
    available = ", ".join(stage.value for stage in stages)
    raise UsageError(f"there is no stage {text!r}; available: {available}")


def stored_result(checkpoint: Checkpoint, name: str | None) -> StageResult:
    """The stage a user names, the last stored one by default.

    Raises:
        UsageError: it is not in the checkpoint.
    """
    stored = {stage.result.stage.value: stage.result for stage in checkpoint.stages}
    if not stored:
        raise UsageError("no stage of this run is finished yet")
    if name is None:
        return list(stored.values())[-1]
    if name not in stored:
        raise UsageError(f"this run has no stage {name!r}; it has: {', '.join(stored)}")
    return stored[name]
