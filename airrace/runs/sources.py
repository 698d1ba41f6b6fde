"""Flights as they are asked for: a file, and a stage of the run in it."""

from pathlib import Path

from airrace.errors import UsageError
from airrace.records import record


@record
class Named:
    """A flight as it was asked for: a file, and a stage or None for the last one."""

    path: Path
    stage: str | None

    @classmethod
    def of(cls, text: str) -> "Named":
        """Split `RUN.h5:STAGE`; a file whose name holds a colon comes first.

        Raises:
            UsageError: nothing stands behind the colon.
        """
        file, colon, stage = text.rpartition(":")
        named = colon and not Path(text).exists() and "/" not in stage and "\\" not in stage
        if named and not stage:
            raise UsageError(f"{text} names no stage behind the colon; leave the colon out for the last one")
        return cls(Path(file), stage) if named else cls(Path(text), None)
