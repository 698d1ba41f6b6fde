"""Stages by the names that users give them."""

from airrace.errors import UsageError
from airrace.procedure import run as procedure
from airrace.procedure.result import Stage


def stage_named(text: str | None) -> Stage:
    """Return the stage that a user names, by default the last available one.

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
